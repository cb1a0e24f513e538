//! The bus's mass from stop to stop against the passengers counted: live, and from each section alone.

use std::sync::Arc;

use dynocar_analysis::dataset::{Dataset, Role, Run};
use dynocar_analysis::identify::identify;
use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::terms::wheel::STANDING_MPS;
use dynocar_shared::{
    Parameter, ParameterSnapshot, PipelineKind, SampleField, Status, TrainId, TrainSample,
};

/// Least length in s of a standstill that is a stop.
const STOP_S: f64 = 5.0;
/// Least time in s of motion in a section; a shorter motion shows little of the mass.
const MOVING_MIN_S: f64 = 20.0;

/// Learned and counted mass of one section, in t.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    learned_t: f64,
    std_t: f64,
    counted_t: f64,
}

/// The masses of all sections by one way of learning.
#[derive(Clone, Debug, Default)]
pub struct StopMasses {
    pairs: Vec<Pair>,
    /// Sections of which nothing was said.
    silent: usize,
}

impl StopMasses {
    /// Adds those of another line.
    pub fn extend(&mut self, other: StopMasses) {
        self.pairs.extend(other.pairs);
        self.silent += other.silent;
    }

    fn take(&mut self, snapshot: &ParameterSnapshot, counted_t: Option<f64>) {
        let Some(counted_t) = counted_t else { return };
        let learned = snapshot.value(Parameter::Mass).zip(snapshot.std(Parameter::Mass));
        match learned.filter(|_| snapshot.status() != Status::Unestimated) {
            Some((learned_t, std_t)) => self.pairs.push(Pair { learned_t, std_t, counted_t }),
            None => self.silent += 1,
        }
    }

    /// Scatter about the counted mass in t, correlation with it, and words.
    pub fn summary(&self) -> (f64, f64, String) {
        let count = self.pairs.len().max(1) as f64;
        let mean = |of: &dyn Fn(&Pair) -> f64| self.pairs.iter().map(of).sum::<f64>() / count;
        let (learned, counted) = (mean(&|it| it.learned_t), mean(&|it| it.counted_t));
        let spread = |one: &dyn Fn(&Pair) -> f64, other: &dyn Fn(&Pair) -> f64| {
            mean(&|it| one(it) * other(it))
        };
        let own = |it: &Pair| it.learned_t - learned;
        let true_one = |it: &Pair| it.counted_t - counted;
        let off = |it: &Pair| own(it) - true_one(it);
        let scatter_t = spread(&off, &off).sqrt();
        let correlation =
            spread(&own, &true_one) / (spread(&own, &own) * spread(&true_one, &true_one)).sqrt();
        let normalised = mean(&|it| ((it.learned_t - it.counted_t) / it.std_t).powi(2)).sqrt();
        let words = format!(
            "{scatter_t:.3} t, correlation {correlation:.3}, offset {:.3} t, {normalised:.1} of its \
             own standard deviations, {} sections, nothing said of {}",
            learned - counted,
            self.pairs.len(),
            self.silent
        );
        (scatter_t, correlation, words)
    }
}

/// Returns the index ranges of the samples from stop to stop.
fn sections(run: &Run) -> Vec<std::ops::Range<usize>> {
    let samples = &run.samples;
    let mut cuts = vec![0];
    let mut standing_from = None;
    for (index, sample) in samples.iter().enumerate() {
        if sample.speed_mps < STANDING_MPS {
            standing_from.get_or_insert(index);
            continue;
        }
        if let Some(from) = standing_from.take() {
            let stood_s = (sample.time_ns - samples[from].time_ns) as f64 * 1e-9;
            if stood_s >= STOP_S && from > 0 {
                cuts.push(index - 1);
            }
        }
    }
    cuts.push(samples.len());
    let long = |range: &std::ops::Range<usize>| {
        let moving = samples[range.clone()].windows(2).filter(|it| it[0].speed_mps > 1.0);
        moving.map(|it| (it[1].time_ns - it[0].time_ns) as f64 * 1e-9).sum::<f64>() >= MOVING_MIN_S
    };
    cuts.windows(2).map(|pair| pair[0]..pair[1]).filter(long).collect()
}

/// Returns the mass counted while a section moved, in t; `None` where nobody counted.
fn counted_t(samples: &[TrainSample]) -> Option<f64> {
    let moving = samples.iter().filter(|it| it.speed_mps > 1.0);
    let counted = moving.filter_map(|it| it.get(SampleField::Mass));
    let (count, sum) = counted.fold((0.0, 0.0), |(count, sum), kg| (count + 1.0, sum + kg));
    (count > 0.0).then_some(1e-3 * sum / count)
}

/// Returns a sample as a vehicle sends it that counts nobody.
fn uncounted(sample: &TrainSample) -> TrainSample {
    let valid = sample.valid & !SampleField::Mass.bit();
    TrainSample { valid, mass_kg: f64::NAN, ..*sample }
}

/// Returns the trips held out, fed to the pipeline as a daemon feeds it.
pub fn live(dataset: &Dataset, kind: PipelineKind) -> StopMasses {
    let settings = EstimatorSettings::default_of(kind).expect("the kind can be built");
    let train = &dataset.train;
    let estimator = settings.build(train).expect("default settings");
    let mut pipeline =
        Pipeline::new(TrainId(1), 0, Arc::clone(train), dataset.track.clone(), estimator);
    let (mut masses, mut sequence) = (StopMasses::default(), 0);
    for run in held_out(dataset) {
        let sections = sections(run);
        for (index, sample) in run.samples.iter().enumerate() {
            sequence += 1;
            let said = pipeline.process(&TrainSample {
                sequence,
                train_id: 1,
                run: run.number,
                ..uncounted(sample)
            });
            if let Some(section) = sections.iter().find(|range| range.end == index + 1) {
                masses.take(said, counted_t(&run.samples[section.clone()]));
            }
        }
    }
    masses
}

/// Returns each section of the trips held out alone, as `identify --per-run` does with runs.
pub fn alone(dataset: &Dataset, kind: PipelineKind) -> StopMasses {
    let settings = EstimatorSettings::default_of(kind).expect("the kind can be built");
    let mut masses = StopMasses::default();
    for run in held_out(dataset) {
        for section in sections(run) {
            let own = &run.samples[section];
            let samples: Vec<TrainSample> = (1..)
                .zip(own)
                .map(|(sequence, sample)| TrainSample {
                    sequence,
                    train_id: 1,
                    ..uncounted(sample)
                })
                .collect();
            let said = identify(dataset, &samples, &settings).expect("default settings").estimate();
            masses.take(&said, counted_t(own));
        }
    }
    masses
}

fn held_out(dataset: &Dataset) -> impl Iterator<Item = &Run> {
    dataset.runs.iter().filter(|run| run.role == Role::Holdout)
}
