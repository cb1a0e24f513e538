//! A banded system with a border of common unknowns: heights and what all passes share.

use nalgebra::{SMatrix, SVector};

use super::banded::Factor;
use super::common::Common;

/// Covariance of the common unknowns.
pub type CommonCovariance = SMatrix<f64, { Common::COUNT }, { Common::COUNT }>;
/// A value for each node and common unknown.
pub type Columns = Vec<[f64; Common::COUNT]>;

/// The system: the band's factor, its border, and the common unknowns' own normal equations.
pub struct Bordered<'b> {
    /// Factor of the band.
    pub factor: &'b Factor,
    /// What each node shares with each common unknown.
    pub border: &'b Columns,
    /// Normal matrix of the common unknowns.
    pub corner: CommonCovariance,
    /// Their right-hand side.
    pub corner_right: SVector<f64, { Common::COUNT }>,
}

/// What solves a [`Bordered`] system.
pub struct Solution {
    /// Change of each height in m.
    pub heights_m: Vec<f64>,
    /// Change of the common unknowns.
    pub common: Common,
    /// Covariance of the common unknowns, with the heights' noise let in.
    pub covariance: CommonCovariance,
    /// The band's inverse times the border.
    pub columns: Columns,
}

impl Bordered<'_> {
    /// Eliminates the heights, solves for the common unknowns and puts them in.
    pub fn solve(&self, mut right: Vec<f64>) -> Solution {
        let size = right.len();
        self.factor.solve(&mut right);
        let mut columns = vec![[0.0; Common::COUNT]; size];
        let mut column = vec![0.0; size];
        for index in 0..Common::COUNT {
            for (entry, border) in column.iter_mut().zip(self.border) {
                *entry = border[index];
            }
            self.factor.solve(&mut column);
            for (entries, value) in columns.iter_mut().zip(&column) {
                entries[index] = *value;
            }
        }
        let (mut corner, mut corner_right) = (self.corner, self.corner_right);
        for node in 0..size {
            for one in 0..Common::COUNT {
                corner_right[one] -= self.border[node][one] * right[node];
                for other in 0..Common::COUNT {
                    corner[(one, other)] -= self.border[node][one] * columns[node][other];
                }
            }
        }
        // The prior keeps the corner positive definite.
        let covariance = corner.try_inverse().unwrap_or_else(CommonCovariance::zeros);
        let common = covariance * corner_right;
        for (height, column) in right.iter_mut().zip(&columns) {
            for index in 0..Common::COUNT {
                *height -= column[index] * common[index];
            }
        }
        Solution { heights_m: right, common: Common(common), covariance, columns }
    }
}

impl Solution {
    /// Standard deviations of the common unknowns.
    pub fn common_std(&self) -> Common {
        Common(self.covariance.diagonal().map(|variance| variance.max(0.0).sqrt()))
    }
}
