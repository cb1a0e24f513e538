//! State of use of a quantity: whether a controller may use it, the reason, and the condition that ends the state.

use super::{PipelineKind, Reason, Status};

vocabulary! {
    /// Whether a controller may use the values for its request, in one word.
    UseState: u32 {
        /// The values may be used, independent of the status of the estimate as a whole.
        Usable = 1 "usable",
        /// Not known well enough yet.
        Learning = 2 "learning",
        /// Known, and held back until it has held for a while without doubt.
        Confirming = 3 "confirming",
        /// Something speaks against the values or the samples.
        Doubted = 4 "doubted",
        /// There are no values: the daemon is silent, or the estimate has failed.
        Unavailable = 5 "unavailable",
    }
}

impl UseState {
    /// Returns the state of use of values whose pipeline has this status.
    pub const fn of(status: Status, is_usable: bool) -> Self {
        match status {
            Status::Invalid => UseState::Unavailable,
            _ if is_usable => UseState::Usable,
            Status::Unestimated => UseState::Learning,
            Status::Estimated => UseState::Confirming,
            Status::Degraded => UseState::Doubted,
        }
    }

    /// Returns why, in one word: the reason behind the status where there is one, else the state itself.
    pub const fn why(self, reason: Option<Reason>) -> &'static str {
        match (self, reason) {
            (UseState::Confirming, _) => self.name(),
            (UseState::Usable, Some(reason)) => reason.name(),
            (_, Some(Reason::None)) => self.name(),
            (_, Some(reason)) => reason.name(),
            (_, None) => "unknown",
        }
    }

    /// Returns the event that ends the state, in words; `reason` is the one behind the status of a pipeline of this kind.
    pub const fn ends(self, reason: Option<Reason>, kind: Option<PipelineKind>) -> &'static str {
        match (self, reason) {
            (UseState::Usable, _) => "half a second of doubt ends it",
            (UseState::Confirming, _) => {
                "2 s without doubt end it, after a doubt 5 s, after each further one twice as long, up to 10 min"
            }
            (UseState::Unavailable, Some(Reason::DaemonSilent)) => {
                "a daemon that speaks again ends it"
            }
            (_, Some(reason)) => end_of(reason, kind),
            (_, None) => "a program of the daemon's release says by its reason when",
        }
    }
}

/// Returns the event that ends a reason for which values of a kind of pipeline are not used.
const fn end_of(reason: Reason, kind: Option<PipelineKind>) -> &'static str {
    match reason {
        Reason::None | Reason::TooFewSamples | Reason::WeakExcitation => "driving ends it",
        Reason::NotIdentifiable => "driving, or one of the values that fit in train.toml, ends it",
        Reason::LoadMayHaveChanged => "the first seconds after departure end it",
        Reason::EstimateStale => "the next braking ends it",
        Reason::OnlyLowerBound => "wheels that slide end it",
        Reason::AtBound => "forces, pressures and a train.toml that fit each other end it",
        Reason::InnovationsTooLarge | Reason::InnovationsNotWhite => {
            "a model that has the missing force ends it"
        }
        Reason::BadInput => "it ends once few of the samples are refused",
        Reason::MissingQuantity => end_of_lack(kind),
        Reason::GradientUnknown => "samples with a gradient, or with a position on a track, end it",
        Reason::NumericalFailure => "an estimate learned anew ends it",
        Reason::DaemonSilent => "a daemon, or an estimate learned anew, ends it",
        Reason::ImplausibleForces => {
            "forces in the right unit, sign and order, as fresh as the speed, end it"
        }
        Reason::ImplausibleMotion => "a speed, position, time and direction that agree end it",
        Reason::ImplausibleMass => "a mass in the right unit ends it",
        Reason::ImplausibleGradient => "a gradient in the right unit and sign ends it",
        Reason::ImplausiblePressure => "a brake pressure in the right unit ends it",
    }
}

/// Returns the event that ends the lack of a quantity for a kind of pipeline.
const fn end_of_lack(kind: Option<PipelineKind>) -> &'static str {
    use PipelineKind::*;
    match kind {
        Some(AdhesionEm | AdhesionEkf | AdhesionSmoother | AdhesionLaw) => {
            "samples with a position and a brake force end it"
        }
        Some(BrakeEm | BrakeEkf | BrakeSmoother) => {
            "samples with a position, a mass and a brake-cylinder pressure, and a declared brake gear, end it"
        }
        _ => "samples with a traction and a brake force end it",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_has_an_end_and_no_driving_ends_what_the_samples_lack() {
        let kinds = [None, Some(PipelineKind::AdhesionLaw), Some(PipelineKind::TrainKalman)];
        for state in [UseState::Learning, UseState::Doubted, UseState::Unavailable] {
            for (&reason, kind) in Reason::ALL.iter().flat_map(|it| kinds.map(|kind| (it, kind))) {
                let ends = state.ends(Some(reason), kind);
                assert!(
                    ends.ends_with("end it")
                        || ends.ends_with("ends it")
                        || ends.starts_with("it ends once")
                );
                assert!(!ends.contains("its reason"), "{ends}");
                assert!(!(reason.is_of_input() && ends.contains("driving")), "{reason}: {ends}");
            }
        }
        let lacking = |kind| UseState::Learning.ends(Some(Reason::MissingQuantity), Some(kind));
        assert!(lacking(PipelineKind::AdhesionLaw).contains("a position and a brake force"));
        assert!(lacking(PipelineKind::BrakeSmoother).contains("pressure"));
        assert!(Reason::BadInput.is_of_input() && !Reason::TooFewSamples.is_of_input());
    }

    #[test]
    fn what_is_not_usable_never_gives_none_for_a_reason() {
        for &status in Status::ALL {
            for &reason in Reason::ALL {
                let state = UseState::of(status, false);
                assert_ne!(state, UseState::Usable);
                assert_ne!(state.why(Some(reason)), "none", "{status} ({reason})");
            }
            let is_usable = UseState::of(status, true) == UseState::Usable;
            assert_eq!(is_usable, status != Status::Invalid);
        }
        let held_back = UseState::of(Status::Estimated, false);
        assert_eq!(held_back.why(Some(Reason::AtBound)), "confirming");
        let failed = UseState::of(Status::Invalid, true);
        assert_eq!(failed.why(Some(Reason::NumericalFailure)), "numerical_failure");
    }
}
