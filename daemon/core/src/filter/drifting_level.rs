//! Least squares jointly with a level that may drift.
//!
//! ```text
//! y_k       = level_k + x_k · theta + e_k
//! level_k+1 = level_k + gain_k bias_k + n_k
//! bias_k+1  = keep_k bias_k + w_k
//! ```
//!
//! Integral regression of motion has this form: the level is the speed that the integrals do not explain, the bias an
//! acceleration that no parameter explains, and theta is constant. The unknowns are stored as square-root information,
//! `R [level; bias; theta] = z + nu` with `R` upper triangular and `nu` of unit covariance (Bierman 1977, chapters V
//! and VII). The level and the bias come first, so that a time step touches only two rows, and forgetting them drops
//! rows, which marginalises them exactly.

use nalgebra::{SMatrix, SVector};

/// Index of the level among the unknowns.
pub const LEVEL: usize = 0;
/// Index of the bias among the unknowns.
pub const BIAS: usize = 1;
/// Index of the first parameter.
pub const PARAMETERS: usize = 2;

/// Innovation of a measurement, as computed when it was absorbed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelInnovation {
    /// Measured minus predicted over its predicted standard deviation; `None` where the measurement only determined a
    /// state that was free before.
    pub normalised: Option<f64>,
    /// Logarithm of the predicted variance over the measurement's own variance.
    pub log_variance_ratio: f64,
}

/// A time step of level and bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriftStep {
    /// Gain of the level from a unit of bias.
    pub gain: f64,
    /// Share of the bias that stays, above 0.
    pub keep: f64,
    /// Variance of the noise added to the bias.
    pub noise_variance: f64,
    /// Variance of the noise added to the level itself.
    pub level_noise_variance: f64,
}

/// Square-root information of a level, its bias and N - 2 parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct DriftingLevel<const N: usize> {
    /// Upper triangle, rows first; the diagonal is never negative.
    root: [[f64; N]; N],
    target: [f64; N],
}

impl<const N: usize> DriftingLevel<N> {
    /// Independent prior knowledge of bias and parameters; the level is free.
    ///
    /// Entry [`LEVEL`] of both arguments is not used; standard deviations are above 0.
    pub fn new(mean: &SVector<f64, N>, std: &SVector<f64, N>) -> Self {
        let mut filter = DriftingLevel { root: [[0.0; N]; N], target: [0.0; N] };
        for i in BIAS..N {
            filter.root[i][i] = 1.0 / std[i];
            filter.target[i] = mean[i] / std[i];
        }
        filter
    }

    /// Forgets the level, as after a gap; the knowledge that it gave of bias and parameters stays.
    pub fn free_level(&mut self) {
        self.root[LEVEL] = [0.0; N];
        self.target[LEVEL] = 0.0;
    }

    /// Forgets level and bias; the bias is then 0 with a standard deviation.
    pub fn restart_bias(&mut self, std: f64) {
        self.free_level();
        self.root[BIAS] = [0.0; N];
        self.root[BIAS][BIAS] = 1.0 / std;
        self.target[BIAS] = 0.0;
    }

    /// Lets the first parameter take a random step of a variance, and restarts the bias.
    ///
    /// Level and bias have to go first: their rows tie the parameter's old value to them.
    pub fn widen_first_parameter(&mut self, variance: f64, bias_std: f64) {
        self.restart_bias(bias_std);
        let root = self.root[PARAMETERS][PARAMETERS];
        let scale = 1.0 / (1.0 + variance * root * root).sqrt();
        self.scale_row(PARAMETERS, scale);
    }

    /// Moves level and bias on by one step of time.
    pub fn propagate(&mut self, step: &DriftStep) {
        let old_level = self.root[LEVEL][LEVEL];
        self.root[LEVEL][BIAS] = (self.root[LEVEL][BIAS] - step.gain * old_level) / step.keep;
        self.root[BIAS][BIAS] /= step.keep;
        if step.noise_variance > 0.0 {
            self.admit_bias_noise(step.noise_variance);
        }
        if step.level_noise_variance > 0.0 {
            // Only the first row holds the level: its equation grows less certain by that much.
            let root = self.root[LEVEL][LEVEL];
            let scale = 1.0 / (1.0 + step.level_noise_variance * root * root).sqrt();
            self.scale_row(LEVEL, scale);
        }
    }

    fn scale_row(&mut self, row: usize, scale: f64) {
        for entry in &mut self.root[row] {
            *entry *= scale;
        }
        self.target[row] *= scale;
    }

    fn admit_bias_noise(&mut self, variance: f64) {
        // The noise w is an unknown of its own, known to be 0 with its variance. Two rotations
        // take it out of both rows; the row left over only depends on w and is dropped.
        let mut noise = [0.0; N];
        let mut noise_target = 0.0;
        let mut noise_root = 1.0 / variance.sqrt();
        for i in [BIAS, LEVEL] {
            let own = -self.root[i][BIAS];
            let length = (noise_root * noise_root + own * own).sqrt();
            let (cosine, sine) = (noise_root / length, own / length);
            noise_root = length;
            rotate(cosine, sine, &mut noise, &mut self.root[i]);
            let target = self.target[i];
            self.target[i] = cosine * target - sine * noise_target;
            noise_target = cosine * noise_target + sine * target;
        }
    }

    /// Absorbs `value = level + parameters · theta + e`, the variance of e being 1 / `weight`.
    ///
    /// `row` is 1 at the level, 0 at the bias. By Givens rotations; the rest of the value
    /// after them is the normalised innovation.
    ///
    /// # Real-time
    ///
    /// N rotations, no allocation.
    pub fn absorb(&mut self, row: &SVector<f64, N>, value: f64, weight: f64) -> LevelInnovation {
        let root_weight = weight.sqrt();
        let mut rest: [f64; N] = std::array::from_fn(|i| row[i] * root_weight);
        let mut rest_value = value * root_weight;
        let (mut cosines, mut is_free) = (1.0, false);
        for i in 0..N {
            if rest[i] == 0.0 {
                continue;
            }
            let before = self.root[i][i];
            let after = (before * before + rest[i] * rest[i]).sqrt();
            let (cosine, sine) = (before / after, rest[i] / after);
            rotate(cosine, sine, &mut self.root[i][i..], &mut rest[i..]);
            let own = self.target[i];
            self.target[i] = cosine * own + sine * rest_value;
            rest_value = cosine * rest_value - sine * own;
            if before > 0.0 {
                cosines *= cosine;
            } else {
                is_free = true;
            }
        }
        let normalised = if is_free { None } else { Some(rest_value) };
        LevelInnovation { normalised, log_variance_ratio: -2.0 * cosines.ln() }
    }

    /// Level, bias and parameters; the level is 0 while it is free.
    ///
    /// `None` when a number is not determined or not finite.
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

    /// Returns the square root S of the covariance S Sᵀ of bias and parameters.
    ///
    /// Row and column [`LEVEL`] are 0. `None` as for [`DriftingLevel::solve`].
    pub fn covariance_root(&self) -> Option<SMatrix<f64, N, N>> {
        let mut inverse = SMatrix::<f64, N, N>::zeros();
        for j in BIAS..N {
            inverse[(j, j)] = 1.0 / self.root[j][j];
            for i in (BIAS..j).rev() {
                let sum: f64 = (i + 1..=j).map(|k| self.root[i][k] * inverse[(k, j)]).sum();
                inverse[(i, j)] = -sum / self.root[i][i];
            }
        }
        inverse.iter().all(|entry| entry.is_finite()).then_some(inverse)
    }
}

fn rotate(cosine: f64, sine: f64, upper: &mut [f64], lower: &mut [f64]) {
    for (one, other) in upper.iter_mut().zip(lower) {
        (*one, *other) = (cosine * *one + sine * *other, cosine * *other - sine * *one);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, Matrix4, Vector4};
    use rand::{RngExt, SeedableRng};

    type Filter = DriftingLevel<4>;

    const MEAN: Vector4<f64> = Vector4::new(0.0, 0.0, 0.5, -0.5);
    const STD: Vector4<f64> = Vector4::new(0.0, 0.8, 3.0, 2.0);

    fn rows(seed: u64, count: usize) -> Vec<(Vector4<f64>, f64)> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        (0..count)
            .map(|_| {
                let mut uniform = || 2.0 * random.random::<f64>() - 1.0;
                (Vector4::new(1.0, 0.0, uniform(), uniform()), uniform())
            })
            .collect()
    }

    fn step(k: usize) -> DriftStep {
        let noise_variance = [0.0, 0.02, 0.1][k % 3];
        let level_noise_variance = [0.0, 0.0, 0.03, 0.2][k % 4];
        DriftStep {
            gain: 0.1 + 0.05 * (k % 4) as f64,
            keep: 0.9,
            noise_variance,
            level_noise_variance,
        }
    }

    /// Weighted least squares with the level and the bias of every instant unknowns of their
    /// own, from the normal equations; the level's first value and every theta at the end.
    fn batch_twin(rows: &[(Vector4<f64>, f64)]) -> (DMatrix<f64>, DMatrix<f64>) {
        let count = rows.len();
        let size = 2 * count + 2;
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
        let theta = 2 * count;
        for (k, (row, value)) in rows.iter().enumerate() {
            add(&[(2 * k, 1.0), (theta, row[2]), (theta + 1, row[3])], *value, 1.0);
            if k > 0 {
                let (level, bias) = (2 * k, 2 * k + 1);
                let DriftStep { gain, keep, noise_variance, level_noise_variance } = step(k);
                // Exact relations as very heavy ones.
                let weight = |variance: f64| if variance > 0.0 { 1.0 / variance } else { 1e9 };
                let level_weight = weight(level_noise_variance);
                add(&[(level, 1.0), (level - 2, -1.0), (bias - 2, -gain)], 0.0, level_weight);
                add(&[(bias, 1.0), (bias - 2, -keep)], 0.0, weight(noise_variance));
            }
        }
        for (at, i) in [(1, BIAS), (theta, 2), (theta + 1, 3)] {
            add(&[(at, 1.0)], MEAN[i], 1.0 / (STD[i] * STD[i]));
        }
        let inverse = normal.cholesky().expect("positive definite").inverse();
        (&inverse * moment, inverse)
    }

    #[test]
    fn the_recursion_equals_least_squares_with_every_level_and_bias_an_unknown() {
        let rows = rows(5, 30);
        let mut filter = Filter::new(&MEAN, &STD);
        for (k, (row, value)) in rows.iter().enumerate() {
            if k > 0 {
                filter.propagate(&step(k));
            }
            filter.absorb(row, *value, 1.0);
        }
        let (solution, covariance) = batch_twin(&rows);
        let own = filter.solve().unwrap();
        let root = filter.covariance_root().unwrap();
        let own_covariance = root * root.transpose();
        let first = 2 * rows.len() - 2;
        for i in 0..4 {
            assert!((own[i] - solution[first + i]).abs() < 1e-5, "unknown {i}");
            for j in BIAS..4 {
                if i >= BIAS {
                    let expected = covariance[(first + i, first + j)];
                    assert!((own_covariance[(i, j)] - expected).abs() < 1e-5);
                }
            }
        }
    }

    #[test]
    fn the_innovation_is_the_residual_over_its_predicted_deviation() {
        let rows = rows(6, 12);
        let mut filter = Filter::new(&MEAN, &STD);
        assert_eq!(filter.absorb(&rows[0].0, rows[0].1, 1.0).normalised, None, "level was free");
        for (k, (row, value)) in rows.iter().enumerate().skip(1) {
            filter.propagate(&step(k));
            let before = filter.solve().unwrap();
            let root = Matrix4::from_fn(|i, j| filter.root[i][j]);
            let variance = 1.0 + (root.try_inverse().unwrap().transpose() * row).norm_squared();
            let innovation = filter.absorb(row, *value, 1.0);
            let expected = (value - row.dot(&before)) / variance.sqrt();
            assert!((innovation.normalised.unwrap() - expected).abs() < 1e-10);
            assert!((innovation.log_variance_ratio - variance.ln()).abs() < 1e-10);
        }
    }

    #[test]
    fn widening_adds_to_the_first_parameters_variance_and_to_nothing_else() {
        let mut filter = Filter::new(&MEAN, &STD);
        for (k, (row, value)) in rows(7, 30).iter().enumerate() {
            filter.propagate(&step(k));
            filter.absorb(row, *value, 1.0);
        }
        let (mean, root) = (filter.solve().unwrap(), filter.covariance_root().unwrap());
        let before = root * root.transpose();
        filter.widen_first_parameter(0.7, 0.8);
        let (wide_mean, wide_root) = (filter.solve().unwrap(), filter.covariance_root().unwrap());
        let after = wide_root * wide_root.transpose();
        assert!((wide_mean - mean).rows(2, 2).norm() < 1e-12);
        assert!((after[(2, 2)] - before[(2, 2)] - 0.7).abs() < 1e-10);
        assert!((after[(3, 3)] - before[(3, 3)]).abs() < 1e-12);
        assert!((after[(2, 3)] - before[(2, 3)]).abs() < 1e-12);
        assert!((after[(1, 1)] - 0.64).abs() < 1e-12);
    }

    #[test]
    fn an_undetermined_parameter_has_no_solution() {
        let filter = Filter::new(&MEAN, &Vector4::new(0.0, 1.0, f64::INFINITY, 1.0));
        assert_eq!(filter.solve(), None);
        assert_eq!(filter.covariance_root(), None);
    }
}
