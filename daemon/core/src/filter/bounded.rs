//! Least squares under lower bounds.

use nalgebra::{SMatrix, SVector};

use super::NotPositiveDefinite;

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
