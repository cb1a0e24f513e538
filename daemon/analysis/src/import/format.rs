//! Which project's file a text is.

use dynocar_model::named;

use crate::dataset::DatasetError;
use crate::dataset::SourcePosition;
use crate::dataset::document::Item;

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
pub(super) fn refuse_xml(label: &str, text: &str) -> Result<(), DatasetError> {
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
pub(super) fn kind_of(root: &Item, forced: Option<Format>) -> Result<Kind, DatasetError> {
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
