//! Least squares: recursive with forgetting, and under lower bounds.

use nalgebra::{SMatrix, SVector};

use super::{Gaussian, Innovation, NotPositiveDefinite};

/// Recursive least squares (Liu 2018, eq. 9-11).
///
/// Joseph's form is used where subtraction would lose digits, as from a wide prior.
///
/// The covariance is in units of the error's variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rls<const N: usize> {
    /// The estimate with its covariance.
    pub belief: Gaussian<N>,
    /// 1 when all rows count alike. Below 1, forgetting is limited to the direction of the newest row (Cao and Schwartz
    /// 2000): the estimate keeps its knowledge of unexcited directions.
    forgetting: f64,
}

impl<const N: usize> Rls<N> {
    /// Starts at `estimate` with independent errors of these variances; in Liu 2018 all of them are p0.
    pub fn new(estimate: SVector<f64, N>, variances: &SVector<f64, N>, forgetting: f64) -> Self {
        let covariance = SMatrix::from_diagonal(variances);
        Rls { belief: Gaussian { mean: estimate, covariance }, forgetting }
    }

    /// Takes in a row `observed = features . theta + error`.
    ///
    /// # Errors
    ///
    /// When the covariance is no longer positive definite; the estimate is then left alone.
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
        if self.forgetting != 1.0 {
            self.forget_along(features, self.forgetting)?;
        }
        self.belief.measure_along(features, observed, 1.0)
    }

    /// P + (1 - f)/f phi phi' / (phi' P^-1 phi): takes the share 1 - f of the information
    /// along the new row, and nothing across it.
    #[inline(always)]
    fn forget_along(
        &mut self,
        features: &SVector<f64, N>,
        factor: f64,
    ) -> Result<(), NotPositiveDefinite> {
        let held =
            information_along(&self.belief.covariance, features).ok_or(NotPositiveDefinite)?;
        if held > 0.0 {
            let step = (1.0 - factor) / (factor * held);
            self.belief.covariance.ger(step, features, features, 1.0);
        }
        Ok(())
    }
}

/// x' P^-1 x by P = L D L'; `None` unless P is positive definite.
#[inline(always)]
fn information_along<const N: usize>(
    covariance: &SMatrix<f64, N, N>,
    along: &SVector<f64, N>,
) -> Option<f64> {
    let mut rest = *covariance;
    let mut solved = *along;
    let mut held = 0.0;
    for k in 0..N {
        let pivot = rest[(k, k)];
        // Also refuses NaN.
        if !(pivot > 0.0) {
            return None;
        }
        let inverse = 1.0 / pivot;
        held += solved[k] * solved[k] * inverse;
        for j in k + 1..N {
            let factor = rest[(j, k)] * inverse;
            solved[j] -= factor * solved[k];
            for i in j..N {
                rest[(i, j)] -= factor * rest[(i, k)];
            }
        }
    }
    Some(held)
}

/// The constrained minimum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounded<const N: usize> {
    /// The minimiser within the bounds.
    pub estimate: SVector<f64, N>,
    /// One bit for each parameter held at its bound.
    pub at_bound: u32,
}

/// Minimises `(x - free)' H (x - free)` over `x >= lower`, `free` being the unconstrained
/// minimiser and H its information matrix.
///
/// Tries the sets of active bounds, smallest first, until one meets the conditions of Karush, Kuhn and Tucker; for the
/// few parameters of a resistance law this is the shortest way. While one parameter is held, the others move along the
/// valley of H; plain clipping would ignore that.
///
/// # Errors
///
/// When H is not positive definite.
///
/// # Real-time
///
/// At most 2^N factorisations of order N, no allocation.
pub fn bounded_minimum<const N: usize>(
    information: &SMatrix<f64, N, N>,
    free: &SVector<f64, N>,
    lower: &SVector<f64, N>,
) -> Result<Bounded<N>, NotPositiveDefinite> {
    const { assert!(N <= 8) };
    for size in 0..=N as u32 {
        for active in (0..1_u32 << N).filter(|set| set.count_ones() == size) {
            let candidate = minimum_with(information, free, lower, active)?;
            if is_optimal(information, free, lower, &candidate, active) {
                return Ok(Bounded { estimate: candidate, at_bound: active });
            }
        }
    }
    Err(NotPositiveDefinite)
}

/// Returns the minimum with the parameters of `active` held at their bounds.
fn minimum_with<const N: usize>(
    information: &SMatrix<f64, N, N>,
    free: &SVector<f64, N>,
    lower: &SVector<f64, N>,
    active: u32,
) -> Result<SVector<f64, N>, NotPositiveDefinite> {
    if active == 0 {
        let is_sound = free.iter().all(|value| value.is_finite());
        return if is_sound { Ok(*free) } else { Err(NotPositiveDefinite) };
    }
    let is_held = |i: usize| active & (1 << i) != 0;
    // The step from `free`: given for the held ones, zero gradient for the others.
    let given =
        SVector::<f64, N>::from_fn(|i, _| if is_held(i) { lower[i] - free[i] } else { 0.0 });
    let pull = information * given;
    let side = SVector::<f64, N>::from_fn(|i, _| if is_held(i) { given[i] } else { -pull[i] });
    let system = SMatrix::<f64, N, N>::from_fn(|i, j| match (is_held(i), is_held(j)) {
        (false, false) => information[(i, j)],
        _ => f64::from(i == j),
    });
    Ok(free + system.cholesky().ok_or(NotPositiveDefinite)?.solve(&side))
}

fn is_optimal<const N: usize>(
    information: &SMatrix<f64, N, N>,
    free: &SVector<f64, N>,
    lower: &SVector<f64, N>,
    candidate: &SVector<f64, N>,
    active: u32,
) -> bool {
    let gradient = information * (candidate - free);
    (0..N).all(|i| match active & (1 << i) != 0 {
        true => gradient[i] >= 0.0,
        false => candidate[i] >= lower[i],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::SquareRootInformation;
    use nalgebra::{Matrix3, Vector3};
    use rand::{RngExt, SeedableRng};

    fn rows(count: usize) -> Vec<(Vector3<f64>, f64)> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        (0..count)
            .map(|_| {
                let x = 2.0 * random.random::<f64>();
                let row = Vector3::new(1.0, x, x * x);
                (row, row.dot(&Vector3::new(1.0, 0.2, 0.5)) + random.random::<f64>() - 0.5)
            })
            .collect()
    }

    /// Returns the batch twin: the same prior and weights, by orthogonal rotations.
    fn twin(
        rows: &[(Vector3<f64>, f64)],
        variance: f64,
        factor: f64,
    ) -> (Vector3<f64>, Matrix3<f64>) {
        let mut batch =
            SquareRootInformation::<3>::new(&Vector3::repeat(1.0 / variance), &Vector3::zeros());
        for (features, observed) in rows {
            batch.forget(factor);
            batch.update(features, *observed);
        }
        (batch.solve().unwrap(), batch.covariance().unwrap())
    }

    /// Plain exponential forgetting, which winds up.
    fn forget(rls: &mut Rls<3>, factor: f64) {
        rls.belief.covariance /= factor;
    }

    #[test]
    fn the_recursion_equals_its_batch_twin_with_and_without_forgetting() {
        for factor in [1.0, 0.95] {
            let rows = rows(60);
            let mut rls = Rls::new(Vector3::zeros(), &Vector3::repeat(1e4), 1.0);
            for (features, observed) in &rows {
                forget(&mut rls, factor);
                rls.update(features, *observed).unwrap();
            }
            let (estimate, covariance) = twin(&rows, 1e4, factor);
            assert!((rls.belief.mean - estimate).norm() < 1e-7);
            assert!(
                (rls.belief.covariance - covariance).norm() < 1e-7 * covariance.norm().max(1.0)
            );
        }
    }

    #[test]
    fn directional_forgetting_keeps_what_the_data_no_longer_excite() {
        let mut directional = Rls::new(Vector3::zeros(), &Vector3::repeat(1e4), 0.9);
        let mut exponential = Rls::new(Vector3::zeros(), &Vector3::repeat(1e4), 1.0);
        for (features, observed) in rows(100) {
            directional.update(&features, observed).unwrap();
            forget(&mut exponential, 0.9);
            exponential.update(&features, observed).unwrap();
        }
        let across = Vector3::new(1.0, -2.0, 1.0).normalize();
        let spread = |rls: &Rls<3>| (across.transpose() * rls.belief.covariance * across)[0];
        let before = spread(&directional);
        let cruise = Vector3::new(1.0, 1.0, 1.0);
        for _ in 0..150 {
            directional.update(&cruise, 1.7).unwrap();
            forget(&mut exponential, 0.9);
            exponential.update(&cruise, 1.7).unwrap();
        }
        assert!(spread(&directional) < 1.5 * before, "across the cruise nothing is forgotten");
        assert!(spread(&exponential) > 1e5 * before, "plain forgetting winds up");
        assert!((directional.belief.mean.dot(&cruise) - 1.7).abs() < 1e-6, "along it all is new");
    }

    #[test]
    fn directional_forgetting_is_its_formula_with_an_inverse() {
        let factor = 0.98;
        let mut rls = Rls::new(Vector3::zeros(), &Vector3::repeat(1e4), factor);
        let (mut theta, mut p) = (Vector3::zeros(), Matrix3::identity() * 1e4);
        for (features, observed) in rows(200) {
            rls.update(&features, observed).unwrap();
            let held = features.dot(&(p.try_inverse().unwrap() * features));
            p += features * features.transpose() * ((1.0 - factor) / (factor * held));
            let gain = p * features / (1.0 + features.dot(&(p * features)));
            theta += gain * (observed - features.dot(&theta));
            p = (Matrix3::identity() - gain * features.transpose()) * p;
        }
        assert!((rls.belief.mean - theta).norm() < 1e-6 * theta.norm());
        assert!((rls.belief.covariance - p).norm() < 1e-6 * p.norm());
    }

    #[test]
    fn information_along_a_direction_is_that_of_the_inverse() {
        let covariance = Matrix3::new(4.0, 1.0, -0.5, 1.0, 3.0, 0.7, -0.5, 0.7, 2.0);
        let along = Vector3::new(0.3, -1.0, 2.0);
        let expected = (along.transpose() * covariance.try_inverse().unwrap() * along)[0];
        let found = information_along(&covariance, &along).unwrap();
        assert!((found - expected).abs() < 1e-12);
        assert_eq!(information_along(&-covariance, &along), None);
        assert_eq!(information_along(&(covariance * f64::NAN), &along), None);
    }

    #[test]
    fn the_covariance_stays_positive_over_a_million_updates_of_one_direction() {
        let mut rls = Rls::new(Vector3::zeros(), &Vector3::repeat(1e6), 0.999);
        for _ in 0..1_000_000 {
            rls.update(&Vector3::new(1.0, 0.999, 0.998), 2.0).unwrap();
        }
        assert!(rls.belief.covariance.cholesky().is_some());
    }

    #[test]
    fn a_row_of_nan_is_refused_and_leaves_the_estimate() {
        let mut rls = Rls::new(Vector3::zeros(), &Vector3::repeat(1.0), 1.0);
        let before = rls;
        assert!(rls.update(&Vector3::repeat(f64::NAN), 1.0).is_err());
        assert!(rls.update(&Vector3::repeat(1.0), f64::NAN).is_err());
        assert_eq!(rls, before);
    }
}

#[cfg(test)]
mod bounded_tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};
    use proptest::prelude::*;

    #[test]
    fn a_minimum_inside_the_bounds_is_left_alone() {
        let free = Vector3::new(1.0, 2.0, 3.0);
        let bounded = bounded_minimum(&Matrix3::identity(), &free, &Vector3::zeros()).unwrap();
        assert_eq!((bounded.estimate, bounded.at_bound), (free, 0));
    }

    #[test]
    fn the_others_follow_the_valley_when_one_is_held() {
        // b and c nearly opposed: holding b at 0 must lower c, as refitting without b does.
        let information = Matrix3::new(4.0, 2.0, 2.0, 2.0, 4.0, 3.6, 2.0, 3.6, 4.0);
        let free = Vector3::new(2.0, -0.5, 1.5);
        let bounded = bounded_minimum(&information, &free, &Vector3::zeros()).unwrap();
        assert_eq!(bounded.at_bound, 0b010);
        assert_eq!(bounded.estimate[1], 0.0);
        assert!(bounded.estimate[2] < 1.2, "clipping alone would leave 1.5");
    }

    #[test]
    fn an_indefinite_information_is_an_error() {
        let indefinite = Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0);
        let free = Vector3::new(-1.0, 1.0, 1.0);
        assert!(bounded_minimum(&indefinite, &free, &Vector3::repeat(2.0)).is_err());
        let nan = Vector3::repeat(f64::NAN);
        assert!(bounded_minimum(&Matrix3::identity(), &nan, &Vector3::zeros()).is_err());
    }

    proptest! {
        #[test]
        fn no_feasible_neighbour_is_better(
            root in prop::array::uniform9(-1.0f64..1.0),
            free in prop::array::uniform3(-2.0f64..2.0),
            steps in prop::collection::vec(prop::array::uniform3(-0.3f64..0.3), 30),
        ) {
            let root = Matrix3::from_row_slice(&root);
            let information = root.transpose() * root + Matrix3::identity() * 0.05;
            let free = Vector3::from(free);
            let bounded = bounded_minimum(&information, &free, &Vector3::zeros()).unwrap();
            let cost = |x: &Vector3<f64>| ((x - free).transpose() * information * (x - free))[0];
            let best = cost(&bounded.estimate);
            prop_assert!(bounded.estimate.min() >= 0.0);
            for step in steps {
                let other = (bounded.estimate + Vector3::from(step)).map(|x| x.max(0.0));
                prop_assert!(cost(&other) >= best - 1e-9);
            }
        }
    }
}
