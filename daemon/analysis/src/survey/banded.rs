//! Symmetric banded systems: work and memory grow linearly with their size.

/// A symmetric positive definite matrix with `width` diagonals on either side of the main one.
#[derive(Clone, Debug)]
pub struct Banded {
    size: usize,
    width: usize,
    /// Row by row the entries from the diagonal to the left: `below[i * (width + 1) + k]` is
    /// the entry (i, i - k).
    below: Vec<f64>,
}

/// The Cholesky factor of a [`Banded`] matrix.
#[derive(Clone, Debug)]
pub struct BandedCholesky {
    lower: Banded,
}

/// A pivot that is not positive.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("expected a positive definite system, got the pivot {pivot} in row {row}")]
pub struct NotPositive {
    /// Its row, from 0.
    pub row: usize,
    /// Value of the pivot.
    pub pivot: f64,
}

impl Banded {
    /// Returns a matrix of zeros.
    pub fn zeros(size: usize, width: usize) -> Self {
        Banded { size, width, below: vec![0.0; size * (width + 1)] }
    }

    /// Adds the outer product of a sparse row with itself, times a weight. Entries are
    /// (column, value), no column twice; no two of them may be further apart than the width.
    pub fn add_row(&mut self, row: &[(usize, f64)], weight: f64) {
        let stride = self.width + 1;
        for (k, &(i, one)) in row.iter().enumerate() {
            let weighted = weight * one;
            for &(j, other) in &row[..=k] {
                self.below[i.max(j) * stride + i.abs_diff(j)] += weighted * other;
            }
        }
    }

    /// Adds a matrix of the same size and width.
    pub fn add(&mut self, other: &Banded) {
        self.below.iter_mut().zip(&other.below).for_each(|(own, more)| *own += more);
    }

    /// Factorises.
    ///
    /// # Errors
    ///
    /// When the matrix is not positive definite.
    pub fn factor(mut self) -> Result<BandedCholesky, NotPositive> {
        let (width, stride) = (self.width, self.width + 1);
        // The entries of a column below the diagonal, the lowest first, in the order of rows in memory.
        let mut column = vec![0.0; width];
        for k in 0..self.size {
            let pivot = self.below[k * stride];
            if !(pivot > 0.0) {
                return Err(NotPositive { row: k, pivot });
            }
            let root = pivot.sqrt();
            self.below[k * stride] = root;
            let last = (k + width).min(self.size - 1);
            for i in k + 1..=last {
                let entry = &mut self.below[i * stride + i - k];
                *entry /= root;
                column[width - (i - k)] = *entry;
            }
            // Columns to the right lose the products one by one: nothing waits for a sum.
            for i in k + 1..=last {
                let own = column[width - (i - k)];
                let row = &mut self.below[i * stride..i * stride + i - k];
                for (entry, other) in row.iter_mut().zip(&column[width - (i - k)..]) {
                    *entry -= own * other;
                }
            }
        }
        Ok(BandedCholesky { lower: self })
    }
}

impl BandedCholesky {
    /// Solves for one right-hand side in place.
    pub fn solve(&self, right: &mut [f64]) {
        let Banded { size, width, below } = &self.lower;
        let stride = width + 1;
        for i in 0..*size {
            let mut sum = right[i];
            for k in i.saturating_sub(*width)..i {
                sum -= below[i * stride + i - k] * right[k];
            }
            right[i] = sum / below[i * stride];
        }
        for i in (0..*size).rev() {
            right[i] /= below[i * stride];
            let value = right[i];
            for k in i.saturating_sub(*width)..i {
                right[k] -= below[i * stride + i - k] * value;
            }
        }
    }

    /// Returns the inverse within the band, by the recursion of Takahashi, Fagan and Chin (1973): as a
    /// matrix in the same storage.
    pub fn inverse_band(&self) -> Banded {
        let Banded { size, width, below } = &self.lower;
        let stride = width + 1;
        let mut inverse = Banded::zeros(*size, *width);
        let entry = |inverse: &Banded, i: usize, j: usize| {
            let (row, column) = (i.max(j), i.min(j));
            inverse.below[row * stride + row - column]
        };
        for j in (0..*size).rev() {
            let last = (j + width).min(size - 1);
            let pivot = below[j * stride];
            for i in (j..=last).rev() {
                let mut sum = if i == j { 1.0 / pivot } else { 0.0 };
                for k in j + 1..=last {
                    sum -= below[k * stride + k - j] * entry(&inverse, i, k);
                }
                inverse.below[i * stride + i - j] = sum / pivot;
            }
        }
        inverse
    }
}

impl Banded {
    /// Returns the variance of a sparse combination under this matrix as covariance.
    pub fn variance_of(&self, row: &[(usize, f64)]) -> f64 {
        let mut sum = 0.0;
        for &(i, one) in row {
            for &(j, other) in row {
                let (low, high) = (i.min(j), i.max(j));
                sum += one * other * self.below[high * (self.width + 1) + high - low];
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Second differences of ten unknowns, tied down at some.
    fn system() -> (Banded, nalgebra::DMatrix<f64>) {
        let (mut banded, mut dense) = (Banded::zeros(10, 3), nalgebra::DMatrix::zeros(10, 10));
        let mut add = |row: &[(usize, f64)], weight: f64| {
            banded.add_row(row, weight);
            for &(i, one) in row {
                for &(j, other) in row {
                    dense[(i, j)] += weight * one * other;
                }
            }
        };
        for i in 0..8 {
            add(&[(i, 1.0), (i + 1, -2.0), (i + 2, 1.0)], 1.0 + i as f64);
        }
        for i in [0, 4, 9] {
            add(&[(i, 1.0)], 0.5);
        }
        add(&[(2, 0.3), (5, -0.7)], 2.0);
        (banded, dense)
    }

    #[test]
    fn solutions_are_those_of_the_full_matrix() {
        let (banded, dense) = system();
        let mut right: Vec<f64> = (0..10).map(|i| f64::from(i * i % 7)).collect();
        let expected = dense.cholesky().unwrap().solve(&nalgebra::DVector::from_vec(right.clone()));
        banded.factor().unwrap().solve(&mut right);
        for (found, expected) in right.iter().zip(expected.iter()) {
            assert!((found - expected).abs() < 1e-9);
        }
    }

    #[test]
    fn the_inverse_within_the_band_is_that_of_the_full_matrix() {
        let (banded, dense) = system();
        let inverse = dense.try_inverse().unwrap();
        let band = banded.factor().unwrap().inverse_band();
        let row = [(3, 1.0), (5, -2.0), (6, 0.5)];
        let mut expected = 0.0;
        for (i, one) in row {
            for (j, other) in row {
                expected += one * other * inverse[(i, j)];
            }
        }
        assert!((band.variance_of(&row) - expected).abs() < 1e-9 * expected.abs());
    }

    #[test]
    fn a_singular_system_is_refused() {
        let mut banded = Banded::zeros(3, 1);
        banded.add_row(&[(0, 1.0), (1, -1.0)], 1.0);
        assert_eq!(banded.factor().unwrap_err().row, 1);
    }
}
