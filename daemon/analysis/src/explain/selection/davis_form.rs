//! By how much a, b and c can be wrong because a train's resistance is only nearly a + b v + c v².
//!
//! The forces that a model leaves out at some speeds are the same in every run, and a, b and c take them up: a train's
//! mass is not spread evenly, and gradients change between the places that a map states. No number of runs averages
//! that out, so that the deviations have a floor.

use dynocar_model::train::Davis;
use nalgebra::{Cholesky, DMatrix, Matrix3, Vector3};

use crate::explain::evidence::FitProblem;

/// Standard deviation of the form at any speed, as a share of the resistance there.
const FORM_SHARE: f64 = 0.002;
/// Width in m/s of the classes of speed.
const CLASS_MPS: f64 = 1.0;
/// Share of the greatest speed over which an error of the form is alike.
const ALIKE_SHARE: f64 = 0.25;

/// Time at each class of speed, with its middle.
type SpeedClasses = Vec<(f64, f64)>;

/// Returns the standard deviations of a, b and c by the error of their form; `None` where the speeds of the runs do not
/// determine them.
pub fn davis_form_std(problem: &FitProblem, davis: Davis) -> Option<[f64; 3]> {
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
    let error = |speed_mps: f64| FORM_SHARE * davis.w0_n_per_kn(speed_mps);
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
            let shares = floor / value / FORM_SHARE;
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
            FORM_SHARE * DAVIS.w0_n_per_kn(speed_mps) * (speed_mps / 30.0 * 6.0).sin()
        };
        let rows = DMatrix::from_fn(classes.len(), 3, |k, i| classes[k].0.powi(i as i32));
        let errors = DMatrix::from_fn(classes.len(), 1, |k, _| bent(classes[k].0));
        let taken_up = rows.svd(true, true).solve(&errors, 1e-12).expect("a solution");
        for i in 0..3 {
            assert!(taken_up[i].abs() < 3.0 * floor[i], "{taken_up} {floor:?}");
        }
    }
}
