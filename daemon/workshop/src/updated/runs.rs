//! The runs of a grown dataset, and what else it names: where they lie, seen from its folder.
//!
//! How grown files begin, and why they cannot be written.

use std::path::Path;

use crate::dataset::FilesOfDataset;
use dynocar::dataset::{LoadError, read_text};
use dynocar::models::text::TRAIN_FILE;
use dynocar::output::{OutputError, require_new, write_in_folder};
use dynocar_analysis::dataset::DatasetFiles;
use dynocar_analysis::dataset::written::{alignment_files, run_files};
use toml::Table;

use crate::paths::from_folder;

/// Names the runs where they lie; those of a recording are written into the folder.
///
/// # Errors
///
/// When a run cannot be written, or would take the place of another file.
pub fn keep_runs(
    manifest: &mut Table,
    source: &FilesOfDataset,
    folder: &Path,
) -> Result<(), UpdatedModelError> {
    for file in run_files(manifest) {
        if !source.is_recording() {
            *file = seen_from(folder, &source.path_of(file));
            continue;
        }
        let target = folder.join(&*file);
        // Runs have no mark of their own.
        if !is_updated(&folder.join(TRAIN_FILE)) {
            require_new(&target)?;
        }
        let text = source.read(file).map_err(|problem| UpdatedModelError::Declared {
            label: source.label(file),
            problem: problem.to_string(),
        })?;
        let (parent, name) = (target.parent().unwrap_or(folder), target.file_name());
        let name = name.unwrap_or_default().to_string_lossy();
        write_in_folder(parent, &name, &text)?;
    }
    Ok(())
}

/// Names the ways on the map, which lie beside the declared line's file.
pub fn keep_alignments(track: &mut Table, declared: &Path, folder: &Path) {
    let beside = declared.parent().unwrap_or(Path::new(""));
    for file in alignment_files(track) {
        *file = seen_from(folder, &beside.join(&*file));
    }
}

/// Removes a file that an earlier explanation wrote and this one does not: the model lacks it.
///
/// # Errors
///
/// When it is there and cannot be removed.
pub fn forget(file: &Path) -> Result<(), OutputError> {
    if !is_updated(file) {
        return Ok(());
    }
    std::fs::remove_file(file).map_err(|source| OutputError::File { path: file.into(), source })
}

fn is_updated(file: &Path) -> bool {
    read_text(file).is_ok_and(|text| text.starts_with(UPDATED_MARK))
}

fn seen_from(folder: &Path, file: &Path) -> String {
    from_folder(folder, file).display().to_string()
}

/// Why the grown files cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum UpdatedModelError {
    /// The dataset cannot be read.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A declared file is not there any more or is no TOML.
    #[error("{label}: expected a TOML file, got {problem}")]
    Declared {
        /// The file.
        label: String,
        /// Problem of the run.
        problem: String,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// How a grown file begins.
pub const UPDATED_MARK: &str = "# Grown from ";
