//! A resistance of a form of its own, which no other term covers.
//!
//! ```text
//! w = n_per_kn · f1(x1) [· f2(x2)]
//! ```
//!
//! in N/kN, of one or two dimensionless factors, each a [`Form`] of one [`Covariate`]. `explain` finds such a force
//! where nothing of its library explains a residual; `[[extra]]` of `train.toml` holds it, and a user who knows a law
//! from elsewhere may write it there.

mod form;
mod law;

pub use form::Form;
pub use law::{Covariate, CovariateFactor, ExtraResistance};

use super::Resistance;

/// The force where all factors are 1 lies within this many N/kN.
pub const FORCE_MAX_N_PER_KN: f64 = 100.0;
/// Factors at most.
pub const FACTORS_MAX: usize = 2;

/// Adds forces of forms of their own to the resistance, with their slope for speeds near this one.
#[inline]
pub fn act(
    extras: &[ExtraResistance],
    speed_mps: f64,
    known: impl Fn(Covariate) -> Option<f64>,
    resistance: &mut Resistance,
) {
    for extra in extras {
        let (n_per_kn, slope) = extra.at(&known);
        resistance.other_n_per_kn += n_per_kn - slope * speed_mps;
        resistance.other_per_mps += slope;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Davis;

    /// Returns the force in N/kN at a speed, given the covariates at another speed and at a temperature in °C.
    fn resists_n_per_kn(
        extra: &ExtraResistance,
        (known_mps, degc): (f64, Option<f64>),
        speed_mps: f64,
    ) -> f64 {
        let mut resistance = Resistance::BASIC;
        let known = |of: Covariate| match of {
            Covariate::Speed => Some(known_mps),
            Covariate::Temperature => degc,
            _ => None,
        };
        act(std::slice::from_ref(extra), known_mps, known, &mut resistance);
        resistance.extra_n_per_kn(Davis { a: 1.0, b: 0.0, c: 0.0 }, speed_mps)
    }

    fn slow_and_cold() -> ExtraResistance {
        let hyperbola =
            CovariateFactor { of: Covariate::Speed, form: Form::Hyperbola, numbers: [15.0, 3.0] };
        let cold =
            CovariateFactor { of: Covariate::Temperature, form: Form::Below, numbers: [5.0, 10.0] };
        ExtraResistance { n_per_kn: 0.8, factors: vec![hyperbola, cold] }
    }

    #[test]
    fn factors_multiply_and_the_slope_holds_near_the_speed() {
        let extra = slow_and_cold();
        let cold = (6.0, Some(-15.0));
        let expected = |speed_mps: f64| 0.8 * (15.0 / speed_mps - 1.0) * 2.0;
        assert!((resists_n_per_kn(&extra, cold, 6.0) - expected(6.0)).abs() < 1e-12);
        assert!((resists_n_per_kn(&extra, cold, 6.01) - expected(6.01)).abs() < 1e-4);
        assert_eq!(resists_n_per_kn(&extra, (6.0, Some(20.0)), 6.0), 0.0);
        assert_eq!(resists_n_per_kn(&extra, (16.0, Some(-15.0)), 16.0), 0.0);
    }

    #[test]
    fn what_depends_on_something_unknown_does_not_act() {
        assert_eq!(resists_n_per_kn(&slow_and_cold(), (6.0, None), 6.0), 0.0);
    }

    #[test]
    fn the_law_reads_as_a_formula() {
        assert_eq!(
            slow_and_cold().law(),
            "0.8000 N/kN · max(0, 15 / max(speed_mps, 3) − 1) · max(0, 5 − \
             ambient_temperature_degc) / 10"
        );
    }
}
