//! Correlated rows turned into independent ones of unit variance, and least squares over these in square-root
//! information form.

use nalgebra::{SMatrix, SVector};

use super::NotPositiveDefinite;
use super::covariance::{measured, moved};
use super::triangular::TriangularSystem;

/// How the hidden states move to the next row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Propagation<const S: usize, const C: usize> {
    /// x' = transition x + input + noise.
    pub transition: SMatrix<f64, S, S>,
    /// Known input, by column.
    pub input: SMatrix<f64, S, C>,
    /// Covariance of the noise.
    pub noise: SMatrix<f64, S, S>,
}

/// Observation of the hidden states by a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting<const S: usize, const C: usize> {
    /// observed = direction . x + noise.
    pub direction: SVector<f64, S>,
    /// The observed value, by column.
    pub observed: SVector<f64, C>,
    /// Variance of the noise.
    pub variance: f64,
}

/// The innovation of a sighting, scaled to unit variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitRow<const C: usize> {
    /// The innovation by column, of unit variance.
    pub columns: SVector<f64, C>,
    /// Variance of the innovation before it was scaled.
    pub variance: f64,
}

/// A Kalman filter whose states are affine in unknown parameters: the generalised least squares
/// of a regression with correlated errors (Rosenberg 1973; de Jong 1991).
///
/// Column 0 holds the known part, columns 1 to C - 1 the amounts that one unit of each parameter subtracts from it: a
/// state is `x0 - x1 theta1 - x2 theta2 ...`. The gains do not depend on the parameters, so all columns run through one
/// filter, and its innovations are rows `y = phi . theta + error` with independent errors of unit variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whitener<const S: usize, const C: usize> {
    /// The states by column.
    pub state: SMatrix<f64, S, C>,
    /// The states' covariance, for known parameters.
    pub covariance: SMatrix<f64, S, S>,
}

impl<const S: usize, const C: usize> Whitener<S, C> {
    /// Starts at known states with their covariance.
    pub fn new(state: SMatrix<f64, S, C>, covariance: SMatrix<f64, S, S>) -> Self {
        Whitener { state, covariance }
    }

    /// Moves the states to the next row.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn propagate(&mut self, step: &Propagation<S, C>) {
        self.state = step.transition * self.state + step.input;
        self.covariance = moved(&step.transition, &self.covariance, &step.noise);
    }

    /// Adds variance to state `i`: it may have jumped.
    ///
    /// # Panics
    ///
    /// When there is no state `i`.
    pub fn loosen(&mut self, i: usize, variance: f64) {
        self.covariance[(i, i)] += variance;
    }

    /// Forgets the effect of parameter `column` on the states, so that another parameter can take its place.
    ///
    /// # Panics
    ///
    /// When there is no such column.
    pub fn clear_column(&mut self, column: usize) {
        self.state.column_mut(column).fill(0.0);
    }

    /// Returns the news of an observation as a row with an error of unit variance; `None` when its variance is not
    /// positive and finite.
    pub fn row(&self, sighting: &Sighting<S, C>) -> Option<UnitRow<C>> {
        let variance = sighting.direction.dot(&self.spread(sighting)) + sighting.variance;
        let is_sound = variance > 0.0 && variance.is_finite();
        is_sound.then(|| UnitRow { columns: self.innovation(sighting) / variance.sqrt(), variance })
    }

    /// Takes a sighting into the states, whose covariance stays symmetric and positive; gives its row.
    ///
    /// # Errors
    ///
    /// When the innovation's variance is not positive and finite; the states are left alone.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn take(&mut self, sighting: &Sighting<S, C>) -> Result<UnitRow<C>, NotPositiveDefinite> {
        let Sighting { direction, variance: noise_variance, .. } = sighting;
        let spread = self.spread(sighting);
        let variance = direction.dot(&spread) + noise_variance;
        if !(variance > 0.0 && variance.is_finite()) {
            return Err(NotPositiveDefinite);
        }
        let innovation = self.innovation(sighting);
        let inverse_variance = 1.0 / variance;
        self.state += spread * innovation.transpose() * inverse_variance;
        measured(&mut self.covariance, direction, &spread, inverse_variance, *noise_variance);
        Ok(UnitRow { columns: innovation / variance.sqrt(), variance })
    }

    fn innovation(&self, sighting: &Sighting<S, C>) -> SVector<f64, C> {
        sighting.observed - self.state.transpose() * sighting.direction
    }

    fn spread(&self, sighting: &Sighting<S, C>) -> SVector<f64, S> {
        self.covariance * sighting.direction
    }
}

/// All rows seen so far, condensed into a triangular system, and the sum of their squared residuals.
///
/// The system's square plus the residual sum equals the sum of squares over all rows, so that the
/// solution is the batch solution at any time (Bierman 1977, chapter IV). Rows enter by Givens
/// rotations; the normal equations and their squared condition are never formed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquareRootInformation<const N: usize> {
    system: TriangularSystem<N>,
    residual_sum: f64,
    count: f64,
}

impl<const N: usize> SquareRootInformation<N> {
    /// Returns the information before any row: only the penalty `sum of weight * (theta - prior)^2`. A weight of 0 is
    /// no penalty.
    pub fn new(weights: &SVector<f64, N>, prior: &SVector<f64, N>) -> Self {
        let roots = weights.map(|weight| weight.max(0.0).sqrt());
        let system = TriangularSystem {
            factor: SMatrix::from_diagonal(&roots),
            residual: -roots.component_mul(prior),
        };
        SquareRootInformation { system, residual_sum: 0.0, count: 0.0 }
    }

    /// Takes in a row `observed = features . theta + error`, the error of unit variance.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn update(&mut self, features: &SVector<f64, N>, observed: f64) {
        let rest = self.system.append(*features, -observed);
        self.residual_sum += rest * rest;
        self.count += 1.0;
    }

    /// Adds the penalty `sum of weight * theta^2`, which counts neither as rows nor as residual.
    pub fn add_penalty(&mut self, weights: &SVector<f64, N>) {
        for i in (0..N).filter(|&i| weights[i] > 0.0) {
            let mut unit = SVector::zeros();
            unit[i] = weights[i].sqrt();
            self.system.append(unit, 0.0);
        }
    }

    /// Adds knowledge from another source, as a row of unit variance that counts neither as a row nor in the residuals.
    pub fn add_knowledge(&mut self, features: &SVector<f64, N>, observed: f64) {
        self.system.append(*features, -observed);
    }

    /// Multiplies the weight of everything seen so far, penalty included, by `factor`.
    pub fn forget(&mut self, factor: f64) {
        if factor == 1.0 {
            return;
        }
        let root = factor.sqrt();
        self.system.factor *= root;
        self.system.residual *= root;
        self.residual_sum *= factor;
        self.count *= factor;
    }

    /// Returns the minimiser of the weighted sum of squares.
    ///
    /// # Errors
    ///
    /// When the rows do not determine all parameters.
    pub fn solve(&self) -> Result<SVector<f64, N>, NotPositiveDefinite> {
        self.system.minimiser().ok_or(NotPositiveDefinite)
    }

    /// Returns the covariance of the solution for errors of unit variance.
    ///
    /// # Errors
    ///
    /// When the rows do not determine all parameters.
    pub fn covariance(&self) -> Result<SMatrix<f64, N, N>, NotPositiveDefinite> {
        self.system.covariance().ok_or(NotPositiveDefinite)
    }

    /// The information matrix: the sum of features outer products, penalty included.
    #[cfg(test)]
    pub fn information(&self) -> SMatrix<f64, N, N> {
        self.system.factor.tr_mul(&self.system.factor)
    }

    /// Returns the logarithm of the information matrix's determinant; negative infinity while singular.
    pub fn log_determinant(&self) -> f64 {
        2.0 * (0..N).map(|i| self.system.factor[(i, i)].abs().ln()).sum::<f64>()
    }

    /// Returns the sum of squared residuals of the solution, penalty included.
    pub fn residual_sum(&self) -> f64 {
        self.residual_sum
    }

    /// Returns the number of rows seen, the forgotten ones in part.
    pub fn count(&self) -> f64 {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::SquareRootInformation;
    use nalgebra::{DMatrix, DVector, Matrix1, SVector, Vector1, Vector3};
    use rand::{RngExt, SeedableRng};

    /// A walk that is seen with noise: v_k = v_0 - theta phi_k + walk, observed with error.
    #[test]
    fn its_rows_give_the_generalised_least_squares_of_the_dense_covariance() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let (count, walk, noise) = (30, 0.04, 0.3);
        let inputs: Vec<[f64; 3]> =
            (0..count).map(|_| [random.random(), random.random(), random.random()]).collect();
        let seen: Vec<f64> = (0..count).map(|_| 3.0 * random.random::<f64>()).collect();

        let start = SMatrix::<f64, 1, 3>::new(seen[0], 0.0, 0.0);
        let mut whitener = Whitener::<1, 3>::new(start, Matrix1::new(noise));
        let mut information = SquareRootInformation::<2>::new(&SVector::zeros(), &SVector::zeros());
        for k in 1..count {
            whitener.propagate(&Propagation {
                transition: Matrix1::new(1.0),
                input: SMatrix::from_row_slice(&inputs[k]),
                noise: Matrix1::new(walk),
            });
            let sighting = Sighting {
                direction: Vector1::new(1.0),
                observed: Vector3::new(seen[k], 0.0, 0.0),
                variance: noise,
            };
            let seen = whitener.row(&sighting).unwrap();
            assert_eq!(whitener.take(&sighting), Ok(seen));
            let row = seen.columns;
            information.update(&SVector::<f64, 2>::new(row[1], row[2]), row[0]);
        }

        // Differences of neighbours: covariance walk + 2 noise on the diagonal, -noise next to it.
        let rows = count - 1;
        let covariance = DMatrix::from_fn(rows, rows, |i, j| match i.abs_diff(j) {
            0 => walk + 2.0 * noise,
            1 => -noise,
            _ => 0.0,
        });
        let x = DMatrix::from_fn(rows, 2, |i, j| -inputs[i + 1][j + 1]);
        let y = DVector::from_fn(rows, |i, _| seen[i + 1] - seen[i] - inputs[i + 1][0]);
        let weight = covariance.try_inverse().unwrap();
        let normal = x.transpose() * &weight * &x;
        let dense = normal.clone().try_inverse().unwrap() * x.transpose() * weight * y;
        let estimate = information.solve().unwrap();
        for i in 0..2 {
            assert!((estimate[i] - dense[i]).abs() < 1e-9);
        }
        assert!((information.information()[(0, 1)] - normal[(0, 1)]).abs() < 1e-9);
    }

    #[test]
    fn a_sighting_without_variance_is_an_error() {
        let mut whitener = Whitener::<1, 2>::new(SMatrix::zeros(), Matrix1::new(0.0));
        let sighting = Sighting {
            direction: Vector1::new(1.0),
            observed: SVector::<f64, 2>::zeros(),
            variance: 0.0,
        };
        assert_eq!(whitener.row(&sighting), None);
        assert_eq!(whitener.take(&sighting), Err(NotPositiveDefinite));
    }
}

#[cfg(test)]
mod information_tests {
    use super::*;
    use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
    use rand::{RngExt, SeedableRng};

    fn rows(count: usize) -> Vec<(Vector3<f64>, f64)> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        (0..count)
            .map(|_| {
                let x = 3.0 * random.random::<f64>();
                let row = Vector3::new(1.0, x, x * x);
                (row, row.dot(&Vector3::new(2.0, -0.3, 0.7)) + random.random::<f64>() - 0.5)
            })
            .collect()
    }

    #[test]
    fn rotations_give_the_batch_solution_and_its_residual_sum() {
        let rows = rows(40);
        let mut recursive = SquareRootInformation::<3>::new(&Vector3::zeros(), &Vector3::zeros());
        for (features, observed) in &rows {
            recursive.update(features, *observed);
        }
        let a = DMatrix::from_fn(40, 3, |i, j| rows[i].0[j]);
        let b = DVector::from_fn(40, |i, _| rows[i].1);
        let normal = (a.transpose() * &a).cholesky().unwrap();
        let batch = normal.solve(&(a.transpose() * &b));
        let estimate = recursive.solve().unwrap();
        for i in 0..3 {
            assert!((estimate[i] - batch[i]).abs() < 1e-10);
        }
        assert!((recursive.residual_sum() - (b - &a * batch).norm_squared()).abs() < 1e-10);
        let inverse = normal.inverse();
        let covariance = recursive.covariance().unwrap();
        assert!((0..9).all(|k| (covariance[k] - inverse[k]).abs() < 1e-10));
        assert!((recursive.log_determinant() - normal.determinant().ln()).abs() < 1e-10);
    }

    #[test]
    fn a_penalty_equals_rows_that_observe_the_prior() {
        let prior = Vector3::new(1.0, 0.5, 0.0);
        let mut penalised = SquareRootInformation::<3>::new(&Vector3::repeat(0.3), &prior);
        let mut by_rows = SquareRootInformation::<3>::new(&Vector3::zeros(), &Vector3::zeros());
        for i in 0..3 {
            let mut unit = Vector3::zeros();
            unit[i] = 0.3_f64.sqrt();
            by_rows.update(&unit, unit.dot(&prior));
        }
        let mut added = SquareRootInformation::<3>::new(&Vector3::zeros(), &Vector3::zeros());
        added.add_penalty(&Vector3::repeat(0.3));
        assert_eq!((added.count(), added.residual_sum()), (0.0, 0.0));
        assert!((added.information() - Matrix3::identity() * 0.3).norm() < 1e-15);
        for (features, observed) in rows(5) {
            penalised.update(&features, observed);
            by_rows.update(&features, observed);
        }
        let difference = penalised.solve().unwrap() - by_rows.solve().unwrap();
        assert!(difference.norm() < 1e-12);
    }

    #[test]
    fn forgetting_equals_rows_of_less_weight() {
        let rows = rows(20);
        let mut forgetting = SquareRootInformation::<3>::new(&Vector3::zeros(), &Vector3::zeros());
        let mut weighted = SquareRootInformation::<3>::new(&Vector3::zeros(), &Vector3::zeros());
        for (age, (features, observed)) in rows.iter().enumerate() {
            forgetting.forget(0.9);
            forgetting.update(features, *observed);
            let root = 0.9_f64.powi(19 - age as i32).sqrt();
            weighted.update(&(features * root), observed * root);
        }
        let difference = forgetting.solve().unwrap() - weighted.solve().unwrap();
        assert!(difference.norm() < 1e-10);
        assert!((forgetting.count() - 10.0 * (1.0 - 0.9_f64.powi(20))).abs() < 1e-9);
    }

    #[test]
    fn undetermined_parameters_are_an_error() {
        let mut information = SquareRootInformation::<3>::new(&Vector3::zeros(), &Vector3::zeros());
        information.update(&Vector3::new(1.0, 2.0, 4.0), 3.0);
        assert_eq!(information.solve(), Err(NotPositiveDefinite));
        assert_eq!(information.covariance(), Err(NotPositiveDefinite));
    }
}
