//! `dynocar fmu`: the estimators, or the train itself, as an FMU.

use std::path::{Path, PathBuf};

use clap::Args;
use dynocar_analysis::dataset::{DatasetError, DatasetFiles};
use dynocar_fmu::variables::ModelFile;
use dynocar_fmu::{ESTIMATORS, PLANT, STEP_DEFAULT_S, STEP_MAX_S};

use crate::dataset;
use crate::fmu::{FmuError, INPUTS_MARK, archive, find_library, inputs, read_library};
use dynocar::cli::Failure;
use dynocar::dataset::{labelled_text, load_track, load_train};
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar::output::{
    report_line, require_file, require_folder, require_replaceable, write_file, write_in_folder,
};

/// Write the estimators, or the train itself, as an FMU for a simulator.
///
/// FMI 2.0 for co-simulation, as Simulink, OpenModelica, Dymola and FMPy take it.
#[derive(Debug, Args)]
pub struct FmuArguments {
    /// The train itself instead of the estimators: traction and brake force in, speed out
    #[arg(long)]
    plant: bool,
    /// The FMU
    #[arg(short, long, value_name = "FILE.fmu")]
    out: PathBuf,
    /// The train that the FMU brings along; else its parameter train_file names one
    #[arg(long, value_name = "train.toml", conflicts_with = "dataset")]
    train: Option<PathBuf>,
    /// The line that it brings along
    #[arg(long, value_name = "track.toml", conflicts_with = "dataset")]
    track: Option<PathBuf>,
    /// Bring along the train and the line that `explain --grown` wrote into this folder
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["train", "track"])]
    grown: Option<PathBuf>,
    /// Bring along the train and the line of this dataset, unless --grown names others
    #[arg(long, value_name = "FOLDER")]
    dataset: Option<PathBuf>,
    /// Write the dataset's runs as inputs of the FMU into this folder, a CSV file each
    #[arg(long, value_name = "FOLDER", requires = "dataset")]
    inputs: Option<PathBuf>,
    /// The library inside the FMU, where it does not lie next to the program
    #[arg(long, value_name = "FILE.so")]
    library: Option<PathBuf>,
}

/// Packs the FMU.
///
/// # Errors
///
/// A wrong train, line, dataset or library is an input failure; a library that was not built and a
/// file that cannot be written are ones of work.
pub fn execute(arguments: &FmuArguments) -> Result<(), Failure> {
    require_file(&arguments.out, "PK")?;
    arguments.inputs.as_deref().map_or(Ok(()), require_folder)?;
    let files = match (&arguments.grown, &arguments.dataset) {
        (Some(grown), _) => files_of_updated(grown)?,
        (None, Some(dataset)) => files_of_dataset(dataset)?,
        (None, None) => named_files(arguments.train.as_deref(), arguments.track.as_deref())?,
    };
    let model = if arguments.plant { &PLANT } else { &ESTIMATORS };
    let library = match &arguments.library {
        Some(path) => read_library(path)?,
        None => find_library(&std::env::current_exe().unwrap_or_default())?,
    };
    let fmu = archive(model, &library, (&files, step_s(arguments)?))?;
    if let (Some(dataset), Some(folder)) = (&arguments.dataset, &arguments.inputs) {
        write_inputs(dataset, folder)?;
    }
    write_file(&arguments.out, &fmu)?;
    report_line(&format!("FMU: {}", arguments.out.display()));
    Ok(())
}

/// Returns the step that hosts take by default: the dataset's.
fn step_s(arguments: &FmuArguments) -> Result<f64, Failure> {
    let Some(dataset) = &arguments.dataset else { return Ok(STEP_DEFAULT_S) };
    let step_s = dataset::load(dataset)?.step_s();
    // As it was recorded, but for the last digits of a difference.
    let step_s = (step_s * 1e6).round() / 1e6;
    let most_s = if arguments.plant { STEP_MAX_S } else { f64::INFINITY };
    Ok(if step_s > 0.0 && step_s <= most_s { step_s } else { STEP_DEFAULT_S })
}

impl From<FmuError> for Failure {
    fn from(error: FmuError) -> Self {
        match error {
            FmuError::Unreadable { .. } | FmuError::OtherLibrary(_) => Failure::input(error),
            FmuError::NoLibrary(_) | FmuError::Archive(_) => Failure::work(error),
        }
    }
}

/// Returns the texts of the files that were named, each understood before it is packed.
fn named_files(
    train: Option<&Path>,
    track: Option<&Path>,
) -> Result<Vec<(ModelFile, String)>, Failure> {
    let text = |path: &Path| labelled_text(path).map(|(_, text)| text);
    let mut files = Vec::new();
    if let Some(path) = train {
        load_train(path)?;
        files.push((ModelFile::Train, text(path)?));
    }
    if let Some(path) = track {
        load_track(path)?;
        files.push((ModelFile::Track, text(path)?));
    }
    Ok(files)
}

/// Returns the texts of a grown train and, where it is known, its line.
fn files_of_updated(folder: &Path) -> Result<Vec<(ModelFile, String)>, Failure> {
    let [train, track] = [TRAIN_FILE, TRACK_FILE].map(|name| folder.join(name));
    named_files(Some(&train), track.exists().then_some(&*track))
}

/// Returns the texts of a dataset's train and line.
fn files_of_dataset(path: &Path) -> Result<Vec<(ModelFile, String)>, Failure> {
    let (folder, head) = dataset::open(path)?;
    let text = |path: &str| -> Result<String, DatasetError> {
        folder.read(path).map_err(|problem| problem.of(&folder.label(path)))
    };
    let mut files = vec![(ModelFile::Train, text(&head.manifest.train_file.path)?)];
    if let Some(track) = &head.manifest.track_file {
        files.push((ModelFile::Track, text(&track.path)?));
    }
    Ok(files)
}

/// Writes each run of a dataset as inputs.
fn write_inputs(path: &Path, folder: &Path) -> Result<(), Failure> {
    let dataset = dataset::load(path)?;
    let names: Vec<_> =
        dataset.runs.iter().map(|run| format!("run_{:02}.csv", run.number)).collect();
    names.iter().try_for_each(|name| require_replaceable(&folder.join(name), INPUTS_MARK))?;
    for (run, name) in dataset.runs.iter().zip(&names) {
        write_in_folder(folder, name, &inputs(run))?;
    }
    report_line(&format!("inputs: {} runs in {}", dataset.runs.len(), folder.display()));
    Ok(())
}
