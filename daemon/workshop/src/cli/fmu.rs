//! `dynocar fmu`: the estimators, or the train itself, as an FMU, and the archive that an FMU is.

use std::fmt::Write as _;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};

use clap::Args;
use dynocar::cli::Failure;
use dynocar::dataset::{labelled_text, load_track, load_train};
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar::output::{
    report_line, require_file, require_folder, require_replaceable, write_file, write_in_folder,
};
use dynocar_analysis::dataset::{DatasetError, DatasetFiles, Run};
use dynocar_fmu::variables::{Meaning, ModelFile};
use dynocar_fmu::{
    ESTIMATORS, INTERFACES, Interface, PLANT, STEP_DEFAULT_S, STEP_MAX_S, documentation,
    model_description,
};
use dynocar_shared::TrainSample;
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use crate::dataset;

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

/// The library that is inside an FMU, as cargo names it.
pub const LIBRARY: &str = "libdynocar_fmu.so";

/// Error of writing an FMU.
#[derive(Debug, thiserror::Error)]
pub enum FmuError {
    /// The library was not built, or lies in another folder.
    #[error(
        "no {LIBRARY} of this release in {}: build it with `cargo build --release -p dynocar-fmu`, \
         or say with --library where it is",
        shown(.0)
    )]
    NoLibrary(Vec<PathBuf>),
    /// The library cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The file is another one.
    #[error("{}: expected the {LIBRARY} of this release", .0.display())]
    OtherLibrary(PathBuf),
    /// The archive cannot be made.
    #[error("the FMU cannot be packed: {0}")]
    Archive(#[from] ZipError),
}

fn shown(folders: &[PathBuf]) -> String {
    let names: Vec<_> = folders.iter().map(|folder| folder.display().to_string()).collect();
    names.join(", ")
}

/// Returns the library of this release from the folders near a program into which cargo or a package puts it.
///
/// # Errors
///
/// The folders without it.
pub fn find_library(program: &Path) -> Result<Vec<u8>, FmuError> {
    let beside = program.parent().unwrap_or(Path::new("/"));
    // As a dependency of the program, as it was asked for, and as it is installed.
    let folders = [beside.join("deps"), beside.into(), beside.join("../lib/dynocar")];
    let found = folders.iter().find_map(|folder| read_library(&folder.join(LIBRARY)).ok());
    found.ok_or_else(|| FmuError::NoLibrary(folders.into()))
}

/// Returns the library at a path.
///
/// # Errors
///
/// When it cannot be read, or is not the library of this release.
pub fn read_library(path: &Path) -> Result<Vec<u8>, FmuError> {
    let library =
        std::fs::read(path).map_err(|source| FmuError::Unreadable { path: path.into(), source })?;
    let holds = |guid: &str| library.windows(guid.len()).any(|bytes| bytes == guid.as_bytes());
    let is_ours =
        library.starts_with(b"\x7fELF") && INTERFACES.iter().all(|model| holds(model.guid));
    if is_ours { Ok(library) } else { Err(FmuError::OtherLibrary(path.into())) }
}

/// Returns the FMU of a model with a default step in s: the same bytes for the same library and files.
///
/// # Errors
///
/// When it cannot be packed.
pub fn archive(
    model: &Interface,
    library: &[u8],
    (files, step_s): (&[(ModelFile, String)], f64),
) -> Result<Vec<u8>, FmuError> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default());
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let mut put = |name: String, content: &[u8]| -> Result<(), ZipError> {
        archive.start_file(name, options)?;
        Ok(archive.write_all(content)?)
    };
    put("modelDescription.xml".into(), model_description(model, step_s).as_bytes())?;
    put("documentation/index.html".into(), documentation(model).as_bytes())?;
    put(format!("binaries/{}/{}.so", platform(), model.identifier), library)?;
    for (file, text) in files {
        put(format!("resources/{}", file.own_name()), text.as_bytes())?;
    }
    Ok(archive.finish()?.into_inner())
}

/// Returns the folder of binaries for this platform: by FMI 2.0 for the one that it names, by 3.0 for others.
fn platform() -> String {
    match std::env::consts::ARCH {
        "x86_64" => "linux64".into(),
        other => format!("{other}-linux"),
    }
}

/// The name of the column of times.
const TIME: &str = "time";

/// How a file of inputs begins, so that one is known again.
pub const INPUTS_MARK: &str = "time,position_m,speed_mps,";

/// Returns a recorded run as a CSV file of the inputs of the estimators' FMU over time in s, `NaN` where
/// missing; the train's takes its own from there.
pub fn inputs(run: &Run) -> String {
    let is_input = |meaning: &Meaning| meaning.causality() == "input";
    let inputs = ESTIMATORS.variables.iter().filter(|variable| is_input(&variable.meaning));
    let mut text = TIME.to_owned();
    for input in inputs.clone() {
        text += &format!(",{}", input.name);
    }
    for sample in &run.samples {
        // The time nearest to the ns, which gives them back.
        write!(text, "\n{}", sample.time_ns as f64 / 1e9).expect("a text takes any line");
        for input in inputs.clone() {
            text += &format!(",{}", cell(sample, run.number, input.meaning));
        }
    }
    text + "\n"
}

fn cell(sample: &TrainSample, run: u32, input: Meaning) -> f64 {
    match input {
        Meaning::Measured(field) => sample.get(field).unwrap_or(f64::NAN),
        Meaning::Direction => sample.direction.into(),
        Meaning::WheelSlide => f64::from(u8::from(sample.flags & FLAG_WHEEL_SLIDE != 0)),
        Meaning::Run => run.into(),
        _ => f64::NAN,
    }
}
