//! The normal equations of heights and common unknowns, which observations add to: the heights make a
//! band, what all passes share its border.

use nalgebra::{SMatrix, SVector};

use super::banded::{Banded, BandedCholesky, NotPositive};
use super::common::Common;

const COUNT: usize = Common::COUNT;

/// Covariance of the common unknowns, or their normal matrix.
pub type CommonCovariance = SMatrix<f64, COUNT, COUNT>;
/// A value for each node and common unknown.
pub type BorderColumns = Vec<[f64; COUNT]>;

/// Information of some observations, or of the prior, on the unknowns.
pub struct Normal {
    /// Of the heights.
    pub matrix: Banded,
    /// Right-hand side of the heights.
    pub right: Vec<f64>,
    border: BorderColumns,
    corner: CommonCovariance,
    corner_right: SVector<f64, COUNT>,
    /// Sizes in N of the residuals.
    pub sizes_n: Vec<f64>,
}

impl Normal {
    /// Returns zero information for `size` heights with a matrix of this width.
    pub fn zeros(size: usize, width: usize) -> Self {
        Normal {
            matrix: Banded::zeros(size, width),
            right: vec![0.0; size],
            border: vec![[0.0; COUNT]; size],
            corner: CommonCovariance::zeros(),
            corner_right: SVector::zeros(),
            sizes_n: Vec::new(),
        }
    }

    /// Adds what is known of the common unknowns beforehand.
    pub fn add_common(&mut self, (corner, right): (CommonCovariance, SVector<f64, COUNT>)) {
        self.corner += corner;
        self.corner_right += right;
    }

    /// Adds an observation: its slopes over the heights and over the common unknowns.
    pub fn add_row(
        &mut self,
        row: &[(usize, f64)],
        slopes: &[f64; COUNT],
        (residual_n, weight): (f64, f64),
    ) {
        self.sizes_n.push(residual_n.abs());
        self.matrix.add_row(row, weight);
        for &(node, value) in row {
            self.right[node] += weight * value * residual_n;
            for (entry, slope) in self.border[node].iter_mut().zip(slopes) {
                *entry += weight * value * slope;
            }
        }
        for (one, slope) in slopes.iter().enumerate() {
            self.corner_right[one] += weight * slope * residual_n;
            for (other, second) in slopes[..=one].iter().enumerate() {
                self.corner[(one, other)] += weight * slope * second;
            }
        }
    }

    /// Adds what others say.
    pub fn add(&mut self, other: Normal) {
        self.matrix.add(&other.matrix);
        self.right.iter_mut().zip(&other.right).for_each(|(own, more)| *own += more);
        for (own, more) in self.border.iter_mut().zip(&other.border) {
            own.iter_mut().zip(more).for_each(|(own, more)| *own += more);
        }
        self.corner += other.corner;
        self.corner_right += other.corner_right;
        self.sizes_n.extend(other.sizes_n);
    }

    /// Eliminates the heights, solves for the common unknowns and puts them in.
    ///
    /// # Errors
    ///
    /// When they have no solution.
    pub fn solve(self) -> Result<HeightSolution, NotPositive> {
        let Normal { matrix, right: mut heights_m, border, mut corner, mut corner_right, .. } =
            self;
        corner.fill_upper_triangle_with_lower_triangle();
        let factor = matrix.factor()?;
        let size = heights_m.len();
        factor.solve(&mut heights_m);
        let mut columns = vec![[0.0; COUNT]; size];
        for index in 0..COUNT {
            let mut column: Vec<f64> = border.iter().map(|entries| entries[index]).collect();
            factor.solve(&mut column);
            for (entries, value) in columns.iter_mut().zip(&column) {
                entries[index] = *value;
            }
        }
        for node in 0..size {
            for one in 0..COUNT {
                corner_right[one] -= border[node][one] * heights_m[node];
                for other in 0..COUNT {
                    corner[(one, other)] -= border[node][one] * columns[node][other];
                }
            }
        }
        // The prior keeps the corner positive definite.
        let covariance = corner.try_inverse().unwrap_or_else(CommonCovariance::zeros);
        let common = covariance * corner_right;
        for (height, column) in heights_m.iter_mut().zip(&columns) {
            for index in 0..COUNT {
                *height -= column[index] * common[index];
            }
        }
        Ok(HeightSolution { heights_m, common: Common(common), covariance, columns, factor })
    }
}

/// Solution of the normal equations.
pub struct HeightSolution {
    /// Change of each height in m.
    pub heights_m: Vec<f64>,
    /// Change of the common unknowns.
    pub common: Common,
    /// Covariance of the common unknowns, with the heights' noise let in.
    pub covariance: CommonCovariance,
    /// Inverse of the heights' matrix times what they share with the common unknowns.
    pub columns: BorderColumns,
    /// Factor of the heights' matrix.
    pub factor: BandedCholesky,
}

impl HeightSolution {
    /// Standard deviations of the common unknowns.
    pub fn common_std(&self) -> Common {
        Common(self.covariance.diagonal().map(|variance| variance.max(0.0).sqrt()))
    }
}
