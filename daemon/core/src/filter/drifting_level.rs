//! Least squares beside a level that may drift.
//!
//! The measurement equation is `y_k = level_k + x_k · theta + e_k` with a level that takes
//! random steps and parameters that stay. Integral regression of motion has this form: the
//! level is the speed that the integrals do not explain, and its drift is what a gust does.
//! Kept as square-root information, `R [level; theta] = z + nu` with `R` upper triangular and
//! `nu` of unit covariance (Bierman 1977, chapter V): a step of the level scales one row, and
//! forgetting the level drops that row, which marginalises it exactly.

use nalgebra::{SMatrix, SVector};

/// Place of the level among the unknowns; the parameters follow.
pub const LEVEL: usize = 0;

/// What a measurement told of itself when it was absorbed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Measured minus predicted over its predicted standard deviation; `None` where the
    /// measurement only fixed what was free before.
    pub normalised: Option<f64>,
    /// Logarithm of the predicted variance over the measurement's own variance.
    pub log_variance_ratio: f64,
}

/// Square-root information of a level and N - 1 parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct DriftingLevel<const N: usize> {
    /// Upper triangle, rows first.
    root: [[f64; N]; N],
    target: [f64; N],
}

impl<const N: usize> DriftingLevel<N> {
    /// Independent prior knowledge of the parameters; the level is free.
    ///
    /// Entry [`LEVEL`] of both arguments is not used. Standard deviations are above 0 and
    /// relative to the measurement noise.
    pub fn new(mean: &SVector<f64, N>, std: &SVector<f64, N>) -> Self {
        let mut root = [[0.0; N]; N];
        let mut target = [0.0; N];
        for i in 1..N {
            root[i][i] = 1.0 / std[i];
            target[i] = mean[i] / std[i];
        }
        DriftingLevel { root, target }
    }

    /// Forgets the level, as after a gap; what it told of the parameters stays.
    pub fn free_level(&mut self) {
        self.root[LEVEL] = [0.0; N];
        self.target[LEVEL] = 0.0;
    }

    /// Lets the level take a random step of a variance in units of the measurement's.
    pub fn drift_level(&mut self, variance: f64) {
        let scale = 1.0 / (1.0 + variance * self.root[LEVEL][LEVEL].powi(2)).sqrt();
        scale_row(&mut self.root[LEVEL], &mut self.target[LEVEL], scale);
    }

    /// Lets the first parameter take a random step and forgets the level.
    ///
    /// The level has to go first: while it is there, its row ties the parameter's old value to
    /// the new level.
    pub fn widen_first_parameter(&mut self, variance: f64) {
        self.free_level();
        let scale = 1.0 / (1.0 + variance * self.root[1][1].powi(2)).sqrt();
        scale_row(&mut self.root[1], &mut self.target[1], scale);
    }

    /// Multiplies all information by a factor from 0 to 1: everything known grows old alike.
    pub fn fade(&mut self, factor: f64) {
        for (row, target) in self.root.iter_mut().zip(&mut self.target) {
            scale_row(row, target, factor.sqrt());
        }
    }

    /// Absorbs `value = row · [level; theta] + e`, the variance of e being 1 / `weight`.
    ///
    /// By Givens rotations; what is left of the value after them is the normalised innovation.
    ///
    /// # Real-time
    ///
    /// N rotations, no allocation.
    pub fn absorb(&mut self, row: &SVector<f64, N>, value: f64, weight: f64) -> Innovation {
        let root_weight = weight.sqrt();
        let mut rest: [f64; N] = std::array::from_fn(|i| row[i] * root_weight);
        let mut rest_value = value * root_weight;
        let (mut log_ratio, mut is_free) = (0.0, false);
        for i in 0..N {
            if rest[i] == 0.0 {
                continue;
            }
            let before = self.root[i][i];
            let after = before.hypot(rest[i]);
            let (cosine, sine) = (before / after, rest[i] / after);
            for (own, other) in self.root[i][i..].iter_mut().zip(&mut rest[i..]) {
                (*own, *other) = (cosine * *own + sine * *other, cosine * *other - sine * *own);
            }
            let own = self.target[i];
            self.target[i] = cosine * own + sine * rest_value;
            rest_value = cosine * rest_value - sine * own;
            if cosine > 0.0 {
                log_ratio -= 2.0 * cosine.ln();
            } else {
                is_free = true;
            }
        }
        let normalised = if is_free { None } else { Some(rest_value) };
        Innovation { normalised, log_variance_ratio: log_ratio }
    }

    /// The parameters; entry [`LEVEL`] is the level, 0 while it is free.
    ///
    /// `None` when a parameter is not determined or a number is not finite.
    pub fn solve(&self) -> Option<SVector<f64, N>> {
        let mut solution = SVector::<f64, N>::zeros();
        for i in (0..N).rev() {
            if i == LEVEL && self.root[i][i] == 0.0 {
                continue;
            }
            let known: f64 = (i + 1..N).map(|j| self.root[i][j] * solution[j]).sum();
            solution[i] = (self.target[i] - known) / self.root[i][i];
            if !solution[i].is_finite() {
                return None;
            }
        }
        Some(solution)
    }

    /// Square root S of the covariance, S Sᵀ, in units of the measurement variance.
    ///
    /// Row and column [`LEVEL`] are 0: the level is not asked for. `None` as for
    /// [`DriftingLevel::solve`].
    pub fn covariance_root(&self) -> Option<SMatrix<f64, N, N>> {
        let mut inverse = SMatrix::<f64, N, N>::zeros();
        for j in 1..N {
            inverse[(j, j)] = 1.0 / self.root[j][j];
            for i in (1..j).rev() {
                let sum: f64 = (i + 1..=j).map(|k| self.root[i][k] * inverse[(k, j)]).sum();
                inverse[(i, j)] = -sum / self.root[i][i];
            }
        }
        inverse.iter().all(|entry| entry.is_finite()).then_some(inverse)
    }
}

fn scale_row<const N: usize>(row: &mut [f64; N], target: &mut f64, scale: f64) {
    for entry in row {
        *entry *= scale;
    }
    *target *= scale;
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use rand::{RngExt, SeedableRng};

    type Filter = DriftingLevel<3>;

    fn rows(seed: u64, count: usize) -> Vec<(SVector<f64, 3>, f64)> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        (0..count)
            .map(|_| {
                let mut uniform = || 2.0 * random.random::<f64>() - 1.0;
                (SVector::from([1.0, uniform(), uniform()]), uniform())
            })
            .collect()
    }

    /// Weighted least squares with every level an unknown of its own, from the normal equations.
    fn batch_twin(rows: &[(SVector<f64, 3>, f64)], steps: &[f64]) -> (DMatrix<f64>, DMatrix<f64>) {
        let levels = rows.len();
        let size = levels + 2;
        let mut normal = DMatrix::zeros(size, size);
        let mut moment = DMatrix::zeros(size, 1);
        let mut add = |entries: &[(usize, f64)], value: f64, weight: f64| {
            for &(i, a) in entries {
                moment[(i, 0)] += weight * a * value;
                for &(j, b) in entries {
                    normal[(i, j)] += weight * a * b;
                }
            }
        };
        for (k, (row, value)) in rows.iter().enumerate() {
            add(&[(k, 1.0), (levels, row[1]), (levels + 1, row[2])], *value, 1.0);
            if k > 0 {
                add(&[(k, 1.0), (k - 1, -1.0)], 0.0, 1.0 / steps[k]);
            }
        }
        add(&[(levels, 1.0)], 0.5, 1.0 / 9.0);
        add(&[(levels + 1, 1.0)], -0.5, 1.0 / 4.0);
        let inverse = normal.cholesky().expect("positive definite").inverse();
        (&inverse * moment, inverse)
    }

    #[test]
    fn the_recursion_equals_least_squares_with_every_level_an_unknown() {
        let rows = rows(5, 40);
        let steps: Vec<f64> = (0..rows.len()).map(|k| 0.01 + 0.3 * (k % 3) as f64).collect();
        let prior = (SVector::from([0.0, 0.5, -0.5]), SVector::from([0.0, 3.0, 2.0]));
        let mut filter = Filter::new(&prior.0, &prior.1);
        for (k, (row, value)) in rows.iter().enumerate() {
            filter.drift_level(steps[k]);
            filter.absorb(row, *value, 1.0);
        }
        let (solution, covariance) = batch_twin(&rows, &steps);
        let own = filter.solve().unwrap();
        let root = filter.covariance_root().unwrap();
        let own_covariance = root * root.transpose();
        let last = rows.len() - 1;
        assert!((own[LEVEL] - solution[last]).abs() < 1e-10);
        for i in 0..2 {
            assert!((own[1 + i] - solution[rows.len() + i]).abs() < 1e-10);
            for j in 0..2 {
                let expected = covariance[(rows.len() + i, rows.len() + j)];
                assert!((own_covariance[(1 + i, 1 + j)] - expected).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn the_innovation_is_the_residual_over_its_predicted_deviation() {
        let rows = rows(6, 12);
        let mut filter = Filter::new(&SVector::from([0.0, 0.0, 0.0]), &SVector::from([0.0, 3.0, 2.0]));
        assert_eq!(filter.absorb(&rows[0].0, rows[0].1, 1.0).normalised, None, "level was free");
        for (row, value) in &rows[1..] {
            let before = filter.solve().unwrap();
            let with_level = {
                let mut inverse = SMatrix::<f64, 3, 3>::zeros();
                for i in 0..3 {
                    for j in 0..3 {
                        inverse[(i, j)] = filter.root[i][j];
                    }
                }
                inverse.try_inverse().unwrap()
            };
            let variance = 1.0 + (with_level.transpose() * row).norm_squared();
            let innovation = filter.absorb(row, *value, 1.0);
            let expected = (value - row.dot(&before)) / variance.sqrt();
            assert!((innovation.normalised.unwrap() - expected).abs() < 1e-10);
            assert!((innovation.log_variance_ratio - variance.ln()).abs() < 1e-10);
        }
    }

    #[test]
    fn widening_adds_to_the_first_parameters_variance_and_to_nothing_else() {
        let mut filter = Filter::new(&SVector::from([0.0, 0.0, 0.0]), &SVector::from([0.0, 3.0, 2.0]));
        for (row, value) in rows(7, 30) {
            filter.absorb(&row, value, 1.0);
        }
        let (mean, root) = (filter.solve().unwrap(), filter.covariance_root().unwrap());
        let before = root * root.transpose();
        filter.widen_first_parameter(0.7);
        let (wide_mean, wide_root) = (filter.solve().unwrap(), filter.covariance_root().unwrap());
        let after = wide_root * wide_root.transpose();
        assert!((wide_mean[1] - mean[1]).abs() < 1e-12 && (wide_mean[2] - mean[2]).abs() < 1e-12);
        assert!((after[(1, 1)] - before[(1, 1)] - 0.7).abs() < 1e-10);
        assert!((after[(2, 2)] - before[(2, 2)]).abs() < 1e-12);
        assert!((after[(1, 2)] - before[(1, 2)]).abs() < 1e-12);
    }

    #[test]
    fn an_undetermined_parameter_has_no_solution() {
        let infinite = SVector::from([0.0, f64::INFINITY, 1.0]);
        let filter = Filter::new(&SVector::zeros(), &infinite);
        assert_eq!(filter.solve(), None);
        assert_eq!(filter.covariance_root(), None);
    }
}
