//! Least-squares rows gathered in a triangular factor, without forming JᵀJ.
//!
//! Golub, Van Loan, Matrix Computations, section 5.3: min ‖J x + r‖ has the minimiser of
//! ‖R x + z‖ when Qᵀ \[J r\] = \[R z; 0 ρ\]. The condition number stays that of J, where JᵀJ
//! has its square: in cruise the Davis regressors 1, v, v² need that.

use nalgebra::{SMatrix, SVector};

/// Rows that are reflected together: enough to hide the square root of a reflection.
const BLOCK_ROWS: usize = 16;

/// Gathers rows of `C` columns into an upper triangular factor of their Gram matrix.
///
/// The last column usually is the residual; then the last diagonal entry ends up as the norm
/// of the residual at the minimum.
#[derive(Clone, Copy, Debug)]
pub struct TriangularAccumulator<const C: usize> {
    factor: [[f64; C]; C],
    block: [[f64; BLOCK_ROWS]; C],
    rows: usize,
}

impl<const C: usize> Default for TriangularAccumulator<C> {
    fn default() -> Self {
        TriangularAccumulator { factor: [[0.0; C]; C], block: [[0.0; BLOCK_ROWS]; C], rows: 0 }
    }
}

impl<const C: usize> TriangularAccumulator<C> {
    /// Takes in a row.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(&mut self, row: &[f64; C]) {
        for (column, &value) in self.block.iter_mut().zip(row) {
            column[self.rows] = value;
        }
        self.rows += 1;
        if self.rows == BLOCK_ROWS {
            self.flush();
        }
    }

    /// Reflects the waiting rows into the factor, column by column.
    fn flush(&mut self) {
        for pivot in 0..C {
            let below: f64 = self.block[pivot].iter().map(|value| value * value).sum();
            if below == 0.0 {
                continue;
            }
            let head = self.factor[pivot][pivot];
            let norm = (head * head + below).sqrt();
            // The sign that adds, so that nothing cancels.
            let reflected = if head > 0.0 { -norm } else { norm };
            let lead = head - reflected;
            let scale = 2.0 / (lead * lead + below);
            self.factor[pivot][pivot] = reflected;
            let axis = self.block[pivot];
            for column in pivot + 1..C {
                let rest = &mut self.block[column];
                let mut dot = lead * self.factor[pivot][column];
                for (value, along) in rest.iter().zip(&axis) {
                    dot += value * along;
                }
                let factor = dot * scale;
                self.factor[pivot][column] -= factor * lead;
                for (value, along) in rest.iter_mut().zip(&axis) {
                    *value -= factor * along;
                }
            }
        }
        self.block = [[0.0; BLOCK_ROWS]; C];
        self.rows = 0;
    }

    /// Returns the triangular factor, row by row; entries below the diagonal are zero.
    pub fn factor(&mut self) -> &[[f64; C]; C] {
        if self.rows > 0 {
            self.flush();
        }
        &self.factor
    }
}

/// The linear least-squares problem min ‖R x + z‖ with upper triangular R.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangularSystem<const N: usize> {
    /// Upper triangular factor of the Gram matrix of the Jacobian.
    pub factor: SMatrix<f64, N, N>,
    /// The residuals, rotated likewise.
    pub residual: SVector<f64, N>,
}

impl<const N: usize> TriangularSystem<N> {
    /// Returns the last `N` columns before the residual of gathered rows of `C` columns, with the
    /// columns before them eliminated.
    ///
    /// # Panics
    ///
    /// At compile time unless `C > N`.
    pub fn from_rows<const C: usize>(rows: &mut TriangularAccumulator<C>) -> Self {
        const { assert!(C > N) };
        let gathered = rows.factor();
        let first = C - 1 - N;
        TriangularSystem {
            factor: SMatrix::from_fn(|i, j| gathered[first + i][first + j]),
            residual: SVector::from_fn(|i, _| gathered[first + i][C - 1]),
        }
    }

    /// Takes in one more row by Givens rotations, and gives the rest of its residual.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn append(&mut self, mut row: SVector<f64, N>, mut residual: f64) -> f64 {
        for pivot in 0..N {
            let value = row[pivot];
            if value == 0.0 {
                continue;
            }
            let head = self.factor[(pivot, pivot)];
            // Rows are scaled, so that the squares need no guard against overflow.
            let norm = (head * head + value * value).sqrt();
            let (cosine, sine) = (head / norm, value / norm);
            self.factor[(pivot, pivot)] = norm;
            for column in pivot + 1..N {
                let (upper, lower) = (self.factor[(pivot, column)], row[column]);
                self.factor[(pivot, column)] = cosine * upper + sine * lower;
                row[column] = cosine * lower - sine * upper;
            }
            let (upper, lower) = (self.residual[pivot], residual);
            self.residual[pivot] = cosine * upper + sine * lower;
            residual = cosine * lower - sine * upper;
        }
        residual
    }

    /// Returns the minimiser; `None` when the rows do not determine it.
    pub fn minimiser(&self) -> Option<SVector<f64, N>> {
        let solution = self.factor.solve_upper_triangular(&-self.residual)?;
        solution.iter().all(|entry| entry.is_finite()).then_some(solution)
    }

    /// Returns the gradient Rᵀ z of half the squared norm at x = 0.
    pub fn gradient(&self) -> SVector<f64, N> {
        self.factor.tr_mul(&self.residual)
    }

    /// Returns the covariance (Rᵀ R)⁻¹ of the minimiser for residuals of unit variance; `None` when the
    /// rows do not determine it.
    pub fn covariance(&self) -> Option<SMatrix<f64, N, N>> {
        let inverse = self.inverse();
        let mut covariance = SMatrix::<f64, N, N>::zeros();
        for i in 0..N {
            for j in i..N {
                let sum: f64 = (j..N).map(|k| inverse[(i, k)] * inverse[(j, k)]).sum();
                (covariance[(i, j)], covariance[(j, i)]) = (sum, sum);
            }
        }
        // An infinite row would else count as known for certain.
        (self.factor.sum() + covariance.sum()).is_finite().then_some(covariance)
    }

    /// R⁻¹, upper triangular; not finite where R has none.
    fn inverse(&self) -> SMatrix<f64, N, N> {
        let mut inverse = SMatrix::<f64, N, N>::zeros();
        for j in 0..N {
            inverse[(j, j)] = 1.0 / self.factor[(j, j)];
            for i in (0..j).rev() {
                let sum: f64 = (i + 1..=j).map(|k| self.factor[(i, k)] * inverse[(k, j)]).sum();
                inverse[(i, j)] = -sum * inverse[(i, i)];
            }
        }
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn random_rows(count: usize) -> Vec<[f64; 4]> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        (0..count).map(|_| std::array::from_fn(|_| random.random::<f64>() - 0.5)).collect()
    }

    #[test]
    fn the_factor_has_the_gram_matrix_of_the_rows() {
        for count in [1, 3, 16, 17, 100] {
            let rows = random_rows(count);
            let mut gathered = TriangularAccumulator::<4>::default();
            rows.iter().for_each(|row| gathered.push(row));
            let factor = *gathered.factor();
            for i in 0..4 {
                for j in 0..4 {
                    let expected: f64 = rows.iter().map(|row| row[i] * row[j]).sum();
                    let got: f64 = (0..4).map(|k| factor[k][i] * factor[k][j]).sum();
                    assert!((got - expected).abs() < 1e-12, "{count} rows, entry {i} {j}");
                    assert!(j >= i || factor[i][j] == 0.0);
                }
            }
        }
    }

    #[test]
    fn the_minimiser_and_its_covariance_are_those_of_the_normal_equations() {
        let rows = random_rows(50);
        let mut gathered = TriangularAccumulator::<4>::default();
        rows.iter().for_each(|row| gathered.push(row));
        let system = TriangularSystem::<3>::from_rows(&mut gathered);
        let mut gram = SMatrix::<f64, 3, 3>::zeros();
        let mut right = SVector::<f64, 3>::zeros();
        for row in &rows {
            let regressors = SVector::<f64, 3>::new(row[0], row[1], row[2]);
            gram += regressors * regressors.transpose();
            right += regressors * row[3];
        }
        let inverse = gram.try_inverse().unwrap();
        let expected = -inverse * right;
        let got = system.minimiser().unwrap();
        assert!((got - expected).norm() < 1e-12);
        assert!((system.covariance().unwrap() - inverse).norm() < 1e-12);
        assert!((system.gradient() - right).norm() < 1e-12);
    }

    #[test]
    fn rows_appended_one_by_one_give_the_same_minimiser() {
        let rows = random_rows(20);
        let mut gathered = TriangularAccumulator::<4>::default();
        let mut appended =
            TriangularSystem::<3> { factor: SMatrix::zeros(), residual: SVector::zeros() };
        for row in &rows {
            gathered.push(row);
            appended.append(SVector::<f64, 3>::new(row[0], row[1], row[2]), row[3]);
        }
        let expected = TriangularSystem::<3>::from_rows(&mut gathered).minimiser().unwrap();
        assert!((appended.minimiser().unwrap() - expected).norm() < 1e-12);
    }

    #[test]
    fn too_few_rows_have_no_covariance() {
        let mut gathered = TriangularAccumulator::<4>::default();
        gathered.push(&[1.0, 2.0, 3.0, 4.0]);
        assert_eq!(TriangularSystem::<3>::from_rows(&mut gathered).covariance(), None);
    }

    #[test]
    fn an_infinite_row_has_no_covariance() {
        let factor = SMatrix::from_diagonal(&SVector::from([1.0, f64::INFINITY, 2.0]));
        let system = TriangularSystem::<3> { factor, residual: SVector::zeros() };
        assert_eq!(system.covariance(), None);
    }
}
