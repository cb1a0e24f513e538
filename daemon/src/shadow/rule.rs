//! Rules for models on trial: selection, adoption, rollback, and the bounds that no model may leave.

use std::collections::BTreeMap;

use dynocar_core::trial::Rival;
use serde::Deserialize;
use toml::Table;

use crate::models::records::ModelChoice;
use crate::models::{Action, ModelHash, ModelText, ModelsError, TrainModels};

/// Who adopts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Adopt {
    /// A person, by `dynocar models adopt`; the log says when a rival is better.
    #[default]
    Ask,
    /// The rule, as soon as there is evidence enough.
    WhenBetter,
}

/// Conditions that a rival must meet, and limits that it may not exceed.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// Who adopts.
    pub adopt: Adopt,
    /// Share of the open-loop error that a rival must take away to count as better.
    pub least_gain: f64,
    /// While no rival is better, no rival is taken for better before this many trips on average, however many are
    /// on trial.
    pub trips_between_mistakes: f64,
    /// Keys of a train's file as `resistance.a`, with the least and the greatest value.
    pub bounds: BTreeMap<String, [f64; 2]>,
}

impl Rule {
    /// Returns whether one of `rivals` rivals has shown that it is better.
    pub fn is_better(&self, rival: &Rival, rivals: usize) -> bool {
        rival.evidence.e_value() >= self.trips_between_mistakes * rivals as f64
    }

    /// Returns the choice when a rival is better: to take back the model in force, if the rival was in force before
    /// it, else to adopt the rival.
    pub fn choice(standing: &ModelStanding, rival: ModelHash) -> ModelChoice {
        match standing.before {
            Some(before) if before == rival => ModelChoice::RollBack,
            _ => ModelChoice::Adopt(rival),
        }
    }

    /// Describes the parts of a model outside the bounds; `None` when there are none.
    pub fn outside(&self, text: &ModelText) -> Option<String> {
        let table: Table = text.train.parse().ok()?;
        self.bounds.iter().find_map(|(key, [low, high])| {
            let value = number(&table, key)?;
            let is_outside = !(*low..=*high).contains(&value);
            is_outside.then(|| format!("{key} = {value}: expected {low} to {high}"))
        })
    }
}

/// Returns the number that a train's file holds under `table.key`.
fn number(table: &Table, key: &str) -> Option<f64> {
    let mut parts = key.split('.');
    let first = table.get(parts.next()?)?;
    let value = parts.try_fold(first, |value, part| value.get(part))?;
    value.as_float().or_else(|| value.as_integer().map(|it| it as f64))
}

/// A train's model in force and its rivals, by the store's decisions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelStanding {
    /// The model in force.
    pub in_force: ModelHash,
    /// Model in force before, to which a rollback leads; `None` for a model without a predecessor.
    pub before: Option<ModelHash>,
    /// On trial: the model in force before, the model taken back last, and the candidates.
    pub rivals: Vec<ModelHash>,
}

/// Returns the standing of a train's models; `declared` is the model that the configuration declares. At most
/// `candidates_max` candidates are on trial: those that the configuration names, else the newest.
///
/// # Errors
///
/// When the store cannot be read.
pub fn standing(
    models: &TrainModels,
    declared: ModelHash,
    (named, candidates_max): (Option<&[ModelHash]>, usize),
) -> Result<ModelStanding, ModelsError> {
    let decisions = models.decisions()?;
    let mut stack = vec![declared];
    stack.extend(crate::models::records::in_force_after(decisions.iter().map(|(_, it)| it)));
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
    Ok(ModelStanding { in_force, before, rivals })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_outside_its_bounds_is_named_with_key_value_and_bounds() {
        let rule = Rule {
            adopt: Adopt::Ask,
            least_gain: 0.1,
            trips_between_mistakes: 1e5,
            bounds: [("resistance.a".to_owned(), [0.5, 3.0])].into(),
        };
        let text = |a: &str| ModelText { train: format!("[resistance]\na = {a}"), track: None };
        assert_eq!(rule.outside(&text("2")), None);
        let outside = rule.outside(&text("3.5")).unwrap();
        assert_eq!(outside, "resistance.a = 3.5: expected 0.5 to 3");
    }
}
