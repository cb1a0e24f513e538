//! Hypotheses side by side: what each weighs, and what they say together.
//!
//! A hypothesis is a filter under one assumption that holds throughout, or from a moment on (multiple
//! models: Bar-Shalom, Li, Kirubarajan 2001, section 11.6).

use nalgebra::{SMatrix, SVector};

use super::Gaussian;

/// Place of the greatest weight; `current` stays unless another is greater.
pub fn likeliest(current: usize, weights: impl IntoIterator<Item = f64>) -> usize {
    let mut best = (current, f64::NEG_INFINITY);
    for (place, weight) in weights.into_iter().enumerate() {
        if weight > best.1 || (weight == best.1 && place == current) {
            best = (place, weight);
        }
    }
    best.0
}

/// Turns logarithms of weights into shares of their sum; false when there is none.
pub fn to_shares(weights: &mut [f64]) -> bool {
    let greatest = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut sum = 0.0;
    for weight in &mut *weights {
        *weight = (*weight - greatest).exp();
        sum += *weight;
    }
    weights.iter_mut().for_each(|weight| *weight /= sum);
    sum.is_finite() && sum > 0.0
}

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

    #[test]
    fn shares_follow_logarithms_of_any_size_and_the_likeliest_stays_among_equals() {
        let mut weights = [-1e4, -1e4 + 2.0_f64.ln(), f64::NEG_INFINITY];
        assert!(to_shares(&mut weights));
        assert!((weights[1] - 2.0 / 3.0).abs() < 1e-11 && weights[2] == 0.0);
        assert_eq!(likeliest(2, [1.0, 3.0, 3.0]), 2);
        assert_eq!(likeliest(0, [1.0, 3.0, 3.0]), 1);
        assert!(!to_shares(&mut [f64::NAN, 0.0]));
    }
}
