//! Filters side by side, one for each way in which the force that the model does not know may behave.

use nalgebra::{Matrix4, Vector3, Vector4};

use super::motion_filter::{
    BEHAVIOURS, BRAKE_ERROR, DISTURBANCE, FilterStep, LOAD, MAP_ERROR, MapErrorStep, MotionFilter,
    MotionState, RESISTANCE, SPEED, STATES, StateCovariance, WIND, behaviours,
};
use super::weigher::{LoadChange, Weigher};
use crate::filter::bank::{Bank, Mixture};
use crate::filter::{Gaussian, NotPositiveDefinite};
use crate::pipeline::motion::{OutlierRow, Trust};

/// Logarithm of the least weight against the best: any behaviour can come back.
const LOG_WEIGHT_MIN: f64 = -30.0;
/// Time in s over which evidence is remembered.
const EVIDENCE_MEMORY_S: f64 = 600.0;
/// Variance in (m/s)² of a wind that is taken for known.
const WIND_LEAST: f64 = 1e-12;
/// Behaviours of a smaller share are left out of the published estimate.
const SHARE_MIN: f64 = 1e-4;

/// Standard deviation in N/kN of the brake force by its lateness from which speeds say nothing else: a brake whose
/// response is unknown gives no information about train or line.
const LATE_UNKNOWN: f64 = 3.0;

/// Leaves all states but the speed and the brake's error, with their covariance, as they were before a measurement; how
/// they depend on these two stays as measured (Schmidt 1966).
fn consider(belief: &mut Gaussian<STATES>, before: &Gaussian<STATES>) {
    let is_measured = |i: usize| i == SPEED || i == BRAKE_ERROR;
    for i in (0..STATES).filter(|&i| !is_measured(i)) {
        belief.mean[i] = before.mean[i];
        for j in (0..STATES).filter(|&j| !is_measured(j)) {
            belief.covariance[(i, j)] = before.covariance[(i, j)];
        }
    }
}

/// Likelihood of a measured speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedLikelihood {
    /// How far it is believed by the likeliest filter.
    pub trust: Trust,
    /// Its innovation in m/s.
    pub innovation_mps: f64,
    /// The predicted variance of that.
    pub variance: f64,
    /// The part of it that forces bring which jumped in the step.
    pub jump_variance: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Rival {
    filter: MotionFilter,
    weigher: Weigher,
    outliers: OutlierRow,
}

/// The filters with the evidence for each.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionBank {
    rivals: Bank<Rival, BEHAVIOURS>,
}

/// a, b, c (scaled) and the load factor, with the covariance of all; and the disturbance now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// a, b, c, scaled, and the declared mass over the true one.
    pub mean: Vector4<f64>,
    /// Their covariance.
    pub covariance: Matrix4<f64>,
    /// Disturbance in N/kN, retarding, and its standard deviation.
    pub disturbance: (f64, f64),
}

impl MotionBank {
    /// All behaviours, each believing the same of everything but the disturbance.
    pub fn new(mean: &MotionState, covariance: &StateCovariance, weigher: Weigher) -> Self {
        let behaviours = behaviours();
        let rivals = behaviours.map(|behaviour| {
            let mut belief = Gaussian { mean: *mean, covariance: *covariance };
            belief.replace(DISTURBANCE, 0.0, behaviour.std_n_per_kn.powi(2));
            let filter = MotionFilter { behaviour, belief, jump_variance: 0.0 };
            Rival { filter, weigher, outliers: OutlierRow::default() }
        });
        let mut rivals = Bank::even(rivals, 0.0);
        for ((_, weight), behaviour) in rivals.weighed_mut().zip(behaviours) {
            *weight = behaviour.log_prior;
        }
        rivals.settle();
        MotionBank { rivals }
    }

    /// Changes the belief of the load.
    pub fn change_load(&mut self, change: LoadChange) {
        for Rival { filter: MotionFilter { belief, .. }, weigher, .. } in
            self.rivals.hypotheses_mut()
        {
            match change {
                LoadChange::Anew(load, variance) => weigher.forget_load(belief, load, variance),
                LoadChange::Weighed => weigher.weigh(belief),
                LoadChange::ShownAs(factor) => weigher.shown_as(belief, factor),
                LoadChange::Opened { by, mean, variance } => {
                    // Any load's mean square distance from the one believed so far.
                    let now = belief.mean[LOAD];
                    let most = variance + (now - mean).powi(2) - belief.covariance[(LOAD, LOAD)];
                    weigher.disturb(belief, (by * now * now).min(most.max(0.0)));
                }
            }
        }
    }

    /// Lets a stop pass, after which the weigher's own error is a little another one.
    pub fn age_weigher(&mut self, weighing_variance: f64) {
        let rivals = self.rivals.hypotheses_mut().iter_mut();
        rivals.for_each(|it| it.weigher.age(weighing_variance));
    }

    /// Begins a motion at a measured speed with the variance of its noise, after a time in s without a sight of it, of
    /// whose wind and error of the map so much is left.
    pub fn begin(&mut self, speed: (f64, f64), gap_s: f64, wind: (f64, f64), map: &MapErrorStep) {
        for Rival { filter, outliers, .. } in self.rivals.hypotheses_mut() {
            *outliers = OutlierRow::default();
            filter.belief.replace(SPEED, speed.0, speed.1);
            let (keep, renewed) = filter.behaviour.over(gap_s);
            filter.belief.fade(DISTURBANCE, keep, renewed);
            filter.belief.fade(WIND, wind.0, wind.1);
            filter.pass(map);
            filter.belief.replace(BRAKE_ERROR, 0.0, 1.0);
        }
    }

    /// Moves every filter on by a step.
    ///
    /// # Real-time
    ///
    /// One step for each behaviour, no allocation.
    pub fn predict(&mut self, step: &FilterStep) {
        self.rivals.hypotheses_mut().iter_mut().for_each(|it| it.filter.predict(step));
    }

    /// The likeliest filter.
    pub fn likeliest(&self) -> &MotionFilter {
        &self.rivals.likeliest().filter
    }

    /// Takes a measured speed into every filter that does not hold it for an outlier.
    ///
    /// # Errors
    ///
    /// When a filter or the measurement is not sound.
    ///
    /// # Real-time
    ///
    /// One correction for each behaviour, no allocation.
    pub fn measure(
        &mut self,
        speed_mps: f64,
        noise_variance: f64,
        step: &FilterStep,
    ) -> Result<SpeedLikelihood, NotPositiveDefinite> {
        let forgetting = (-step.duration_s / EVIDENCE_MEMORY_S).exp();
        let likeliest = self.rivals.likeliest_index();
        let late_std = step.brake_std * step.brake_lateness.sqrt();
        let is_late = late_std > LATE_UNKNOWN * step.duration_s;
        let mut measured = None;
        for (index, (rival, weight)) in self.rivals.weighed_mut().enumerate() {
            let Rival { filter, outliers, .. } = rival;
            let noise_variance = noise_variance + filter.transient_variance(step);
            let before = is_late.then_some(filter.belief);
            let (innovation, trust) =
                outliers.correct(&mut filter.belief, SPEED, speed_mps, noise_variance)?;
            let log_prior = filter.behaviour.log_prior;
            let mut evidence = -trust.surprise() - 0.5 * innovation.variance.ln();
            if let Some(before) = before {
                consider(&mut filter.belief, &before);
                evidence = 0.0;
            }
            // Forgetting applies to the evidence, not to the prior.
            *weight = log_prior + forgetting * (*weight - log_prior) + evidence;
            if index == likeliest {
                measured = Some(SpeedLikelihood {
                    trust,
                    innovation_mps: innovation.value,
                    variance: innovation.variance,
                    jump_variance: filter.jump_variance,
                });
            }
        }
        if !self.rivals.settle() {
            return Err(NotPositiveDefinite);
        }
        self.rivals.weighed_mut().for_each(|(_, weight)| *weight = weight.max(LOG_WEIGHT_MIN));
        measured.ok_or(NotPositiveDefinite)
    }

    /// Returns the mixture of all behaviours, each by its share; the map's error in a direction and the wind are part of
    /// the disturbance, with the addition of 1 m/s of it in N/kN by an air resistance c (scaled).
    ///
    /// # Real-time
    ///
    /// A few sums for each behaviour, no allocation.
    pub fn published(&self, direction: f64, by_wind: f64, c: f64) -> Published {
        const PLACES: [usize; 7] =
            [RESISTANCE, RESISTANCE + 1, RESISTANCE + 2, LOAD, DISTURBANCE, WIND, MAP_ERROR];
        let mut mixture = Mixture::<7>::default();
        let shares = self.rivals.shares(|_| true);
        for (share, Rival { filter, .. }) in shares.into_iter().zip(self.rivals.hypotheses()) {
            if share > SHARE_MIN {
                let belief = &filter.belief;
                mixture.add(
                    share,
                    &nalgebra::SVector::from(PLACES.map(|index| belief.mean[index])),
                    &nalgebra::SMatrix::from_fn(|i, j| belief.covariance[(PLACES[i], PLACES[j])]),
                );
            }
        }
        let Gaussian { mean, covariance } = mixture.belief;
        let parts = Vector3::new(1.0, by_wind, direction);
        let variance = parts.dot(&(covariance.fixed_view::<3, 3>(4, 4) * parts));
        // The filters compute the wind's force by the declared air resistance. The uncertainty that remains grows with
        // the mean square of the learned air resistance.
        let square = mean[2] * mean[2] + covariance[(2, 2)];
        let excess = if c > 0.0 { (square / (c * c) - 1.0).max(0.0) } else { 0.0 };
        let with_wind = covariance.fixed_view::<4, 1>(0, 5).into_owned();
        let by_wind_alone = with_wind * with_wind.transpose() / covariance[(5, 5)].max(WIND_LEAST);
        Published {
            mean: mean.fixed_rows::<4>(0).into_owned(),
            covariance: covariance.fixed_view::<4, 4>(0, 0) + by_wind_alone * excess,
            disturbance: (parts.dot(&mean.fixed_rows::<3>(4)), variance.max(0.0).sqrt()),
        }
    }

    /// True while every filter is sound.
    pub fn is_sound(&self) -> bool {
        // Other unsound values reach the variances with the next step.
        let is_sound = |belief: &Gaussian<STATES>| {
            belief.mean.sum().is_finite()
                && (0..STATES).all(|i| belief.covariance[(i, i)] >= 0.0)
                && belief.covariance.trace().is_finite()
        };
        self.rivals.hypotheses().iter().all(|it| is_sound(&it.filter.belief))
            && self.rivals.weights().iter().all(|weight| weight.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_wind_leaves_open_grows_with_the_air_resistance_that_is_learned() {
        let c = 0.4;
        let variance_of_a = |learned_c: f64| {
            let (mut mean, mut covariance) = (MotionState::zeros(), StateCovariance::zeros());
            mean[RESISTANCE + 2] = learned_c;
            for (i, j, value) in [(3, 3, 0.010), (9, 9, 2.0), (3, 9, -0.1), (9, 3, -0.1)] {
                covariance[(i, j)] = value;
            }
            MotionBank::new(&mean, &covariance, Weigher::new(0.0)).published(0.0, 0.0, c).covariance
                [(0, 0)]
        };
        // Of 0.010 the wind leaves 0.1² / 2 = 0.005; it acts in proportion to c.
        assert!((variance_of_a(c) - 0.010).abs() < 1e-12);
        assert!((variance_of_a(2.0 * c) - (0.005 + 4.0 * 0.005)).abs() < 1e-12);
        // A lower one is no reason to trust more than the declared figure.
        assert!((variance_of_a(0.5 * c) - 0.010).abs() < 1e-12);
    }
}
