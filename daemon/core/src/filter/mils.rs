//! Multi-innovation least squares, with regularisation.

use nalgebra::{SMatrix, SVector};

use super::{Gaussian, Innovation, NotPositiveDefinite};

/// How a criterion `sum of lambda/2 theta^2` enters a recursion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penalty<const N: usize> {
    /// lambda of each parameter; one for all in Liu 2018.
    pub lambda: SVector<f64, N>,
    /// N, the updates over which the criterion's lambda/2 is spread.
    pub length: u32,
    /// True for Liu 2018, eq. 12-16, as printed: lambda/N at every update, for ever. That is
    /// twice the criterion's weight at N updates, and grows beyond.
    pub is_printed: bool,
}

impl<const N: usize> Penalty<N> {
    /// No regularisation.
    pub fn none() -> Self {
        Penalty { lambda: SVector::zeros(), length: 1, is_printed: false }
    }

    /// Returns the weight that update number `index`, counted from 0, adds to each square.
    fn weights_at(&self, index: u64) -> Option<SVector<f64, N>> {
        let length = f64::from(self.length.max(1));
        match self.is_printed {
            true => Some(self.lambda / length),
            false => (index < u64::from(self.length)).then(|| self.lambda * (0.5 / length)),
        }
    }
}

/// Regularised multi-innovation least squares (Liu 2018, section 3) with an innovation length
/// of up to `L`; length 1 is regularised RLS (eq. 12-16).
///
/// An update stacks the newest `length` rows, all with the innovation of the estimate before.
/// That is the same as taking them one after the other, and the regularisation the same as rows
/// that observe 0: lambda = 0 allowed (the printed eq. 14 divides by it), P symmetric and positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mils<const N: usize, const L: usize> {
    belief: Gaussian<N>,
    penalty: Penalty<N>,
    /// The newest rows; `next` is where the oldest will be overwritten.
    features: [SVector<f64, N>; L],
    observed: [f64; L],
    length: usize,
    next: usize,
    held: usize,
    updates: u64,
}

impl<const N: usize, const L: usize> Mils<N, L> {
    /// Starts at `estimate` with the diagonal of P, p0 for all of it in Liu 2018; `length` is
    /// p, cut to 1 to L.
    pub fn new(
        estimate: SVector<f64, N>,
        start: &SVector<f64, N>,
        length: usize,
        penalty: Penalty<N>,
    ) -> Self {
        const { assert!(L > 0) };
        Mils {
            belief: Gaussian { mean: estimate, covariance: SMatrix::from_diagonal(start) },
            penalty,
            features: [SVector::zeros(); L],
            observed: [0.0; L],
            length: length.clamp(1, L),
            next: 0,
            held: 0,
            updates: 0,
        }
    }

    /// Returns the estimate.
    pub fn estimate(&self) -> &SVector<f64, N> {
        &self.belief.mean
    }

    /// Returns the estimate's covariance in units of the error's variance: p P.
    ///
    /// Exact without regularisation, since every row entered p times. With regularisation, it is the posterior
    /// covariance for a prior of weight lambda/p, since the repetition divides lambda by p.
    pub fn covariance(&self) -> SMatrix<f64, N, N> {
        self.belief.covariance * self.length as f64
    }

    /// Goes on from another estimate and covariance (not P), in which the criterion's
    /// regularisation is complete; the remembered rows are dropped.
    pub fn restart(&mut self, estimate: SVector<f64, N>, covariance: SMatrix<f64, N, N>) {
        self.belief = Gaussian { mean: estimate, covariance: covariance / self.length as f64 };
        self.updates = self.updates.max(u64::from(self.penalty.length));
        self.forget_rows();
    }

    /// Takes in a row and updates with the newest p rows; fewer while fewer have come.
    ///
    /// # Errors
    ///
    /// When P is no longer positive definite; the estimate is then left alone.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    #[inline]
    pub fn update(
        &mut self,
        features: &SVector<f64, N>,
        observed: f64,
    ) -> Result<Innovation, NotPositiveDefinite> {
        self.remember(features, observed);
        self.update_from_memory()
    }

    /// Keeps a row for the next update without updating.
    #[inline]
    pub fn remember(&mut self, features: &SVector<f64, N>, observed: f64) {
        self.features[self.next] = *features;
        self.observed[self.next] = observed;
        self.next = self.index_after(self.next);
        self.held = (self.held + 1).min(self.length);
    }

    /// Drops the remembered rows, so that no update reaches back past this point.
    pub fn forget_rows(&mut self) {
        (self.next, self.held) = (0, 0);
    }

    fn index_after(&self, index: usize) -> usize {
        if index + 1 < self.length { index + 1 } else { 0 }
    }

    fn index_before(&self, index: usize) -> usize {
        index.checked_sub(1).unwrap_or(self.length - 1)
    }

    /// Updates with the remembered rows; gives the newest row's innovation.
    ///
    /// # Errors
    ///
    /// When P is no longer positive definite, or no row is remembered.
    #[inline]
    pub fn update_from_memory(&mut self) -> Result<Innovation, NotPositiveDefinite> {
        if self.held == 0 {
            return Err(NotPositiveDefinite);
        }
        // A copy, which stays in registers where `self` may not.
        let mut belief = match self.penalty.weights_at(self.updates) {
            Some(weights) => drawn_to_zero(self.belief, &weights)?,
            None => self.belief,
        };
        let newest = self.index_before(self.next);
        let innovation =
            belief.measure_along(&self.features[newest], self.observed[newest], 1.0)?;
        let mut index = newest;
        for _ in 1..self.held {
            index = self.index_before(index);
            belief.measure_along(&self.features[index], self.observed[index], 1.0)?;
        }
        self.belief = belief;
        self.updates += 1;
        Ok(innovation)
    }
}

/// Sum of the weighted variances up to which [`drawn_to_zero`] inverts: the minors of A⁻¹ keep
/// their digits. After a first penalty it is at most the number of parameters.
const WEIGHTED_SUM_MAX: f64 = 100.0;

/// Returns a belief after rows that observe each parameter as 0 with a weight: A times its mean and A P, with
/// A = (I + P W)⁻¹ (Liu 2018, eq. 14, without dividing by lambda).
#[inline(always)]
fn drawn_to_zero<const N: usize>(
    belief: Gaussian<N>,
    weights: &SVector<f64, N>,
) -> Result<Gaussian<N>, NotPositiveDefinite> {
    let Gaussian { mean, covariance } = belief;
    // Also refuses NaN.
    if !(covariance.diagonal().dot(weights) <= WEIGHTED_SUM_MAX) {
        return drawn_to_zero_one_by_one(belief, weights);
    }
    let identity = SMatrix::<f64, N, N>::identity();
    let weighted = SMatrix::from_fn(|i, j| covariance[(i, j)] * weights[j]);
    let share = (identity + weighted).try_inverse().ok_or(NotPositiveDefinite)?;
    let mut covariance = share * covariance;
    for j in 0..N {
        for i in 0..j {
            covariance[(j, i)] = covariance[(i, j)];
        }
    }
    Ok(Gaussian { mean: share * mean, covariance })
}

/// Returns the same for any covariance, away from the usual way and by value, so that there the belief
/// stays in registers.
#[cold]
#[inline(never)]
fn drawn_to_zero_one_by_one<const N: usize>(
    mut belief: Gaussian<N>,
    weights: &SVector<f64, N>,
) -> Result<Gaussian<N>, NotPositiveDefinite> {
    for i in (0..N).filter(|&i| weights[i] > 0.0) {
        belief.measure(i, 0.0, 1.0 / weights[i])?;
    }
    Ok(belief)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, Matrix3, Vector3};
    use rand::{RngExt, SeedableRng};

    fn rows(count: usize) -> Vec<(Vector3<f64>, f64)> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        (0..count)
            .map(|_| {
                let x = 2.0 * random.random::<f64>();
                let row = Vector3::new(1.0, x, x * x);
                (row, row.dot(&Vector3::new(1.0, 0.2, 0.5)) + random.random::<f64>() - 0.5)
            })
            .collect()
    }

    /// Returns the formulas as Liu 2018 prints them: Q by eq. 14, then the stacked update.
    fn printed(rows: &[(Vector3<f64>, f64)], p: usize, lambda_per_n: f64, p0: f64) -> Vector3<f64> {
        let mut theta = Vector3::repeat(1.0 / p0);
        let mut covariance = Matrix3::identity() * p0;
        for t in 0..rows.len() {
            let used: Vec<_> = (0..p.min(t + 1)).map(|back| rows[t - back]).collect();
            let stacked = DMatrix::from_fn(3, used.len(), |i, j| used[j].0[i]);
            let stacked = stacked.fixed_rows::<3>(0);
            let ratio = Matrix3::identity() / lambda_per_n;
            let q = covariance * (ratio + covariance).try_inverse().unwrap() / lambda_per_n;
            let inner =
                DMatrix::identity(used.len(), used.len()) + stacked.transpose() * q * stacked;
            let gain = q * stacked * inner.try_inverse().unwrap();
            let innovations =
                nalgebra::DVector::from_fn(used.len(), |j, _| used[j].1 - used[j].0.dot(&theta));
            covariance = (Matrix3::identity() - &gain * stacked.transpose()) * q;
            theta = theta + &gain * innovations - lambda_per_n * covariance * theta;
        }
        theta
    }

    #[test]
    fn scalar_updates_equal_the_printed_stacked_formulas() {
        let rows = rows(25);
        for p in [1, 2, 4, 6] {
            let (lambda, length, p0) = (0.4, 20, 1e3);
            let penalty = Penalty { lambda: Vector3::repeat(lambda), length, is_printed: true };
            let mut mils =
                Mils::<3, 6>::new(Vector3::repeat(1.0 / p0), &Vector3::repeat(p0), p, penalty);
            for (features, observed) in &rows {
                mils.update(features, *observed).unwrap();
            }
            let expected = printed(&rows, p, lambda / f64::from(length), p0);
            assert!((mils.estimate() - expected).norm() < 1e-8, "p = {p}");
        }
    }

    #[test]
    fn after_n_updates_regularised_rls_is_the_ridge_solution_of_the_criterion() {
        let rows = rows(30);
        let (lambda, p0) = (3.0, 1e9);
        // lambda/2 |theta|^2 in addition to the sum of squares: its gradient adds lambda/2 I.
        let normal = rows.iter().fold(Matrix3::identity() * (0.5 * lambda), |sum, (row, _)| {
            sum + row * row.transpose()
        });
        let side = rows.iter().fold(Vector3::zeros(), |sum, (row, y)| sum + row * *y);
        let ridge = normal.cholesky().unwrap().solve(&side);
        let penalty = Penalty { lambda: Vector3::repeat(lambda), length: 10, is_printed: false };
        let mut recursive = Mils::<3, 1>::new(Vector3::zeros(), &Vector3::repeat(p0), 1, penalty);
        for (features, observed) in &rows {
            recursive.update(features, *observed).unwrap();
        }
        assert!((recursive.estimate() - ridge).norm() < 1e-6);
    }

    #[test]
    fn without_regularisation_p_times_the_recursions_p_is_the_covariance_of_least_squares() {
        let rows = rows(200);
        let mut mils =
            Mils::<3, 6>::new(Vector3::zeros(), &Vector3::repeat(1e6), 4, Penalty::none());
        for (features, observed) in &rows {
            mils.update(features, *observed).unwrap();
        }
        let normal =
            rows.iter().fold(Matrix3::zeros(), |sum, (row, _)| sum + row * row.transpose());
        let exact = normal.cholesky().unwrap().inverse();
        // The first and last three rows entered fewer than four times.
        assert!((mils.covariance() - exact).norm() < 0.05 * exact.norm());
    }

    #[test]
    fn a_penalty_taken_at_once_is_that_of_its_rows_one_by_one() {
        let root = SMatrix::<f64, 5, 5>::from_fn(|i, j| 0.3 + (1.7 * i as f64 - j as f64).sin());
        let mean = SVector::<f64, 5>::from([1.0, -2.0, 0.5, 3.0, -0.1]);
        let weights = SVector::<f64, 5>::from([0.2, 0.0, 1.5, 0.01, 3.0]);
        let belief = Gaussian { mean, covariance: root * root.transpose() };
        let at_once = drawn_to_zero(belief, &weights).unwrap();
        let one_by_one = drawn_to_zero_one_by_one(belief, &weights).unwrap();
        assert!((at_once.mean - one_by_one.mean).norm() < 1e-12);
        assert!((at_once.covariance - one_by_one.covariance).norm() < 1e-12);
        assert_eq!(at_once.covariance, at_once.covariance.transpose());
        let unsound = Gaussian { covariance: belief.covariance * f64::NAN, ..belief };
        assert!(drawn_to_zero(unsound, &weights).is_err());
    }

    #[test]
    fn dropping_the_rows_keeps_an_update_from_reaching_back() {
        let rows = rows(12);
        let mut broken =
            Mils::<3, 6>::new(Vector3::zeros(), &Vector3::repeat(1e3), 3, Penalty::none());
        for (i, (features, observed)) in rows.iter().enumerate() {
            if i == 6 {
                broken.forget_rows();
            }
            broken.update(features, *observed).unwrap();
            assert_eq!(broken.held, (i % 6 + 1).min(3));
        }
    }
}
