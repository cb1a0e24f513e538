//! The speeds behind an estimate.

use dynocar_shared::ParameterSnapshot;

/// Lowest and highest speed so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedRange(Option<(f64, f64)>);

impl SpeedRange {
    /// Takes in a speed in m/s.
    pub fn push(&mut self, speed_mps: f64) {
        let (low, high) = self.0.unwrap_or((speed_mps, speed_mps));
        self.0 = Some((low.min(speed_mps), high.max(speed_mps)));
    }

    /// Lowest and highest, in m/s; `None` before the first.
    pub fn get(&self) -> Option<(f64, f64)> {
        self.0
    }

    /// Writes both; 0 before the first.
    pub fn write(&self, snapshot: &mut ParameterSnapshot) {
        (snapshot.speed_min_mps, snapshot.speed_max_mps) = self.0.unwrap_or((0.0, 0.0));
    }
}
