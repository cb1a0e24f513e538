//! A folder with a daemon and a controller, for programs that read their channels.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use dynocar::config::DaemonConfig;
use dynocar_client::SamplePublisher;
use dynocar_shared::{SampleField, TrainId, TrainSample};
use dynocar_transport::{Host, Peer, Role, monotonic_now_ns};

pub const TRAIN: TrainId = TrainId(1);
const TRAIN_FILE: &str = "[train]\nname = \"t\"\nmass_t = 200.0\nlength_m = 120.0\ncars = 6\n\
     rotating_mass_factor = 0.08\n[resistance]\na = 1.9\nb = 0.03\nc = 0.0043\n";
/// How long a test waits for an event that must happen before it calls it a hang.
pub const WATCHDOG: Duration = Duration::from_secs(60);

pub fn await_true(what: &str, mut condition: impl FnMut() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < WATCHDOG, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A folder with a run-time directory and a daemon's configuration.
pub struct TestSite {
    folder: tempfile::TempDir,
}

impl TestSite {
    /// For a train with pipelines of these kinds.
    pub fn new(kinds: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("train.toml"), TRAIN_FILE).unwrap();
        let site = TestSite { folder };
        let pipelines = kinds.iter().map(|kind| format!("[[pipelines]]\nkind = \"{kind}\"\n"));
        let config = format!(
            "[daemon]\nroot = {:?}\nidle = \"event\"\n[state]\nkeep = false\n[[trains]]\nid = 1\nfile = \"train.toml\"\n{}",
            site.at("root"),
            pipelines.collect::<String>()
        );
        std::fs::write(site.at("daemon.toml"), config).unwrap();
        site
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn host(&self) -> Host {
        Host::at(&self.at("root")).unwrap()
    }

    /// Starts a daemon of this process, and waits until it is seen.
    pub fn daemon(&self) -> JoinHandle<()> {
        let config = DaemonConfig::load(&self.at("daemon.toml")).unwrap();
        let daemon = std::thread::spawn(move || dynocar::run::run(&config).unwrap());
        let host = self.host();
        await_true("the daemon", || {
            !matches!(Peer::look_up(&host, TRAIN, Role::Daemon), Ok(Peer::Absent))
        });
        daemon
    }
}

/// Publishes until it is dropped.
pub struct Controller {
    published: Arc<Mutex<Vec<TrainSample>>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Controller {
    /// Publishes `at_once` samples every 2 ms.
    pub fn start(site: &TestSite, at_once: usize) -> Self {
        let published = Arc::new(Mutex::new(Vec::new()));
        let stop = Arc::new(AtomicBool::new(false));
        let (done, ends, host) = (Arc::clone(&published), Arc::clone(&stop), site.host());
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

    /// Returns the published samples; a sample is added only after its publication.
    pub fn published(&self) -> MutexGuard<'_, Vec<TrainSample>> {
        self.published.lock().unwrap()
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
