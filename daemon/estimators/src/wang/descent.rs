//! Gradient descent on a mean of squares.

use nalgebra::{SMatrix, SVector};

/// The mean square of `target - features · coefficients` over all samples so far.
///
/// Only the sums that it depends on are stored, so that a step along the gradient over every sample costs the same
/// after ten samples and after 28,000.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanSquare<const N: usize> {
    gram: SMatrix<f64, N, N>,
    moment: SVector<f64, N>,
    squares: f64,
    /// Number of samples.
    pub count: f64,
}

impl<const N: usize> Default for MeanSquare<N> {
    fn default() -> Self {
        MeanSquare { gram: SMatrix::zeros(), moment: SVector::zeros(), squares: 0.0, count: 0.0 }
    }
}

impl<const N: usize> MeanSquare<N> {
    /// Takes one sample in.
    pub fn add(&mut self, features: &SVector<f64, N>, target: f64) {
        self.gram += features * features.transpose();
        self.moment += features * target;
        self.squares += target * target;
        self.count += 1.0;
    }

    /// Returns the mean square at some coefficients; 0 without samples.
    pub fn loss(&self, coefficients: &SVector<f64, N>) -> f64 {
        let sum = self.squares - 2.0 * coefficients.dot(&self.moment)
            + coefficients.dot(&(self.gram * coefficients));
        sum / self.count.max(1.0)
    }

    /// Returns its gradient (Wang 2022 trains on eq. 27 with it); 0 without samples.
    pub fn gradient(&self, coefficients: &SVector<f64, N>) -> SVector<f64, N> {
        (self.gram * coefficients - self.moment) * (2.0 / self.count.max(1.0))
    }

    /// A step down the gradient in all coefficients from the place `first` on; the others are
    /// known. The rate is relative to the inverse trace of the second derivative, and the
    /// descent converges for any rate from 0 to 2.
    pub fn step(&self, coefficients: &mut SVector<f64, N>, first: usize, rate: f64) {
        let trace: f64 = (first..N).map(|i| self.gram[(i, i)]).sum();
        let curvature = 2.0 * trace / self.count.max(1.0);
        if curvature > 0.0 {
            let gradient = self.gradient(coefficients);
            for i in first..N {
                coefficients[i] -= rate / curvature * gradient[i];
            }
        }
    }

    /// Returns the covariance of the minimum by the textbook formula, which takes residuals for white.
    ///
    /// `None` while the samples do not determine the coefficients.
    pub fn covariance(&self, coefficients: &SVector<f64, N>) -> Option<SMatrix<f64, N, N>> {
        let freedom = self.count - N as f64;
        if freedom <= 0.0 {
            return None;
        }
        let variance = self.loss(coefficients).max(0.0) * self.count / freedom;
        Some(self.gram.cholesky()?.inverse() * variance)
    }
}

impl MeanSquare<1> {
    /// Returns the share of the target's squares that the one feature explains at best, from 0 to 1.
    pub fn explained_share(&self) -> f64 {
        let product = self.gram[(0, 0)] * self.squares;
        if product > 0.0 { (self.moment[0].powi(2) / product).min(1.0) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};

    fn sample_sums() -> MeanSquare<3> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let mut sums = MeanSquare::default();
        for _ in 0..200 {
            let x: f64 = random.random();
            let noise = random.random::<f64>() - 0.5;
            sums.add(&Vector3::new(1.0, x, x * x), 2.0 - x + 3.0 * x * x + noise);
        }
        sums
    }

    #[test]
    fn the_explained_share_is_the_ratio_of_the_two_regressions() {
        let (mut forward, mut reverse) = (MeanSquare::<1>::default(), MeanSquare::<1>::default());
        for (x, y) in [(1.0, 2.1), (2.0, 3.9), (-1.0, -2.4), (0.5, 0.7)] {
            forward.add(&SVector::from([x]), y);
            reverse.add(&SVector::from([y]), x);
        }
        let slopes =
            forward.moment[0] / forward.gram[(0, 0)] * reverse.moment[0] / reverse.gram[(0, 0)];
        assert!((forward.explained_share() - slopes).abs() < 1e-12 && slopes < 1.0);
        assert_eq!(MeanSquare::<1>::default().explained_share(), 0.0);
    }

    #[test]
    fn the_gradient_equals_finite_differences_of_the_loss() {
        let (sums, at, step) = (sample_sums(), Vector3::new(0.3, -0.7, 1.9), 1e-4);
        let gradient = sums.gradient(&at);
        for i in 0..3 {
            let (mut above, mut below) = (at, at);
            above[i] += step;
            below[i] -= step;
            let slope = (sums.loss(&above) - sums.loss(&below)) / (2.0 * step);
            assert!((slope - gradient[i]).abs() < 1e-8, "{slope} and {}", gradient[i]);
        }
    }

    #[test]
    fn the_descent_ends_at_the_least_squares_solution() {
        let sums = sample_sums();
        let exact = sums.gram.cholesky().unwrap().solve(&sums.moment);
        let mut coefficients = Vector3::zeros();
        for _ in 0..20_000 {
            sums.step(&mut coefficients, 0, 1.0);
        }
        assert!((coefficients - exact).norm() < 1e-6);
        assert!(sums.gradient(&coefficients).norm() < 1e-6);
    }

    #[test]
    fn a_stage_leaves_the_coefficients_of_the_stage_before_alone() {
        let sums = sample_sums();
        let mut coefficients = Vector3::new(1.7, 0.0, 0.0);
        for _ in 0..20_000 {
            sums.step(&mut coefficients, 1, 1.0);
        }
        assert_eq!(coefficients[0], 1.7);
        let gradient = sums.gradient(&coefficients);
        assert!(gradient[1].abs() < 1e-9 && gradient[2].abs() < 1e-9);
    }

    #[test]
    fn without_samples_nothing_moves_and_nothing_is_claimed() {
        let sums = MeanSquare::<3>::default();
        let mut coefficients = Vector3::new(1.0, 2.0, 3.0);
        sums.step(&mut coefficients, 0, 1.0);
        assert_eq!(coefficients, Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(sums.covariance(&coefficients), None);
        assert_eq!(sums.loss(&coefficients), 0.0);
    }
}
