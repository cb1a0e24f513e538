//! Open-loop prediction: the judge of a finished model.

use super::evidence::{Fit, FitProblem, GrownForces, RunData};
use super::stop_to_stop::StopToStop;
use crate::simulate::{Prediction, Restart, SpeedError, stop_runs};

/// Errors of the model without and with the effects.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Score {
    /// Whole holdout runs, by run: before and after.
    pub holdout_runs: Vec<[SpeedError; 2]>,
    /// Holdout runs restarted every 60 s: before and after.
    pub holdout_window60: [SpeedError; 2],
    /// Holdout runs from stop to stop; `None` where they do not stop twice.
    pub holdout_stop_to_stop: Option<StopToStop>,
    /// Whole fit runs: before and after.
    pub fit_runs: [SpeedError; 2],
}

/// Predicted measured speeds of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictedRun {
    /// The run's file.
    pub file: String,
    /// Times in s, in the recording's own count.
    pub time_s: Vec<f64>,
    /// Predicted measured speeds in m/s.
    pub speed_mps: Vec<f64>,
}

/// Error of a model over one run.
pub fn run_error(fit: &Fit, run: &RunData, restart: Restart) -> SpeedError {
    let (mut forces, mut prediction) = (GrownForces::default(), Prediction::new());
    fit.model.forces(run, &fit.theta, &mut forces);
    prediction.simulate(&run.recording, &forces, restart);
    SpeedError::of(&run.recording, &prediction)
}

/// Errors of recorded runs from stop to stop, by the models without and with the effects; `None`
/// where none of them goes from stop to stop.
pub fn stop_to_stop(runs: &[RunData], before: &Fit, after: &Fit) -> Option<StopToStop> {
    let errors_mps = |fit: &Fit, run: &RunData| {
        let (mut forces, mut prediction) = (GrownForces::default(), Prediction::new());
        fit.model.forces(run, &fit.theta, &mut forces);
        prediction.simulate(&run.recording, &forces, Restart::AtDepartures);
        let within = |part| SpeedError::within(&run.recording, &prediction, part).rmse_mps();
        stop_runs(&run.recording).into_iter().filter_map(within).collect::<Vec<f64>>()
    };
    let of_run = |run: &RunData| {
        let pairs = errors_mps(before, run).into_iter().zip(errors_mps(after, run));
        pairs.map(|(before, after)| [before, after]).collect()
    };
    StopToStop::from_errors(runs.iter().map(of_run).collect())
}

/// Open-loop errors of the fit runs.
#[derive(Clone, Copy, Debug)]
pub struct FitErrors {
    /// Root mean square in m/s over whole runs, and with restarts every 60 s.
    speed_mps: [f64; 2],
    /// Share by which the integrated speed misses the measured way, with what that is known to.
    way: f64,
    /// Whether the model looks for the scale of the speeds: nothing else is judged by the way.
    has_speed_scale: bool,
}

impl FitErrors {
    /// Those of a fitted model.
    pub fn of(problem: &FitProblem, fit: &Fit) -> Self {
        let speed_mps = [Restart::FullRun, Restart::WINDOW_60].map(|restart| {
            let each = problem.runs.iter().map(|run| run_error(fit, run, restart));
            each.sum::<SpeedError>().rmse_mps().unwrap_or(0.0)
        });
        let missed =
            |(ratio, deviation): (f64, f64)| (ratio - 1.0 / fit.speed_scale()).hypot(deviation);
        let has_speed_scale = fit.model.effects.iter().any(|it| it.changes_speed_scale());
        FitErrors { speed_mps, way: problem.way_ratio.map_or(0.0, missed), has_speed_scale }
    }

    /// Share of the error that a model with these errors takes away from another: over whole runs,
    /// with restarts or, for the scale of the speeds, of the way, whichever is most.
    pub fn reduction_from(&self, before: &Self) -> f64 {
        let share = |before: f64, after: f64| if before > 0.0 { 1.0 - after / before } else { 0.0 };
        let of_speed = [0, 1].map(|k| share(before.speed_mps[k], self.speed_mps[k]));
        let of_way = if self.has_speed_scale == before.has_speed_scale {
            f64::NEG_INFINITY
        } else {
            share(before.way, self.way)
        };
        of_speed.into_iter().fold(of_way, f64::max)
    }
}

/// Share of the error of the fit runs that the larger model takes away.
pub fn reduction_on_fit_runs(problem: &FitProblem, smaller: &Fit, larger: &Fit) -> f64 {
    FitErrors::of(problem, larger).reduction_from(&FitErrors::of(problem, smaller))
}

/// Predictions of all runs, fit and holdout.
pub fn predictions(problem: &FitProblem, holdout: &[RunData], fit: &Fit) -> Vec<PredictedRun> {
    problem
        .runs
        .iter()
        .chain(holdout)
        .map(|run| {
            let (mut forces, mut prediction) = (GrownForces::default(), Prediction::new());
            fit.model.forces(run, &fit.theta, &mut forces);
            prediction.simulate(&run.recording, &forces, Restart::FullRun);
            PredictedRun {
                file: run.file.clone(),
                time_s: run.recording.time_s().iter().map(|time| run.offset_s + time).collect(),
                speed_mps: prediction.speed_mps().to_vec(),
            }
        })
        .collect()
}

impl Score {
    /// Scores the model without and with the effects on fit and holdout runs.
    pub fn of(problem: &FitProblem, holdout: &[RunData], before: &Fit, after: &Fit) -> Self {
        let both = |run: &RunData, restart: Restart| {
            [run_error(before, run, restart), run_error(after, run, restart)]
        };
        let summed = |runs: &[RunData], restart: Restart| {
            runs.iter().fold([SpeedError::default(); 2], |sum, run| {
                let own = both(run, restart);
                [sum[0] + own[0], sum[1] + own[1]]
            })
        };
        Score {
            holdout_runs: holdout.iter().map(|run| both(run, Restart::FullRun)).collect(),
            holdout_window60: summed(holdout, Restart::WINDOW_60),
            holdout_stop_to_stop: stop_to_stop(holdout, before, after),
            fit_runs: summed(&problem.runs, Restart::FullRun),
        }
    }

    /// RMSE in m/s on the holdout runs: before and after.
    pub fn holdout_rmse_mps(&self) -> [Option<f64>; 2] {
        [0, 1].map(|side| {
            self.holdout_runs.iter().map(|run| run[side]).sum::<SpeedError>().rmse_mps()
        })
    }

    /// 95 % interval of 1 - after / before by bootstrap over the holdout runs; `None` with fewer
    /// than two.
    pub fn reduction_interval(&self) -> Option<[f64; 2]> {
        const DRAWS: usize = 2000;
        let runs = self.holdout_runs.len();
        if runs < 2 {
            return None;
        }
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        let mut draw = || {
            // Knuth's linear congruential generator: a fixed sequence, so that results repeat.
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % runs
        };
        let mut reductions: Vec<f64> = (0..DRAWS)
            .filter_map(|_| {
                let mut sums = [SpeedError::default(); 2];
                for _ in 0..runs {
                    let run = self.holdout_runs[draw()];
                    sums = [sums[0] + run[0], sums[1] + run[1]];
                }
                Some(1.0 - sums[1].rmse_mps()? / sums[0].rmse_mps().filter(|&rmse| rmse > 0.0)?)
            })
            .collect();
        reductions.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| reductions[((reductions.len() - 1) as f64 * share) as usize];
        (!reductions.is_empty()).then(|| [at(0.025), at(0.975)])
    }
}
