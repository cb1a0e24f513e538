//! Whether samples can be true: wrong units, swapped forces, reversed signs.
//!
//! The same laws judge a train's samples live ([`Plausibility`] in every
//! [`Pipeline`](crate::pipeline::Pipeline)) and recorded runs.
//!
//! # Layout, in the order of the work
//!
//! - [`watch`]: sample by sample, with [`window_balance`] (forces against acceleration)
//! - [`diagnosis`]: which input fault makes all figures come out as they did
//! - [`input_fault`]: the input faults, their names, severity and words

pub mod diagnosis;
pub mod input_fault;
pub mod watch;
pub mod window_balance;

use std::sync::Arc;

use dynocar_model::train::TrainModel;
use dynocar_shared::{RejectionReason, TrainSample};

pub use diagnosis::DetectedFaults;
pub use input_fault::{DetectedFault, InputFault, Severity};

use watch::PlausibilityWatch;
use window_balance::WindowMean;

/// Judges the samples of one train as they come.
#[derive(Clone, Debug)]
pub struct Plausibility {
    watch: PlausibilityWatch,
    detected: DetectedFaults,
}

impl Plausibility {
    /// Nothing seen yet of a train.
    pub fn new(train: Arc<TrainModel>) -> Self {
        Plausibility { watch: PlausibilityWatch::new(train), detected: DetectedFaults::default() }
    }

    /// Takes in a sample with what validation said of it, and the gradient in ‰ along the travel.
    ///
    /// Samples that were refused for a value out of range count as well: the range may be what is
    /// missed.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation: a few sums at a sample, a solution of five equations at the
    /// end of a window.
    pub fn take(
        &mut self,
        sample: &TrainSample,
        verdict: Result<(), RejectionReason>,
        gradient_permille: Option<f64>,
    ) {
        let is_valid = match verdict {
            Ok(()) => true,
            Err(
                RejectionReason::MassOutOfRange
                | RejectionReason::ForceOutOfRange
                | RejectionReason::SpeedOutOfRange
                | RejectionReason::OutOfRange
                | RejectionReason::PositionJump
                | RejectionReason::TimeJump,
            ) => false,
            Err(_) => return,
        };
        if self.watch.take(sample, is_valid, gradient_permille) {
            self.detected = diagnosis::diagnose(&self.watch.figures());
        }
    }

    /// Returns the means of the window that the last sample ended; `None` where it ended none.
    pub fn ended_window(&self) -> Option<&WindowMean> {
        self.watch.ended()
    }

    /// Returns the recent impossibilities of the samples.
    pub fn detected(&self) -> &DetectedFaults {
        &self.detected
    }
}
