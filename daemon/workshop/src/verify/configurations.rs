//! The daemon's configurations that are attached to a recording.

use dynocar::config::{ConfigError, DaemonConfig};
use toml::{Table, Value};

use dynocar_mcap::recording::Recording;
use dynocar_mcap::writing::{CONFIGURATION, folder_of_configuration};

/// Error of an attached configuration that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigurationProblem {
    /// No configuration is attached.
    #[error("no daemon's configuration is attached: there is nothing to verify by")]
    None,
    /// The configuration cannot be unpacked.
    #[error(transparent)]
    Unpacking(#[from] std::io::Error),
    /// The configuration is not valid.
    #[error("{folder}/daemon.toml: {problem}")]
    Malformed {
        /// The folder of the attached files.
        folder: String,
        /// Problem of the configuration.
        problem: String,
    },
    /// The daemon of this release refuses the configuration.
    #[error("attached {0}")]
    Refused(#[from] ConfigError),
}

/// A configuration with when it was seen.
struct SeenConfiguration {
    monotonic_ns: i64,
    config: DaemonConfig,
    keeps_state: bool,
}

/// The configurations of a recording, in the order in which they were seen.
pub struct Configurations {
    seen: Vec<SeenConfiguration>,
}

impl Configurations {
    /// Reads the attached configurations.
    ///
    /// # Errors
    ///
    /// See [`ConfigurationProblem`].
    pub fn from_recording(recording: &Recording) -> Result<Self, ConfigurationProblem> {
        let mut seen: Vec<SeenConfiguration> = Vec::new();
        for metadata in recording.metadata.iter().filter(|it| it.name == CONFIGURATION) {
            let number = |key| metadata.metadata.get(key).and_then(|it| it.parse::<i64>().ok());
            let (Some(index), Some(monotonic_ns)) = (number("number"), number("seen_monotonic_ns"))
            else {
                continue;
            };
            // Every file of a rotating recording has the same one once more.
            if seen.iter().all(|it| it.monotonic_ns != monotonic_ns) {
                let folder = folder_of_configuration(index as u32);
                let (config, keeps_state) = load(recording, &folder)?;
                seen.push(SeenConfiguration { monotonic_ns, config, keeps_state });
            }
        }
        if seen.is_empty() {
            return Err(ConfigurationProblem::None);
        }
        seen.sort_by_key(|it| it.monotonic_ns);
        Ok(Configurations { seen })
    }

    /// Returns the configuration of a daemon that started at a moment of the monotonic clock, and whether it
    /// keeps states: the first that was seen after that moment.
    pub fn of_epoch(&self, epoch: u64) -> (&DaemonConfig, bool) {
        let start_ns = i64::try_from(epoch).unwrap_or(i64::MAX);
        let found = self.seen.iter().find(|it| it.monotonic_ns >= start_ns);
        let newest = &self.seen[self.seen.len() - 1];
        let it = found.unwrap_or(newest);
        (&it.config, it.keeps_state)
    }
}

/// Unpacks a configuration with its files under the names they were attached by, and reads it.
fn load(recording: &Recording, folder: &str) -> Result<(DaemonConfig, bool), ConfigurationProblem> {
    let malformed = |problem: String| {
        let folder = folder.to_owned();
        ConfigurationProblem::Malformed { folder, problem }
    };
    let place = tempfile::tempdir()?;
    let mut text = None;
    for (name, content) in &recording.attachments {
        let Some(name) = name.strip_prefix(&format!("{folder}/")) else { continue };
        if name == "daemon.toml" {
            text = Some(String::from_utf8_lossy(content).into_owned());
        } else if !name.contains('/') {
            std::fs::write(place.path().join(name), content)?;
        }
    }
    let text = text.ok_or_else(|| malformed("not attached".into()))?;
    let mut table: Table = text.parse().map_err(|it: toml::de::Error| malformed(it.to_string()))?;
    let trains = table.get_mut("trains").and_then(Value::as_array_mut);
    for train in trains.into_iter().flatten().filter_map(Value::as_table_mut) {
        let id = train.get("id").and_then(Value::as_integer).unwrap_or(0);
        train.remove("candidates");
        for (key, name) in [("file", "train"), ("track", "track")] {
            if let Some(file) = train.get_mut(key) {
                *file = Value::String(format!("{name}-{id}.toml"));
            }
        }
    }
    // The folder of states is on another host; the report names it as a possible cause of a difference.
    let keeps_state = table.remove("state").is_some();
    // The models that were in force are attached in place of those declared.
    table.remove("models");
    let config = DaemonConfig::from_text(&place.path().join("daemon.toml"), &table.to_string())?;
    Ok((config, keeps_state))
}
