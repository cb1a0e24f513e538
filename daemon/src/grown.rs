//! The grown model as files: a train and a line that the daemon loads.
//!
//! The declared files are taken as they are, with every key that somebody wrote into them, and
//! only what the data changed is replaced: a, b, c always, and what holds an effect that was found:
//! a constant, a profile, a correction. What belongs to certain runs is an event and no property of
//! a train or a line: it is listed, so that nobody takes the files for more than they are.

use std::path::{Path, PathBuf};

use dynocar_core::dataset::{DatasetFiles, FileProblem, MANIFEST_FILE};
use dynocar_core::explain::answer::{Answer, EffectAnswer, MassSection, ParameterValue};
use dynocar_core::explain::{Explanation, evidence::Fit};
use toml::{Table, Value};

use crate::dataset::{LoadError, open};
use crate::output::{OutputError, write_in_folder};

/// Greatest `tunnel_c_factor` that a train file may hold.
const TUNNEL_C_FACTOR_MAX: f64 = 100.0;

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
        let note = format!(
            "{GROWN_MARK}{declared} of {MANIFEST_FILE} by `dynocar explain`.\n# {}\n",
            explanation.answer.statement
        );
        Ok(write_in_folder(folder, name, &format!("{note}{table}"))?)
    };
    let mut files = vec![write(GROWN_FILES[0], &train, &head.manifest.train_file.path)?];
    if let (Some(track), Some(file)) = (&track, &head.manifest.track_file) {
        files.push(write(GROWN_FILES[1], track, &file.path)?);
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
        let number = |name: &str| number(effect, name);
        let is_expressed = match effect.kind {
            "curve_resistance" => number("k_n_per_kn_m")
                .map(|k| set(train, "resistance", "curve_constant_n_per_kn_m", k)),
            "rotating_mass" => number("rotating_mass_factor")
                .map(|gamma| set(train, "train", "rotating_mass_factor", gamma)),
            "gradient_shift" => number("shift_m").and_then(|shift_m| {
                track.as_deref_mut().and_then(|track| shift_gradient(track, shift_m))
            }),
            "tunnel_drag" => express_tunnels(effect, train, track.as_deref_mut()),
            "local_resistance" if effect.place.runs.is_none() => {
                track.as_deref_mut().and_then(|track| express_places(effect, track))
            }
            "mass_change" => track.as_deref_mut().and_then(|track| express_masses(effect, track)),
            _ => express_numbers(effect, train),
        };
        if is_expressed.is_none() {
            not_expressed.push(effect.kind.to_string());
        }
    }
    not_expressed
}

/// The keys of `[corrections]` that hold an effect's parameters.
fn correction_keys(kind: &str) -> &'static [(&'static str, &'static str)] {
    match kind {
        "wheel_diameter" => &[("speed_scale", "speed_scale")],
        "traction_gain" => &[("gain", "traction_gain")],
        "actuator_delay" => &[("delay_s", "actuator_delay_s"), ("lag_s", "actuator_lag_s")],
        "wind" => &[("wind_plus_mps", "wind_plus_mps")],
        "bearing_temperature" => {
            &[("delta_a_n_per_kn", "bearing_delta_a_n_per_kn"), ("tau_s", "bearing_tau_s")]
        }
        "ambient_temperature" => {
            &[("w0_per_k", "ambient_w0_per_k"), ("reference_k", "ambient_reference_k")]
        }
        _ => &[],
    }
}

fn express_numbers(effect: &EffectAnswer, train: &mut Table) -> Option<()> {
    let keys = correction_keys(effect.kind);
    for (parameter, key) in keys {
        correct(train, key, number(effect, parameter)?);
    }
    (!keys.is_empty() && !effect.parameters.contains_key("headwind_mps")).then_some(())
}

/// Multiplies or adds to what is corrected already.
fn correct(train: &mut Table, key: &str, value: f64) {
    let known = train
        .get("corrections")
        .and_then(|section| section.get(key))
        .and_then(|value| value.as_float().or_else(|| value.as_integer().map(|it| it as f64)));
    let value = match (key, known) {
        ("speed_scale" | "traction_gain" | "tunnel_c_factor", Some(known)) => known * value,
        ("bearing_tau_s" | "ambient_reference_k", _) | (_, None) => value,
        (_, Some(known)) => known + value,
    };
    set(train, "corrections", key, value);
}

fn express_tunnels(
    effect: &EffectAnswer,
    train: &mut Table,
    track: Option<&mut Table>,
) -> Option<()> {
    // Where c is next to nothing, no factor on it says what a tunnel adds.
    let factor = number(effect, "c_factor").filter(|factor| *factor <= TUNNEL_C_FACTOR_MAX)?;
    let track = track?.get_mut("track")?.as_table_mut()?;
    if !track.contains_key("tunnels") {
        let intervals = effect.place.intervals_m.as_ref()?;
        let list = intervals.iter().map(|pair| Value::from(pair.to_vec())).collect::<Vec<_>>();
        track.insert("tunnels".into(), Value::Array(list));
    }
    correct(train, "tunnel_c_factor", factor);
    Some(())
}

fn express_places(effect: &EffectAnswer, track: &mut Table) -> Option<()> {
    let extra = number(effect, "extra_n_per_kn")?;
    let list = track_list(track, "resistance")?;
    for [from_m, to_m] in effect.place.intervals_m.as_ref()? {
        list.push(Value::from(vec![*from_m, *to_m, extra]));
    }
    Some(())
}

fn express_masses(effect: &EffectAnswer, track: &mut Table) -> Option<()> {
    let Some(ParameterValue::Sections(sections)) = effect.parameters.get("sections") else {
        return None;
    };
    let list = track_list(track, "masses")?;
    for MassSection { from_m, to_m, direction, mass_factor } in sections {
        list.push(Value::from(vec![*from_m, *to_m, f64::from(*direction), *mass_factor]));
    }
    Some(())
}

/// A list of `[track]`, made when absent.
fn track_list<'t>(track: &'t mut Table, key: &str) -> Option<&'t mut Vec<Value>> {
    let section = track.get_mut("track")?.as_table_mut()?;
    section.entry(key).or_insert_with(|| Value::Array(Vec::new())).as_array_mut()
}

fn number(effect: &EffectAnswer, name: &str) -> Option<f64> {
    match effect.parameters.get(name) {
        Some(ParameterValue::Number(value)) => Some(*value),
        _ => None,
    }
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

#[cfg(test)]
mod tests {
    use dynocar_core::explain::answer::Place;

    use super::*;

    fn tunnel_drag(c_factor: f64) -> EffectAnswer {
        EffectAnswer {
            kind: "tunnel_drag",
            place: Place::default(),
            parameters: [("c_factor".into(), ParameterValue::Number(c_factor))].into(),
            std: Default::default(),
            p_value: 1e-9,
            error_reduction: 0.5,
        }
    }

    #[test]
    fn a_factor_that_no_train_file_may_hold_is_not_written() {
        let mut track: Table = "[track]\ntunnels = [[100.0, 900.0]]".parse().unwrap();
        let mut train = Table::new();
        assert_eq!(express_tunnels(&tunnel_drag(2654.7), &mut train, Some(&mut track)), None);
        assert_eq!(train, Table::new());
        assert_eq!(express_tunnels(&tunnel_drag(2.5), &mut train, Some(&mut track)), Some(()));
        assert_eq!(train["corrections"]["tunnel_c_factor"], Value::Float(2.5));
    }
}
