//! Mutations of a corpus, given to every reader of foreign bytes.
//!
//! The mutations are random but seeded, and need only the stable compiler: bytes are flipped, cut out, doubled, spliced
//! from other files of the corpus, and replaced by values that often break readers. An input that makes a reader panic
//! is written into the corpus, from where every later run starts.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use dynocar::config::DaemonConfig;
use dynocar::state::{entry::StateContent, file};
use dynocar_analysis::dataset::guess::{GivenMarks, RecordingText, guess};
use dynocar_analysis::dataset::text_layout::{decoded, guessed};
use dynocar_analysis::dataset::{Dataset, Quantity, parse_track, parse_train};
use dynocar_analysis::import::{ImportReading, ImportSource, import};
use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::train::TrainModel;
use dynocar_shared::layout::Words;
use dynocar_shared::{PipelineKind, SampleField, TrainId, TrainSample};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A reader of foreign bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// `dataset.toml` of a dataset.
    Dataset,
    /// A run's table.
    Csv,
    /// A logger's file: its letters, a guess of its contents, and its table as declared.
    Logger,
    /// A train file.
    Train,
    /// A track file.
    Track,
    /// A file of another project.
    Import,
    /// The daemon's configuration.
    Daemon,
    /// The settings of an estimator, and the estimator built from them.
    Estimator,
    /// A state file.
    State,
    /// The bytes of samples in shared memory.
    Sample,
}

/// Tokens over which readers stumble.
const TOKENS: [&str; 26] = [
    "nan",
    "-inf",
    "1e999",
    "-0.0",
    "1e-320",
    "18446744073709551616",
    "-1",
    "0",
    "\"",
    "'",
    "[[",
    "]",
    "{",
    "=",
    ",",
    "\n",
    "\r\n",
    "\u{feff}",
    "\0",
    "\u{fffd}",
    "true",
    "9223372036854775807",
    "23:59:59.999",
    "2026-02-30T24:60:60",
    "+99:99",
    "9999-12-31T23:59:59-23:59",
];

const TRAIN: &str = include_str!("../corpus/train/demo.toml");
const TRACK: &str = include_str!("../corpus/track/demo.toml");
const DATASET: &str = include_str!("../corpus/dataset/dataset.toml");
const CSV: &str = include_str!("../corpus/csv/run.csv");
const LOGGER: &str = include_str!("../corpus/dataset/logger.toml");

impl Target {
    /// All of them.
    pub const ALL: [Target; 10] = [
        Target::Dataset,
        Target::Csv,
        Target::Logger,
        Target::Train,
        Target::Track,
        Target::Import,
        Target::Daemon,
        Target::Estimator,
        Target::State,
        Target::Sample,
    ];

    /// Returns the target's folder of the corpus.
    pub fn folder(self) -> PathBuf {
        let name = format!("{self:?}").to_lowercase();
        Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name)
    }

    /// Feeds the bytes to the reader; true when it accepts them.
    ///
    /// # Panics
    ///
    /// When the reader misbehaves, or accepts an input that it must refuse.
    pub fn feed(self, bytes: &[u8]) -> bool {
        let text = String::from_utf8_lossy(bytes);
        match self {
            Target::Dataset => feed_dataset(&text, CSV),
            Target::Csv => feed_dataset(DATASET, &text),
            Target::Logger => feed_logger(bytes),
            Target::Train => parse_train("train.toml", &text).is_ok_and(|train| {
                assert!(train.mass_kg.is_finite() && train.mass_kg > 0.0, "{train:?}");
                true
            }),
            Target::Track => parse_track("track.toml", &text).is_ok(),
            Target::Import => {
                let source = [ImportSource { label: "file", text: &text }];
                import(&source, None, &ImportReading::default()).is_ok()
            }
            // Names of files in the text lead into the corpus.
            Target::Daemon => {
                let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo/daemon.toml");
                DaemonConfig::from_text(&path, &text).is_ok()
            }
            Target::Estimator => feed_estimator(&text),
            Target::State => {
                // Behind a right header, so that more than the checksum is reached.
                let path = Path::new("x.state");
                let _ = file::content_of(path, bytes);
                let whole = file::content_of(path, &file::bytes_of(&text)).expect("whole");
                StateContent::from_text(path, &whole).is_ok_and(|content| {
                    for stored in &content.estimates {
                        let aged = stored.estimate.after(1e9);
                        assert!(aged.covariance().iter().all(|it| it.is_finite()), "{stored:?}");
                    }
                    true
                })
            }
            Target::Sample => feed_samples(bytes),
        }
    }

    /// Returns the inputs that mutations start from.
    ///
    /// # Panics
    ///
    /// When the corpus cannot be read.
    pub fn corpus(self) -> Vec<Vec<u8>> {
        let mut files: Vec<PathBuf> = std::fs::read_dir(self.folder())
            .expect("the corpus")
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some())
            .collect();
        files.sort();
        let mut inputs: Vec<Vec<u8>> =
            files.iter().map(|path| std::fs::read(path).expect("a file of the corpus")).collect();
        if self == Target::Sample {
            inputs.push(good_samples());
        }
        inputs
    }
}

fn feed_dataset(manifest: &str, csv: &str) -> bool {
    let files = [
        ("dataset.toml", manifest),
        ("train.toml", TRAIN),
        ("track.toml", TRACK),
        ("run.csv", csv),
    ];
    Dataset::load(&files[..]).is_ok_and(|dataset| {
        for sample in dataset.runs.iter().flat_map(|run| &run.samples) {
            assert!(!sample.speed_mps.is_nan(), "{sample:?}");
        }
        true
    })
}

fn feed_logger(bytes: &[u8]) -> bool {
    let Ok(text) = decoded(bytes.to_vec(), guessed(bytes)) else { return false };
    let is_read = feed_dataset(LOGGER, &text);
    let recording = [RecordingText { label: "run.csv", text: &text }];
    let is_guessed = guess(&recording, &[], GivenMarks::default()).is_ok_and(|guess| {
        assert!(guess.column(Quantity::Speed).is_some(), "{guess:?}");
        true
    });
    is_read || is_guessed
}

fn demo_train() -> Arc<TrainModel> {
    Arc::new(parse_train("train.toml", TRAIN).expect("the demo's train"))
}

fn feed_estimator(text: &str) -> bool {
    let Ok(settings) = toml::from_str::<EstimatorSettings>(text) else { return false };
    let train = demo_train();
    let Ok(estimator) = settings.build(&train) else { return false };
    let mut pipeline = Pipeline::new(TrainId(1), 0, train, None, estimator);
    let words = good_samples();
    for sample in samples_of(&words) {
        let snapshot = pipeline.process(&sample);
        assert!(snapshot.values.iter().all(|it| it.is_finite()), "{settings:?}: {snapshot:?}");
    }
    true
}

/// Fifty samples of a coasting train, as they lie in shared memory.
fn good_samples() -> Vec<u8> {
    use dynocar_shared::SampleField as Field;
    let sample = |index: u64| {
        let speed_mps = 20.0 - 0.01 * index as f64;
        let mut sample = TrainSample::empty(TrainId(1))
            .with(Field::Speed, speed_mps)
            .with(Field::TractionForce, 0.0)
            .with(Field::BrakeForce, 0.0)
            .with(Field::Gradient, 0.0);
        (sample.sequence, sample.time_ns, sample.run) = (index + 1, index as i64 * 200_000_000, 1);
        bytes_of(&sample)
    };
    (0..50).flat_map(sample).collect()
}

/// The place of the first measured quantity among the fields of a sample.
const FIRST_MEASURED: usize = TrainSample::LAYOUT.len() - SampleField::ALL.len();

fn bytes_of(it: &TrainSample) -> Vec<u8> {
    let integers = [it.time_ns as u64, it.published_ns as u64, it.sequence, it.train_id];
    let small = u64::from(it.valid)
        | u64::from(it.flags) << 16
        | u64::from(it.direction as u8) << 24
        | u64::from(it.run) << 32;
    let measured = (FIRST_MEASURED..TrainSample::LAYOUT.len()).map(|index| it.word(index));
    let words = integers.into_iter().chain([small]).chain(measured);
    words.flat_map(u64::to_le_bytes).collect()
}

fn samples_of(bytes: &[u8]) -> impl Iterator<Item = TrainSample> + '_ {
    bytes.chunks_exact(size_of::<TrainSample>()).map(|chunk| {
        let word = |index: usize| {
            let bytes: [u8; 8] = std::array::from_fn(|i| chunk[8 * index + i]);
            u64::from_le_bytes(bytes)
        };
        let mut sample = TrainSample {
            time_ns: word(0) as i64,
            published_ns: word(1) as i64,
            sequence: word(2),
            valid: word(4) as u16,
            flags: (word(4) >> 16) as u8,
            direction: (word(4) >> 24) as i8,
            run: (word(4) >> 32) as u32,
            ..TrainSample::empty(TrainId(word(3)))
        };
        for k in 0..SampleField::ALL.len() {
            sample.set_word(FIRST_MEASURED + k, word(5 + k));
        }
        sample
    })
}

/// The kinds that take samples by quite different ways.
const SAMPLE_KINDS: [PipelineKind; 5] = [
    PipelineKind::VMils,
    PipelineKind::ResistanceKalman,
    PipelineKind::TrajectoryKalman,
    PipelineKind::MassKalman,
    PipelineKind::ResidualMonitor,
];

fn feed_samples(bytes: &[u8]) -> bool {
    let train = demo_train();
    for kind in SAMPLE_KINDS {
        let settings = EstimatorSettings::default_of(kind).expect("a kind that can be built");
        let estimator = settings.build(&train).expect("default settings");
        let mut pipeline = Pipeline::new(TrainId(1), 0, Arc::clone(&train), None, estimator);
        for (offered, sample) in (1..).zip(samples_of(bytes)) {
            let it = pipeline.process(&sample);
            assert_eq!(it.samples_used + it.samples_rejected, offered, "{kind}");
            let mut numbers = it.values.iter().chain(&it.covariance);
            assert!(numbers.all(|it| it.is_finite()), "{kind}: {sample:?}: {it:?}");
        }
    }
    true
}

fn mutate(input: &mut Vec<u8>, others: &[Vec<u8>], random: &mut ChaCha8Rng) {
    for _ in 0..random.random_range(1..6) {
        let length = input.len();
        if length == 0 {
            input.push(random.random());
            continue;
        }
        let index = random.random_range(0..length);
        let end = (index + random.random_range(0..40)).min(length);
        match random.random_range(0..8) {
            0 => input[index] ^= 1 << random.random_range(0..8),
            1 => input[index] = random.random(),
            2 => drop(input.drain(index..end)),
            3 => {
                let doubled = input[index..end].to_vec();
                input.splice(index..index, doubled);
            }
            4 => input.truncate(index),
            5 => {
                let other = &others[random.random_range(0..others.len())];
                let start = random.random_range(0..=other.len());
                let stop = (start + random.random_range(0..80)).min(other.len());
                input.splice(index..end, other[start..stop].iter().copied());
            }
            6 => {
                // A whole number or word becomes something else.
                let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || b"._-+".contains(byte);
                let word = input[index..].iter().take_while(|byte| is_word(byte)).count();
                let token = TOKENS[random.random_range(0..TOKENS.len())];
                input.splice(index..index + word, token.bytes());
            }
            _ => {
                let token = TOKENS[random.random_range(0..TOKENS.len())];
                input.splice(index..index, token.bytes());
            }
        }
    }
}

/// Feeds the corpus, then `rounds` mutations of it; returns the number of accepted inputs.
///
/// # Panics
///
/// When the reader misbehaves; the input is then in the corpus.
pub fn run(target: Target, rounds: u64, seed: u64) -> u64 {
    let corpus = target.corpus();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut accepted = 0;
    for round in 0..corpus.len() as u64 + rounds {
        let input = match corpus.get(round as usize) {
            Some(input) => input.clone(),
            None => {
                let mut input = corpus[random.random_range(0..corpus.len())].clone();
                mutate(&mut input, &corpus, &mut random);
                input
            }
        };
        match catch_unwind(AssertUnwindSafe(|| target.feed(&input))) {
            Ok(is_accepted) => accepted += u64::from(is_accepted),
            Err(cause) => {
                let path = target.folder().join(format!("panic-{seed}-{round}.bin"));
                // The panic says more than a failure to keep the input.
                let _ = std::fs::write(&path, &input);
                dynocar::output::report_line(&format!(
                    "{target:?}, seed {seed}, round {round}: {}",
                    path.display()
                ));
                std::panic::resume_unwind(cause);
            }
        }
    }
    accepted
}
