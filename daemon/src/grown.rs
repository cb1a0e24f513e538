//! The grown model as files: a train and a line that the daemon loads.
//!
//! The declared files are taken as they are, with every key that somebody wrote into them, and
//! only what the data changed is replaced: a, b, c always; the curve constant, the rotating mass
//! and the gradient profile where an effect of that kind was found. What the formats cannot
//! express is listed, so that nobody takes the files for more than they are.

use std::path::{Path, PathBuf};

use dynocar_core::dataset::{DatasetFiles, FileProblem, MANIFEST_FILE};
use dynocar_core::explain::answer::{Answer, ParameterValue};
use dynocar_core::explain::{Explanation, evidence::Fit};
use toml::{Table, Value};

use crate::dataset::{LoadError, open};

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
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

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
    let table = |path: &str| -> Result<Table, GrownError> {
        let declared =
            |problem: String| GrownError::Declared { label: source.label(path), problem };
        let text =
            source.read(path).map_err(|problem: FileProblem| declared(problem.to_string()))?;
        text.parse().map_err(|error: toml::de::Error| declared(error.message().to_string()))
    };
    let mut train = table(&head.manifest.train_file.path)?;
    let mut track = head.manifest.track_file.as_ref().map(|file| table(&file.path)).transpose()?;
    let not_expressed = grow(&explanation.answer, &explanation.grown, &mut train, track.as_mut());
    let write = |name: &str, table: &Table, declared: &str| -> Result<PathBuf, GrownError> {
        let path = folder.join(name);
        let failed = |source| GrownError::Write { path: path.clone(), source };
        std::fs::create_dir_all(folder).map_err(failed)?;
        let failed = |source| GrownError::Write { path: path.clone(), source };
        let note = format!(
            "# Grown from {declared} of {MANIFEST_FILE} by `dynocar explain`.\n# {}\n",
            explanation.answer.statement
        );
        std::fs::write(&path, format!("{note}{table}")).map_err(failed)?;
        Ok(path)
    };
    let mut files = vec![write("train.toml", &train, &head.manifest.train_file.path)?];
    if let (Some(track), Some(file)) = (&track, &head.manifest.track_file) {
        files.push(write("track.toml", track, &file.path)?);
    }
    Ok(GrownFiles { files, not_expressed })
}

/// Changes the tables; gives the kinds that they cannot express.
fn grow(
    answer: &Answer,
    fit: &Fit,
    train: &mut Table,
    mut track: Option<&mut Table>,
) -> Vec<String> {
    let mut not_expressed = Vec::new();
    for (key, value) in ["a", "b", "c"].into_iter().zip(&fit.theta) {
        set(train, "resistance", key, *value);
    }
    for effect in &answer.effects {
        let number = |name: &str| match effect.parameters.get(name) {
            Some(ParameterValue::Number(value)) => Some(*value),
            _ => None,
        };
        let is_expressed = match effect.kind {
            "curve_resistance" => number("k_n_per_kn_m")
                .map(|k| set(train, "resistance", "curve_constant_n_per_kn_m", k)),
            "rotating_mass" => number("rotating_mass_factor")
                .map(|gamma| set(train, "train", "rotating_mass_factor", gamma)),
            "gradient_shift" => number("shift_m").and_then(|shift_m| {
                track.as_deref_mut().and_then(|track| shift_gradient(track, shift_m))
            }),
            _ => None,
        };
        if is_expressed.is_none() {
            not_expressed.push(effect.kind.to_string());
        }
    }
    not_expressed
}

fn set(table: &mut Table, section: &str, key: &str, value: f64) {
    let entry = table.entry(section).or_insert_with(|| Value::Table(Table::new()));
    if let Value::Table(section) = entry {
        section.insert(key.into(), Value::Float(value));
    }
}

/// Moves every entry of the gradient profile.
fn shift_gradient(track: &mut Table, shift_m: f64) -> Option<()> {
    let entries = track.get_mut("track")?.get_mut("gradient")?.as_array_mut()?;
    for entry in entries {
        let chainage = entry.get_mut(0)?;
        let at = chainage.as_float().or_else(|| chainage.as_integer().map(|it| it as f64))?;
        *chainage = Value::Float(at + shift_m);
    }
    Some(())
}
