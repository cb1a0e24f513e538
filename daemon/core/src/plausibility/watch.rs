//! Evidence on units, signs and swaps, gathered sample by sample.

use std::sync::Arc;

use dynocar_model::train::TrainModel;
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::{SampleField, TrainSample};

use super::held_forces::{ForcesNow, HeldForces};
use super::window_balance::{Slopes, WindowBalance, WindowMean};
use crate::filter::RunningMedian;

/// Time in s over which accelerations are averaged; one step where the steps are longer.
const WINDOW_S: f64 = 5.0;
/// A step this many times as long as the usual one is a gap.
const GAP_STEPS: f64 = 4.0;
/// A new step's share in the usual one.
const STEP_SHARE: f64 = 0.1;
/// Below this speed in m/s holding brakes and stiction act.
const MOVING_MPS: f64 = 1.0;
/// Least refused share at which a window with refused samples counts nevertheless.
const REFUSED_SHARE_MIN: f64 = 0.9;
/// Distance in m over which position and speed are compared.
const COMPARED_M: f64 = 200.0;
/// Comparisons of position and speed that the median looks back over, and that are enough.
const RATIOS: usize = 21;
const RATIOS_MIN: usize = 5;
/// Distance in m over which the position is seen to run against the stated direction, and the times in a row.
const REVERSED_M: f64 = 50.0;
const REVERSED_MIN: u32 = 2;
/// Distance by position over distance by speed below which the position runs the other way, and is not only noise.
const REVERSED_RATIO: f64 = -0.5;
/// The greatest share of the effort curve loses this share with each window.
const EFFORT_FADE: f64 = 1.0 / 400.0;
/// Windows with a mass that are enough to judge it.
const MASSES_MIN: f64 = 5.0;

/// Figures of the samples; every ratio is 1 in right units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// Acceleration over the acceleration that the forces and the gradient would give.
    pub slopes: Slopes,
    /// The gradient's factor while the chainage grows and while it falls.
    pub gradients_by_direction: [Option<f64>; 2],
    /// Distance by position, counted in the direction of travel, over distance by speed.
    pub distance_ratio: Option<f64>,
    /// The same over the newest distance, where the position runs against the stated direction.
    pub reversed_ratio: Option<f64>,
    /// Reported over declared mass.
    pub mass_ratio: Option<f64>,
    /// True where the train goes to its next force before that is reported.
    pub are_forces_stale: bool,
    /// Greatest traction and brake force lately as shares of their effort curves.
    pub effort_shares: [Option<f64>; 2],
    /// Brake-cylinder pressure in Pa while braking, where it follows the brake.
    pub braking_pressure_pa: Option<f64>,
    /// Root mean square of the gradients in ‰.
    pub gradient_rms_permille: f64,
    /// Time in s from sample to sample.
    pub step_s: f64,
}

/// Integrals over the window that is being filled.
#[derive(Clone, Copy, Debug, Default)]
struct Window {
    start_mps: f64,
    elapsed_s: f64,
    refused_s: f64,
    traction_mps: f64,
    brake_mps: f64,
    gradient_mps: f64,
    travelled_m: f64,
}

/// Where position and speed are compared from.
#[derive(Clone, Copy, Debug, Default)]
struct Distances {
    by_position_m: f64,
    by_speed_m: f64,
}

impl Distances {
    fn add(&mut self, by_position_m: f64, by_speed_m: f64) {
        self.by_position_m += by_position_m;
        self.by_speed_m += by_speed_m;
    }

    /// Returns the ratio of the two, and begins anew, once one of them is so long.
    fn over(&mut self, length_m: f64) -> Option<f64> {
        let Distances { by_position_m, by_speed_m } = *self;
        if by_speed_m.max(by_position_m.abs()) < length_m {
            return None;
        }
        *self = Distances::default();
        Some(by_position_m / by_speed_m)
    }
}

/// Follows the samples of one train; of fixed size.
#[derive(Clone, Debug)]
pub struct PlausibilityWatch {
    train: Arc<TrainModel>,
    last: Option<TrainSample>,
    usual_step_s: f64,
    gradient_permille: f64,
    window: Window,
    /// False for positions that were integrated from the speed, which show nothing about it.
    pub is_position_measured: bool,
    /// Means of the window that the last sample ended.
    pub ended: Option<WindowMean>,
    distances: Distances,
    balance: WindowBalance,
    /// The windows while the chainage grows and while it falls.
    by_direction: [WindowBalance; 2],
    distance_ratios: RunningMedian<RATIOS>,
    short_distances: Distances,
    reversed_in_a_row: u32,
    reversed_ratio: f64,
    masses: f64,
    mass_ratio: f64,
    effort_shares: [f64; 2],
    held_forces: HeldForces,
    pressure: PressureContrast,
}

impl PlausibilityWatch {
    /// Returns a watch over the samples of a train as it is declared.
    pub fn new(train: Arc<TrainModel>) -> Self {
        PlausibilityWatch {
            train,
            last: None,
            usual_step_s: 0.0,
            gradient_permille: 0.0,
            window: Window::default(),
            is_position_measured: true,
            ended: None,
            distances: Distances::default(),
            balance: WindowBalance::default(),
            by_direction: Default::default(),
            distance_ratios: RunningMedian::default(),
            short_distances: Distances::default(),
            reversed_in_a_row: 0,
            reversed_ratio: 0.0,
            masses: 0.0,
            mass_ratio: 1.0,
            effort_shares: [0.0; 2],
            held_forces: HeldForces::default(),
            pressure: PressureContrast::default(),
        }
    }

    /// Takes in a sample, valid or refused for a value out of range, with the gradient in ‰ along
    /// the travel; true when the figures are new.
    ///
    /// Samples that are no measurement (out of order, not finite, jumps of speed) are the
    /// caller's to leave out.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn take(
        &mut self,
        sample: &TrainSample,
        is_valid: bool,
        gradient_permille: Option<f64>,
    ) -> bool {
        self.ended = None;
        if let Some(gradient) = gradient_permille.filter(|gradient| gradient.is_finite()) {
            self.gradient_permille = gradient;
        }
        let Some(last) = self.last.replace(*sample) else { return false };
        let step_s = sample.time_ns.saturating_sub(last.time_ns) as f64 * 1e-9;
        if sample.run != last.run || sample.direction != last.direction || !(step_s > 0.0) {
            self.begin();
            return false;
        }
        let is_gap = self.usual_step_s > 0.0 && step_s > GAP_STEPS * self.usual_step_s;
        if self.usual_step_s == 0.0 {
            self.usual_step_s = step_s;
        }
        self.usual_step_s += STEP_SHARE * (step_s - self.usual_step_s);
        if is_gap {
            self.begin();
            return false;
        }
        if is_valid {
            self.pressure.take(sample, step_s);
        } else {
            self.window.refused_s += step_s;
        }
        let is_compared = self.compare_distances(&last, sample, step_s);
        let is_held = self.follow_forces(sample, step_s);
        self.extend_window(&last, sample, step_s) || is_compared || is_held
    }

    /// Follows forces that stay the same; true when they changed after a while.
    fn follow_forces(&mut self, now: &TrainSample, step_s: f64) -> bool {
        let Some((traction_n, brake_n)) = forces_n(now).filter(|_| self.is_moving(now)) else {
            self.held_forces.interrupt();
            return false;
        };
        let mass_kg = now.get(SampleField::Mass).unwrap_or(self.train.mass_kg);
        let (traction_mps2, brake_mps2) = (traction_n / mass_kg, brake_n / mass_kg);
        let now = ForcesNow { speed_mps: now.speed_mps, traction_mps2, brake_mps2 };
        self.held_forces.take(now, step_s)
    }

    /// Returns whether a train moves on wheels that neither slide nor spin.
    fn is_moving(&self, sample: &TrainSample) -> bool {
        let is_sliding = sample.flags & dynocar_shared::sample::FLAG_WHEEL_SLIDE != 0;
        sample.speed_mps >= MOVING_MPS && !is_sliding
    }

    /// Returns the figures of the samples so far.
    pub fn figures(&self) -> Figures {
        let share = |share: f64| (share > 0.0).then_some(share);
        Figures {
            slopes: self.balance.slopes(),
            gradients_by_direction: self.by_direction.map(|balance| balance.slopes().gradient),
            reversed_ratio: self.is_reversed().then_some(self.reversed_ratio),
            distance_ratio: if self.distance_ratios.count() >= RATIOS_MIN {
                self.distance_ratios.median()
            } else {
                None
            },
            mass_ratio: (self.masses >= MASSES_MIN).then_some(self.mass_ratio),
            are_forces_stale: self.held_forces.are_stale(),
            effort_shares: self.effort_shares.map(share),
            braking_pressure_pa: self.pressure.braking_pa(),
            gradient_rms_permille: self.balance.gradient_rms_permille(),
            step_s: self.usual_step_s,
        }
    }

    fn begin(&mut self) {
        self.window = Window::default();
        self.distances = Distances::default();
        self.short_distances = Distances::default();
        self.held_forces.interrupt();
    }

    fn is_reversed(&self) -> bool {
        self.reversed_in_a_row >= REVERSED_MIN
    }

    /// Compares position and speed; true when a comparison is complete. A position that runs against the stated
    /// direction shows at once, one in another unit by the median, which the other direction does not enter.
    fn compare_distances(&mut self, last: &TrainSample, now: &TrainSample, step_s: f64) -> bool {
        let (Some(from_m), Some(to_m), true) = (
            last.get(SampleField::Position),
            now.get(SampleField::Position),
            self.is_position_measured,
        ) else {
            self.distances = Distances::default();
            self.short_distances = Distances::default();
            return false;
        };
        let by_position_m = f64::from(now.direction) * (to_m - from_m);
        let by_speed_m = 0.5 * (last.speed_mps + now.speed_mps) * step_s;
        self.distances.add(by_position_m, by_speed_m);
        self.short_distances.add(by_position_m, by_speed_m);
        let short = self.short_distances.over(REVERSED_M);
        if let Some(ratio) = short {
            let is_reversed = ratio < REVERSED_RATIO;
            self.reversed_in_a_row = if is_reversed { self.reversed_in_a_row + 1 } else { 0 };
            self.reversed_ratio = ratio;
        }
        if let Some(ratio) = self.distances.over(COMPARED_M).filter(|_| !self.is_reversed()) {
            self.distance_ratios.push(ratio);
            return true;
        }
        short.is_some()
    }

    fn extend_window(&mut self, last: &TrainSample, now: &TrainSample, step_s: f64) -> bool {
        let (Some(before), Some(after)) = (forces_n(last), forces_n(now)) else {
            self.window = Window::default();
            return false;
        };
        if last.speed_mps < MOVING_MPS || !self.is_moving(now) {
            self.window = Window::default();
            return false;
        }
        let mass_kg = now.get(SampleField::Mass).unwrap_or(self.train.mass_kg);
        let window = &mut self.window;
        if window.elapsed_s == 0.0 {
            window.start_mps = last.speed_mps;
        }
        window.elapsed_s += step_s;
        window.traction_mps += 0.5 * (before.0 + after.0) / mass_kg * step_s;
        window.brake_mps += 0.5 * (before.1 + after.1) / mass_kg * step_s;
        window.gradient_mps += 1e-3 * GRAVITY_MPS2 * self.gradient_permille * step_s;
        window.travelled_m += 0.5 * (last.speed_mps + now.speed_mps) * step_s;
        // The margin keeps rounded times from lengthening a window.
        if window.elapsed_s < WINDOW_S * (1.0 - 1e-6) {
            return false;
        }
        let window = std::mem::take(&mut self.window);
        // Single refusals are failures of a sensor, a whole window of them may be a wrong unit.
        if window.refused_s > 0.0 && window.refused_s < REFUSED_SHARE_MIN * window.elapsed_s {
            return false;
        }
        self.close(window, now, mass_kg);
        true
    }

    fn close(&mut self, window: Window, end: &TrainSample, mass_kg: f64) {
        let per_s = 1.0 / window.elapsed_s;
        let mean = WindowMean {
            inertia_mps2: (1.0 + self.train.rotating_mass_factor)
                * (end.speed_mps - window.start_mps)
                * per_s,
            traction_mps2: window.traction_mps * per_s,
            brake_mps2: window.brake_mps * per_s,
            gradient_mps2: window.gradient_mps * per_s,
            speed_mps: window.travelled_m * per_s,
        };
        self.balance.push(&mean);
        self.by_direction[usize::from(end.direction < 0)].push(&mean);
        self.ended = Some(mean);
        self.masses += 1.0;
        self.mass_ratio = mass_kg / self.train.mass_kg;
        let curves =
            [(&self.train.traction, mean.traction_mps2), (&self.train.brake, mean.brake_mps2)];
        for (share, (curve, force_mps2)) in self.effort_shares.iter_mut().zip(curves) {
            *share -= EFFORT_FADE * *share;
            if let Some(curve) = curve {
                let greatest_n = curve.force_n(mean.speed_mps);
                if greatest_n > 0.0 {
                    *share = share.max(force_mps2 * mass_kg / greatest_n);
                }
            }
        }
    }
}

/// Returns the traction and brake force in N. One that is not recorded is 0 while the other acts.
fn forces_n(sample: &TrainSample) -> Option<(f64, f64)> {
    match (sample.get(SampleField::TractionForce), sample.get(SampleField::BrakeForce)) {
        (Some(traction), Some(brake)) => Some((traction, brake)),
        (Some(traction), None) if traction > 0.0 => Some((traction, 0.0)),
        (None, Some(brake)) if brake > 0.0 => Some((0.0, brake)),
        _ => None,
    }
}

/// Braking time in s that is enough to judge.
const BRAKING_MIN_S: f64 = 20.0;
/// Times of which the means forget, in s.
const MEMORY_S: f64 = 2000.0;
/// The pressure follows the brake when it is this many times as high while braking.
const CONTRAST_MIN: f64 = 3.0;

/// Mean pressure with and without brake force.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PressureContrast {
    braking: Mean,
    released: Mean,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mean {
    time_s: f64,
    integral_pa_s: f64,
}

impl Mean {
    fn take(&mut self, value: f64, step_s: f64) {
        let keep = 1.0 / (1.0 + step_s / MEMORY_S);
        self.time_s = self.time_s * keep + step_s;
        self.integral_pa_s = self.integral_pa_s * keep + value * step_s;
    }

    fn value(&self) -> f64 {
        self.integral_pa_s / self.time_s
    }
}

impl PressureContrast {
    /// Takes in a sample and the time since the one before it.
    pub fn take(&mut self, sample: &TrainSample, step_s: f64) {
        let pressure = sample.get(SampleField::BrakeCylinderPressure);
        let (Some(pressure), Some(brake)) = (pressure, sample.get(SampleField::BrakeForce)) else {
            return;
        };
        let mean = if brake > 0.0 { &mut self.braking } else { &mut self.released };
        mean.take(pressure.abs(), step_s);
    }

    /// Returns the mean pressure in Pa while braking, when it surely follows the brake.
    pub fn braking_pa(&self) -> Option<f64> {
        let is_enough = self.braking.time_s.min(self.released.time_s) >= BRAKING_MIN_S;
        let follows = is_enough && self.braking.value() > CONTRAST_MIN * self.released.value();
        follows.then(|| self.braking.value())
    }
}

#[cfg(test)]
mod tests;
