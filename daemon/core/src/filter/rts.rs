//! Fixed-interval smoothing (Rauch, Tung and Striebel 1965).

use nalgebra::{SMatrix, SVector};

use super::kalman::{FilterError, GaussianState};

/// One step of a forward pass of a Kalman filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForwardStep<const N: usize> {
    /// Belief before the step's measurement.
    pub predicted: GaussianState<N>,
    /// Belief after it.
    pub filtered: GaussianState<N>,
    /// Jacobian of the move from the step before to this one.
    pub jacobian: SMatrix<f64, N, N>,
}

/// The belief about one step, given every measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothedStep<const N: usize> {
    /// Mean and covariance.
    pub state: GaussianState<N>,
    /// Covariance of the next step's state with this one's; zero at the last step.
    pub cross_with_next: SMatrix<f64, N, N>,
}

impl<const N: usize> SmoothedStep<N> {
    /// A step about which nothing is known, to fill a buffer with.
    pub fn empty() -> Self {
        let state = GaussianState { mean: SVector::zeros(), covariance: SMatrix::zeros() };
        SmoothedStep { state, cross_with_next: SMatrix::zeros() }
    }
}

/// Smooths a forward pass into `smoothed`, which must be as long.
///
/// # Errors
///
/// When a predicted covariance is not positive definite.
///
/// # Panics
///
/// When the lengths differ.
pub fn smooth<const N: usize>(
    forward: &[ForwardStep<N>],
    smoothed: &mut [SmoothedStep<N>],
) -> Result<(), FilterError> {
    assert_eq!(forward.len(), smoothed.len(), "one smoothed step for each forward step");
    let Some(last) = forward.len().checked_sub(1) else { return Ok(()) };
    smoothed[last] =
        SmoothedStep { state: forward[last].filtered, cross_with_next: SMatrix::zeros() };
    for step in (0..last).rev() {
        let next = &forward[step + 1];
        let filtered = &forward[step].filtered;
        let factor = next
            .predicted
            .covariance
            .cholesky()
            .ok_or(FilterError::NotPositiveDefinite { step: step + 1 })?;
        // gain = P F' Pp^-1, from Pp gain' = F P.
        let gain = factor.solve(&(next.jacobian * filtered.covariance)).transpose();
        let ahead = smoothed[step + 1].state;
        let mean = filtered.mean + gain * (ahead.mean - next.predicted.mean);
        let covariance = filtered.covariance
            + gain * (ahead.covariance - next.predicted.covariance) * gain.transpose();
        smoothed[step] = SmoothedStep {
            state: GaussianState { mean, covariance: (covariance + covariance.transpose()) * 0.5 },
            cross_with_next: ahead.covariance * gain.transpose(),
        };
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::random::Random;
    use nalgebra::{DMatrix, DVector, Matrix2};

    const STEPS: usize = 12;

    struct Problem {
        jacobian: Matrix2<f64>,
        noise: Matrix2<f64>,
        prior: GaussianState<2>,
        measured: Vec<f64>,
        variance: f64,
    }

    fn problem() -> Problem {
        let mut random = Random::new(5);
        Problem {
            jacobian: Matrix2::new(1.0, 0.5, -0.1, 0.9),
            noise: Matrix2::new(0.05, 0.01, 0.01, 0.03),
            prior: GaussianState::independent(
                SVector::from([1.0, -1.0]),
                SVector::from([0.7, 1.5]),
            ),
            measured: (0..STEPS).map(|_| random.normal()).collect(),
            variance: 0.2,
        }
    }

    fn smoothed(problem: &Problem) -> Vec<SmoothedStep<2>> {
        let mut state = problem.prior;
        let mut forward = Vec::new();
        for (step, &measured) in problem.measured.iter().enumerate() {
            if step > 0 {
                let mean = problem.jacobian * state.mean;
                state.predict(mean, &problem.jacobian, &problem.noise);
            }
            let predicted = state;
            let row = SVector::from([1.0, 0.0]);
            let update = state.innovation(row, measured, problem.variance).unwrap();
            state.apply(&update);
            forward.push(ForwardStep { predicted, filtered: state, jacobian: problem.jacobian });
        }
        let mut smoothed = vec![SmoothedStep::empty(); STEPS];
        smooth(&forward, &mut smoothed).unwrap();
        smoothed
    }

    /// All states at once: information matrix and vector of prior, moves and measurements.
    fn batch(problem: &Problem) -> (DVector<f64>, DMatrix<f64>) {
        let mut information = DMatrix::zeros(2 * STEPS, 2 * STEPS);
        let mut vector = DVector::zeros(2 * STEPS);
        let prior = problem.prior.covariance.try_inverse().unwrap();
        let mut block = information.fixed_view_mut::<2, 2>(0, 0);
        block += prior;
        let mut first = vector.fixed_rows_mut::<2>(0);
        first += prior * problem.prior.mean;
        let weight = problem.noise.try_inverse().unwrap();
        for step in 0..STEPS {
            information[(2 * step, 2 * step)] += 1.0 / problem.variance;
            vector[2 * step] += problem.measured[step] / problem.variance;
            if step + 1 < STEPS {
                let (from, to) = (2 * step, 2 * step + 2);
                let back = problem.jacobian.transpose() * weight;
                let mut block = information.fixed_view_mut::<2, 2>(from, from);
                block += back * problem.jacobian;
                let mut block = information.fixed_view_mut::<2, 2>(to, to);
                block += weight;
                let mut block = information.fixed_view_mut::<2, 2>(from, to);
                block -= back;
                let mut block = information.fixed_view_mut::<2, 2>(to, from);
                block -= back.transpose();
            }
        }
        let covariance = information.try_inverse().unwrap();
        (&covariance * vector, covariance)
    }

    #[test]
    fn smoothing_equals_batch_least_squares() {
        let problem = problem();
        let (means, covariance) = batch(&problem);
        for (step, smoothed) in smoothed(&problem).iter().enumerate() {
            let mean = means.fixed_rows::<2>(2 * step);
            let own = covariance.fixed_view::<2, 2>(2 * step, 2 * step);
            assert!((smoothed.state.mean - mean).norm() < 1e-10);
            assert!((smoothed.state.covariance - own).norm() < 1e-10);
            if step + 1 < STEPS {
                let cross = covariance.fixed_view::<2, 2>(2 * step + 2, 2 * step);
                assert!((smoothed.cross_with_next - cross).norm() < 1e-10);
            }
        }
    }

    #[test]
    fn a_singular_prediction_is_reported_with_its_step() {
        let state = GaussianState { mean: SVector::zeros(), covariance: SMatrix::zeros() };
        let step = ForwardStep { predicted: state, filtered: state, jacobian: Matrix2::identity() };
        let refused = smooth(&[step; 3], &mut [SmoothedStep::empty(); 3]);
        assert_eq!(refused, Err(FilterError::NotPositiveDefinite { step: 2 }));
    }
}
