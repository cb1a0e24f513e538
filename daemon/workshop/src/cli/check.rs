//! `dynocar check`: reads a dataset, a train, a track or a daemon configuration and states its meaning.

mod json;
mod report;
mod runs;

use std::path::Path;
use std::sync::Arc;

use dynocar::cli::Failure;
use dynocar::cli::check::{CheckArguments, or_refused};
use dynocar::config::DaemonConfig;
use dynocar::dataset::{DatasetSource, FileKind, LoadError, kind_of, labelled_text};
use dynocar::output::{give, require_file, require_folder};
use dynocar_analysis::dataset::{SourcePosition, parse_track, parse_train, top_keys};
use dynocar_analysis::parallel;
use dynocar_shared::TrainId;
use serde::Serialize;

use crate::dataset;
use crate::formats::is_recording;

pub use runs::Understood;

/// Runs `dynocar check`.
///
/// # Errors
///
/// When the path leads to no known kind of file or a file is wrong; the readable parts have been reported by then.
pub fn run(arguments: &CheckArguments) -> Result<(), Failure> {
    let (path, json) = (&arguments.path, arguments.json.as_deref());
    let source = DatasetSource { path, train: arguments.train.map(TrainId) };
    if let Some(file) = json {
        require_file(file, "{")?;
    }
    if let Some(folder) = &arguments.draw {
        require_folder(folder)?;
    }
    let understood = or_refused(path, json, understand(source, SamplesOfRuns::Dropped))?;
    give(json, &understood.answer(path), || understood.text())?;
    if let Some(folder) = &arguments.draw {
        runs::draw(&understood, folder)?;
    }
    let errors: Vec<_> = understood.errors().map(ToString::to_string).collect();
    if errors.is_empty() { Ok(()) } else { Err(Failure::Input(errors.join("\ndynocar: "))) }
}

impl Understood {
    /// Returns the answer for machines.
    pub fn answer(&self, path: &Path) -> impl Serialize {
        json::answer(path, self)
    }

    /// Returns the answer for people.
    pub fn text(&self) -> String {
        report::report(self)
    }
}

/// Whether the samples of runs stay in memory once they are judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SamplesOfRuns {
    /// Those of all runs.
    Kept,
    /// None: each run is dropped once it is read, so that a dataset may be larger than memory.
    Dropped,
}

/// Reads the file or folder at a path; the result holds the errors of single runs.
///
/// # Errors
///
/// When the path leads to no known kind of file, or a file that everything rests on is wrong.
pub fn understand(source: DatasetSource, samples: SamplesOfRuns) -> Result<Understood, Failure> {
    let path = source.path;
    if source.train.is_some() || !path.is_file() || is_recording(path) {
        return read_dataset(source, samples);
    }
    let (label, text) = labelled_text(path)?;
    let refuse = |message| Err(Failure::At(SourcePosition::whole(&label), message));
    if path.extension().is_none_or(|extension| extension != "toml") {
        return refuse(format!("{label}: not a TOML file; {EXPECTED}"));
    }
    let keys = top_keys(&label, &text)?;
    let Some(kind) = kind_of(&keys) else {
        return refuse(format!("{label}: {}; {EXPECTED}", found(&keys)));
    };
    let mut understood = Understood::from_kind(kind);
    match kind {
        FileKind::Dataset => return read_dataset(source, samples),
        FileKind::Train => understood.train = Some(Arc::new(parse_train(&label, &text)?)),
        FileKind::Track => understood.track = Some(Arc::new(parse_track(&label, &text)?)),
        FileKind::Daemon => understood.daemon = Some(DaemonConfig::load(path)?),
    }
    Ok(understood)
}

const EXPECTED: &str = "expected a dataset's folder or its dataset.toml (with a table [dataset]), \
                        a train.toml ([train]), a track.toml ([track]) or a daemon.toml ([trains] \
                        and [pipelines])";

fn found(keys: &[String]) -> String {
    if keys.is_empty() {
        return "the file is empty".into();
    }
    let names: Vec<_> = keys.iter().take(8).map(|key| format!("[{key}]")).collect();
    let more = if keys.len() > names.len() { ", …" } else { "" };
    format!("not a file that can be checked: it holds {}{more}", names.join(", "))
}

fn read_dataset(source: DatasetSource, samples: SamplesOfRuns) -> Result<Understood, Failure> {
    let (folder, head) = dataset::open(source).map_err(|error| match error {
        LoadError::NotADataset { .. } => {
            let place = SourcePosition::whole(&source.path.display().to_string());
            Failure::At(place, format!("{error}; {EXPECTED}"))
        }
        other => other.into(),
    })?;
    let read = |index| {
        let mut run = head.read_run(&folder, index)?;
        if samples == SamplesOfRuns::Dropped {
            drop(run.split_off_samples());
        }
        Ok(run)
    };
    let runs = parallel::of_each_number(head.manifest.runs.len(), read);
    Ok(Understood {
        dataset: Some((head.manifest, runs)),
        train: Some(head.train),
        track: head.track,
        ..Understood::from_kind(FileKind::Dataset)
    })
}
