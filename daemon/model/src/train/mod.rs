//! Declared model of a train.

mod derived;
pub mod numbers;
mod rule;

pub use numbers::{
    BrakeComponents, BrakeGear, Corrections, Davis, FrictionBrake, PowerTrain, TrainModel,
};
pub use rule::{Joined, NumberRule};

use crate::track::along_line;

/// A piecewise linear curve of force over speed, held constant beyond its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct EffortCurve {
    /// Points (speed in m/s, force in N), speeds strictly increasing; never empty.
    points: Vec<(f64, f64)>,
}

impl EffortCurve {
    /// Returns a curve through points of strictly increasing, finite speed and finite force >= 0;
    /// `None` when there is no point or one breaks the order.
    pub fn new(points: Vec<(f64, f64)>) -> Option<Self> {
        let is_finite = points.iter().all(|&(v, f)| v.is_finite() && f.is_finite() && f >= 0.0);
        let is_ordered = points.windows(2).all(|pair| pair[0].0 < pair[1].0);
        (!points.is_empty() && is_finite && is_ordered).then_some(EffortCurve { points })
    }

    /// Returns the force in N at a speed in m/s.
    pub fn force_n(&self, speed_mps: f64) -> f64 {
        along_line(&self.points, speed_mps)
    }

    /// Returns the points (speed in m/s, force in N).
    pub fn points(&self) -> &[(f64, f64)] {
        &self.points
    }

    /// Returns the greatest force in N.
    pub fn force_max_n(&self) -> f64 {
        self.points.iter().map(|&(_, force)| force).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effort_is_linear_between_points_and_constant_beyond() {
        let curve = EffortCurve::new(vec![(0.0, 300.0), (10.0, 300.0), (20.0, 100.0)]).unwrap();
        assert_eq!(curve.force_n(-1.0), 300.0);
        assert_eq!(curve.force_n(15.0), 200.0);
        assert_eq!(curve.force_n(10.0), 300.0);
        assert_eq!(curve.force_n(99.0), 100.0);
        assert_eq!(curve.force_max_n(), 300.0);
    }

    #[test]
    fn an_unordered_or_empty_curve_is_refused() {
        assert_eq!(EffortCurve::new(vec![]), None);
        assert_eq!(EffortCurve::new(vec![(1.0, 1.0), (1.0, 2.0)]), None);
        assert_eq!(EffortCurve::new(vec![(0.0, f64::NAN)]), None);
    }
}
