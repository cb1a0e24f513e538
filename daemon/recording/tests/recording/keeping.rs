//! A flight recorder keeps for good the files around a moment, and nothing else.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use dynocar::storage::Disk;
use dynocar_mcap::copying::recover;
use dynocar_mcap::event::{Event, EventKind};
use dynocar_mcap::recording::Recording;
use dynocar_mcap::topic::Message;
use dynocar_recording::record::{EventKeeper, Keeping, RecordingFiles, Rotation, request_keeping};
use dynocar_shared::{Status, TrainId, TrainSample};

const HOUR: Duration = Duration::from_secs(3600);

fn keeping() -> Keeping {
    Keeping { before: HOUR, after: HOUR, most_bytes: 1 << 30 }
}

fn event(kind: EventKind) -> Event {
    Event { kind: kind as i32, train_id: 1, text: kind.name().into(), ..Default::default() }
}

/// Returns the names of the recordings in a folder.
fn names(folder: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder).unwrap().flatten();
    let names = entries.map(|it| it.file_name().into_string().unwrap());
    names.filter(|it| it.ends_with(".mcap")).collect()
}

fn stretches(ring: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(ring.join("kept")).unwrap().flatten();
    let mut folders: Vec<PathBuf> = entries.map(|it| it.path()).collect();
    folders.sort();
    folders
}

fn ring(folder: &Path, keeping: Keeping) -> RecordingFiles {
    let rotation = Rotation { bytes: Some(8_000), keep_bytes: Some(30_000), ..Rotation::default() };
    let begin = || EventKeeper::begin(Arc::new(Disk), folder, keeping);
    // A process that another test starts holds the ring's lock, too, until it is a program of its own.
    let keeper = (0..1000).find_map(|_| {
        begin().ok().or_else(|| {
            std::thread::sleep(Duration::from_millis(1));
            None
        })
    });
    let keeper = keeper.expect("nobody else has the ring");
    let sync = Some(Duration::from_secs(1));
    RecordingFiles::begin(Arc::new(Disk), &folder.join("ring.mcap"), rotation, sync, Some(keeper))
        .unwrap()
}

fn drive(files: &mut RecordingFiles, sequences: std::ops::Range<u64>) {
    for sequence in sequences {
        let sample = TrainSample { sequence, ..TrainSample::empty(TrainId(1)) };
        files.write(Message::Sample(&sample)).unwrap();
        if sequence % 50 == 0 {
            files.flush().unwrap();
        }
    }
}

#[test]
fn what_lies_around_a_suspicion_outlives_the_ring() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = ring(folder.path(), keeping());
    drive(&mut files, 1..1000);
    let before = names(folder.path());
    files.write(Message::Event(&event(EventKind::SuspicionRaised))).unwrap();
    let [stretch] = &stretches(folder.path())[..] else { panic!("one stretch") };
    assert_eq!(names(stretch), before);
    drive(&mut files, 1000..2000);
    let after = names(folder.path());
    let kept = names(stretch);
    assert!(before.is_subset(&kept) && after.is_subset(&kept), "{before:?} {after:?} {kept:?}");
    assert!(before.intersection(&after).next().is_none(), "the ring has gone round");
    files.finish().unwrap();
    // No sample between the first and the last is missing, and all can be read as one recording.
    let whole = folder.path().join("whole.mcap");
    let parts: Vec<PathBuf> = kept.iter().map(|it| stretch.join(it)).collect();
    recover(&parts, &whole).unwrap();
    let recording = Recording::load(&whole).unwrap();
    assert_eq!((recording.broken, recording.metadata.len()), (None, 1));
    let sequences: Vec<u64> = recording.samples.iter().map(|it| it.sequence).collect();
    assert_eq!(sequences, (sequences[0]..2000).collect::<Vec<_>>());
}

#[test]
fn a_second_reason_lengthens_the_kept_event_and_a_late_one_begins_another() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = ring(folder.path(), keeping());
    files.write(Message::Event(&event(EventKind::DaemonSilent))).unwrap();
    files.write(Message::Event(&event(EventKind::SamplesLost))).unwrap();
    files.write(Message::Event(&event(EventKind::SamplesLost))).unwrap();
    let [stretch] = &stretches(folder.path())[..] else { panic!("one stretch") };
    let account = std::fs::read_to_string(stretch.join("stretch.toml")).unwrap();
    assert_eq!(account.matches("[[reasons]]").count(), 2, "{account}");
    let ended = account
        .lines()
        .map(|it| match it.split(" = ").next() {
            Some("until_unix_s") => "until_unix_s = 1",
            Some("boot_id") => "boot_id = \"another\"",
            _ => it,
        })
        .collect::<Vec<_>>();
    std::fs::write(stretch.join("stretch.toml"), ended.join("\n")).unwrap();
    drop(files);
    let mut files = ring(folder.path(), keeping());
    files.write(Message::Event(&event(EventKind::DaemonSilent))).unwrap();
    assert_eq!(stretches(folder.path()).len(), 2);
}

#[test]
fn a_recorder_that_died_leaves_its_kept_event_to_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = ring(folder.path(), keeping());
    drive(&mut files, 1..200);
    files.write(Message::Event(&event(EventKind::SuspicionRaised))).unwrap();
    files.flush().unwrap();
    // As kill -9 does: nothing is finished.
    drop(files);
    let mut files = ring(folder.path(), keeping());
    drive(&mut files, 200..400);
    files.finish().unwrap();
    let [stretch] = &stretches(folder.path())[..] else { panic!("one stretch") };
    assert!(names(stretch).is_superset(&names(folder.path())));
    let whole = folder.path().join("whole.mcap");
    let parts: Vec<PathBuf> = names(stretch).iter().map(|it| stretch.join(it)).collect();
    recover(&parts, &whole).unwrap();
    let samples = Recording::load(&whole).unwrap().samples;
    let sequences: Vec<u64> = samples.iter().map(|it| it.sequence).collect();
    assert!(sequences[0] < 200, "{sequences:?}");
    assert_eq!(sequences, (sequences[0]..400).collect::<Vec<_>>());
}

#[test]
fn what_lies_too_far_back_and_what_is_no_reason_is_not_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = ring(folder.path(), keeping());
    drive(&mut files, 1..600);
    drop(files);
    let all = names(folder.path());
    let old = all.first().unwrap();
    let file = std::fs::File::options().append(true).open(folder.path().join(old)).unwrap();
    file.set_modified(SystemTime::now() - 2 * HOUR).unwrap();
    let mut files = ring(folder.path(), keeping());
    let degraded =
        Event { status: Some(Status::Degraded as i32), ..event(EventKind::StatusChanged) };
    for nothing in
        [degraded.clone(), event(EventKind::DaemonCame), event(EventKind::SuspicionEnded)]
    {
        files.write(Message::Event(&nothing)).unwrap();
    }
    assert_eq!(stretches(folder.path()), [] as [PathBuf; 0]);
    files
        .write(Message::Event(&Event { status: Some(Status::Invalid as i32), ..degraded }))
        .unwrap();
    let [stretch] = &stretches(folder.path())[..] else { panic!("one stretch") };
    assert!(!names(stretch).contains(old) && names(stretch).len() == all.len());
}

#[test]
fn what_is_kept_stays_within_its_bound_and_the_recorder_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = ring(folder.path(), Keeping { most_bytes: 40_000, ..keeping() });
    files.write(Message::Event(&event(EventKind::SuspicionRaised))).unwrap();
    drive(&mut files, 1..4000);
    files.finish().unwrap();
    let [stretch] = &stretches(folder.path())[..] else { panic!("one stretch") };
    let length = |name: String| std::fs::metadata(stretch.join(name)).unwrap().len();
    let bytes: u64 = names(stretch).into_iter().map(length).sum();
    // One file has grown since it was given its name.
    assert!((20_000..60_000).contains(&bytes), "{bytes}");
}

#[test]
fn a_request_is_kept_and_one_to_nobody_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    assert!(!request_keeping(folder.path(), "nobody").unwrap());
    assert!(request_keeping(&folder.path().join("absent"), "nobody").is_err());
    let mut files = ring(folder.path(), keeping());
    assert!(request_keeping(folder.path(), "the driver felt a jerk").unwrap());
    files.flush().unwrap();
    let [stretch] = &stretches(folder.path())[..] else { panic!("one stretch") };
    let account = std::fs::read_to_string(stretch.join("stretch.toml")).unwrap();
    assert!(account.contains("the driver felt a jerk"), "{account}");
    files.flush().unwrap();
    assert_eq!(stretches(folder.path()).len(), 1, "asked once");
    let second = EventKeeper::begin(Arc::new(Disk), folder.path(), keeping()).unwrap_err();
    assert!(second.to_string().contains("another recorder"), "{second}");
    files.finish().unwrap();
    assert!(!request_keeping(folder.path(), "too late").unwrap());
}
