//! Programs beside a daemon that read the same channels: what they cost is measured like everything else.

use std::process::Stdio;

use dynocar::programs::{LIVE, RECORDING, call};
use dynocar_tests::process::{Process, Site};

use super::server::TRAIN;
use crate::output::{Failure, during};
use crate::rig::site::require;

/// A program that reads what a controller and the daemon write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Companion {
    /// `dynocar record`.
    Recorder,
    /// `dynocar live`, with nobody looking.
    Live,
}

impl Companion {
    /// Its name in a case.
    pub fn name(self) -> &'static str {
        match self {
            Companion::Recorder => "recorder",
            Companion::Live => "live",
        }
    }

    /// Starts it on a site, and waits for its first line: by then its channels are open.
    ///
    /// # Errors
    ///
    /// When it cannot be started.
    pub fn start(self, site: &Site) -> Result<Process, Failure> {
        let (train, file) = (TRAIN.to_string(), site.path().join("run.mcap"));
        let file = file.to_string_lossy();
        let (package, arguments) = match self {
            Companion::Recorder => (RECORDING, vec!["record", "--output", &file]),
            Companion::Live => (LIVE, vec!["--port", "0"]),
        };
        let mut program = call(package);
        // One that is not there is named in words.
        let look = program.arg("--version").stdout(Stdio::null()).status();
        look.map_err(during(package))?;
        let program = program.get_program().to_string_lossy();
        let mut process = site.start(&program, &[&arguments[..], &["--train", &train]].concat());
        process.await_error("\n");
        require(&mut process)?;
        Ok(process)
    }
}
