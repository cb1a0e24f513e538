//! The pipelines of Jin 2020 and Xie 2019 over one stop, fed with a brake of unknown force.
//!
//! Nobody measured a pressure, so a gear is declared that would give the mean deceleration of the stop at a friction
//! coefficient of 0.3: the pipeline then reports the shape of the friction over speed, and its scale is a convention.
//! The adhesion is no convention: it is at least the retarding force over the weight.

use std::sync::Arc;

use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_model::track::Track;
use dynocar_model::train::{BrakeGear, TrainModel};
use dynocar_shared::{Parameter, PipelineKind, SampleField, Status, TrainId, TrainSample};
use serde::Serialize;

use super::deceleration_curve::DecelerationCurve;

/// Friction coefficient at which the declared gear gives the mean deceleration of the stop.
const DECLARED_FRICTION: f64 = 0.3;
/// Cylinder pressure in Pa of the declared brake.
const PRESSURE_PA: f64 = 300e3;

/// Friction that a pipeline learned while the train passed a speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FrictionPoint {
    /// Speed in m/s of the sample that closed the estimate.
    pub speed_mps: f64,
    /// Friction as a share of that which gives the stop's mean deceleration.
    pub share: f64,
    /// Its standard deviation.
    pub share_std: f64,
    /// Least adhesion between wheel and rail that the stop took; `None` while the pipeline had none.
    pub adhesion_at_least: Option<f64>,
}

/// Runs `brake_smoother` and `adhesion_smoother` over a stop of a run; one point for each m/s.
pub fn friction(
    samples: &[TrainSample],
    curve: &DecelerationCurve,
    train: &TrainModel,
    track: Option<&Arc<Track>>,
) -> Vec<FrictionPoint> {
    let Some(train) = with_brake(train, curve).map(Arc::new) else { return Vec::new() };
    let mut pipelines = [PipelineKind::BrakeSmoother, PipelineKind::AdhesionSmoother].map(|kind| {
        let settings = EstimatorSettings::default_of(kind).expect("a kind that learns");
        let estimator = settings.build(&train).expect("default settings");
        Pipeline::new(TrainId(1), 0, Arc::clone(&train), track.cloned(), estimator)
    });
    let mut points: Vec<FrictionPoint> = Vec::new();
    for (index, sample) in samples.iter().enumerate() {
        let mut sample = *sample;
        sample.train_id = 1;
        sample.sequence = index as u64 + 1;
        sample.set(SampleField::BrakeCylinderPressure, PRESSURE_PA);
        sample.set(SampleField::TractionForce, 0.0);
        if track.is_none() && sample.get(SampleField::Gradient).is_none() {
            // Without a gradient, the mean gradient becomes part of the friction.
            sample.set(SampleField::Gradient, 0.0);
        }
        let [brake, rail] = &mut pipelines;
        let snapshot = brake.process(&sample);
        let learned = (snapshot.status() == Status::Estimated)
            .then(|| {
                snapshot.value(Parameter::DiscFriction).zip(snapshot.std(Parameter::DiscFriction))
            })
            .flatten();
        let rail = rail.process(&sample);
        let bound = rail.value(Parameter::AdhesionLowerBound);
        let adhesion_at_least = bound.or(rail.value(Parameter::Adhesion));
        let is_new = points.last().is_none_or(|it| it.speed_mps - sample.speed_mps >= 1.0);
        if let (Some((friction, std)), true) = (learned, is_new) {
            points.push(FrictionPoint {
                speed_mps: sample.speed_mps,
                share: friction / DECLARED_FRICTION,
                share_std: std / DECLARED_FRICTION,
                adhesion_at_least,
            });
        }
    }
    points
}

/// Returns the train with a gear that gives a stop's mean deceleration at the declared friction.
fn with_brake(train: &TrainModel, curve: &DecelerationCurve) -> Option<TrainModel> {
    let from = &curve.points[curve.built_up?];
    let last = curve.points.last()?;
    let mean_mps2 = (from.speed_mps - last.speed_mps) / (last.time_s - from.time_s);
    let half_mps = 0.5 * from.speed_mps;
    let resisted_n = train.resistance.w0_n_per_kn(half_mps) * TrainModel::weight_kn(train.mass_kg);
    let force_n = train.mass_kg * (1.0 + train.rotating_mass_factor) * mean_mps2 - resisted_n;
    let per_pad_n = std::f64::consts::FRAC_PI_4 * PRESSURE_PA * DECLARED_FRICTION;
    let gear = BrakeGear {
        cylinder_diameter_mm: Some(1000.0),
        disc_radius_mm: Some(1.0),
        wheel_radius_mm: Some(1.0),
        efficiency: Some(1.0),
        ratio: Some(1.0),
        friction: Some(DECLARED_FRICTION),
        pads: Some(force_n / per_pad_n),
        ..BrakeGear::default()
    };
    (force_n > 0.0).then(|| TrainModel { brake_gear: gear, ..train.clone() })
}
