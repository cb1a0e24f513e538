//! What helps where driving does not.

use dynocar_shared::{Manoeuvre, Reason, Status};

/// What lifts a reservation that no manoeuvre lifts; `None` where there is none, or driving helps.
pub const fn remedy(status: Status, reason: Option<Reason>) -> Option<&'static str> {
    let Some(reason) = reason else {
        return Some("a newer daemon gives a reason that is unknown here");
    };
    Some(match reason {
        Reason::None | Reason::TooFewSamples | Reason::WeakExcitation => return None,
        Reason::AtBound if matches!(status, Status::Estimated) => return None,
        Reason::NotIdentifiable if matches!(status, Status::Estimated) => return None,
        Reason::NotIdentifiable => "other values fit as well: give one of them in the train's file",
        Reason::AtBound => "the data contradict the model: check forces and pressures",
        Reason::InnovationsTooLarge | Reason::InnovationsNotWhite => {
            "the model lacks a force: record a run, dynocar explain says which"
        }
        Reason::BadInput => "many samples are refused: see the reasons by pipeline",
        Reason::MissingQuantity => "the controller must send what the pipeline's page asks for",
        Reason::GradientUnknown => "declare a track and send the position, or send the gradient",
        Reason::NumericalFailure => {
            "it learns anew: wait; should it come again, keep the recording"
        }
        Reason::EstimateStale => "of an earlier braking: the next braking renews it",
        Reason::OnlyLowerBound => {
            "the rail carries at least this; more shows only when wheels slide"
        }
        Reason::DaemonSilent => "the daemon is silent: see dynocar health and its log",
        Reason::ImplausibleForces => "forces cannot be true: check their unit, sign and order",
        Reason::ImplausibleMotion => {
            "speed, position or time cannot be true: check units and signs"
        }
        Reason::ImplausibleMass => "the mass cannot be true: check its unit",
        Reason::ImplausibleGradient => "the gradient cannot be true: check its unit and sign",
        Reason::ImplausiblePressure => "the brake pressure cannot be true: check its unit",
    })
}

/// What a manoeuvre is that a pipeline lacks, where no numbers can be given yet.
pub const fn in_words(manoeuvre: Manoeuvre) -> &'static str {
    match manoeuvre {
        Manoeuvre::CoastSlow => "coasting at low speed",
        Manoeuvre::CoastFast => "coasting at high speed",
        Manoeuvre::VarySpeed => "driving at other speeds",
        Manoeuvre::Accelerate => "strong traction",
        Manoeuvre::Brake => "strong braking",
        Manoeuvre::Move => "driving",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reservation_that_driving_does_not_lift_has_a_remedy() {
        for &reason in Reason::ALL {
            let advice = remedy(Status::Degraded, Some(reason));
            let is_driven =
                matches!(reason, Reason::None | Reason::TooFewSamples | Reason::WeakExcitation);
            assert_eq!(advice.is_none(), is_driven, "{reason}");
            assert!(advice.is_none_or(|words| words.len() <= 72), "fits a line of 80: {reason}");
        }
        assert_eq!(remedy(Status::Estimated, Some(Reason::AtBound)), None);
    }
}
