//! State of each model of a train, from the decisions, and the keys in which two models differ.

use std::collections::{BTreeMap, BTreeSet};

use dynocar_model::named;
use toml::{Table, Value};

use super::records::{Action, Decision, ModelsError, Numbered};
use super::store::{Listing, Stored, TrainModels};
use super::text::{ModelHash, ModelText, TRACK_FILE, TRAIN_FILE};

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

/// The most characters of a value that are shown.
const SHOWN_MAX: usize = 60;
/// Ends of keys and the units that they name, the longest first.
const UNITS: [(&str, &str); 13] = [
    ("_n_per_kn_m", "N/kN·m"),
    ("_n_per_kn", "N/kN"),
    ("_permille", "‰"),
    ("_per_k", "1/K"),
    ("_mps", "m/s"),
    ("_kn", "kN"),
    ("_mm", "mm"),
    ("_kg", "kg"),
    ("_pa", "Pa"),
    ("_s", "s"),
    ("_m", "m"),
    ("_t", "t"),
    ("_k", "K"),
];

/// A key whose values differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyDifference {
    /// The file.
    pub file: &'static str,
    /// The key with its tables.
    pub key: String,
    /// Its values, with the unit where the key names it; a dash where there is none.
    pub values: [String; 2],
}

/// Returns the keys in which two models differ, by file and key.
pub fn differences(one: &ModelText, other: &ModelText) -> Vec<KeyDifference> {
    let mut all = of_file(TRAIN_FILE, [Some(&one.train), Some(&other.train)]);
    all.extend(of_file(TRACK_FILE, [one.track.as_ref(), other.track.as_ref()]));
    all
}

fn of_file(file: &'static str, texts: [Option<&String>; 2]) -> Vec<KeyDifference> {
    let [one, other] = texts.map(|text| {
        let mut flat = BTreeMap::new();
        // Text that is not TOML has no keys; the store holds none such.
        let table: Table = text.and_then(|text| text.parse().ok()).unwrap_or_default();
        flatten("", &table, &mut flat);
        flat
    });
    let keys: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
    let differing = keys.into_iter().filter(|key| one.get(*key) != other.get(*key));
    let shown = |value: Option<&Value>, key: &str| value.map_or("–".into(), |it| shown(key, it));
    differing
        .map(|key| KeyDifference {
            file,
            key: key.clone(),
            values: [shown(one.get(key), key), shown(other.get(key), key)],
        })
        .collect()
}

fn flatten(prefix: &str, table: &Table, flat: &mut BTreeMap<String, Value>) {
    for (key, value) in table {
        let key = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        match value {
            Value::Table(table) => flatten(&key, table, flat),
            value => {
                flat.insert(key, value.clone());
            }
        }
    }
}

fn shown(key: &str, value: &Value) -> String {
    let text = match value {
        // As exact as anybody reads it; the files have every digit.
        Value::Float(number) => {
            format!("{number:.5e}").parse::<f64>().unwrap_or(*number).to_string()
        }
        value => value.to_string().split_whitespace().collect::<Vec<_>>().join(" "),
    };
    let unit = match value {
        Value::Integer(_) | Value::Float(_) => match key {
            "resistance.a" => " N/kN",
            "resistance.b" => " N/kN per m/s",
            "resistance.c" => " N/kN per (m/s)²",
            _ => {
                let of_key = UNITS.iter().find(|(end, _)| key.ends_with(end));
                return of_key.map_or(text.clone(), |(_, unit)| format!("{text} {unit}"));
            }
        },
        _ => "",
    };
    if text.chars().count() > SHOWN_MAX {
        let begin: String = text.chars().take(SHOWN_MAX).collect();
        return format!("{begin}… ({} characters)", text.chars().count());
    }
    text + unit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_differ_are_shown_with_both_values_and_their_unit() {
        let model = |train: &str, track: Option<&str>| ModelText {
            train: train.into(),
            track: track.map(str::to_owned),
        };
        let one = model("[train]\nmass_t = 100\nlength_m = 80\n[resistance]\na = 1.5\n", None);
        let other = model(
            "# grown\n[train]\nmass_t = 101.5\nlength_m = 80\n[resistance]\na = 1.5\nc = 2.123456789e-4\n",
            Some("[track]\ntunnels = [[1000.0, 2000.0]]\n"),
        );
        let found: Vec<(String, [String; 2])> =
            differences(&one, &other).into_iter().map(|it| (it.key, it.values)).collect();
        let expected = [
            ("resistance.c", ["–", "0.000212346 N/kN per (m/s)²"]),
            ("train.mass_t", ["100 t", "101.5 t"]),
            ("track.tunnels", ["–", "[[1000.0, 2000.0]]"]),
        ];
        let expected = expected.map(|(key, values)| (key.to_owned(), values.map(str::to_owned)));
        assert_eq!(found, expected);
        assert!(differences(&one, &one).is_empty());
    }
}
