//! Brake-cylinder pressure that stays while no brake is reported.

use dynocar_model::force::ResolvedSample;

/// After the brake force is gone, the cylinders get this time in s to empty.
const RELEASE_S: f64 = 6.0;
/// The pressure is averaged over this time in s.
const SMOOTHING_S: f64 = 10.0;
/// A lasting pressure below this in Pa is nothing.
const STEP_MIN_PA: f64 = 2500.0;

/// Watches the pressure of released brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReleasedPressure {
    released_s: f64,
    seen_s: f64,
    mean_pa: f64,
    lowest_pa: f64,
}

impl ReleasedPressure {
    /// Before the first sample.
    pub fn new() -> Self {
        ReleasedPressure { released_s: 0.0, seen_s: 0.0, mean_pa: 0.0, lowest_pa: f64::INFINITY }
    }

    /// A new run: the brakes have been released, the lowest pressure ever stays known.
    pub fn restart(&mut self) {
        *self = ReleasedPressure { lowest_pa: self.lowest_pa, ..ReleasedPressure::new() };
    }

    /// Takes in a sample.
    pub fn push(&mut self, sample: &ResolvedSample) {
        let (Some(pressure), Some(brake)) =
            (sample.brake_cylinder_pressure_pa, sample.brake_force_n)
        else {
            return;
        };
        // N per kN of weight: a thousandth of the weight is no brake.
        if brake > sample.weight_kn {
            self.released_s = 0.0;
            return;
        }
        self.released_s += sample.step_s;
        if self.released_s < RELEASE_S {
            return;
        }
        self.seen_s = (self.seen_s + sample.step_s).min(SMOOTHING_S);
        let share = if self.seen_s > 0.0 { sample.step_s / self.seen_s } else { 1.0 };
        self.mean_pa += (pressure - self.mean_pa) * share;
        if self.seen_s >= SMOOTHING_S {
            self.lowest_pa = self.lowest_pa.min(self.mean_pa);
        }
    }

    /// True while the released brakes hold clearly more pressure than they once did.
    pub fn is_raised(&self) -> bool {
        self.seen_s >= SMOOTHING_S && self.mean_pa > self.lowest_pa + STEP_MIN_PA
    }
}
