//! Recordings whose messages another tool has reordered, written twice or merged, and recordings of several trains.

use std::path::{Path, PathBuf};

use dynocar::dataset::{self, DatasetSource};
use dynocar_mcap::recording::Recording;
use dynocar_mcap::topic::Message;
use dynocar_mcap::writing::{RecordingWriter, WallClock};
use dynocar_shared::{TrainId, TrainSample};
use dynocar_workshop::convert::{ModelFiles, to_dataset};

use crate::support::{config_folder, samples};

/// The demo's samples as a controller publishes them.
fn published() -> Vec<TrainSample> {
    let stamped = |it: TrainSample| {
        let published_ns = i64::from(it.run) * 10_000_000_000_000 + it.time_ns;
        TrainSample { published_ns, ..it }
    };
    samples().into_iter().map(stamped).collect()
}

/// Writes samples in this order, each logged when it was published, with attached files.
fn write(path: &Path, samples: &[TrainSample], attached: &[(&str, String)]) {
    let file = std::fs::File::create_new(path).unwrap();
    let mut writer = RecordingWriter::new(file, WallClock::of_another_host()).unwrap();
    for (name, text) in attached {
        writer.attach(name, text.as_bytes(), 0).unwrap();
    }
    samples.iter().for_each(|it| writer.write(Message::Sample(it)).unwrap());
    writer.finish().unwrap();
}

fn train_text(mass_t: u32) -> String {
    let text = std::fs::read_to_string(config_folder().join("demo/train.toml")).unwrap();
    let mut train: toml::Table = text.parse().unwrap();
    train["train"].as_table_mut().unwrap().insert("mass_t".into(), mass_t.into());
    train.to_string()
}

struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        Place(tempfile::tempdir().unwrap())
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The error of a conversion of samples.
    fn refusal(&self, name: &str, samples: &[TrainSample], attached: &[(&str, String)]) -> String {
        write(&self.at(name), samples, attached);
        let models =
            ModelFiles { train: Some(config_folder().join("demo/train.toml")), track: None };
        let done = to_dataset(&[self.at(name)], &self.at(&format!("{name}.d")), None, &models);
        done.unwrap_err().to_string()
    }
}

#[test]
fn samples_are_read_in_the_order_in_which_they_were_recorded_each_once() {
    let (place, own) = (Place::new(), published());
    let third = own.len() / 3;
    let reversed: Vec<TrainSample> = own.iter().rev().copied().collect();
    let exchanged = [&own[2 * third..], &own[..third], &own[third..2 * third]].concat();
    let twice: Vec<TrainSample> = own.iter().flat_map(|it| [*it, *it]).collect();
    let halves = own.chunks(2).flat_map(|it| it.iter().rev().copied()).collect();
    let overlapping = [&own[..2 * third], &own[third..]].concat();
    let mut by_speed = own.clone();
    by_speed.sort_by(|one, other| one.speed_mps.total_cmp(&other.speed_mps));
    for (name, written) in [
        ("plain", own.clone()),
        ("reversed", reversed),
        ("exchanged", exchanged),
        ("twice", twice),
        ("halves", halves),
        ("overlapping", overlapping),
        ("by_speed", by_speed),
    ] {
        write(&place.at(name), &written, &[]);
        assert!(Recording::load(&place.at(name)).unwrap().samples == own, "{name}");
    }
}

#[test]
fn a_clock_set_back_and_numbers_that_begin_anew_change_no_order() {
    let (place, own) = (Place::new(), published());
    let (first, rest) = own.split_at(600);
    // The controller starts again: its numbers begin anew, the host's clock goes on.
    let anew = rest.iter().zip(1..).map(|(it, sequence)| TrainSample { sequence, ..*it });
    let restarted: Vec<TrainSample> = first.iter().copied().chain(anew).collect();
    write(&place.at("restarted"), &restarted, &[]);
    assert!(Recording::load(&place.at("restarted")).unwrap().samples == restarted);
    // The wall clock, by which messages are logged, is set back meanwhile.
    let file = std::fs::File::create_new(place.at("set_back")).unwrap();
    let mut writer = RecordingWriter::new(file, WallClock::of_another_host()).unwrap();
    for (index, it) in restarted.iter().enumerate() {
        let back_ns = if index < 600 { 10_000_000_000_000 } else { 0 };
        writer.log_next_at((it.published_ns + back_ns) as u64);
        writer.write(Message::Sample(it)).unwrap();
    }
    writer.finish().unwrap();
    assert!(Recording::load(&place.at("set_back")).unwrap().samples == restarted);
}

#[test]
fn merged_recordings_are_refused_in_true_words() {
    let (place, own) = (Place::new(), published());
    let other_train = [("configuration-1/train-1.toml", train_text(90))];
    let attached = [("configuration-1/train-1.toml", train_text(80)), other_train[0].clone()];
    let message = place.refusal("attached.mcap", &own, &attached);
    assert!(
        message
            .contains("configuration-1/train-1.toml is attached to it several times, each another"),
        "{message}"
    );
    // Two controllers of trains with the same number, one sample of each in turn.
    let of_other = |it: &TrainSample| TrainSample {
        sequence: it.sequence + 70_000,
        published_ns: it.published_ns + 3,
        speed_mps: it.speed_mps + 1.0,
        ..*it
    };
    let merged: Vec<TrainSample> = own.iter().flat_map(|it| [*it, of_other(it)]).collect();
    let message = place.refusal("controllers.mcap", &merged, &[]);
    assert!(message.contains("the numbers of train 1's samples go back and forth"), "{message}");
    // One after the other they are a controller that was started again.
    let joined: Vec<TrainSample> = own.iter().copied().chain(own.iter().map(of_other)).collect();
    write(&place.at("joined.mcap"), &joined, &attached[..1]);
    to_dataset(&[place.at("joined.mcap")], &place.at("joined"), None, &ModelFiles::default())
        .unwrap();
}

#[test]
fn of_several_trains_the_chosen_one_is_read() {
    let (place, own) = (Place::new(), published());
    let of_second = |it: &TrainSample| TrainSample {
        train_id: 2,
        published_ns: it.published_ns + 3,
        speed_mps: it.speed_mps + 0.25,
        ..*it
    };
    let both: Vec<TrainSample> = own.iter().flat_map(|it| [*it, of_second(it)]).collect();
    let attached = [
        ("configuration-1/train-1.toml", train_text(80)),
        ("configuration-1/train-2.toml", train_text(90)),
    ];
    let path = place.at("two.mcap");
    write(&path, &both, &attached);
    for (train, mass_kg, more_mps) in [(1, 80e3, 0.0), (2, 90e3, 0.25)] {
        let folder = place.at(&train.to_string());
        let paths = std::slice::from_ref(&path);
        to_dataset(paths, &folder, Some(train), &ModelFiles::default()).unwrap();
        let read = dataset::load(&folder).unwrap();
        assert_eq!(read.train.mass_kg, mass_kg);
        let source = DatasetSource { path: &path, train: Some(TrainId(train)) };
        assert_eq!(dynocar_workshop::dataset::load(source).unwrap(), read);
        let speeds = read.runs.iter().flat_map(|run| &run.samples).map(|it| it.speed_mps);
        assert!(speeds.eq(own.iter().map(|it| it.speed_mps + more_mps)), "train {train}");
    }
    let message = place.refusal("none.mcap", &both, &attached);
    assert!(
        message.ends_with("holds trains 1, 2; a dataset is of one: choose it by --train"),
        "{message}"
    );
}
