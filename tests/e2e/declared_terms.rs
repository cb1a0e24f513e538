//! Every term that can be declared, with every estimator: a true declaration changes no estimate.

#[path = "declared/drive.rs"]
mod drive;
#[path = "declared/terms.rs"]
mod terms;

use std::sync::Arc;

use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{Parameter, ParameterSnapshot, PipelineKind, Status, TrainSample};
use dynocar_tests::golden::frugal_estimators;

use drive::Drive;
use terms::{Declaration, GRADIENT, TRACK, TRAIN, World, declarations};

/// Share of its own standard deviation by which an estimate may move.
const SHARE_MAX: f64 = 0.25;
/// The same for estimates by random particles, which diverge after a difference in the last bit.
const PARTICLES_SHARE_MAX: f64 = 1.0;
/// Speeds in m/s at which resistances are compared.
const SPEEDS_MPS: [f64; 3] = [6.0, 12.0, 20.0];

fn last_snapshot(
    settings: &EstimatorSettings,
    world: &World,
    samples: &[TrainSample],
) -> ParameterSnapshot {
    let train = Arc::new(world.train.clone());
    let track = Some(Arc::new(world.track.clone()));
    let estimator = settings.build(&train).expect("default settings");
    let mut pipeline = Pipeline::new(drive::TRAIN, 0, train, track, estimator);
    for sample in samples {
        pipeline.process(sample);
    }
    *pipeline.snapshot()
}

/// Returns the estimates of a snapshot: name, value and standard deviation.
fn estimates(snapshot: &ParameterSnapshot) -> Vec<(String, f64, f64)> {
    let davis = [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC];
    let mut all: Vec<(String, f64, f64)> = Parameter::ALL
        .iter()
        .filter(|parameter| !davis.contains(parameter))
        .filter_map(|&it| Some((it.to_string(), snapshot.value(it)?, snapshot.std(it)?)))
        // A quantity that is not yet estimated has no standard deviation.
        .filter(|(_, _, std)| *std > 0.0)
        .collect();
    for speed_mps in SPEEDS_MPS {
        if let Some(at) = snapshot.resistance_at(speed_mps) {
            all.push((format!("w0({speed_mps})"), at.w0_n_per_kn, at.w0_std_n_per_kn));
        }
    }
    all
}

/// Describes the changed estimates; a mass is expected to change by a factor.
fn moved(base: &ParameterSnapshot, now: &ParameterSnapshot, mass_factor: f64) -> Vec<String> {
    let (before, after) = (estimates(base), estimates(now));
    let share_max = match base.pipeline_kind() {
        Some(PipelineKind::AdhesionEm | PipelineKind::BrakeEm) => PARTICLES_SHARE_MAX,
        _ => SHARE_MAX,
    };
    if before.len() != after.len() {
        return vec![format!("{} estimates, were {}", after.len(), before.len())];
    }
    let mut all: Vec<String> = before
        .into_iter()
        .zip(after)
        .filter_map(|((name, value, std), (_, found, _))| {
            let factor = if name == Parameter::Mass.name() { mass_factor } else { 1.0 };
            let expected = factor * value;
            let bound = share_max * std.max(1e-3 * value.abs());
            let has_moved = !((found - expected).abs() <= bound);
            has_moved.then(|| format!("{name} {found:.4}, expected {expected:.4} ± {std:.4}"))
        })
        .collect();
    if base.status() != now.status() {
        all.push(format!("{} / {:?}, was {}", now.status(), now.reason(), base.status()));
    }
    if now.suspected_effect != EffectKind::None as u32 {
        all.push(format!("suspects {:?}", EffectKind::from_number(now.suspected_effect)));
    }
    all
}

#[test]
fn a_declared_truth_leaves_every_estimate_where_it_was() {
    let base = World::of(TRAIN, TRACK);
    let survey = World::of(TRAIN, &format!("{TRACK}{GRADIENT}")).track;
    let drive = Drive::new(&base.train, &survey, terms::PRESSURE_PA_PER_N);
    let estimators = frugal_estimators();
    let before: Vec<ParameterSnapshot> =
        estimators.iter().map(|it| last_snapshot(it, &base, &drive.samples)).collect();
    for snapshot in &before {
        let kind = snapshot.pipeline_kind().expect("a kind");
        assert!(snapshot.updates > 0 && !estimates(snapshot).is_empty(), "{kind}");
        assert_ne!(snapshot.status(), Status::Invalid, "{kind}");
    }
    let mut failures = Vec::new();
    let declared: Vec<Declaration> =
        EffectKind::ALL.iter().flat_map(|&kind| declarations(kind)).collect();
    for declaration in &declared {
        let world = declaration.world();
        let samples = declaration.samples(&drive, &base);
        for (settings, base) in estimators.iter().zip(&before) {
            let now = last_snapshot(settings, &world, &samples);
            let moved = moved(base, &now, declaration.mass_factor);
            if !moved.is_empty() {
                failures.push(format!(
                    "{} × {}: {}",
                    declaration.name,
                    settings.kind(),
                    moved.join("; ")
                ));
            }
        }
    }
    assert!(failures.is_empty(), "{} moved:\n{}", failures.len(), failures.join("\n"));
}
