//! Kalman filters [v, 1/m, bias] side by side, one for each way in which a bias may behave.
//!
//! Effects that the declared model lacks act like an acceleration: a gradient error stays for minutes, wind grows with
//! the speed, a gust lasts seconds. A single noise model for all of them would trust the model too much in wind or too
//! little in calm. Each filter therefore assumes one behaviour, and the evidence of the innovations weights it.

use dynocar_core::filter::bank::{Bank, Mixture};
use dynocar_core::filter::{Gaussian, NotPositiveDefinite};
use dynocar_core::pipeline::motion::{OutlierRow, Trust};
use nalgebra::{Matrix2, Vector2, Vector3};

use super::force_model::{BiasModel, LineResistance, MapError};
use super::known_motion::{Inertia, KnownMotion};

/// Index of the speed in m/s in a filter's state.
pub const SPEED: usize = 0;
/// Index of the reference mass over the mass.
pub const INVERSE_MASS: usize = 1;
/// Index of the bias in m/s².
pub const BIAS: usize = 2;

/// Number of behaviours.
pub const MODELS: usize = 8;

/// Logarithm of the least weight relative to the best: any behaviour can come back.
const LOG_WEIGHT_MIN: f64 = -30.0;
/// Conversion of forces into acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dynamics {
    /// Resistance of the train on the line.
    pub resistance: LineResistance,
    /// Inertia of the train.
    pub inertia: Inertia,
}

impl Dynamics {
    /// Returns the deceleration in m/s² by resistance and gradient, which does not depend on the mass.
    #[inline]
    pub fn drag_mps2(&self, motion: &KnownMotion, speed_mps: f64) -> f64 {
        self.inertia.mps2_per_n_per_kn() * self.resistance.w_n_per_kn(motion, speed_mps)
    }
}

/// Mean and covariance of inverse mass and bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassBiasMoments {
    /// Reference mass over mass.
    pub inverse_mass: f64,
    /// Its variance.
    pub inverse_mass_variance: f64,
    /// Bias in m/s² at the present speed.
    pub bias_mps2: f64,
    /// Its variance.
    pub bias_variance: f64,
    /// Correlation of the two, -1 to 1.
    pub correlation: f64,
}

/// A filter under one behaviour of the bias.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Behaviour {
    model: BiasModel,
    filter: Gaussian<3>,
    /// Outliers in a row under it.
    outliers: OutlierRow,
    /// Share of the bias that is left after a step of the length that the bank remembers.
    keep: f64,
}

/// The filters with the evidence for each.
#[derive(Clone, Debug, PartialEq)]
pub struct BiasBank {
    dynamics: Dynamics,
    behaviours: Bank<Behaviour, MODELS>,
    forgetting: f64,
    /// Step in s for which the behaviours hold their kept share.
    kept_step_s: f64,
}

impl BiasBank {
    /// A bank that knows of the inverse mass a mean and a standard deviation, both relative to the
    /// reference; `memory` is the number of samples over which evidence is remembered.
    pub fn new(
        dynamics: Dynamics,
        models: [BiasModel; MODELS],
        inverse_mass: (f64, f64),
        memory: f64,
    ) -> Self {
        let behaviours = models.map(|model| Behaviour {
            model,
            filter: Gaussian::independent(
                Vector3::new(0.0, inverse_mass.0, 0.0),
                Vector3::new(1.0, inverse_mass.1, model.std_mps2),
            ),
            outliers: OutlierRow::default(),
            keep: 1.0,
        });
        let forgetting = 1.0 - 1.0 / memory;
        BiasBank { dynamics, behaviours: Bank::even(behaviours, 0.0), forgetting, kept_step_s: 0.0 }
    }

    /// Starts anew at a measured speed; mass and bias stay as they are.
    pub fn restart_speed(&mut self, speed_mps: f64, noise_variance: f64) {
        for behaviour in self.behaviours.hypotheses_mut() {
            behaviour.outliers = OutlierRow::default();
            behaviour.filter.replace(SPEED, speed_mps, noise_variance);
        }
    }

    /// Opens the mass: the same mean and variance for every behaviour, biases as at the start.
    pub fn reopen(&mut self, inverse_mass: f64, variance: f64) {
        for Behaviour { filter, model, .. } in self.behaviours.hypotheses_mut() {
            filter.replace(INVERSE_MASS, inverse_mass, variance);
            filter.replace(BIAS, 0.0, model.std_mps2 * model.std_mps2);
        }
    }

    /// Lets the error of the map at a place into every bias of which nothing is known yet.
    pub fn begin_on_map(&mut self, motion: &KnownMotion) {
        let map = MapError::over(motion, 0.0, self.dynamics.inertia.mps2_per_n_per_kn());
        for Behaviour { filter, model, .. } in self.behaviours.hypotheses_mut() {
            let std_mps2 = model.std_given_others_mps2(map.std_mps2, motion.speed_mps);
            filter.replace(BIAS, 0.0, std_mps2 * std_mps2);
        }
    }

    /// Moves on by a step between two samples, with the force linear between them (Heun).
    pub fn predict(&mut self, from: &KnownMotion, to: &KnownMotion, step_s: f64) {
        let dynamics = &self.dynamics;
        let (push_from, push_to) =
            (dynamics.inertia.push_mps2(from), dynamics.inertia.push_mps2(to));
        let bend = to.known_n_per_kn - from.known_n_per_kn;
        let change = (push_to - push_from, dynamics.inertia.mps2_per_n_per_kn() * bend);
        if self.kept_step_s != step_s {
            self.kept_step_s = step_s;
            for behaviour in self.behaviours.hypotheses_mut() {
                behaviour.keep = behaviour.model.keep(step_s);
            }
        }
        let map = MapError::over(from, step_s, dynamics.inertia.mps2_per_n_per_kn());
        for Behaviour { filter, model, keep, .. } in self.behaviours.hypotheses_mut() {
            let (keep, bias_variance) = model.drift(*keep, &map, from.speed_mps);
            let [speed, inverse_mass, bias] = filter.mean.into();
            let shape = model.shape(speed);
            let start = push_from * inverse_mass - dynamics.drag_mps2(from, speed) + shape * bias;
            let ahead = speed + step_s * start;
            let end = push_to * inverse_mass - dynamics.drag_mps2(to, ahead) + shape * bias;
            let damping =
                dynamics.inertia.mps2_per_n_per_kn() * dynamics.resistance.slope(from, speed);
            let mean_push = 0.5 * (push_from + push_to);
            let gradient = Vector3::new(1.0 - step_s * damping, step_s * mean_push, step_s * shape);
            let jump_variance = model.jump_variance(change.0 * inverse_mass - change.1, step_s);
            let next_mps = speed + 0.5 * step_s * (start + end);
            filter.rewrite(SPEED, next_mps, &gradient, jump_variance);
            filter.fade(BIAS, keep, bias_variance);
        }
    }

    /// Returns the filter with the most evidence.
    pub fn best(&self) -> &Gaussian<3> {
        &self.behaviours.likeliest().filter
    }

    /// Takes a measured speed into every filter for which it is not an outlier; returns the innovation of the filter
    /// that has the most evidence afterwards.
    ///
    /// A speed that is an outlier under one behaviour may be as expected under another, which
    /// knows of forces that jump: each judges for itself, and the evidence is taken of all.
    ///
    /// # Errors
    ///
    /// When a filter or the measurement is not sound.
    pub fn measure(
        &mut self,
        speed_mps: f64,
        noise_variance: f64,
    ) -> Result<Trust, NotPositiveDefinite> {
        let mut judged = [Trust::from_normalised(0.0); MODELS];
        for (judged, (behaviour, weight)) in judged.iter_mut().zip(self.behaviours.weighed_mut()) {
            let Behaviour { filter, outliers, .. } = behaviour;
            let (innovation, trust) = outliers.correct(filter, SPEED, speed_mps, noise_variance)?;
            *judged = trust;
            let evidence = -trust.surprise() - 0.5 * innovation.variance.ln();
            *weight = self.forgetting * *weight + evidence;
        }
        self.behaviours.settle();
        for (_, weight) in self.behaviours.weighed_mut() {
            *weight = weight.max(LOG_WEIGHT_MIN);
        }
        Ok(judged[self.behaviours.likeliest_index()])
    }

    /// Inverse mass and bias, averaged over the behaviours by their evidence.
    pub fn moments(&self) -> MassBiasMoments {
        self.averaged(|_| true)
    }

    /// Returns the same of those behaviours alone that know of forces which jump between samples.
    pub fn moments_after_a_jump(&self) -> MassBiasMoments {
        self.averaged(BiasModel::knows_of_jumps)
    }

    fn averaged(&self, counts: impl Fn(&BiasModel) -> bool) -> MassBiasMoments {
        let shares = self.behaviours.shares(|behaviour| counts(&behaviour.model));
        let mut mixture = Mixture::<2>::default();
        for (share, Behaviour { model, filter, .. }) in
            shares.into_iter().zip(self.behaviours.hypotheses()).filter(|(share, _)| *share > 0.0)
        {
            let shape = model.shape(filter.mean[SPEED]);
            let [_, inverse_mass, bias] = filter.mean.into();
            let own = &filter.covariance;
            let cross = shape * own[(INVERSE_MASS, BIAS)];
            let covariance = Matrix2::new(
                own[(INVERSE_MASS, INVERSE_MASS)],
                cross,
                cross,
                shape * shape * own[(BIAS, BIAS)],
            );
            mixture.add(share, &Vector2::new(inverse_mass, shape * bias), &covariance);
        }
        let Gaussian { mean, covariance } = mixture.belief;
        let product = (covariance[(0, 0)] * covariance[(1, 1)]).sqrt();
        let correlation = covariance[(0, 1)] / product;
        MassBiasMoments {
            inverse_mass: mean[0],
            inverse_mass_variance: covariance[(0, 0)],
            bias_mps2: mean[1],
            bias_variance: covariance[(1, 1)],
            correlation: if product > 0.0 { correlation.clamp(-1.0, 1.0) } else { 0.0 },
        }
    }

    /// Returns whether every filter is sound.
    pub fn is_sound(&self) -> bool {
        self.behaviours.hypotheses().iter().all(|behaviour| behaviour.filter.is_sound())
            && self.behaviours.weights().iter().all(|weight| weight.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;
    use dynocar_model::train::Davis;

    const REFERENCE_KG: f64 = 100_000.0;
    const STEP_S: f64 = 0.2;
    const NOISE_VARIANCE: f64 = 4e-4;

    fn dynamics() -> Dynamics {
        let basic = Davis { a: 2.0, b: 0.0, c: 0.0 };
        Dynamics {
            resistance: LineResistance {
                basic,
                curve: None,
                tunnel: None,
                reference_radius_m: 500.0,
            },
            inertia: Inertia { reference_mass_kg: REFERENCE_KG, rotating_mass_factor: 0.05 },
        }
    }

    fn motion(k: i64, force_n: f64) -> KnownMotion {
        KnownMotion {
            time_ns: k * 200_000_000,
            segment: 1,
            speed_mps: 0.0,
            force_n,
            declared_kg: 1e5,
            known_n_per_kn: 3.0,
            gradient_std_permille: 0.0,
            curvature_per_m: 0.0,
            tunnel_share: 0.0,
        }
    }

    #[test]
    fn without_bias_the_filters_equal_their_batch_least_squares_twin() {
        let calm = BiasModel::new(1e-9, f64::INFINITY, false);
        let mut bank = BiasBank::new(dynamics(), [calm; MODELS], (1.0, 0.2), 1000.0);
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let mut measured = |speed: f64| speed + 0.04 * (random.random::<f64>() - 0.5);
        // v = v0 + u ∫ push dt - drag t: normal equations in [v0, u], with u known to 0.2.
        let mut normal = Matrix2::new(0.0, 0.0, 0.0, 1.0 / 0.04);
        let mut moment = Vector2::new(0.0, 1.0 / 0.04);
        let drag_mps2 = dynamics().inertia.mps2_per_n_per_kn() * (2.0 + 3.0);
        let (truth, mut push_mps) = (0.9, 0.0);
        let force = |k: i64| if k < 60 { 1_000.0 * k as f64 } else { 0.0 };
        for k in 0..120 {
            if k > 0 {
                let (from, to) = (motion(k - 1, force(k - 1)), motion(k, force(k)));
                bank.predict(&from, &to, STEP_S);
                push_mps += 0.5
                    * STEP_S
                    * (dynamics().inertia.push_mps2(&from) + dynamics().inertia.push_mps2(&to));
            }
            let known = -drag_mps2 * STEP_S * k as f64;
            let speed = measured(5.0 + truth * push_mps + known);
            if k == 0 {
                bank.restart_speed(speed, NOISE_VARIANCE);
            } else {
                bank.measure(speed, NOISE_VARIANCE).unwrap();
            }
            let row = Vector2::new(1.0, push_mps);
            normal += row * row.transpose() / NOISE_VARIANCE;
            moment += row * (speed - known) / NOISE_VARIANCE;
        }
        let covariance = normal.try_inverse().unwrap();
        let batch = covariance * moment;
        let moments = bank.moments();
        assert!((moments.inverse_mass - batch[1]).abs() < 1e-7);
        assert!((moments.inverse_mass_variance / covariance[(1, 1)] - 1.0).abs() < 1e-5);
        assert!((moments.inverse_mass - truth).abs() < 4.0 * covariance[(1, 1)].sqrt());
    }

    #[test]
    fn evidence_goes_to_the_behaviour_that_acts() {
        let calm = BiasModel::new(1e-5, f64::INFINITY, false);
        let constant = BiasModel::new(0.02, f64::INFINITY, false);
        for (acting_mps2, expected) in [(0.0, 0), (0.02, 1)] {
            let mut models = [calm; MODELS];
            models[1..].fill(constant);
            let mut bank = BiasBank::new(dynamics(), models, (1.0, 1e-3), 1e6);
            let mut speed = 20.0;
            bank.restart_speed(speed, NOISE_VARIANCE);
            for k in 1..300 {
                bank.predict(&motion(k - 1, 0.0), &motion(k, 0.0), STEP_S);
                speed += STEP_S * (acting_mps2 - dynamics().inertia.mps2_per_n_per_kn() * 5.0);
                bank.measure(speed, NOISE_VARIANCE).unwrap();
            }
            let weights = bank.behaviours.shares(|_| true);
            assert!(weights[expected] > weights[1 - expected], "{acting_mps2}: {weights:?}");
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            assert!((bank.moments().bias_mps2 - acting_mps2).abs() < 2e-3);
        }
    }

    #[test]
    fn opening_the_mass_gives_every_behaviour_the_same_one() {
        let models = [BiasModel::new(0.01, 60.0, true); MODELS];
        let mut bank = BiasBank::new(dynamics(), models, (1.0, 0.2), 1000.0);
        bank.reopen(0.8, 0.01);
        let moments = bank.moments();
        assert!((moments.inverse_mass - 0.8).abs() < 1e-12);
        assert!((moments.inverse_mass_variance - 0.01).abs() < 1e-12);
        assert_eq!((moments.bias_mps2, moments.correlation), (0.0, 0.0));
    }
}
