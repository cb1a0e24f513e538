//! Kalman filters [v, 1/m, bias] side by side, one for each way in which a bias may behave.
//!
//! What the declared model lacks acts like an acceleration: a gradient error stays for minutes,
//! wind grows with the speed, a gust lasts seconds. One noise for all of them is either too
//! trusting in wind or too timid in calm. Each filter therefore assumes one behaviour, and the
//! evidence of the innovations weighs them (static multiple models: Bar-Shalom, Li,
//! Kirubarajan 2001, section 11.6.2).

use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use nalgebra::{Matrix3, Vector3};

use super::bias_model::BiasModel;
use super::line_resistance::LineResistance;
use super::motion::Motion;
use crate::filter::JosephFilter;
use crate::train::TrainModel;

/// Place of the speed in m/s in a filter's state.
pub const SPEED: usize = 0;
/// Place of the reference mass over the mass.
pub const INVERSE_MASS: usize = 1;
/// Place of the bias in m/s².
pub const BIAS: usize = 2;

/// Number of behaviours.
pub const MODELS: usize = 8;

/// Logarithm of the least weight against the best: any behaviour can come back.
const LOG_WEIGHT_MIN: f64 = -30.0;

/// What turns forces into acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dynamics {
    /// Resistance of the train on the line.
    pub resistance: LineResistance,
    /// Mass in kg that the state's inverse mass refers to.
    pub reference_mass_kg: f64,
    /// 1 + gamma.
    pub inertia_factor: f64,
}

impl Dynamics {
    /// Of a train with a resistance.
    pub fn new(train: &TrainModel, resistance: LineResistance) -> Self {
        Dynamics {
            resistance,
            reference_mass_kg: train.mass_kg,
            inertia_factor: 1.0 + train.rotating_mass_factor,
        }
    }

    /// Acceleration in m/s² of the force on the reference mass.
    pub fn push_mps2(&self, motion: &Motion) -> f64 {
        motion.force_n / (self.reference_mass_kg * self.inertia_factor)
    }

    /// m/s² of one N/kN.
    pub fn mps2_per_n_per_kn(&self) -> f64 {
        1e-3 * STANDARD_GRAVITY_MPS2 / self.inertia_factor
    }

    /// Deceleration in m/s² by resistance and gradient, which does not depend on the mass.
    pub fn drag_mps2(&self, motion: &Motion, speed_mps: f64) -> f64 {
        let w_n_per_kn = self.resistance.w_n_per_kn(motion, speed_mps);
        self.mps2_per_n_per_kn() * (w_n_per_kn + motion.gradient_permille)
    }
}

/// Mean and covariance of inverse mass and bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
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

/// The filters with the evidence for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiasBank {
    dynamics: Dynamics,
    models: [BiasModel; MODELS],
    filters: [JosephFilter<3>; MODELS],
    log_weights: [f64; MODELS],
    forgetting: f64,
}

impl BiasBank {
    /// A bank that knows of the inverse mass a mean and a deviation, both relative to the
    /// reference; `memory` is the number of samples over which evidence is remembered.
    pub fn new(
        dynamics: Dynamics,
        models: [BiasModel; MODELS],
        inverse_mass: (f64, f64),
        memory: f64,
    ) -> Self {
        let filters = models.map(|model| {
            JosephFilter::new(
                Vector3::new(0.0, inverse_mass.0, 0.0),
                Vector3::new(1.0, inverse_mass.1, model.std_mps2),
            )
        });
        let log_weights = [0.0; MODELS];
        BiasBank { dynamics, models, filters, log_weights, forgetting: 1.0 - 1.0 / memory }
    }

    /// Starts anew at a measured speed; mass and bias stay as they are.
    pub fn restart_speed(&mut self, speed_mps: f64, noise_variance: f64) {
        for filter in &mut self.filters {
            filter.replace(SPEED, speed_mps, noise_variance);
        }
    }

    /// Opens the mass: the same mean and variance for every behaviour, biases as at the start.
    pub fn reopen(&mut self, inverse_mass: f64, variance: f64) {
        for (filter, model) in self.filters.iter_mut().zip(&self.models) {
            filter.replace(INVERSE_MASS, inverse_mass, variance);
            filter.replace(BIAS, 0.0, model.std_mps2 * model.std_mps2);
        }
    }

    /// Moves on by a step between two samples, with the force linear between them (Heun).
    pub fn predict(&mut self, from: &Motion, to: &Motion, step_s: f64) {
        let dynamics = &self.dynamics;
        let (push_from, push_to) = (dynamics.push_mps2(from), dynamics.push_mps2(to));
        for (filter, model) in self.filters.iter_mut().zip(&self.models) {
            let [speed, inverse_mass, bias] = filter.state.into();
            let shape = model.shape(speed);
            let start = push_from * inverse_mass - dynamics.drag_mps2(from, speed) + shape * bias;
            let ahead = speed + step_s * start;
            let end = push_to * inverse_mass - dynamics.drag_mps2(to, ahead) + shape * bias;
            let damping = dynamics.mps2_per_n_per_kn() * dynamics.resistance.slope(from, speed);
            let keep = model.keep(step_s);
            let mean_push = 0.5 * (push_from + push_to);
            #[rustfmt::skip]
            let transition = Matrix3::new(
                1.0 - step_s * damping, step_s * mean_push, step_s * shape,
                0.0, 1.0, 0.0,
                0.0, 0.0, keep,
            );
            let next =
                Vector3::new(speed + 0.5 * step_s * (start + end), inverse_mass, keep * bias);
            let noise = Vector3::new(0.0, 0.0, model.noise_variance(keep));
            filter.predict(next, &transition, &noise);
        }
    }

    /// The filter with the most evidence.
    pub fn best(&self) -> &JosephFilter<3> {
        &self.filters[self.best_index()]
    }

    fn best_index(&self) -> usize {
        let better = |best: usize, other: usize| {
            if self.log_weights[other] > self.log_weights[best] { other } else { best }
        };
        (1..MODELS).fold(0, better)
    }

    /// Takes a measured speed into every filter.
    pub fn measure(&mut self, speed_mps: f64, noise_variance: f64) {
        for (filter, log_weight) in self.filters.iter_mut().zip(&mut self.log_weights) {
            let innovation = filter.measure(SPEED, speed_mps, noise_variance);
            let square = innovation.value * innovation.value / innovation.variance;
            *log_weight = self.forgetting * *log_weight - 0.5 * (square + innovation.variance.ln());
        }
        let highest = self.log_weights[self.best_index()];
        for log_weight in &mut self.log_weights {
            *log_weight = (*log_weight - highest).max(LOG_WEIGHT_MIN);
        }
    }

    /// Share of the evidence for each behaviour.
    pub fn weights(&self) -> [f64; MODELS] {
        let raw = self.log_weights.map(f64::exp);
        let sum: f64 = raw.iter().sum();
        raw.map(|weight| weight / sum)
    }

    /// Inverse mass and bias, averaged over the behaviours by their evidence.
    pub fn moments(&self) -> Moments {
        let weights = self.weights();
        let shapes: [f64; MODELS] =
            std::array::from_fn(|i| self.models[i].shape(self.filters[i].state[SPEED]));
        let (mut mass, mut bias) = (0.0, 0.0);
        for ((weight, shape), filter) in weights.iter().zip(shapes).zip(&self.filters) {
            mass += weight * filter.state[INVERSE_MASS];
            bias += weight * shape * filter.state[BIAS];
        }
        let (mut mass_variance, mut bias_variance, mut cross) = (0.0, 0.0, 0.0);
        for ((weight, shape), filter) in weights.iter().zip(shapes).zip(&self.filters) {
            let (du, db) = (filter.state[INVERSE_MASS] - mass, shape * filter.state[BIAS] - bias);
            let own = &filter.covariance;
            mass_variance += weight * (own[(INVERSE_MASS, INVERSE_MASS)] + du * du);
            bias_variance += weight * (shape * shape * own[(BIAS, BIAS)] + db * db);
            cross += weight * (shape * own[(INVERSE_MASS, BIAS)] + du * db);
        }
        let product = (mass_variance * bias_variance).sqrt();
        Moments {
            inverse_mass: mass,
            inverse_mass_variance: mass_variance,
            bias_mps2: bias,
            bias_variance,
            correlation: if product > 0.0 { (cross / product).clamp(-1.0, 1.0) } else { 0.0 },
        }
    }

    /// True while every filter is sound.
    pub fn is_sound(&self) -> bool {
        self.filters.iter().all(JosephFilter::is_sound)
            && self.log_weights.iter().all(|weight| weight.is_finite())
    }
}
