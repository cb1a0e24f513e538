//! Decisions on models: who put which model in force, who took it back, and the resulting model in force.

use dynocar_model::named;
use serde::{Deserialize, Serialize};

use super::text::ModelHash;
use crate::stamp::UtcSecond;

named! {
    /// Decision on a model.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    Action ("as in the files") {
        /// The model is put in force.
        Adopted "adopted";
        /// The model in force is withdrawn; its predecessor is in force again.
        RolledBack "rolled_back";
        /// The model is not wanted: it is no candidate any more.
        Rejected "rejected";
    }
}

/// A decision that was taken.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Decision {
    /// Decided action.
    pub action: Action,
    /// The model that was adopted or rejected, or that a rollback put in force again; absent for the declared model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelHash>,
    /// The model in force before; absent for the declared model.
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
    /// Put the predecessor of the model in force in force again.
    RollBack,
    /// Strike a model of the store off the candidates.
    Reject(ModelHash),
}

/// Returns the models in force after some decisions, the present one last, each after its predecessor; empty while
/// nothing but the configuration's declaration is in force.
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
