//! Multi-innovation least squares, with regularisation.

use nalgebra::{SMatrix, SVector};

use super::rank_one::measured;
use super::rls::scalar_update;
use super::{NotPositiveDefinite, Step};

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

    /// Weight that update number `index`, counted from 0, adds to each square.
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
/// that observe 0, so both are done with scalar Joseph updates: no inverse, lambda = 0 allowed
/// (the printed eq. 14 divides by it), P symmetric and positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mils<const N: usize, const L: usize> {
    estimate: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
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
            estimate,
            covariance: SMatrix::from_diagonal(start),
            penalty,
            features: [SVector::zeros(); L],
            observed: [0.0; L],
            length: length.clamp(1, L),
            next: 0,
            held: 0,
            updates: 0,
        }
    }

    /// The estimate.
    pub fn estimate(&self) -> &SVector<f64, N> {
        &self.estimate
    }

    /// The recursion's P: smaller than a covariance by the length p, since every row is used
    /// p times.
    pub fn recursion_covariance(&self) -> &SMatrix<f64, N, N> {
        &self.covariance
    }

    /// The estimate's covariance in units of the error's variance: p P.
    ///
    /// Exact without regularisation, since every row entered p times. With it, it is the
    /// posterior covariance for a prior of weight lambda/p, which is what the repetition makes
    /// of lambda.
    pub fn covariance(&self) -> SMatrix<f64, N, N> {
        self.covariance * self.length as f64
    }

    /// Goes on from another estimate and covariance (not P), in which the criterion's
    /// regularisation is complete; the remembered rows are dropped.
    pub fn restart(&mut self, estimate: SVector<f64, N>, covariance: SMatrix<f64, N, N>) {
        self.estimate = estimate;
        self.covariance = covariance / self.length as f64;
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
    ) -> Result<Step, NotPositiveDefinite> {
        self.remember(features, observed);
        self.update_from_memory()
    }

    /// Keeps a row for the next update without updating.
    #[inline]
    pub fn remember(&mut self, features: &SVector<f64, N>, observed: f64) {
        self.features[self.next] = *features;
        self.observed[self.next] = observed;
        self.next = self.place_after(self.next);
        self.held = (self.held + 1).min(self.length);
    }

    /// Drops the remembered rows, so that no update reaches back past this point.
    pub fn forget_rows(&mut self) {
        (self.next, self.held) = (0, 0);
    }

    /// The number of rows remembered, at most p.
    pub fn remembered(&self) -> usize {
        self.held
    }

    fn place_after(&self, place: usize) -> usize {
        if place + 1 < self.length { place + 1 } else { 0 }
    }

    fn place_before(&self, place: usize) -> usize {
        place.checked_sub(1).unwrap_or(self.length - 1)
    }

    /// Updates with the remembered rows; the step is the newest row's.
    ///
    /// # Errors
    ///
    /// When P is no longer positive definite, or no row is remembered.
    #[inline]
    pub fn update_from_memory(&mut self) -> Result<Step, NotPositiveDefinite> {
        if self.held == 0 {
            return Err(NotPositiveDefinite);
        }
        // Copies, which stay in registers where `self` may not.
        let (mut estimate, mut covariance) = (self.estimate, self.covariance);
        if let Some(weights) = self.penalty.weights_at(self.updates) {
            penalise(&mut estimate, &mut covariance, &weights)?;
        }
        let newest = self.place_before(self.next);
        let (features, observed) = (&self.features[newest], self.observed[newest]);
        let step = scalar_update(&mut estimate, &mut covariance, features, observed)?;
        let mut place = newest;
        for _ in 1..self.held {
            place = self.place_before(place);
            let (features, observed) = (&self.features[place], self.observed[place]);
            scalar_update(&mut estimate, &mut covariance, features, observed)?;
        }
        (self.estimate, self.covariance) = (estimate, covariance);
        self.updates += 1;
        Ok(step)
    }
}

/// Takes in the rows of a penalty.
#[inline(always)]
fn penalise<const N: usize>(
    estimate: &mut SVector<f64, N>,
    covariance: &mut SMatrix<f64, N, N>,
    weights: &SVector<f64, N>,
) -> Result<(), NotPositiveDefinite> {
    if N == 3 && draw_three_to_zero(estimate, covariance, weights) {
        return Ok(());
    }
    for i in (0..N).filter(|&i| weights[i] > 0.0) {
        draw_to_zero(estimate, covariance, i, weights[i])?;
    }
    Ok(())
}

/// A row that observes parameter `i` as 0 with a weight.
#[inline(always)]
fn draw_to_zero<const N: usize>(
    estimate: &mut SVector<f64, N>,
    covariance: &mut SMatrix<f64, N, N>,
    i: usize,
    weight: f64,
) -> Result<(), NotPositiveDefinite> {
    let noise_variance = 1.0 / weight;
    let spread = covariance.column(i).into_owned();
    let variance = spread[i] + noise_variance;
    if !(variance >= noise_variance && variance.is_finite() && estimate[i].is_finite()) {
        return Err(NotPositiveDefinite);
    }
    let inverse_variance = 1.0 / variance;
    *estimate -= spread * (inverse_variance * estimate[i]);
    let mut row = SVector::<f64, N>::zeros();
    row[i] = 1.0;
    measured(covariance, &row, &spread, inverse_variance, noise_variance);
    Ok(())
}

/// Sum of the weighted variances up to which three rows are taken at once.
const WEIGHTED_MAX: f64 = 100.0;

/// Three rows that observe the parameters as 0, in one solution: Q = P (I + W P)^-1.
///
/// With the matrix A of elements `P_ij W_j`, A adj(I + A) = A + (s2 + det A) I - adj A, s2 being
/// the sum of the principal minors (Cayley and Hamilton), so that one division does. False when
/// nothing was done: where the weighted variances are large the minors would lose digits.
#[inline(always)]
fn draw_three_to_zero<const N: usize>(
    estimate: &mut SVector<f64, N>,
    covariance: &mut SMatrix<f64, N, N>,
    weights: &SVector<f64, N>,
) -> bool {
    let p = |i: usize, j: usize| covariance[(i, j)];
    let [w0, w1, w2] = [weights[0], weights[1], weights[2]];
    // Minors of P; those of A carry the weights of their columns.
    let minor = [
        p(1, 1) * p(2, 2) - p(1, 2) * p(1, 2),
        p(0, 0) * p(2, 2) - p(0, 2) * p(0, 2),
        p(0, 0) * p(1, 1) - p(0, 1) * p(0, 1),
    ];
    let crossed01 = p(0, 1) * p(2, 2) - p(0, 2) * p(1, 2);
    let crossed02 = p(0, 2) * p(1, 1) - p(0, 1) * p(1, 2);
    let crossed12 = p(1, 2) * p(0, 0) - p(0, 1) * p(0, 2);
    let determinant = p(0, 0) * minor[0] - p(0, 1) * crossed01 - p(0, 2) * crossed02;
    let trace = p(0, 0) * w0 + p(1, 1) * w1 + p(2, 2) * w2;
    // Also refuses NaN.
    if !(trace <= WEIGHTED_MAX) {
        return false;
    }
    let (w01, w02, w12) = (w0 * w1, w0 * w2, w1 * w2);
    let minors = w12 * minor[0] + w02 * minor[1] + w01 * minor[2];
    let scale = 1.0 / (1.0 + trace + minors + w01 * w2 * determinant);
    let diagonal = [
        p(0, 0) + w2 * minor[1] + w1 * minor[2] + w12 * determinant,
        p(1, 1) + w2 * minor[0] + w0 * minor[2] + w02 * determinant,
        p(2, 2) + w1 * minor[0] + w0 * minor[1] + w01 * determinant,
    ];
    let off = [
        (0, 1, p(0, 1) + w2 * crossed01),
        (0, 2, p(0, 2) + w1 * crossed02),
        (1, 2, p(1, 2) + w0 * crossed12),
    ];
    for (i, value) in diagonal.into_iter().enumerate() {
        covariance[(i, i)] = value * scale;
    }
    for (i, j, value) in off {
        covariance[(i, j)] = value * scale;
        covariance[(j, i)] = value * scale;
    }
    *estimate -= *covariance * estimate.component_mul(weights);
    true
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

    /// The formulas as Liu 2018 prints them: Q by eq. 14, then the stacked update.
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
    fn three_rows_at_once_are_the_three_one_after_the_other() {
        let prior = Matrix3::new(4.0, 1.0, -0.5, 1.0, 3.0, 0.7, -0.5, 0.7, 2.0);
        for weights in [Vector3::repeat(4e-4), Vector3::new(0.0, 2.0, 0.3), Vector3::repeat(20.0)] {
            let start = Vector3::new(1.0, -2.0, 0.5);
            let (mut estimate, mut covariance) = (start, prior);
            for i in (0..3).filter(|&i| weights[i] > 0.0) {
                draw_to_zero(&mut estimate, &mut covariance, i, weights[i]).unwrap();
            }
            let (mut at_once, mut joint) = (start, prior);
            let is_done = draw_three_to_zero(&mut at_once, &mut joint, &weights);
            assert_eq!(is_done, weights[0] < 20.0);
            if is_done {
                assert!((at_once - estimate).norm() < 1e-13);
                assert!((joint - covariance).norm() < 1e-13);
            }
        }
    }

    #[test]
    fn after_n_updates_regularised_rls_is_the_ridge_solution_of_the_criterion() {
        let rows = rows(30);
        let (lambda, p0) = (3.0, 1e9);
        // lambda/2 |theta|^2 beside the sum of squares: its gradient adds lambda/2 I.
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
    fn dropping_the_rows_keeps_an_update_from_reaching_back() {
        let rows = rows(12);
        let mut broken =
            Mils::<3, 6>::new(Vector3::zeros(), &Vector3::repeat(1e3), 3, Penalty::none());
        for (i, (features, observed)) in rows.iter().enumerate() {
            if i == 6 {
                broken.forget_rows();
            }
            broken.update(features, *observed).unwrap();
            assert_eq!(broken.remembered(), (i % 6 + 1).min(3));
        }
    }
}
