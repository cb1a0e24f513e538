//! Remedies for the daemon's reasons.

use dynocar_shared::{Reason, RejectionReason};

/// Returns the remedy for a pipeline with this reason, in a line of at most 72 characters.
pub const fn of_reason(reason: Reason) -> &'static str {
    match reason {
        Reason::None | Reason::TooFewSamples | Reason::WeakExcitation => {
            "drive on: more of the data that the pipeline needs will come"
        }
        Reason::NotIdentifiable => {
            "drive on, or give one of the values that fit as well in train.toml"
        }
        Reason::LoadMayHaveChanged => "nothing: the first seconds after departure weigh the load",
        Reason::EstimateStale => "of an earlier braking: the next braking renews it",
        Reason::OnlyLowerBound => {
            "the rail carries at least this; more shows only when wheels slide"
        }
        Reason::AtBound => "check units and signs of forces and pressures, and train.toml",
        Reason::InnovationsTooLarge | Reason::InnovationsNotWhite => {
            "record a run and let `dynocar explain` say which force is missing"
        }
        Reason::BadInput => "mend the samples by the reasons for which they are refused",
        Reason::MissingQuantity => "let the controller send what the pipeline needs",
        Reason::GradientUnknown => {
            "declare a track and let the controller send position or gradient"
        }
        Reason::NumericalFailure => "wait, it learns anew; report it when it comes back",
        Reason::DaemonSilent => "look whether the daemon runs, and start it",
        Reason::ImplausibleForces => "forces cannot be true: check their unit, sign, order and age",
        Reason::ImplausibleMotion => {
            "speed, position or time cannot be true: check units and signs"
        }
        Reason::ImplausibleMass => "the mass cannot be true: check its unit",
        Reason::ImplausibleGradient => "the gradient cannot be true: check its unit and sign",
        Reason::ImplausiblePressure => "the brake pressure cannot be true: check its unit",
    }
}

/// Returns the remedy where samples are refused for this reason; `None` where nothing is to be done.
pub const fn of_refusal(reason: RejectionReason) -> Option<&'static str> {
    Some(match reason {
        RejectionReason::Outlier | RejectionReason::WheelSlide => return None,
        RejectionReason::TimeNotIncreasing => "check the controller's clock",
        RejectionReason::TimeJump => "look for gaps in the controller's cycle",
        RejectionReason::SequenceNotIncreasing => {
            "look for a second publisher, or numbers written by hand"
        }
        RejectionReason::WrongTrain => "check the train's number in the controller",
        RejectionReason::Missing => "check the bits of `valid` that the controller sets",
        RejectionReason::NotFinite => "leave the bit out where a quantity is not known",
        RejectionReason::SpeedOutOfRange => "check the unit of the speed, m/s",
        RejectionReason::SpeedJump => "check the speed sensor",
        RejectionReason::PositionJump => "check the position's unit, m, and the line's file",
        RejectionReason::ForceOutOfRange => "check the forces' unit, N of the whole train",
        RejectionReason::MassOutOfRange => "check the mass's unit, kg",
        RejectionReason::BadDirection => "send +1 or -1 as the direction",
        RejectionReason::OutOfRange => "check the units of pressure, temperature and gradient",
        RejectionReason::Repeated => "look for a bus or a sender that repeats its last values",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_remedy_is_one_plain_line() {
        let reasons = Reason::ALL.iter().map(|&it| of_reason(it));
        let refusals = RejectionReason::ALL.iter().filter_map(|&it| of_refusal(it));
        for words in reasons.chain(refusals) {
            assert!((10..=72).contains(&words.len()) && !words.ends_with('.'), "{words}");
        }
    }
}
