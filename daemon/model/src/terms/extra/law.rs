//! A force as a product of functions of covariates.

use super::form::Form;
use crate::named;

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
