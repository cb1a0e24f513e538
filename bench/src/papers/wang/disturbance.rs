//! What acts on the train and is not in the model.

use dynocar_estimators::wang::MassKalmanSettings;
use dynocar_estimators::wang::bias_model::BiasModel;
use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::shuttle::{Disturbance, PERIOD_S};
use crate::papers::seeds::normal;

/// Standard deviation in m/s of a leg's mean headwind: a fresh breeze.
pub const MEAN_WIND_STD_MPS: f64 = 3.0;
/// Standard deviation of the gusts in m/s.
pub const GUST_STD_MPS: f64 = 1.0;
/// Correlation time of the gusts in s.
pub const GUST_TIME_S: f64 = 8.0;

/// Headwind: a mean for the leg and gusts, acting on the quadratic part of the resistance.
pub struct Wind {
    mean_mps: f64,
    gust_mps: f64,
    quadratic: f64,
    random: ChaCha8Rng,
}

impl Wind {
    /// Wind for a train with the Davis coefficient c in N/kN per (m/s)².
    pub fn new(quadratic: f64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mean_mps = MEAN_WIND_STD_MPS * normal(&mut random);
        let gust_mps = GUST_STD_MPS * normal(&mut random);
        Wind { mean_mps, gust_mps, quadratic, random }
    }
}

impl Disturbance for Wind {
    fn resistance_n_per_kn(&mut self, _time_s: f64, speed_mps: f64) -> f64 {
        let keep = (-PERIOD_S / GUST_TIME_S).exp();
        self.gust_mps = keep * self.gust_mps
            + GUST_STD_MPS * (1.0 - keep * keep).sqrt() * normal(&mut self.random);
        let air_mps = speed_mps + self.mean_mps + self.gust_mps;
        self.quadratic * (air_mps * air_mps.abs() - speed_mps * speed_mps)
    }
}

/// An unexplained acceleration drawn from what the mass filter presumes: one of its behaviours,
/// all alike likely.
pub struct Presumed {
    model: BiasModel,
    bias_mps2: f64,
    random: ChaCha8Rng,
}

impl Presumed {
    /// Draws by a seed; seeds in a row take the behaviours in turn.
    pub fn new(seed: u64) -> Self {
        let models = MassKalmanSettings::default().bias_models();
        let model = models[(seed % models.len() as u64) as usize];
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0xb1a5);
        Presumed { model, bias_mps2: model.std_mps2 * normal(&mut random), random }
    }
}

impl Disturbance for Presumed {
    fn resistance_n_per_kn(&mut self, _time_s: f64, speed_mps: f64) -> f64 {
        let keep = self.model.keep(PERIOD_S);
        let new = self.model.noise_variance(keep).sqrt() * normal(&mut self.random);
        self.bias_mps2 = keep * self.bias_mps2 + new;
        -1e3 / STANDARD_GRAVITY_MPS2 * self.model.shape(speed_mps) * self.bias_mps2
    }
}

/// A gradient that the map has wrong by a constant, in ‰ along the travel.
pub struct GradientError(pub f64);

impl Disturbance for GradientError {
    fn resistance_n_per_kn(&mut self, _time_s: f64, _speed_mps: f64) -> f64 {
        self.0
    }
}
