//! Result of an import: the texts of `train.toml` and `track.toml`, and the outcome of every field.

use std::path::Path;

use dynocar::cli::Failure;
use dynocar_analysis::dataset::DatasetDiagnostic;
use dynocar_analysis::dataset::keys::{self, track};
use dynocar_analysis::dataset::written::TomlText;
use dynocar_analysis::import::{Account, FieldOutcome, ImportedLine, ImportedTrain};
use dynocar_model::terms::Key;
use dynocar_model::train::numbers::{
    CARS, DAVIS_A, DAVIS_B, DAVIS_C, LENGTH, MASS, ROTATING_MASS_FACTOR,
};
use toml::Value;

use crate::cli::train_text::{
    TrainArguments, TrainText, TrainValues, comment, converted, on_one_line,
};
use crate::report::provenance::for_shell;
use crate::run_facts::diagnostics;
use dynocar::cli::text::{TextTable, entry};

/// Returns the `train.toml`; a value that neither the file nor the command line gives is a marked default.
///
/// # Errors
///
/// A value that is impossible for a train is an input failure.
pub fn train(train: &ImportedTrain, arguments: &TrainArguments) -> Result<TrainText, Failure> {
    let from = |key: &str| origin(&train.account, key);
    let name = Value::String(train.name.clone());
    let mut figures = vec![(keys::train::NAME.name, name, "as the file names it".to_string())];
    let mut number = |key: &Key, value: Option<f64>| {
        figures.extend(value.map(|value| (key.name, converted(value), from(key.name))));
    };
    number(&MASS, train.mass_kg.map(|mass_kg| mass_kg / 1000.0));
    number(&LENGTH, train.length_m);
    number(&ROTATING_MASS_FACTOR, train.rotating_mass_factor);
    number(&DAVIS_A, train.resistance.map(|davis| davis.a));
    number(&DAVIS_B, train.resistance.map(|davis| davis.b));
    number(&DAVIS_C, train.resistance.map(|davis| davis.c));
    let count = |cars: u32| (CARS.name, Value::Integer(cars.into()), from(CARS.name));
    figures.extend(train.cars.map(count));
    let writer = format!("dynocar import from {}", train.place);
    let (traction, brake_mps2) = (train.traction.clone(), train.brake_mps2.clone());
    arguments.text(&writer, &TrainValues { figures, traction, brake_mps2 })
}

/// From which field a key is.
fn origin(account: &Account, wanted: &str) -> String {
    let fields = account.outcomes().iter().filter_map(|outcome| match outcome {
        FieldOutcome::Taken { field, key, .. } if key.split(", ").any(|key| key == wanted) => {
            Some(field.as_str())
        }
        _ => None,
    });
    format!("from {}", fields.collect::<Vec<_>>().join(" and "))
}

/// Returns the `track.toml`; a list that the file does not give is left out, with the reason.
pub fn track(line: &ImportedLine) -> String {
    let words = format!(
        "The line. Written by dynocar import from {}. A list that is left out is not known; an empty \
         one says that nothing is there. `dynocar check track.toml` reads it back.",
        line.place
    );
    let mut head = comment("", &words);
    for outcome in line.account.outcomes() {
        if let FieldOutcome::Unknown { key, why } = outcome {
            head += &comment("  ", &format!("{key} is not known: {why}."));
        }
    }
    let mut text = TomlText::new(&head, track::TABLE);
    text.value(&track::NAME, Value::String(line.name.clone()));
    text.value(&track::LENGTH, converted(line.length_m));
    let pair = |&(at_m, value): &(f64, f64)| format!("{}, {}", converted(at_m), converted(value));
    if let Some(gradient) = &line.gradient {
        text.list(&track::GRADIENT, gradient.iter().map(pair));
    }
    if let Some(curves) = &line.curves {
        let ends =
            |start_m: f64, end_m: f64| format!("{}, {}", converted(start_m), converted(end_m));
        let entry = |it: &dynocar_model::track::TrackCurve| {
            format!("{}, {}", ends(it.start_m, it.end_m), converted(it.radius_m))
        };
        text.list(&track::CURVES, curves.iter().map(entry));
    }
    if !line.stops.is_empty() {
        let stop = |(at_m, name): &(f64, String)| {
            format!("{}, {}", converted(*at_m), Value::String(name.clone()))
        };
        text.list(&track::STOPS, line.stops.iter().map(stop));
    }
    if let Some(permitted) = &line.permitted_speed {
        text.list(&track::PERMITTED_SPEED, permitted.iter().map(pair));
    }
    text.into_text()
}

/// Describes the imported fields, the refused fields, and the missing ones.
pub fn text(
    folder: &Path,
    train: Option<&(&ImportedTrain, TrainText)>,
    line: Option<&(&ImportedLine, String)>,
    of_result: &[DatasetDiagnostic],
    written: &[&str],
) -> String {
    let mut text = String::new();
    if let Some((train, made)) = train {
        text += &entry("", &on_one_line(&format!("train '{}' of {}", train.name, train.place)));
        text += &account(&train.account);
        if !made.defaults.is_empty() {
            let defaults = made.defaults.join(", ");
            text += &entry("", &format!("defaults in train.toml, nobody's figures: {defaults}"));
        }
        text.push('\n');
    }
    if let Some((line, _)) = line {
        text += &entry("", &on_one_line(&format!("line '{}' of {}", line.name, line.place)));
        text += &account(&line.account);
        text.push('\n');
    }
    text += &diagnostics(of_result);
    let paths = || written.iter().map(|name| folder.join(name).display().to_string());
    text += &format!("written: {}\n\nnext:\n", paths().collect::<Vec<_>>().join(", "));
    for path in paths() {
        let drawings = for_shell(&folder.display().to_string());
        text += &format!("  dynocar check {} --draw {drawings}\n", for_shell(&path));
    }
    text
}

fn account(account: &Account) -> String {
    let mut table = TextTable::new(&["field", "taken as", "how"], &[0, 1, 2]);
    let mut rest = String::new();
    for outcome in account.outcomes() {
        match outcome {
            FieldOutcome::Taken { field, key, how } => {
                table.push(vec![on_one_line(field), (*key).into(), on_one_line(how)]);
            }
            FieldOutcome::Left { field, why } => {
                rest += &entry("  ", &on_one_line(&format!("not taken: '{field}': {why}")));
            }
            FieldOutcome::Unknown { key, why } => {
                rest += &entry("  ", &on_one_line(&format!("not in the file: {key}: {why}")));
            }
        }
    }
    format!("{table}{rest}")
}
