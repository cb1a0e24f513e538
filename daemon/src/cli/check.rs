//! `dynocar check`: reads a dataset, a train, a track or a daemon configuration and says what it
//! understood.

mod daemon;
mod json;
mod report;
mod runs;

use std::path::{Path, PathBuf};

use clap::Args;
use dynocar_core::dataset::{
    DatasetError, DatasetHead, Place, Problem, Run, parse_track, parse_train, top_keys,
};
use dynocar_core::track::Track;
use dynocar_core::train::TrainModel;

use super::{Failure, output};
use crate::config::DaemonConfig;
use crate::dataset::{self, LoadError, read_text};

/// Validate a dataset, train, track or daemon configuration and say what was understood.
#[derive(Clone, Debug, Args)]
pub struct CheckArguments {
    /// A dataset's folder or its dataset.toml, a train.toml, a track.toml or a daemon.toml.
    path: PathBuf,
    /// Also write the result as JSON; '-' for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What a path was understood to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
enum Kind {
    Dataset,
    Train,
    Track,
    Daemon,
}

/// What was understood.
enum Understood {
    Dataset(Box<DatasetHead>, Vec<Result<Run, DatasetError>>),
    Train(Box<TrainModel>),
    Track(Box<Track>),
    Daemon(Box<DaemonConfig>),
}

/// Runs `dynocar check`.
///
/// # Errors
///
/// When the path leads to nothing known or a file is wrong; everything that could be read has
/// been reported by then.
pub fn run(arguments: &CheckArguments) -> Result<(), Failure> {
    let path = &arguments.path;
    let understood = match read(path) {
        Ok(understood) => understood,
        Err(message) => {
            if let Some(file) = &arguments.json {
                output::write_json(file, &json::refusal(path, &message))?;
            }
            return Err(Failure::Input(message));
        }
    };
    let errors = understood.errors();
    let goes_to_output = arguments.json.as_deref().is_some_and(output::is_standard_output);
    if !goes_to_output {
        output::print(&report::report(&understood))?;
    }
    if let Some(file) = &arguments.json {
        output::write_json(file, &json::answer(path, &understood))?;
    }
    if errors.is_empty() { Ok(()) } else { Err(Failure::Input(errors.join("\ndynocar: "))) }
}

impl Understood {
    fn kind(&self) -> Kind {
        match self {
            Understood::Dataset(..) => Kind::Dataset,
            Understood::Train(_) => Kind::Train,
            Understood::Track(_) => Kind::Track,
            Understood::Daemon(_) => Kind::Daemon,
        }
    }

    /// What is wrong with single runs.
    fn errors(&self) -> Vec<String> {
        match self {
            Understood::Dataset(_, runs) => {
                runs.iter().filter_map(|run| run.as_ref().err()).map(ToString::to_string).collect()
            }
            Understood::Train(_) | Understood::Track(_) | Understood::Daemon(_) => Vec::new(),
        }
    }
}

fn read(path: &Path) -> Result<Understood, String> {
    if !path.is_file() {
        return read_dataset(path);
    }
    let label = path.display().to_string();
    let text = read_text(path)
        .map_err(|problem| Place::whole(&label).problem(Problem::File(problem)).to_string())?;
    if path.extension().is_none_or(|extension| extension != "toml") {
        return Err(format!("{label}: not a TOML file; {EXPECTED}"));
    }
    let keys = top_keys(&label, &text).map_err(|error| error.to_string())?;
    let understood = match kind_of(&keys) {
        Some(Kind::Dataset) => return read_dataset(path),
        Some(Kind::Train) => parse_train(&label, &text).map(Box::new).map(Understood::Train),
        Some(Kind::Track) => parse_track(&label, &text).map(Box::new).map(Understood::Track),
        Some(Kind::Daemon) => return daemon::read(path),
        None => return Err(format!("{label}: {}; {EXPECTED}", found(&keys))),
    };
    understood.map_err(|error| error.to_string())
}

const EXPECTED: &str = "expected a dataset's folder or its dataset.toml (with a table [dataset]), \
                        a train.toml ([train]), a track.toml ([track]) or a daemon.toml ([trains] \
                        and [pipelines])";

/// What a TOML file is, by its tables. A dataset names its train and track in tables of the
/// same names, so that `[dataset]` decides first.
fn kind_of(keys: &[String]) -> Option<Kind> {
    let has = |name: &str| keys.iter().any(|key| key == name);
    let kinds = [
        ("dataset", Kind::Dataset),
        ("daemon", Kind::Daemon),
        ("pipelines", Kind::Daemon),
        ("train", Kind::Train),
        ("track", Kind::Track),
    ];
    kinds.into_iter().find(|(table, _)| has(table)).map(|(_, kind)| kind)
}

fn found(keys: &[String]) -> String {
    if keys.is_empty() {
        return "the file is empty".into();
    }
    let names: Vec<_> = keys.iter().take(8).map(|key| format!("[{key}]")).collect();
    let more = if keys.len() > names.len() { ", …" } else { "" };
    format!("not a file that can be checked: it holds {}{more}", names.join(", "))
}

fn read_dataset(path: &Path) -> Result<Understood, String> {
    let (folder, head) = dataset::open(path).map_err(|error| match error {
        LoadError::NotADataset { .. } => format!("{error}; {EXPECTED}"),
        other => other.to_string(),
    })?;
    let runs = (0..head.manifest.runs.len()).map(|index| head.read_run(&folder, index)).collect();
    Ok(Understood::Dataset(Box::new(head), runs))
}
