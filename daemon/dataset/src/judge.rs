//! Judgement of a recorded run by validation and the laws that judge samples live.

use dynocar_core::plausibility::diagnosis::gradient_fault;
use dynocar_core::plausibility::window_balance::WindowBalance;
use dynocar_core::plausibility::{DetectedFaults, Plausibility};
use dynocar_model::force::ForceResolver;
use dynocar_model::validation::Validator;
use dynocar_shared::{RejectionReason, SampleField, TrainSample};

use super::resolved::{Context, DATASET_TRAIN};

/// Judges the samples of a recorded run, one after the other, as a pipeline would.
pub(super) struct Judge {
    validator: Validator,
    resolver: ForceResolver,
    plausibility: Plausibility,
    balance: WindowBalance,
    /// False for positions that were integrated from the speed, which show nothing about it.
    is_position_recorded: bool,
    rows: usize,
    /// How many samples are refused for each reason, and the row of the first.
    refused: [(usize, usize); RejectionReason::ALL.len()],
}

impl Judge {
    /// Nothing seen yet of a run.
    pub fn new(context: Context, is_position_recorded: bool) -> Self {
        let nominal_mass_kg = context.train.mass_kg;
        Judge {
            validator: Validator::new(DATASET_TRAIN, nominal_mass_kg),
            resolver: ForceResolver::new(context.train.clone(), context.track.cloned()),
            plausibility: Plausibility::new(context.train.clone()),
            balance: WindowBalance::of_all(),
            is_position_recorded,
            rows: 0,
            refused: [(0, 0); RejectionReason::ALL.len()],
        }
    }

    /// Takes in the sample of the next row.
    pub fn take(&mut self, sample: &TrainSample) {
        let resolved = self.validator.check(sample).map(|valid| self.resolver.resolve(&valid));
        let gradient_permille = match &resolved {
            Ok(resolved) => resolved.gradient_permille,
            Err(_) => self.resolver.stated_gradient_permille(sample),
        };
        if let Err(reason) = resolved {
            let (count, first_row) = &mut self.refused[reason as usize];
            *first_row = if *count == 0 { self.rows } else { *first_row };
            *count += 1;
        }
        self.rows += 1;
        let mut sample = *sample;
        if !self.is_position_recorded {
            sample.valid &= !SampleField::Position.bit();
        }
        self.plausibility.take(&sample, resolved.map(drop), gradient_permille);
        if let Some(window) = self.plausibility.ended_window() {
            self.balance.push(window);
        }
    }

    /// Returns the impossibilities of the samples: those that a pipeline would see, else what the run as a whole shows.
    pub fn detected(&self) -> DetectedFaults {
        let live = self.plausibility.detected();
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
