//! Processes beside the measuring one: this program again, with a hidden command.

use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::time::{Duration, Instant};

use dynocar_shared::services::ROOT_VARIABLE;
use rustix::process::{Pid, Signal, kill_process};

use super::site::Site;
use super::{RigError, system};

/// How long a process may take to end by itself.
const END_WITHIN: Duration = Duration::from_secs(5);

/// A process of the measurement; killed when dropped.
#[derive(Debug)]
pub struct Peer {
    name: String,
    child: Child,
}

impl Peer {
    /// Starts the hidden command `peer` with these arguments on a site.
    ///
    /// # Errors
    ///
    /// When it cannot be started.
    pub fn start(site: &Site, arguments: &[&str]) -> Result<Self, RigError> {
        let program = std::env::current_exe().map_err(system("finding this program"))?;
        Peer::start_program(site, &program, &[&["peer"], arguments].concat())
    }

    fn start_program(site: &Site, program: &Path, arguments: &[&str]) -> Result<Self, RigError> {
        let mut command = Command::new(program);
        command.args(arguments);
        Peer::start_command(site, &arguments[1..].join(" "), command)
    }

    /// Starts a program on a site, by this name in errors.
    ///
    /// # Errors
    ///
    /// When it cannot be started.
    pub fn start_command(site: &Site, name: &str, mut command: Command) -> Result<Self, RigError> {
        let child = command
            .current_dir(site.path())
            .env(ROOT_VARIABLE, site.host().root())
            .env("STATE_DIRECTORY", site.path().join("states"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .map_err(system("starting a process"))?;
        Ok(Peer { name: name.to_owned(), child })
    }

    /// What it prints on standard error, where that was asked for.
    pub fn take_errors(&mut self) -> Option<ChildStderr> {
        self.child.stderr.take()
    }

    /// Its process number.
    pub fn process_id(&self) -> u32 {
        self.child.id()
    }

    /// What it was started as.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Fails when it has ended.
    ///
    /// # Errors
    ///
    /// With its exit status.
    pub fn require(&mut self) -> Result<(), RigError> {
        match self.child.try_wait().map_err(system("looking after a process"))? {
            None => Ok(()),
            Some(status) => {
                Err(RigError::Ended { what: self.name.clone(), status: status.to_string() })
            }
        }
    }

    /// Asks it to end and waits for that.
    ///
    /// # Errors
    ///
    /// When it does not end, or ends with a failure of its own.
    pub fn stop(mut self) -> Result<(), RigError> {
        self.require()?;
        if let Some(pid) = Pid::from_raw(self.child.id() as i32) {
            kill_process(pid, Signal::TERM)
                .map_err(|error| system("stopping a process")(error.into()))?;
        }
        let start = Instant::now();
        while start.elapsed() < END_WITHIN {
            match self.child.try_wait().map_err(system("waiting for a process"))? {
                None => std::thread::sleep(Duration::from_millis(2)),
                // Peers without a handler of their own end by the signal.
                Some(status) if status.success() || status.code().is_none() => return Ok(()),
                Some(status) => {
                    let status = status.to_string();
                    return Err(RigError::Ended { what: self.name.clone(), status });
                }
            }
        }
        Err(RigError::Silent { what: self.name.clone(), seconds: END_WITHIN.as_secs() })
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // One that has ended by itself is as good as a killed one.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
