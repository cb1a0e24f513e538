//! A recorded run, prepared for simulation, and the accelerating forces at its samples.

use dynocar_shared::resistance::GRAVITY_MPS2;

use crate::force::{ForceBalance, ResolvedSample};
use crate::train::Davis;

/// Gaps in s up to which a missing force is bridged by a straight line.
const FORCE_GAP_MAX_S: f64 = 2.0;
/// Gaps in s between rows up to which the simulation runs on.
const ROW_GAP_MAX_S: f64 = 10.0;

/// Why a run cannot be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulateError {
    /// There is no sample with both forces.
    #[error("expected samples with traction and brake force, got none among {samples} samples")]
    NoForces {
        /// Samples of the run.
        samples: usize,
    },
    /// Times do not grow.
    #[error("sample {index}: expected a time after {before_ns} ns, got {time_ns} ns")]
    TimeNotIncreasing {
        /// Number of the sample, from 0.
        index: usize,
        /// Time of the sample before it in ns.
        before_ns: i64,
        /// Its time in ns.
        time_ns: i64,
    },
}

/// A recorded run made ready for the open-loop simulation.
///
/// - Missing forces and gradients are interpolated over short gaps. Where a gap of forces or rows
///   is longer than the limits, nothing can be said: the simulation starts anew after it at the
///   measured speed, and the samples within are neither simulated nor scored.
/// - A train that is measured at rest while no traction is reported is held by a brake, reported
///   or not: gravity does not set it in motion.
/// - Samples that validation refused (outliers, repeated rows) are simply not there; the step
///   across them is longer.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenLoopRecording {
    samples: Vec<ResolvedSample>,
    /// Time in s from the run's first sample.
    time_s: Vec<f64>,
    /// Measured speeds in m/s, near each other in memory.
    speed_mps: Vec<f64>,
    roles: Vec<SampleRole>,
    knows_gradient: bool,
    bridged: usize,
}

/// Role of a sample in the simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SampleRole {
    /// Reached by a step from the sample before.
    Follows,
    /// As `Follows`, but the train is held at rest by a brake during the step.
    HeldAtRest,
    /// The simulation starts here with the measured speed.
    Starts,
    /// Forces are unknown here.
    Unknown,
}

/// Below this speed in m/s a measurement means rest.
const REST_SPEED_MPS: f64 = 0.05;
/// Below this traction, as acceleration in m/s², a train at rest counts as not pulled.
const REST_TRACTION_MPS2: f64 = 0.005;

impl OpenLoopRecording {
    /// Makes a run ready; `samples` are in order of time.
    ///
    /// # Errors
    ///
    /// When times do not grow or no sample has forces.
    pub fn new(mut samples: Vec<ResolvedSample>) -> Result<Self, SimulateError> {
        for (i, pair) in samples.windows(2).enumerate() {
            let (before_ns, time_ns) = (pair[0].time_ns, pair[1].time_ns);
            if time_ns <= before_ns {
                return Err(SimulateError::TimeNotIncreasing { index: i + 1, before_ns, time_ns });
            }
        }
        let first_ns = samples.first().map_or(0, |sample| sample.time_ns);
        let time_s: Vec<f64> = samples
            .iter()
            .map(|sample| sample.time_ns.saturating_sub(first_ns) as f64 * 1e-9)
            .collect();
        let knows_gradient = samples.iter().any(|sample| sample.gradient_permille.is_some());
        let tractions = bridge(&mut samples, &time_s, |s| &mut s.traction_force_n);
        let bridged = tractions.max(bridge(&mut samples, &time_s, |s| &mut s.brake_force_n));
        // A profile along the line has no short gaps in time: hold it to the ends of the run.
        bridge(&mut samples, &time_s, |s| &mut s.gradient_permille);
        hold_ends(&mut samples);
        let roles = roles(&samples, &time_s, knows_gradient);
        if !roles.contains(&SampleRole::Starts) {
            return Err(SimulateError::NoForces { samples: samples.len() });
        }
        let speed_mps = samples.iter().map(|sample| sample.speed_mps).collect();
        Ok(OpenLoopRecording { samples, time_s, speed_mps, roles, knows_gradient, bridged })
    }

    /// Returns the samples, missing forces bridged where they could be.
    pub fn samples(&self) -> &[ResolvedSample] {
        &self.samples
    }

    /// Returns the time in s of each sample from the run's first.
    pub fn time_s(&self) -> &[f64] {
        &self.time_s
    }

    /// False when no gradient is known anywhere: the line then counts as level.
    pub fn knows_gradient(&self) -> bool {
        self.knows_gradient
    }

    /// Returns the samples whose missing forces were interpolated.
    pub fn bridged(&self) -> usize {
        self.bridged
    }

    /// Returns how often the simulation starts at a measured speed in mid-run, because forces or rows
    /// were missing for too long.
    pub fn restarts(&self) -> usize {
        self.roles.iter().filter(|role| **role == SampleRole::Starts).count() - 1
    }

    /// Returns whether the simulation gives a speed for this sample.
    ///
    /// # Panics
    ///
    /// When the run has no sample of this index.
    pub fn is_simulated(&self, index: usize) -> bool {
        self.roles[index] != SampleRole::Unknown
    }

    /// Returns whether the simulation takes up the measured speed because nothing was known before.
    ///
    /// # Panics
    ///
    /// When the run has no sample of this index.
    pub fn starts(&self, index: usize) -> bool {
        self.roles[index] == SampleRole::Starts
    }

    pub(super) fn speed_mps(&self) -> &[f64] {
        &self.speed_mps
    }

    pub(super) fn roles(&self) -> &[SampleRole] {
        &self.roles
    }
}

/// Interpolates a quantity over gaps of at most [`FORCE_GAP_MAX_S`]; returns the number of samples filled.
fn bridge(
    samples: &mut [ResolvedSample],
    time_s: &[f64],
    field: fn(&mut ResolvedSample) -> &mut Option<f64>,
) -> usize {
    let mut filled = 0;
    let mut known: Option<(usize, f64)> = None;
    for i in 0..samples.len() {
        let Some(value) = *field(&mut samples[i]) else { continue };
        if let Some((from, from_value)) = known
            && time_s[i] - time_s[from] <= FORCE_GAP_MAX_S
        {
            for k in from + 1..i {
                let share = (time_s[k] - time_s[from]) / (time_s[i] - time_s[from]);
                *field(&mut samples[k]) = Some(from_value + share * (value - from_value));
                filled += 1;
            }
        }
        known = Some((i, value));
    }
    filled
}

/// Gives the samples before the first known gradient its value: an accelerometer shows the
/// gradient only from the second sample on.
fn hold_ends(samples: &mut [ResolvedSample]) {
    let gradient_permille = samples.iter().find_map(|sample| sample.gradient_permille);
    let unknown = samples.iter_mut().take_while(|sample| sample.gradient_permille.is_none());
    unknown.for_each(|sample| sample.gradient_permille = gradient_permille);
}

fn roles(samples: &[ResolvedSample], time_s: &[f64], knows_gradient: bool) -> Vec<SampleRole> {
    let mut roles = Vec::with_capacity(samples.len());
    for (i, sample) in samples.iter().enumerate() {
        let is_known = sample.control_force_n().is_some()
            && (!knows_gradient || sample.gradient_permille.is_some());
        let follows = i > 0
            && roles[i - 1] != SampleRole::Unknown
            && time_s[i] - time_s[i - 1] <= ROW_GAP_MAX_S;
        roles.push(match (is_known, follows) {
            (false, _) => SampleRole::Unknown,
            (true, false) => SampleRole::Starts,
            (true, true) if is_held(&samples[i - 1]) && is_held(sample) => SampleRole::HeldAtRest,
            (true, true) => SampleRole::Follows,
        });
    }
    roles
}

fn is_held(sample: &ResolvedSample) -> bool {
    sample.speed_mps < REST_SPEED_MPS && !is_pulled(sample)
}

/// False for a train that, standing, is held by a brake, reported or not.
pub fn is_pulled(sample: &ResolvedSample) -> bool {
    let traction_n = sample.traction_force_n.unwrap_or(0.0);
    !(traction_n < REST_TRACTION_MPS2 * sample.weight_kn * 1000.0 / GRAVITY_MPS2)
}

/// The acceleration of a train at each sample of a recorded run, for any speed.
///
/// The simulated speed is not the measured one, so a model answers for any speed; everything
/// else (place, forces, weather) is the sample's. Between samples the answers are interpolated.
pub trait ForceModel {
    /// dv/dt in m/s² at the sample of this index if the train went at `speed_mps` there.
    fn acceleration_mps2(&self, index: usize, speed_mps: f64) -> f64;

    /// Returns the measured speed over true speed; differs from 1 where the wheel diameter is not the
    /// declared one.
    fn speed_scale(&self) -> f64 {
        1.0
    }
}

/// A closure (index, speed in m/s) to dv/dt in m/s².
impl<F: Fn(usize, f64) -> f64> ForceModel for F {
    fn acceleration_mps2(&self, index: usize, speed_mps: f64) -> f64 {
        self(index, speed_mps)
    }
}

/// Acceleration in m/s² at one sample as a polynomial of the speed in m/s: p0 + p1 v + p2 v².
pub type Polynomial = [f64; 3];

/// A force model that is a quadratic polynomial of the speed at every sample.
///
/// The declared model is of this form, and so are tunnel and curve resistance, wind, dragging
/// brakes, another mass, gain or delay of the forces: an effect adds its three numbers per sample
/// once, and the simulation costs the same with ten effects as with none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuadraticForces {
    polynomials: Vec<Polynomial>,
    speed_scale: f64,
}

impl QuadraticForces {
    /// Returns the declared model over a run with the given Davis coefficients.
    pub fn declared(recording: &OpenLoopRecording, resistance: Davis) -> Self {
        let mut forces = QuadraticForces::default();
        let polynomial = |sample| declared_polynomial(sample, resistance);
        forces.restart(1.0);
        forces.extend(recording.samples().iter().map(polynomial));
        forces
    }

    /// Becomes the model of no sample yet, and of a measured over true speed; keeps its memory, so that an
    /// optimiser allocates only once.
    pub fn restart(&mut self, speed_scale: f64) {
        self.speed_scale = speed_scale;
        self.polynomials.clear();
    }

    /// Goes on with these polynomials, one for each sample.
    pub fn extend(&mut self, polynomials: impl Iterator<Item = Polynomial>) {
        self.polynomials.extend(polynomials);
    }
}

impl ForceModel for QuadraticForces {
    #[inline]
    fn acceleration_mps2(&self, index: usize, speed_mps: f64) -> f64 {
        let [p0, p1, p2] = self.polynomials[index];
        p0 + speed_mps * (p1 + speed_mps * p2)
    }

    fn speed_scale(&self) -> f64 {
        self.speed_scale
    }
}

/// Returns the declared model at a sample. A gradient that is not known counts as level track;
/// [`OpenLoopRecording::knows_gradient`] says.
pub fn declared_polynomial(sample: &ResolvedSample, resistance: Davis) -> Polynomial {
    let Davis { a, b, c } = resistance;
    let acting = ForceBalance {
        mass_kg: sample.mass_kg,
        rotating_mass_factor: sample.rotating_mass_factor(),
        force_n: sample.control_force_n().unwrap_or(0.0),
        gradient_permille: sample.gradient_permille.unwrap_or(0.0),
        resistance_n_per_kn: [sample.extra_n_per_kn + a, b, c],
    };
    acting.acceleration_mps2()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns a train of 100 t with gamma 0.06 that coasts on the level at 20 m/s.
    pub(in crate::simulate) fn coasting_sample(time_s: f64) -> ResolvedSample {
        ResolvedSample { time_ns: (time_s * 1e9).round() as i64, ..ResolvedSample::coasting() }
    }

    pub(in crate::simulate) fn recorded(samples: Vec<ResolvedSample>) -> OpenLoopRecording {
        OpenLoopRecording::new(samples).unwrap()
    }
}
