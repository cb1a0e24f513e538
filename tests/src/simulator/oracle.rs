//! How well the true parameters, in the terms of the effect library, predict a dataset.
//!
//! The oracle sees the recorded samples only, but knows the effects. What it cannot know is noise,
//! gusts, and what the declared form leaves out (each car's own mass, the odometer's error).

use std::sync::Arc;

use dynocar_core::force::{ForceResolver, ResolvedSample};
use dynocar_core::simulate::{
    BridgeLimits, ForceModel, Prediction, QuadraticForces, Recording, Restart, SpeedError,
};
use dynocar_core::validation::{ValidationLimits, Validator};

use super::disturbances::{Disturbances, SpeedBand};
use super::sensors::SIMULATED_TRAIN;
use super::{SimulatedDataset, SimulatedRun};

/// RMSE in m/s over the pooled holdout runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Of the declared model.
    pub declared_mps: f64,
    /// Of the true Davis coefficients with the true effects.
    pub true_mps: f64,
}

/// Both metrics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OracleScore {
    /// From start to end.
    pub full_run: Errors,
    /// Restarted every 60 s.
    pub window60: Errors,
}

/// Scores the declared and the true model on the holdout runs.
///
/// # Panics
///
/// When a holdout run has no usable samples, which the simulator does not make.
pub fn score(dataset: &SimulatedDataset) -> OracleScore {
    let runs: Vec<(Recording, QuadraticForces, OracleForces)> = dataset
        .runs
        .iter()
        .filter(|run| run.plan.is_holdout)
        .map(|run| {
            let recording = record(dataset, run);
            let declared = QuadraticForces::declared(&recording, dataset.train.declared.resistance);
            let truth = oracle_forces(dataset, run, &recording);
            (recording, declared, truth)
        })
        .collect();
    let errors = |restart: Restart| Errors {
        declared_mps: pooled_mps(runs.iter().map(|run| error(&run.0, &run.1, restart))),
        true_mps: pooled_mps(runs.iter().map(|run| error(&run.0, &run.2, restart))),
    };
    OracleScore { full_run: errors(Restart::FullRun), window60: errors(Restart::WINDOW_60) }
}

fn pooled_mps(errors: impl Iterator<Item = SpeedError>) -> f64 {
    errors.sum::<SpeedError>().rmse_mps().expect("a simulated run moves")
}

fn error(recording: &Recording, model: &impl ForceModel, restart: Restart) -> SpeedError {
    let mut prediction = Prediction::new();
    prediction.simulate(recording, model, restart);
    SpeedError::of(recording, &prediction)
}

/// A run's samples as the program under test resolves them.
///
/// # Panics
///
/// When no sample is usable.
pub fn record(dataset: &SimulatedDataset, run: &SimulatedRun) -> Recording {
    let train = Arc::new(dataset.train.declared.clone());
    let limits = ValidationLimits::for_train(train.mass_kg);
    let mut validator = Validator::new(SIMULATED_TRAIN, train.mass_kg, limits);
    let mut resolver = ForceResolver::new(train, Some(Arc::new(dataset.line.track.clone())));
    let resolved: Vec<ResolvedSample> = run
        .samples
        .iter()
        .filter_map(|sample| validator.check(sample).ok())
        .map(|valid| resolver.resolve(&valid))
        .collect();
    Recording::new(resolved, BridgeLimits::default()).expect("a simulated run has forces")
}

/// The true model of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct OracleForces {
    quadratic: QuadraticForces,
    speed_band: Option<SpeedBand>,
    /// Weight in kN over inertial mass in kg.
    weight_per_kg: f64,
}

impl ForceModel for OracleForces {
    fn acceleration_mps2(&self, index: usize, speed_mps: f64) -> f64 {
        let band_n_per_kn = self.speed_band.map_or(0.0, |band| {
            let away = (speed_mps - band.centre_mps) / band.width_mps;
            band.extra_n_per_kn * (-0.5 * away * away).exp()
        });
        self.quadratic.acceleration_mps2(index, speed_mps) - self.weight_per_kg * band_n_per_kn
    }

    fn speed_scale(&self) -> f64 {
        self.quadratic.speed_scale()
    }
}

/// The true model of a run, put together from its samples and its effects.
pub fn oracle_forces(
    dataset: &SimulatedDataset,
    run: &SimulatedRun,
    recording: &Recording,
) -> OracleForces {
    let disturbances = &run.disturbances;
    let davis = dataset.train.resistance;
    let mut quadratic = QuadraticForces::declared(recording, davis);
    quadratic.set_speed_scale(disturbances.speed_scale);
    let acting_n = acting_forces_n(recording, disturbances);
    let declared = dataset.declared_train();
    let inertia_ratio =
        (1.0 + declared.rotating_mass_factor) / (1.0 + disturbances.rotating_mass_factor);
    let mut position_m = run.plan.start_m;
    for (index, sample) in recording.samples().iter().enumerate() {
        let time_s = recording.time_s()[index];
        position_m = sample.position_m.unwrap_or(position_m);
        // Everything but traction and brake is in proportion to the mass.
        let mass_factor = disturbances.mass_factor(time_s, position_m);
        let control_n = sample.control_force_n().unwrap_or(0.0);
        let control_change_n = acting_n[index] / mass_factor - control_n;
        let drag_n = disturbances.drag_n(time_s) / mass_factor;
        quadratic.add_force(index, sample, [control_change_n - drag_n, 0.0, 0.0]);
        let [constant, linear, quadratic_term] =
            extra_n_per_kn(dataset, run, sample, (time_s, position_m));
        let w_kn = -sample.weight_kn;
        let force = [w_kn * constant, w_kn * linear, w_kn * quadratic_term];
        quadratic.add_force(index, sample, force);
        quadratic.scale_acceleration(index, inertia_ratio);
    }
    let first = &recording.samples()[0];
    OracleForces {
        quadratic,
        speed_band: disturbances.speed_band,
        weight_per_kg: inertia_ratio * first.weight_kn / first.inertial_mass_kg,
    }
}

/// Undeclared resistance in N/kN as a polynomial of the speed.
fn extra_n_per_kn(
    dataset: &SimulatedDataset,
    run: &SimulatedRun,
    sample: &ResolvedSample,
    (time_s, position_m): (f64, f64),
) -> [f64; 3] {
    let davis = dataset.train.resistance;
    let disturbances = &run.disturbances;
    let length_m = dataset.train.declared.length_m;
    let tunnel_share = sample.tunnel_share.unwrap_or(0.0);
    let outside = 1.0 - tunnel_share;
    let declared_k = dataset.train.declared.curve_constant_n_per_kn_m;
    let curvature = sample.curvature_per_m.unwrap_or(0.0);
    let headwind_mps = disturbances.headwind_mps;
    let mut constant = (disturbances.curve_constant_n_per_kn_m - declared_k) * curvature
        + davis.c * outside * headwind_mps * headwind_mps;
    let mut linear = 2.0 * davis.c * outside * headwind_mps;
    let mut quadratic = davis.c * (disturbances.tunnel_c_factor - 1.0) * tunnel_share;
    let mapped_permille = |chainage_m: f64| {
        let permille = dataset.track().gradient_permille(chainage_m, length_m).unwrap_or(0.0);
        run.plan.direction * permille
    };
    constant +=
        mapped_permille(position_m - disturbances.gradient_shift_m) - mapped_permille(position_m);
    if let Some(local) = &disturbances.local {
        constant += local.mean_around(position_m, length_m);
    }
    if let Some((delta_a, tau_s)) = disturbances.cold_bearings {
        constant += delta_a * (-time_s / tau_s).exp();
    }
    if let (Some((w0_per_k, reference_k)), Some(temperature_degc)) =
        (disturbances.ambient, sample.ambient_temperature_degc)
    {
        let change = w0_per_k * (temperature_degc + 273.15 - reference_k);
        constant += change * davis.a;
        linear += change * davis.b;
        quadratic += change * davis.c;
    }
    [constant, linear, quadratic]
}

/// Traction minus brake in N that acts behind the reported forces, at each sample.
fn acting_forces_n(recording: &Recording, disturbances: &Disturbances) -> Vec<f64> {
    let samples = recording.samples();
    let time_s = recording.time_s();
    let mut from = 0;
    let mut arrived = delayed(recording, 0, time_s[0]);
    let mut acting = arrived;
    (0..samples.len())
        .map(|index| {
            let late_s = time_s[index] - disturbances.delay_s;
            while from + 1 < samples.len() && time_s[from + 1] <= late_s {
                from += 1;
            }
            let before = arrived;
            arrived = delayed(recording, from, late_s);
            let step_s = if index > 0 { time_s[index] - time_s[index - 1] } else { 0.0 };
            let behind = |acting_n: f64, before_n: f64, arrived_n: f64| {
                lagged_ramp(acting_n, (before_n, arrived_n), step_s, disturbances.lag_s)
            };
            acting = (behind(acting.0, before.0, arrived.0), behind(acting.1, before.1, arrived.1));
            let sample = &samples[index];
            let carried_n = match (&disturbances.adhesion, sample.position_m) {
                (Some(cap), Some(position_m)) => {
                    cap.carried_n(acting.1, 1000.0 * sample.weight_kn, position_m)
                }
                _ => acting.1,
            };
            acting.0 / disturbances.traction_gain - carried_n
        })
        .collect()
}

/// A first-order lag after one step in which its input runs linearly between two values.
fn lagged_ramp(value: f64, (from, to): (f64, f64), step_s: f64, lag_s: f64) -> f64 {
    if lag_s <= 0.0 || step_s <= 0.0 {
        return if lag_s <= 0.0 { to } else { value };
    }
    let kept = (-step_s / lag_s).exp();
    let slope_n_per_s = (to - from) / step_s;
    kept * (value - from + slope_n_per_s * lag_s) + to - slope_n_per_s * lag_s
}

/// Reported traction and brake force in N at a time in s, interpolated after sample `from`.
fn delayed(recording: &Recording, from: usize, late_s: f64) -> (f64, f64) {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let next = (from + 1).min(samples.len() - 1);
    let span_s = time_s[next] - time_s[from];
    let share = if span_s > 0.0 { ((late_s - time_s[from]) / span_s).clamp(0.0, 1.0) } else { 0.0 };
    let between = |field: fn(&ResolvedSample) -> Option<f64>| {
        let (here, there) =
            (field(&samples[from]).unwrap_or(0.0), field(&samples[next]).unwrap_or(0.0));
        here + share * (there - here)
    };
    (between(|sample| sample.traction_force_n), between(|sample| sample.brake_force_n))
}
