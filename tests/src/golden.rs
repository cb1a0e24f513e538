//! Estimates of every estimator from the demo's recorded runs, bit for bit, as a small text file.
//!
//! Rust's arithmetic gives the same bits on every machine, but `exp`, `ln` and the like come from
//! the C library and may differ in the last place from one release to the next. The file
//! therefore holds a fingerprint of these functions: where it is the same, every bit of every
//! snapshot must be the same; elsewhere the final values must agree to [`TOLERANCE`].

use std::fmt::Write;
use std::path::PathBuf;
use std::sync::Arc;

use dynocar::dataset;
use dynocar_analysis::identify::{default_estimators, published_samples};
use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::{ParameterSnapshot, TrainId};

/// Relative difference of final values that another C library may cause.
pub const TOLERANCE: f64 = 1e-6;

/// Returns the file's place.
pub fn path() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("golden/demo.txt")
}

/// Estimates of one estimator from the runs.
#[derive(Clone, Debug, PartialEq)]
pub struct GoldenLine {
    /// The kind of estimator.
    pub kind: String,
    /// Samples used, rejected, lost, and updates.
    pub counts: [u64; 4],
    /// Hash over every bit of every snapshot.
    pub hash: u64,
    /// Final values.
    pub values: Vec<f64>,
}

/// The content of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Golden {
    /// Fingerprint of the C library's functions.
    pub fingerprint: u64,
    /// By kind.
    pub lines: Vec<GoldenLine>,
}

fn mix(hash: &mut u64, word: u64) {
    for byte in word.to_le_bytes() {
        *hash = (*hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    }
}

const HASH_START: u64 = 0xcbf2_9ce4_8422_2325;

/// Hash over the results of the functions that the C library provides.
pub fn fingerprint() -> u64 {
    let functions: [fn(f64) -> f64; 9] = [
        f64::exp,
        f64::ln,
        f64::sin,
        f64::cos,
        f64::tanh,
        f64::atan,
        f64::exp_m1,
        f64::ln_1p,
        |x| x.powf(1.7),
    ];
    let mut hash = HASH_START;
    for step in 1..=2_000 {
        // Not a multiple of anything, 0.013 to 26.
        let argument = std::hint::black_box(f64::from(step) * 0.013_031);
        functions.iter().for_each(|function| mix(&mut hash, function(argument).to_bits()));
    }
    hash
}

/// Returns a snapshot as made by the samples: without the times of this run of the daemon, and without the stamps
/// of its configuration.
pub fn without_stamps(snapshot: &ParameterSnapshot) -> ParameterSnapshot {
    ParameterSnapshot {
        epoch: 0,
        pipeline_index: 0,
        quantities: 0,
        train_quantities: 0,
        sample_published_ns: 0,
        published_ns: 0,
        vouched_ns: 0,
        model_hash: 0,
        ..*snapshot
    }
}

/// Adds a snapshot to a hash, without the stamps of a daemon's clock.
fn mix_snapshot(hash: &mut u64, it: &ParameterSnapshot) {
    let floats = it.values.iter().chain(&it.covariance).chain([
        &it.innovation_normalised,
        &it.innovation_mean_square,
        &it.innovation_correlation,
        &it.unexplained_force_n,
        &it.unexplained_force_std_n,
        &it.suspicion_evidence,
        &it.speed_min_mps,
        &it.speed_max_mps,
    ]);
    floats.for_each(|value| mix(hash, value.to_bits()));
    let words = [it.status, it.reason, it.parameter_count, it.excited]
        .into_iter()
        .chain([it.missing_manoeuvres, it.suspected_effect])
        .chain([it.suspected_alternatives, it.suspicion_age_s])
        .chain(it.parameters)
        .chain(it.rejected_by_reason);
    words.for_each(|word| mix(hash, u64::from(word)));
    let counts = [it.sequence, it.generation, it.sample_sequence, it.updates];
    counts.into_iter().for_each(|count| mix(hash, count));
}

/// Runs every estimator over the demo's runs.
///
/// # Panics
///
/// When the demo's runs cannot be read.
pub fn compute() -> Golden {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../config/demo");
    let dataset = dataset::load(&folder).expect("the demo's runs");
    let train_id = TrainId(1);
    let samples = published_samples(&dataset, train_id);
    let line = |settings: &dynocar_estimators::EstimatorSettings| {
        let train = Arc::clone(&dataset.train);
        let estimator = settings.build(&train).expect("default settings");
        let mut pipeline = Pipeline::new(train_id, 0, train, dataset.track.clone(), estimator);
        let mut hash = HASH_START;
        for sample in &samples {
            mix_snapshot(&mut hash, pipeline.process(sample));
        }
        let last = pipeline.snapshot();
        GoldenLine {
            kind: settings.kind().to_string(),
            counts: [last.samples_used, last.samples_rejected, last.samples_lost, last.updates],
            hash,
            values: last.values[..last.parameter_count as usize].to_vec(),
        }
    };
    Golden { fingerprint: fingerprint(), lines: default_estimators().iter().map(line).collect() }
}

impl Golden {
    /// Returns the file's text.
    pub fn to_text(&self) -> String {
        let mut text = format!(
            "# The demo's recorded runs through every estimator: kind, used, rejected, lost, updates,\n\
             # hash over all snapshots, final values. Made anew, after a change that is meant, by\n\
             # cargo run --release -p dynocar-tests --bin dynocar-soak -- golden\n\
             libm {:016x}\n",
            self.fingerprint
        );
        for line in &self.lines {
            let [used, rejected, lost, updates] = line.counts;
            // Writing into a String cannot fail.
            let _ =
                write!(text, "{} {used} {rejected} {lost} {updates} {:016x}", line.kind, line.hash);
            for value in &line.values {
                let _ = write!(text, " {value:e}");
            }
            text.push('\n');
        }
        text
    }

    /// Reads the file's text; `None` when it has another form.
    pub fn from_text(text: &str) -> Option<Self> {
        let hash = |word: &str| u64::from_str_radix(word, 16).ok();
        let mut rows = text.lines().filter(|line| !line.starts_with('#'));
        let fingerprint = hash(rows.next()?.strip_prefix("libm ")?)?;
        let line = |row: &str| {
            let words: Vec<&str> = row.split(' ').collect();
            let [kind, used, rejected, lost, updates, bits, values @ ..] = &words[..] else {
                return None;
            };
            let count = |word: &str| word.parse().ok();
            Some(GoldenLine {
                kind: (*kind).to_owned(),
                counts: [count(used)?, count(rejected)?, count(lost)?, count(updates)?],
                hash: hash(bits)?,
                values: values.iter().map(|it| it.parse().ok()).collect::<Option<_>>()?,
            })
        };
        Some(Golden { fingerprint, lines: rows.map(line).collect::<Option<_>>()? })
    }
}

/// Observations by which the windows of expectation maximisation slide: half of a window. By default they slide
/// so far that each observation is looked at eight times, which takes most of the time of all estimators together.
const SLIDE: usize = 20;

/// Returns the default estimators, with windows of expectation maximisation that overlap by half.
pub fn frugal_estimators() -> Vec<EstimatorSettings> {
    let mut all = default_estimators();
    for settings in &mut all {
        if let EstimatorSettings::AdhesionEm(own) | EstimatorSettings::BrakeEm(own) = settings {
            own.slide = SLIDE;
        }
    }
    all
}
