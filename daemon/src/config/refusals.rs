//! Why a configuration is refused, and at which line.

use std::path::{Path, PathBuf};

use dynocar_dataset::error::unknown;
use dynocar_dataset::node::{Node, NodeContent};
use dynocar_dataset::{FileProblem, SourcePosition};
use dynocar_transport::ChannelError;

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file's text cannot be read.
    #[error("{path}: {problem}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why not.
        problem: FileProblem,
    },
    /// The file is no TOML, or has a key or type that is not expected.
    #[error("{place}: {message}")]
    Malformed {
        /// The file and the line.
        place: SourcePosition,
        /// Message of the reader.
        message: String,
    },
    /// A value lies outside its range.
    #[error("{place}: {key} = {value}: expected {allowed}")]
    OutOfRange {
        /// The file and the line.
        place: SourcePosition,
        /// The key, with its table.
        key: String,
        /// The value it was given.
        value: String,
        /// The allowed range, in words.
        allowed: String,
    },
    /// A train or track file is wrong; the message names it.
    #[error(transparent)]
    Model(#[from] crate::dataset::LoadError),
    /// The run-time directory cannot be one.
    #[error(transparent)]
    Root(#[from] RootError),
}

/// Why the run-time directory cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RootError {
    /// That of the environment.
    #[error(transparent)]
    OfEnvironment(ChannelError),
    /// That of a configuration.
    #[error("{file}: daemon.root, in place of DYNOCAR_ROOT: {source}")]
    Configured {
        /// The configuration's file.
        file: PathBuf,
        /// Why not.
        source: ChannelError,
    },
}

/// Names the configuration's file, and the line, in every refusal.
pub struct Checker<'a> {
    pub path: &'a Path,
    pub text: &'a str,
    /// Whether the configuration is read to observe its daemon: directories that only the daemon uses may be missing.
    pub is_observer: bool,
}

impl Checker<'_> {
    /// Returns the folder to which file names in the configuration are relative.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new("."))
    }

    pub fn refuse<T>(
        &self,
        key: impl Into<String>,
        value: impl ToString,
        allowed: impl Into<String>,
    ) -> Result<T, ConfigError> {
        let (key, value) = (key.into(), value.to_string());
        let place = self.place(&key, &value);
        Err(ConfigError::OutOfRange { place, key, value, allowed: allowed.into() })
    }

    /// Returns the place of a key that has this value.
    pub fn place(&self, key: &str, value: &str) -> SourcePosition {
        place_of(&self.path.display().to_string(), self.text, key, value)
    }

    /// Returns the refusal of a text that has a key, a word or a type that is not expected, in the table of this name; the
    /// reader's error says which.
    pub fn malformed(&self, table: &str, error: &toml::de::Error) -> ConfigError {
        let words = error.message().trim_end().replace('\n', ", ");
        let quoted: Vec<&str> = words.split('`').skip(1).step_by(2).collect();
        let named = ["field", "variant"].into_iter().find_map(|what| {
            let (name, names) = quoted.split_first()?;
            let is_unknown = words.starts_with(&format!("unknown {what} "));
            let what = if what == "field" { "key" } else { "value" };
            is_unknown.then(|| (*name, unknown(what, name, "", names.iter().copied())))
        });
        let (name, words) = named.unwrap_or_else(|| ("", words.clone()));
        let place = match error.span() {
            Some(span) => {
                let line = self.text[..span.start].matches('\n').count() + 1;
                SourcePosition::line(&self.path.display().to_string(), line)
            }
            None => self.place(&format!("{table}.{name}"), ""),
        };
        let label = if table.is_empty() { String::new() } else { format!("{table}: ") };
        ConfigError::Malformed { place, message: label + &words }
    }

    pub fn range(&self, key: &str, value: u64, low: u64, high: u64) -> Result<u64, ConfigError> {
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        self.refuse(key, value, format!("a whole number from {low} to {high}"))
    }

    /// Checks that this machine has a processor core.
    pub fn core(&self, key: &str, core: Option<usize>) -> Result<(), ConfigError> {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        match core.filter(|&core| core >= cores) {
            Some(core) => {
                self.refuse(key, core, format!("a core of this machine, 0 to {}", cores - 1))
            }
            None => Ok(()),
        }
    }
}

/// How far a value is from the one looked for: parts of the key that lead no further, then whether another value is there.
type Distance = (usize, bool);

/// Returns the line of a key in a text; where the text lacks it, of the table that would have it.
///
/// In a list of tables a part of the key may be a table's name or kind. Of several such keys it is the last that has this value.
fn place_of(file: &str, text: &str, key: &str, value: &str) -> SourcePosition {
    let parts: Vec<&str> = key.split('.').collect();
    let root = Node::of_toml(file, text).ok();
    let line = root.and_then(|root| nearest(&root, &parts, value.trim_matches('"')).1);
    SourcePosition { file: file.into(), line }
}

fn nearest(node: &Node, key: &[&str], value: &str) -> (Distance, Option<usize>) {
    let is_value = matches!(&node.content,
        NodeContent::Text(text) | NodeContent::Plain(text) if text == value);
    let here = ((key.len(), !is_value), node.line);
    let below: Vec<_> = match (&node.content, key.split_first()) {
        (NodeContent::Map(entries), Some((first, rest))) => {
            let named = entries.iter().filter(|(name, _)| name == first);
            named.map(|(_, it)| nearest(it, rest, value)).collect()
        }
        (NodeContent::List(tables), Some((first, rest))) => tables
            .iter()
            .map(|it| nearest(it, if is_called(it, first) { rest } else { key }, value))
            .collect(),
        (NodeContent::List(values), None) => {
            values.iter().map(|it| nearest(it, key, value)).collect()
        }
        _ => Vec::new(),
    };
    below.into_iter().rev().chain([here]).min_by_key(|(distance, _)| *distance).unwrap_or(here)
}

/// Returns whether a table has this name, or no name and this kind.
fn is_called(table: &Node, name: &str) -> bool {
    let NodeContent::Map(entries) = &table.content else { return false };
    let text = |key: &str| entries.iter().find(|(it, _)| it == key).map(|(_, it)| &it.content);
    let called = text("name").or_else(|| text("kind"));
    matches!(called, Some(NodeContent::Text(it)) if it == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"[daemon]
log = "infoo"

[[trains]]
id = 1
[[trains]]
id = 2
[[trains]]
id = 1

[[pipelines]]
kind = "train_kalman"
[[pipelines]]
name = "second"
kind = "train_kalman"
trains = [1, 7]
[pipelines.settings]
brake_lag_s = -5.0

[models.bounds]
"resistance.a" = [2.0, 1.0]
"#;

    #[test]
    fn a_key_is_found_by_its_tables_and_its_value() {
        let line = |key: &str, value: &str| place_of("d.toml", TEXT, key, value).line;
        assert_eq!(line("daemon.log", "\"infoo\""), Some(2));
        assert_eq!(line("trains.id", "1"), Some(9), "the second of two equal ones");
        assert_eq!(line("trains.id", "2"), Some(7));
        assert_eq!(line("pipelines.second.settings.brake_lag_s", "-5"), Some(18));
        assert_eq!(line("pipelines.second.settings.none", ""), Some(17));
        assert_eq!(line("pipelines.second.trains", "7"), Some(16));
        assert_eq!(line("pipelines.train_kalman.kind", "train_kalman"), Some(12));
        assert_eq!(line("models.bounds.\"resistance.a\"", "[2, 1]"), Some(20));
        assert_eq!(line("metrics.listen", "x"), None, "a table that the text lacks");
        assert_eq!(place_of("d.toml", "not TOML", "daemon.log", "x").line, None);
    }
}
