//! The speed that the limits and the next stop allow along a run.

use super::line_maker::SimulatedLine;

/// Highest speed over the distance travelled, up to the next stop.
#[derive(Clone, Debug, PartialEq)]
pub struct PermittedSpeed {
    from_m: f64,
    spacing_m: f64,
    squares: Vec<f64>,
}

/// A leg from one stop to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PermittedLeg {
    /// Distance travelled in m at its start.
    pub from_m: f64,
    /// Distance travelled in m at the stop.
    pub to_m: f64,
    /// Chainage in m of the run's start.
    pub origin_m: f64,
    /// +1 or -1.
    pub direction: f64,
    /// Length in m of the train.
    pub train_length_m: f64,
    /// Share of the limits that the driver aims at.
    pub speed_share: f64,
    /// Highest speed in m/s of the train.
    pub speed_max_mps: f64,
    /// Deceleration in m/s² before lower limits and the stop.
    pub braking_mps2: f64,
}

impl PermittedSpeed {
    /// Returns the profile of a leg.
    pub fn new(line: &SimulatedLine, leg: &PermittedLeg) -> Self {
        let spacing_m = 4.0;
        let count = ((leg.to_m - leg.from_m) / spacing_m).ceil().max(1.0) as usize;
        let mut squares: Vec<f64> = (0..count)
            .map(|k| {
                let centre_m = leg.origin_m + leg.direction * (leg.from_m + k as f64 * spacing_m);
                let limit_mps = line.limit_under_mps(centre_m, leg.train_length_m);
                (leg.speed_share * limit_mps.min(leg.speed_max_mps)).powi(2)
            })
            .collect();
        // The last point lies exactly at the stop.
        let last_m = leg.to_m - leg.from_m - (count - 1) as f64 * spacing_m;
        squares[count - 1] = squares[count - 1].min(2.0 * leg.braking_mps2 * last_m);
        for k in (0..count - 1).rev() {
            squares[k] = squares[k].min(squares[k + 1] + 2.0 * leg.braking_mps2 * spacing_m);
        }
        PermittedSpeed { from_m: leg.from_m, spacing_m, squares }
    }

    /// Permitted speed in m/s at a distance travelled in m; zero past the stop.
    pub fn at(&self, distance_m: f64) -> f64 {
        let place = ((distance_m - self.from_m) / self.spacing_m).max(0.0);
        let index = place as usize;
        let Some(&here) = self.squares.get(index) else { return 0.0 };
        let next = self.squares.get(index + 1).copied().unwrap_or(0.0);
        (here + (next - here) * (place - index as f64)).max(0.0).sqrt()
    }
}
