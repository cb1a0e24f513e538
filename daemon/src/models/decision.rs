//! Decisions that put a model in force or take it back, and the state of each model of a train that follows from them.

use dynocar_model::named;
use serde::{Deserialize, Serialize};

use super::error::ModelsError;
use super::moment::UtcSecond;
use super::numbered::Numbered;
use super::store::{Listing, Stored, TrainModels};
use super::text::ModelHash;

named! {
    /// Decision on a model.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    Action ("as in the files") {
        /// It is put in force.
        Adopted "adopted";
        /// The model in force is withdrawn; its predecessor is in force again.
        RolledBack "rolled_back";
        /// It is not wanted: it is no candidate any more.
        Rejected "rejected";
    }
}

/// A decision that was taken.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Decision {
    /// Decided action.
    pub action: Action,
    /// The model that was adopted or rejected, or that a rollback put in force again; absent for what
    /// the configuration declares.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelHash>,
    /// The model in force before; absent for what the configuration declares.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<ModelHash>,
    /// Who decided: a person's name, or `rule`.
    pub by: String,
    /// Why; may be empty.
    pub reason: String,
    /// When.
    pub at: UtcSecond,
}

/// A decision that is to be taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewDecision {
    /// Chosen decision.
    pub what: ModelChoice,
    /// Who decides: a person's name, or `rule`.
    pub by: String,
    /// Why; may be empty.
    pub reason: String,
    /// When.
    pub at: UtcSecond,
}

/// Choice between decisions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelChoice {
    /// Put a model of the store in force.
    Adopt(ModelHash),
    /// Put in force again what was so before the model that is.
    RollBack,
    /// Strike a model of the store off the candidates.
    Reject(ModelHash),
}

/// Returns the models in force after some decisions, the present one last, each on top of what it replaced;
/// empty while nothing but the configuration's declaration is in force.
pub fn in_force_after<'d>(decisions: impl IntoIterator<Item = &'d Decision>) -> Vec<ModelHash> {
    let mut stack = Vec::new();
    for decision in decisions {
        match (decision.action, decision.model) {
            (Action::Adopted, Some(model)) => stack.push(model),
            (Action::RolledBack, model) => {
                stack.pop();
                // The model that a rollback names as in force is in force.
                match model {
                    None => stack.clear(),
                    Some(model) if stack.last() != Some(&model) => stack.push(model),
                    Some(_) => {}
                }
            }
            _ => {}
        }
    }
    stack
}

named! {
    /// State of a model.
    State ("in words") {
        /// It is in force.
        InForce "in force";
        /// It grew from the model in force, and nothing was decided on it.
        Candidate "candidate";
        /// It was in force.
        Earlier "earlier";
        /// It is not wanted.
        Rejected "rejected";
        /// Somebody declared it, and it is not in force.
        Declared "declared";
        /// It grew from a model that is not in force.
        Aside "aside";
    }
}

/// All that the store holds of a train.
#[derive(Clone, Debug)]
pub struct ModelHistory {
    /// The models, the oldest first, each with what it is.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_rollback_goes_one_adoption_further_back() {
        let [a, b] = [1, 2].map(|hash| Some(ModelHash(hash)));
        let decision = |action, model| Decision {
            action,
            model,
            from: None,
            by: "rule".into(),
            reason: String::new(),
            at: UtcSecond { unix_s: 0 },
        };
        let (adopt, back) = (Action::Adopted, Action::RolledBack);
        let steps = [
            (adopt, a, vec![1]),
            (adopt, b, vec![1, 2]),
            (Action::Rejected, Some(ModelHash(3)), vec![1, 2]),
            (back, a, vec![1]),
            (back, None, vec![]),
            (adopt, b, vec![2]),
            (adopt, a, vec![2, 1]),
            (back, None, vec![]),
        ];
        let mut decisions = Vec::new();
        for (action, model, expected) in steps {
            decisions.push(decision(action, model));
            let expected: Vec<ModelHash> = expected.into_iter().map(ModelHash).collect();
            assert_eq!(in_force_after(&decisions), expected, "{decisions:?}");
        }
    }
}
