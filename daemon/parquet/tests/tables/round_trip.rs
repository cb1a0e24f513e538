//! A recording comes back from Parquet as it was.

use std::path::Path;

use dynocar_mcap::columns::RecordingRow;
use dynocar_mcap::event::Event;
use dynocar_parquet::reading::{read, write_mcap};
use dynocar_parquet::writing::write_folder;
use dynocar_shared::layout::Words;
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};
use proptest::prelude::*;

use crate::support::{Everything, command, write};

/// Any bits, often those of numbers that are easily taken for others.
fn word() -> impl Strategy<Value = u64> {
    prop_oneof![
        any::<u64>(),
        Just(0),
        Just((-0.0f64).to_bits()),
        Just(f64::NAN.to_bits() | 5),
        Just(f64::INFINITY.to_bits()),
        (0..3u64).prop_map(|it| (it as f64).to_bits()),
    ]
}

/// A message of one of two trains, with any content.
fn row() -> impl Strategy<Value = RecordingRow> {
    let sample = prop::collection::vec(word(), 19).prop_map(|words| {
        let mut sample = TrainSample::empty(TrainId(1));
        words.iter().enumerate().for_each(|(index, &it)| sample.set_word(index, it));
        sample.train_id = 1 + words[0] % 2;
        RecordingRow::Sample(sample)
    });
    let snapshot = prop::collection::vec(word(), 100).prop_map(|words| {
        let mut snapshot = ParameterSnapshot::empty();
        for index in 0..snapshot.count() {
            snapshot.set_word(index, words[index % words.len()]);
        }
        (snapshot.train_id, snapshot.pipeline_index) = (1 + words[0] % 2, words[1] as u32 % 3);
        snapshot.pipeline_kind = words[2] as u32 % 30;
        RecordingRow::Snapshot(snapshot.into())
    });
    let event = (prop::collection::vec(word(), 7), any::<u8>(), ".{0,20}").prop_map(
        |(words, is_there, text)| {
            let mut event = Event { text, ..Event::default() };
            for (index, &word) in words.iter().enumerate() {
                event.set_word(index, (index < 3 || is_there >> index & 1 == 1).then_some(word));
            }
            RecordingRow::Event(event)
        },
    );
    prop_oneof![4 => sample, 2 => snapshot, 1 => event]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_recording_comes_back_from_parquet_message_by_message(
        mut messages in prop::collection::vec((any::<u64>(), row()), 0..40),
        last in any::<u64>(),
    ) {
        messages.push((last, RecordingRow::Sample(TrainSample::empty(TrainId(1)))));
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        write(&at("run.mcap"), &messages);
        let written = write_folder(&[at("run.mcap")], &at("run.parquet")).unwrap();
        prop_assert_eq!(written.samples + written.snapshots + written.events, messages.len());
        write_mcap(&read(&at("run.parquet")).unwrap(), &at("again.mcap")).unwrap();
        let (one, two) = (Everything::of(&at("run.mcap")), Everything::of(&at("again.mcap")));
        prop_assert_eq!(one, two);
    }
}

/// A recording of several batches of rows.
fn long(path: &Path) -> Vec<TrainSample> {
    let samples: Vec<TrainSample> = (1..150_000u64)
        .map(|it| {
            let mut sample = TrainSample::empty(TrainId(1 + it % 2))
                .with(dynocar_shared::SampleField::Speed, 20.0 + (it as f64 * 1e-3).sin());
            (sample.sequence, sample.time_ns) = (it, it as i64 * 10_000_000);
            sample
        })
        .collect();
    let messages: Vec<(u64, RecordingRow)> =
        samples.iter().map(|it| (it.time_ns as u64, RecordingRow::Sample(*it))).collect();
    write(path, &messages);
    samples
}

#[test]
fn a_long_recording_becomes_smaller_and_comes_back_and_a_trains_file_stands_for_itself() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let shown = |name: &str| at(name).display().to_string();
    let samples = long(&at("run.mcap"));
    command(&["convert", &shown("run.mcap"), "-o", &shown("run.parquet")]).unwrap();
    command(&["convert", &shown("run.parquet"), "-o", &shown("again.mcap")]).unwrap();
    assert!(Everything::of(&at("run.mcap")) == Everything::of(&at("again.mcap")));
    let size = |name: &str| std::fs::metadata(at(name)).unwrap().len();
    let tables = size("run.parquet/samples-1.parquet") + size("run.parquet/samples-2.parquet");
    assert!(tables < size("run.mcap") / 2, "{tables} of {} bytes", size("run.mcap"));

    std::fs::rename(at("run.parquet/samples-1.parquet"), at("alone.parquet")).unwrap();
    let alone = read(&at("alone.parquet")).unwrap();
    let attached: Vec<&str> = alone.attached.iter().map(|it| it.0.as_str()).collect();
    assert_eq!(attached, ["configuration-1/daemon.toml", "configuration-1/train-1.toml"]);
    let recording = alone.into_recording();
    let expected: Vec<TrainSample> = samples.into_iter().filter(|it| it.train_id == 1).collect();
    assert!(recording.samples == expected);
    command(&["convert", &shown("alone.parquet"), "-o", &shown("dataset")]).unwrap();
    let dataset = dynocar::dataset::load(&at("dataset")).unwrap();
    assert_eq!(dataset.runs[0].samples.len(), expected.len());
}

#[test]
fn a_dataset_becomes_parquet_as_a_controller_would_have_had_it_recorded_and_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/demo");
    for (from, to) in [(&demo, at("demo.parquet")), (&at("demo.parquet"), at("demo"))] {
        command(&["convert", from.to_str().unwrap(), "-o", to.to_str().unwrap()]).unwrap();
    }
    for file in ["dataset.toml", "train.toml", "track.toml", "runs/01.csv", "runs/06.csv"] {
        let same = std::fs::read(demo.join(file)).unwrap()
            == std::fs::read(at("demo").join(file)).unwrap();
        assert!(same, "{file}");
    }
}
