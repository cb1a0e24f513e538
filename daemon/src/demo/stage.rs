//! The recorded runs that the program carries, and the demo's processes and files, which are all gone when it is over.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::runtime::system::ends_with_this;
use dynocar_shared::TrainId;
use dynocar_shared::services::ROOT_VARIABLE;
use dynocar_transport::channel::SampleCount;
use dynocar_transport::{ChannelError, Host};
use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

/// Why a process cannot be started or a file cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The system refused.
    #[error("{what}: {source}")]
    System {
        /// Attempted action.
        what: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A process ended before its time.
    #[error("the {role} ended: {status}; it said:\n{said}")]
    Ended {
        /// Daemon or controller.
        role: &'static str,
        /// Its exit status.
        status: String,
        /// Its standard error.
        said: String,
    },
    /// The run-time directory cannot be used.
    #[error(transparent)]
    Channel(#[from] ChannelError),
}

fn system(what: &'static str) -> impl FnOnce(std::io::Error) -> StageError {
    move |source| StageError::System { what, source }
}

/// The demo's own run-time directory with its daemon and controller.
pub struct Stage {
    folder: TempDir,
    dataset: PathBuf,
    host: Host,
    daemon: Option<Child>,
    controller: Option<Child>,
}

impl Stage {
    /// Writes dataset and configuration into a temporary folder.
    ///
    /// # Errors
    ///
    /// When the folder cannot be written.
    pub fn build() -> Result<Self, StageError> {
        let folder = tempfile::Builder::new()
            .prefix("dynocar-demo-")
            .tempdir()
            .map_err(system("temporary folder"))?;
        // The configuration names its train as config/daemon.toml does: demo/train.toml.
        let dataset = folder.path().join("demo");
        write_dataset(&dataset).map_err(system("writing the embedded runs"))?;
        std::fs::write(folder.path().join("daemon.toml"), DAEMON_CONFIG)
            .map_err(system("writing the configuration"))?;
        let host = Host::at(&folder.path().join("root"))?;
        Ok(Stage { folder, dataset, host, daemon: None, controller: None })
    }

    /// Returns the dataset's folder.
    pub fn dataset(&self) -> &Path {
        &self.dataset
    }

    /// Returns the run-time directory.
    pub fn host(&self) -> &Host {
        &self.host
    }

    /// Starts the daemon process.
    ///
    /// # Errors
    ///
    /// When it cannot be started.
    pub fn start_daemon(&mut self) -> Result<(), StageError> {
        let config = self.folder.path().join("daemon.toml");
        self.daemon = Some(self.start("daemon", &["run".as_ref(), "--config".as_ref(), &config])?);
        Ok(())
    }

    /// Starts the controller process.
    ///
    /// # Errors
    ///
    /// When it cannot be started.
    pub fn start_controller(&mut self, rate: f64) -> Result<(), StageError> {
        let rate = rate.to_string();
        let arguments =
            ["replay".as_ref(), self.dataset.as_path(), "--rate".as_ref(), rate.as_ref()];
        self.controller = Some(self.start("controller", &arguments)?);
        Ok(())
    }

    fn start(&self, role: &'static str, arguments: &[&Path]) -> Result<Child, StageError> {
        let program = std::env::current_exe().map_err(system("finding this program"))?;
        let log = File::create(self.log(role)).map_err(system("writing a log"))?;
        ends_with_this(&mut Command::new(program))
            .args(arguments)
            .env(ROOT_VARIABLE, self.host.root())
            // A show leaves nothing behind.
            .env("STATE_DIRECTORY", self.folder.path().join("state"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .map_err(system("starting a process"))
    }

    fn log(&self, role: &str) -> PathBuf {
        self.folder.path().join(format!("{role}.log"))
    }

    fn ended(&self, role: &'static str, status: std::process::ExitStatus) -> StageError {
        let said = std::fs::read_to_string(self.log(role)).unwrap_or_default();
        StageError::Ended { role, status: status.to_string(), said }
    }

    /// Fails when the daemon has ended.
    ///
    /// # Errors
    ///
    /// With the words of the daemon's log.
    pub fn require_daemon(&mut self) -> Result<(), StageError> {
        let status = match &mut self.daemon {
            Some(daemon) => daemon.try_wait().map_err(system("looking after the daemon"))?,
            None => None,
        };
        status.map_or(Ok(()), |status| Err(self.ended("daemon", status)))
    }

    /// Returns whether the controller has published everything.
    ///
    /// # Errors
    ///
    /// When it failed.
    pub fn controller_has_ended(&mut self) -> Result<bool, StageError> {
        let status = match &mut self.controller {
            Some(controller) => {
                controller.try_wait().map_err(system("looking after the controller"))?
            }
            None => None,
        };
        match status {
            None => Ok(false),
            Some(status) if status.success() => Ok(true),
            Some(status) => Err(self.ended("controller", status)),
        }
    }

    /// Stops the daemon as an operator would.
    ///
    /// # Errors
    ///
    /// When it does not end cleanly.
    pub fn stop_daemon(&mut self) -> Result<(), StageError> {
        let Some(mut daemon) = self.daemon.take() else { return Ok(()) };
        if let Some(pid) = Pid::from_raw(daemon.id() as i32) {
            kill_process(pid, Signal::TERM)
                .map_err(|error| system("stopping the daemon")(error.into()))?;
        }
        let status = daemon.wait().map_err(system("waiting for the daemon"))?;
        if status.success() { Ok(()) } else { Err(self.ended("daemon", status)) }
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        for child in [&mut self.daemon, &mut self.controller].into_iter().flatten() {
            // A child that has ended by itself is as good as a killed one.
            let _ = child.kill();
            let _ = child.wait();
        }
        // Whoever uses the shared memory last removes the files of those that were killed.
        drop(SampleCount::open(&self.host, TrainId(1)));
    }
}

/// The demo's dataset: file name and text.
const FILES: [(&str, &str); 7] = [
    ("dataset.toml", include_str!("../../../config/demo/dataset.toml")),
    ("train.toml", include_str!("../../../config/demo/train.toml")),
    ("track.toml", include_str!("../../../config/demo/track.toml")),
    ("runs/01.csv", include_str!("../../../config/demo/runs/01.csv")),
    ("runs/02.csv", include_str!("../../../config/demo/runs/02.csv")),
    ("runs/03.csv", include_str!("../../../config/demo/runs/03.csv")),
    ("runs/06.csv", include_str!("../../../config/demo/runs/06.csv")),
];

/// Writes the dataset into a folder.
///
/// # Errors
///
/// When a file cannot be written.
pub fn write_dataset(folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder.join("runs"))?;
    FILES.iter().try_for_each(|(name, text)| std::fs::write(folder.join(name), text))
}

/// The demo's daemon configuration.
pub const DAEMON_CONFIG: &str = include_str!("../../../config/daemon.toml");
