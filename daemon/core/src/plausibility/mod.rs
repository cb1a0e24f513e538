//! Whether samples can be true: wrong units, swapped forces, reversed signs.
//!
//! The same laws judge a train's samples live ([`Plausibility`] in every
//! [`Pipeline`](crate::pipeline::Pipeline)), recorded runs ([`of_samples`]) and what is declared
//! ([`declared`]).
//!
//! # Layout, in the order of the work
//!
//! - [`watch`]: sample by sample, with [`balance`] (forces against acceleration) and [`pressure`]
//! - [`diagnosis`]: which slip makes all figures come out as they did
//! - [`slip`]: the slips, their names and severity; [`words`]: a finding in a sentence
//! - [`declared`]: the train's and the line's own figures

pub mod balance;
pub mod declared;
pub mod diagnosis;
pub mod pressure;
pub mod slip;
pub mod watch;
pub mod words;

use std::sync::Arc;

use dynocar_shared::{RejectionReason, SampleField, TrainSample};

pub use diagnosis::Findings;
pub use slip::{Finding, Severity, Slip};

use crate::dataset::DATASET_TRAIN;
use crate::force::ForceResolver;
use crate::track::Track;
use crate::train::TrainModel;
use crate::validation::{ValidationLimits, Validator};
use watch::Watch;

/// Judges the samples of one train as they come.
#[derive(Clone, Debug)]
pub struct Plausibility {
    train: Arc<TrainModel>,
    watch: Watch,
    findings: Findings,
}

impl Plausibility {
    /// Nothing seen yet of a train.
    pub fn new(train: Arc<TrainModel>) -> Self {
        Plausibility { watch: Watch::new(&train), train, findings: Findings::default() }
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
        if self.watch.take(&self.train, sample, is_valid, gradient_permille) {
            self.findings = diagnosis::diagnose(&self.watch.figures());
        }
    }

    /// What cannot be true of the samples lately.
    pub fn findings(&self) -> &Findings {
        &self.findings
    }
}

/// Judges the samples of a recorded run; positions that were integrated from the speed tell
/// nothing about it.
pub fn of_samples(
    train: &Arc<TrainModel>,
    track: Option<&Arc<Track>>,
    samples: &[TrainSample],
    is_position_recorded: bool,
) -> Findings {
    let limits = ValidationLimits::for_train(train.mass_kg);
    let mut validator = Validator::new(DATASET_TRAIN, train.mass_kg, limits);
    let mut resolver = ForceResolver::new(Arc::clone(train), track.cloned());
    let mut plausibility = Plausibility::new(Arc::clone(train));
    for sample in samples {
        let resolved = validator.check(sample).map(|valid| resolver.resolve(&valid));
        let gradient_permille = match &resolved {
            Ok(resolved) => resolved.gradient_permille,
            Err(_) => resolver.stated_gradient_permille(sample),
        };
        let mut sample = *sample;
        if !is_position_recorded {
            sample.valid &= !SampleField::Position.bit();
        }
        plausibility.take(&sample, resolved.map(drop), gradient_permille);
    }
    *plausibility.findings()
}
