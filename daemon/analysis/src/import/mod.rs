//! Other projects' descriptions of trains and lines, read into what `train.toml` and `track.toml` hold.
//!
//! Texts come in; what comes out are numbers in SI units and an account of every field: which key it
//! became and how, what has no place or is not understood, and which keys the file does not give.
//! Nothing is made up.
//!
//! # Layout, in the order of the work
//!
//! - `tree`: YAML and JSON with the line of every value
//! - [`mod@format`]: which project's file it is, by its content
//! - `rolling_stock`, `running_path`: railtoolkit's schemas
//! - `ttobench`: TTOBench's files
//! - `osrd`: OSRD's rolling stock
//! - [`imported`]: what comes out

pub mod format;
pub mod imported;
mod osrd;
mod rolling_stock;
mod running_path;
#[cfg(test)]
mod tests;
mod tree;
mod ttobench;

pub use format::Format;
pub use imported::{Account, FieldOutcome, ImportReading, ImportedLine, ImportedTrain};

use crate::dataset::DatasetError;
use crate::dataset::document::Item;
use format::Kind;

/// A file.
#[derive(Clone, Copy, Debug)]
pub struct ImportSource<'t> {
    /// Its name in messages.
    pub label: &'t str,
    /// Its text.
    pub text: &'t str,
}

/// Contents of imported files.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Imported {
    /// The trains, in the order of the files.
    pub trains: Vec<ImportedTrain>,
    /// The lines, in the order of the files.
    pub lines: Vec<ImportedLine>,
}

/// Reads files, each of the format that its content shows or of the one that is forced. Vehicles and
/// the trains that they form may stand in several files.
///
/// # Errors
///
/// Where a file is of no known format or breaks the rules of its own; with file, line, the path to the
/// value and what was expected.
pub fn import(
    sources: &[ImportSource],
    forced: Option<Format>,
    reading: &ImportReading,
) -> Result<Imported, DatasetError> {
    let mut read = Vec::new();
    for source in sources {
        format::refuse_xml(source.label, source.text)?;
        read.push((source.label, tree::parse(source.label, source.text)?));
    }
    let mut imported = Imported::default();
    let mut stock: Vec<Item> = Vec::new();
    for (label, root) in &read {
        let root = Item::root(label, root);
        match format::kind_of(&root, forced)? {
            Kind::RollingStock => stock.push(root),
            Kind::RunningPath => imported.lines.extend(running_path::lines(&root)?),
            Kind::TtobenchTrain => imported.trains.push(ttobench::train(&root)?),
            Kind::TtobenchTrack => imported.lines.push(ttobench::line(&root)?),
            Kind::OsrdBrake => imported.trains.push(osrd::brake_alone(&root)?),
            Kind::OsrdRollingStock => imported.trains.push(osrd::train(&root, reading)?),
        }
    }
    if !stock.is_empty() {
        imported.trains.extend(rolling_stock::trains(&stock, reading)?);
    }
    Ok(imported)
}
