//! Programs beside a daemon that read the same channels: what they cost is measured like everything else.

use std::io::{BufRead, BufReader};
use std::process::Stdio;

use dynocar::programs::{RECORDING, call};

use super::server::TRAIN;
use crate::rig::child::Peer;
use crate::rig::site::Site;
use crate::rig::{RigError, system};

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

    /// Starts it on a site, and waits until its channels are open.
    ///
    /// # Errors
    ///
    /// When it cannot be started.
    pub fn start(self, site: &Site) -> Result<Peer, RigError> {
        let train = TRAIN.to_string();
        let mut command = match self {
            Companion::Recorder => {
                let mut command = call(RECORDING);
                command.args(["record", "--output", "run.mcap", "--train", &train]);
                command
            }
            Companion::Live => {
                let mut command = call("dynocar-live");
                command.args(["--port", "0", "--train", &train]);
                command
            }
        };
        command.stderr(Stdio::piped());
        let mut peer = Peer::start_command(site, self.name(), command)?;
        if let Some(output) = peer.take_errors() {
            // Its first line: by then its channels are open.
            let line = BufReader::new(output).lines().next().transpose();
            line.map_err(system("reading what a process prints"))?;
        }
        peer.require()?;
        Ok(peer)
    }
}
