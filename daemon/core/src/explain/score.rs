//! Open-loop prediction: the judge of a finished model.

use super::evidence::{Fit, FitProblem, GrownForces, RunData};
use crate::simulate::{Prediction, Restart, SpeedError};

/// Errors of the model without and with the effects.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Score {
    /// Whole holdout runs, by run: before and after.
    pub holdout_runs: Vec<[SpeedError; 2]>,
    /// Holdout runs restarted every 60 s: before and after.
    pub holdout_window60: [SpeedError; 2],
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

/// Open-loop errors of some runs: root mean square in m/s over whole runs and with restarts every
/// 60 s, and the share by which the integrated speed misses the measured way, with what that is
/// known to.
pub fn open_loop_errors(runs: &[RunData], way_ratio: Option<(f64, f64)>, fit: &Fit) -> [f64; 3] {
    let [whole, restarted] = [Restart::FullRun, Restart::WINDOW_60].map(|restart| {
        let error: SpeedError = runs.iter().map(|run| run_error(fit, run, restart)).sum();
        error.rmse_mps().unwrap_or(0.0)
    });
    let missed =
        |(ratio, deviation): (f64, f64)| (ratio - 1.0 / fit.speed_scale()).hypot(deviation);
    [whole, restarted, way_ratio.map_or(0.0, missed)]
}

/// The same of the fit runs.
pub fn errors_on_fit_runs(problem: &FitProblem, fit: &Fit) -> [f64; 3] {
    open_loop_errors(&problem.runs, problem.way_ratio, fit)
}

/// Share of the error that a model takes away: over whole runs, with restarts or of the way,
/// whichever is most.
pub fn reduction(before: [f64; 3], after: [f64; 3]) -> f64 {
    before
        .into_iter()
        .zip(after)
        .map(|(before, after)| if before > 0.0 { 1.0 - after / before } else { 0.0 })
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Share of the error of the fit runs that the larger model takes away.
pub fn reduction_on_fit_runs(problem: &FitProblem, smaller: &Fit, larger: &Fit) -> f64 {
    reduction(errors_on_fit_runs(problem, smaller), errors_on_fit_runs(problem, larger))
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
