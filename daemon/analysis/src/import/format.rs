//! Which project's file a text is.

use dynocar_model::named;

use super::error::{ImportError, ImportProblem};
use super::item::Item;
use crate::dataset::SourcePosition;

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
pub(super) enum Kind {
    RollingStock,
    RunningPath,
    TtobenchTrain,
    TtobenchTrack,
    OsrdRollingStock,
}

const ROLLING_STOCK: &str = "https://railtoolkit.org/schema/rolling-stock.json";
const RUNNING_PATH: &str = "https://railtoolkit.org/schema/running-path.json";
const VERSIONS: [&str; 2] = ["2022.05", "2024.07"];

/// Refuses XML, and railML by its name.
pub(super) fn refuse_xml(label: &str, text: &str) -> Result<(), ImportError> {
    let Some(root) = xml_root(text.strip_prefix('\u{feff}').unwrap_or(text)) else {
        return Ok(());
    };
    let name = root.rsplit(':').next().unwrap_or(root).to_lowercase();
    let problem = match name.as_str() {
        "railml" => ImportProblem::RailMl,
        _ => ImportProblem::Xml { root: root.chars().take(40).collect() },
    };
    Err(ImportError::new(SourcePosition::whole(label), problem))
}

/// The name of the root element; `None` for a text that is no XML.
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

/// The kind of a file by its keys, or of those of one project.
pub(super) fn kind_of(root: &Item, forced: Option<Format>) -> Result<Kind, ImportError> {
    let has = |key: &str| root.has(key);
    let recognised = if has("schema") {
        Some(Format::Railtoolkit)
    } else if has("rolling_resistance") {
        Some(Format::Osrd)
    } else if has("metadata") && (has("mass") || has("stops")) {
        Some(Format::Ttobench)
    } else {
        None
    };
    match forced.or(recognised) {
        Some(Format::Railtoolkit) => railtoolkit(root),
        Some(Format::Osrd) => Ok(Kind::OsrdRollingStock),
        Some(Format::Ttobench) if has("mass") => Ok(Kind::TtobenchTrain),
        Some(Format::Ttobench) => Ok(Kind::TtobenchTrack),
        None => Err(root.wrong(ImportProblem::NotRecognised { found: found(root) })),
    }
}

fn railtoolkit(root: &Item) -> Result<Kind, ImportError> {
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
        other => {
            let problem = ImportProblem::Version { found: other.into(), expected: versions };
            Err(version.wrong(problem))
        }
    }
}

fn found(root: &Item) -> String {
    let names: Vec<String> = root.keys().take(8).map(|key| format!("'{key}'")).collect();
    match &names[..] {
        [] => "it holds no keys and values".into(),
        names => format!("it holds {}", names.join(", ")),
    }
}
