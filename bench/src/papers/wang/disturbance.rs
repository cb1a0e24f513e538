//! What acts on the train and is not in the model.

use dynocar_estimators::wang::MassKalmanSettings;
use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::shuttle::PERIOD_S;
use crate::statistics::normal;

/// Standard deviation in m/s of a leg's mean headwind: a fresh breeze.
pub const MEAN_WIND_STD_MPS: f64 = 3.0;
/// Standard deviation of the gusts in m/s.
pub const GUST_STD_MPS: f64 = 1.0;
/// Correlation time of the gusts in s.
pub const GUST_TIME_S: f64 = 8.0;

/// Headwind: a mean for the leg and gusts, acting on the quadratic part of the resistance, the Davis coefficient c
/// in N/kN per (m/s)².
pub fn wind(quadratic: f64, seed: u64) -> impl FnMut(f64) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mean_mps = MEAN_WIND_STD_MPS * normal(&mut random);
    let mut gust_mps = GUST_STD_MPS * normal(&mut random);
    let keep = (-PERIOD_S / GUST_TIME_S).exp();
    move |speed_mps| {
        gust_mps =
            keep * gust_mps + GUST_STD_MPS * (1.0 - keep * keep).sqrt() * normal(&mut random);
        let air_mps = speed_mps + mean_mps + gust_mps;
        quadratic * (air_mps * air_mps.abs() - speed_mps * speed_mps)
    }
}

/// An unexplained acceleration drawn from what the mass filter presumes: one of its behaviours,
/// all alike likely; seeds in a row take the behaviours in turn.
pub fn presumed(seed: u64) -> impl FnMut(f64) -> f64 {
    let models = MassKalmanSettings::default().bias_models();
    let model = models[(seed % models.len() as u64) as usize];
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0xb1a5);
    let mut bias_mps2 = model.std_mps2 * normal(&mut random);
    let keep = model.keep(PERIOD_S);
    move |speed_mps| {
        bias_mps2 = keep * bias_mps2 + model.noise_variance(keep).sqrt() * normal(&mut random);
        -1e3 / STANDARD_GRAVITY_MPS2 * model.shape(speed_mps) * bias_mps2
    }
}
