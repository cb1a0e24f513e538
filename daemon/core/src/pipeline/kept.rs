//! What of an estimate outlives the daemon, and what it is worth later.
//!
//! A stored estimate comes back as a prior, never as an estimate: a pipeline that starts from it
//! reports `unestimated` with the stored values until its own samples have confirmed them.

use dynocar_shared::snapshot::{PARAMETERS_MAX, packed_index};
use dynocar_shared::{Parameter, ParameterSnapshot, Status};
use nalgebra::{Cholesky, DMatrix, SMatrix, SVector};

use super::judge::{are_alike, are_too_large};
use super::output::contract_unit;

/// A validated estimate with its covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptEstimate {
    parameters: Vec<Parameter>,
    values: Vec<f64>,
    covariance: Vec<f64>,
}

/// Why an estimate is not worth keeping, or a kept one not worth taking up.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NotKept {
    /// The status is another than estimated.
    #[error("its status is {0}, expected estimated")]
    Status(Status),
    /// The innovations contradict the covariance.
    #[error(
        "its innovations are not white: mean square {mean_square:.2}, correlation {correlation:.2}"
    )]
    NotWhite {
        /// Mean square of the normalised innovations.
        mean_square: f64,
        /// Their lag-1 correlation.
        correlation: f64,
    },
    /// There is no parameter, or more than a snapshot holds, or one that this release lacks.
    #[error("it has no known parameters")]
    Parameters,
    /// A value or the covariance is not finite or not positive definite.
    #[error("its values and covariance are not finite and positive definite")]
    NotSound,
}

impl KeptEstimate {
    /// Takes parameters, values and packed covariance for an estimate.
    ///
    /// # Errors
    ///
    /// When they are not as many as each other, not finite or not positive definite.
    pub fn new(
        parameters: &[Parameter],
        values: &[f64],
        covariance: &[f64],
    ) -> Result<Self, NotKept> {
        let count = parameters.len();
        let entries = count * (count + 1) / 2;
        if !(1..=PARAMETERS_MAX).contains(&count)
            || values.len() != count
            || covariance.len() != entries
        {
            return Err(NotKept::Parameters);
        }
        let kept = KeptEstimate {
            parameters: parameters.to_vec(),
            values: values.to_vec(),
            covariance: covariance.to_vec(),
        };
        if kept.is_sound() { Ok(kept) } else { Err(NotKept::NotSound) }
    }

    /// Takes the estimate of a snapshot, if it is validated: status estimated, innovations as
    /// large and as white as the covariance says.
    ///
    /// # Errors
    ///
    /// Why it is not.
    pub fn of(snapshot: &ParameterSnapshot) -> Result<Self, NotKept> {
        if snapshot.status() != Status::Estimated {
            return Err(NotKept::Status(snapshot.status()));
        }
        let mean_square = snapshot.innovation_mean_square;
        let correlation = snapshot.innovation_correlation;
        if !(mean_square + correlation).is_finite()
            || are_too_large(mean_square)
            || are_alike(mean_square, correlation)
        {
            return Err(NotKept::NotWhite { mean_square, correlation });
        }
        let count = (snapshot.parameter_count as usize).min(PARAMETERS_MAX);
        let parameters: Option<Vec<_>> =
            snapshot.parameters[..count].iter().map(|&it| Parameter::from_number(it)).collect();
        let parameters = parameters.ok_or(NotKept::Parameters)?;
        let entries = count * (count + 1) / 2;
        KeptEstimate::new(&parameters, &snapshot.values[..count], &snapshot.covariance[..entries])
    }

    /// The parameters.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Their values, each in its unit.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Their covariance, lower triangle packed by rows.
    pub fn covariance(&self) -> &[f64] {
        &self.covariance
    }

    /// What the estimate is worth after a time in s without a sample: every variance grows by
    /// what the parameter may have changed meanwhile, `(share * value)² (1 - exp(-2 t / time))`.
    ///
    /// Resistance follows the weather within hours; the mass is another one after the next stop.
    #[must_use]
    pub fn after(&self, elapsed_s: f64) -> Self {
        let mut aged = self.clone();
        for i in 0..self.parameters.len() {
            let (share, time_s) = wander(self.parameters[i]);
            let grown = 1.0 - (-2.0 * elapsed_s.max(0.0) / time_s).exp();
            aged.covariance[packed_index(i, i)] += (share * self.values[i]).powi(2) * grown;
        }
        aged
    }

    /// Mean and covariance of these parameters, the mass in kg; `None` unless all of them were kept.
    pub fn moments<const N: usize>(
        &self,
        wanted: [Parameter; N],
    ) -> Option<(SVector<f64, N>, SMatrix<f64, N, N>)> {
        let mut places = [0; N];
        for (index, parameter) in places.iter_mut().zip(wanted) {
            *index = self.parameters().iter().position(|&it| it == parameter)?;
        }
        let units = wanted.map(contract_unit);
        let mean = SVector::from_fn(|i, _| self.values[places[i]] / units[i]);
        let entry = |i: usize, j: usize| {
            self.covariance[packed_index(places[i], places[j])] / (units[i] * units[j])
        };
        Some((mean, SMatrix::from_fn(entry)))
    }

    fn is_sound(&self) -> bool {
        let entry = |i, j| self.covariance[packed_index(i, j)];
        let count = self.parameters.len();
        let matrix = DMatrix::from_fn(count, count, entry);
        let is_finite = self.values().iter().chain(self.covariance()).all(|it| it.is_finite());
        is_finite && Cholesky::new(matrix).is_some()
    }
}

/// How far a parameter wanders in the long run, as a share of its value, and the time in s of it.
fn wander(parameter: Parameter) -> (f64, f64) {
    match parameter {
        Parameter::Mass => (0.15, 120.0),
        Parameter::DavisA | Parameter::DavisB | Parameter::DavisC => (0.3, 6.0 * 3600.0),
        _ => (1.0, 600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot() -> ParameterSnapshot {
        let mut snapshot = ParameterSnapshot::empty();
        snapshot.status = Status::Estimated as u32;
        snapshot.parameter_count = 2;
        snapshot.parameters[..2]
            .copy_from_slice(&[Parameter::DavisA as u32, Parameter::DavisC as u32]);
        snapshot.values[..2].copy_from_slice(&[2.0, 1e-3]);
        snapshot.covariance[..3].copy_from_slice(&[0.04, -1e-5, 1e-8]);
        snapshot.innovation_mean_square = 1.1;
        snapshot
    }

    #[test]
    fn only_a_validated_estimate_is_kept() {
        assert!(KeptEstimate::of(&snapshot()).is_ok());
        for status in [Status::Unestimated, Status::Degraded, Status::Invalid] {
            let mut other = snapshot();
            other.status = status as u32;
            assert_eq!(KeptEstimate::of(&other), Err(NotKept::Status(status)));
        }
        let mut coloured = snapshot();
        coloured.innovation_correlation = 0.6;
        assert!(matches!(KeptEstimate::of(&coloured), Err(NotKept::NotWhite { .. })));
        coloured.innovation_correlation = f64::NAN;
        assert!(matches!(KeptEstimate::of(&coloured), Err(NotKept::NotWhite { .. })));
        let mut large = snapshot();
        large.innovation_mean_square = 3.0;
        assert!(matches!(KeptEstimate::of(&large), Err(NotKept::NotWhite { .. })));
        let mut unsound = snapshot();
        unsound.covariance[2] = 1e-10;
        assert_eq!(KeptEstimate::of(&unsound), Err(NotKept::NotSound));
        let mut unknown = snapshot();
        unknown.parameters[1] = 999;
        assert_eq!(KeptEstimate::of(&unknown), Err(NotKept::Parameters));
    }

    #[test]
    fn moments_come_in_the_order_asked_for_and_only_together() {
        let kept = KeptEstimate::of(&snapshot()).unwrap();
        let (mean, covariance) = kept.moments([Parameter::DavisC, Parameter::DavisA]).unwrap();
        assert_eq!((mean[0], mean[1]), (1e-3, 2.0));
        assert_eq!((covariance[(0, 0)], covariance[(0, 1)]), (1e-8, -1e-5));
        assert!(kept.moments([Parameter::DavisA, Parameter::DavisB]).is_none());
    }

    #[test]
    fn variances_grow_with_time_towards_a_bound_and_never_shrink() {
        let kept = KeptEstimate::of(&snapshot()).unwrap();
        assert_eq!(kept.after(0.0), kept);
        assert_eq!(kept.after(-5.0), kept, "a clock that was set back ages nothing");
        let variance = |elapsed_s: f64| kept.after(elapsed_s).covariance()[0];
        assert!(variance(60.0) > variance(0.0));
        assert!(variance(86_400.0) > variance(3_600.0));
        assert!((variance(1e9) - (0.04 + 0.36)).abs() < 1e-12);
    }
}
