//! What the regression takes from a sample.

use dynocar_model::force::ResolvedSample;
use dynocar_model::train::Davis;
use dynocar_shared::RejectionReason;
use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;

use super::{PARAMETERS, regressors, scaled};
use crate::pipeline::motion::{OutlierRow, SpeedNoise};

/// A sample with its forces per weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitSample {
    /// Measurement time in ns.
    pub time_ns: i64,
    /// Motion segment.
    pub segment: u32,
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Traction minus brake minus all that is known to retard, in N/kN.
    pub driving: f64,
    /// Traction in N/kN.
    pub traction: f64,
    /// Brake in N/kN, retarding.
    pub brake: f64,
    /// All that is known to retard beyond the basic resistance, in N/kN: see
    /// [`ResolvedSample::known_n_per_kn`].
    pub known: f64,
    /// s = 1000 (1 + gamma) / g in N/kN per m/s²: momentum per weight and speed.
    pub inertia: f64,
}

impl UnitSample {
    /// The forces of a sample per weight.
    ///
    /// # Errors
    ///
    /// [`RejectionReason::WheelSlide`] while the wheels slide, [`RejectionReason::Missing`]
    /// while a force or the gradient is missing.
    pub fn of(sample: &ResolvedSample) -> Result<Self, RejectionReason> {
        if sample.is_sliding {
            return Err(RejectionReason::WheelSlide);
        }
        let per_weight = |force: Option<f64>| {
            force.map(|force_n| force_n / sample.weight_kn).ok_or(RejectionReason::Missing)
        };
        Ok(UnitSample {
            time_ns: sample.time_ns,
            segment: sample.segment,
            speed_mps: sample.speed_mps,
            driving: per_weight(sample.driving_force_n())?,
            traction: per_weight(sample.traction_force_n)?,
            brake: per_weight(sample.brake_force_n)?,
            known: sample.known_n_per_kn().ok_or(RejectionReason::Missing)?,
            inertia: 1000.0 * sample.inertial_mass_kg / (sample.mass_kg * STANDARD_GRAVITY_MPS2),
        })
    }

    /// Time in s since another sample.
    pub fn seconds_since(&self, earlier: &UnitSample) -> f64 {
        (self.time_ns - earlier.time_ns) as f64 * 1e-9
    }
}

/// Trapezoids from one sample to the next: of the driving force, then of the regressors.
pub fn trapezoids(from: &UnitSample, to: &UnitSample) -> [f64; 1 + PARAMETERS] {
    let half_s = 0.5 * to.seconds_since(from);
    let (at_from, at_to) = (regressors(from.speed_mps), regressors(to.speed_mps));
    let mut areas = [half_s * (from.driving + to.driving); 1 + PARAMETERS];
    for i in 0..PARAMETERS {
        areas[i + 1] = half_s * (at_from[i] + at_to[i]);
    }
    areas
}

/// Keeps the newest accepted sample, refuses spikes, learns the noise of the speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedWatch {
    /// Noise of the speed so far.
    pub noise: SpeedNoise,
    outliers: OutlierRow,
    spike_mps: f64,
}

impl SpeedWatch {
    /// A watch that never calls a deviation below `spike_mps` a spike.
    pub fn new(spike_mps: f64) -> Self {
        // What is never called a spike is taken to be three standard deviations at the start.
        let noise = SpeedNoise::unknown(spike_mps / 3.0);
        SpeedWatch { noise, outliers: OutlierRow::default(), spike_mps }
    }

    /// Judges a sample by the one before it and the resistance as far as it is known; `Some` for a
    /// spike, true in it when so many came in a row that the samples before must have been wrong.
    ///
    /// The force may have changed anywhere in the step, and a tenth of every force is doubted.
    pub fn judge(&mut self, before: &UnitSample, now: &UnitSample, known: &Davis) -> Option<bool> {
        let step_s = now.seconds_since(before);
        let driving = 0.5 * (before.driving + now.driving);
        let resistance = known.w0_n_per_kn(before.speed_mps);
        let expected_mps = before.speed_mps + step_s * (driving - resistance) / now.inertia;
        let control = (before.traction - before.brake).abs().max((now.traction - now.brake).abs());
        let doubt = 0.5 * (now.driving - before.driving).abs() + 0.1 * (control + resistance.abs());
        let allowed_mps =
            self.spike_mps + 8.0 * self.noise.variance().sqrt() + step_s * doubt / now.inertia;
        let is_spike = !((now.speed_mps - expected_mps).abs() <= allowed_mps);
        let is_believed = self.outliers.push(is_spike);
        is_spike.then_some(is_believed)
    }
}

/// w0 integrated, from the integrals of the regressors.
pub fn resistance_integral(known: &Davis, regressor_integrals: &[f64]) -> f64 {
    scaled(known).iter().zip(regressor_integrals).map(|(value, integral)| value * integral).sum()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A sample of a train with s = 100 N/kN per m/s².
    pub fn unit_sample(time_s: f64, speed_mps: f64, driving: f64) -> UnitSample {
        UnitSample {
            time_ns: (time_s * 1e9).round() as i64,
            segment: 1,
            speed_mps,
            driving,
            traction: driving.max(0.0),
            brake: (-driving).max(0.0),
            known: 0.0,
            inertia: 100.0,
        }
    }

    /// Speeds of a train under constant driving force, every `step_s`, by small Euler steps.
    pub fn driven(davis: &Davis, speed_mps: f64, driving: f64, step_s: f64) -> Vec<UnitSample> {
        let mut speed_mps = speed_mps;
        let ticks = 1000;
        (0..300)
            .map(|index| {
                let sample = unit_sample(step_s * f64::from(index), speed_mps, driving);
                for _ in 0..ticks {
                    let rate = (driving - davis.w0_n_per_kn(speed_mps)) / 100.0;
                    speed_mps += rate * step_s / f64::from(ticks);
                }
                sample
            })
            .collect()
    }

    #[test]
    fn a_change_of_force_within_the_step_is_no_spike() {
        let known = Davis { a: 2.0, b: 0.0, c: 0.0 };
        let mut watch = SpeedWatch::new(0.15);
        let before = unit_sample(0.0, 10.0, 0.0);
        // Full traction from just after the first sample on.
        let now = unit_sample(1.0, 10.98, 100.0);
        assert_eq!(watch.judge(&before, &now, &known), None);
        let coasting = unit_sample(1.0, 10.98, 0.0);
        assert_eq!(watch.judge(&before, &coasting, &known), Some(false));
    }

    #[test]
    fn trapezoids_are_exact_for_linear_forces_and_regressors() {
        let areas = trapezoids(&unit_sample(0.0, 10.0, 4.0), &unit_sample(0.5, 20.0, 8.0));
        assert_eq!(areas[..3], [3.0, 0.5, 0.375]);
    }
}
