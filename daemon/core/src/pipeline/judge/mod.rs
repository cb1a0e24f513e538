//! One judge of what an estimate may be used for, whichever estimator it is from.
//!
//! - [`InputHealth`]: whether the samples serve the estimator
//! - [`InnovationMonitor`]: whether the innovations are as large and as white as the covariance says
//! - [`LackOfFit`]: whether a force that no parameter explains stays
//! - [`Case`]: all that is known of an estimate, and the verdict on it

mod innovations;
mod input;
mod lack_of_fit;

pub use innovations::{
    InnovationMonitor, LONG_RUN_MAX, are_alike, are_too_large, long_run_variance,
};
pub use input::{InputHealth, missing};
pub use lack_of_fit::LackOfFit;

use dynocar_shared::{Reason, Status};

/// All that is known of an estimate when it is judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// What takes the place of any judgement, as a numerical failure.
    pub fault: Option<(Status, Reason)>,
    /// What is wrong with the samples lately.
    pub input: Option<Reason>,
    /// True when enough samples were used.
    pub is_ready: bool,
    /// True when the intervals are narrow enough.
    pub is_known: bool,
    /// The status while one of these is lacking.
    pub lacking: Status,
    /// What contradicts an estimate that is known.
    pub contradiction: Option<Reason>,
    /// What is to be said of one that nothing contradicts.
    pub caveat: Reason,
}

impl Case {
    /// Status and reason.
    pub fn verdict(&self) -> (Status, Reason) {
        let is_there = self.is_ready && self.is_known;
        if let Some(fault) = self.fault {
            fault
        } else if let Some(reason) = self.input {
            (if is_there { Status::Degraded } else { self.lacking }, reason)
        } else if !self.is_ready {
            (self.lacking, Reason::TooFewSamples)
        } else if !self.is_known {
            (self.lacking, Reason::WeakExcitation)
        } else if let Some(reason) = self.contradiction {
            (Status::Degraded, reason)
        } else {
            (Status::Estimated, self.caveat)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_names_what_is_lacking_before_what_contradicts() {
        let good = Case {
            fault: None,
            input: None,
            is_ready: true,
            is_known: true,
            lacking: Status::Unestimated,
            contradiction: None,
            caveat: Reason::AtBound,
        };
        let contradiction = Some(Reason::InnovationsTooLarge);
        let input = Some(Reason::BadInput);
        let fault = Some((Status::Invalid, Reason::NumericalFailure));
        for (case, expected) in [
            (good, (Status::Estimated, Reason::AtBound)),
            (Case { contradiction, ..good }, (Status::Degraded, Reason::InnovationsTooLarge)),
            (
                Case { contradiction, is_known: false, ..good },
                (Status::Unestimated, Reason::WeakExcitation),
            ),
            (
                Case { is_known: false, is_ready: false, ..good },
                (Status::Unestimated, Reason::TooFewSamples),
            ),
            (Case { input, contradiction, ..good }, (Status::Degraded, Reason::BadInput)),
            (Case { input, is_known: false, ..good }, (Status::Unestimated, Reason::BadInput)),
            (Case { fault, input, ..good }, (Status::Invalid, Reason::NumericalFailure)),
        ] {
            assert_eq!(case.verdict(), expected, "{case:?}");
        }
    }
}
