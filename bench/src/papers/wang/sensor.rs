//! What the controller measures of a drive, and what the daemon makes of it.

use dynocar_model::force::{ForceResolver, ResolvedSample};
use dynocar_model::validation::{ValidationLimits, Validator};
use dynocar_shared::{SampleField, TrainId, TrainSample};
use rand_chacha::ChaCha8Rng;

use super::shuttle::{Instant, Shuttle};
use crate::statistics::normal;

/// Standard deviation of the speed sensor in m/s: 0.05 km/h.
pub const SPEED_STD_MPS: f64 = 0.05 / 3.6;
/// Step of the speed's digits in m/s: 0.1 km/h.
pub const SPEED_QUANTUM_MPS: f64 = 0.1 / 3.6;

/// Variance in (m/s)² of a measured speed: sensor and rounding.
pub fn speed_variance() -> f64 {
    SPEED_STD_MPS * SPEED_STD_MPS + SPEED_QUANTUM_MPS * SPEED_QUANTUM_MPS / 12.0
}

/// The samples of a drive with noise and rounding, through validation and force resolution.
pub fn measure(
    shuttle: &Shuttle,
    ride: &[Instant],
    random: &mut ChaCha8Rng,
) -> Vec<ResolvedSample> {
    let train = &shuttle.train;
    let limits = ValidationLimits::for_train(train.mass_kg);
    let mut validator = Validator::new(TrainId(1), train.mass_kg, limits);
    let mut resolver = ForceResolver::new(train.clone(), Some(shuttle.track.clone()));
    let mut resolved = Vec::with_capacity(ride.len());
    for (index, instant) in ride.iter().enumerate() {
        let is_standing = instant.speed_mps <= 0.0;
        let speed_mps = match is_standing {
            true => 0.0,
            false => {
                let noisy = instant.speed_mps + SPEED_STD_MPS * normal(random);
                ((noisy / SPEED_QUANTUM_MPS).round() * SPEED_QUANTUM_MPS).max(0.0)
            }
        };
        let mut sample = TrainSample::empty(TrainId(1))
            .with(SampleField::Speed, speed_mps)
            .with(SampleField::Position, instant.position_m)
            .with(SampleField::TractionForce, instant.force_n.max(0.0))
            .with(SampleField::BrakeForce, (-instant.force_n).max(0.0));
        sample.time_ns = (instant.time_s * 1e9).round() as i64;
        sample.sequence = index as u64 + 1;
        sample.direction = instant.direction as i8;
        let valid = validator.check(&sample).expect("a plausible sample");
        resolved.push(resolver.resolve(&valid));
    }
    resolved
}
