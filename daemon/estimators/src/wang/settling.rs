//! When a force has acted for long enough to estimate the mass.

use dynocar_core::pipeline::motion::jump_variance;

/// A force that jumped by a somewhere in a step h leaves up to a h / 2 of the speed open, and a mass
/// wrong by as much over the impulse since. At this impulse over a h that is 5 %, and the speeds
/// have long distinguished a jump from another mass.
const IMPULSE_MIN: f64 = 10.0;

/// The impulse of a force since it last jumped.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settling {
    jump_mps: f64,
    impulse_mps: f64,
}

impl Settling {
    /// Takes in a step in s between two accelerations in m/s² by the force, with the variance in
    /// (m/s)² of the measured speed: what leaves less open than that is no jump.
    pub fn step(&mut self, from_mps2: f64, to_mps2: f64, step_s: f64, noise_variance: f64) {
        let change_mps2 = to_mps2 - from_mps2;
        if jump_variance(change_mps2, step_s) > noise_variance {
            let before_mps = if self.is_settled() { 0.0 } else { self.jump_mps };
            self.jump_mps = before_mps.max(step_s * change_mps2.abs());
            self.impulse_mps = 0.0;
        }
        self.impulse_mps += 0.5 * step_s * (from_mps2 + to_mps2).abs();
    }

    /// True when what a jump left open is small against what the force has done since.
    pub fn is_settled(&self) -> bool {
        self.impulse_mps >= IMPULSE_MIN * self.jump_mps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_that_jumps_settles_in_ten_steps_and_one_that_only_trembles_is_settled() {
        let mut settling = Settling::default();
        settling.step(0.0, 0.8, 0.2, 1e-6);
        let steps = (1..).find(|_| {
            settling.step(0.8, 0.8, 0.2, 1e-6);
            settling.is_settled()
        });
        assert_eq!(steps, Some(10));
        settling.step(0.8, 0.75, 0.2, 1e-6);
        assert!(settling.is_settled(), "a change of a sixteenth is made up for by its own step");
        settling.step(0.75, 0.0, 0.2, 1.0);
        assert!(settling.is_settled(), "within the noise");
    }
}
