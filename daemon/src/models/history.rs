//! State of each model of a train, from the decisions.

use dynocar_model::named;

use super::decision::{Action, Decision};
use super::error::ModelsError;
use super::numbered::Numbered;
use super::store::{Listing, Stored, TrainModels};
use super::text::ModelHash;

named! {
    /// State of a model.
    State ("in words") {
        /// The model is in force.
        InForce "in force";
        /// The model grew from the model in force, and no decision on it was taken.
        Candidate "candidate";
        /// The model was in force.
        Earlier "earlier";
        /// The model is not wanted.
        Rejected "rejected";
        /// Somebody declared the model, and it is not in force.
        Declared "declared";
        /// The model grew from a model that is not in force.
        Aside "aside";
    }
}

/// All that the store holds of a train.
#[derive(Clone, Debug)]
pub struct ModelHistory {
    /// The models, the oldest first, each with its state.
    pub models: Vec<(Stored, State)>,
    /// Entries among them that are not decisions.
    pub left_out: Vec<(std::path::PathBuf, String)>,
    /// The decisions, in order.
    pub decisions: Vec<Numbered<Decision>>,
    /// The model in force: by the last decision, else the one that was declared last.
    pub in_force: Option<ModelHash>,
}

impl ModelHistory {
    /// Of a train.
    ///
    /// # Errors
    ///
    /// When models or decisions cannot be read.
    pub fn from_train(train: &TrainModels) -> Result<Self, ModelsError> {
        let Listing { models, left_out } = train.list()?;
        let decisions = train.decisions()?;
        let declared = models.iter().rev().find(|it| it.origin.parent.is_none());
        let in_force = train.in_force()?.or(declared.map(|it| it.hash));
        let state = |stored: &Stored| {
            let mut own = decisions.iter().filter(|(_, it)| it.model == Some(stored.hash));
            match own.next_back().map(|(_, decision)| decision.action) {
                _ if in_force == Some(stored.hash) => State::InForce,
                Some(Action::Rejected) => State::Rejected,
                Some(_) => State::Earlier,
                None if stored.origin.parent.is_none() => State::Declared,
                None if stored.origin.parent == in_force => State::Candidate,
                None => State::Aside,
            }
        };
        let models = models.iter().map(|stored| (stored.clone(), state(stored))).collect();
        Ok(ModelHistory { models, left_out, decisions, in_force })
    }
}
