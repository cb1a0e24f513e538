//! Wall clocks that jump by hours and days, under a daemon, a flight recorder and their files.
//!
//! Only the clocks of the processes under test jump; the host's clock is not changed.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use dynocar_client::{Host, SamplePublisher, SnapshotReader};
use dynocar_mcap::copying::recover;
use dynocar_mcap::recording::Recording;
use dynocar_shared::{SampleField, TrainId, TrainSample};
use dynocar_tests::process::{DaemonSite, Process, await_true};
use dynocar_tests::soak::day::strange_host::StrangeHost;
use dynocar_transport::monotonic_now_ns;
use rustix::process::Signal;

use super::state::Cast;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const RECORDING: &str = env!("CARGO_BIN_EXE_dynocar-recording-under-test");
const TRAIN: TrainId = TrainId(1);
const HOUR_S: i64 = 3_600;

/// A controller that publishes without pause, 400 samples a second, so that a reader falls behind only after a second.
struct Controller {
    published: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Controller {
    fn start(host: &Host) -> Self {
        let (published, stop) = (Arc::<AtomicU64>::default(), Arc::<AtomicBool>::default());
        let (host, count, is_stopped) = (host.clone(), Arc::clone(&published), Arc::clone(&stop));
        let thread = std::thread::spawn(move || {
            let mut publisher = SamplePublisher::open(&host, TRAIN).unwrap();
            while !is_stopped.load(Ordering::Relaxed) {
                let mut sample = TrainSample::empty(TRAIN).with(SampleField::Speed, 20.0);
                sample.time_ns = monotonic_now_ns();
                publisher.publish(&mut sample).unwrap();
                count.store(publisher.sequence(), Ordering::Relaxed);
                std::thread::sleep(Duration::from_micros(2_500));
            }
        });
        Controller { published, stop, thread }
    }

    /// Stops; returns the number of the last sample.
    fn end(self) -> u64 {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap();
        self.published.load(Ordering::Relaxed)
    }
}

/// A flight recorder's folder, and the recorder with a host of its own.
struct Ring {
    folder: PathBuf,
    strange: StrangeHost,
}

impl Ring {
    fn start(&self, site: &DaemonSite) -> Process {
        let folder = self.folder.to_str().unwrap();
        let limits = ["--before-s", "3600", "--after-s", "10", "--train", "1", "--ring-mib", "15"];
        let arguments = [&["flight-recorder", folder][..], &limits].concat();
        let recorder = site.start_with(RECORDING, &arguments, &self.strange.variables());
        recorder.await_error("recording into");
        recorder
    }

    fn files(&self) -> Vec<PathBuf> {
        mcap_in(&self.folder)
    }

    fn events(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.folder.join("kept")).unwrap().flatten();
        let is_whole = |it: &PathBuf| it.extension().is_none_or(|it| it != "part");
        let mut events: Vec<PathBuf> = entries.map(|it| it.path()).filter(is_whole).collect();
        events.sort();
        events
    }

    /// Asks to keep this moment; returns the one event that was not there before.
    fn keep(&self, site: &DaemonSite) -> PathBuf {
        let before = self.events();
        let mut keep = site.start(RECORDING, &["keep", self.folder.to_str().unwrap()]);
        assert!(keep.wait().success(), "{}", keep.errors());
        let mut new = Vec::new();
        await_true(
            || {
                new = self.events();
                new.retain(|it| !before.contains(it));
                !new.is_empty()
            },
            || "an event that is kept".into(),
        );
        assert_eq!(new.len(), 1, "{new:?}");
        new.remove(0)
    }

    /// Waits until one more file is begun.
    fn await_next_file(&self) {
        let before = self.files().last().cloned();
        await_true(|| self.files().last().cloned() > before, || "the next file".into());
    }
}

fn mcap_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().flatten().map(|it| it.path());
    let mut files: Vec<PathBuf> =
        entries.filter(|it| it.extension().is_some_and(|it| it == "mcap")).collect();
    files.sort();
    files
}

fn names(files: &[PathBuf]) -> Vec<String> {
    files.iter().map(|it| it.file_name().unwrap().to_string_lossy().into_owned()).collect()
}

/// The numbers of the samples in files that belong together.
fn sequences(site: &DaemonSite, files: &[PathBuf]) -> Vec<u64> {
    let whole = site.path().join("whole.mcap");
    let _ = std::fs::remove_file(&whole);
    recover(files, &whole).unwrap();
    Recording::load(&whole).unwrap().samples.iter().map(|it| it.sequence).collect()
}

#[test]
fn a_ring_loses_nothing_and_an_event_ends_whatever_the_wall_clock_does() {
    let site = DaemonSite::new();
    let ring = Ring {
        folder: site.path().join("ring"),
        strange: StrangeHost::new(site.path(), site.path()),
    };
    let recorder = ring.start(&site);
    let controller = Controller::start(&site.host());
    ring.await_next_file();
    // By its date this file is older than the time kept before an event, and older than the span of the ring.
    ring.strange.set_clock_ahead(30 * HOUR_S);
    ring.await_next_file();
    let (all, first) = (names(&ring.files()), ring.keep(&site));
    assert!(names(&mcap_in(&first)).starts_with(&all), "{all:?}");
    // By the wall clock that event goes on for days now.
    ring.strange.set_clock_ahead(-30 * HOUR_S);
    let end = monotonic_now_ns() + 11_000_000_000;
    await_true(|| monotonic_now_ns() > end, || "the event's end".into());
    ring.await_next_file();
    ring.await_next_file();
    assert!(!names(&mcap_in(&first)).contains(names(&ring.files()).last().unwrap()));
    let second = ring.keep(&site);
    assert_eq!(names(&mcap_in(&second))[0], all[0], "nothing of the ring has gone");
    // Killed in the middle of an event, and by the wall clock started weeks later.
    recorder.kill();
    ring.strange.set_clock_ahead(700 * HOUR_S);
    let mut recorder = ring.start(&site);
    assert!(mcap_in(&second).len() > names(&ring.files()).len() - 1, "the event goes on");
    ring.await_next_file();
    let last = controller.end();
    assert!(recorder.end(Signal::TERM).success(), "{}", recorder.errors());
    let said = recorder.errors();
    assert!(said.contains(" 0 samples lost"), "{said}");
    assert_eq!(names(&ring.files())[0], all[0], "nothing of the ring has gone");
    // Samples that were published while there was no recorder are missing, no others.
    let recorded = sequences(&site, &ring.files());
    let gaps = recorded.windows(2).filter(|it| it[1] != it[0] + 1).count();
    assert!(gaps <= 1 && *recorded.last().unwrap() == last, "{gaps} gaps, {:?}", recorded.last());
}

#[test]
fn a_daemon_serves_and_its_state_is_taken_up_whatever_the_wall_clock_does() {
    let cast = Cast::new();
    let strange = StrangeHost::new(cast.site.path(), cast.site.path());
    let start = || cast.daemon([""; 2], &strange.variables());
    let mut daemon = start();
    cast.replay();
    await_true(|| cast.state_file().exists(), || "the state".into());
    for (kill, ahead_s) in [(true, -30 * HOUR_S), (false, 9_000 * HOUR_S), (true, 0)] {
        strange.set_clock_ahead(ahead_s);
        let before = count(&cast.site);
        cast.replay();
        let after = count(&cast.site);
        // Of both pipelines; a replay ends when all that it published is accounted for.
        assert!(after.0 > before.0 && after.1 == before.1, "{before:?} {after:?}");
        daemon.signal(if kill { Signal::KILL } else { Signal::TERM });
        daemon.wait();
        // The next one is started by another time of the day again.
        strange.set_clock_ahead(-ahead_s / 2);
        daemon = start();
        let said = daemon.errors();
        assert_eq!(said.matches("warm start").count(), 2, "{said}");
        assert!(!said.contains("cold start"), "{said}");
    }
    let mut health = cast.site.start(DYNOCAR, &["health"]);
    assert_eq!(health.wait().code(), Some(0), "{}", health.errors());
    assert!(daemon.end(Signal::TERM).success());
    assert_eq!(cast.content().estimates.len(), 2);
}

/// Samples that a pipeline used or rejected, and lost ones.
fn count(site: &DaemonSite) -> (u64, u64) {
    let mut reader = SnapshotReader::open(&site.host(), TRAIN).unwrap();
    let mut counts = None;
    await_true(
        || {
            reader.poll();
            let newest = reader.readings(monotonic_now_ns()).find(|it| !it.is_stale);
            counts = newest.map(|it| *it.snapshot);
            counts.is_some()
        },
        || "a snapshot that is vouched for".into(),
    );
    let it = counts.unwrap();
    (it.samples_used + it.samples_rejected, it.samples_lost)
}
