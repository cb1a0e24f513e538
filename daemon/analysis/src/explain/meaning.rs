//! Meaning of an effect to a railway: energy on the line, and the error in m of a prediction over a minute.

use dynocar_model::simulate::{ForceModel, MOVING_SPEED_MPS, Prediction, Restart};
use dynocar_model::units::J_PER_KWH;

use super::answer::EffectMeaning;
use super::evidence::{Fit, FitProblem, RunData, UpdatedForces};
use super::score::predicted;
use crate::statistics::rms;

impl EffectMeaning {
    /// Returns the meaning of one effect of a fitted model; `rest` is the model refitted without it.
    pub fn new(problem: &FitProblem, fit: &Fit, index: usize, rest: &Fit) -> Self {
        let (mut effect_j, mut traction_j, mut distance_m) = (0.0, 0.0, 0.0);
        for run in &problem.runs {
            let work = Work::new(run, fit, index);
            effect_j += work.effect_j;
            traction_j += work.traction_j;
            distance_m += work.distance_m;
        }
        let kwh_per_100_km = effect_j / J_PER_KWH / (distance_m / 100e3);
        let errors = distance_error_m(problem, rest).zip(distance_error_m(problem, fit));
        EffectMeaning {
            energy_kwh_per_100_km: if distance_m > 0.0 { kwh_per_100_km } else { 0.0 },
            share_of_traction_energy: (traction_j > 0.0).then(|| effect_j / traction_j),
            distance_error_60_s_m: errors.map(|(without, with)| [without, with]),
        }
    }
}

/// Work and distance of the moving samples of a run.
#[derive(Default)]
struct Work {
    effect_j: f64,
    traction_j: f64,
    distance_m: f64,
}

impl Work {
    /// By the forces with everything that was fitted, and with everything but one effect.
    fn new(run: &RunData, fit: &Fit, index: usize) -> Self {
        let (mut with, mut without) = (UpdatedForces::default(), UpdatedForces::default());
        fit.model.forces(run, &fit.theta, &mut with);
        let (others, theta) = fit.model.without(&fit.theta, index);
        others.forces(run, &theta, &mut without);
        let (samples, time_s) = (run.recording.samples(), run.recording.time_s());
        let mut work = Work::default();
        for i in 1..samples.len() {
            let sample = &samples[i];
            let follows = run.recording.is_simulated(i) && !run.recording.starts(i);
            if follows && sample.speed_mps > MOVING_SPEED_MPS {
                let distance_m = sample.speed_mps * (time_s[i] - time_s[i - 1]);
                let slower_mps2 = without.acceleration_mps2(i, sample.speed_mps)
                    - with.acceleration_mps2(i, sample.speed_mps);
                work.effect_j += sample.inertial_mass_kg * slower_mps2 * distance_m;
                work.traction_j += sample.traction_force_n.unwrap_or(0.0) * distance_m;
                work.distance_m += distance_m;
            }
        }
        work
    }
}

/// Returns the root mean square in m, over all whole minutes of motion, of the predicted less the measured distance;
/// each minute starts at the measured speed.
fn distance_error_m(problem: &FitProblem, fit: &Fit) -> Option<f64> {
    let mut errors_m = Vec::new();
    for run in &problem.runs {
        let prediction = predicted(fit, run, Restart::WINDOW_60);
        errors_m.extend(minutes(run, &prediction));
    }
    (!errors_m.is_empty()).then(|| rms(&errors_m))
}

/// Returns the predicted less measured distance in m of each minute of a run that is driven without a gap.
fn minutes(run: &RunData, prediction: &Prediction) -> Vec<f64> {
    let (recording, time_s) = (&run.recording, run.recording.time_s());
    let minute_of = |i: usize| (time_s[i] / Restart::WINDOW_S) as usize;
    let mut errors_m = Vec::new();
    let indices: Vec<usize> = (0..time_s.len()).collect();
    let whole = |minute: &[usize]| {
        minute.iter().skip(1).all(|&i| recording.is_simulated(i) && !recording.starts(i))
    };
    for minute in indices.chunk_by(|&one, &next| minute_of(one) == minute_of(next)) {
        let moves = minute.iter().any(|&i| recording.samples()[i].speed_mps > MOVING_SPEED_MPS);
        let length_s = time_s[minute[minute.len() - 1]] - time_s[minute[0]];
        if moves && whole(minute) && length_s > 0.9 * Restart::WINDOW_S {
            let off_mps = |i: usize| prediction.speed_mps()[i] - recording.samples()[i].speed_mps;
            let parts = minute.windows(2).map(|pair| {
                0.5 * (off_mps(pair[0]) + off_mps(pair[1])) * (time_s[pair[1]] - time_s[pair[0]])
            });
            errors_m.push(parts.sum());
        }
    }
    errors_m
}
