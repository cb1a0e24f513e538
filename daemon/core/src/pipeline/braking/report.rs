//! What of an estimate may be said, and how.

use dynocar_shared::{Parameter, ParameterSnapshot, Reason, Status};
use nalgebra::{Matrix1, Matrix2, SVector};

use super::engine::Estimate;
use super::intake::BrakingCoefficient;
use crate::pipeline::judge::Case;
use crate::pipeline::output::{write_parameters, write_status};

/// When an estimate counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReportSettings {
    /// Greatest standard deviation over value of an estimate that counts.
    pub relative_std_max: f64,
    /// Standard deviation over value of the declared brake force.
    pub demand_relative_std: f64,
    /// True when the scale of the law is written beside the coefficient.
    pub has_law_scale: bool,
}

impl ReportSettings {
    /// True when an estimate is precise enough to be used.
    pub fn counts(&self, estimate: &Estimate) -> bool {
        let coefficient = estimate.coefficient;
        coefficient.std <= self.relative_std_max * coefficient.value.abs()
    }
}

/// Standard deviations by which the achieved brake force must lie below the demanded one before
/// the rail counts as the smaller one.
const RAIL_LIMIT_SIGMAS: f64 = 2.0;
/// What is known beside the estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circumstances {
    /// Why there is no estimate, or no newer one.
    pub reason: Reason,
    /// True when the last braking lies too far back.
    pub is_stale: bool,
    /// True when the innovations are larger than the filter says.
    pub are_innovations_too_large: bool,
}

/// True when the rail carries less than the brake would need, so that the coefficient is that
/// of the rail and not only a lower bound of it.
pub fn is_rail_limited(estimate: &Estimate, demand_relative_std: f64) -> bool {
    if let Some(probability) = estimate.brake_limited {
        return probability <= 0.5;
    }
    let demand_std = demand_relative_std * estimate.demand;
    let std = estimate.coefficient.std.hypot(demand_std);
    estimate.coefficient.value < estimate.demand - RAIL_LIMIT_SIGMAS * std
}

/// Writes parameters, status and reason.
///
/// # Real-time
///
/// Allocates nothing.
pub fn write(
    snapshot: &mut ParameterSnapshot,
    quantity: BrakingCoefficient,
    settings: &ReportSettings,
    estimate: Option<&Estimate>,
    circumstances: &Circumstances,
) {
    let Some(estimate) = estimate else {
        snapshot.parameter_count = 0;
        write_status(snapshot, (Status::Unestimated, circumstances.reason));
        return;
    };
    let is_number = quantity != BrakingCoefficient::Adhesion
        || is_rail_limited(estimate, settings.demand_relative_std);
    let parameter = match quantity {
        BrakingCoefficient::Adhesion if is_number => Parameter::Adhesion,
        BrakingCoefficient::Adhesion => Parameter::AdhesionLowerBound,
        BrakingCoefficient::Friction => Parameter::DiscFriction,
        BrakingCoefficient::Ratio => Parameter::BrakingRatio,
    };
    write_values(snapshot, parameter, settings.has_law_scale && is_number, estimate);
    let case = case(quantity, settings, is_number, estimate, circumstances);
    write_status(snapshot, case.verdict());
}

fn write_values(
    snapshot: &mut ParameterSnapshot,
    parameter: Parameter,
    has_law_scale: bool,
    estimate: &Estimate,
) {
    let (coefficient, scale) = (estimate.coefficient, estimate.scale);
    let variance = coefficient.std * coefficient.std;
    if has_law_scale {
        let covariance = estimate.covariance;
        write_parameters(
            snapshot,
            [parameter, Parameter::AdhesionLawScale],
            &SVector::from([coefficient.value, scale.value]),
            &Matrix2::new(variance, covariance, covariance, scale.std * scale.std),
        );
    } else {
        write_parameters(
            snapshot,
            [parameter],
            &SVector::from([coefficient.value]),
            &Matrix1::new(variance),
        );
    }
}

fn case(
    quantity: BrakingCoefficient,
    settings: &ReportSettings,
    is_number: bool,
    estimate: &Estimate,
    circumstances: &Circumstances,
) -> Case {
    let counts = settings.counts(estimate);
    let is_impossible = counts && estimate.coefficient.value <= 0.0;
    let is_too_large = circumstances.are_innovations_too_large;
    // The event that would say more has not come: nothing is wrong, and nothing may be used yet.
    let awaited =
        [(circumstances.is_stale, Reason::EstimateStale), (!is_number, Reason::OnlyLowerBound)];
    let awaited = awaited.into_iter().find(|(is_so, _)| counts && !is_too_large && *is_so);
    let fault = match is_impossible {
        true => Some((Status::Invalid, Reason::AtBound)),
        false => awaited.map(|(_, reason)| (Status::Unestimated, reason)),
    };
    Case {
        fault,
        input: None,
        is_ready: counts,
        is_known: true,
        lacking: Status::Unestimated,
        contradiction: is_too_large.then_some(Reason::InnovationsTooLarge),
        // Only friction times ratio acts on the train, and the other factor is held as declared:
        // who reckons with both has the force that acts.
        caveat: match quantity {
            BrakingCoefficient::Adhesion => Reason::None,
            BrakingCoefficient::Friction | BrakingCoefficient::Ratio => Reason::NotIdentifiable,
        },
    }
}
