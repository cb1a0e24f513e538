//! The way from stop to stop as the driver's map has it.

/// Length in m of a piece of the map.
pub const PIECE_M: f64 = 10.0;

/// A way from stop to stop; distances count from where the train starts.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// Distance to the stopping point in m.
    pub length_m: f64,
    /// Highest speed in m/s.
    pub top_mps: f64,
    /// When the train should stand at the stopping point, in s since its start.
    pub due_s: f64,
    /// Gradient and curve resistance in ‰ along the direction of travel, by piece of [`PIECE_M`].
    pub slopes_permille: Vec<f64>,
}

impl Leg {
    /// Gradient and curve resistance in ‰ at a distance in m.
    pub fn slope_permille(&self, at_m: f64) -> f64 {
        let Some(last) = self.slopes_permille.len().checked_sub(1) else { return 0.0 };
        let place = (at_m / PIECE_M).clamp(0.0, last as f64);
        let (index, share) = (place as usize, place.fract());
        let (from, to) = (self.slopes_permille[index], self.slopes_permille[(index + 1).min(last)]);
        from + share * (to - from)
    }

    /// The mean over a section in ‰.
    pub fn mean_slope_permille(&self, from_m: f64, to_m: f64) -> f64 {
        let count = 16;
        let at = |k: i32| from_m + (to_m - from_m) * (f64::from(k) + 0.5) / f64::from(count);
        (0..count).map(|k| self.slope_permille(at(k))).sum::<f64>() / f64::from(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_is_linear_between_pieces_and_constant_beyond() {
        let leg =
            Leg { length_m: 20.0, top_mps: 9.0, due_s: 9.0, slopes_permille: vec![0.0, 10.0, 4.0] };
        assert_eq!([-5.0, 5.0, 10.0, 99.0].map(|at| leg.slope_permille(at)), [0.0, 5.0, 10.0, 4.0]);
        assert!((leg.mean_slope_permille(0.0, 10.0) - 5.0).abs() < 1e-12);
    }
}
