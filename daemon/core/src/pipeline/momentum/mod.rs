//! Momentum against the impulse of the forces: the data of every estimator of resistance.
//!
//! In momentum per weight, with s = 1000 (1 + gamma) / g, the declared model reads `s dv/dt = f(t) - w0(v)`, where f is
//! the driving force in N per kN of weight (Liu 2018, eq. 5, whose printed factor 100 lacks rotating mass and rounds
//! 1000/g). It is linear in Davis a, b and c for any window of integration.
//!
//! - [`UnitSample`], [`SpeedWatch`]: forces per weight; refusal of spikes of the speed, and its noise, learned
//! - [`blocks`]: samples to blocks, the impulse between them, and the share of each unknown in it
//! - [`Disturbance`]: the correlation of blocks by a small unknown force
//! - [`DataSettings`]: how samples become regression data

use dynocar_model::force::ResolvedSample;
use dynocar_model::train::Davis;
use dynocar_shared::RejectionReason;
use dynocar_shared::resistance::GRAVITY_MPS2;
use nalgebra::{SMatrix, SVector, Vector2, Vector3};
use serde::Deserialize;

use crate::filter::{Propagation, Sighting};
use crate::pipeline::motion::{MOVING_MPS, OutlierRow, SpeedNoise};
use crate::settings;

pub mod blocks;

/// Davis a, b, c.
pub const PARAMETERS: usize = 3;
/// Number of unknowns of a row: Davis a, b, c, then the errors of the forces, in this order: the scale of traction, the
/// scale of the brake, the delay in s of both.
pub const UNKNOWNS: usize = 6;
/// Index of the error of the traction force's scale among the unknowns.
pub const TRACTION_SCALE: usize = 3;
/// Index of the error of the brake force's scale among the unknowns.
pub const BRAKE_SCALE: usize = 4;
/// Index of the delay in s between the report of a force and the force itself among the unknowns.
pub const FORCE_DELAY: usize = 5;
/// Columns of a row: the known part, then the amount that one unit of each unknown subtracts from it.
pub const COLUMNS: usize = 1 + UNKNOWNS;
/// Regressors are 1, v/20 and (v/20)²: of one magnitude over the speeds of trains.
pub const SPEED_SCALE_MPS: f64 = 20.0;

/// Known part and regressors by column.
pub type MomentumColumns = SVector<f64, COLUMNS>;

/// Returns the scaled regressors of w0 at a speed in m/s.
pub fn regressors(speed_mps: f64) -> [f64; PARAMETERS] {
    let scaled = speed_mps / SPEED_SCALE_MPS;
    [1.0, scaled, scaled * scaled]
}

/// Scaled parameters, all in N/kN, of Davis coefficients.
pub fn scaled(davis: &Davis) -> Vector3<f64> {
    Vector3::new(davis.a, davis.b * SPEED_SCALE_MPS, davis.c * SPEED_SCALE_MPS * SPEED_SCALE_MPS)
}

/// Factors that turn scaled parameters into Davis coefficients.
pub fn unscaling() -> Vector3<f64> {
    Vector3::new(1.0, 1.0 / SPEED_SCALE_MPS, 1.0 / (SPEED_SCALE_MPS * SPEED_SCALE_MPS))
}

/// Returns the seconds since the last time, which the new one replaces; none at first, or when time does not grow.
pub fn gap_s(last_ns: &mut Option<i64>, time_ns: i64) -> Option<f64> {
    let gap_s = time_ns.saturating_sub(last_ns.replace(time_ns)?) as f64 * 1e-9;
    (gap_s > 0.0).then_some(gap_s)
}

/// Integrals since the middle of the newest block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SinceBlock {
    /// The integral of the driving force, then the amount that one unit of each unknown subtracts from it.
    pub impulse: MomentumColumns,
    /// Momentum per weight and speed.
    pub inertia: f64,
}

/// Mean momentum of a block of samples, and the impulse that should have led to it from the block before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MomentumBlock {
    /// True when no block before it belongs to it.
    pub is_first: bool,
    /// s times the mean speed, in N/kN s.
    pub momentum: f64,
    /// Variance of `momentum` by the noise of the speed.
    pub momentum_variance: f64,
    /// From the mean of the block before to the mean of this one: the integral of f, then the amount that one unit of
    /// each unknown subtracts from it.
    pub impulse: MomentumColumns,
    /// Variance of the integral of f.
    pub impulse_variance: f64,
    /// Time of the newest sample in ns.
    pub time_ns: i64,
    /// Mean speed in m/s.
    pub speed_mps: f64,
}

/// Number of hidden states of the error: accumulated momentum (for coasting segments, the error that overlapping
/// segments share), and the disturbance.
pub const STATES: usize = 2;
/// Index of the accumulated momentum.
pub const MOMENTUM: usize = 0;
/// Index of the disturbance.
pub const DISTURBANCE: usize = 1;

/// A slow force that the model does not know: an Ornstein-Uhlenbeck process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbance {
    /// Standard deviation in N/kN.
    pub std_n_per_kn: f64,
    /// Correlation time in s.
    pub time_s: f64,
}

impl Disturbance {
    /// It goes on for a time, and nothing else.
    pub fn decay<const C: usize>(&self, duration_s: f64) -> Propagation<STATES, C> {
        let mut step = Propagation {
            transition: SMatrix::<f64, STATES, STATES>::zeros(),
            input: SMatrix::zeros(),
            noise: SMatrix::zeros(),
        };
        let kept = (-duration_s / self.time_s).exp();
        step.transition[(DISTURBANCE, DISTURBANCE)] = kept;
        step.noise[(DISTURBANCE, DISTURBANCE)] = self.std_n_per_kn.powi(2) * (1.0 - kept * kept);
        step
    }

    /// Over a gap, unknown for how long when `None`, to the first block of a chain: its momentum and
    /// the variance of that are new. The block is used up by it.
    pub fn across_gap<const C: usize>(
        &self,
        gap_s: Option<f64>,
        momentum: f64,
        variance: f64,
    ) -> Propagation<STATES, C> {
        let mut step = self.decay(gap_s.unwrap_or(f64::INFINITY));
        step.input[(MOMENTUM, 0)] = momentum;
        step.noise[(MOMENTUM, MOMENTUM)] = variance;
        step
    }

    /// From a block to the next, by the columns of the impulse between them, which took `duration_s`.
    pub fn over_impulse<const C: usize>(
        &self,
        duration_s: f64,
        impulse: &SVector<f64, C>,
        variance: f64,
    ) -> Propagation<STATES, C> {
        let mut step: Propagation<STATES, C> = self.decay(duration_s);
        step.transition[(MOMENTUM, MOMENTUM)] = 1.0;
        step.transition[(MOMENTUM, DISTURBANCE)] = -duration_s;
        step.input.set_row(MOMENTUM, &impulse.transpose());
        step.noise[(MOMENTUM, MOMENTUM)] = variance;
        step
    }
}

/// Returns a block's momentum, seen with the variance that the speed's noise gives it.
pub fn momentum_seen<const C: usize>(momentum: f64, variance: f64) -> Sighting<STATES, C> {
    let mut observed = SVector::zeros();
    observed[0] = momentum;
    Sighting { direction: Vector2::new(1.0, 0.0), observed, variance }
}

/// Where the regression data come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DataSource {
    /// Momentum against the impulse of the measured forces, in every kind of motion.
    #[default]
    Momentum,
    /// Half-overlapping coasting segments (Liu 2018, figure 2).
    Coasting,
}

settings! {
    /// How samples become regression data.
    #[derive(Copy)]
    DataSettings in "data." {
        /// `momentum` (default) or `coasting`.
        source: DataSource = DataSource::Momentum;
        /// Shortest block of samples in s whose mean speed makes a row (momentum).
        block_s: f64 = 5.0 => (0.5 to 120 "s");
        /// Change of speed in km/h over a coasting segment (0.5 in Liu 2018).
        segment_kmh: f64 = 0.5 => (0.1 to 20 "km/h");
        /// Time in s after the forces ended before coasting is believed.
        coasting_settle_s: f64 = 3.0 => (0 to 60 "s");
        /// Below this speed in m/s nothing is learned: static friction, holding brakes.
        speed_min_mps: f64 = MOVING_MPS => (0.1 to 10 "m/s");
        /// Deviation in m/s from the expected speed that is never called a spike.
        spike_mps: f64 = 0.15 => (0.01 to 10 "m/s");
        /// Standard deviation of the scales of traction and brake force, found jointly with the
        /// resistance: 0.01 is 1 %.
        force_scale_std: f64 = 0.01 => (0.000001 to 0.5);
        /// Standard deviation in s of the delay between report and force, found jointly with the
        /// resistance; a logger that writes means over a step is off by half a step.
        force_delay_std_s: f64 = 0.3 => (0.000001 to 5 "s");
        /// Standard deviation in m of the position against the gradient profile.
        position_std_m: f64 = 3.0 => (0 to 1000 "m");
    }
}

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
    /// Returns the forces of a sample per weight.
    ///
    /// # Errors
    ///
    /// [`RejectionReason::WheelSlide`] while the wheels slide, [`RejectionReason::Missing`]
    /// while a force or the gradient is missing.
    pub fn from_sample(sample: &ResolvedSample) -> Result<Self, RejectionReason> {
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
            inertia: 1000.0 * sample.inertial_mass_kg / (sample.mass_kg * GRAVITY_MPS2),
        })
    }

    /// Returns the time in s since another sample.
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
    /// Returns a watch that never calls a deviation below `spike_mps` a spike.
    pub fn new(spike_mps: f64) -> Self {
        // A level that was never called a spike is taken to be three standard deviations at the start.
        let noise = SpeedNoise::unknown(spike_mps / 3.0);
        SpeedWatch { noise, outliers: OutlierRow::default(), spike_mps }
    }

    /// Judges a sample by the one before it and the resistance as far as it is known; `Some` for a spike, true in
    /// it when several came in a row, so that the samples before must have been wrong.
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

    /// Returns a sample of a train with s = 100 N/kN per m/s².
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

    /// Returns the speeds of a train under constant driving force, every `step_s`, by small Euler steps.
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
