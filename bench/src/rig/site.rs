//! A run-time directory with a daemon configuration of its own.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use dynocar::config::IdleStrategy;
use dynocar::models::{ModelText, Moment, NewModel, Origin, Store};
use dynocar_client::Host;
use dynocar_shared::{PipelineKind, TrainId};
use tempfile::TempDir;

use super::{RigError, system};

/// The train that latency and load drive; its brake gear is declared, so that every pipeline
/// has what it needs.
const TRAIN: &str = r#"[train]
name = "measured train"
mass_t = 200.0
length_m = 120.0
cars = 6
rotating_mass_factor = 0.08

[resistance]
a = 1.9
b = 0.03
c = 0.0043

[traction]
effort = [[0.0, 300.0], [20.0, 300.0], [50.0, 120.0]]

[brake]
max_force_kn = 300.0
cylinder_diameter_mm = 203.0
disc_radius_mm = 247.0
wheel_radius_mm = 460.0
efficiency = 0.9
ratio = 2.5
friction = 0.35
pads = 48
"#;

/// A thread of the daemon with the pipelines it serves, in their order.
#[derive(Clone, Debug)]
pub struct ThreadPlan {
    /// Its name.
    pub name: &'static str,
    /// The core it is bound to.
    pub core: Option<usize>,
    /// What it does while no sample comes.
    pub idle: IdleStrategy,
    /// Its real-time priority.
    pub priority: Option<u8>,
    /// Its pipelines.
    pub pipelines: Vec<PipelineKind>,
}

/// A daemon's configuration, as far as measurements vary it.
#[derive(Clone, Debug)]
pub struct DaemonPlan {
    /// Number of trains, numbered from 1.
    pub trains: u64,
    /// Its threads.
    pub threads: Vec<ThreadPlan>,
    /// Further lines of the `[daemon]` table.
    pub lines: String,
}

impl DaemonPlan {
    /// The configuration's text.
    pub fn to_toml(&self) -> String {
        let mut text = format!("[daemon]\nlog = \"error\"\n{}\n", self.lines);
        for id in 1..=self.trains {
            text += &format!("[[trains]]\nid = {id}\nfile = \"train.toml\"\n");
        }
        for thread in &self.threads {
            let (name, idle) = (thread.name, thread.idle);
            // Writing into a String cannot fail.
            let _ = write!(text, "[[threads]]\nname = \"{name}\"\nidle = \"{idle}\"\n");
            if let Some(core) = thread.core {
                let _ = writeln!(text, "core = {core}");
            }
            if let Some(priority) = thread.priority {
                let _ = writeln!(text, "priority = {priority}");
            }
            for kind in &thread.pipelines {
                let _ = write!(text, "[[pipelines]]\nkind = \"{kind}\"\nthread = \"{name}\"\n");
            }
        }
        text
    }
}

/// A folder for one slice of a measurement; processes of different sites never meet.
#[derive(Debug)]
pub struct Site {
    folder: TempDir,
    host: Host,
}

impl Site {
    /// A new site with the train that latency and load drive.
    ///
    /// # Errors
    ///
    /// When no temporary folder can be had.
    pub fn new() -> Result<Self, RigError> {
        Site::with_train(TRAIN)
    }

    /// A new site with a train's file of this text.
    ///
    /// # Errors
    ///
    /// When no temporary folder can be had.
    pub fn with_train(text: &str) -> Result<Self, RigError> {
        let folder = tempfile::Builder::new()
            .prefix("dynocar-bench-")
            .tempdir()
            .map_err(system("a temporary folder"))?;
        let host = Host::at(&folder.path().join("root"))?;
        let site = Site { folder, host };
        std::fs::write(site.train_file(), text).map_err(system("writing the train's file"))?;
        Ok(site)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// The run-time directory.
    pub fn host(&self) -> &Host {
        &self.host
    }

    /// Where the train's file lies.
    pub fn train_file(&self) -> PathBuf {
        self.path().join("train.toml")
    }

    /// Puts candidates into a store of models, each with another resistance than the train's file; gives
    /// the lines of the configuration that have them tried.
    ///
    /// # Errors
    ///
    /// When they cannot be written.
    pub fn put_candidates(&self, train: TrainId, count: u32) -> Result<String, RigError> {
        let store = self.path().join("models");
        std::fs::create_dir(&store).map_err(system("making a store of models"))?;
        let parent = Some(ModelText { train: TRAIN.into(), track: None }.hash());
        for number in 1..=count {
            let a = format!("[resistance]\na = 2.{number}");
            let text = ModelText { train: TRAIN.replace("[resistance]\na = 1.9", &a), track: None };
            let origin =
                Origin::written("Of a measurement.", parent, Moment::of(SystemTime::now()));
            let new = NewModel { text, origin, answer_json: None, report_html: None };
            Store::at(&store).train(train).put(&new)?;
        }
        Ok("[models]\ndirectory = \"models\"".into())
    }

    /// Writes the daemon's configuration and gives its path.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn write_config(&self, plan: &DaemonPlan) -> Result<PathBuf, RigError> {
        let path = self.path().join("daemon.toml");
        std::fs::write(&path, plan.to_toml()).map_err(system("writing the configuration"))?;
        Ok(path)
    }
}

impl Drop for Site {
    fn drop(&mut self) {
        // Peers are killed, so what they had in shared memory is still there.
        let own = self.path().file_name().unwrap_or_default().to_string_lossy();
        let prefixes = [self.host.segment_prefix(), own.into_owned()];
        for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            let name = entry.file_name();
            if prefixes.iter().any(|prefix| name.to_string_lossy().starts_with(prefix)) {
                // Gone already is as good.
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}
