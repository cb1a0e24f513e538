//! A folder with a daemon, a controller and a live view.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use dynocar::config::DaemonConfig;
use dynocar_client::{Host, Peer, Role, SamplePublisher, monotonic_now_ns};
use dynocar_shared::{SampleField, TrainId, TrainSample};
use rustix::process::{Pid, Signal, kill_process};

pub const PROGRAM: &str = env!("CARGO_BIN_EXE_dynocar-live");
pub const TRAIN: TrainId = TrainId(1);
const TRAIN_FILE: &str = "[train]\nname = \"t\"\nmass_t = 200.0\nlength_m = 120.0\ncars = 6\n\
     rotating_mass_factor = 0.08\n[resistance]\na = 1.9\nb = 0.03\nc = 0.0043\n";
/// How long a test waits for what must happen before it calls it a hang.
pub const WATCHDOG: Duration = Duration::from_secs(60);

pub fn await_true(what: &str, mut condition: impl FnMut() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < WATCHDOG, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A folder with a run-time directory and a daemon's configuration.
pub struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("train.toml"), TRAIN_FILE).unwrap();
        let place = Place { folder };
        let config = format!(
            "[daemon]\nroot = {:?}\nidle = \"event\"\n[[trains]]\nid = 1\nfile = \"train.toml\"\n\
             [[pipelines]]\nkind = \"mass_kalman\"\n",
            place.at("root")
        );
        std::fs::write(place.at("daemon.toml"), config).unwrap();
        place
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn host(&self) -> Host {
        Host::at(&self.at("root")).unwrap()
    }

    /// Starts a daemon of this process, and waits until it is seen.
    pub fn daemon(&self) {
        let config = DaemonConfig::load(&self.at("daemon.toml")).unwrap();
        std::thread::spawn(move || dynocar::run::run(&config).unwrap());
        let host = self.host();
        await_true("the daemon", || {
            !matches!(Peer::look_up(&host, TRAIN, Role::Daemon), Ok(Peer::Absent))
        });
    }

    /// Starts a live view on a free port, and waits until it serves.
    pub fn live(&self, options: &[&str]) -> Live {
        let mut process = Command::new(PROGRAM)
            .args(["--port", "0", "--root"])
            .arg(self.at("root"))
            .args(options)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let told = Arc::new(Mutex::new(String::new()));
        let listening = Arc::clone(&told);
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                *listening.lock().unwrap() += &(line + "\n");
            }
        });
        let mut live = Live { process, told, port: 0 };
        live.await_told("serving ws://127.0.0.1:");
        let told = live.told();
        let address = told.split("ws://127.0.0.1:").nth(1).unwrap();
        live.port = address.split(';').next().unwrap().parse().unwrap();
        live
    }
}

/// A live view; killed when it is dropped.
pub struct Live {
    process: Child,
    told: Arc<Mutex<String>>,
    pub port: u16,
}

impl Live {
    pub fn told(&self) -> String {
        self.told.lock().unwrap().clone()
    }

    pub fn await_told(&self, words: &str) {
        await_true(words, || self.told().contains(words));
    }

    /// Asks it to end, and gives its exit status.
    pub fn interrupt(&mut self) -> Option<i32> {
        let id = Pid::from_raw(self.process.id() as i32).unwrap();
        kill_process(id, Signal::INT).unwrap();
        let mut status = None;
        await_true("the end", || {
            status = self.process.try_wait().unwrap();
            status.is_some()
        });
        status.unwrap().code()
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // One that has ended is not there to be killed.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Publishes until it is dropped.
pub struct Controller {
    published: Arc<Mutex<Vec<TrainSample>>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Controller {
    /// Publishes so many samples every 2 ms.
    pub fn start(place: &Place, at_once: usize) -> Self {
        let published = Arc::new(Mutex::new(Vec::new()));
        let stop = Arc::new(AtomicBool::new(false));
        let (done, ends, host) = (Arc::clone(&published), Arc::clone(&stop), place.host());
        let thread = std::thread::spawn(move || {
            let mut publisher = SamplePublisher::open(&host, TRAIN).unwrap();
            while !ends.load(Ordering::Relaxed) {
                for _ in 0..at_once {
                    let time_ns = monotonic_now_ns();
                    let phase = time_ns as f64 * 1e-9 / 60.0 * std::f64::consts::TAU;
                    let mut sample = TrainSample::empty(TRAIN)
                        .with(SampleField::Speed, 20.0 - 10.0 * phase.cos())
                        .with(SampleField::TractionForce, 50_000.0)
                        .with(SampleField::BrakeForce, 0.0);
                    sample.time_ns = time_ns;
                    publisher.publish(&mut sample).unwrap();
                    done.lock().unwrap().push(sample);
                }
                std::thread::sleep(Duration::from_millis(2));
            }
        });
        Controller { published, stop, thread: Some(thread) }
    }

    /// The sample of this number.
    pub fn sample(&self, sequence: u64) -> TrainSample {
        let found = |it: &&TrainSample| it.sequence == sequence;
        let mut sample = None;
        // It is noted down only after it was published.
        await_true("the sample to be noted down", || {
            sample = self.published.lock().unwrap().iter().find(found).copied();
            sample.is_some()
        });
        sample.unwrap()
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
