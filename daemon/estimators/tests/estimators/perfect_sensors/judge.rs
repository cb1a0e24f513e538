//! Runs an estimator over a drive and compares the values that it calls `estimated` with the truth.

use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::{Parameter, ParameterSnapshot, Status, TrainId, TrainSample};

use super::drive::{DAVIS, FRICTION, MASS_KG, Phase, train};

/// Number of standard deviations within which a trusted value must lie, unless its relative error is at most
/// `SHARE_MAX`.
const STDS_MAX: f64 = 4.0;
const SHARE_MAX: f64 = 0.05;

/// Counts of a drive's snapshots: all, those called `estimated`, and the wrong ones of these.
#[derive(Clone, Debug, Default)]
pub struct Found {
    pub looks: u64,
    pub trusted: u64,
    pub wrong: u64,
    pub first_wrong: Option<String>,
}

fn is_wrong(value: f64, std: f64, truth: f64) -> bool {
    !((value - truth).abs() <= (STDS_MAX * std).max(SHARE_MAX * truth.abs()))
}

/// Returns the value that is trusted and wrong, if there is one.
fn misled(snapshot: &ParameterSnapshot, carried: f64) -> Option<String> {
    let mean_mps = 0.5 * (snapshot.speed_min_mps + snapshot.speed_max_mps);
    if let Some(estimate) = snapshot.resistance_at(mean_mps) {
        let (value, std) = (estimate.w0_n_per_kn, estimate.w0_std_n_per_kn);
        let truth = DAVIS.w0_n_per_kn(mean_mps);
        if is_wrong(value, std, truth) {
            return Some(format!("w0({mean_mps:.1}) = {value:.3} ± {std:.3}, truth {truth:.3}"));
        }
    }
    let truths = [
        (Parameter::Mass, 1e-3 * MASS_KG),
        // No wheel ever slides: the rail carried the force that the brake demanded.
        (Parameter::Adhesion, carried),
        (Parameter::DiscFriction, FRICTION),
        (Parameter::BrakingRatio, 2.55),
    ];
    truths.into_iter().find_map(|(parameter, truth)| {
        let (value, std) = (snapshot.value(parameter)?, snapshot.std(parameter)?);
        is_wrong(value, std, truth)
            .then(|| format!("{parameter:?} = {value:.4} ± {std:.4}, truth {truth}"))
    })
}

/// Runs an estimator of given settings over a drive's samples.
pub fn run(settings: &EstimatorSettings, samples: &[(TrainSample, Phase)]) -> Found {
    let train = train();
    let estimator = settings.build(&train).expect("default settings");
    let mut pipeline = Pipeline::new(TrainId(1), 0, train, None, estimator);
    let mut found = Found::default();
    let mut carried = 0.0;
    for (index, (sample, phase)) in samples.iter().enumerate() {
        if *phase == Phase::Braking {
            carried = sample.brake_force_n / (GRAVITY_MPS2 * MASS_KG);
        }
        let snapshot = pipeline.process(sample);
        found.looks += 1;
        if snapshot.status() != Status::Estimated {
            continue;
        }
        found.trusted += 1;
        if let Some(what) = misled(snapshot, carried) {
            found.wrong += 1;
            let sentence = || format!("sample {index}, {phase:?}: {what}");
            found.first_wrong.get_or_insert_with(sentence);
        }
    }
    found
}
