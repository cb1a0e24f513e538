//! Judgement of a recorded run by the admission that judges samples live.

use dynocar_core::pipeline::admission::Admission;
use dynocar_core::pipeline::{Echo, Outcome};
use dynocar_core::plausibility::DetectedFaults;
use dynocar_core::plausibility::diagnosis::gradient_fault;
use dynocar_core::plausibility::window_balance::WindowBalance;
use dynocar_model::force::ForceResolver;
use dynocar_shared::{RejectionReason, TrainSample};

use super::resolved::{Context, DATASET_TRAIN};

/// Judges the samples of a recorded run, one after the other, as a pipeline would.
pub(super) struct Judge {
    admission: Admission,
    resolver: ForceResolver,
    balance: WindowBalance,
    rows: usize,
    /// How many samples are refused for each reason, and the row of the first.
    refused: [(usize, usize); RejectionReason::ALL.len()],
}

impl Judge {
    /// Nothing seen yet of a run.
    pub fn new(context: Context, is_position_recorded: bool) -> Self {
        let mut admission = Admission::new(DATASET_TRAIN, context.train.clone());
        admission.set_position_measured(is_position_recorded);
        Judge {
            admission,
            resolver: ForceResolver::new(context.train.clone(), context.track.cloned()),
            balance: WindowBalance::of_all(),
            rows: 0,
            refused: [(0, 0); RejectionReason::ALL.len()],
        }
    }

    /// Takes in the sample of the next row.
    pub fn take(&mut self, sample: &TrainSample) {
        let outcome = self.admission.take(sample, &mut self.resolver, &mut Echo);
        if let Outcome::Rejected(reason) = outcome {
            let (count, first_row) = &mut self.refused[reason as usize];
            *first_row = if *count == 0 { self.rows } else { *first_row };
            *count += 1;
        }
        self.rows += 1;
        if let Some(window) = self.admission.ended_window() {
            self.balance.push(window);
        }
    }

    /// Returns the impossibilities of the samples: those that a pipeline would see, else what the run as a whole shows.
    pub fn detected(&self) -> DetectedFaults {
        let live = self.admission.detected();
        if live.is_empty() {
            gradient_fault(&self.balance).into_iter().collect()
        } else {
            live.clone()
        }
    }

    /// Returns how forces, gradients and accelerations go together over the whole run.
    pub fn balance(&self) -> WindowBalance {
        self.balance
    }

    /// The reasons for which validation refuses samples, how many, and the row of the first.
    pub fn refused(&self) -> impl Iterator<Item = (RejectionReason, usize, usize)> {
        let counts = RejectionReason::ALL.iter().copied().zip(self.refused);
        counts
            .filter(|(_, (count, _))| *count > 0)
            .map(|(reason, (count, row))| (reason, count, row))
    }
}
