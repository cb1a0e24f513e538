//! Prediction of a dataset by the true parameters, in the terms of the effect library.
//!
//! The oracle sees the recorded samples only, but knows the effects. It knows neither noise nor gusts, nor details that
//! the declared form lacks (each car's own mass, the odometer's error).

use std::sync::Arc;

use dynocar_core::pipeline::admission::Admission;
use dynocar_model::force::{ForceResolver, ResolvedSample};
use dynocar_model::simulate::{
    ForceModel, OpenLoopRecording, Prediction, QuadraticForces, Restart, STANDING_MPS, SpeedError,
    declared_polynomial,
};
use dynocar_model::terms::delay::DelayLine;
use dynocar_model::terms::{gradient, traction};

use super::disturbances::{DisturbanceInput, Disturbances};
use super::sensors::SIMULATED_TRAIN;
use super::{SimulatedDataset, SimulatedRun};

/// RMSE in m/s over the pooled holdout runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OracleErrors {
    /// Error of the declared model.
    pub declared_mps: f64,
    /// Error of the true Davis coefficients with the true effects.
    pub true_mps: f64,
}

/// Both metrics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OracleScore {
    /// From start to end.
    pub full_run: OracleErrors,
    /// Restarted every 60 s.
    pub window60: OracleErrors,
}

/// Scores the declared and the true model on the holdout runs.
///
/// # Panics
///
/// When a holdout run has no usable samples, which the simulator does not make.
pub fn score(dataset: &SimulatedDataset) -> OracleScore {
    let runs: Vec<(OpenLoopRecording, QuadraticForces, OracleForces)> = dataset
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
    let errors = |restart: Restart| OracleErrors {
        declared_mps: pooled_mps(runs.iter().map(|run| error(&run.0, &run.1, restart))),
        true_mps: pooled_mps(runs.iter().map(|run| error(&run.0, &run.2, restart))),
    };
    OracleScore { full_run: errors(Restart::FullRun), window60: errors(Restart::WINDOW_60) }
}

fn pooled_mps(errors: impl Iterator<Item = SpeedError>) -> f64 {
    errors.sum::<SpeedError>().rmse_mps().expect("a simulated run moves")
}

fn error(recording: &OpenLoopRecording, model: &impl ForceModel, restart: Restart) -> SpeedError {
    let mut prediction = Prediction::new();
    prediction.simulate(recording, model, restart);
    SpeedError::new(recording, &prediction)
}

/// Returns a run's samples as the program under test resolves them.
///
/// # Panics
///
/// When no sample is usable.
pub fn record(dataset: &SimulatedDataset, run: &SimulatedRun) -> OpenLoopRecording {
    let train = Arc::new(dataset.train.declared.clone());
    let mut admission = Admission::new(SIMULATED_TRAIN, Arc::clone(&train));
    let mut resolver = ForceResolver::new(train, Some(Arc::new(dataset.line.track.clone())));
    let resolve = |sample| Some(resolver.resolve(&admission.validate(sample).ok()?));
    let resolved: Vec<ResolvedSample> = run.samples.iter().filter_map(resolve).collect();
    OpenLoopRecording::new(resolved).expect("a simulated run has forces")
}

/// The true model of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct OracleForces {
    quadratic: QuadraticForces,
    disturbances: Disturbances,
    /// Time in s from the run's first sample and outside temperature in °C, by sample.
    around: Vec<(f64, Option<f64>)>,
    /// Weight in kN over inertial mass in kg.
    weight_per_kg: f64,
}

impl ForceModel for OracleForces {
    fn acceleration_mps2(&self, index: usize, speed_mps: f64) -> f64 {
        let (time_s, degc) = self.around[index];
        let force_n_per_kn = self.disturbances.unlisted_n_per_kn(speed_mps, time_s, degc);
        self.quadratic.acceleration_mps2(index, speed_mps) - self.weight_per_kg * force_n_per_kn
    }

    fn speed_scale(&self) -> f64 {
        self.quadratic.speed_scale()
    }
}

/// Returns the true model of a run, put together from its samples and its effects.
pub fn oracle_forces(
    dataset: &SimulatedDataset,
    run: &SimulatedRun,
    recording: &OpenLoopRecording,
) -> OracleForces {
    let disturbances = &run.disturbances;
    let davis = dataset.train.resistance;
    let acting_n = acting_forces_n(recording, disturbances);
    let declared = dataset.declared_train();
    let inertia_ratio =
        (1.0 + declared.rotating_mass_factor) / (1.0 + disturbances.rotating_mass_factor);
    let mut position_m = run.plan.start_m;
    let mut polynomial = |(index, sample): (usize, &ResolvedSample)| {
        let time_s = recording.time_s()[index];
        position_m = sample.position_m.unwrap_or(position_m);
        // Everything but traction and brake is in proportion to the mass.
        let mass_factor = disturbances.mass_factor(time_s, position_m);
        let control_n = sample.control_force_n().unwrap_or(0.0);
        let control_change_n = acting_n[index] / mass_factor - control_n;
        let drag_n = disturbances.drag_n(time_s) / mass_factor;
        let changes_n = [control_change_n - drag_n, 0.0, 0.0];
        let declared = declared_polynomial(sample, davis);
        let extra_n_per_kn = extra_n_per_kn(dataset, run, sample, (time_s, position_m));
        std::array::from_fn(|power| {
            let force_n = changes_n[power] - sample.weight_kn * extra_n_per_kn[power];
            inertia_ratio * (declared[power] + force_n / sample.inertial_mass_kg)
        })
    };
    let mut quadratic = QuadraticForces::default();
    let mut late = DelayLine::<3>::new(disturbances.speed_delay_s, disturbances.speed_lag_s);
    let samples = recording.samples().iter().enumerate();
    let behind = samples.zip(recording.samples()).map(|(numbered, sample)| {
        let at = (sample.time_ns, sample.segment);
        let now = polynomial(numbered);
        let stands = sample.speed_mps <= STANDING_MPS;
        late.acting_unless(at, Some(now), |net_mps2| stands && net_mps2[0] <= 0.0).unwrap_or(now)
    });
    quadratic.restart(disturbances.speed_scale);
    quadratic.extend(behind);
    let first = &recording.samples()[0];
    OracleForces {
        quadratic,
        disturbances: disturbances.clone(),
        around: recording
            .time_s()
            .iter()
            .zip(recording.samples())
            .map(|(&time_s, sample)| (time_s, sample.ambient_temperature_degc))
            .collect(),
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
    let mut all = disturbances.resistance(DisturbanceInput {
        time_s,
        curvature_per_m: sample.curvature_per_m.unwrap_or(0.0),
        tunnel_share: sample.tunnel_share.unwrap_or(0.0),
        headwind_mps: disturbances.headwind_mps,
        degc: sample.ambient_temperature_degc,
        local_n_per_kn: disturbances
            .local
            .as_ref()
            .map_or(0.0, |local| local.mean_around(position_m, length_m)),
    });
    let permille = |shift_m: f64| {
        let at = (position_m, run.plan.direction);
        gradient::along_travel_permille(dataset.track(), at, length_m, shift_m).unwrap_or(0.0)
    };
    all.other_n_per_kn = permille(disturbances.gradient_shift_m) - permille(0.0);
    if let Some(error) = &disturbances.gradient_error {
        gradient::err(error, (position_m, run.plan.direction), &mut all.other_n_per_kn);
    }
    // Corrections of the declared model.
    all.curve_n_per_kn -= sample.resistance.curve_n_per_kn;
    let [constant, linear, quadratic] = all.polynomial(davis, sample.speed_mps);
    [constant - davis.a, linear - davis.b, quadratic - davis.c]
}

/// Returns the traction minus brake in N that acts behind the reported forces, at each sample.
fn acting_forces_n(recording: &OpenLoopRecording, disturbances: &Disturbances) -> Vec<f64> {
    let mut late = DelayLine::new(disturbances.delay_s, disturbances.lag_s);
    let [brake_delay_s, brake_lag_s] = disturbances.brake_late_s;
    let mut late_brake = DelayLine::new(brake_delay_s, brake_lag_s);
    let acting = |sample: &ResolvedSample| {
        let force = |field: Option<f64>| field.unwrap_or(0.0);
        let reported = [force(sample.traction_force_n), force(sample.brake_force_n)];
        let at = (sample.time_ns, sample.segment);
        let [brake_n] = late_brake.acting(at, Some([reported[1]])).unwrap_or([reported[1]]);
        let reported = [reported[0], brake_n];
        let [traction_n, brake_n] = late.acting(at, Some(reported)).unwrap_or(reported);
        let brake_n = brake_n / disturbances.brake_gain;
        let carried_n = match (&disturbances.adhesion, sample.position_m) {
            (Some(cap), Some(position_m)) => {
                cap.carried_n(brake_n, 1000.0 * sample.weight_kn, position_m)
            }
            _ => brake_n,
        };
        traction::true_force_n(traction_n, disturbances.traction_gain) - carried_n
    };
    recording.samples().iter().map(acting).collect()
}
