//! A Kalman filter over a few changing states and many constant ones.

use nalgebra::{SMatrix, SVector};

use super::{NotPositiveDefinite, Step};

/// Mean and covariance of states of which only some move.
///
/// A step of time rewrites single rows, so that its cost grows with N, not with N³; the
/// correction is by one state at a time, in Joseph form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointState<const N: usize> {
    mean: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
}

impl<const N: usize> JointState<N> {
    /// Starts at a mean with its covariance.
    pub fn new(mean: SVector<f64, N>, covariance: SMatrix<f64, N, N>) -> Self {
        JointState { mean, covariance }
    }

    /// The mean.
    pub fn mean(&self) -> &SVector<f64, N> {
        &self.mean
    }

    /// The covariance.
    pub fn covariance(&self) -> &SMatrix<f64, N, N> {
        &self.covariance
    }

    /// Makes state `i` a function of all states: its value, its gradient by the states before,
    /// and the variance of the noise that comes in.
    ///
    /// # Panics
    ///
    /// When there is no state `i`.
    ///
    /// # Real-time
    ///
    /// Work in proportion to N², no allocation.
    pub fn rewrite(&mut self, i: usize, value: f64, gradient: &SVector<f64, N>, variance: f64) {
        let mixed = self.covariance * gradient;
        self.covariance.set_column(i, &mixed);
        self.covariance.set_row(i, &mixed.transpose());
        self.covariance[(i, i)] = gradient.dot(&mixed) + variance;
        self.mean[i] = value;
    }

    /// Adds noise of a variance to state `i`.
    ///
    /// # Panics
    ///
    /// When there is no state `i`.
    pub fn disturb(&mut self, i: usize, variance: f64) {
        self.covariance[(i, i)] += variance;
    }

    /// Forgets state `i`: a new value, independent of the other states.
    ///
    /// # Panics
    ///
    /// When there is no state `i`.
    pub fn replace(&mut self, i: usize, value: f64, variance: f64) {
        self.covariance.fill_column(i, 0.0);
        self.covariance.fill_row(i, 0.0);
        self.covariance[(i, i)] = variance;
        self.mean[i] = value;
    }

    /// The innovation of an observation of state `i`, and its variance.
    ///
    /// # Panics
    ///
    /// When there is no state `i`.
    pub fn innovation(&self, i: usize, observed: f64, variance: f64) -> Step {
        Step { innovation: observed - self.mean[i], variance: self.covariance[(i, i)] + variance }
    }

    /// Takes in an observation of state `i` with noise of a variance.
    ///
    /// # Errors
    ///
    /// When the innovation or its variance is not sound; nothing is then changed.
    ///
    /// # Panics
    ///
    /// When there is no state `i`.
    ///
    /// # Real-time
    ///
    /// Work in proportion to N², no allocation.
    pub fn correct(
        &mut self,
        i: usize,
        observed: f64,
        variance: f64,
    ) -> Result<Step, NotPositiveDefinite> {
        let step = self.innovation(i, observed, variance);
        if !(step.variance > 0.0 && step.variance.is_finite() && step.innovation.is_finite()) {
            return Err(NotPositiveDefinite);
        }
        let column = self.covariance.column(i).into_owned();
        let gain = column / step.variance;
        self.mean += gain * step.innovation;
        // (I - K e') P (I - K e')' + K R K', the row and column of P being `column`.
        for j in 0..N {
            for k in 0..N {
                let crossed = gain[k] * column[j] + column[k] * gain[j];
                self.covariance[(k, j)] += gain[k] * gain[j] * step.variance - crossed;
            }
        }
        Ok(step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::SquareRootInformation;
    use nalgebra::{Matrix3, Vector3};
    use rand::{RngExt, SeedableRng};

    /// x0 gathers what two constants let through; each step of x0 is seen with noise.
    #[test]
    fn without_process_noise_it_is_the_least_squares_of_all_observations() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let start = Matrix3::from_diagonal(&Vector3::new(4.0, 9.0, 1.0));
        let mut filter = JointState::<3>::new(Vector3::zeros(), start);
        let weights = Vector3::new(0.25, 1.0 / 9.0, 1.0);
        let mut batch = SquareRootInformation::<3>::new(&weights, &Vector3::zeros());
        let mut gathered = Vector3::new(1.0, 0.0, 0.0);
        for _ in 0..40 {
            let (p, q) = (random.random::<f64>(), random.random::<f64>());
            gathered += Vector3::new(0.0, p, q);
            let gradient = Vector3::new(1.0, p, q);
            filter.rewrite(0, gradient.dot(filter.mean()), &gradient, 0.0);
            let observed = gathered.dot(&Vector3::new(1.0, 0.7, -0.4)) + random.random::<f64>();
            filter.correct(0, observed, 0.5).unwrap();
            batch.update(&(gathered / 0.5_f64.sqrt()), observed / 0.5_f64.sqrt());
        }
        let estimate = batch.solve().unwrap();
        let covariance = batch.covariance().unwrap();
        assert!((filter.mean().fixed_rows::<2>(1) - estimate.fixed_rows::<2>(1)).norm() < 1e-9);
        assert!((filter.mean()[0] - gathered.dot(&estimate)).abs() < 1e-9);
        let block = filter.covariance().fixed_view::<2, 2>(1, 1);
        assert!((block - covariance.fixed_view::<2, 2>(1, 1)).norm() < 1e-9);
    }

    #[test]
    fn replacing_a_state_cuts_its_ties() {
        let full = Matrix3::new(2.0, 0.5, 0.1, 0.5, 3.0, 0.2, 0.1, 0.2, 1.0);
        let mut filter = JointState::<3>::new(Vector3::new(1.0, 2.0, 3.0), full);
        filter.replace(1, 9.0, 7.0);
        assert_eq!(filter.mean()[1], 9.0);
        assert_eq!(filter.covariance().column(1).into_owned(), Vector3::new(0.0, 7.0, 0.0));
        assert_eq!(filter.covariance()[(0, 2)], 0.1);
        filter.disturb(1, 0.5);
        assert_eq!(filter.covariance()[(1, 1)], 7.5);
    }

    #[test]
    fn an_unsound_observation_changes_nothing() {
        let mut filter = JointState::<3>::new(Vector3::zeros(), Matrix3::identity());
        let before = filter;
        assert!(filter.correct(0, f64::NAN, 1.0).is_err());
        assert!(filter.correct(0, 1.0, -1.0).is_err());
        assert_eq!(filter, before);
    }
}
