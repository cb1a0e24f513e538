//! Open-loop errors before and after, with intervals by bootstrap.

use dynocar_model::simulate::{Restart, SpeedError};

use super::IntervalEstimate;
use crate::dataset::Role;
use crate::explain::Explanation;
use crate::explain::evidence::{Fit, RunData};
use crate::explain::score::{self, pooled, predicted, run_error};
use crate::explain::stop_to_stop::Judged;
use crate::explain::stop_to_stop::StopToStop;
use crate::statistics::intervals_95;

/// Length in s of the blocks of a single run.
const BLOCK_S: f64 = 60.0;

/// Units that were resampled with replacement for the intervals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resampling {
    /// Whole runs.
    Runs(usize),
    /// Blocks of 60 s of a single run.
    Blocks(usize),
}

/// Errors of the models without and with the effects over the same samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorPair {
    /// RMSE in m/s without the effects.
    pub before_mps: IntervalEstimate,
    /// RMSE in m/s with the effects.
    pub after_mps: IntervalEstimate,
    /// 1 - after / before.
    pub reduction: IntervalEstimate,
    /// How the intervals were found.
    pub resampling: Resampling,
}

/// Errors of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunErrors {
    /// The run's file.
    pub file: String,
    /// Fit or holdout.
    pub role: Role,
    /// RMSE in m/s without and with the effects, from start to end.
    pub full_run_mps: Option<[f64; 2]>,
    /// The same restarted every 60 s.
    pub window60_mps: Option<[f64; 2]>,
}

/// All errors that a report shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Errors {
    /// Fit runs from start to end.
    pub fit: Option<ErrorPair>,
    /// Holdout runs from start to end.
    pub holdout: Option<ErrorPair>,
    /// Fit runs restarted every 60 s.
    pub fit_window60: Option<ErrorPair>,
    /// Holdout runs restarted every 60 s.
    pub holdout_window60: Option<ErrorPair>,
    /// Holdout runs from stop to stop.
    pub holdout_stop_to_stop: Option<StopToStop>,
    /// Fit runs from stop to stop.
    pub fit_stop_to_stop: Option<StopToStop>,
    /// Run by run, fit runs first.
    pub by_run: Vec<RunErrors>,
}

impl Errors {
    /// Returns the errors of an explanation's models.
    pub fn from_explanation(explanation: &Explanation) -> Self {
        let (before, after) = (&explanation.outcome.base, &explanation.outcome.fit);
        let (fit, holdout) = (&explanation.problem.runs[..], &explanation.holdout[..]);
        let pair = |runs: &[RunData], restart| error_pair(runs, before, after, restart);
        let mut scored = pair(holdout, Restart::FullRun);
        let are_all = explanation.score.holdout_runs.len() == holdout.len();
        if let (Some(scored), Some(interval), true) =
            (&mut scored, explanation.answer.error_reduction_interval, are_all && holdout.len() > 1)
        {
            // The page and the answer for machines state one interval of the same runs.
            scored.reduction.interval = Some(interval);
        }
        Errors {
            fit: pair(fit, Restart::FullRun),
            holdout: scored,
            fit_window60: pair(fit, Restart::WINDOW_60),
            holdout_window60: pair(holdout, Restart::WINDOW_60),
            holdout_stop_to_stop: explanation.score.holdout_stop_to_stop.clone(),
            fit_stop_to_stop: score::stop_to_stop(fit, before, after),
            by_run: fit.iter().chain(holdout).map(|run| run_errors(run, before, after)).collect(),
        }
    }

    /// Returns the errors that judge the model: those of the holdout runs, else those of the fit runs; from
    /// stop to stop where there are stops.
    pub fn judged(&self) -> Option<(Role, Judged)> {
        let one = |stops: &Option<StopToStop>, pair: Option<ErrorPair>| {
            stops.as_ref().map(Judged::from).or(pair.map(|pair| pair.judged()))
        };
        let holdout = one(&self.holdout_stop_to_stop, self.holdout);
        let fit = || Some((Role::Fit, one(&self.fit_stop_to_stop, self.fit)?));
        holdout.map(|judged| (Role::Holdout, judged)).or_else(fit)
    }
}

impl ErrorPair {
    /// Returns the pair as the error that judges a model.
    fn judged(&self) -> Judged {
        let count = match self.resampling {
            Resampling::Runs(count) => count,
            Resampling::Blocks(_) => 1,
        };
        let all = [self.before_mps, self.after_mps, self.reduction].map(|it| it.interval);
        let intervals = match all {
            [Some(before), Some(after), Some(reduction)] => Some([before, after, reduction]),
            _ => None,
        };
        Judged::by_full_runs(count, [self.before_mps.value, self.after_mps.value], intervals)
    }
}

fn run_errors(run: &RunData, before: &Fit, after: &Fit) -> RunErrors {
    let both = |restart| {
        let [one, other] = [before, after].map(|fit| run_error(fit, run, restart).rmse_mps());
        Some([one?, other?])
    };
    RunErrors {
        file: run.file.clone(),
        role: run.role,
        full_run_mps: both(Restart::FullRun),
        window60_mps: both(Restart::WINDOW_60),
    }
}

fn error_pair(runs: &[RunData], before: &Fit, after: &Fit, restart: Restart) -> Option<ErrorPair> {
    let (units, resampling) = match runs {
        [] => return None,
        [run] => {
            let blocks = blocks(run, before, after, restart);
            let count = blocks.len();
            (blocks, Resampling::Blocks(count))
        }
        _ => {
            let errors = runs.iter().map(|run| [before, after].map(|f| run_error(f, run, restart)));
            (errors.collect(), Resampling::Runs(runs.len()))
        }
    };
    bootstrap(&units, resampling)
}

/// Returns the errors of one run in blocks of 60 s.
fn blocks(run: &RunData, before: &Fit, after: &Fit, restart: Restart) -> Vec<[SpeedError; 2]> {
    let (samples, time_s) = (run.samples(), run.recording.time_s());
    let count = (run.duration_s() / BLOCK_S) as usize + 1;
    let mut blocks = vec![[SpeedError::default(); 2]; count];
    for (side, fit) in [before, after].into_iter().enumerate() {
        let prediction = predicted(fit, run, restart);
        for (i, sample) in samples.iter().enumerate() {
            if sample.speed_mps > dynocar_model::simulate::MOVING_SPEED_MPS
                && run.recording.is_simulated(i)
            {
                let away = prediction.speed_mps()[i] - sample.speed_mps;
                let block = &mut blocks[(time_s[i] / BLOCK_S) as usize][side];
                *block = *block + SpeedError { sum_of_squares: away * away, count: 1 };
            }
        }
    }
    blocks.retain(|block| block[0].count > 0);
    blocks
}

/// Percentile bootstrap over units; the two models are always judged on the same draw.
fn bootstrap(units: &[[SpeedError; 2]], resampling: Resampling) -> Option<ErrorPair> {
    let values = pooled(units.iter().copied())?;
    let intervals = intervals_95(units, |drawn| pooled(drawn.iter().map(|unit| **unit)));
    let estimate = |which: usize| IntervalEstimate {
        value: values[which],
        interval: intervals.map(|intervals| intervals[which]),
    };
    Some(ErrorPair {
        before_mps: estimate(0),
        after_mps: estimate(1),
        reduction: estimate(2),
        resampling,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_core::filter::random::Random;

    fn unit(before_mps: f64, after_mps: f64) -> [SpeedError; 2] {
        [before_mps, after_mps]
            .map(|rmse| SpeedError { sum_of_squares: 100.0 * rmse * rmse, count: 100 })
    }

    #[test]
    fn intervals_hold_the_value_and_stay_within_the_units() {
        let units: Vec<_> = (0..12).map(|i| unit(1.0 + 0.05 * f64::from(i), 0.4)).collect();
        let pair = bootstrap(&units, Resampling::Runs(12)).unwrap();
        let [low, high] = pair.before_mps.interval.unwrap();
        assert!(1.0 < low && low < pair.before_mps.value);
        assert!(pair.before_mps.value < high && high < 1.55);
        assert_eq!(pair.after_mps.interval.map(|i| i.map(|x| (1e9 * x).round())), Some([4e8; 2]));
        assert!((pair.reduction.value - (1.0 - 0.4 / pair.before_mps.value)).abs() < 1e-12);
    }

    #[test]
    fn a_bootstrap_interval_covers_the_mean_square_about_as_often_as_it_says() {
        let mut random = Random::new(3);
        let (mut covered, repeats) = (0, 150);
        for _ in 0..repeats {
            let units: Vec<_> = (0..30)
                .map(|_| {
                    let square = 1.0 + 0.2 * random.normal();
                    unit(square.max(0.0).sqrt(), 0.5)
                })
                .collect();
            let [low, high] =
                bootstrap(&units, Resampling::Runs(30)).unwrap().before_mps.interval.unwrap();
            covered += usize::from(low < 1.0 && 1.0 < high);
        }
        let share = covered as f64 / f64::from(repeats);
        assert!((0.86..=0.99).contains(&share), "{share}");
    }

    #[test]
    fn one_unit_has_no_interval() {
        let pair = bootstrap(&[unit(1.0, 0.5)], Resampling::Blocks(1)).unwrap();
        assert_eq!(pair.reduction, IntervalEstimate { value: 0.5, interval: None });
        assert_eq!(bootstrap(&[], Resampling::Blocks(0)), None);
    }
}
