//! The window with a value of the coefficient, and what it gives the M-step.

use dynocar_core::filter::Gaussian;
use dynocar_core::pipeline::braking::engine::Observation;
use dynocar_core::pipeline::braking::motion::{self, MotionNoise, StepInputs};

/// What the M-step needs of the E-step: dQ/d share and -d²Q/d share² at the present value, the
/// share being the coefficient over the demand. Only I_2, the moves, depends on it (Xie 2019,
/// eq. 30-32: I_1 and I_3 vanish).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Gradient of Q.
    pub gradient: f64,
    /// Curvature of Q, never negative.
    pub curvature: f64,
}

impl Statistics {
    /// The step to the maximum: Q is quadratic in the share, so that the papers' gradient
    /// search (Xie 2019, eq. 33; Jin 2020, eq. 29) ends after this one step. 0 where Q does not
    /// depend on the coefficient.
    pub fn newton_step(&self) -> f64 {
        if self.curvature > 0.0 { self.gradient / self.curvature } else { 0.0 }
    }
}

/// One observation with the step that led to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// The known motion since the entry before.
    pub inputs: StepInputs,
    /// What was measured.
    pub observed: Observation,
    /// The process noise of that step.
    pub noise: MoveNoise,
}

/// Process noise of distance and speed over one step, ready for use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveNoise {
    /// Variances in m² and (m/s)².
    pub variances: [f64; 2],
    /// Their roots.
    pub stds: [f64; 2],
    /// Their inverses.
    pub precisions: [f64; 2],
}

impl MoveNoise {
    /// The noise of a step; of no step, nothing that could be divided by zero.
    pub fn over(noise: &MotionNoise, step_s: f64) -> Self {
        let variances = [noise.distance_m2_per_s, noise.speed_m2_per_s3].map(|rate| rate * step_s);
        let precisions =
            variances.map(|variance| if variance > 0.0 { 1.0 / variance } else { 0.0 });
        MoveNoise { variances, stds: variances.map(f64::sqrt), precisions }
    }
}

/// Observations of a window and the belief about its first state.
#[derive(Clone, Debug)]
pub struct Window {
    /// In order of time; the first entry's inputs lead into the window.
    pub entries: Vec<Entry>,
    /// Distance in m and speed in m/s at the first entry, before its measurement.
    pub first: Gaussian<2>,
}

/// A window with a value of the coefficient: what an E-step needs.
///
/// The coefficient is kept as its share of the demand, which is the same thing while the cylinder
/// pressure is constant, as in the papers, and stays constant while the brake is being applied.
#[derive(Clone, Copy, Debug)]
pub struct WindowModel<'a> {
    /// The window.
    pub window: &'a Window,
    /// Noise of motion and measurement.
    pub noise: &'a MotionNoise,
    /// The coefficient over the demand.
    pub share: f64,
    /// See [`super::EmModel::has_printed_cap`].
    pub has_printed_cap: bool,
}

impl WindowModel<'_> {
    /// The share that acts, and its derivative by the share: above 1 the printed cap lets the
    /// demand act, whatever the share.
    pub fn acting(&self) -> (f64, f64) {
        if self.has_printed_cap && self.share >= 1.0 { (1.0, 0.0) } else { (self.share, 1.0) }
    }

    /// Distance and speed after the move that starts at `step`, without noise, and the
    /// derivative of the final speed by the first.
    pub fn advance(&self, step: usize, state: [f64; 2]) -> ([f64; 2], f64) {
        self.mover(step)(state)
    }

    /// [`WindowModel::advance`] for any number of states.
    #[inline]
    pub fn mover(&self, step: usize) -> impl Fn([f64; 2]) -> ([f64; 2], f64) + use<> {
        let inputs = self.window.entries[step + 1].inputs;
        let (share, _) = self.acting();
        // The law is the demand itself.
        let law = (inputs.demand, 0.0);
        move |[distance_m, speed_mps]| {
            let moved = motion::advance_under(&inputs, law, speed_mps, share);
            ([distance_m + moved.travelled_m, moved.speed_mps], moved.speed_by_speed)
        }
    }

    /// Derivatives of distance and speed after a move by the share.
    pub fn by_share(&self, step: usize) -> [f64; 2] {
        let inputs = &self.window.entries[step + 1].inputs;
        let speed = -inputs.step_s * inputs.gain_mps2 * inputs.demand * self.acting().1;
        [0.5 * inputs.step_s * speed, speed]
    }

    /// The process noise of the move that starts at `step`.
    pub fn move_noise(&self, step: usize) -> &MoveNoise {
        &self.window.entries[step + 1].noise
    }

    /// Adds to the M-step by how much the states deviate, on average over the E-step, from the
    /// noise-free move that starts at `step`.
    pub fn accumulate(&self, step: usize, deviation: [f64; 2], into: &mut Statistics) {
        let slopes = self.by_share(step);
        let precisions = self.move_noise(step).precisions;
        for ((slope, precision), deviation) in slopes.into_iter().zip(precisions).zip(deviation) {
            into.curvature += slope * slope * precision;
            into.gradient += slope * deviation * precision;
        }
    }
}
