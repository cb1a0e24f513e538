//! `dynocar models`: the store of models, and decisions on them.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use clap::{Args, Subcommand};
use dynocar_model::words;
use dynocar_shared::TrainId;

use super::Failure;
use super::text::short;
use crate::config::DaemonConfig;
use crate::models::history::{ModelHistory, State, differences};
use crate::models::records::ModelChoice;
use crate::models::{
    ModelFigure, ModelHash, ModelText, ModelsError, NewDecision, Store, Stored, TrainModels,
    UtcSecond,
};
use crate::output::{print, report_line};
use crate::shadow::record::{TrialRecord, TriedModel, ratio_in_words};

/// The store where none is named.
const DEFAULT_STORE: &str = "models";

/// List, compare, adopt and take back models
#[derive(Debug, Args)]
pub struct ModelsArguments {
    #[command(subcommand)]
    command: ModelsCommand,
    /// The store of models; `models` where neither this nor --config names one
    #[arg(long, value_name = "DIR", global = true)]
    models: Option<PathBuf>,
    /// The daemon's configuration, which names the store
    #[arg(long, value_name = "FILE", global = true)]
    config: Option<PathBuf>,
    /// The train; may be left out where the store holds one only
    #[arg(long, value_name = "ID", global = true)]
    train: Option<u64>,
}

/// A model is named by its hash or the beginning of it, or as `in-force` or `declared`.
#[derive(Debug, Subcommand)]
enum ModelsCommand {
    /// All models of a train: when they were made, their state, and the effects that they add
    List,
    /// Where a model came from and which effects it adds, with 95 % intervals
    Show {
        /// The model's hash, the beginning of it, in-force or declared
        model: String,
    },
    /// The keys in which two models differ
    Diff {
        /// The one
        one: String,
        /// The other
        other: String,
    },
    /// Put a model in force
    Adopt {
        /// The model's hash or the beginning of it
        model: String,
        #[command(flatten)]
        signed: Signed,
    },
    /// Take the model in force back: the one before it is in force again
    Rollback(Signed),
    /// Strike a model off the candidates
    Reject {
        /// The model's hash or the beginning of it
        model: String,
        #[command(flatten)]
        signed: Signed,
    },
}

/// Who decides, and why.
#[derive(Debug, Args)]
struct Signed {
    /// Who decides
    #[arg(long, value_name = "NAME")]
    by: String,
    /// Why
    #[arg(long, value_name = "TEXT", default_value = "")]
    reason: String,
}

/// Shows the store or takes a decision.
///
/// # Errors
///
/// A model or train that is not there is an input failure.
pub fn execute(arguments: &ModelsArguments) -> Result<(), Failure> {
    let models = chosen(arguments)?;
    let history = ModelHistory::from_train(&models).map_err(failure)?;
    let find = |name: &str| found(&history, name);
    let text = match &arguments.command {
        ModelsCommand::List => {
            for (path, problem) in &history.left_out {
                report_line(&format!("left out: {}: {problem}", path.display()));
            }
            list(&models, &history)
        }
        ModelsCommand::Show { model } => {
            let (stored, state) = find(model)?;
            show(&models, stored, *state)
        }
        ModelsCommand::Diff { one, other } => {
            let [one, other] = [find(one)?, find(other)?].map(|(stored, _)| stored.hash);
            let text = |hash| models.text(hash).map_err(failure);
            diff((one, &text(one)?), (other, &text(other)?))
        }
        ModelsCommand::Adopt { model, signed } => {
            decide(&models, ModelChoice::Adopt(find(model)?.0.hash), signed)?
        }
        ModelsCommand::Rollback(signed) => decide(&models, ModelChoice::RollBack, signed)?,
        ModelsCommand::Reject { model, signed } => {
            decide(&models, ModelChoice::Reject(find(model)?.0.hash), signed)?
        }
    };
    Ok(print(&text)?)
}

fn failure(error: ModelsError) -> Failure {
    match error {
        ModelsError::Storage(_) => Failure::work(error),
        error => Failure::input(error),
    }
}

/// Returns the store that is named, else that of the configuration; `models` where there is none.
///
/// # Errors
///
/// When the configuration names none.
pub fn store(named: Option<&Path>, config: Option<&DaemonConfig>) -> Result<Store, Failure> {
    let of_config = config.map(|config| config.models.as_ref().map(|it| it.directory.as_path()));
    match (named, of_config) {
        (Some(directory), _) | (None, Some(Some(directory))) => Ok(Store::at(directory)),
        (None, None) => Ok(Store::at(Path::new(DEFAULT_STORE))),
        (None, Some(None)) => Err(Failure::Input(
            "no store of models: give --models DIR, or [models] in the configuration".into(),
        )),
    }
}

/// Returns the models of the train that is meant.
fn chosen(arguments: &ModelsArguments) -> Result<TrainModels, Failure> {
    let config = arguments.config.as_deref().map(DaemonConfig::load).transpose()?;
    let store = store(arguments.models.as_deref(), config.as_ref())?;
    let trains = store.trains().map_err(failure)?;
    let shown = store.directory().display();
    let train = match (arguments.train.map(TrainId), trains.as_slice()) {
        (Some(train), trains) if trains.contains(&train) => train,
        (None, [only]) => *only,
        (_, []) => return Err(Failure::Input(format!("{shown}: holds no models of any train"))),
        (_, trains) => {
            let known = trains.iter().map(TrainId::to_string).collect::<Vec<_>>().join(", ");
            return Err(Failure::Input(format!(
                "{shown}: holds models of trains {known}: choose one by --train"
            )));
        }
    };
    Ok(store.train(train))
}

/// Returns the model that a name means.
fn found<'h>(history: &'h ModelHistory, name: &str) -> Result<&'h (Stored, State), Failure> {
    let is_meant = |(stored, _): &&(Stored, State)| match name {
        "in-force" => history.in_force == Some(stored.hash),
        "declared" => stored.origin.parent.is_none(),
        prefix => stored.hash.to_string().starts_with(&prefix.to_lowercase()),
    };
    let mut meant = history.models.iter().rev().filter(is_meant);
    match (meant.next(), meant.next()) {
        (Some(_), Some(_)) if name != "declared" => {
            Err(Failure::Input(format!("{name}: several models begin so: give more of the hash")))
        }
        // Of several declared models the newest is meant.
        (Some(model), _) => Ok(model),
        (None, _) => {
            Err(Failure::Input(format!("{name}: no such model; `dynocar models list` names them")))
        }
    }
}

fn list(models: &TrainModels, history: &ModelHistory) -> String {
    let mut text = format!(
        "train {}\n{:16}  {:20}  {:9}  {:17}  adds\n",
        models.train(),
        "model",
        "made",
        "state",
        "error held out"
    );
    let trials = TrialRecord::read(models.folder());
    for (stored, state) in &history.models {
        let origin = &stored.origin;
        let on_trial = trials.of(stored.hash).filter(|tried| tried.against.is_some());
        let error = origin.error.map_or("–".into(), |error| {
            format!("{:.3} → {:.3} m/s", error.before_mps, error.after_mps)
        });
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{}  {}  {:9}  {error:17}  {}",
            stored.hash,
            origin.made,
            state.name(),
            origin.adds()
        );
        if let Some(tried) = on_trial {
            let _ = writeln!(text, "{:16}  on trial: {}", "", compared(tried));
        }
    }
    text
}

fn show(models: &TrainModels, stored: &Stored, state: State) -> String {
    let origin = &stored.origin;
    let mut text = format!("model {} of train {}: {}\n", stored.hash, models.train(), state.name());
    let mut row = |name: &str, value: &str| {
        let _ = writeln!(text, "{name:10} {value}");
    };
    let command = match origin.command.as_str() {
        "" => String::new(),
        command => format!(": {command}"),
    };
    row("made", &format!("{} by dynocar {}{command}", origin.made, origin.version));
    if let Some(parent) = origin.parent {
        row("parent", &parent.to_string());
    }
    row("says", &origin.statement);
    if let Some(error) = origin.error {
        let words = "m/s, open loop on the runs held out";
        row("error", &format!("{:.3} → {:.3} {words}", error.before_mps, error.after_mps));
    }
    for effect in &origin.effects {
        row("adds", &words::effect(&effect.kind, &effect.intervals_m));
        for figure in effect.parameters.iter().filter_map(|(name, it)| it.of_effect(name)) {
            row("", &figure);
        }
    }
    if let Some(sha256) = &origin.dataset_sha256 {
        row("learned", &format!("from {} files, SHA-256 {sha256}", origin.files.len()));
    }
    let entries = std::fs::read_dir(&stored.folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    files.sort();
    for file in files {
        row("file", &file.display().to_string());
    }
    text + &trial(&TrialRecord::read(models.folder()), stored.hash)
}

/// Describes the daemon's measurements of a model in its trial; empty without a trial.
fn trial(trials: &TrialRecord, hash: ModelHash) -> String {
    let Some(tried) = trials.of(hash) else { return String::new() };
    let mut text = String::new();
    let mut row = |name: &str, value: String| {
        let _ = writeln!(text, "{name:10} {value}");
    };
    let error = tried.error_mps.map_or("–".into(), |error| format!("{error:.3} m/s over 60 s"));
    row("driven", format!("error {error}, last on {}", tried.last));
    if let Some(against) = tried.against {
        row("trial", format!("against model {against}: {}", compared(tried)));
    }
    for estimate in &tried.estimates {
        let values = estimate
            .values
            .iter()
            .map(|(name, value, std)| ModelFigure { value: *value, std: *std }.shown(name));
        let values = values.collect::<Vec<_>>().join(", ");
        let suspects = match estimate.suspects.as_str() {
            "" => String::new(),
            kind => format!(" suspects {kind}"),
        };
        row("", format!("{} {}{suspects} {values}", estimate.pipeline, estimate.status));
    }
    text
}

/// Returns a model's error over that of the model in force, with the evidence for it.
fn compared(tried: &TriedModel) -> String {
    let (trips, e_value) = (tried.evidence.trips(), tried.evidence.e_value());
    let evidence = if e_value < 1e4 { short(e_value, 1) } else { format!("{e_value:.0e}") };
    match tried.error_ratio {
        Some(ratio) => {
            let ratio = ratio_in_words(ratio);
            format!("{ratio} the error of the model in force, {trips} trips, evidence {evidence}")
        }
        None => format!("{trips} trips"),
    }
}

fn diff(one: (ModelHash, &ModelText), other: (ModelHash, &ModelText)) -> String {
    let mut rows = vec![["key".to_owned(), one.0.to_string(), other.0.to_string()]];
    rows.extend(differences(one.1, other.1).into_iter().map(|it| {
        let [before, after] = it.values;
        [format!("{}: {}", it.file, it.key), before, after]
    }));
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max();
    let [key, before] = [0, 1].map(|column| width(column).unwrap_or(0));
    rows.iter().map(|row| format!("{:key$}  {:before$}  {}\n", row[0], row[1], row[2])).collect()
}

fn decide(models: &TrainModels, what: ModelChoice, signed: &Signed) -> Result<String, Failure> {
    let new = NewDecision {
        what,
        by: signed.by.clone(),
        reason: signed.reason.clone(),
        at: UtcSecond::from_time(SystemTime::now()),
    };
    let number = models.decide(&new).map_err(failure)?;
    let in_force = models.in_force().map_err(failure)?;
    let shown =
        in_force.map_or("what the configuration declares".into(), |it| format!("model {it}"));
    Ok(format!("decision {number}: {shown} is in force for train {}\n", models.train()))
}
