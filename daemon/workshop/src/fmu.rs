//! The estimators, or the train itself, as an FMU: the archive that a simulator takes, and recorded
//! runs as its inputs.

use std::fmt::Write as _;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};

use dynocar_analysis::dataset::Run;
use dynocar_fmu::variables::{Meaning, ModelFile};
use dynocar_fmu::{ESTIMATORS, INTERFACES, Interface, documentation, model_description};
use dynocar_shared::TrainSample;
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

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
