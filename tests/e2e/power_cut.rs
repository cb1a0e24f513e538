//! Dynocar's files after a power cut: whole, and never older than the last content that was kept on request.

use std::path::{Path, PathBuf};

use dynocar::models::{ModelText, NewModel, Origin, UtcSecond, records, store};
use dynocar::state::file;
use dynocar::storage::{Disk, Rights, replace};
use dynocar_tests::power_cut::{LossyDisk, Neglect};

const CONTENTS: [&str; 4] =
    ["the first estimate\n", "the second, longer estimate\n", "", "the last\n"];

/// Cuts the power after every step while four states are kept; returns the number of checked disks, and the first that
/// broke the promise.
fn cut(neglect: Neglect) -> (usize, Option<String>) {
    let path = Path::new("train-1.state");
    let disk = LossyDisk::new(neglect);
    // Number of steps after which each content must be kept.
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

fn new_model() -> NewModel {
    let origin = Origin {
        made: UtcSecond { unix_s: 1 },
        version: "1".into(),
        command: "x".into(),
        parent: None,
        verdict: None,
        statement: "s".into(),
        dataset_sha256: None,
        error: None,
        effects: Vec::new(),
        files: Vec::new(),
    };
    let text = ModelText { train: "train".into(), track: Some("track".into()) };
    NewModel { text, origin, answer_json: Some("{}".into()), report_html: None }
}

/// Cuts the power after every step of a model being put into the store and a decision being taken;
/// gives how many disks were looked at, and the first that was not as promised.
fn cut_store(neglect: Neglect) -> (usize, Option<String>) {
    let (folder, decisions) = (Path::new("1/00aa"), Path::new("1/decisions"));
    let model = new_model();
    let disk = LossyDisk::new(neglect);
    store::write_model(&disk, folder, &model).expect("this disk takes everything");
    let put = disk.steps();
    assert!(records::write(&disk, decisions, 1, &model.origin).expect("a disk that takes it"));
    let decided = disk.steps();
    assert!(!records::write(&disk, decisions, 1, &model.origin).expect("a disk that takes it"));
    let whole = |content: &[u8]| toml::from_slice::<Origin>(content).ok();
    let mut looked_at = 0;
    for count in 0..=disk.steps() {
        for left in disk.left_after(count) {
            looked_at += 1;
            let at = |path: PathBuf| left.get(&path).map(Vec::as_slice);
            let origin = at(folder.join("origin.toml"));
            let is_model = at(folder.join("train.toml")) == Some(b"train")
                && at(folder.join("track.toml")) == Some(b"track")
                && at(folder.join("answer.json")) == Some(b"{}")
                && origin.and_then(whole).as_ref() == Some(&model.origin);
            let is_none = !left.keys().any(|name| name.starts_with(folder));
            let decision = at(records::path_of(decisions, 1));
            let is_decision = decision.and_then(whole).as_ref() == Some(&model.origin);
            let is_promised = (is_model || is_none && count < put)
                && (is_decision || decision.is_none() && count < decided);
            if !is_promised {
                return (looked_at, Some(format!("after {count} steps: {:?}", left.keys())));
            }
        }
    }
    (looked_at, None)
}

#[test]
fn a_power_cut_leaves_a_model_or_a_decision_whole_or_not_at_all() {
    let (looked_at, broken) = cut_store(Neglect::Nothing);
    assert_eq!(broken, None);
    assert!(looked_at > 40, "only {looked_at} disks");
    for neglect in [Neglect::Bytes, Neglect::Names] {
        assert!(cut_store(neglect).1.is_some(), "{neglect:?} is noticed");
    }
}
