//! Which models are on trial next to the one in force.

use crate::models::{Action, ModelHash, ModelsError, TrainModels};

/// A train's model in force and its rivals, by the store's decisions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Standing {
    /// The model in force.
    pub in_force: ModelHash,
    /// What was in force before, to which a rollback leads; `None` for a model that nothing preceded.
    pub before: Option<ModelHash>,
    /// On trial: what was in force before, the model taken back last, and the candidates.
    pub rivals: Vec<ModelHash>,
}

/// Where a train's models stand; `declared` is what the configuration declares. At most
/// `candidates_max` candidates are on trial: those that the configuration names, else the newest.
///
/// # Errors
///
/// When the store cannot be read.
pub fn standing(
    models: &TrainModels,
    declared: ModelHash,
    (named, candidates_max): (Option<&[ModelHash]>, usize),
) -> Result<Standing, ModelsError> {
    let decisions = models.decisions()?;
    let mut stack = vec![declared];
    stack.extend(crate::models::decision::in_force_after(decisions.iter().map(|(_, it)| it)));
    let in_force = stack.pop().unwrap_or(declared);
    let before = stack.pop();
    let is_rejected = |hash: ModelHash| {
        let last = decisions.iter().rev().find(|(_, it)| it.model == Some(hash));
        last.is_some_and(|(_, it)| it.action == Action::Rejected)
    };
    let last_taken_back = decisions.iter().rev().find(|(_, it)| it.action == Action::RolledBack);
    let candidates = match named {
        Some(named) => named.to_vec(),
        None => models.candidates(in_force)?,
    };
    let mut rivals: Vec<ModelHash> = Vec::new();
    let taken_back = last_taken_back.and_then(|(_, it)| it.from);
    let others = before.into_iter().chain(taken_back);
    for rival in others.chain(candidates.into_iter().take(candidates_max)) {
        if rival != in_force && !rivals.contains(&rival) && !is_rejected(rival) {
            rivals.push(rival);
        }
    }
    Ok(Standing { in_force, before, rivals })
}
