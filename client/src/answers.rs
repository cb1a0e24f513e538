//! Which pipeline answers which quantity, as the daemon says in its snapshots.

use dynocar_shared::{ParameterSnapshot, Quantity};

/// Why there is no reading of a quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoAnswer {
    /// No daemon has been heard of, or not yet the pipeline that answers.
    #[error("no snapshot of the pipeline that answers has come yet")]
    NoSnapshot,
    /// The daemon is there, and its configuration lets no pipeline answer this for the train.
    #[error("the daemon's configuration lets no pipeline answer this quantity for the train")]
    NotProvided,
}

impl NoAnswer {
    /// The reason's name, in addition to those of [`dynocar_shared::Reason`].
    pub const fn name(self) -> &'static str {
        match self {
            NoAnswer::NoSnapshot => "no_snapshot",
            NoAnswer::NotProvided => "not_provided",
        }
    }
}

/// The pipelines that answer, learned from the snapshots of the newest daemon.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Answers {
    epoch: u64,
    /// Bits of the quantities that any pipeline answers; `None` before the first snapshot.
    provided: Option<u32>,
    /// Number of the pipeline that answers, by quantity.
    indices: [Option<usize>; Quantity::ALL.len()],
}

impl Answers {
    /// Takes in what a snapshot says; another daemon may have another configuration.
    pub(crate) fn learn(&mut self, snapshot: &ParameterSnapshot) {
        if snapshot.epoch < self.epoch {
            return;
        }
        if snapshot.epoch > self.epoch {
            *self = Answers { epoch: snapshot.epoch, ..Answers::default() };
        }
        self.provided = Some(snapshot.train_quantities);
        for &quantity in Quantity::ALL {
            if snapshot.answers(quantity) {
                self.indices[quantity as usize] = Some(snapshot.pipeline_index as usize);
            }
        }
    }

    /// The number of the pipeline that answers a quantity.
    pub(crate) fn index(&self, quantity: Quantity) -> Result<usize, NoAnswer> {
        let is_provided = self.provided.is_none_or(|bits| bits & quantity.bit() != 0);
        let why = if is_provided { NoAnswer::NoSnapshot } else { NoAnswer::NotProvided };
        self.indices[quantity as usize].ok_or(why)
    }
}
