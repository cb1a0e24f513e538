//! The normal equations of heights and common unknowns, which observations add to.

use nalgebra::SVector;

use super::banded::{Banded, Factor, NotPositive};
use super::bordered::{Bordered, Columns, CommonCovariance, Solution};
use super::common::Common;

const COUNT: usize = Common::COUNT;

/// What some observations, or what is known beforehand, say of the unknowns.
pub struct Normal {
    /// Of the heights.
    pub matrix: Banded,
    /// Right-hand side of the heights.
    pub right: Vec<f64>,
    border: Columns,
    corner: CommonCovariance,
    corner_right: SVector<f64, COUNT>,
    /// Sizes in N of the residuals.
    pub sizes_n: Vec<f64>,
}

impl Normal {
    /// Nothing, for so many heights with a matrix of this width.
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

    /// What solves them, with the factor of the heights' matrix.
    ///
    /// # Errors
    ///
    /// When they have no solution.
    pub fn solve(self) -> Result<(Factor, Solution), NotPositive> {
        let mut corner = self.corner;
        corner.fill_upper_triangle_with_lower_triangle();
        let factor = self.matrix.factor()?;
        let border = &self.border;
        let system = Bordered { factor: &factor, border, corner, corner_right: self.corner_right };
        let solution = system.solve(self.right);
        Ok((factor, solution))
    }
}
