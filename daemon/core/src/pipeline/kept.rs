//! Persisted estimates: the stored values, and how they become a prior.
//!
//! A stored estimate comes back as a prior: a pipeline that starts from it reports `unestimated` with the
//! stored values until its own samples have confirmed them. One that was in use moments ago goes on.

use dynocar_shared::snapshot::{PARAMETERS_MAX, packed_index};
use dynocar_shared::{Parameter, ParameterSnapshot, Reason, Status};
use nalgebra::{Cholesky, DMatrix, SMatrix, SVector};

use super::judge::{are_alike, are_too_large};
use super::output::contract_unit;

/// A validated estimate with its covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptEstimate {
    parameters: Vec<Parameter>,
    values: Vec<f64>,
    covariance: Vec<f64>,
    /// Covariance before any time had passed.
    first_covariance: Vec<f64>,
    /// When and how it was used.
    pub use_before: UseBefore,
}

/// How an estimate was used when it was kept.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UseBefore {
    /// Time in ns of the newest sample behind it, controller's clock.
    pub sample_time_ns: i64,
    /// The quantities that a controller might use, one bit each.
    pub usable_quantities: u32,
    /// Lowest and highest speed in m/s driven.
    pub speeds_mps: Option<(f64, f64)>,
    /// Time in s that has passed since, by the clock of the daemon's host.
    pub elapsed_s: f64,
}

impl UseBefore {
    /// Returns the time in s that has passed up to a sample's time in ns, where the use may go on: minutes
    /// at most, by the controller's clock and by the host's.
    pub fn interrupted_s(&self, time_ns: i64) -> Option<f64> {
        let since_s = time_ns.saturating_sub(self.sample_time_ns) as f64 * 1e-9;
        let is_short = |elapsed_s: f64| (0.0..=RESUMED_MAX_S).contains(&elapsed_s);
        let is_known = self.sample_time_ns != 0 && is_short(since_s);
        (is_known && is_short(self.elapsed_s.max(0.0))).then(|| since_s.max(self.elapsed_s))
    }
}

/// Time in s after which a use that was broken off does not go on by itself.
const RESUMED_MAX_S: f64 = 600.0;

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
            first_covariance: covariance.to_vec(),
            use_before: UseBefore::default(),
        };
        if kept.is_sound() { Ok(kept) } else { Err(NotKept::NotSound) }
    }

    /// Takes the estimate of a snapshot, if it is validated: status estimated, or some quantities usable while others are
    /// being learned, innovations as large and as white as the covariance says.
    ///
    /// # Errors
    ///
    /// Why it is not.
    pub fn from_snapshot(snapshot: &ParameterSnapshot) -> Result<Self, NotKept> {
        let is_learning = snapshot.status() == Status::Unestimated
            && matches!(
                snapshot.reason(),
                Some(Reason::WeakExcitation | Reason::LoadMayHaveChanged)
            );
        let is_known_in_part = is_learning && snapshot.usable_quantities != 0;
        if snapshot.status() != Status::Estimated && !is_known_in_part {
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
        let kept = KeptEstimate::new(
            &parameters,
            &snapshot.values[..count],
            &snapshot.covariance[..entries],
        )?;
        let speeds_mps = (snapshot.speed_min_mps, snapshot.speed_max_mps);
        let use_before = UseBefore {
            sample_time_ns: snapshot.sample_time_ns,
            usable_quantities: snapshot.usable_quantities,
            speeds_mps: (speeds_mps.1 > speeds_mps.0).then_some(speeds_mps),
            elapsed_s: 0.0,
        };
        Ok(KeptEstimate { use_before, ..kept })
    }

    /// Returns true when another one says the same of the parameters.
    pub fn has_values_of(&self, other: &KeptEstimate) -> bool {
        let all = |it: &KeptEstimate| {
            (it.parameters.clone(), it.values.clone(), it.first_covariance.clone())
        };
        all(self) == all(other)
    }

    /// Returns the variance of a parameter's value before any time had passed.
    pub fn first_variance(&self, parameter: Parameter) -> Option<f64> {
        let index = self.parameters.iter().position(|&it| it == parameter)?;
        Some(self.first_covariance[packed_index(index, index)])
    }

    /// Returns the parameters.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Returns their values, each in its unit.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Returns their covariance, lower triangle packed by rows.
    pub fn covariance(&self) -> &[f64] {
        &self.covariance
    }

    /// Returns the estimate after a time in s without a sample: every variance grows by the possible change of the
    /// parameter meanwhile, `(share * value)² (1 - exp(-2 t / time))`.
    ///
    /// Resistance follows the weather within hours; the mass is another one after the next stop.
    #[must_use]
    pub fn after(&self, elapsed_s: f64) -> Self {
        let mut aged = self.clone();
        aged.use_before.elapsed_s += elapsed_s;
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

/// Returns how far a parameter wanders in the long run, as a share of its value, and the time in s of it.
fn wander(parameter: Parameter) -> (f64, f64) {
    match parameter {
        Parameter::Mass => (0.15, 120.0),
        Parameter::DavisA | Parameter::DavisB | Parameter::DavisC => (0.3, 6.0 * 3600.0),
        _ => (1.0, 600.0),
    }
}

#[cfg(test)]
mod tests {
    use dynocar_shared::Quantity;

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
        assert!(KeptEstimate::from_snapshot(&snapshot()).is_ok());
        for status in [Status::Unestimated, Status::Degraded, Status::Invalid] {
            let mut other = snapshot();
            other.status = status as u32;
            assert_eq!(KeptEstimate::from_snapshot(&other), Err(NotKept::Status(status)));
        }
        let mut learning = snapshot();
        learning.status = Status::Unestimated as u32;
        learning.usable_quantities = Quantity::Mass.bit();
        for (reason, is_kept) in [
            (Reason::WeakExcitation, true),
            (Reason::LoadMayHaveChanged, true),
            (Reason::EstimateStale, false),
            (Reason::BadInput, false),
        ] {
            learning.reason = reason as u32;
            let kept = KeptEstimate::from_snapshot(&learning);
            assert_eq!(kept.is_ok(), is_kept, "{reason}");
        }
        (learning.reason, learning.usable_quantities) = (Reason::WeakExcitation as u32, 0);
        assert!(KeptEstimate::from_snapshot(&learning).is_err(), "nothing is usable");
        let mut coloured = snapshot();
        coloured.innovation_correlation = 0.6;
        assert!(matches!(KeptEstimate::from_snapshot(&coloured), Err(NotKept::NotWhite { .. })));
        coloured.innovation_correlation = f64::NAN;
        assert!(matches!(KeptEstimate::from_snapshot(&coloured), Err(NotKept::NotWhite { .. })));
        let mut large = snapshot();
        large.innovation_mean_square = 3.0;
        assert!(matches!(KeptEstimate::from_snapshot(&large), Err(NotKept::NotWhite { .. })));
        let mut unsound = snapshot();
        unsound.covariance[2] = 1e-10;
        assert_eq!(KeptEstimate::from_snapshot(&unsound), Err(NotKept::NotSound));
        let mut unknown = snapshot();
        unknown.parameters[1] = 999;
        assert_eq!(KeptEstimate::from_snapshot(&unknown), Err(NotKept::Parameters));
    }

    #[test]
    fn moments_come_in_the_order_asked_for_and_only_together() {
        let kept = KeptEstimate::from_snapshot(&snapshot()).unwrap();
        let (mean, covariance) = kept.moments([Parameter::DavisC, Parameter::DavisA]).unwrap();
        assert_eq!((mean[0], mean[1]), (1e-3, 2.0));
        assert_eq!((covariance[(0, 0)], covariance[(0, 1)]), (1e-8, -1e-5));
        assert!(kept.moments([Parameter::DavisA, Parameter::DavisB]).is_none());
    }

    #[test]
    fn a_use_goes_on_within_minutes_by_the_clocks_of_both_sides() {
        let mut it = snapshot();
        let second_ns = 1_000_000_000;
        it.sample_time_ns = 100 * second_ns;
        let kept = KeptEstimate::from_snapshot(&it).unwrap();
        assert_eq!(kept.after(2.0).use_before.interrupted_s(103 * second_ns), Some(3.0));
        assert_eq!(kept.after(7.0).use_before.interrupted_s(103 * second_ns), Some(7.0));
        assert_eq!(kept.after(2.0).use_before.interrupted_s(99 * second_ns), None, "another clock");
        assert_eq!(kept.after(2.0).use_before.interrupted_s(900 * second_ns), None);
        assert_eq!(kept.after(900.0).use_before.interrupted_s(103 * second_ns), None);
        assert_eq!(kept.after(50.0).first_variance(Parameter::DavisA), Some(0.04));
    }

    #[test]
    fn variances_grow_with_time_towards_a_bound_and_never_shrink() {
        let kept = KeptEstimate::from_snapshot(&snapshot()).unwrap();
        assert_eq!(kept.after(0.0), kept);
        let set_back = kept.after(-5.0);
        assert_eq!(set_back.covariance(), kept.covariance(), "a clock set back ages nothing");
        let variance = |elapsed_s: f64| kept.after(elapsed_s).covariance()[0];
        assert!(variance(60.0) > variance(0.0));
        assert!(variance(86_400.0) > variance(3_600.0));
        assert!((variance(1e9) - (0.04 + 0.36)).abs() < 1e-12);
    }
}
