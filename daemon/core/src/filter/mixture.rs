//! What beliefs say together.

use nalgebra::{SMatrix, SVector};

use super::Gaussian;

/// Beliefs mixed by weight: their common mean, and a covariance that holds the spread between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixture<const N: usize> {
    /// Sum of the weights.
    pub weight: f64,
    /// Mean and covariance of all; zero while nothing has been mixed in.
    pub belief: Gaussian<N>,
}

impl<const N: usize> Default for Mixture<N> {
    fn default() -> Self {
        let belief = Gaussian { mean: SVector::zeros(), covariance: SMatrix::zeros() };
        Mixture { weight: 0.0, belief }
    }
}

impl<const N: usize> Mixture<N> {
    /// Mixes a belief in.
    ///
    /// # Real-time
    ///
    /// Work in proportion to N², no allocation.
    pub fn add(&mut self, weight: f64, mean: &SVector<f64, N>, covariance: &SMatrix<f64, N, N>) {
        self.weight += weight;
        if !(weight > 0.0) {
            return;
        }
        let share = weight / self.weight;
        let apart = mean - self.belief.mean;
        self.belief.mean += apart * share;
        self.belief.covariance *= 1.0 - share;
        self.belief.covariance +=
            covariance * share + apart * apart.transpose() * (share * (1.0 - share));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    #[test]
    fn a_mixture_has_the_moments_of_the_sum_of_densities() {
        let parts = [
            (0.5, Vector2::new(1.0, -2.0), Matrix2::new(1.0, 0.2, 0.2, 0.5)),
            (0.0, Vector2::new(9.0, 9.0), Matrix2::identity()),
            (1.5, Vector2::new(0.0, 3.0), Matrix2::new(2.0, -0.3, -0.3, 0.1)),
            (1.0, Vector2::new(-1.0, 0.5), Matrix2::identity()),
        ];
        let mut mixture = Mixture::default();
        parts.iter().for_each(|(weight, mean, own)| mixture.add(*weight, mean, own));
        let mean: Vector2<f64> = parts.iter().map(|(weight, mean, _)| mean * (weight / 3.0)).sum();
        let second: Matrix2<f64> =
            parts.iter().map(|(weight, m, own)| (own + m * m.transpose()) * (weight / 3.0)).sum();
        let covariance = second - mean * mean.transpose();
        assert_eq!(mixture.weight, 3.0);
        assert!((mixture.belief.mean - mean).norm() < 1e-14);
        assert!((mixture.belief.covariance - covariance).norm() < 1e-13);
    }
}
