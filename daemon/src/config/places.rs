//! The directories that a configuration names.

use std::path::{Path, PathBuf, absolute};

use dynocar_transport::{ChannelError, Host};

use super::refusals::{Checker, ConfigError, RootError};
use super::{DaemonConfig, ProcessConfig};

impl ProcessConfig {
    /// Returns the host under the run-time directory.
    ///
    /// # Errors
    ///
    /// See [`Host::at`]; the message names the key where the directory is configured.
    pub fn host(&self) -> Result<Host, RootError> {
        match &self.root {
            Some(root) => Host::at(root).map_err(|source| self.refused(source)),
            None => Host::from_environment().map_err(RootError::OfEnvironment),
        }
    }

    /// Checks the name of the run-time directory, if there is one.
    pub(super) fn check_root(&self) -> Result<(), ConfigError> {
        let check = |root: &PathBuf| Host::check_name(root).map_err(|it| self.refused(it).into());
        self.root.as_ref().map_or(Ok(()), check)
    }

    fn refused(&self, source: ChannelError) -> RootError {
        RootError::Configured { file: self.file.clone(), source }
    }
}

impl DaemonConfig {
    /// Returns the host of a configuration, or of the environment where there is none.
    ///
    /// # Errors
    ///
    /// See [`ProcessConfig::host`].
    pub fn host_of(config: Option<&Self>) -> Result<Host, RootError> {
        config.map_or_else(|| ProcessConfig::default().host(), |config| config.process.host())
    }
}

impl Checker<'_> {
    /// Returns the path of a directory that must be there when the daemon starts.
    pub fn existing_directory(&self, key: &str, named: &Path) -> Result<PathBuf, ConfigError> {
        let path = self.folder().join(named);
        if path.is_dir() || self.is_observer {
            return Ok(path);
        }
        let full = absolute(&path).unwrap_or(path);
        let allowed = format!("an existing directory, found none at {}", full.display());
        self.refuse(key, named.display(), allowed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_directory_that_cannot_be_used_is_named_with_file_key_and_place() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("d.toml");
        let refusal = |text: &str| {
            let demo = include_str!("../../../config/daemon.toml");
            let train = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo");
            let text = demo.replace("demo/", &format!("{train}/")).replace("[daemon]", text);
            let loaded = DaemonConfig::from_text(&file, &text).map_err(|it| it.to_string());
            loaded.and_then(|it| it.process.host().map_err(|it| it.to_string())).unwrap_err()
        };
        let place = file.display();
        let named = format!("{place}: daemon.root, in place of DYNOCAR_ROOT: ");
        for root in ["depot", "", "/depot 1"] {
            let words = refusal(&format!("[daemon]\nroot = {root:?}"));
            assert_eq!(
                words
                    .strip_prefix(&named)
                    .map(|it| it.starts_with(&format!("{root}: expected an absolute path"))),
                Some(true),
                "{words}"
            );
        }
        std::fs::write(folder.path().join("taken"), "").unwrap();
        let taken = folder.path().join("taken").display().to_string();
        let words = refusal(&format!("[daemon]\nroot = {taken:?}"));
        assert!(words.starts_with(&(named + &taken)), "{words}");
        for table in ["models", "state"] {
            let words = refusal(&format!("[{table}]\ndirectory = \"none/x\"\n[daemon]"));
            let full = folder.path().join("none/x").display().to_string();
            assert_eq!(
                words,
                format!(
                    "{place}:5: {table}.directory = none/x: expected an existing directory, found none at {full}"
                )
            );
            let train = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo");
            let demo = include_str!("../../../config/daemon.toml");
            let text = format!("[{table}]\ndirectory = \"none/x\"\n[daemon]");
            let text = demo.replace("demo/", &format!("{train}/")).replace("[daemon]", &text);
            std::fs::write(&file, text).unwrap();
            assert!(DaemonConfig::load_to_observe(&file).is_ok(), "{table}: to observe it");
        }
    }
}
