//! Recordings made in the process, from the demo's runs by the demo's daemon.

use std::path::{Path, PathBuf};

use dynocar::config::{DaemonConfig, build_pipeline};
use dynocar::dataset;
use dynocar_analysis::identify::published_samples;
use dynocar_mcap::topic::Message;
use dynocar_mcap::writing::{CONFIGURATION, RecordingWriter, WallClock, folder_of_configuration};
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};

/// The daemon's start, on the monotonic clock of the recording.
pub const EPOCH: u64 = 1_000;

/// The folder of the shipped configuration.
pub fn config_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config")
}

/// The samples of the demo's first two runs.
pub fn samples() -> Vec<TrainSample> {
    let mut dataset = dataset::load(&config_folder().join("demo")).expect("the demo's runs");
    dataset.runs.truncate(2);
    dataset.runs.iter_mut().for_each(|run| run.samples.truncate(700));
    published_samples(&dataset, TrainId(1))
}

/// Returns the answers of the shipped daemon to samples: a snapshot of each pipeline every `every` samples.
pub fn snapshots(samples: &[TrainSample], every: usize) -> Vec<ParameterSnapshot> {
    let config = DaemonConfig::load(&config_folder().join("daemon.toml")).expect("daemon.toml");
    let mut answers = Vec::new();
    for (index, settings) in config.pipelines.iter().enumerate() {
        let mut pipeline =
            build_pipeline(settings, index as u32, &config.trains[0]).expect("a pipeline");
        if let Some(first) = samples.first() {
            pipeline.count_from(first.sequence - 1);
        }
        for (place, sample) in samples.iter().enumerate() {
            pipeline.process(sample);
            if place % every == 0 || place + 1 == samples.len() {
                answers.push(ParameterSnapshot { epoch: EPOCH, ..*pipeline.snapshot() });
            }
        }
    }
    answers
}

/// Writes a recording as the recorder does, with the shipped configuration attached.
pub fn write(path: &Path, samples: &[TrainSample], snapshots: &[ParameterSnapshot]) {
    let file = std::fs::File::create_new(path).expect("a new file");
    let mut writer = RecordingWriter::new(file, WallClock::of_another_host()).expect("a file");
    let files = [
        ("daemon.toml", "daemon.toml"),
        ("demo/train.toml", "train-1.toml"),
        ("demo/track.toml", "track-1.toml"),
    ];
    for (file, name) in files {
        let content = std::fs::read(config_folder().join(file)).expect("a shipped file");
        let name = format!("{}/{name}", folder_of_configuration(1));
        writer.attach(&name, &content, 2_000).expect("attached");
    }
    let pairs = [("number", "1".to_owned()), ("seen_monotonic_ns", "2000".to_owned())];
    writer.metadata(CONFIGURATION, &pairs).expect("written");
    for (index, sample) in samples.iter().enumerate() {
        writer.log_next_at(WallClock::of_another_host().wall_ns(sample.time_ns));
        writer.write(Message::Sample(sample)).expect("written");
        if index % 200 == 0 {
            writer.flush().expect("flushed");
        }
    }
    snapshots.iter().for_each(|it| writer.write(Message::Snapshot(it)).expect("written"));
    writer.finish().expect("finished");
}
