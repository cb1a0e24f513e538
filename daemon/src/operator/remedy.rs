//! What a person does about what the daemon says.

use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{Reason, RejectionReason};

/// What to do about a pipeline with this reason.
pub const fn of_reason(reason: Reason) -> &'static str {
    match reason {
        Reason::None
        | Reason::TooFewSamples
        | Reason::WeakExcitation
        | Reason::EstimateStale
        | Reason::OnlyLowerBound
        | Reason::NotIdentifiable => "drive on: more of the data that the pipeline needs will come",
        Reason::AtBound => {
            "check the units and signs of forces and pressures, and the train's file"
        }
        Reason::InnovationsTooLarge | Reason::InnovationsNotWhite => {
            "record a run and let `dynocar explain` say which force the model lacks"
        }
        Reason::BadInput => "mend the samples by the reasons for which they are refused",
        Reason::MissingQuantity => "let the controller send what the pipeline needs",
        Reason::GradientUnknown => "let the controller send its position or the gradient",
        Reason::NumericalFailure => "nothing at once, it learns anew; report it when it comes back",
        Reason::DaemonSilent => "look whether the daemon runs, and start it",
        Reason::ImplausibleForces
        | Reason::ImplausibleMotion
        | Reason::ImplausibleMass
        | Reason::ImplausibleGradient
        | Reason::ImplausiblePressure => {
            "mend units and signs of what the controller sends; the log names the input fault"
        }
    }
}

/// What to do where samples are refused for this reason; `None` where it is as it should be.
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
        RejectionReason::Frozen => "look for a bus that repeats its last value",
    })
}

/// What to do where this effect is suspected.
pub const fn of_suspect(effect: EffectKind) -> &'static str {
    match effect {
        EffectKind::DraggingBrake => {
            "look at the next stop whether every brake releases and no disc is hot"
        }
        EffectKind::MassChange => "check the declared mass against the load",
        EffectKind::WheelDiameter => "check the wheel diameter set in the speed sensor",
        EffectKind::TractionGain => "check the scale of the reported forces",
        EffectKind::ActuatorDelay => "check how late forces act after they are reported",
        EffectKind::SpeedDelay => "check how old a speed is when the controller reads it",
        EffectKind::RotatingMass => "check the declared rotating mass",
        EffectKind::LowAdhesion => {
            "expect long braking distances: the rail carries less than the brake asks"
        }
        EffectKind::GradientShift | EffectKind::GradientError => {
            "check the line's gradient profile and where it begins"
        }
        EffectKind::LocalResistance => "look at the track and the overhead line at that place",
        EffectKind::TunnelDrag | EffectKind::CurveResistance => {
            "declare it: `dynocar explain` on a recorded run writes it into the line's files"
        }
        EffectKind::Wind | EffectKind::BearingTemperature | EffectKind::AmbientTemperature => {
            "nothing on the train: the weather passes; `dynocar explain` gives its size"
        }
        EffectKind::None | EffectKind::Unknown => {
            "record a run and let `dynocar explain` say which force the model lacks"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_remedy_is_one_plain_line() {
        let reasons = Reason::ALL.iter().map(|&it| of_reason(it));
        let refusals = RejectionReason::ALL.iter().filter_map(|&it| of_refusal(it));
        let suspects = EffectKind::ALL.iter().map(|&it| of_suspect(it));
        for words in reasons.chain(refusals).chain(suspects) {
            assert!((10..120).contains(&words.len()) && !words.ends_with('.'), "{words}");
        }
    }
}
