//! Resistance at a speed, computed from a snapshot.

use crate::snapshot::ParameterSnapshot;
use crate::vocabulary::Parameter;

/// Basic resistance at a speed, with its uncertainty.
///
/// # Examples
///
/// ```
/// use dynocar_shared::ResistanceEstimate;
///
/// let at_20_mps =
///     ResistanceEstimate { w0_n_per_kn: 2.1, w0_std_n_per_kn: 0.1, is_extrapolated: false };
/// let (force_n, std_n) = at_20_mps.force_n(1_692_000.0);
/// assert_eq!([force_n.round(), std_n.round()], [34_857.0, 1_660.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResistanceEstimate {
    /// Unit basic resistance w0 in N per kN of train weight.
    pub w0_n_per_kn: f64,
    /// Standard deviation of `w0_n_per_kn`.
    pub w0_std_n_per_kn: f64,
    /// True when the speed lies outside the speeds behind the estimate.
    pub is_extrapolated: bool,
}

impl ResistanceEstimate {
    /// Returns the resistance in N and its standard deviation, for a train of `mass_kg`.
    pub fn force_n(&self, mass_kg: f64) -> (f64, f64) {
        let weight_kn = mass_kg * GRAVITY_MPS2 / 1000.0;
        (self.w0_n_per_kn * weight_kn, self.w0_std_n_per_kn * weight_kn)
    }
}

/// Gravity in m/s², as the declared model uses it.
pub const GRAVITY_MPS2: f64 = 9.81;

impl ParameterSnapshot {
    /// w0(v) = a + b v + c v² with its standard deviation from the full covariance.
    ///
    /// `None` when the pipeline does not estimate all three Davis coefficients, or when the
    /// speed is not finite.
    pub fn resistance_at(&self, speed_mps: f64) -> Option<ResistanceEstimate> {
        let places = [
            self.index_of(Parameter::DavisA)?,
            self.index_of(Parameter::DavisB)?,
            self.index_of(Parameter::DavisC)?,
        ];
        if !speed_mps.is_finite() {
            return None;
        }
        let powers = [1.0, speed_mps, speed_mps * speed_mps];
        let mut w0 = 0.0;
        let mut variance = 0.0;
        for (i, &place_i) in places.iter().enumerate() {
            w0 += powers[i] * self.values[place_i];
            for (j, &place_j) in places.iter().enumerate() {
                variance += powers[i] * powers[j] * self.covariance_at(place_i, place_j);
            }
        }
        Some(ResistanceEstimate {
            w0_n_per_kn: w0,
            w0_std_n_per_kn: variance.max(0.0).sqrt(),
            is_extrapolated: !(self.speed_min_mps..=self.speed_max_mps).contains(&speed_mps),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::snapshot::packed_index;

    fn davis_snapshot() -> ParameterSnapshot {
        let mut snapshot = ParameterSnapshot::empty();
        snapshot.parameter_count = 3;
        // Out of order on purpose: the places come from the parameter numbers.
        snapshot.parameters[..3].copy_from_slice(&[
            Parameter::DavisC as u32,
            Parameter::DavisA as u32,
            Parameter::DavisB as u32,
        ]);
        snapshot.values[..3].copy_from_slice(&[0.005, 1.5, 0.02]);
        snapshot.covariance[packed_index(1, 1)] = 0.04;
        snapshot.covariance[packed_index(1, 2)] = -0.001;
        snapshot.covariance[packed_index(2, 2)] = 0.0001;
        snapshot.speed_max_mps = 30.0;
        snapshot
    }

    #[test]
    fn resistance_and_its_deviation_follow_the_quadratic_form() {
        let estimate = davis_snapshot().resistance_at(10.0).unwrap();
        assert!((estimate.w0_n_per_kn - 2.2).abs() < 1e-12);
        let variance: f64 = 0.04 - 2.0 * 10.0 * 0.001 + 100.0 * 0.0001;
        assert!((estimate.w0_std_n_per_kn - variance.sqrt()).abs() < 1e-12);
        assert!(!estimate.is_extrapolated);
    }

    #[test]
    fn a_speed_beyond_the_data_is_marked_and_a_bad_one_refused() {
        assert!(davis_snapshot().resistance_at(40.0).unwrap().is_extrapolated);
        assert_eq!(davis_snapshot().resistance_at(f64::NAN), None);
        assert_eq!(ParameterSnapshot::empty().resistance_at(10.0), None);
    }
}
