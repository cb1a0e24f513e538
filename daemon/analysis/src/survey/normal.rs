//! The unknown heights of a line's alignments, the gradient under a vehicle that follows from them, and the normal
//! equations of heights and common unknowns: the heights make a band, the unknowns that all passes share its border.

use nalgebra::{SMatrix, SVector};

use super::banded::{Banded, BandedCholesky, NotPositive};
use super::observation::Common;

const COUNT: usize = Common::COUNT;

/// Covariance of the common unknowns, or their normal matrix.
pub type CommonCovariance = SMatrix<f64, COUNT, COUNT>;
/// A value for each node and common unknown.
pub type BorderColumns = Vec<[f64; COUNT]>;

/// Information of some observations, or of the prior, on the unknowns.
pub struct Normal {
    /// Information on the heights.
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

    /// Adds the prior information on the common unknowns.
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

    /// Adds the information of other observations.
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
    /// Inverse of the heights' matrix times the border of the common unknowns.
    pub columns: BorderColumns,
    /// Factor of the heights' matrix.
    pub factor: BandedCholesky,
}

impl HeightSolution {
    /// Returns the standard deviations of the common unknowns.
    pub fn common_std(&self) -> Common {
        Common(self.covariance.diagonal().map(|variance| variance.max(0.0).sqrt()))
    }
}

/// Distance in m between heights.
pub const HEIGHT_STEP_M: f64 = 10.0;
/// Heights reach beyond an alignment by half a vehicle and this many m.
const MARGIN_M: f64 = 60.0;

/// Steps between heights over which the uncertainty of a gradient is stated: 100 m.
const STATED_STEPS: usize = 10;

/// Where heights lie in the system.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightLayout {
    /// For the two alignments: number of the first height, and number of heights.
    pub blocks: Vec<(usize, usize)>,
    /// Chainage in m of a block's first height along its alignment.
    pub start_m: f64,
    /// Length in m of the vehicle.
    vehicle_m: f64,
}

/// A pass's alignment in the system: which block, and +1 along it, -1 against it from an end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineCourse {
    /// Number of the block of heights.
    pub block: usize,
    /// For a pass against the block's sense: length of the alignment in m.
    pub against_from_m: Option<f64>,
}

impl LineCourse {
    /// Returns the place in m along the block.
    pub fn in_block(&self, along_m: f64) -> f64 {
        self.against_from_m.map_or(along_m, |length_m| length_m - along_m)
    }
}

impl HeightLayout {
    /// Heights for alignments of some lengths in m.
    pub fn new(lengths_m: &[f64], vehicle_m: f64) -> Self {
        let start_m = -(MARGIN_M + 0.5 * vehicle_m);
        let mut next = 0;
        let block = |length_m: &f64| {
            let count = ((length_m - 2.0 * start_m) / HEIGHT_STEP_M).ceil() as usize + 1;
            next += count;
            (next - count, count)
        };
        let blocks = lengths_m.iter().map(block).collect();
        HeightLayout { blocks, start_m, vehicle_m }
    }

    /// Returns the number of heights.
    pub fn size(&self) -> usize {
        self.blocks.iter().map(|block| block.1).sum()
    }

    /// Returns the number of diagonals on one side of the main one, for the length of a vehicle, the reach of a block
    /// of time, and the distance over which an uncertainty is stated.
    pub fn width(&self, reach_max_m: f64) -> usize {
        let reach = (self.vehicle_m.max(HEIGHT_STEP_M) + 2.0 * reach_max_m) / HEIGHT_STEP_M;
        (reach.ceil() as usize + 3).max(STATED_STEPS)
    }

    /// Adds a height with a weight to a sparse row.
    pub fn push(&self, block: usize, at_m: f64, weight: f64, row: &mut Vec<(usize, f64)>) {
        let (first, count) = self.blocks[block];
        let place = ((at_m - self.start_m) / HEIGHT_STEP_M).clamp(0.0, (count - 1) as f64 - 1e-9);
        let node = place as usize;
        let share = place - node as f64;
        for (node, part) in [(node, 1.0 - share), (node + 1, share)] {
            match row.iter_mut().find(|entry| entry.0 == first + node) {
                Some(entry) => entry.1 += weight * part,
                None => row.push((first + node, weight * part)),
            }
        }
    }

    /// The gradient under a vehicle as a combination of heights.
    pub fn gradient(
        &self,
        course: LineCourse,
        along_m: f64,
        reach_m: f64,
        row: &mut Vec<(usize, f64)>,
    ) {
        row.clear();
        let length_m = self.vehicle_m.max(HEIGHT_STEP_M);
        let parts: &[(f64, f64)] = match reach_m > 0.0 {
            true => &[(-1.0, 0.25), (0.0, 0.5), (1.0, 0.25)],
            false => &[(0.0, 1.0)],
        };
        for (offset, weight) in parts {
            let centre_m = along_m + offset * reach_m;
            let front = course.in_block(centre_m + 0.5 * length_m);
            let rear = course.in_block(centre_m - 0.5 * length_m);
            self.push(course.block, front, weight / length_m, row);
            self.push(course.block, rear, -weight / length_m, row);
        }
    }

    /// Returns the variance of the mean gradient over 100 m around each piece between neighbouring
    /// heights: between two heights alone the forces show little, and nobody feels it.
    pub fn gradient_variances(&self, solution: &HeightSolution) -> Vec<Vec<f64>> {
        let HeightSolution { columns, covariance, .. } = solution;
        let inverse = solution.factor.inverse_band();
        let of_steps = |from: usize, to: usize| {
            let per_m = 1.0 / ((to - from) as f64 * HEIGHT_STEP_M);
            let row = [(from, -per_m), (to, per_m)];
            let slopes = nalgebra::SVector::<f64, { Common::COUNT }>::from_fn(|index, _| {
                per_m * (columns[to][index] - columns[from][index])
            });
            inverse.variance_of(&row).max(0.0) + slopes.dot(&(covariance * slopes)).max(0.0)
        };
        let block = |&(first, count): &(usize, usize)| {
            let around = |node: usize| {
                let from = (node + 1).saturating_sub(STATED_STEPS / 2).max(first);
                of_steps(from, (from + STATED_STEPS).min(first + count - 1))
            };
            (first..first + count - 1).map(around).collect()
        };
        self.blocks.iter().map(block).collect()
    }
}
