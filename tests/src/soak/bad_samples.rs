//! Every pipeline under every failure of its sensors.

use std::sync::Arc;

use dynocar::identify::default_estimators;
use dynocar_core::pipeline::{EstimatorSettings, Pipeline};
use dynocar_core::train::Davis;
use dynocar_shared::{Parameter, ParameterSnapshot, Status, TrainSample};

use crate::sensor_failures::{SensorFailure, Spoiled};
use crate::simulator::sensors::SIMULATED_TRAIN;
use crate::simulator::{EffectRequest, SimulatedDataset, SimulatorSettings, TrainType, simulate};

/// Standard deviations within which a trusted value must lie.
const STDS_MAX: f64 = 4.0;
/// Share of the truth that is let pass beyond that: the declared model is not the simulator's.
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
    /// What it said and what is true.
    pub what: String,
}

/// Simulated driving without anything undeclared.
#[derive(Debug)]
pub struct Scene {
    data: SimulatedDataset,
    samples: Vec<TrainSample>,
}

impl Scene {
    /// The scene of a seed and a type of train.
    pub fn new(seed: u64, train_type: TrainType) -> Self {
        let mut settings = SimulatorSettings::new(seed, EffectRequest::none());
        settings.train_type = Some(train_type);
        settings.runs = 2;
        settings.holdout_runs = 0;
        settings.duration_s = 400.0;
        settings.hidden_variation = 0.0;
        settings.resistance_spread = 0.5;
        let data = simulate(&settings);
        let mut samples: Vec<TrainSample> = Vec::new();
        for (run, recorded) in (1..).zip(&data.runs) {
            for sample in &recorded.samples {
                let sequence = samples.len() as u64 + 1;
                samples.push(TrainSample { sequence, run, ..*sample });
            }
        }
        Scene { data, samples }
    }

    /// Runs every estimator over the samples under a failure; gives those that were misled.
    ///
    /// # Panics
    ///
    /// When a snapshot holds what is not finite, or a sample is not accounted for.
    pub fn run(&self, failure: Option<SensorFailure>, rate: f64, seed: u64) -> Vec<Misled> {
        let spoiled = match failure {
            Some(failure) => failure.apply(&self.samples, rate, seed),
            None => Spoiled { samples: self.samples.clone(), dropped: 0 },
        };
        let of_kind = |settings: &EstimatorSettings| {
            let told = format!("{failure:?} at {rate}, seed {seed}, {}", settings.kind());
            let last = self.feed(settings, &spoiled, failure, &told);
            let what = self.misled(&last)?;
            Some(Misled { failure, rate, kind: settings.kind().to_string(), what })
        };
        default_estimators().iter().filter_map(of_kind).collect()
    }

    fn feed(
        &self,
        settings: &EstimatorSettings,
        spoiled: &Spoiled,
        failure: Option<SensorFailure>,
        told: &str,
    ) -> ParameterSnapshot {
        let train = Arc::new(self.data.declared_train().clone());
        let estimator = settings.build(&train).expect("default settings");
        let track = Some(Arc::new(self.data.track().clone()));
        let mut pipeline = Pipeline::new(SIMULATED_TRAIN, 0, train, track, estimator);
        for (offered, sample) in (1..).zip(&spoiled.samples) {
            let it = pipeline.process(sample);
            assert_eq!(it.samples_used + it.samples_rejected, offered, "{told}");
            assert_finite(it, told);
        }
        let last = *pipeline.snapshot();
        let by_reason: u64 = last.rejected_by_reason.iter().map(|&it| u64::from(it)).sum();
        assert_eq!(by_reason, last.samples_rejected, "{told}: by reason");
        if failure != Some(SensorFailure::SequenceJump) {
            assert_eq!(last.samples_lost, spoiled.dropped, "{told}: lost");
        }
        last
    }

    /// What a trusted estimate says that is not so.
    fn misled(&self, snapshot: &ParameterSnapshot) -> Option<String> {
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
        let last_run = &self.data.runs[self.data.runs.len() - 1];
        let truth_t = 1e-3 * last_run.plan.mass_kg;
        let (value, std) = (snapshot.value(Parameter::Mass)?, snapshot.std(Parameter::Mass)?);
        let is_wrong = (value - truth_t).abs() > STDS_MAX * std + SHARE_MAX * truth_t;
        is_wrong.then(|| format!("mass {value:.1} ± {std:.1}, truth {truth_t:.1} t"))
    }
}

fn assert_finite(it: &ParameterSnapshot, told: &str) {
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
    assert!(all.all(|value| value.is_finite()), "{told}: {it:?}");
    for i in 0..it.parameter_count as usize {
        assert!(it.covariance_at(i, i) >= 0.0, "{told}: a negative variance: {it:?}");
    }
}
