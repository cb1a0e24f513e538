//! A bank of hypotheses: filters side by side, each under its own assumption, weighted by evidence.
//!
//! The caller decides which assumptions compete, when a new one joins and how one replaces another. The bank reports
//! the weight of each hypothesis, the likeliest one and their mixture (multiple models: Bar-Shalom, Li, Kirubarajan
//! 2001, section 11.6).

use arrayvec::ArrayVec;
use nalgebra::{SMatrix, SVector};

use super::Gaussian;

/// At most `MAX` hypotheses with the evidence for each, in the order in which they joined.
///
/// The caller moves and measures the hypotheses and updates their weights; then the bank settles: it finds the
/// likeliest and scales the weights to it. A weight is either the logarithm of a likelihood, which may have any size,
/// or odds, which are cheaper but only serve where the likelihoods are densities that cannot vanish.
#[derive(Clone, Debug, PartialEq)]
pub struct Bank<H, const MAX: usize> {
    hypotheses: ArrayVec<H, MAX>,
    /// Negative infinity at an index without a hypothesis.
    weights: [f64; MAX],
    likeliest: usize,
}

impl<H, const MAX: usize> Bank<H, MAX> {
    /// Returns hypotheses of equal weight: 0 as a logarithm, 1 as odds. The first is the likeliest until evidence
    /// comes.
    ///
    /// # Panics
    ///
    /// When there are more than `MAX`.
    pub fn even(hypotheses: impl IntoIterator<Item = H>, weight: f64) -> Self {
        let hypotheses: ArrayVec<_, MAX> = hypotheses.into_iter().collect();
        let mut weights = [f64::NEG_INFINITY; MAX];
        weights[..hypotheses.len()].fill(weight);
        Bank { hypotheses, weights, likeliest: 0 }
    }

    /// Returns the hypotheses.
    #[inline]
    pub fn hypotheses(&self) -> &[H] {
        &self.hypotheses
    }

    /// Returns the same, to be moved.
    #[inline]
    pub fn hypotheses_mut(&mut self) -> &mut [H] {
        &mut self.hypotheses
    }

    /// Returns the evidence for each.
    #[inline]
    pub fn weights(&self) -> &[f64] {
        &self.weights[..self.hypotheses.len()]
    }

    /// Returns the hypotheses and their evidence, to be measured and weighed.
    #[inline]
    pub fn weighed_mut(&mut self) -> impl Iterator<Item = (&mut H, &mut f64)> {
        self.hypotheses.iter_mut().zip(&mut self.weights)
    }

    /// Returns the hypothesis with the most evidence when the bank settled last.
    ///
    /// # Panics
    ///
    /// If the bank is empty.
    #[inline]
    pub fn likeliest(&self) -> &H {
        &self.hypotheses[self.likeliest]
    }

    /// Returns its place.
    #[inline]
    pub fn likeliest_index(&self) -> usize {
        self.likeliest
    }

    /// Takes a hypothesis for the likeliest until the bank settles, regardless of its weight.
    pub fn believe(&mut self, index: usize) {
        self.likeliest = index;
    }

    /// Finds the likeliest, gives it the logarithm 0 and the others theirs in proportion; among equals
    /// the likeliest stays. False when a weight is not a number.
    ///
    /// # Real-time
    ///
    /// Work in proportion to `MAX`, no allocation.
    #[inline]
    pub fn settle(&mut self) -> bool {
        self.find_likeliest();
        let greatest = self.weights[self.likeliest];
        self.weights.iter_mut().for_each(|weight| *weight -= greatest);
        !self.weights.iter().any(|weight| weight.is_nan())
    }

    /// The same for odds: the likeliest has 1, the others theirs in proportion.
    #[inline]
    pub fn settle_odds(&mut self) {
        self.find_likeliest();
        let greatest = self.weights[self.likeliest];
        self.weights.iter_mut().for_each(|weight| *weight /= greatest);
    }

    /// Returns the probability of each hypothesis that counts, by its logarithm; 0 of the others.
    #[inline]
    pub fn shares(&self, counts: impl Fn(&H) -> bool) -> [f64; MAX] {
        let mut shares = [0.0; MAX];
        let mut sum = 0.0;
        for (index, _) in self.hypotheses.iter().enumerate().filter(|(_, it)| counts(it)) {
            shares[index] = self.weights[index].exp();
            sum += shares[index];
        }
        if sum > 0.0 {
            shares.iter_mut().for_each(|share| *share /= sum);
        }
        shares
    }

    /// Lets a hypothesis join as the last.
    ///
    /// # Panics
    ///
    /// When the bank is full.
    pub fn join(&mut self, hypothesis: H, weight: f64) {
        self.weights[self.hypotheses.len()] = weight;
        self.hypotheses.push(hypothesis);
    }

    /// Puts one, with its weight, in the place of a hypothesis and of the next.
    ///
    /// # Panics
    ///
    /// If there is no next hypothesis.
    pub fn unite(&mut self, index: usize, (both, weight): (H, f64)) {
        self.drop(index + 1);
        self.hypotheses[index] = both;
        self.weights[index] = weight;
        self.find_likeliest();
    }

    /// Drops every hypothesis whose weight is not above a bound, or not a number.
    #[inline]
    pub fn drop_up_to(&mut self, bound: f64) {
        for index in (0..self.hypotheses.len()).rev() {
            if !(self.weights[index] > bound) {
                self.drop(index);
            }
        }
    }

    fn drop(&mut self, index: usize) {
        self.hypotheses.remove(index);
        self.weights.copy_within(index + 1.., index);
        self.weights[MAX - 1] = f64::NEG_INFINITY;
        self.find_likeliest();
    }

    fn find_likeliest(&mut self) {
        let greatest = self.weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if self.weights[self.likeliest] != greatest {
            let place = self.weights.iter().position(|&weight| weight == greatest);
            self.likeliest = place.unwrap_or(self.likeliest);
        }
    }
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
    use super::*;

    #[test]
    fn shares_follow_logarithms_of_any_size() {
        let mut bank = Bank::<_, 3>::even(["a", "b", "none"], 0.0);
        bank.weights = [-1e4, -1e4 + 2.0_f64.ln(), f64::NEG_INFINITY];
        assert!(bank.settle());
        assert_eq!((*bank.likeliest(), bank.weights()[1]), ("b", 0.0));
        let shares = bank.shares(|_| true);
        assert!((shares[1] - 2.0 / 3.0).abs() < 1e-11 && shares[2] == 0.0);
        assert_eq!(bank.shares(|name| *name != "b"), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn the_likeliest_stays_among_equals() {
        let mut bank = Bank::<_, 3>::even([0, 1, 2], 1.0);
        bank.believe(2);
        bank.weights[0] = 0.3;
        bank.settle_odds();
        assert_eq!(*bank.likeliest(), 2);
        bank.weights[2] = 0.5;
        bank.settle_odds();
        assert_eq!(*bank.likeliest(), 1);
    }

    #[test]
    fn a_weight_that_is_no_number_is_reported() {
        let mut bank = Bank::<_, 2>::even([0, 1], 0.0);
        bank.weights[1] = f64::NAN;
        assert!(!bank.settle());
    }

    #[test]
    fn hypotheses_join_unite_and_go() {
        let mut bank = Bank::<_, 3>::even([10], 1.0);
        bank.join(20, 3.0);
        bank.join(30, 2.0);
        bank.settle_odds();
        assert_eq!(*bank.likeliest(), 20);
        bank.unite(0, (15, 0.1));
        assert_eq!((bank.hypotheses(), *bank.likeliest()), ([15, 30].as_slice(), 30));
        bank.drop_up_to(0.2);
        assert_eq!((bank.hypotheses(), bank.weights().len()), ([30].as_slice(), 1));
        bank.weights[0] = f64::NAN;
        bank.drop_up_to(0.0);
        assert!(bank.hypotheses().is_empty());
    }
}

#[cfg(test)]
mod mixture_tests {
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
