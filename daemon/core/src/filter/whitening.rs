//! Turning correlated rows into independent ones of unit variance.

use nalgebra::{SMatrix, SVector};

use super::NotPositiveDefinite;
use super::rank_one::{measured, moved};

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
