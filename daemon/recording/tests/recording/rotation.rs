//! Files of a recording that rotates.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use dynocar::storage::Disk;
use dynocar_mcap::topic::Message;
use dynocar_recording::record::{RecordError, RecordingFiles, Rotation};
use dynocar_shared::{TrainId, TrainSample};

/// The numbered files of a folder, in order, with their lengths.
fn numbered(folder: &Path) -> Vec<(PathBuf, u64)> {
    let entries = std::fs::read_dir(folder).unwrap().flatten();
    let mut files: Vec<_> = entries
        .filter(|it| it.file_name().to_str().unwrap().starts_with("run-0"))
        .map(|it| (it.path(), it.metadata().unwrap().len()))
        .collect();
    files.sort();
    files
}

#[test]
fn files_are_numbered_on_and_the_oldest_go_when_they_take_too_much() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("run.mcap");
    std::fs::write(folder.path().join("run-000041.mcap"), [0; 5000]).unwrap();
    std::fs::write(folder.path().join("run-mine.mcap"), "stays").unwrap();
    let rotation =
        Rotation { bytes: Some(20_000), keep_bytes: Some(60_000), ..Rotation::default() };
    let mut files = RecordingFiles::begin(Arc::new(Disk), &output, rotation, None, None).unwrap();
    assert!(files.path().ends_with("run-000042.mcap"));
    for sequence in 1..=4000 {
        let sample = TrainSample { sequence, ..TrainSample::empty(TrainId(1)) };
        files.write(Message::Sample(&sample)).unwrap();
        if sequence % 100 == 0 {
            files.flush().unwrap();
        }
    }
    files.finish().unwrap();
    let kept = numbered(folder.path());
    assert!(kept.len() > 1 && !kept[0].0.ends_with("run-000042.mcap"), "{kept:?}");
    let bytes: u64 = kept.iter().map(|it| it.1).sum();
    assert!(bytes < 60_000 + 25_000, "{bytes} bytes");
    assert!(folder.path().join("run-mine.mcap").exists());
}

#[test]
fn a_name_that_is_taken_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("run.mcap");
    std::fs::write(&output, "precious").unwrap();
    let refused = RecordingFiles::begin(Arc::new(Disk), &output, Rotation::default(), None, None)
        .err()
        .unwrap();
    assert!(matches!(refused, RecordError::Taken { .. }), "{refused}");
    assert_eq!(std::fs::read_to_string(&output).unwrap(), "precious");
}
