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

pub use form::Form;

use super::Resistance;
use crate::named;

/// The force where all factors are 1 lies within this many N/kN.
pub const FORCE_MAX_N_PER_KN: f64 = 100.0;
/// Factors at most.
pub const FACTORS_MAX: usize = 2;

/// A dimensionless function of one covariate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CovariateFactor {
    /// Covariate of the law.
    pub of: Covariate,
    /// Form of the function.
    pub form: Form,
    /// The numbers of the form, in the order of [`Form::numbers`]; surplus numbers are ignored.
    pub numbers: [f64; 2],
}

/// A force and the factors that it is multiplied by.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtraResistance {
    /// The resistance in N/kN where all factors are 1.
    pub n_per_kn: f64,
    /// The one or two factors.
    pub factors: Vec<CovariateFactor>,
}

impl CovariateFactor {
    /// Returns the value of the factor and its slope over the speed in 1/(m/s); `None` where the covariate is not
    /// known.
    #[inline]
    fn at(&self, known: impl Fn(Covariate) -> Option<f64>) -> Option<(f64, f64)> {
        let (value, slope) = self.form.value_and_slope(self.numbers, known(self.of)?);
        Some((value, if self.of == Covariate::Speed { slope } else { 0.0 }))
    }

    /// Multiplies values by those at each of a covariate; by none where that is `NaN`, not known.
    pub fn multiply(&self, covariate: &[f64], values: &mut [f64]) {
        for (value, &at) in values.iter_mut().zip(covariate) {
            *value *= if at.is_nan() { 0.0 } else { self.form.value_and_slope(self.numbers, at).0 };
        }
    }

    /// Returns its value at a covariate, and by how much a unit of each number changes it; none where that is `NaN`.
    #[inline]
    pub fn value_and_by_numbers(&self, at: f64) -> (f64, [f64; 2]) {
        match at.is_nan() {
            true => (0.0, [0.0; 2]),
            false => self.form.value_and_by_numbers(self.numbers, at),
        }
    }

    /// Returns the formula.
    pub fn law(&self) -> String {
        self.form.law(self.numbers, self.of.name())
    }
}

impl ExtraResistance {
    /// Returns the formula, in N/kN.
    pub fn law(&self) -> String {
        let factors = self.factors.iter().map(|factor| format!(" · {}", factor.law()));
        format!("{:.4} N/kN{}", self.n_per_kn, factors.collect::<String>())
    }

    /// Returns the force in N/kN and its slope over the speed, given the known covariates; 0 where a covariate of the
    /// law is unknown.
    #[inline]
    pub fn at(&self, known: impl Fn(Covariate) -> Option<f64>) -> (f64, f64) {
        let joined = self.factors.iter().try_fold((1.0, 0.0), |(value, slope), factor| {
            let (own, own_slope) = factor.at(&known)?;
            Some((value * own, slope * own + value * own_slope))
        });
        let (value, slope) = joined.unwrap_or((0.0, 0.0));
        (self.n_per_kn * value, self.n_per_kn * slope)
    }
}

named! {
    /// A quantity known at every sample, or at some.
    Covariate ("in files and answers, with the unit") {
        /// Speed in m/s.
        Speed "speed_mps";
        /// Chainage in m.
        Chainage "chainage_m";
        /// Time in s since the train was cold, as its bearings count it.
        TimeSinceStart "time_since_start_s";
        /// Reported traction force in N.
        TractionForce "traction_force_n";
        /// Reported brake force in N.
        BrakeForce "brake_force_n";
        /// Outside temperature in °C.
        Temperature "ambient_temperature_degc";
    }
}

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
