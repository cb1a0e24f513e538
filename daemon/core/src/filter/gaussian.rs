//! A Gaussian belief about a state, in covariance form.
//!
//! Every filter in covariance form consists of these steps. First the state moves: as a whole by a linearised model
//! ([`Gaussian::predict`]) or, where most components stay, by single components ([`Gaussian::rewrite`]). Then
//! measurements of single components are taken in: [`Gaussian::innovation`] forms the innovation, the caller judges
//! it, and [`Gaussian::take`] updates the belief.

use nalgebra::{SMatrix, SVector};

use super::NotPositiveDefinite;
use super::covariance::{measured, moved};

/// Innovation of a scalar measurement before the measurement update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Measured minus predicted value.
    pub value: f64,
    /// Its predicted variance: the belief's and the measurement's own.
    pub variance: f64,
    /// One over `variance`.
    pub inverse_variance: f64,
}

impl Innovation {
    /// Returns the innovation of a difference, with the variances of the prediction and of the measurement.
    ///
    /// # Errors
    ///
    /// When the belief's variance is negative, or a number is not finite.
    #[inline(always)]
    pub fn new(
        value: f64,
        predicted_variance: f64,
        noise_variance: f64,
    ) -> Result<Self, NotPositiveDefinite> {
        let variance = predicted_variance + noise_variance;
        let inverse_variance = 1.0 / variance;
        // Also refuses NaN.
        let is_sound = variance >= noise_variance && variance > 0.0 && variance.is_finite();
        match is_sound && value.is_finite() {
            true => Ok(Innovation { value, variance, inverse_variance }),
            false => Err(NotPositiveDefinite),
        }
    }

    /// Returns its square over its predicted variance.
    pub fn normalised_square(&self) -> f64 {
        self.value * self.value * self.inverse_variance
    }

    /// It over its predicted standard deviation.
    pub fn normalised(&self) -> f64 {
        self.value * self.inverse_variance.sqrt()
    }

    /// Returns the logarithm of the predicted density of the measured value.
    pub fn log_likelihood(&self) -> f64 {
        -0.5 * (self.normalised_square() + (std::f64::consts::TAU * self.variance).ln())
    }
}

/// Mean and covariance of a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian<const N: usize> {
    /// Mean.
    pub mean: SVector<f64, N>,
    /// Covariance, symmetric.
    pub covariance: SMatrix<f64, N, N>,
}

/// Component `i` must be below N everywhere here.
impl<const N: usize> Gaussian<N> {
    /// Returns a belief with independent components of the given standard deviations.
    pub fn independent(mean: SVector<f64, N>, std: SVector<f64, N>) -> Self {
        let variances = std.component_mul(&std);
        Gaussian { mean, covariance: SMatrix::from_diagonal(&variances) }
    }

    /// Moves the belief to a mean computed by the caller, with the Jacobian of that move:
    /// P ← F P Fᵀ + Q.
    #[inline]
    pub fn predict(
        &mut self,
        mean: SVector<f64, N>,
        jacobian: &SMatrix<f64, N, N>,
        process_noise: &SMatrix<f64, N, N>,
    ) {
        self.mean = mean;
        self.covariance = moved(jacobian, &self.covariance, process_noise);
    }

    /// Makes component `i` a function of all: its value, its gradient by the state before, and the
    /// variance of the noise that comes in. The work grows with N², not N³.
    #[inline]
    pub fn rewrite(&mut self, i: usize, value: f64, gradient: &SVector<f64, N>, variance: f64) {
        let mixed = self.covariance * gradient;
        self.covariance.set_column(i, &mixed);
        self.covariance.set_row(i, &mixed.transpose());
        self.covariance[(i, i)] = gradient.dot(&mixed) + variance;
        self.mean[i] = value;
    }

    /// Component `i` keeps a share of itself, and noise of a variance comes in. The work grows with N.
    #[inline]
    pub fn fade(&mut self, i: usize, keep: f64, variance: f64) {
        let column = self.covariance.column(i) * keep;
        self.covariance.set_column(i, &column);
        self.covariance.set_row(i, &column.transpose());
        self.covariance[(i, i)] = keep * column[i] + variance;
        self.mean[i] *= keep;
    }

    /// Adds noise of a variance to component `i`.
    pub fn disturb(&mut self, i: usize, variance: f64) {
        self.covariance[(i, i)] += variance;
    }

    /// Forgets component `i`: a new value, independent of the others.
    pub fn replace(&mut self, i: usize, value: f64, variance: f64) {
        self.covariance.fill_column(i, 0.0);
        self.covariance.fill_row(i, 0.0);
        self.covariance[(i, i)] = variance;
        self.mean[i] = value;
    }

    /// Returns the innovation of a measurement of component `i`, without updating.
    ///
    /// # Errors
    ///
    /// When the belief or the measurement is not sound.
    #[inline]
    pub fn innovation(
        &self,
        i: usize,
        observed: f64,
        noise_variance: f64,
    ) -> Result<Innovation, NotPositiveDefinite> {
        Innovation::new(observed - self.mean[i], self.covariance[(i, i)], noise_variance)
    }

    /// Takes in an innovation of component `i`, and gives its gain; the covariance stays symmetric
    /// and positive.
    ///
    /// # Real-time
    ///
    /// Work in proportion to N², no allocation.
    #[inline]
    pub fn take(
        &mut self,
        i: usize,
        innovation: &Innovation,
        noise_variance: f64,
    ) -> SVector<f64, N> {
        let spread = self.covariance.column(i).into_owned();
        // The inverse is known last: terms that do not need it are computed before.
        self.mean += (spread * innovation.value) * innovation.inverse_variance;
        let mut row = SVector::zeros();
        row[i] = 1.0;
        measured(&mut self.covariance, &row, &spread, innovation.inverse_variance, noise_variance);
        spread * innovation.inverse_variance
    }

    /// Takes in a measurement of component `i`.
    ///
    /// # Errors
    ///
    /// When the belief or the measurement is not sound; nothing is then changed.
    ///
    /// # Real-time
    ///
    /// Work in proportion to N², no allocation.
    #[inline]
    pub fn measure(
        &mut self,
        i: usize,
        observed: f64,
        noise_variance: f64,
    ) -> Result<Innovation, NotPositiveDefinite> {
        let innovation = self.innovation(i, observed, noise_variance)?;
        self.take(i, &innovation, noise_variance);
        Ok(innovation)
    }

    /// Takes in a measurement of `row` · x.
    ///
    /// # Errors
    ///
    /// When the belief or the measurement is not sound; nothing is then changed.
    ///
    /// # Real-time
    ///
    /// Work in proportion to N², no allocation.
    #[inline(always)]
    pub fn measure_along(
        &mut self,
        row: &SVector<f64, N>,
        observed: f64,
        noise_variance: f64,
    ) -> Result<Innovation, NotPositiveDefinite> {
        let spread = self.covariance * row;
        let innovation =
            Innovation::new(observed - row.dot(&self.mean), row.dot(&spread), noise_variance)?;
        self.mean += spread * (innovation.inverse_variance * innovation.value);
        measured(&mut self.covariance, row, &spread, innovation.inverse_variance, noise_variance);
        Ok(innovation)
    }

    /// Returns the standard deviation of component `i`.
    pub fn std(&self, i: usize) -> f64 {
        self.covariance[(i, i)].max(0.0).sqrt()
    }

    /// Returns whether every number is finite and every variance positive; measuring keeps the rest of
    /// positive definiteness.
    pub fn is_sound(&self) -> bool {
        // One infinity or NaN makes the sum one.
        (self.mean.sum() + self.covariance.sum()).is_finite()
            && (0..N).all(|i| self.covariance[(i, i)] > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::SquareRootInformation;
    use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
    use rand::{RngExt, SeedableRng};

    /// Constant speed, position measured; against the batch least-squares solution.
    #[test]
    fn filtering_a_straight_line_equals_batch_least_squares() {
        let measured = [0.1, 1.2, 1.9, 3.2, 3.9, 5.1];
        let prior = Gaussian::independent(SVector::from([0.5, 0.8]), SVector::from([2.0, 1.0]));
        let (mut belief, mut along) = (prior, prior);
        let jacobian = Matrix2::new(1.0, 1.0, 0.0, 1.0);
        for (k, &value) in measured.iter().enumerate() {
            if k > 0 {
                belief.predict(jacobian * belief.mean, &jacobian, &SMatrix::zeros());
                along.predict(jacobian * along.mean, &jacobian, &SMatrix::zeros());
            }
            belief.measure(0, value, 0.04).unwrap();
            along.measure_along(&Vector2::new(1.0, 0.0), value, 0.04).unwrap();
        }
        let mut information = prior.covariance.try_inverse().unwrap();
        let mut weighted = information * prior.mean;
        for (k, &value) in measured.iter().enumerate() {
            let row = SVector::from([1.0, k as f64]);
            information += row * row.transpose() / 0.04;
            weighted += row * (value / 0.04);
        }
        let covariance = information.try_inverse().unwrap();
        let end = jacobian.pow(5);
        for belief in [belief, along] {
            assert!((belief.mean - end * covariance * weighted).norm() < 1e-12);
            assert!((belief.covariance - end * covariance * end.transpose()).norm() < 1e-12);
        }
    }

    /// x0 is the sum of two constants, each times random factors; each step of x0 is measured with noise.
    #[test]
    fn rewriting_without_process_noise_is_the_least_squares_of_all_observations() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut filter = Gaussian::independent(Vector3::zeros(), Vector3::new(2.0, 3.0, 1.0));
        let weights = Vector3::new(0.25, 1.0 / 9.0, 1.0);
        let mut batch = SquareRootInformation::<3>::new(&weights, &Vector3::zeros());
        let mut gathered = Vector3::new(1.0, 0.0, 0.0);
        for _ in 0..40 {
            let (p, q) = (random.random::<f64>(), random.random::<f64>());
            gathered += Vector3::new(0.0, p, q);
            let gradient = Vector3::new(1.0, p, q);
            filter.rewrite(0, gradient.dot(&filter.mean), &gradient, 0.0);
            let observed = gathered.dot(&Vector3::new(1.0, 0.7, -0.4)) + random.random::<f64>();
            filter.measure(0, observed, 0.5).unwrap();
            batch.update(&(gathered / 0.5_f64.sqrt()), observed / 0.5_f64.sqrt());
        }
        let estimate = batch.solve().unwrap();
        let covariance = batch.covariance().unwrap();
        assert!((filter.mean.fixed_rows::<2>(1) - estimate.fixed_rows::<2>(1)).norm() < 1e-9);
        assert!((filter.mean[0] - gathered.dot(&estimate)).abs() < 1e-9);
        let block = filter.covariance.fixed_view::<2, 2>(1, 1);
        assert!((block - covariance.fixed_view::<2, 2>(1, 1)).norm() < 1e-9);
    }

    #[test]
    fn fading_is_rewriting_by_a_share_of_itself() {
        let covariance = Matrix3::new(2.0, 0.5, 0.1, 0.5, 3.0, 0.2, 0.1, 0.2, 1.0);
        let mut faded = Gaussian { mean: Vector3::new(1.0, 2.0, 3.0), covariance };
        let mut rewritten = faded;
        faded.fade(1, 0.8, 0.3);
        rewritten.rewrite(1, 1.6, &Vector3::new(0.0, 0.8, 0.0), 0.3);
        assert!((faded.mean - rewritten.mean).norm() < 1e-15);
        assert!((faded.covariance - rewritten.covariance).norm() < 1e-15);
    }

    #[test]
    fn replacing_a_state_cuts_its_ties() {
        let covariance = Matrix3::new(2.0, 0.5, 0.1, 0.5, 3.0, 0.2, 0.1, 0.2, 1.0);
        let mut filter = Gaussian { mean: Vector3::new(1.0, 2.0, 3.0), covariance };
        filter.replace(1, 9.0, 7.0);
        assert_eq!(filter.mean[1], 9.0);
        assert_eq!(filter.covariance.column(1).into_owned(), Vector3::new(0.0, 7.0, 0.0));
        assert_eq!(filter.covariance[(0, 2)], 0.1);
        filter.disturb(1, 0.5);
        assert_eq!(filter.covariance[(1, 1)], 7.5);
    }

    #[test]
    fn an_unsound_belief_or_measurement_is_refused_and_changes_nothing() {
        let mut belief = Gaussian::independent(Vector2::zeros(), Vector2::new(0.0, 1.0));
        assert!(!belief.is_sound() && belief.measure(0, 1.0, 0.0).is_err());
        belief.covariance[(0, 0)] = 1.0;
        assert!(belief.is_sound());
        let before = belief;
        for (observed, noise_variance) in [(f64::NAN, 1.0), (1.0, -1.0), (1.0, f64::NAN)] {
            assert!(belief.measure(0, observed, noise_variance).is_err());
            assert!(belief.measure_along(&Vector2::x(), observed, noise_variance).is_err());
        }
        assert_eq!(belief, before);
        belief.covariance[(0, 0)] = -0.5;
        assert!(!belief.is_sound());
        assert_eq!(belief.measure(0, 1.0, 1.0), Err(NotPositiveDefinite));
    }

    #[test]
    fn ten_thousand_precise_measurements_leave_the_covariance_positive() {
        let mut belief =
            Gaussian::independent(SVector::from([0.0, 0.0]), SVector::from([1e4, 1e4]));
        let jacobian = Matrix2::new(1.0, 0.01, 0.0, 1.0);
        for _ in 0..10_000 {
            belief.predict(jacobian * belief.mean, &jacobian, &SMatrix::zeros());
            belief.measure(0, 0.0, 1e-12).unwrap();
            assert!(belief.covariance.cholesky().is_some());
        }
    }
}
