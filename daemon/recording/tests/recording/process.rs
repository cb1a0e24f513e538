//! The recorder as a process next to a controller and a daemon: killed, asked to end, out of disk.

use std::io::Read;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use crate::support_site::{Controller, TRAIN, TestSite, await_true};
use dynocar::config::DaemonConfig;
use dynocar_mcap::event::EventKind;
use dynocar_mcap::reading::{FileEnding, read};
use dynocar_mcap::recording::Recording;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{ParameterSnapshot, PipelineKind};
use dynocar_transport::channel::Transport;
use dynocar_transport::monotonic_now_ns;
use dynocar_workshop::verify::{ComparisonOutcome, Configurations, overlay, text, verify};
use rustix::process::{Pid, Signal, kill_process};

const PROGRAM: &str = env!("CARGO_BIN_EXE_dynocar-recording");

/// Starts the recorder and waits until its channels are open.
fn recorder(site: &TestSite) -> Child {
    started(site, &["record", "-o"], "run.mcap")
}

/// Starts a recorder that writes to a place, and waits until its channels are open.
fn started(site: &TestSite, command: &[&str], to: &str) -> Child {
    let mut recorder = Command::new(PROGRAM)
        .args(command)
        .arg(site.at(to))
        .args(["--train", "1", "--snapshots-ms", "20", "--root"])
        .arg(site.at("root"))
        .arg("--config")
        .arg(site.at("daemon.toml"))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut printed = [0; 14];
    recorder.stderr.as_mut().unwrap().read_exact(&mut printed).unwrap();
    assert_eq!(&printed, b"recording into");
    recorder
}

/// Returns the recording as far as it can be read by now.
fn recording(site: &TestSite) -> Recording {
    let mut recording = Recording::default();
    read(&site.at("run.mcap"), &mut recording).unwrap();
    recording
}

fn await_recorded(site: &TestSite, sequence: u64) {
    let newest = || recording(site).samples.last().map_or(0, |it| it.sequence);
    await_true("a sample in the file", || newest() >= sequence);
}

fn count(site: &TestSite, kind: EventKind) -> usize {
    recording(site).events.iter().filter(|it| it.kind == kind as i32).count()
}

/// Waits until `count` samples more are published, and returns the newest number.
fn await_more(controller: &Controller, count: u64) -> u64 {
    let newest = || controller.published().last().map_or(0, |it| it.sequence);
    let start = newest();
    await_true("samples", || newest() >= start + count);
    newest()
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
    let site = TestSite::new(&["mass_kalman", "v_mils"]);
    let mut recorder = recorder(&site);
    for round in 1..=2 {
        let daemon = site.daemon();
        await_true("its coming in the file", || count(&site, EventKind::DaemonCame) == round);
        let controller = Controller::start(&site, 1);
        let published = await_more(&controller, 300);
        await_recorded(&site, published);
        drop(controller);
        // Daemons of this process end when it is asked to.
        signal(std::process::id(), Signal::TERM);
        daemon.join().unwrap();
        await_true("its going in the file", || count(&site, EventKind::DaemonGone) == round);
    }
    let newest = recording(&site).samples.len();
    recorder.kill().unwrap();
    recorder.wait().unwrap();

    let left = Recording::load(&site.at("run.mcap")).unwrap();
    assert!(left.broken.is_some(), "it has no end");
    assert!(left.samples.len() >= newest);
    let attached: Vec<&str> = left.attachments.iter().map(|it| it.0.as_str()).collect();
    assert_eq!(attached, ["configuration-1/daemon.toml", "configuration-1/train-1.toml"]);
    let whole = site.at("whole.mcap");
    let recovered = run(&["recover", "-o"], &[&whole, &site.at("run.mcap")]);
    assert_eq!(recovered.status.code(), Some(3), "the end is lost");
    assert!(words(&recovered).contains("lost of "));
    let mut again = Recording::default();
    assert_eq!(read(&whole, &mut again).unwrap(), FileEnding::Whole);
    assert_eq!((&again.samples, &again.snapshots), (&left.samples, &left.snapshots));

    let configurations = Configurations::from_recording(&again).unwrap();
    let verified = verify(&again, &configurations);
    let other = DaemonConfig::load(&site.at("daemon.toml")).unwrap();
    let recorded = configurations.of_epoch(verified.last().unwrap().epoch).0;
    let printed = text(&verified) + &overlay([recorded, &other], &again.samples, "daemon.toml");
    assert_eq!(printed.matches("daemon of epoch").count(), 2, "{printed}");
    assert!(printed.contains("recorded configuration"), "{printed}");
    // On a machine so busy that samples are lost, daemon and recorder did not take the same.
    let lost = left.snapshots.iter().any(|it| it.samples_lost > 0)
        || count(&site, EventKind::SamplesLost) > 0;
    assert!(lost || verified.iter().all(|it| it.outcome == ComparisonOutcome::Same), "{printed}");
    assert!(lost || !printed.contains("cannot"), "{printed}");
}

#[test]
fn a_recorder_that_is_asked_to_ends_whole() {
    let site = TestSite::new(&["mass_kalman", "v_mils"]);
    let controller = Controller::start(&site, 1);
    let mut recorder = recorder(&site);
    await_more(&controller, 1);
    let published = await_more(&controller, 200);
    await_recorded(&site, published);
    signal(recorder.id(), Signal::INT);
    assert!(recorder.wait().unwrap().success());
    let mut recording = Recording::default();
    assert_eq!(read(&site.at("run.mcap"), &mut recording).unwrap(), FileEnding::Whole);
    let kinds: Vec<i32> = recording.events.iter().map(|it| it.kind).collect();
    assert_eq!(kinds.first(), Some(&(EventKind::RecordingBegan as i32)));
    assert_eq!(kinds.last(), Some(&(EventKind::RecordingEnded as i32)));
    assert!(kinds.contains(&(EventKind::ControllerCame as i32)));
    let again = run(&["record", "-o"], &[&site.at("run.mcap")]);
    assert_eq!(again.status.code(), Some(2), "{}", words(&again));
}

#[test]
fn a_full_disk_ends_only_the_recorder_and_what_was_written_can_be_read() {
    let site = TestSite::new(&["mass_kalman", "v_mils"]);
    let controller = Controller::start(&site, 1);
    // A file may grow to 64 KiB, and writing on fails instead of killing: as on a full disk.
    let line = "trap '' XFSZ; ulimit -f 128; exec \"$0\" record --train 1 --root \"$1\" -o \"$2\"";
    let recorder = Command::new("sh")
        .args(["-c", line, PROGRAM])
        .args([site.at("root"), site.at("run.mcap")])
        .output()
        .unwrap();
    let printed = words(&recorder);
    assert_eq!(recorder.status.code(), Some(1), "{printed}");
    assert!(printed.contains("run.mcap: cannot be written: File too large"), "{printed}");
    assert!(recording(&site).samples.len() > 50, "{printed}");
    await_more(&controller, 100);
}

#[test]
fn a_flight_recorder_keeps_what_it_is_asked_to_whatever_ends_it() {
    let site = TestSite::new(&["mass_kalman", "v_mils"]);
    let controller = Controller::start(&site, 1);
    let ring = site.at("ring");
    let asked = || run(&["keep", "--reason", "a jerk"], &[&ring]);
    assert_eq!(asked().status.code(), Some(2), "no such folder");
    let mut recorder = started(&site, &["flight-recorder"], "ring");
    await_more(&controller, 1);
    let begun = await_more(&controller, 100);
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
    let after = await_more(&controller, 100);
    await_true("what came after in what is kept", || newest() >= after);
    recorder.kill().unwrap();
    recorder.wait().unwrap();
    // The ring goes round, or is cleared by hand.
    std::fs::remove_file(ring.join("ring-000001.mcap")).unwrap();
    let whole = site.at("whole.mcap");
    let recovered = run(&["recover", "-o"], &[&whole, &kept]);
    assert!(recovered.status.code().is_some_and(|it| it == 0 || it == 3), "{recovered:?}");
    let recording = Recording::load(&whole).unwrap();
    assert!(recording.samples.iter().any(|it| it.sequence <= begun), "from before it was asked");
    let text = std::fs::read_to_string(stretch().unwrap().join("stretch.toml")).unwrap();
    assert!(text.contains("keep_requested") && text.contains("a jerk"), "{text}");
    let late = asked();
    assert_eq!(late.status.code(), Some(1), "{}", words(&late));
    assert!(words(&late).contains("no flight recorder writes into it"), "{}", words(&late));
}

#[test]
fn a_name_that_no_new_file_can_have_is_refused_before_anything_is_written() {
    let site = TestSite::new(&["v_mils"]);
    std::fs::create_dir(site.at("folder")).unwrap();
    for (name, status, said) in [
        ("folder/", 2, "expected the name of a new file, found a folder's\n"),
        ("new.mcap/", 2, "expected the name of a new file, found a folder's\n"),
        ("folder", 2, "exists already, and is not overwritten: give another name\n"),
        ("none/new.mcap", 1, "cannot be made: No such file or directory (os error 2)\n"),
    ] {
        let path = format!("{}/{name}", site.at("").display()).replace("//", "/");
        let output = run(&["record", "--root"], &[&site.at("root"), "-o".as_ref(), path.as_ref()]);
        assert_eq!(output.status.code(), Some(status), "{}", words(&output));
        assert!(words(&output).ends_with(&format!("{path}: {said}")), "{}", words(&output));
    }
}

#[test]
fn a_closed_pipe_is_no_failure_and_a_full_disk_is_reported_by_the_name_that_was_called() {
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    for name in ["dynocar-recording", "dynocar"] {
        for arguments in [&["fields"][..], &["--help"], &["record", "--help"]] {
            let mut command = Command::new(PROGRAM);
            command.arg0(name).args(arguments);
            let (_, closed) = std::io::pipe().unwrap();
            let output = command.stdout(closed).output().unwrap();
            assert_eq!((output.status.code(), words(&output)), (Some(0), String::new()));
            let output = command.stdout(full()).output().unwrap();
            let printed =
                format!("{name}: standard output: cannot be written: No space left on device");
            assert!(words(&output).starts_with(&printed), "{}", words(&output));
            assert_eq!(output.status.code(), Some(1));
        }
    }
}

#[test]
fn a_flight_recorder_keeps_what_lies_around_a_suspicion() {
    let site = TestSite::new(&["mass_kalman", "v_mils"]);
    let controller = Controller::start(&site, 1);
    // A daemon's end of the channel, which sends nothing but a suspicion.
    let transport = Transport::open(&site.host(), "monitor").unwrap();
    let snapshots = transport.sender::<ParameterSnapshot>(TRAIN).unwrap();
    let mut snapshot = ParameterSnapshot::empty();
    (snapshot.train_id, snapshot.epoch) = (TRAIN.0, monotonic_now_ns() as u64);
    snapshot.pipeline_kind = PipelineKind::ResidualMonitor as u32;
    let mut recorder = started(&site, &["flight-recorder"], "ring");
    await_more(&controller, 100);
    let ring = site.at("ring");
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
    assert!(accounts().contains("dragging_brake for 0.0 s, evidence 35"), "{}", accounts());
    signal(recorder.id(), Signal::INT);
    assert!(recorder.wait().unwrap().success());
    let recording = Recording::load(&ring.join("ring-000001.mcap")).unwrap();
    let raised = recording.events.iter().filter(|it| it.kind == EventKind::SuspicionRaised as i32);
    assert_eq!(raised.count(), 1, "reported once, however long it is suspected");
}
