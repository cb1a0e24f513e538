//! `dynocar import`: a train and a line from other projects' files, and the account of their contents.

use std::path::{Path, PathBuf};

use clap::Args;
use dynocar::cli::Failure;
use dynocar::cli::text::{TextTable, entry};
use dynocar::dataset::labelled_text;
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar::output::{print, require_folder, require_new, write_new_in_folder};
use dynocar_analysis::dataset::dataset_diagnostic::diagnostics;
use dynocar_analysis::dataset::keys::{self, track};
use dynocar_analysis::dataset::written::TomlText;
use dynocar_analysis::dataset::{DatasetDiagnostic, parse_track, parse_train};
use dynocar_analysis::import::{
    Account, FieldOutcome, Format, ImportReading, ImportSource, ImportedLine, ImportedTrain, import,
};
use dynocar_model::terms::Key;
use dynocar_model::train::numbers::{
    CARS, DAVIS_A, DAVIS_B, DAVIS_C, LENGTH, MASS, ROTATING_MASS_FACTOR,
};
use toml::Value;

use super::train_text::{TrainArguments, TrainText, TrainValues, comment, converted, on_one_line};
use crate::report::provenance::for_shell;
use crate::run_facts;

/// Import trains and lines of railtoolkit, TTOBench or OSRD.
///
/// It writes train.toml and track.toml, and reports the outcome of every field. Nothing is overwritten.
#[derive(Debug, Args)]
pub struct ImportArguments {
    /// The files: YAML of railtoolkit, JSON of TTOBench or OSRD
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The folder for the results; it is made where there is none
    #[arg(short, long, value_name = "FOLDER")]
    out: PathBuf,
    /// Take the files for those of this project: railtoolkit, ttobench or osrd
    #[arg(long, value_name = "PROJECT", value_parser = format)]
    format: Option<Format>,
    /// Which train, where the files hold several
    #[arg(long = "train", value_name = "ID")]
    train_id: Option<String>,
    /// Which line, where the files hold several
    #[arg(long = "line", value_name = "ID")]
    line_id: Option<String>,
    /// Share of the permitted load that is on the train, 0 to 1, where a file gives the load
    #[arg(long, value_name = "SHARE", default_value = "0", value_parser = share)]
    load: f64,
    /// The mode of traction whose effort curve counts, where a file has several
    #[arg(long, value_name = "NAME")]
    mode: Option<String>,
    #[command(flatten)]
    train: TrainArguments,
}

/// Imports and writes.
///
/// # Errors
///
/// An input failure where a file or the command line is wrong, or a result is there already; a failure
/// of the work where a file cannot be written.
pub fn execute(arguments: &ImportArguments) -> Result<(), Failure> {
    let out = &arguments.out;
    require_folder(out)?;
    let texts = arguments.files.iter().map(|path| labelled_text(path));
    let texts: Vec<_> = texts.collect::<Result<_, _>>()?;
    let sources: Vec<ImportSource> =
        texts.iter().map(|(label, text)| ImportSource { label, text }).collect();
    let reading = ImportReading { load_share: arguments.load, mode: arguments.mode.clone() };
    let imported = import(&sources, arguments.format, &reading)?;
    let train = chosen(&imported.trains, |it| &it.id, arguments.train_id.as_deref(), "train")?;
    let line = chosen(&imported.lines, |it| &it.id, arguments.line_id.as_deref(), "line")?;
    if train.is_none() && !arguments.train.is_empty() {
        return Err(Failure::Input(
            "the files hold no train, so that nothing can be said of one on the command line"
                .into(),
        ));
    }
    let train = train.map(|it| train_file(it, &arguments.train).map(|text| (it, text)));
    let train = train.transpose()?;
    let line = line.map(|it| (it, track_file(it)));
    let mut written = Vec::new();
    written.extend(train.as_ref().map(|(_, made)| (TRAIN_FILE, made.text.as_str())));
    written.extend(line.as_ref().map(|(_, text)| (TRACK_FILE, text.as_str())));
    for (name, _) in &written {
        require_new(&out.join(name))?;
    }
    // The readers accept the written text.
    let model = train.as_ref().map(|(_, made)| parse_train(TRAIN_FILE, &made.text)).transpose()?;
    let track = line.as_ref().map(|(_, text)| parse_track(TRACK_FILE, text)).transpose()?;
    let diagnostics =
        model.map(|model| diagnostics(&model, track.as_ref(), [])).unwrap_or_default();
    write_new_in_folder(out, &written)?;
    let names: Vec<&str> = written.iter().map(|(name, _)| *name).collect();
    Ok(print(&summary(out, train.as_ref(), line.as_ref(), &diagnostics, &names))?)
}

/// Returns the requested one of several; `None` where there is none.
fn chosen<'i, T>(
    all: &'i [T],
    id: impl Fn(&T) -> &String,
    wanted: Option<&str>,
    what: &str,
) -> Result<Option<&'i T>, Failure> {
    let ids: Vec<String> = all.iter().map(|it| format!("'{}'", id(it))).collect();
    let ids = ids.join(", ");
    let is_wanted = |it: &&T| wanted.is_none_or(|wanted| id(it) == wanted);
    let found: Vec<&T> = all.iter().filter(is_wanted).collect();
    match (wanted, all.len(), &found[..]) {
        (None, 0, _) => Ok(None),
        (_, _, [only]) => Ok(Some(only)),
        (None, count, _) => Err(Failure::Input(format!(
            "the files hold {count} {what}s; say which: --{what} ID, of {ids}"
        ))),
        (Some(wanted), 0, _) => {
            Err(Failure::Input(format!("--{what} {wanted}: the files hold no {what}")))
        }
        (Some(wanted), _, []) => {
            Err(Failure::Input(format!("--{what} {wanted}: expected one of {ids}")))
        }
        (Some(wanted), ..) => Err(Failure::Input(format!(
            "--{what} {wanted}: it stands in several files; give one of them at a time"
        ))),
    }
}

fn format(name: &str) -> Result<Format, String> {
    let all = Format::ALL.map(Format::name).join(", ");
    let found = Format::from_name(name);
    found.ok_or_else(|| format!("expected one of {all}"))
}

fn share(text: &str) -> Result<f64, String> {
    let share = text.parse::<f64>().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "expected a share from 0 to 1".into())
}

/// Returns the `train.toml`; a value that neither the file nor the command line gives is a marked default.
///
/// # Errors
///
/// A value that is impossible for a train is an input failure.
fn train_file(train: &ImportedTrain, arguments: &TrainArguments) -> Result<TrainText, Failure> {
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
fn track_file(line: &ImportedLine) -> String {
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
fn summary(
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
    text += &run_facts::diagnostics(of_result);
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
