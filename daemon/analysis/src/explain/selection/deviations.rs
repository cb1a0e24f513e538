//! How surely the parameters of a fitted model are known, with the run as the unit of evidence; and by how much they can
//! be wrong in any number of runs.

use std::ops::Range;

use dynocar_model::train::Davis;
use dynocar_shared::HALF_95;
use nalgebra::{Cholesky, DMatrix, DVector, Matrix3, Vector3};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::explain::evidence::{Fit, FitProblem, PRIOR_RUNS, RunData, RunNormal, UpdatedModel};

/// Standard deviation, as a share of its range, with which a parameter at a bound is held there.
const HELD_SHARE: f64 = 1e-4;
/// Least number of runs whose scatter says anything.
const RUNS_MIN: usize = 2;

/// Returns the changes of the first `count` parameters when each run is left out, to second order, with all others
/// held. A run without which they are not determined has no entry.
fn moves_without_each_run(
    information: &DMatrix<f64>,
    runs: &[RunNormal],
    count: usize,
) -> Vec<DVector<f64>> {
    let moved = |run: &RunNormal| {
        let rest = Cholesky::new(first(&(information - &run.information), count))?;
        Some(-rest.solve(&run.score.rows(0, count)))
    };
    runs.iter().filter_map(moved).collect()
}

/// Returns the leading `count` rows and columns of a matrix.
fn first(matrix: &DMatrix<f64>, count: usize) -> DMatrix<f64> {
    matrix.view((0, 0), (count, count)).into_owned()
}

/// Returns the parameters fitted without each run, to second order and within their bounds: a prediction for that run
/// from the others. A parameter that the others do not determine has no effect; a parameter of a single run (its wind,
/// its load) stays as it was fitted, since it says nothing of other runs. With a single run all stay.
pub fn without_each_run(problem: &FitProblem, fit: &Fit) -> Vec<Vec<f64>> {
    let count = fit.theta.len();
    if fit.runs.len() < RUNS_MIN {
        return vec![fit.theta.clone(); fit.runs.len()];
    }
    // The pull of the runs and the prior, and with it, as weak as possible, a pull towards zero.
    let (mut information, mut pull) = (fit.information(), fit.score());
    let mut bounds = vec![Some((f64::NEG_INFINITY, f64::INFINITY)); count];
    for (effect, range) in fit.model.effects.iter().zip(fit.model.ranges()) {
        let place = effect.place();
        let acts = |parameter: usize| {
            let in_run =
                |run: &&RunData| place.may_be_in(&run.file) && effect.touches(parameter, run);
            problem.runs.iter().filter(in_run).count()
        };
        for (parameter, (i, spec)) in range.zip(effect.parameters()).enumerate() {
            bounds[i] = (acts(parameter) > 1).then_some((spec.lower, spec.upper));
            let width = spec.upper - spec.lower;
            let at_bound = |bound: f64| (fit.theta[i] - bound).abs() < spec.step;
            if at_bound(spec.lower) || at_bound(spec.upper) {
                // A parameter that all runs push against a bound stays there.
                information[(i, i)] += (HELD_SHARE * width).powi(-2);
                continue;
            }
            // A flat prior's variance: as wide as the parameter's range.
            let weight = 12.0 / width.powi(2);
            information[(i, i)] += weight;
            pull[i] += weight * (effect.none() - fit.theta[i]);
        }
    }
    let moved = |run: &RunNormal| {
        let Some(rest) = Cholesky::new(&information - &run.information) else {
            return fit.theta.clone();
        };
        let away = rest.solve(&(&pull - &run.score));
        let each = fit.theta.iter().zip(&bounds).enumerate();
        each.map(|(i, (value, bounds))| {
            bounds.map_or(*value, |(lower, upper)| (value + away[i]).clamp(lower, upper))
        })
        .collect()
    };
    fit.runs.iter().map(moved).collect()
}

/// The form of an effect (a train of one piece, averages over bins, one number for a drive's efficiency) is itself good
/// to this share of its size.
pub const EFFECT_FORM_SHARE: f64 = 0.01;

/// Student's 97.5 % quantile over the normal one, so that 1.96 standard deviations make a 95 %
/// interval.
fn students_factor(freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom).map_or(1.0, |student| student.inverse_cdf(0.975) / HALF_95)
}

/// Returns the factor by which a standard deviation that only the scatter between `runs` runs gives is enlarged.
pub fn few_runs_factor(runs: usize) -> f64 {
    students_factor((runs as f64 - 1.0).max(2.0))
}

/// How surely the parameters of a fitted model are known.
#[derive(Clone, Debug)]
pub struct Deviations {
    /// Standard deviations, of which 1.96 make a 95 % interval.
    pub std: Vec<f64>,
    /// Covariance by likelihood, scatter and sampling, without the shares of the forms and the map.
    pub covariance: DMatrix<f64>,
    /// c of the same fit, to which an effect refers that is a share of c.
    pub c: f64,
}

impl Deviations {
    /// Returns the standard deviation of the sum of some parameters.
    pub fn std_of_sum(&self, of: Range<usize>) -> f64 {
        let own = self.covariance.view((of.start, of.start), (of.len(), of.len()));
        own.sum().max(0.0).sqrt()
    }

    /// Adds the errors that runs with samples some s apart share, so that more of them do not take these away: of the
    /// form of a, b and c, and of the unknown course between samples. `theta` begins with a, b and c.
    pub fn add_shared_errors(
        &mut self,
        problem: &FitProblem,
        model: &UpdatedModel,
        theta: &[f64],
        step_s: f64,
    ) {
        let davis = Davis { a: theta[0], b: theta[1], c: theta[2] };
        if let Some(floor) = davis_form_std(problem, davis) {
            self.std.iter_mut().zip(floor).for_each(|(std, floor)| *std = std.hypot(floor));
        }
        for (effect, range) in model.effects.iter().zip(model.ranges()) {
            let split = effect.sampling_error(step_s);
            for i in range.clone() {
                self.std[i] = self.std[i].hypot(split);
                for j in range.clone() {
                    // A dead time that is longer by this leaves a lag that is shorter by as much.
                    let sign = if i == j { 1.0 } else { -1.0 };
                    self.covariance[(i, j)] += sign * split * split;
                }
            }
        }
    }
}

/// Standard deviations of all parameters, and their covariance.
///
/// The likelihood's variance and the scatter between the runs (jackknife: how the parameters move when
/// single runs are left out) are averaged, the likelihood counting as `PRIOR_RUNS` runs and the scatter
/// as those there are.
pub fn deviations(fit: &Fit) -> Deviations {
    deviations_of_first(fit, fit.theta.len())
}

/// By how much the scatter between the runs enlarges the likelihood's standard deviation of a parameter.
pub fn scatter_factor(fit: &Fit, parameter: usize) -> f64 {
    let likelihood = Cholesky::new(fit.free_information()).map(|factor| factor.inverse());
    let variance = likelihood.map_or(f64::NAN, |covariance| covariance[(parameter, parameter)]);
    deviations(fit).std[parameter] / variance.sqrt()
}

/// Returns the deviations of the first `count` parameters together with the last `shared`: errors that all runs
/// share, of which the scatter between the runs shows nothing.
pub fn deviations_with_nuisance(fit: &Fit, count: usize, shared: usize) -> Deviations {
    let information = fit.free_information();
    let variance_of = |parameters: usize| {
        let factor = Cholesky::new(first(&information, parameters))?;
        Some(first(&factor.inverse(), count))
    };
    let held = fit.theta.len() - shared;
    let Deviations { mut std, covariance, c } = deviations_of_first(fit, held);
    std.truncate(count);
    let mut covariance = first(&covariance, count);
    if let (Some(joint), Some(alone)) = (variance_of(fit.theta.len()), variance_of(held)) {
        let added = joint - alone;
        for (i, std) in std.iter_mut().enumerate() {
            *std = std.hypot(added[(i, i)].max(0.0).sqrt());
        }
        covariance += added;
    }
    Deviations { std, covariance, c }
}

/// Returns the covariance of the first parameters, as the scatter between the runs enlarges it; `information` and the
/// score of each run are of all parameters, where those fit best.
pub fn enlarged_by_scatter(
    covariance: &DMatrix<f64>,
    information: &DMatrix<f64>,
    runs: &[RunNormal],
) -> DMatrix<f64> {
    let count = covariance.nrows();
    let mut scatter = DVector::zeros(count);
    for moved in moves_without_each_run(information, runs, count) {
        scatter += moved.component_mul(&moved);
    }
    let runs = runs.len() as f64;
    let left = (runs - 1.0) / runs;
    let freedom = PRIOR_RUNS + runs - 1.0;
    let enlarged = |i: usize| {
        let seen = left * scatter[i] / covariance[(i, i)];
        let both = (PRIOR_RUNS + (runs - 1.0) * seen) / freedom;
        // Runs that agree better than their noise lets them share it: without one of them it stays.
        students_factor(freedom) * both.max(1.0).sqrt()
    };
    let enlarged: Vec<f64> = (0..count).map(enlarged).collect();
    DMatrix::from_fn(count, count, |i, j| covariance[(i, j)] * enlarged[i] * enlarged[j])
}

/// Returns the deviations of the first `count` parameters with all others held.
fn deviations_of_first(fit: &Fit, count: usize) -> Deviations {
    let Some(factor) = Cholesky::new(first(&fit.free_information(), count)) else {
        let (std, covariance) = (vec![f64::NAN; count], DMatrix::zeros(count, count));
        return Deviations { std, covariance, c: fit.theta[2] };
    };
    let scaled = enlarged_by_scatter(&factor.inverse(), &fit.information(), &fit.runs);
    let std = std_with_forms(&scaled, &fit.model, &fit.theta);
    Deviations { std, covariance: scaled, c: fit.theta[2] }
}

/// Returns the standard deviations of the first parameters of a model by their covariance, enlarged by the errors of
/// the effects' forms and of the map.
pub fn std_with_forms(covariance: &DMatrix<f64>, model: &UpdatedModel, theta: &[f64]) -> Vec<f64> {
    let count = covariance.nrows();
    let mut std: Vec<f64> = (0..count).map(|i| covariance[(i, i)].sqrt()).collect();
    let effects = model.effects.iter().zip(model.ranges());
    for (effect, range) in effects.filter(|(_, range)| range.end <= count) {
        for i in range.clone() {
            let form = EFFECT_FORM_SHARE * (theta[i] - effect.none());
            std[i] = std[i].hypot(form);
        }
        // The part of a map's error that all passages share lies on the size, or on every gradient.
        let last = if effect.is_gradient() { range.end } else { range.start + 1 };
        for std in &mut std[range.start..last] {
            *std = std.hypot(effect.nature().shared_error);
        }
    }
    std
}

/// Standard deviation of the form at any speed, as a share of the resistance there.
const DAVIS_FORM_SHARE: f64 = 0.002;
/// Width in m/s of the classes of speed.
const CLASS_MPS: f64 = 1.0;
/// Share of the greatest speed over which an error of the form is alike.
const ALIKE_SHARE: f64 = 0.25;

/// Time at each class of speed, with its middle.
type SpeedClasses = Vec<(f64, f64)>;

/// Returns the standard deviations of a, b and c by the error of their form; `None` where the speeds of the runs do not
/// determine them.
///
/// A train's resistance is only nearly a + b v + c v²: its mass is not spread evenly, and gradients change between the
/// places that a map states. The forces that the form leaves out at some speeds are the same in every run, a, b and c
/// take them up, and no number of runs averages that out.
fn davis_form_std(problem: &FitProblem, davis: Davis) -> Option<[f64; 3]> {
    let bins = problem.runs.iter().flat_map(|run| &run.bins);
    form_std(&classes(bins.map(|bin| bin.speed_mps)), davis)
}

fn classes(speeds_mps: impl Iterator<Item = f64>) -> SpeedClasses {
    let mut classes: SpeedClasses = Vec::new();
    for speed_mps in speeds_mps {
        let class = (speed_mps / CLASS_MPS) as usize;
        while classes.len() <= class {
            classes.push(((classes.len() as f64 + 0.5) * CLASS_MPS, 0.0));
        }
        classes[class].1 += 1.0;
    }
    classes
}

/// The same over classes of speed: least squares of an error that is alike at speeds close to each other.
fn form_std(classes: &SpeedClasses, davis: Davis) -> Option<[f64; 3]> {
    let powers = |speed_mps: f64| Vector3::new(1.0, speed_mps, speed_mps * speed_mps);
    let information: Matrix3<f64> = classes
        .iter()
        .map(|&(speed_mps, weight)| weight * powers(speed_mps) * powers(speed_mps).transpose())
        .sum();
    let known = Cholesky::new(information)?.inverse();
    let alike_mps = ALIKE_SHARE * classes.last()?.0;
    let error = |speed_mps: f64| DAVIS_FORM_SHARE * davis.w0_n_per_kn(speed_mps);
    let errors = DMatrix::from_fn(classes.len(), classes.len(), |i, j| {
        let (one_mps, other_mps) = (classes[i].0, classes[j].0);
        let apart = (one_mps - other_mps) / alike_mps;
        error(one_mps) * error(other_mps) * (-0.5 * apart * apart).exp()
    });
    let taken_up = DMatrix::from_fn(3, classes.len(), |i, k| {
        let (speed_mps, weight) = classes[k];
        weight * (known.row(i) * powers(speed_mps))[0]
    });
    let covariance = &taken_up * errors * taken_up.transpose();
    Some([0, 1, 2].map(|i| covariance[(i, i)].max(0.0).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DAVIS: Davis = Davis { a: 2.0, b: 0.03, c: 0.004 };

    fn speeds_mps(runs: usize) -> impl Iterator<Item = f64> {
        (0..runs).flat_map(|_| (0..300).map(|k| 0.1 * f64::from(k)))
    }

    #[test]
    fn more_runs_at_the_same_speeds_leave_the_floor_where_it_is() {
        let of = |runs| form_std(&classes(speeds_mps(runs)), DAVIS).expect("three speeds and more");
        let (few, many) = (of(2), of(512));
        for i in 0..3 {
            assert!((few[i] / many[i] - 1.0).abs() < 1e-9);
        }
        // A multiple of the form's own error, since a, b and c look alike over a few speeds.
        for (floor, value) in few.into_iter().zip([DAVIS.a, DAVIS.b, DAVIS.c]) {
            let shares = floor / value / DAVIS_FORM_SHARE;
            assert!((1.0..100.0).contains(&shares), "{few:?}");
        }
    }

    #[test]
    fn trains_of_a_single_speed_have_no_floor_that_could_be_stated() {
        assert_eq!(form_std(&classes([5.2, 5.4].into_iter()), DAVIS), None);
    }

    #[test]
    fn a_resistance_that_bends_by_its_usual_error_lies_within() {
        let classes = classes(speeds_mps(1));
        let floor = form_std(&classes, DAVIS).expect("three speeds and more");
        let bent = |speed_mps: f64| {
            DAVIS_FORM_SHARE * DAVIS.w0_n_per_kn(speed_mps) * (speed_mps / 30.0 * 6.0).sin()
        };
        let rows = DMatrix::from_fn(classes.len(), 3, |k, i| classes[k].0.powi(i as i32));
        let errors = DMatrix::from_fn(classes.len(), 1, |k, _| bent(classes[k].0));
        let taken_up = rows.svd(true, true).solve(&errors, 1e-12).expect("a solution");
        for i in 0..3 {
            assert!(taken_up[i].abs() < 3.0 * floor[i], "{taken_up} {floor:?}");
        }
    }
}
