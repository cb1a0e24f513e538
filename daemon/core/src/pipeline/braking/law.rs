//! How the coefficient that slows the train depends on speed.

use dynocar_shared::RailCondition;

/// Why a table of a coefficient over speed is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpeedTableError {
    /// There are fewer than two points.
    #[error("expected at least two points, got {count}")]
    TooFewPoints {
        /// Number of points.
        count: usize,
    },
    /// A point is not finite, not positive, or not faster than the one before it.
    #[error(
        "point {index}: expected a rising speed and a coefficient above 0, got {speed_mps} m/s, {coefficient}"
    )]
    BadPoint {
        /// Number of the point, from 1.
        index: usize,
        /// Its speed in m/s.
        speed_mps: f64,
        /// Its coefficient.
        coefficient: f64,
    },
}

/// A piecewise linear coefficient over speed, held constant beyond its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedTable {
    points: Vec<(f64, f64)>,
}

impl SpeedTable {
    /// Returns a table through (speed in m/s, coefficient) points of rising speed.
    ///
    /// # Errors
    ///
    /// See [`SpeedTableError`].
    pub fn new(points: Vec<(f64, f64)>) -> Result<Self, SpeedTableError> {
        if points.len() < 2 {
            return Err(SpeedTableError::TooFewPoints { count: points.len() });
        }
        for (i, &(speed_mps, coefficient)) in points.iter().enumerate() {
            let is_rising = i == 0 || points[i - 1].0 < speed_mps;
            let is_valid = speed_mps.is_finite() && coefficient.is_finite() && coefficient > 0.0;
            if !(is_rising && is_valid) {
                return Err(SpeedTableError::BadPoint { index: i + 1, speed_mps, coefficient });
            }
        }
        Ok(SpeedTable { points })
    }

    /// Returns the coefficient at a speed in m/s and its derivative in s/m.
    fn at(&self, speed_mps: f64) -> (f64, f64) {
        let after = self.points.partition_point(|point| point.0 <= speed_mps);
        let (Some(low), Some(high)) =
            (after.checked_sub(1).map(|i| self.points[i]), self.points.get(after))
        else {
            let end = if after == 0 { self.points[0] } else { self.points[after - 1] };
            return (end.1, 0.0);
        };
        let slope = (high.1 - low.1) / (high.0 - low.0);
        (low.1 + slope * (speed_mps - low.0), slope)
    }
}

/// The known shape of a coefficient; the estimated scale multiplies it.
#[derive(Clone, Debug, PartialEq)]
pub enum BrakingLaw {
    /// The same at all speeds: the scale is the coefficient itself.
    Constant,
    /// The demand of the brake: the scale is the achieved share of it.
    Demand,
    /// An adhesion law of Xie 2019, section 3.1.
    Rail(RailCondition),
    /// A declared curve over speed.
    Table(SpeedTable),
}

impl BrakingLaw {
    /// Returns the law's coefficient at a speed in m/s, and its derivative by speed in s/m.
    pub fn at(&self, speed_mps: f64, demand: f64) -> (f64, f64) {
        match self {
            BrakingLaw::Constant => (1.0, 0.0),
            BrakingLaw::Demand => (demand, 0.0),
            BrakingLaw::Rail(condition) => {
                (condition.adhesion(speed_mps), condition.adhesion_slope_s_per_m(speed_mps))
            }
            BrakingLaw::Table(table) => table.at(speed_mps),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_linear_between_its_points_and_constant_beyond() {
        let law = BrakingLaw::Table(SpeedTable::new(vec![(10.0, 0.3), (20.0, 0.2)]).unwrap());
        let (value, slope) = law.at(15.0, f64::NAN);
        assert!((value - 0.25).abs() < 1e-15 && (slope + 0.01).abs() < 1e-15);
        assert_eq!(law.at(5.0, 0.0), (0.3, 0.0));
        assert_eq!(law.at(50.0, 0.0), (0.2, 0.0));
    }

    #[test]
    fn a_bad_table_is_refused_with_its_point() {
        assert_eq!(
            SpeedTable::new(vec![(0.0, 0.3)]),
            Err(SpeedTableError::TooFewPoints { count: 1 })
        );
        for bad in [(0.0, 0.3), (1.0, 0.0), (1.0, f64::NAN)] {
            let refused = SpeedTable::new(vec![(0.0, 0.3), bad]);
            assert!(matches!(refused, Err(SpeedTableError::BadPoint { index: 2, .. })));
        }
    }
}
