//! The recorder as a process beside a controller and a daemon: killed, asked to end, out of disk.

use std::io::Read;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use dynocar::config::DaemonConfig;
use dynocar_client::channel::Transport;
use dynocar_client::{Host, Peer, Role, SamplePublisher, monotonic_now_ns};
use dynocar_recording::event::EventKind;
use dynocar_recording::reading::{Ending, read};
use dynocar_recording::recording::Recording;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{ParameterSnapshot, PipelineKind, SampleField, TrainId, TrainSample};
use rustix::process::{Pid, Signal, kill_process};

const PROGRAM: &str = env!("CARGO_BIN_EXE_dynocar-recording");
const TRAIN: TrainId = TrainId(1);
const TRAIN_FILE: &str = "[train]\nname = \"t\"\nmass_t = 200.0\nlength_m = 120.0\ncars = 6\n\
     rotating_mass_factor = 0.08\n[resistance]\na = 1.9\nb = 0.03\nc = 0.0043\n";
/// How long a test waits for what must happen before it calls it a hang.
const WATCHDOG: Duration = Duration::from_secs(60);

fn await_true(what: &str, mut condition: impl FnMut() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < WATCHDOG, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A folder with a run-time directory and a daemon's configuration.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("train.toml"), TRAIN_FILE).unwrap();
        let place = Place { folder };
        let config = format!(
            "[daemon]\nroot = {:?}\nidle = \"event\"\n[[trains]]\nid = 1\nfile = \"train.toml\"\n\
             [[pipelines]]\nkind = \"mass_kalman\"\n[[pipelines]]\nkind = \"v_mils\"\n",
            place.at("root")
        );
        std::fs::write(place.at("daemon.toml"), config).unwrap();
        place
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn host(&self) -> Host {
        Host::at(&self.at("root")).unwrap()
    }

    /// Starts the recorder and waits until its channels are open.
    fn recorder(&self) -> Child {
        self.started(&["record", "-o"], "run.mcap")
    }

    /// Starts a recorder that writes to a place, and waits until its channels are open.
    fn started(&self, command: &[&str], to: &str) -> Child {
        let mut recorder = Command::new(PROGRAM)
            .args(command)
            .arg(self.at(to))
            .args(["--train", "1", "--snapshots-ms", "20", "--root"])
            .arg(self.at("root"))
            .arg("--config")
            .arg(self.at("daemon.toml"))
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut told = [0; 14];
        recorder.stderr.as_mut().unwrap().read_exact(&mut told).unwrap();
        assert_eq!(&told, b"recording into");
        recorder
    }

    /// Starts a daemon of this process, and waits until it is seen.
    fn daemon(&self) -> JoinHandle<()> {
        let config = DaemonConfig::load(&self.at("daemon.toml")).unwrap();
        let daemon = std::thread::spawn(move || dynocar::run::run(&config).unwrap());
        let host = self.host();
        await_true("the daemon", || {
            !matches!(Peer::look_up(&host, TRAIN, Role::Daemon), Ok(Peer::Absent))
        });
        daemon
    }

    /// What can be read by now.
    fn recording(&self) -> Recording {
        let mut recording = Recording::default();
        read(&self.at("run.mcap"), &mut recording).unwrap();
        recording
    }

    fn await_recorded(&self, sequence: u64) {
        let newest = || self.recording().samples.last().map_or(0, |it| it.sequence);
        await_true("a sample in the file", || newest() >= sequence);
    }

    fn count(&self, kind: EventKind) -> usize {
        self.recording().events.iter().filter(|it| it.kind == kind as i32).count()
    }
}

/// Publishes at 500 Hz until it is dropped.
struct Controller {
    published: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Controller {
    fn start(place: &Place) -> Self {
        let (published, stop) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(false)));
        let (newest, ends, host) = (Arc::clone(&published), Arc::clone(&stop), place.host());
        let thread = std::thread::spawn(move || {
            let mut publisher = SamplePublisher::open(&host, TRAIN).unwrap();
            while !ends.load(Ordering::Relaxed) {
                let time_ns = monotonic_now_ns();
                let phase = time_ns as f64 * 1e-9 / 60.0 * std::f64::consts::TAU;
                let mut sample = TrainSample::empty(TRAIN)
                    .with(SampleField::Speed, 20.0 - 10.0 * phase.cos())
                    .with(SampleField::TractionForce, 50_000.0)
                    .with(SampleField::BrakeForce, 0.0);
                sample.time_ns = time_ns;
                newest.store(publisher.publish(&mut sample).unwrap(), Ordering::Relaxed);
                std::thread::sleep(Duration::from_millis(2));
            }
        });
        Controller { published, stop, thread: Some(thread) }
    }

    /// Waits until so many samples more are published, and gives the newest number.
    fn await_more(&self, count: u64) -> u64 {
        let newest = || self.published.load(Ordering::Relaxed);
        let start = newest();
        await_true("samples", || newest() >= start + count);
        newest()
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

fn run(arguments: &[&str], files: &[&Path]) -> Output {
    Command::new(PROGRAM).args(arguments).args(files).output().unwrap()
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned()
}

fn signal(process: u32, signal: Signal) {
    kill_process(Pid::from_raw(process as i32).unwrap(), signal).unwrap();
}

#[test]
fn a_recorder_outlives_daemons_and_controllers_and_what_is_killed_is_verified() {
    let place = Place::new();
    let mut recorder = place.recorder();
    for round in 1..=2 {
        let daemon = place.daemon();
        await_true("its coming in the file", || place.count(EventKind::DaemonCame) == round);
        let controller = Controller::start(&place);
        let published = controller.await_more(300);
        place.await_recorded(published);
        drop(controller);
        // Daemons of this process end when it is asked to.
        signal(std::process::id(), Signal::TERM);
        daemon.join().unwrap();
        await_true("its going in the file", || place.count(EventKind::DaemonGone) == round);
    }
    let newest = place.recording().samples.len();
    recorder.kill().unwrap();
    recorder.wait().unwrap();

    let left = Recording::load(&place.at("run.mcap")).unwrap();
    assert!(left.broken.is_some(), "it has no end");
    assert!(left.samples.len() >= newest);
    let attached: Vec<&str> = left.attachments.iter().map(|it| it.0.as_str()).collect();
    assert_eq!(attached, ["configuration-1/daemon.toml", "configuration-1/train-1.toml"]);
    let whole = place.at("whole.mcap");
    let recovered = run(&["recover", "-o"], &[&whole, &place.at("run.mcap")]);
    assert!(recovered.status.success() && words(&recovered).contains("lost of "));
    let mut again = Recording::default();
    assert_eq!(read(&whole, &mut again).unwrap(), Ending::Whole);
    assert_eq!((&again.samples, &again.snapshots), (&left.samples, &left.snapshots));

    let verified = run(&["verify", "--with"], &[&place.at("daemon.toml"), &whole]);
    let told = words(&verified);
    assert_eq!(told.matches("daemon of epoch").count(), 2, "{told}");
    assert!(told.contains("recorded configuration"), "{told}");
    // On a machine so busy that samples are lost, daemon and recorder did not take the same.
    let lost = left.snapshots.iter().any(|it| it.samples_lost > 0)
        || place.count(EventKind::SamplesLost) > 0;
    assert!(lost || verified.status.success(), "{told}");
    assert!(lost || !told.contains("cannot"), "{told}");
}

#[test]
fn a_recorder_that_is_asked_to_ends_whole() {
    let place = Place::new();
    let controller = Controller::start(&place);
    let mut recorder = place.recorder();
    controller.await_more(1);
    let published = controller.await_more(200);
    place.await_recorded(published);
    signal(recorder.id(), Signal::INT);
    assert!(recorder.wait().unwrap().success());
    let mut recording = Recording::default();
    assert_eq!(read(&place.at("run.mcap"), &mut recording).unwrap(), Ending::Whole);
    let kinds: Vec<i32> = recording.events.iter().map(|it| it.kind).collect();
    assert_eq!(kinds.first(), Some(&(EventKind::RecordingBegan as i32)));
    assert_eq!(kinds.last(), Some(&(EventKind::RecordingEnded as i32)));
    assert!(kinds.contains(&(EventKind::ControllerCame as i32)));
    let again = run(&["record", "-o"], &[&place.at("run.mcap")]);
    assert_eq!(again.status.code(), Some(2), "{}", words(&again));
}

#[test]
fn a_full_disk_ends_only_the_recorder_and_what_was_written_can_be_read() {
    let place = Place::new();
    let controller = Controller::start(&place);
    // A file may grow to 64 KiB, and writing on fails instead of killing: as on a full disk.
    let line = "trap '' XFSZ; ulimit -f 128; exec \"$0\" record --train 1 --root \"$1\" -o \"$2\"";
    let recorder = Command::new("sh")
        .args(["-c", line, PROGRAM])
        .args([place.at("root"), place.at("run.mcap")])
        .output()
        .unwrap();
    let told = words(&recorder);
    assert_eq!(recorder.status.code(), Some(1), "{told}");
    assert!(told.contains("run.mcap: cannot be written: File too large"), "{told}");
    assert!(place.recording().samples.len() > 50, "{told}");
    controller.await_more(100);
}

#[test]
fn a_flight_recorder_keeps_what_it_is_asked_to_whatever_ends_it() {
    let place = Place::new();
    let controller = Controller::start(&place);
    let ring = place.at("ring");
    let asked = || run(&["keep", "--reason", "a jerk"], &[&ring]);
    assert_eq!(asked().status.code(), Some(2), "no such folder");
    let mut recorder = place.started(&["flight-recorder"], "ring");
    controller.await_more(1);
    let begun = controller.await_more(100);
    let again = run(&["flight-recorder"], &[&ring]);
    assert_eq!(again.status.code(), Some(2), "{}", words(&again));
    assert!(words(&again).contains("another recorder"), "{}", words(&again));

    assert!(asked().status.success());
    let stretch = || {
        let folders = std::fs::read_dir(ring.join("kept")).into_iter().flatten().flatten();
        let named = folders.filter(|it| !it.file_name().to_string_lossy().starts_with('.'));
        named.map(|it| it.path()).find(|it| it.join("ring-000001.mcap").exists())
    };
    await_true("a stretch that is kept", || stretch().is_some());
    let kept = stretch().unwrap().join("ring-000001.mcap");
    let newest = || {
        let mut recording = Recording::default();
        read(&kept, &mut recording).unwrap();
        recording.samples.last().map_or(0, |it| it.sequence)
    };
    let after = controller.await_more(100);
    await_true("what came after in what is kept", || newest() >= after);
    recorder.kill().unwrap();
    recorder.wait().unwrap();
    // The ring goes round, or is cleared by hand.
    std::fs::remove_file(ring.join("ring-000001.mcap")).unwrap();
    let whole = place.at("whole.mcap");
    assert!(run(&["recover", "-o"], &[&whole, &kept]).status.success());
    let recording = Recording::load(&whole).unwrap();
    assert!(recording.samples.iter().any(|it| it.sequence <= begun), "from before it was asked");
    let text = std::fs::read_to_string(stretch().unwrap().join("stretch.toml")).unwrap();
    assert!(text.contains("keep_requested") && text.contains("a jerk"), "{text}");
    let late = asked();
    assert_eq!(late.status.code(), Some(1), "{}", words(&late));
    assert!(words(&late).contains("no flight recorder writes into it"), "{}", words(&late));
}

#[test]
fn a_closed_pipe_is_no_failure_and_a_full_disk_is_told_by_the_name_that_was_called() {
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    for name in ["dynocar-recording", "dynocar"] {
        for arguments in [&["fields"][..], &["--help"], &["record", "--help"]] {
            let mut command = Command::new(PROGRAM);
            command.arg0(name).args(arguments);
            let (_, closed) = std::io::pipe().unwrap();
            let output = command.stdout(closed).output().unwrap();
            assert_eq!((output.status.code(), words(&output)), (Some(0), String::new()));
            let output = command.stdout(full()).output().unwrap();
            let told =
                format!("{name}: standard output: cannot be written: No space left on device");
            assert!(words(&output).starts_with(&told), "{}", words(&output));
            assert_eq!(output.status.code(), Some(1));
        }
    }
}

#[test]
fn a_flight_recorder_keeps_what_lies_around_a_suspicion() {
    let place = Place::new();
    let controller = Controller::start(&place);
    // A daemon's end of the channel, with nothing but what is suspected behind it.
    let transport = Transport::open(&place.host(), "monitor").unwrap();
    let snapshots = transport.sender::<ParameterSnapshot>(TRAIN).unwrap();
    let mut snapshot = ParameterSnapshot::empty();
    (snapshot.train_id, snapshot.epoch) = (TRAIN.0, monotonic_now_ns() as u64);
    snapshot.pipeline_kind = PipelineKind::ResidualMonitor as u32;
    let mut recorder = place.started(&["flight-recorder"], "ring");
    controller.await_more(100);
    let ring = place.at("ring");
    let accounts = || {
        let folders = std::fs::read_dir(ring.join("kept")).into_iter().flatten().flatten();
        let texts = folders.map(|it| std::fs::read_to_string(it.path().join("stretch.toml")));
        texts.filter_map(Result::ok).collect::<String>()
    };
    for suspect in [EffectKind::None, EffectKind::DraggingBrake] {
        assert_eq!(accounts(), "", "nothing is suspected yet");
        (snapshot.suspected_effect, snapshot.suspicion_evidence) = (suspect as u32, 35.0);
        // A reader takes the newest, whenever it joined.
        for _ in 0..20 {
            snapshot.sequence += 1;
            snapshot.vouched_ns = monotonic_now_ns();
            snapshots.send(&snapshot).unwrap();
            std::thread::sleep(Duration::from_millis(10));
        }
    }
    await_true("a stretch that is kept", || accounts().contains("suspicion_raised"));
    assert!(accounts().contains("dragging_brake, evidence 35"), "{}", accounts());
    signal(recorder.id(), Signal::INT);
    assert!(recorder.wait().unwrap().success());
    let recording = Recording::load(&ring.join("ring-000001.mcap")).unwrap();
    let raised = recording.events.iter().filter(|it| it.kind == EventKind::SuspicionRaised as i32);
    assert_eq!(raised.count(), 1, "told once, however long it is suspected");
}
