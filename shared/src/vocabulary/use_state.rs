//! State of use of a quantity: whether a controller may use it, the reason, and the condition that ends the state.

use super::{Reason, Status};

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

    /// Returns the event that ends the state, in words; `reason` is the one behind the status.
    pub const fn ends(self, reason: Option<Reason>) -> &'static str {
        match (self, reason) {
            (UseState::Usable, _) => "half a second of doubt ends it",
            (UseState::Learning, Some(reason)) if reason.is_of_input() => "it ends with its reason",
            (UseState::Learning, Some(Reason::OnlyLowerBound)) => "wheels that slide end it",
            (UseState::Learning, _) => "driving ends it",
            (UseState::Confirming, _) => {
                "2 s without doubt end it, after a doubt 5 s, after each further one twice as long, up to 10 min"
            }
            (UseState::Doubted, _) => "it ends with its reason",
            (UseState::Unavailable, _) => "a daemon, or an estimate learned anew, ends it",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_driving_ends_what_the_samples_lack() {
        for &reason in Reason::ALL {
            let is_by_driving = UseState::Learning.ends(Some(reason)) == "driving ends it";
            let is_by_sliding = reason == Reason::OnlyLowerBound;
            assert_eq!(is_by_driving, !reason.is_of_input() && !is_by_sliding, "{reason}");
        }
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
