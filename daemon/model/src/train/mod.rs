//! Declared model of a train, and the rules for a number of its file: the values that it may have, and how a finding is
//! combined with a declared value.

mod derived;
pub mod numbers;

pub use numbers::{
    BrakeComponents, BrakeGear, Corrections, Davis, FrictionBrake, PowerTrain, TrainModel,
};

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

/// How a number that was found is combined with one that is declared already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Joined {
    /// The found number replaces the declared one.
    Replaced,
    /// They add up.
    Added,
    /// They multiply.
    Multiplied,
}

/// Rule for a number of a file, in the file's unit.
#[derive(Clone, Copy, Debug)]
pub struct NumberRule {
    /// Least and greatest value.
    pub range: [f64; 2],
    /// True where the value lies above the least.
    pub is_above: bool,
    /// True for a whole number.
    pub is_whole: bool,
    /// True where its table must hold it.
    pub is_required: bool,
    /// The rule in words.
    pub allowed: &'static str,
    /// Effect of a finding on a declared value.
    pub joined: Joined,
    /// The number in the model's unit over that in the file's.
    pub factor: f64,
}

impl NumberRule {
    /// From a least to a greatest value; `allowed` says so.
    pub const fn within(least: f64, greatest: f64, allowed: &'static str) -> Self {
        NumberRule {
            range: [least, greatest],
            is_above: false,
            is_whole: false,
            is_required: false,
            allowed,
            joined: Joined::Replaced,
            factor: 1.0,
        }
    }

    /// Above a value, up to a greatest one.
    pub const fn above(below: f64, greatest: f64, allowed: &'static str) -> Self {
        NumberRule { is_above: true, ..Self::within(below, greatest, allowed) }
    }

    /// Returns the same for a number that its table must hold.
    pub const fn required(self) -> Self {
        NumberRule { is_required: true, ..self }
    }

    /// Returns the same for a whole number.
    pub const fn whole(self) -> Self {
        NumberRule { is_whole: true, ..self }
    }

    /// Returns the same for a number that the model holds this many times greater.
    pub const fn times(self, factor: f64) -> Self {
        NumberRule { factor, ..self }
    }

    /// Returns the same for a number to which findings add.
    pub const fn added(self) -> Self {
        NumberRule { joined: Joined::Added, ..self }
    }

    /// Returns the same for a number with which findings multiply.
    pub const fn multiplied(self) -> Self {
        NumberRule { joined: Joined::Multiplied, ..self }
    }

    /// Returns true for a number that may stand in the file.
    pub fn allows(&self, value: f64) -> bool {
        let is_above = !self.is_above || value > self.range[0];
        let is_whole = !self.is_whole || value.fract() == 0.0;
        (self.range[0]..=self.range[1]).contains(&value) && is_above && is_whole
    }

    /// Returns the declared number joined with one that was found.
    pub fn join(&self, declared: f64, found: f64) -> f64 {
        match self.joined {
            Joined::Replaced => found,
            Joined::Added => declared + found,
            Joined::Multiplied => declared * found,
        }
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
