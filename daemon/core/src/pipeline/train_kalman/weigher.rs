//! The error of a load cell or of another weigher: in part the same at every weighing, in part another one each time.
//!
//! A load cell that always shows 3 % too much is no new evidence at each stop. Its own error is kept outside the filter, as
//! a function of the load and of the traction's scale: no sample between two weighings changes that function, so that it
//! costs work at weighings alone.

use nalgebra::{Matrix2, Vector2};

use super::motion_filter::{LOAD, MotionState, STATES, TRACTION_SCALE};
use crate::filter::Gaussian;

/// Change by a sample of the load factor's estimate: the declared mass over the true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadChange {
    /// The load factor starts anew, as well known as the declaration allows: a mean and a variance.
    Anew(f64, f64),
    /// The load was weighed.
    Weighed,
    /// The weigher shows the load of before times this factor, by its noise: no load changes under way.
    ShownAs(f64),
    /// The load may have changed by this variance as a share of its square, at most to the uncertainty of any load of
    /// this mean and variance.
    Opened { by: f64, mean: f64, variance: f64 },
}

/// Variance of the weigher's own error, which is the same at every weighing, as a share of that of a weighing.
const OWN_SHARE: f64 = 0.5;
/// Number of weighings that the stated variance counts for, and the most that count.
const WEIGHT_FIRST: f64 = 8.0;
const WEIGHT_MAX: f64 = 100.0;
/// A load that was driven tells of its weighing where this share of the weighing's variance is left, or less.
const SEEN_SHARE: f64 = 0.5;
/// Share of the weigher's own error that is left after a stop.
const KEPT: f64 = 0.99;

/// Variance of a load or scale that is taken for known.
const VARIANCE_LEAST: f64 = 1e-16;

/// The weigher's own error as a share of the mass: normally distributed about a linear function of the load factor and of
/// the traction's scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weigher {
    constant: f64,
    slopes: Vector2<f64>,
    variance: f64,
    /// Variance of the error that is another one at each weighing, as stated and seen, and the number of weighings that it
    /// rests on.
    each_variance: f64,
    weight: f64,
    /// Whether the load is still the one that was weighed.
    holds_weighed: bool,
}

/// Moments of the weigher's own error, and its covariance with the states.
struct Moments {
    mean: f64,
    variance: f64,
    with: MotionState,
}

impl Weigher {
    /// Before any weighing of a variance.
    pub fn new(weighing_variance: f64) -> Self {
        Weigher {
            constant: 0.0,
            slopes: Vector2::zeros(),
            variance: OWN_SHARE * weighing_variance,
            each_variance: weighing_variance,
            weight: WEIGHT_FIRST,
            holds_weighed: false,
        }
    }

    fn moments(&self, belief: &Gaussian<STATES>) -> Moments {
        let [by_load, by_scale] = [self.slopes[0], self.slopes[1]];
        let covariance = &belief.covariance;
        let with = covariance.column(LOAD) * by_load + covariance.column(TRACTION_SCALE) * by_scale;
        Moments {
            mean: self.constant
                + by_load * belief.mean[LOAD]
                + by_scale * belief.mean[TRACTION_SCALE],
            variance: self.variance + by_load * with[LOAD] + by_scale * with[TRACTION_SCALE],
            with,
        }
    }

    /// The error of these moments, by the load and the scale as they are believed now.
    fn given(self, moments: &Moments, belief: &Gaussian<STATES>) -> Self {
        let covariance = &belief.covariance;
        let both = Matrix2::from_fn(|i, j| {
            covariance[([LOAD, TRACTION_SCALE][i], [LOAD, TRACTION_SCALE][j])]
        });
        let with = Vector2::new(moments.with[LOAD], moments.with[TRACTION_SCALE]);
        // A load or a scale that is known exactly tells nothing of the weigher.
        let least = Matrix2::from_diagonal_element(VARIANCE_LEAST);
        let slopes = (both + least).cholesky().map_or(Vector2::zeros(), |it| it.solve(&with));
        let now = Vector2::new(belief.mean[LOAD], belief.mean[TRACTION_SCALE]);
        Weigher {
            constant: moments.mean - slopes.dot(&now),
            slopes,
            variance: (moments.variance - slopes.dot(&with)).max(0.0),
            ..self
        }
    }

    /// Adds a variance to the load factor.
    pub fn disturb(&mut self, belief: &mut Gaussian<STATES>, variance: f64) {
        let moments = self.moments(belief);
        self.learn(&moments, belief);
        belief.disturb(LOAD, variance);
        *self = self.given(&moments, belief);
    }

    /// Forgets the load: another mean and variance, of which the weigher knows nothing.
    pub fn forget_load(&mut self, belief: &mut Gaussian<STATES>, load: f64, variance: f64) {
        let mut moments = self.moments(belief);
        self.learn(&moments, belief);
        belief.replace(LOAD, load, variance);
        moments.with[LOAD] = 0.0;
        *self = self.given(&moments, belief);
    }

    /// Takes a weighing in: the load factor starts anew, but for the weigher's own error.
    pub fn weigh(&mut self, belief: &mut Gaussian<STATES>) {
        let mut moments = self.moments(belief);
        self.learn(&moments, belief);
        belief.replace(LOAD, 1.0 + moments.mean, moments.variance + self.each_variance);
        for i in (0..STATES).filter(|&i| i != LOAD) {
            belief.covariance[(LOAD, i)] = moments.with[i];
            belief.covariance[(i, LOAD)] = moments.with[i];
        }
        moments.with[LOAD] = moments.variance;
        *self = Weigher { holds_weighed: true, ..self.given(&moments, belief) };
    }

    /// Learns from the load as it was driven how far its weighing was off beyond the weigher's own error; once for each
    /// weighing, before the load changes.
    fn learn(&mut self, moments: &Moments, belief: &Gaussian<STATES>) {
        if !std::mem::take(&mut self.holds_weighed) {
            return;
        }
        let error = belief.mean[LOAD] - 1.0 - moments.mean;
        let variance =
            belief.covariance[(LOAD, LOAD)] - 2.0 * moments.with[LOAD] + moments.variance;
        if variance < SEEN_SHARE * self.each_variance {
            self.weight = (self.weight + 1.0).min(WEIGHT_MAX);
            let seen = error * error + variance.max(0.0);
            self.each_variance += (seen - self.each_variance) / self.weight;
        }
    }

    /// Takes in that the weigher shows the same load times a factor.
    pub fn shown_as(&mut self, belief: &mut Gaussian<STATES>, factor: f64) {
        belief.fade(LOAD, factor, 0.0);
        self.slopes[0] /= factor;
    }

    /// Lets a stop pass, after which the own error of a weigher of a variance is a little another one.
    pub fn age(&mut self, weighing_variance: f64) {
        self.constant *= KEPT;
        self.slopes *= KEPT;
        self.variance *= KEPT * KEPT;
        self.variance += OWN_SHARE * weighing_variance * (1.0 - KEPT * KEPT);
    }
}

#[cfg(test)]
mod tests {
    use super::super::motion_filter::{SPEED, StateCovariance};
    use super::*;

    /// Takes in that traction shows the load and its own scale together.
    fn see_traction(belief: &mut Gaussian<STATES>, load: f64) {
        let mut both = MotionState::zeros();
        both[LOAD] = 1.0;
        both[TRACTION_SCALE] = 1.0;
        belief.rewrite(SPEED, belief.mean[LOAD] + belief.mean[TRACTION_SCALE], &both, 0.0);
        belief.measure(SPEED, load, 4e-6).unwrap();
    }

    fn before_any_weighing() -> Gaussian<STATES> {
        let mut covariance = StateCovariance::zeros();
        covariance[(TRACTION_SCALE, TRACTION_SCALE)] = 0.007 * 0.007;
        Gaussian { mean: MotionState::zeros(), covariance }
    }

    #[test]
    fn a_weigher_that_is_always_off_does_not_pass_for_a_scale_of_the_forces() {
        let variance = 0.03 * 0.03;
        let (mut belief, mut weigher) = (before_any_weighing(), Weigher::new(variance));
        for stop in 0..300 {
            weigher.age(variance);
            weigher.weigh(&mut belief);
            see_traction(&mut belief, 1.03);
            let away = (1.03 - belief.mean[LOAD]) / belief.covariance[(LOAD, LOAD)].sqrt();
            assert!(away.abs() < 2.0, "{away} standard deviations off at stop {stop}");
        }
        let own = weigher.moments(&belief);
        assert!((own.mean - 0.03).abs() < 0.01 && own.variance.sqrt() < 0.01, "{}", own.mean);
    }

    #[test]
    fn beside_a_weigher_that_is_right_on_average_the_scale_of_the_forces_is_learned() {
        let variance = 0.03 * 0.03;
        let (mut belief, mut weigher) = (before_any_weighing(), Weigher::new(variance));
        for stop in 0..300 {
            // By turns 2 % too much and too little; the traction is reported 0.5 % too large.
            let load = if stop % 2 == 0 { 1.02 } else { 0.98 };
            // A stop opens the load before the weigher shows the new one.
            weigher.disturb(&mut belief, 0.01);
            weigher.weigh(&mut belief);
            see_traction(&mut belief, load + 0.005);
            let away = (load - belief.mean[LOAD]) / belief.covariance[(LOAD, LOAD)].sqrt();
            assert!(away.abs() < 2.5, "{away} standard deviations off at stop {stop}");
        }
        assert!((weigher.each_variance.sqrt() - 0.02).abs() < 0.004, "{}", weigher.each_variance);
    }

    #[test]
    fn what_is_known_of_the_weigher_is_neither_more_nor_less_by_keeping_it() {
        let variance = 0.03 * 0.03;
        let (mut belief, mut weigher) = (before_any_weighing(), Weigher::new(variance));
        weigher.weigh(&mut belief);
        assert!((belief.covariance[(LOAD, LOAD)] - 1.5 * variance).abs() < 1e-12);
        see_traction(&mut belief, 1.03);
        let before = weigher.moments(&belief);
        assert!(before.variance < OWN_SHARE * variance, "{}", before.variance);
        weigher.disturb(&mut belief, 0.01);
        let after = weigher.moments(&belief);
        assert!((before.mean - after.mean).abs() < 1e-12);
        assert!((before.variance - after.variance).abs() < 1e-12);
        weigher.shown_as(&mut belief, 1.01);
        assert!((weigher.moments(&belief).mean - after.mean).abs() < 1e-12);
        weigher.forget_load(&mut belief, 1.0, 0.01);
        assert!((weigher.moments(&belief).mean - after.mean).abs() < 1e-12);
    }
}
