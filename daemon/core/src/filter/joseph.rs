//! A small Kalman filter with scalar measurements of single states.

use nalgebra::{SMatrix, SVector};

use super::rank_one::{measured, moved};

/// State and covariance of N unknowns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JosephFilter<const N: usize> {
    /// The state.
    pub state: SVector<f64, N>,
    /// Its covariance.
    pub covariance: SMatrix<f64, N, N>,
}

/// What a measurement told of itself when it was taken in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalarInnovation {
    /// Measured minus predicted, in the measurement's unit.
    pub value: f64,
    /// Its predicted variance.
    pub variance: f64,
}

impl<const N: usize> JosephFilter<N> {
    /// Independent prior knowledge.
    pub fn new(state: SVector<f64, N>, std: SVector<f64, N>) -> Self {
        let variances = std.component_mul(&std);
        JosephFilter { state, covariance: SMatrix::from_diagonal(&variances) }
    }

    /// Moves on to a predicted state: P ← F P Fᵀ + Q with diagonal Q.
    pub fn predict(
        &mut self,
        state: SVector<f64, N>,
        transition: &SMatrix<f64, N, N>,
        noise_variances: &SVector<f64, N>,
    ) {
        self.state = state;
        let noise = SMatrix::from_diagonal(noise_variances);
        self.covariance = moved(transition, &self.covariance, &noise);
    }

    /// Makes one state independent of the others, with a new mean and variance.
    pub fn replace(&mut self, index: usize, mean: f64, variance: f64) {
        self.state[index] = mean;
        self.covariance.row_mut(index).fill(0.0);
        self.covariance.column_mut(index).fill(0.0);
        self.covariance[(index, index)] = variance;
    }

    /// The innovation that a measurement of one state would have.
    pub fn innovation(&self, index: usize, value: f64, noise_variance: f64) -> ScalarInnovation {
        ScalarInnovation {
            value: value - self.state[index],
            variance: self.covariance[(index, index)] + noise_variance,
        }
    }

    /// Takes in a measurement of one state.
    ///
    /// The covariance stays symmetric and positive: where subtraction would cost digits, it is
    /// P ← (I - K H) P (I - K H)ᵀ + K R Kᵀ.
    ///
    /// # Real-time
    ///
    /// No allocation.
    pub fn measure(&mut self, index: usize, value: f64, noise_variance: f64) -> ScalarInnovation {
        let innovation = self.innovation(index, value, noise_variance);
        let spread = self.covariance.column(index).into_owned();
        let inverse_variance = 1.0 / innovation.variance;
        self.state += spread * (inverse_variance * innovation.value);
        let mut row = SVector::<f64, N>::zeros();
        row[index] = 1.0;
        measured(&mut self.covariance, &row, &spread, inverse_variance, noise_variance);
        innovation
    }

    /// True while every number is finite and every variance positive; [`JosephFilter::measure`]
    /// keeps the rest of positive definiteness.
    pub fn is_sound(&self) -> bool {
        // One infinity or NaN makes the sum one.
        (self.state.sum() + self.covariance.sum()).is_finite()
            && (0..N).all(|i| self.covariance[(i, i)] > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};
    use rand::{RngExt, SeedableRng};

    #[test]
    fn the_filter_equals_its_batch_least_squares_twin() {
        // Position and slope, the position measured: a straight line through noisy points.
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let points: Vec<f64> = (0..50).map(|k| 0.3 * k as f64 + random.random::<f64>()).collect();
        let noise_variance: f64 = 0.25;
        let prior_std = Vector2::new(10.0, 4.0);
        let mut filter = JosephFilter::new(Vector2::zeros(), prior_std);
        let transition = Matrix2::new(1.0, 1.0, 0.0, 1.0);
        for (k, &point) in points.iter().enumerate() {
            if k > 0 {
                filter.predict(transition * filter.state, &transition, &Vector2::zeros());
            }
            filter.measure(0, point, noise_variance);
        }
        let mut normal = Matrix2::from_diagonal(&prior_std.map(|std| 1.0 / (std * std)));
        let mut moment = Vector2::zeros();
        for (k, &point) in points.iter().enumerate() {
            let row = Vector2::new(1.0, k as f64);
            normal += row * row.transpose() / noise_variance;
            moment += row * point / noise_variance;
        }
        let covariance = normal.try_inverse().unwrap();
        let first = covariance * moment;
        let to_end = Matrix2::new(1.0, (points.len() - 1) as f64, 0.0, 1.0);
        assert!((filter.state - to_end * first).norm() < 1e-9);
        assert!((filter.covariance - to_end * covariance * to_end.transpose()).norm() < 1e-10);
    }

    #[test]
    fn a_replaced_state_keeps_no_correlation() {
        let mut filter = JosephFilter::new(Vector2::zeros(), Vector2::new(1.0, 1.0));
        let transition = Matrix2::new(1.0, 1.0, 0.0, 1.0);
        filter.predict(transition * filter.state, &transition, &Vector2::zeros());
        filter.replace(0, 7.0, 2.0);
        assert_eq!(filter.covariance, Matrix2::new(2.0, 0.0, 0.0, 1.0));
        filter.measure(0, 9.0, 1.0);
        assert_eq!(filter.state[1], 0.0);
    }

    #[test]
    fn a_broken_covariance_is_noticed() {
        let mut filter = JosephFilter::new(Vector2::zeros(), Vector2::new(1.0, 1.0));
        assert!(filter.is_sound());
        filter.covariance[(1, 1)] = -1.0;
        assert!(!filter.is_sound());
        filter.covariance[(1, 1)] = f64::NAN;
        assert!(!filter.is_sound());
    }
}
