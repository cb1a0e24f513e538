//! The Cramér-Rao bound of a run, from its own numerical Jacobian.

use dynocar_core::filter::triangular::{TriangularAccumulator, TriangularSystem};
use dynocar_model::train::Davis;
use nalgebra::{DMatrix, Matrix3};

use super::scenario::{DISTURBANCE_N_PER_KN, DISTURBANCE_S, Run, SPEED_NOISE_MPS, speeds_mps};
use crate::papers::differences;

/// Least covariance of (a, b, c) that an unbiased estimator can have from a run's speeds with
/// white noise, when the initial speed is not known either.
pub fn davis_covariance(run: &Run, davis: &Davis) -> Matrix3<f64> {
    covariance(jacobian(run, davis)) * SPEED_NOISE_MPS.powi(2)
}

/// The same where the resistance is disturbed as in [`Run::disturbed`] and the disturbance's
/// strength and correlation are known: generalised least squares.
pub fn disturbed_davis_covariance(run: &Run, davis: &Davis) -> Matrix3<f64> {
    let rows = jacobian(run, davis);
    let rows = DMatrix::from_fn(rows.len(), 4, |i, j| rows[i][j]);
    let count = run.speeds_mps.len();
    let mut times_s = vec![0.0];
    for (step, speed_mps) in run.steps.iter().zip(&run.speeds_mps) {
        times_s.push(times_s[times_s.len() - 1] + step.size / speed_mps);
    }
    let spread = DMatrix::from_fn(count - 1, count - 1, |i, j| {
        let apart_s: f64 = times_s[i] - times_s[j];
        DISTURBANCE_N_PER_KN.powi(2) * (-apart_s.abs() / DISTURBANCE_S).exp()
    });
    let effect = effects(run, davis);
    let mut noise = &effect * spread * effect.transpose();
    for i in 0..count {
        noise[(i, i)] += SPEED_NOISE_MPS.powi(2);
    }
    let factor = noise.cholesky().expect("white noise makes it positive definite").unpack();
    let whitened = factor.solve_lower_triangular(&rows).expect("a positive diagonal");
    covariance(whitened.row_iter().map(|row| [row[0], row[1], row[2], row[3]]))
}

/// Derivatives of every speed with respect to v_0, a, b and c, by central differences of the
/// truth's own recursion rather than by the derivatives that the estimators use.
fn jacobian(run: &Run, davis: &Davis) -> Vec<[f64; 4]> {
    differences::jacobian([1e-4, 1e-4, 1e-6, 1e-8], |[dv, da, db, dc]| {
        let moved = Davis { a: davis.a + da, b: davis.b + db, c: davis.c + dc };
        speeds_mps(&run.steps, run.speeds_mps[0] + dv, &moved)
    })
}

/// Derivatives of every speed with respect to 1 N/kN of resistance during each step.
fn effects(run: &Run, davis: &Davis) -> DMatrix<f64> {
    let width = 1e-4;
    let count = run.speeds_mps.len();
    let mut effect = DMatrix::zeros(count, count - 1);
    for disturbed in 0..count - 1 {
        let at = |change: f64| {
            let first = Davis { a: davis.a + change, ..*davis };
            let step = &run.steps[disturbed..=disturbed];
            let after_mps = speeds_mps(step, run.speeds_mps[disturbed], &first)[1];
            speeds_mps(&run.steps[disturbed + 1..], after_mps, davis)
        };
        for (offset, (plus, minus)) in at(width).iter().zip(at(-width)).enumerate() {
            effect[(disturbed + 1 + offset, disturbed)] = (plus - minus) / (2.0 * width);
        }
    }
    effect
}

/// Covariance of the last three parameters for rows of unit variance.
fn covariance(rows: impl IntoIterator<Item = [f64; 4]>) -> Matrix3<f64> {
    let mut gathered = TriangularAccumulator::<5>::default();
    rows.into_iter().for_each(|[v, a, b, c]| gathered.push(&[v, a, b, c, 0.0]));
    let information = TriangularSystem::<3>::from_rows(&mut gathered);
    information.covariance().expect("a run that excites a, b and c")
}
