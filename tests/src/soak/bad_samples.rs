//! Every pipeline under every failure of its sensors.

use std::sync::Arc;

use dynocar_analysis::identify::default_estimators;
use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::train::Davis;
use dynocar_shared::{Parameter, ParameterSnapshot, Status, TrainSample};

use crate::sensor_failures::{SensorFailure, Spoiled};
use crate::simulator::sensors::SIMULATED_TRAIN;
use crate::simulator::{
    EffectRequest, SimulatedDataset, SimulatorSettings, TrainType, TrueDeviations, simulate,
};

/// Greatest distance of a trusted value from the truth, in standard deviations.
const STDS_MAX: f64 = 4.0;
/// Further allowance as a share of the truth, since the declared model is not the simulator's.
const SHARE_MAX: f64 = 0.05;

/// A trusted value that is wrong.
#[derive(Clone, Debug)]
pub struct Misled {
    /// The failure.
    pub failure: Option<SensorFailure>,
    /// Its rate.
    pub rate: f64,
    /// The kind of estimator.
    pub kind: String,
    /// Statement and truth.
    pub what: String,
}

/// Samples between two looks at an estimate, 40 s.
pub const LOOK_SAMPLES: u64 = 200;

/// How often estimates were looked at, trusted, and wrong nevertheless.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SoakTally {
    /// Looks.
    pub looks: u64,
    /// Looks at an estimate called `estimated`.
    pub trusted: u64,
    /// Looks at such an estimate that was wrong.
    pub wrong: u64,
    /// Runs at whose end it was.
    pub wrong_at_end: u64,
}

impl SoakTally {
    fn add(&mut self, snapshot: &ParameterSnapshot, is_wrong: bool) {
        self.looks += 1;
        self.trusted += u64::from(snapshot.status() == Status::Estimated);
        self.wrong += u64::from(is_wrong);
    }
}

impl std::ops::AddAssign for SoakTally {
    fn add_assign(&mut self, other: SoakTally) {
        self.looks += other.looks;
        self.trusted += other.trusted;
        self.wrong += other.wrong;
        self.wrong_at_end += other.wrong_at_end;
    }
}

/// One kind of estimator over a scene.
#[derive(Clone, Debug)]
pub struct WatchedSnapshots {
    /// The kind of estimator.
    pub kind: String,
    /// Counts over all looks.
    pub tally: SoakTally,
    /// Whether it was misled at the end.
    pub misled_at_end: Option<Misled>,
}

/// Simulated driving without anything undeclared.
#[derive(Debug)]
pub struct SoakScene {
    data: SimulatedDataset,
    samples: Vec<TrainSample>,
    estimators: Vec<EstimatorSettings>,
}

impl SoakScene {
    /// Returns the scene of a seed and a type of train.
    pub fn new(seed: u64, train_type: TrainType) -> Self {
        let mut settings = SimulatorSettings::new(seed, EffectRequest::none());
        settings.train_type = Some(train_type);
        settings.runs = 2;
        settings.holdout_runs = 0;
        settings.duration_s = 400.0;
        settings.deviations = TrueDeviations::NONE;
        settings.resistance_spread = 0.5;
        let data = simulate(&settings);
        let mut samples: Vec<TrainSample> = Vec::new();
        for (run, recorded) in (1..).zip(&data.runs) {
            for sample in &recorded.samples {
                let sequence = samples.len() as u64 + 1;
                samples.push(TrainSample { sequence, run, ..*sample });
            }
        }
        SoakScene { data, samples, estimators: default_estimators() }
    }

    /// Returns the same before other estimators than those by default.
    pub fn before(self, estimators: Vec<EstimatorSettings>) -> Self {
        SoakScene { estimators, ..self }
    }

    /// Runs every estimator over the samples under a failure; gives those that were misled at the
    /// end.
    ///
    /// # Panics
    ///
    /// As [`SoakScene::watch`].
    pub fn run(&self, failure: Option<SensorFailure>, rate: f64, seed: u64) -> Vec<Misled> {
        let watched = self.watch(failure, rate, seed, |_| true).into_iter();
        watched.filter_map(|it| it.misled_at_end).collect()
    }

    /// Runs the estimators of some kinds over the samples under a failure, with a look every
    /// [`LOOK_SAMPLES`] samples and at the end.
    ///
    /// # Panics
    ///
    /// When a snapshot holds a value that is not finite, or a sample is not accounted for.
    pub fn watch(
        &self,
        failure: Option<SensorFailure>,
        rate: f64,
        seed: u64,
        is_wanted: impl Fn(&str) -> bool,
    ) -> Vec<WatchedSnapshots> {
        let spoiled = match failure {
            Some(failure) => failure.apply(&self.samples, rate, seed),
            None => Spoiled { samples: self.samples.clone(), dropped: 0 },
        };
        let mut all = Vec::new();
        for settings in &self.estimators {
            let kind = settings.kind().to_string();
            if !is_wanted(&kind) {
                continue;
            }
            let case = format!("{failure:?} at {rate}, seed {seed}, {kind}");
            let mut watched =
                WatchedSnapshots { kind, tally: SoakTally::default(), misled_at_end: None };
            let misled = |what| Misled { failure, rate, kind: watched.kind.clone(), what };
            let last = self.feed(settings, &spoiled, failure, &case, |run, it| {
                // Before a train departs, the mass of the run before may stand.
                let wrong = self.misled(it, run).and_then(|_| self.misled(it, run.max(2) - 1));
                watched.tally.add(it, wrong.is_some());
            });
            watched.misled_at_end = self.misled(&last, self.data.runs.len() as u32).map(misled);
            watched.tally.wrong_at_end += u64::from(watched.misled_at_end.is_some());
            all.push(watched);
        }
        all
    }

    fn feed(
        &self,
        settings: &EstimatorSettings,
        spoiled: &Spoiled,
        failure: Option<SensorFailure>,
        case: &str,
        mut look: impl FnMut(u32, &ParameterSnapshot),
    ) -> ParameterSnapshot {
        let train = Arc::new(self.data.declared_train().clone());
        let estimator = settings.build(&train).expect("default settings");
        let track = Some(Arc::new(self.data.track().clone()));
        let mut pipeline = Pipeline::new(SIMULATED_TRAIN, 0, train, track, estimator);
        for (offered, sample) in (1..).zip(&spoiled.samples) {
            let it = pipeline.process(sample);
            assert_eq!(it.samples_used + it.samples_rejected, offered, "{case}");
            assert_finite(it, case);
            if offered % LOOK_SAMPLES == 0 || offered == spoiled.samples.len() as u64 {
                look(sample.run, it);
            }
        }
        let last = *pipeline.snapshot();
        let by_reason: u64 = last.rejected_by_reason.iter().map(|&it| u64::from(it)).sum();
        assert_eq!(by_reason, last.samples_rejected, "{case}: by reason");
        if failure != Some(SensorFailure::SequenceJump) {
            assert_eq!(last.samples_lost, spoiled.dropped, "{case}: lost");
        }
        last
    }

    /// Returns the false statement of a trusted estimate in a run.
    fn misled(&self, snapshot: &ParameterSnapshot, run: u32) -> Option<String> {
        if snapshot.status() != Status::Estimated {
            return None;
        }
        let Davis { a, b, c } = self.data.train.resistance;
        let mean_mps = 0.5 * (snapshot.speed_min_mps + snapshot.speed_max_mps);
        if let Some(estimate) = snapshot.resistance_at(mean_mps) {
            let truth = a + mean_mps * (b + mean_mps * c);
            let (value, std) = (estimate.w0_n_per_kn, estimate.w0_std_n_per_kn);
            if (value - truth).abs() > STDS_MAX * std + SHARE_MAX * truth {
                return Some(format!(
                    "w0({mean_mps:.1}) {value:.3} ± {std:.3}, truth {truth:.3} N/kN"
                ));
            }
        }
        let truth_t = 1e-3 * self.data.runs[run as usize - 1].plan.mass_kg;
        let (value, std) = (snapshot.value(Parameter::Mass)?, snapshot.std(Parameter::Mass)?);
        let is_wrong = (value - truth_t).abs() > STDS_MAX * std + SHARE_MAX * truth_t;
        is_wrong.then(|| format!("mass {value:.1} ± {std:.1}, truth {truth_t:.1} t"))
    }
}

fn assert_finite(it: &ParameterSnapshot, case: &str) {
    let others = [
        it.innovation_normalised,
        it.innovation_mean_square,
        it.innovation_correlation,
        it.unexplained_force_n,
        it.unexplained_force_std_n,
        it.suspicion_evidence,
        it.speed_min_mps,
        it.speed_max_mps,
    ];
    let mut all = it.values.iter().chain(&it.covariance).chain(&others);
    assert!(all.all(|value| value.is_finite()), "{case}: {it:?}");
    for i in 0..it.parameter_count as usize {
        assert!(it.covariance_at(i, i) >= 0.0, "{case}: a negative variance: {it:?}");
    }
}
