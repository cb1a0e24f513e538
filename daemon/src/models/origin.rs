//! Additions of learning to the store: the origin of a model, and maintenance events.

use std::collections::BTreeMap;

use dynocar_model::words;
use dynocar_shared::HALF_95;
use serde::{Deserialize, Serialize};

use super::text::ModelHash;
use crate::stamp::UtcSecond;

/// A number with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelFigure {
    /// The number, in the unit of its name.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
}

impl ModelFigure {
    /// Returns half the width of the 95 % interval.
    pub fn half_width(self) -> f64 {
        HALF_95 * self.std
    }

    /// Returns whether the 95 % intervals of both overlap.
    pub fn agrees_with(self, other: ModelFigure) -> bool {
        (self.value - other.value).abs() <= self.half_width() + other.half_width()
    }

    /// Returns the number as one of an effect, in words; `None` without an interval.
    pub fn of_effect(self, name: &str) -> Option<String> {
        words::figure(name, self.value, self.half_width())
    }

    /// Returns the number under its name, with its 95 % interval.
    pub fn shown(self, name: &str) -> String {
        let half = self.half_width();
        let decimals = (1.0 - half.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
        format!("{name} = {:.decimals$} ± {half:.decimals$}", self.value)
    }
}

/// An effect that a model adds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FoundEffect {
    /// Its kind.
    pub kind: String,
    /// Where on the line it acts, in m; empty where it is tied to no place.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub intervals_m: Vec<[f64; 2]>,
    /// Its numbers by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<String, ModelFigure>,
}

impl FoundEffect {
    /// Returns true for an effect of the same kind, at the same places, whose numbers agree.
    pub fn is_same_as(&self, other: &FoundEffect) -> bool {
        let meets = |[from, to]: [f64; 2], others: &[[f64; 2]]| {
            others.iter().any(|other| from <= other[1] && other[0] <= to)
        };
        let within = |some: &[[f64; 2]], others: &[[f64; 2]]| {
            some.is_empty() == others.is_empty() && some.iter().all(|it| meets(*it, others))
        };
        let agree = |(name, figure): (&String, &ModelFigure)| {
            other.parameters.get(name).is_none_or(|other| figure.agrees_with(*other))
        };
        self.kind == other.kind
            && within(&self.intervals_m, &other.intervals_m)
            && within(&other.intervals_m, &self.intervals_m)
            && self.parameters.iter().all(agree)
    }
}

/// A file that a model was learned from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SourceFile {
    /// Its path in the dataset.
    pub path: String,
    /// SHA-256 of its content.
    pub sha256: String,
}

/// Open-loop errors in m/s on runs held out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOutError {
    /// Of the model before.
    pub before_mps: f64,
    /// Of this model.
    pub after_mps: f64,
}

/// Where a model came from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// When it was made.
    pub made: UtcSecond,
    /// Version of the program that made it.
    pub version: String,
    /// The command that made it; empty for one that somebody wrote.
    pub command: String,
    /// The model that it grew from; absent for one that somebody declared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent: Option<ModelHash>,
    /// The verdict of `explain`; absent for one that somebody declared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<String>,
    /// Description of the model, in a sentence or two.
    pub statement: String,
    /// SHA-256 over the list of files, as the report states it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dataset_sha256: Option<String>,
    /// The errors before and after, where runs were held out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<HeldOutError>,
    /// Effects that it adds to its parent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<FoundEffect>,
    /// The files of the dataset that it was learned from.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<SourceFile>,
}

impl Origin {
    /// Of a model that somebody wrote, perhaps from another: nothing was learned.
    pub fn written(statement: &str, parent: Option<ModelHash>, made: UtcSecond) -> Self {
        Origin {
            made,
            version: env!("CARGO_PKG_VERSION").into(),
            command: String::new(),
            parent,
            verdict: None,
            statement: statement.into(),
            dataset_sha256: None,
            error: None,
            effects: Vec::new(),
            files: Vec::new(),
        }
    }

    /// Returns whether both models add the same effects, within their intervals.
    pub fn adds_the_same_as(&self, other: &Origin) -> bool {
        let has = |effects: &[FoundEffect], it: &FoundEffect| {
            effects.iter().any(|other| it.is_same_as(other))
        };
        self.effects.len() == other.effects.len()
            && self.effects.iter().all(|it| has(&other.effects, it))
            && other.effects.iter().all(|it| has(&self.effects, it))
    }

    /// Describes the additions of the model, in a few words.
    pub fn adds(&self) -> String {
        let words = |effect: &FoundEffect| words::effect(&effect.kind, &effect.intervals_m);
        let effects: Vec<String> = self.effects.iter().map(words).collect();
        if effects.is_empty() { "declared".into() } else { effects.join("; ") }
    }
}

/// An interval of a run in which an event acted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EventWindow {
    /// The run, by its file.
    pub run: String,
    /// SHA-256 of the run's file.
    pub sha256: String,
    /// Start in s, in the run's own time.
    pub t_start_s: f64,
    /// End in s.
    pub t_end_s: f64,
}

/// Effect that acted in certain runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MaintenanceEvent {
    /// Its kind.
    pub kind: String,
    /// When it was found.
    pub found: UtcSecond,
    /// When it first and last acted, where the runs' dates are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acted: Option<[UtcSecond; 2]>,
    /// The model in force, against which it was seen.
    pub model: ModelHash,
    /// Where on the line, in m; empty where it is tied to no place.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub intervals_m: Vec<[f64; 2]>,
    /// A sentence for people.
    pub sentence: String,
    /// Its numbers by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub size: BTreeMap<String, ModelFigure>,
    /// Probability that as much is found where nothing acts.
    pub p_value: f64,
    /// The runs in which it acted, and when.
    pub windows: Vec<EventWindow>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effect(kind: &str, intervals_m: &[[f64; 2]], value: f64) -> FoundEffect {
        let parameters = [("c_factor".to_owned(), ModelFigure { value, std: 0.1 })].into();
        FoundEffect { kind: kind.into(), intervals_m: intervals_m.to_vec(), parameters }
    }

    #[test]
    fn an_effect_is_the_same_by_kind_place_and_size_within_the_intervals() {
        let tunnel = effect("tunnel_drag", &[[2000.0, 3500.0]], 2.0);
        let same = |other: FoundEffect| tunnel.is_same_as(&other) && other.is_same_as(&tunnel);
        assert!(same(effect("tunnel_drag", &[[1980.0, 3510.0]], 2.3)));
        assert!(!same(effect("tunnel_drag", &[[1980.0, 3510.0]], 2.5)));
        assert!(!same(effect("local_resistance", &[[2000.0, 3500.0]], 2.0)));
        assert!(!same(effect("tunnel_drag", &[[2000.0, 3500.0], [5e3, 6e3]], 2.0)));
        assert!(!same(effect("tunnel_drag", &[], 2.0)));
    }
}
