//! A run-time directory with a daemon of its own, and other processes on it.

use std::time::{Duration, SystemTime};

use dynocar::config::IdleStrategy;
use dynocar::models::{ModelText, NewModel, Origin, Store, UtcSecond};
use dynocar_client::SnapshotReader;
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId};
use dynocar_tests::process::{DaemonSite, Process};
use rustix::process::Signal;

use crate::output::{BenchError, during};

/// The train that latency and load drive; its brake gear is declared, so that every pipeline has its inputs.
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
    /// Idle strategy of the thread.
    pub idle: IdleStrategy,
    /// Its real-time priority.
    pub priority: Option<u8>,
    /// Its pipelines.
    pub pipelines: Vec<PipelineKind>,
}

/// A daemon's configuration, as far as measurements vary it.
#[derive(Clone, Debug, Default)]
pub struct DaemonPlan {
    /// Number of trains, numbered from 1.
    pub trains: u64,
    /// Its threads.
    pub threads: Vec<ThreadPlan>,
    /// Further lines of the `[daemon]` table.
    pub lines: String,
}

impl DaemonPlan {
    fn to_toml(&self) -> String {
        let mut text = format!("[daemon]\nlog = \"error\"\n{}\n", self.lines);
        for id in 1..=self.trains {
            text += &format!("[[trains]]\nid = {id}\nfile = \"train.toml\"\n");
        }
        for ThreadPlan { name, core, idle, priority, pipelines } in &self.threads {
            text += &format!("[[threads]]\nname = \"{name}\"\nidle = \"{idle}\"\n");
            let line = |(key, value)| format!("{key} = {value}\n");
            text.extend(core.map(|core| line(("core", core))));
            text.extend(priority.map(|it| line(("priority", usize::from(it)))));
            for kind in pipelines {
                text += &format!("[[pipelines]]\nkind = \"{kind}\"\nthread = \"{name}\"\n");
            }
        }
        text
    }

    /// Starts the daemon.
    ///
    /// # Errors
    ///
    /// When this program cannot be found.
    pub fn start(&self, site: &DaemonSite) -> Result<Process, BenchError> {
        let config = site.write("daemon.toml", &self.to_toml());
        peer(site, "daemon", &[&config.to_string_lossy()])
    }
}

/// Returns a new site with the train that latency and load drive.
pub fn site() -> DaemonSite {
    let site = DaemonSite::new();
    site.write("train.toml", TRAIN);
    site
}

/// Starts a process of a measurement: this program again, with its hidden command.
///
/// # Errors
///
/// When this program cannot be found.
pub fn peer(site: &DaemonSite, kind: &str, arguments: &[&str]) -> Result<Process, BenchError> {
    let program = std::env::current_exe().map_err(during("finding this program"))?;
    Ok(site.start_apart(&program.to_string_lossy(), &[&["peer", kind], arguments].concat()))
}

/// Fails when a process has ended.
///
/// # Errors
///
/// When it has ended, with its error output.
pub fn require(process: &mut Process) -> Result<(), BenchError> {
    match process.try_wait() {
        None => Ok(()),
        Some(status) => {
            let said = process.errors();
            Err(format!("a process of the measurement ended: {status} {}", said.trim()).into())
        }
    }
}

/// Asks a process to end, and waits until it has.
///
/// # Errors
///
/// When it ended before, or badly.
pub fn stop(mut process: Process) -> Result<(), BenchError> {
    require(&mut process)?;
    let status = process.end(Signal::TERM);
    // Peers without a handler of their own end by the signal.
    let is_well = status.success() || status.code().is_none();
    if is_well { Ok(()) } else { Err(format!("a process ended: {status}").into()) }
}

/// Polls until as many pipelines as this show a wanted snapshot; looks ever more seldom.
///
/// # Errors
///
/// When the daemon ends, or says nothing for a minute.
pub fn await_all(
    reader: &mut SnapshotReader,
    daemon: &mut Process,
    pipelines: usize,
    is_wanted: impl Fn(&ParameterSnapshot) -> bool,
) -> Result<(), BenchError> {
    // A daemon answers within some of these looks, unless it shares its core with this thread.
    for look in 1..3_000_000 {
        reader.poll();
        if reader.readings(0).filter(|it| is_wanted(it.snapshot)).count() == pipelines {
            return Ok(());
        }
        if look < 200 {
            std::thread::yield_now();
            continue;
        }
        std::thread::sleep(Duration::from_micros(20));
        if look % 1000 == 0 {
            require(daemon)?;
        }
    }
    Err("the daemon: no answer for a minute".into())
}

/// Puts candidates into a store of models, each with another resistance than the train's file; gives
/// the lines of the configuration that have them tried.
///
/// # Errors
///
/// When they cannot be written.
pub fn put_candidates(site: &DaemonSite, train: TrainId, count: u32) -> Result<String, BenchError> {
    let store = site.path().join("models");
    std::fs::create_dir(&store).map_err(during("making a store of models"))?;
    let parent = Some(ModelText { train: TRAIN.into(), track: None }.hash());
    for number in 1..=count {
        let a = format!("[resistance]\na = 2.{number}");
        let text = ModelText { train: TRAIN.replace("[resistance]\na = 1.9", &a), track: None };
        let origin =
            Origin::written("Of a measurement.", parent, UtcSecond::from_time(SystemTime::now()));
        let new = NewModel { text, origin, answer_json: None, report_html: None };
        Store::at(&store).train(train).put(&new)?;
    }
    Ok("[models]\ndirectory = \"models\"".into())
}
