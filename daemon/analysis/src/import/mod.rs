//! Other projects' descriptions of trains and lines, read into the contents of `train.toml` and `track.toml`. The
//! content of a file shows the project that it comes from.
//!
//! Texts come in; numbers in SI units and an account of every field come out: the key that the field became and how,
//! the fields that have no key or are not understood, and the keys that the file does not give. No value is invented.
//!
//! # Layout, in the order of the work
//!
//! - `tree`: YAML and JSON with the line of every value
//! - `rolling_stock`, `running_path`: railtoolkit's schemas
//! - `ttobench`: TTOBench's files
//! - `osrd`: OSRD's rolling stock
//! - [`imported`]: the imported train or line

pub mod imported;
mod osrd;
mod rolling_stock;
mod running_path;
#[cfg(test)]
mod tests;
mod tree;
mod ttobench;

use dynocar_model::named;

pub use imported::{Account, FieldOutcome, ImportReading, ImportedLine, ImportedTrain};

use crate::dataset::document::Item;
use crate::dataset::{DatasetError, SourcePosition};

named! {
    /// A project whose files are read.
    Format ("on the command line") {
        /// Rolling stock and running paths of railtoolkit's schema.
        Railtoolkit "railtoolkit";
        /// Trains and tracks of TTOBench.
        Ttobench "ttobench";
        /// Rolling stock of OSRD.
        Osrd "osrd";
    }
}

/// A kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    RollingStock,
    RunningPath,
    TtobenchTrain,
    TtobenchTrack,
    OsrdRollingStock,
    OsrdBrake,
}

const ROLLING_STOCK: &str = "https://railtoolkit.org/schema/rolling-stock.json";
const RUNNING_PATH: &str = "https://railtoolkit.org/schema/running-path.json";
const VERSIONS: [&str; 2] = ["2022.05", "2024.07"];

const EXPECTED: &str = "expected a railtoolkit rolling stock or running path (a key 'schema'), a \
                        TTOBench track or train ('metadata' with 'stops' or 'mass'), or an OSRD \
                        rolling stock ('rolling_resistance') or brake ('gamma_emergency')";
const RAILML: &str = "railML is not imported: its licence forbids an open implementation without \
                      certification; convert the file to railtoolkit's schema, or write train.toml \
                      and track.toml by hand";

/// Refuses XML, and railML by its name.
fn refuse_xml(label: &str, text: &str) -> Result<(), DatasetError> {
    let Some(root) = xml_root(text.strip_prefix('\u{feff}').unwrap_or(text)) else {
        return Ok(());
    };
    let name = root.rsplit(':').next().unwrap_or(root).to_lowercase();
    let root: String = root.chars().take(40).collect();
    let words = match name.as_str() {
        "railml" => RAILML.into(),
        _ => format!("expected YAML or JSON, found XML with the root '{root}'; {EXPECTED}"),
    };
    Err(SourcePosition::whole(label).problem(words))
}

/// Returns the name of the root element; `None` for a text that is no XML.
fn xml_root(text: &str) -> Option<&str> {
    let mut rest = text.trim_start();
    loop {
        let tag = rest.strip_prefix('<')?;
        let end = match tag {
            _ if tag.starts_with('?') => "?>",
            _ if tag.starts_with("!--") => "-->",
            _ if tag.starts_with('!') => ">",
            _ => {
                let end = tag.find(|it: char| it.is_whitespace() || it == '>' || it == '/');
                return Some(&tag[..end.unwrap_or(tag.len())]);
            }
        };
        let Some((_, after)) = tag.split_once(end) else { return Some("") };
        rest = after.trim_start();
    }
}

/// Returns the kind of a file by its keys, or of those of one project.
fn kind_of(root: &Item, forced: Option<Format>) -> Result<Kind, DatasetError> {
    let has = |key: &str| root.has(key);
    let recognised = if has("schema") {
        Some(Format::Railtoolkit)
    } else if has("rolling_resistance") || has("gamma_emergency") {
        Some(Format::Osrd)
    } else if has("metadata") && (has("mass") || has("stops")) {
        Some(Format::Ttobench)
    } else {
        None
    };
    match forced.or(recognised) {
        Some(Format::Railtoolkit) => railtoolkit(root),
        Some(Format::Osrd) if has("gamma_emergency") => Ok(Kind::OsrdBrake),
        Some(Format::Osrd) => Ok(Kind::OsrdRollingStock),
        Some(Format::Ttobench) if has("mass") => Ok(Kind::TtobenchTrain),
        Some(Format::Ttobench) => Ok(Kind::TtobenchTrack),
        None => {
            let words = format!("the format is not recognised: {}; {EXPECTED}", found(root));
            Err(root.wrong(words + "; --format says which it is"))
        }
    }
}

fn railtoolkit(root: &Item) -> Result<Kind, DatasetError> {
    let expected = "the address of railtoolkit's schema";
    let schema = root.need("schema", expected)?;
    let kind = match schema.text(expected)? {
        ROLLING_STOCK => Kind::RollingStock,
        RUNNING_PATH => Kind::RunningPath,
        other => {
            return Err(schema.out_of_range(other, &format!("{ROLLING_STOCK} or {RUNNING_PATH}")));
        }
    };
    let versions = VERSIONS.join(" or ");
    let version = root.need("schema_version", &versions)?;
    match version.text(&versions)? {
        known if VERSIONS.contains(&known) => Ok(kind),
        other => Err(version.wrong(format!("schema_version = {other}: expected {versions}"))),
    }
}

fn found(root: &Item) -> String {
    let names: Vec<String> = root.keys().take(8).map(|key| format!("'{key}'")).collect();
    match &names[..] {
        [] => "it holds no keys and values".into(),
        names => format!("it holds {}", names.join(", ")),
    }
}

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
/// value and the expected value.
pub fn import(
    sources: &[ImportSource],
    forced: Option<Format>,
    reading: &ImportReading,
) -> Result<Imported, DatasetError> {
    let mut read = Vec::new();
    for source in sources {
        refuse_xml(source.label, source.text)?;
        read.push((source.label, tree::parse(source.label, source.text)?));
    }
    let mut imported = Imported::default();
    let mut stock: Vec<Item> = Vec::new();
    for (label, root) in &read {
        let root = Item::root(label, root);
        match kind_of(&root, forced)? {
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
