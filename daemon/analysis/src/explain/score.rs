//! Open-loop prediction, which judges a finished model; and the meaning of an effect to a railway: energy on the line,
//! and the error in m of a prediction over a minute.

use dynocar_model::simulate::{ForceModel, MOVING_SPEED_MPS, Prediction, Restart, SpeedError};
use dynocar_model::units::J_PER_KWH;

use super::answer::EffectMeaning;
use super::evidence::{Fit, FitProblem, RunData, RunFactors, UpdatedForces};
use super::selection::without_each_run;
use super::stop_to_stop::{self, Judged, StopToStop, stop_runs};
use crate::parallel;
use crate::statistics::{intervals_95, rms};

/// Errors of the model without and with the effects.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PredictionScore {
    /// Whole holdout runs, by run: before and after.
    pub holdout_runs: Vec<[SpeedError; 2]>,
    /// Holdout runs restarted every 60 s: before and after.
    pub holdout_window60: [SpeedError; 2],
    /// Holdout runs from stop to stop; `None` where they do not stop twice.
    pub holdout_stop_to_stop: Option<StopToStop>,
    /// Whole fit runs: before and after.
    pub fit_runs: [SpeedError; 2],
}

/// Errors of the models without and with the effects over one run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunScore {
    /// The whole run: before and after.
    full: [SpeedError; 2],
    /// Restarted every 60 s: before and after.
    window60: [SpeedError; 2],
    /// Root mean square errors in m/s from stop to stop: before and after.
    stop_to_stop_mps: Vec<[f64; 2]>,
}

impl RunScore {
    /// Of a run by the models without and with the effects.
    pub fn new(run: &RunData, before: &Fit, after: &Fit) -> Self {
        let both = |restart| [before, after].map(|fit| run_error(fit, run, restart));
        RunScore {
            full: both(Restart::FullRun),
            window60: both(Restart::WINDOW_60),
            stop_to_stop_mps: stop_errors_mps(run, before, after),
        }
    }
}

/// Returns the speeds of a run predicted open loop.
pub fn predicted(fit: &Fit, run: &RunData, restart: Restart) -> Prediction {
    let (mut forces, mut prediction) = (UpdatedForces::default(), Prediction::new());
    fit.model.forces(run, &fit.theta, &mut forces);
    prediction.simulate(&run.recording, &forces, restart);
    prediction
}

/// Returns the error of a model over one run.
pub fn run_error(fit: &Fit, run: &RunData, restart: Restart) -> SpeedError {
    let [error] = errors_at(fit, &fit.theta, (run, &RunFactors::zeros()), [restart]);
    error
}

/// Errors of a run with given parameters and its own factors, restarted in each of the given ways.
fn errors_at<const N: usize>(
    fit: &Fit,
    theta: &[f64],
    (run, own): (&RunData, &RunFactors),
    restarts: [Restart; N],
) -> [SpeedError; N] {
    let (mut forces, mut ways) =
        (UpdatedForces::default(), restarts.map(|it| (Prediction::new(), it)));
    fit.model.forces_on_day(run, theta, own, &mut forces);
    let each = ways.each_mut().map(|(prediction, restart)| (prediction, *restart));
    Prediction::simulate_together(&run.recording, &forces, each);
    ways.map(|(prediction, _)| SpeedError::new(&run.recording, &prediction))
}

/// Returns the errors of recorded runs from stop to stop, by the models without and with the effects; `None`
/// where none of them goes from stop to stop.
pub fn stop_to_stop(runs: &[RunData], before: &Fit, after: &Fit) -> Option<StopToStop> {
    let of_run = |run: &RunData| stop_errors_mps(run, before, after);
    StopToStop::from_errors(runs.iter().map(of_run).collect())
}

/// Returns the same of one run, in m/s.
fn stop_errors_mps(run: &RunData, before: &Fit, after: &Fit) -> Vec<[f64; 2]> {
    let errors_mps = |fit: &Fit| {
        let prediction = predicted(fit, run, Restart::AtDepartures);
        let within = |part| SpeedError::within(&run.recording, &prediction, part).rmse_mps();
        stop_runs(&run.recording).into_iter().filter_map(within).collect::<Vec<f64>>()
    };
    let pairs = errors_mps(before).into_iter().zip(errors_mps(after));
    pairs.map(|(before, after)| [before, after]).collect()
}

/// Open-loop errors of the fit runs: of each run as fitted, and as predicted from the others.
#[derive(Clone, Copy, Debug)]
pub struct FitErrors {
    /// Root mean squares in m/s as fitted and left out, each over whole runs, with restarts every 60 s, and over whole
    /// runs with each run's own load and wind where the model is fitted jointly with them.
    speed_mps: [[f64; 3]; 2],
    /// Share by which the integrated speed misses the measured distance, with the standard deviation of this ratio.
    distance: f64,
    /// Whether the model estimates the scale of the speeds: only this number is judged by the distance.
    has_speed_scale: bool,
}

impl FitErrors {
    /// Returns those of a fitted model.
    pub fn new(problem: &FitProblem, fit: &Fit) -> Self {
        let speed_mps = fit.open_loop_mps(|| open_loop_mps(problem, fit));
        let missed =
            |(ratio, deviation): (f64, f64)| (ratio - 1.0 / fit.speed_scale()).hypot(deviation);
        let has_speed_scale = fit.model.effects.iter().any(|it| it.nature().changes_speed_scale);
        FitErrors {
            speed_mps,
            distance: problem.positions.distance_ratio.map_or(0.0, missed),
            has_speed_scale,
        }
    }

    /// Returns the share of the error that a model with these errors removes from another. Of the shares over whole
    /// runs, with restarts, with each run's own load and wind and, where only one of the two models scales the speeds,
    /// of the distance, the largest counts; of runs as fitted and runs left out, the smaller.
    pub fn reduction_from(&self, before: &Self) -> f64 {
        let share = |before: f64, after: f64| if before > 0.0 { 1.0 - after / before } else { 0.0 };
        let of_distance = if self.has_speed_scale == before.has_speed_scale {
            f64::NEG_INFINITY
        } else {
            share(before.distance, self.distance)
        };
        let most = |before: &[f64; 3], after: &[f64; 3]| {
            let of_speed = before.iter().zip(after).map(|(before, after)| share(*before, *after));
            of_speed.fold(of_distance, f64::max)
        };
        let each = before.speed_mps.iter().zip(&self.speed_mps);
        each.map(|(before, after)| most(before, after)).fold(f64::INFINITY, f64::min)
    }
}

/// Returns the root mean squares in m/s of the open-loop errors as fitted and left out, in the three ways.
fn open_loop_mps(problem: &FitProblem, fit: &Fit) -> [[f64; 3]; 2] {
    let fitted = vec![fit.theta.clone(); problem.runs.len()];
    [fitted, without_each_run(problem, fit)].map(|theta| {
        let restarts = [Restart::FullRun, Restart::WINDOW_60];
        let each = parallel::of_each_number(problem.runs.len(), |index| {
            let (run, theta) = (&problem.runs[index], &theta[index]);
            let none = RunFactors::zeros();
            let [full, window] = errors_at(fit, theta, (run, &none), restarts);
            let on_day = || {
                let own = fit.own_factors(index);
                let [error] = errors_at(fit, theta, (run, own), [Restart::FullRun]);
                error
            };
            let has_own = fit.has_loads_and_winds();
            [full, window, if has_own { on_day() } else { full }]
        });
        [0, 1, 2].map(|restart| {
            let errors = each.iter().map(|of_run| of_run[restart]);
            errors.sum::<SpeedError>().rmse_mps().unwrap_or(0.0)
        })
    })
}

/// Returns the share of the open-loop error of the fit runs that the larger model takes away.
pub fn reduction(problem: &FitProblem, smaller: &Fit, larger: &Fit) -> f64 {
    FitErrors::new(problem, larger).reduction_from(&FitErrors::new(problem, smaller))
}

/// Errors in m/s without and with the effects, pooled over some parts, and the share that the effects remove.
pub fn pooled(parts: impl Iterator<Item = [SpeedError; 2]>) -> Option<[f64; 3]> {
    let sum =
        parts.fold([SpeedError::default(); 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
    let [before, after] = [sum[0].rmse_mps()?, sum[1].rmse_mps()?];
    Some([before, after, stop_to_stop::reduction([before, after])])
}

impl PredictionScore {
    /// Returns the scores of the holdout runs with the errors of the models without and with the effects on the fit
    /// runs.
    pub fn new(problem: &FitProblem, holdout: Vec<RunScore>, before: &Fit, after: &Fit) -> Self {
        let summed = |parts: &mut dyn Iterator<Item = [SpeedError; 2]>| {
            let add =
                |sum: [SpeedError; 2], own: [SpeedError; 2]| [sum[0] + own[0], sum[1] + own[1]];
            parts.fold([SpeedError::default(); 2], add)
        };
        let fitted = problem.runs.iter();
        let of_fitted =
            |run: &RunData| [before, after].map(|fit| run_error(fit, run, Restart::FullRun));
        PredictionScore {
            holdout_runs: holdout.iter().map(|run| run.full).collect(),
            holdout_window60: summed(&mut holdout.iter().map(|run| run.window60)),
            fit_runs: summed(&mut fitted.map(of_fitted)),
            holdout_stop_to_stop: StopToStop::from_errors(
                holdout.into_iter().map(|run| run.stop_to_stop_mps).collect(),
            ),
        }
    }

    /// RMSE in m/s on the holdout runs: before and after.
    pub fn holdout_rmse_mps(&self) -> [Option<f64>; 2] {
        [0, 1].map(|side| {
            self.holdout_runs.iter().map(|run| run[side]).sum::<SpeedError>().rmse_mps()
        })
    }

    /// Returns the error of the holdout runs by which the model is judged; `None` without motion in them.
    pub fn judged(&self) -> Option<Judged> {
        let [before, after] = self.holdout_rmse_mps();
        let by_full_runs = || {
            let intervals = self.intervals();
            Some(Judged::by_full_runs(self.holdout_runs.len(), [before?, after?], intervals))
        };
        self.holdout_stop_to_stop.as_ref().map(Judged::from).or_else(by_full_runs)
    }

    /// 95 % interval of 1 - after / before by bootstrap over the holdout runs; `None` with fewer
    /// than two.
    pub fn reduction_interval(&self) -> Option<[f64; 2]> {
        self.intervals().map(|it| it[2])
    }

    /// 95 % intervals of the errors over whole runs in m/s, before and after, and of the taken values
    /// away.
    fn intervals(&self) -> Option<[[f64; 2]; 3]> {
        intervals_95(&self.holdout_runs, |drawn| {
            pooled(drawn.iter().map(|run| **run)).filter(|[before, ..]| *before > 0.0)
        })
    }
}

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
