//! Files of ours after a power cut: whole, and never older than what was told to be kept.

use std::path::Path;

use dynocar::state::file;
use dynocar::storage::{Disk, Rights, replace};
use dynocar_tests::power_cut::{LossyDisk, Neglect};

const CONTENTS: [&str; 4] =
    ["the first estimate\n", "the second, longer estimate\n", "", "the last\n"];

/// Cuts the power after every step of four states being kept; gives how many disks were looked
/// at, and the first that was not as promised.
fn cut(neglect: Neglect) -> (usize, Option<String>) {
    let path = Path::new("train-1.state");
    let disk = LossyDisk::new(neglect);
    // Steps by which each content was told to be kept.
    let kept: Vec<usize> = CONTENTS
        .iter()
        .map(|content| {
            file::replace_on(&disk, path, content).expect("this disk takes everything");
            disk.steps()
        })
        .collect();
    let mut looked_at = 0;
    for count in 0..=disk.steps() {
        let oldest = kept.iter().filter(|&&steps| steps <= count).count();
        let newest = (oldest + 1).min(CONTENTS.len());
        for left in disk.left_after(count) {
            looked_at += 1;
            let found = left.get(path).map(|bytes| file::content_of(path, bytes));
            let is_promised = match &found {
                None => oldest == 0,
                Some(Err(_)) => false,
                Some(Ok(content)) => {
                    CONTENTS[oldest.saturating_sub(1)..newest].contains(&content.as_str())
                }
            };
            if !is_promised {
                return (looked_at, Some(format!("after {count} steps: {found:?}, {oldest} kept")));
            }
        }
    }
    (looked_at, None)
}

#[test]
fn a_power_cut_at_any_step_leaves_a_whole_state_no_older_than_the_last_one_kept() {
    let (looked_at, broken) = cut(Neglect::Nothing);
    assert_eq!(broken, None);
    assert!(looked_at > 40, "only {looked_at} disks");
}

#[test]
fn a_disk_that_keeps_bytes_or_names_back_is_noticed() {
    for neglect in [Neglect::Bytes, Neglect::Names] {
        let (_, broken) = cut(neglect);
        assert!(broken.is_some(), "{neglect:?}");
    }
}

#[test]
fn the_next_writer_goes_on_from_whatever_a_power_cut_left() {
    let path = Path::new("train-1.state");
    let disk = LossyDisk::new(Neglect::Nothing);
    for content in CONTENTS {
        file::replace_on(&disk, path, content).expect("this disk takes everything");
    }
    for count in 0..=disk.steps() {
        for left in disk.left_after(count) {
            let folder = tempfile::tempdir().unwrap();
            for (name, bytes) in &left {
                std::fs::write(folder.path().join(name), bytes).unwrap();
            }
            let path = folder.path().join(path);
            file::replace(&path, "what came after").unwrap();
            assert_eq!(file::read(&path).unwrap().as_deref(), Some("what came after"));
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing beside it");
        }
    }
}

#[test]
fn what_half_a_renaming_left_is_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let (path, beside) = (folder.path().join("model.toml"), folder.path().join("model.part"));
    std::fs::write(&path, "old").unwrap();
    std::fs::hard_link(&path, &beside).unwrap();
    let refused = folder.path().join("no/such/folder/model.part");
    assert!(replace(&Disk, &path, &refused, (b"new", &Rights::Usual)).is_err());
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    replace(&Disk, &path, &beside, (b"new", &Rights::Usual)).unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
    assert!(!beside.exists());
}
