//! The run as the unit of evidence.

use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::explain::evidence::{Fit, RunNormal};

/// What an effect does for runs that did not take part in its fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// Decrease of -2 log likelihood on the runs left out, summed.
    pub gain: f64,
    /// Runs on which it helps.
    pub better: usize,
    /// Runs in all.
    pub runs: usize,
}

/// By how much the parameters move when each run is left out, to second order; `None` for a run
/// without which they are not determined.
fn moves_without_each_run(fit: &Fit) -> Vec<Option<DVector<f64>>> {
    let information = fit.information();
    let moved = |run: &RunNormal| {
        let rest = Cholesky::new(&information - &run.information)?;
        Some(-rest.solve(&run.score))
    };
    fit.runs.iter().map(moved).collect()
}

/// Cost of each run under the parameters fitted without it, to second order.
fn held_out_costs(fit: &Fit) -> Vec<f64> {
    fit.runs
        .iter()
        .zip(moves_without_each_run(fit))
        .map(|(run, moved)| match moved {
            Some(away) => {
                run.cost - 2.0 * run.score.dot(&away) + away.dot(&(&run.information * &away))
            }
            None => run.cost,
        })
        .collect()
}

/// Leaves one run out at a time: what the larger model gains on it.
pub fn leave_one_run_out(smaller: &Fit, larger: &Fit) -> Held {
    let (before, after) = (held_out_costs(smaller), held_out_costs(larger));
    let gains = before.iter().zip(&after).map(|(before, after)| before - after);
    Held {
        gain: gains.clone().sum(),
        better: gains.filter(|&gain| gain > 0.0).count(),
        runs: before.len(),
    }
}

/// The form of an effect (a train of one piece, averages over bins) is itself good to this share
/// of its size.
const FORM_SHARE: f64 = 0.015;

/// Student's 97.5 % quantile for the runs' degrees of freedom over the normal one, so that
/// 1.96 standard deviations make a 95 % interval.
fn few_runs_factor(runs: usize) -> f64 {
    let freedom = (runs as f64 - 1.0).max(2.0);
    StudentsT::new(0.0, 1.0, freedom).map_or(1.0, |student| student.inverse_cdf(0.975) / 1.96)
}

/// Standard deviations of all parameters, and their covariance.
///
/// The likelihood's covariance is enlarged where the parameters move more when single runs are
/// left out than it says (jackknife over runs). With few runs a parameter's own scatter is itself
/// uncertain: where that of all parameters together is greater, half of the enlargement is theirs.
pub fn deviations(fit: &Fit) -> (Vec<f64>, DMatrix<f64>) {
    let count = fit.theta.len();
    let Some(factor) = Cholesky::new(fit.free_information()) else {
        return (vec![f64::NAN; count], DMatrix::zeros(count, count));
    };
    let covariance = factor.inverse();
    let runs = fit.runs.len() as f64;
    let mut scatter = DVector::zeros(count);
    for moved in moves_without_each_run(fit).into_iter().flatten() {
        scatter += moved.component_mul(&moved);
    }
    let left = (runs - 1.0) / runs;
    let own: Vec<f64> = (0..count).map(|i| left * scatter[i] / covariance[(i, i)]).collect();
    let pooled = own.iter().sum::<f64>() / count as f64;
    let enlarged: Vec<f64> = own.iter().map(|own| own.max(0.5 * (own + pooled)).max(1.0)).collect();
    let few = few_runs_factor(fit.runs.len());
    let mut deviations: Vec<f64> =
        (0..count).map(|i| few * (covariance[(i, i)] * enlarged[i]).sqrt()).collect();
    for (effect, range) in fit.model.effects.iter().zip(fit.model.ranges()) {
        for i in range.clone() {
            let form = FORM_SHARE * (fit.theta[i] - effect.none());
            deviations[i] = deviations[i].hypot(form);
        }
        deviations[range.start] = deviations[range.start].hypot(effect.shared_error());
    }
    let scaled = DMatrix::from_fn(count, count, |i, j| {
        covariance[(i, j)] * (enlarged[i] * enlarged[j]).sqrt()
    });
    (deviations, scaled)
}
