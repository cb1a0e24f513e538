//! A bank of hypotheses: filters side by side, each under an assumption of its own, weighed by evidence.
//!
//! Which assumptions compete, when a new one joins and how they give way to each other is the affair
//! of whoever keeps the bank; what each weighs, which is the likeliest and what they say together is reported
//! here (multiple models: Bar-Shalom, Li, Kirubarajan 2001, section 11.6).

use std::marker::PhantomData;

use arrayvec::ArrayVec;

/// How evidence is counted.
pub trait Evidence {
    /// Weight of the likeliest, once a bank has settled.
    const LIKELIEST: f64;
    /// Weight of what cannot be.
    const NONE: f64;
    /// A weight against the greatest one.
    fn against(weight: f64, greatest: f64) -> f64;
    /// The probability that a weight stands for, up to a factor that all share.
    fn probability(weight: f64) -> f64;
}

/// Likelihoods that multiply: the cheapest where they come as densities that cannot vanish.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odds;

impl Evidence for Odds {
    const LIKELIEST: f64 = 1.0;
    const NONE: f64 = 0.0;

    #[inline(always)]
    fn against(weight: f64, greatest: f64) -> f64 {
        weight / greatest
    }

    #[inline(always)]
    fn probability(weight: f64) -> f64 {
        weight
    }
}

/// Logarithms of likelihoods, which add up, of any size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nats;

impl Evidence for Nats {
    const LIKELIEST: f64 = 0.0;
    const NONE: f64 = f64::NEG_INFINITY;

    #[inline(always)]
    fn against(weight: f64, greatest: f64) -> f64 {
        weight - greatest
    }

    #[inline(always)]
    fn probability(weight: f64) -> f64 {
        weight.exp()
    }
}

/// At most `MAX` hypotheses with the evidence for each, in the order in which they joined.
///
/// Whoever moves and measures the hypotheses adds to their weights, and lets the bank settle.
#[derive(Clone, Debug, PartialEq)]
pub struct Bank<H, E, const MAX: usize> {
    hypotheses: ArrayVec<H, MAX>,
    /// Of places without a hypothesis, [`Evidence::NONE`].
    weights: [f64; MAX],
    likeliest: usize,
    evidence: PhantomData<E>,
}

impl<H, E: Evidence, const MAX: usize> Bank<H, E, MAX> {
    /// Hypotheses of equal weight, the first believed until evidence comes.
    ///
    /// # Panics
    ///
    /// When there are more than `MAX`.
    pub fn even(hypotheses: impl IntoIterator<Item = H>) -> Self {
        let hypotheses: ArrayVec<_, MAX> = hypotheses.into_iter().collect();
        let mut weights = [E::NONE; MAX];
        weights[..hypotheses.len()].fill(E::LIKELIEST);
        Bank { hypotheses, weights, likeliest: 0, evidence: PhantomData }
    }

    /// The hypotheses.
    #[inline]
    pub fn hypotheses(&self) -> &[H] {
        &self.hypotheses
    }

    /// The same, to be moved.
    #[inline]
    pub fn hypotheses_mut(&mut self) -> &mut [H] {
        &mut self.hypotheses
    }

    /// The evidence for each.
    #[inline]
    pub fn weights(&self) -> &[f64] {
        &self.weights[..self.hypotheses.len()]
    }

    /// The hypotheses and their evidence, to be measured and weighed.
    #[inline]
    pub fn weighed_mut(&mut self) -> impl Iterator<Item = (&mut H, &mut f64)> {
        self.hypotheses.iter_mut().zip(&mut self.weights)
    }

    /// The hypothesis with the most evidence when the bank settled last.
    ///
    /// # Panics
    ///
    /// When there is none.
    #[inline]
    pub fn likeliest(&self) -> &H {
        &self.hypotheses[self.likeliest]
    }

    /// Its place.
    #[inline]
    pub fn likeliest_index(&self) -> usize {
        self.likeliest
    }

    /// Takes a hypothesis for the likeliest until the bank settles, whatever its weight.
    pub fn believe(&mut self, index: usize) {
        self.likeliest = index;
    }

    /// Finds the likeliest, gives it the weight [`Evidence::LIKELIEST`] and the others theirs in
    /// proportion; among equals the likeliest stays. False when a weight is not a number.
    ///
    /// # Real-time
    ///
    /// Work in proportion to `MAX`, no allocation.
    #[inline]
    pub fn settle(&mut self) -> bool {
        self.find_likeliest();
        let greatest = self.weights[self.likeliest];
        self.weights.iter_mut().for_each(|weight| *weight = E::against(*weight, greatest));
        !self.weights.iter().any(|weight| weight.is_nan())
    }

    /// Probability of each hypothesis that counts; 0 of the others.
    #[inline]
    pub fn shares(&self, counts: impl Fn(&H) -> bool) -> [f64; MAX] {
        let mut shares = [0.0; MAX];
        let mut sum = 0.0;
        for (index, _) in self.hypotheses.iter().enumerate().filter(|(_, it)| counts(it)) {
            shares[index] = E::probability(self.weights[index]);
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
    /// When there is none next.
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
        self.weights[MAX - 1] = E::NONE;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_follow_logarithms_of_any_size() {
        let mut bank = Bank::<_, Nats, 3>::even(["a", "b", "none"]);
        bank.weights = [-1e4, -1e4 + 2.0_f64.ln(), f64::NEG_INFINITY];
        assert!(bank.settle());
        assert_eq!((*bank.likeliest(), bank.weights()[1]), ("b", 0.0));
        let shares = bank.shares(|_| true);
        assert!((shares[1] - 2.0 / 3.0).abs() < 1e-11 && shares[2] == 0.0);
        assert_eq!(bank.shares(|name| *name != "b"), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn the_likeliest_stays_among_equals() {
        let mut bank = Bank::<_, Odds, 3>::even([0, 1, 2]);
        bank.believe(2);
        bank.weights[0] = 0.3;
        assert!(bank.settle());
        assert_eq!(*bank.likeliest(), 2);
        bank.weights[2] = 0.5;
        assert!(bank.settle());
        assert_eq!(*bank.likeliest(), 1);
    }

    #[test]
    fn a_weight_that_is_no_number_is_reported() {
        let mut bank = Bank::<_, Nats, 2>::even([0, 1]);
        bank.weights[1] = f64::NAN;
        assert!(!bank.settle());
        let mut nothing = Bank::<_, Odds, 2>::even([0]);
        nothing.weights[0] = 0.0;
        assert!(!nothing.settle());
    }

    #[test]
    fn hypotheses_join_unite_and_go() {
        let mut bank = Bank::<_, Odds, 3>::even([10]);
        bank.join(20, 3.0);
        bank.join(30, 2.0);
        assert!(bank.settle());
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
