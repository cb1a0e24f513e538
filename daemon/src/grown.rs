//! The grown model as files: a train and a line that the daemon loads.
//!
//! The declared files are taken as they are, with every key that somebody wrote into them, and
//! only what the data changed is replaced: a, b, c always, and what holds an effect that was found:
//! a constant, a profile, a correction. What belongs to certain runs is an event and no property of
//! a train or a line: it is listed, so that nobody takes the files for more than they are.

use std::path::{Path, PathBuf};

use dynocar_analysis::dataset::{DatasetFiles, FileProblem, MANIFEST_FILE};
use dynocar_analysis::explain::{Explanation, evidence::Fit};
use dynocar_core::terms::extra::{self, Extra, Factor};
use dynocar_core::terms::{Entry, Key};
use toml::{Table, Value};

use crate::dataset::{LoadError, open};
use crate::output::{OutputError, write_in_folder};

/// Why the grown files cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum GrownError {
    /// The dataset cannot be read.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A declared file is not there any more or is no TOML.
    #[error("{label}: expected a TOML file, got {problem}")]
    Declared {
        /// The file.
        label: String,
        /// What is wrong.
        problem: String,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// How a grown file begins.
pub const GROWN_MARK: &str = "# Grown from ";
/// The files of a grown model: the train, and the line when it is known.
pub const GROWN_FILES: [&str; 2] = ["train.toml", "track.toml"];

/// What was written.
#[derive(Clone, Debug, PartialEq)]
pub struct GrownFiles {
    /// The files.
    pub files: Vec<PathBuf>,
    /// Kinds of effects that the formats cannot express.
    pub not_expressed: Vec<String>,
}

/// Writes the grown model of a dataset into a folder: `train.toml`, and `track.toml` when the
/// line is known.
///
/// # Errors
///
/// When the declared files cannot be read or the grown ones not written.
pub fn write_grown(
    dataset: &Path,
    explanation: &Explanation,
    folder: &Path,
) -> Result<GrownFiles, GrownError> {
    let (source, head) = open(dataset)?;
    let read = |path: &str| {
        source.read(path).map_err(|problem: FileProblem| GrownError::Declared {
            label: source.label(path),
            problem: problem.to_string(),
        })
    };
    let (train, track) = (&head.manifest.train_file, head.manifest.track_file.as_ref());
    let texts = (read(&train.path)?, track.map(|file| read(&file.path)).transpose()?);
    let labels = (&train.path[..], track.map_or("", |file| &file.path));
    let grown = grown_texts(explanation, (&texts.0, texts.1.as_deref()), labels, MANIFEST_FILE)?;
    let mut files = vec![write_in_folder(folder, GROWN_FILES[0], &grown.train)?];
    if let Some(track) = &grown.track {
        files.push(write_in_folder(folder, GROWN_FILES[1], track)?);
    }
    Ok(GrownFiles { files, not_expressed: grown.not_expressed })
}

/// A grown model as texts.
#[derive(Clone, Debug, PartialEq)]
pub struct GrownTexts {
    /// Of the train.
    pub train: String,
    /// Of the line, when it is known.
    pub track: Option<String>,
    /// Kinds of effects that the formats cannot express.
    pub not_expressed: Vec<String>,
}

/// The texts of a model that grew from declared ones of a train and a line; `labels` and `source` say in
/// their first lines what they grew from.
///
/// # Errors
///
/// When a declared text is no TOML.
pub fn grown_texts(
    explanation: &Explanation,
    (train, track): (&str, Option<&str>),
    labels: (&str, &str),
    source: &str,
) -> Result<GrownTexts, GrownError> {
    let table = |text: &str, label: &str| -> Result<Table, GrownError> {
        text.parse().map_err(|error: toml::de::Error| GrownError::Declared {
            label: label.into(),
            problem: error.message().to_string(),
        })
    };
    let mut train = table(train, labels.0)?;
    let mut track = track.map(|text| table(text, labels.1)).transpose()?;
    let not_expressed = grow(&explanation.grown, &mut train, track.as_mut());
    if let Some(drive) = explanation.answer.drive.as_ref().filter(|it| it.at_bound.is_none()) {
        set(&mut train, "traction", "efficiency", drive.efficiency.value);
        if let Some(told) = drive.auxiliary_power_kw {
            set(&mut train, "traction", "auxiliary_power_kw", told.value);
        }
    }
    let statement = &explanation.answer.statement;
    let text = |label: &str, table: Table| {
        format!("{GROWN_MARK}{label} of {source} by `dynocar explain`.\n# {statement}\n{table}")
    };
    Ok(GrownTexts {
        train: text(labels.0, train),
        track: track.map(|table| text(labels.1, table)),
        not_expressed,
    })
}

/// Changes the tables of a declared train and line to those of a fitted model; gives the kinds
/// that they cannot express.
pub fn grow(fit: &Fit, train: &mut Table, mut track: Option<&mut Table>) -> Vec<String> {
    let mut not_expressed = Vec::new();
    for (key, value) in ["a", "b", "c"].into_iter().zip(&fit.theta) {
        set(train, "resistance", key, *value);
    }
    for (effect, range) in fit.model.effects.iter().zip(fit.model.ranges()) {
        let entries = effect.entries(&fit.theta[range]);
        let is_held = entries.as_ref().is_some_and(|entries| {
            entries.iter().all(|entry| can_hold(entry, train, track.as_deref()))
        });
        if !is_held {
            not_expressed.push(effect.kind().to_string());
            continue;
        }
        for entry in entries.into_iter().flatten() {
            write_entry(entry, train, track.as_deref_mut());
        }
    }
    not_expressed
}

/// True for an entry that the files may hold beside what they hold already.
fn can_hold(entry: &Entry, train: &Table, track: Option<&Table>) -> bool {
    match entry {
        Entry::Number(key, found) => key.allows(joined(key, train, *found)),
        Entry::Extra(_) => true,
        Entry::TrackNumber(..) | Entry::Rows(..) | Entry::List(..) => {
            let section = track.and_then(|track| track.get("track")?.as_table());
            let stands_alone = |name: &str| !section.is_some_and(|own| own.contains_key(name));
            section.is_some() && !matches!(entry, Entry::List(name, _) if !stands_alone(name))
        }
    }
}

fn write_entry(entry: Entry, train: &mut Table, track: Option<&mut Table>) {
    match (entry, track) {
        (Entry::Number(key, found), _) => {
            let value = joined(key, train, found);
            set(train, key.table, key.name, value);
        }
        (Entry::Extra(found), _) => {
            let tables = train.entry(extra::TABLES).or_insert_with(|| Value::Array(Vec::new()));
            if let Some(tables) = tables.as_array_mut() {
                tables.push(Value::Table(extra_table(&found)));
            }
        }
        (Entry::TrackNumber(name, found), Some(track)) => {
            let declared = number(track, "track", name).unwrap_or(0.0);
            set(track, "track", name, declared + found);
        }
        (Entry::Rows(name, rows) | Entry::List(name, rows), Some(track)) => {
            if let Some(list) = track_list(track, name) {
                list.extend(rows.into_iter().map(Value::from));
            }
        }
        (_, None) => {}
    }
}

/// A table of `[[extra]]`.
fn extra_table(found: &Extra) -> Table {
    let factor = |factor: &Factor| {
        let mut table = Table::new();
        table.insert("of".into(), factor.of.name().into());
        table.insert("form".into(), factor.form.name().into());
        for (name, number) in factor.form.numbers().iter().zip(factor.numbers) {
            table.insert((*name).into(), Value::Float(number));
        }
        Value::Table(table)
    };
    let mut table = Table::new();
    table.insert(extra::FORCE.into(), Value::Float(found.n_per_kn));
    let factors: Vec<Value> = found.factors.iter().map(factor).collect();
    table.insert(extra::FACTORS.into(), Value::Array(factors));
    table
}

/// A number that was found with the one that stands in the file.
fn joined(key: &Key, train: &Table, found: f64) -> f64 {
    number(train, key.table, key.name).map_or(found, |declared| key.join(declared, found))
}

/// A list of `[track]`, made when absent.
fn track_list<'t>(track: &'t mut Table, key: &str) -> Option<&'t mut Vec<Value>> {
    let section = track.get_mut("track")?.as_table_mut()?;
    section.entry(key).or_insert_with(|| Value::Array(Vec::new())).as_array_mut()
}

fn number(table: &Table, section: &str, key: &str) -> Option<f64> {
    let value = table.get(section)?.get(key)?;
    value.as_float().or_else(|| value.as_integer().map(|it| it as f64))
}

fn set(table: &mut Table, section: &str, key: &str, value: f64) {
    let entry = table.entry(section).or_insert_with(|| Value::Table(Table::new()));
    if let Value::Table(section) = entry {
        section.insert(key.into(), Value::Float(value));
    }
}

#[cfg(test)]
mod tests {
    use dynocar_core::terms::{masses, traction, wind};

    use super::*;

    #[test]
    fn a_finding_joins_what_is_declared_by_the_rule_of_its_key() {
        let declared = "[corrections]\ntraction_gain = 1.1\nwind_plus_mps = 2";
        let mut train: Table = declared.parse().unwrap();
        write_entry(Entry::Number(&traction::GAIN, 0.9), &mut train, None);
        write_entry(Entry::Number(&wind::WIND_PLUS, 3.0), &mut train, None);
        assert_eq!(train["corrections"]["traction_gain"], Value::Float(1.1 * 0.9));
        assert_eq!(train["corrections"]["wind_plus_mps"], Value::Float(5.0));
    }

    #[test]
    fn what_no_file_may_hold_is_not_written() {
        let train = Table::new();
        assert!(can_hold(&Entry::Number(&traction::GAIN, 1.4), &train, None));
        assert!(!can_hold(&Entry::Number(&traction::GAIN, 2.4), &train, None));
        assert!(!can_hold(&Entry::Rows(masses::LIST, Vec::new()), &train, None));
    }
}
