//! A bank of hypotheses: filters side by side, each under an assumption of its own, weighed by evidence.
//!
//! Which assumptions compete, when a new one joins and how they give way to each other is the affair
//! of whoever keeps the bank; what each weighs, which is the likeliest and what they say together is told
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

/// Hypotheses with the evidence for each: an array of them where the assumptions stay the same, an
/// [`ArrayVec`] where they come and go.
///
/// Whoever moves and measures the hypotheses adds to their weights, and lets the bank settle.
#[derive(Clone, Debug, PartialEq)]
pub struct Bank<S, E, const MAX: usize> {
    hypotheses: S,
    /// Of places without a hypothesis, [`Evidence::NONE`].
    weights: [f64; MAX],
    likeliest: usize,
    evidence: PhantomData<E>,
}

impl<S, E: Evidence, const MAX: usize> Bank<S, E, MAX> {
    /// The hypotheses, in the order in which they joined.
    #[inline]
    pub fn hypotheses(&self) -> &S {
        &self.hypotheses
    }

    /// The same, to be moved.
    #[inline]
    pub fn hypotheses_mut(&mut self) -> &mut S {
        &mut self.hypotheses
    }

    /// The hypotheses and, place by place, their evidence, to be measured and weighed.
    #[inline]
    pub fn weighed_mut(&mut self) -> (&mut S, &mut [f64; MAX]) {
        (&mut self.hypotheses, &mut self.weights)
    }

    /// The evidence for each place.
    #[inline]
    pub fn weights(&self) -> &[f64; MAX] {
        &self.weights
    }

    /// Place of the hypothesis with the most evidence when the bank settled last.
    #[inline]
    pub fn likeliest_place(&self) -> usize {
        self.likeliest
    }

    /// Takes a hypothesis for the likeliest until the bank settles, whatever its weight.
    pub fn believe(&mut self, place: usize) {
        self.likeliest = place;
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

    /// Raises every weight to a least one: a hypothesis that weighs so much can come back.
    #[inline]
    pub fn raise_to(&mut self, least: f64) {
        self.weights.iter_mut().for_each(|weight| *weight = weight.max(least));
    }

    /// Probability of the hypothesis at each of the places that count; 0 at the others.
    #[inline]
    pub fn shares(&self, counts: impl Fn(usize) -> bool) -> [f64; MAX] {
        let share = |place| if counts(place) { E::probability(self.weights[place]) } else { 0.0 };
        let mut shares: [f64; MAX] = std::array::from_fn(share);
        let sum: f64 = shares.iter().sum();
        if sum > 0.0 {
            shares.iter_mut().for_each(|share| *share /= sum);
        }
        shares
    }

    fn find_likeliest(&mut self) {
        let greatest = self.weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if self.weights[self.likeliest] != greatest {
            let place = self.weights.iter().position(|&weight| weight == greatest);
            self.likeliest = place.unwrap_or(self.likeliest);
        }
    }
}

impl<H, E: Evidence, const MAX: usize> Bank<[H; MAX], E, MAX> {
    /// Hypotheses of equal weight, the first believed until evidence comes.
    pub fn even(hypotheses: [H; MAX]) -> Self {
        let weights = [E::LIKELIEST; MAX];
        Bank { hypotheses, weights, likeliest: 0, evidence: PhantomData }
    }

    /// The hypothesis at [`Bank::likeliest_place`].
    #[inline]
    pub fn likeliest(&self) -> &H {
        &self.hypotheses[self.likeliest]
    }
}

impl<H, E: Evidence, const MAX: usize> Bank<ArrayVec<H, MAX>, E, MAX> {
    /// A bank that begins with one hypothesis.
    pub fn of_one(hypothesis: H) -> Self {
        let mut weights = [E::NONE; MAX];
        weights[0] = E::LIKELIEST;
        let hypotheses = std::iter::once(hypothesis).collect();
        Bank { hypotheses, weights, likeliest: 0, evidence: PhantomData }
    }

    /// The hypothesis at [`Bank::likeliest_place`].
    ///
    /// # Panics
    ///
    /// When every one has been dropped.
    #[inline]
    pub fn likeliest(&self) -> &H {
        &self.hypotheses[self.likeliest]
    }

    /// Lets a hypothesis join as the last; a full bank refuses it.
    pub fn join(&mut self, hypothesis: H, weight: f64) -> bool {
        let place = self.hypotheses.len();
        let is_joined = self.hypotheses.try_push(hypothesis).is_ok();
        if is_joined {
            self.weights[place] = weight;
        }
        is_joined
    }

    /// Puts one, with its weight, in the place of a hypothesis and of the next.
    ///
    /// # Panics
    ///
    /// When there is none next.
    pub fn unite(&mut self, place: usize, (both, weight): (H, f64)) {
        self.drop(place + 1);
        self.hypotheses[place] = both;
        self.weights[place] = weight;
        self.find_likeliest();
    }

    /// Drops every hypothesis whose weight is not above a bound, or not a number.
    #[inline]
    pub fn drop_up_to(&mut self, bound: f64) {
        for place in (0..self.hypotheses.len()).rev() {
            if !(self.weights[place] > bound) {
                self.drop(place);
            }
        }
    }

    fn drop(&mut self, place: usize) {
        self.hypotheses.remove(place);
        self.weights.copy_within(place + 1.., place);
        self.weights[MAX - 1] = E::NONE;
        self.find_likeliest();
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
        assert_eq!(bank.shares(|place| place != 1), [1.0, 0.0, 0.0]);
        bank.raise_to(-30.0);
        assert_eq!(bank.weights()[2], -30.0);
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
    fn a_weight_that_is_no_number_is_told() {
        let mut bank = Bank::<_, Nats, 2>::even([0, 1]);
        bank.weights[1] = f64::NAN;
        assert!(!bank.settle());
        let mut nothing = Bank::<_, Odds, 2>::of_one(0);
        nothing.weights[0] = 0.0;
        assert!(!nothing.settle());
    }

    #[test]
    fn hypotheses_join_unite_and_go() {
        let mut bank = Bank::<_, Odds, 3>::of_one(10);
        assert!(bank.join(20, 3.0) && bank.join(30, 2.0) && !bank.join(40, 9.0));
        assert!(bank.settle());
        assert_eq!(*bank.likeliest(), 20);
        bank.unite(0, (15, 0.1));
        assert_eq!((bank.hypotheses()[..].to_vec(), *bank.likeliest()), (vec![15, 30], 30));
        bank.drop_up_to(0.2);
        assert_eq!((bank.hypotheses()[..].to_vec(), bank.weights()[1]), (vec![30], 0.0));
        bank.weights[0] = f64::NAN;
        bank.drop_up_to(0.0);
        assert!(bank.hypotheses().is_empty());
    }
}
