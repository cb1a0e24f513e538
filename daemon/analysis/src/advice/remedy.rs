//! Remedies where driving does not help.

use dynocar_core::remedy::of_reason;
use dynocar_shared::{Manoeuvre, Reason, Status};

/// Returns the remedy of a reservation that no manoeuvre lifts; `None` where there is no reservation, or driving
/// helps.
pub const fn remedy(status: Status, reason: Option<Reason>) -> Option<&'static str> {
    match reason {
        None => Some("a newer daemon gives a reason that is unknown here"),
        Some(Reason::None | Reason::TooFewSamples | Reason::WeakExcitation) => None,
        Some(Reason::AtBound | Reason::NotIdentifiable) if matches!(status, Status::Estimated) => {
            None
        }
        Some(reason) => Some(of_reason(reason)),
    }
}

/// Returns the name of a manoeuvre that a pipeline lacks, where no numbers can be given yet.
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
