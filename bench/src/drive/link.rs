//! Trains whose drivers ask a daemon, a process of its own: each cycle every train's sample goes through
//! its channel, and nobody drives on before every pipeline has answered it. So the daemon misses
//! nothing, however much faster than real time it goes, and a seed gives the same figures on any machine.

use std::fmt::Write;
use std::time::{Duration, Instant};

use dynocar::config::IdleStrategy;
use dynocar_client::{Reading, SamplePublisher, SnapshotReader, monotonic_now_ns};
use dynocar_model::train::{EffortCurve, TrainModel};
use dynocar_shared::{ParameterSnapshot, PipelineKind, Quantity, TrainId, TrainSample};

use crate::rig::RigError;
use crate::rig::child::Peer;
use crate::rig::site::{DaemonPlan, Site, ThreadPlan};

/// What config/daemon.toml recommends, with the brake's friction, which these trains can give.
const KINDS: [PipelineKind; 4] = [
    PipelineKind::TrainKalman,
    PipelineKind::AdhesionLaw,
    PipelineKind::BrakeSmoother,
    PipelineKind::ResidualMonitor,
];
/// How long a daemon may take to begin, or to answer a sample.
const PATIENCE: Duration = Duration::from_secs(60);
/// Looks for an answer before the thread sleeps.
const LOOKS: u32 = 200;
const SLEEP: Duration = Duration::from_micros(20);
/// The simulated clock is not the host's: a busy machine makes no daemon silent.
const NEVER_STALE_NS: i64 = 600_000_000_000;

/// A controller's two ends.
struct Ends {
    reader: SnapshotReader,
    publisher: SamplePublisher,
}

/// The trains' channels and the daemon behind them.
pub struct Link {
    ends: Vec<Ends>,
    daemon: Option<Peer>,
    config: String,
    /// Last, for it takes the folder away.
    site: Site,
}

impl Link {
    /// Opens channels for some trains of a model, and starts the daemon that serves them.
    ///
    /// # Errors
    ///
    /// When a process, file or channel cannot be had.
    pub fn open(train: &TrainModel, trains: usize) -> Result<Self, RigError> {
        let site = Site::with_train(&train_toml(train))?;
        let fast = ThreadPlan {
            name: "fast",
            core: None,
            idle: IdleStrategy::Event,
            priority: None,
            pipelines: KINDS.to_vec(),
        };
        let lines = "[state]\nkeep = false\n".to_owned();
        let plan = DaemonPlan { trains: trains as u64, threads: vec![fast], lines };
        let config = site.write_config(&plan)?.to_string_lossy().into_owned();
        let mut ends = Vec::with_capacity(trains);
        for id in (1..=trains as u64).map(TrainId) {
            let reader = SnapshotReader::open(site.host(), id)?;
            ends.push(Ends { reader, publisher: SamplePublisher::open(site.host(), id)? });
        }
        let mut link = Link { ends, daemon: None, config, site };
        link.start_daemon()?;
        Ok(link)
    }

    /// Starts a daemon, and waits until it serves every train.
    ///
    /// # Errors
    ///
    /// When it does not come to it.
    pub fn start_daemon(&mut self) -> Result<(), RigError> {
        let begin_ns = monotonic_now_ns();
        let mut daemon = Peer::start(&self.site, &["daemon", &self.config])?;
        for ends in &mut self.ends {
            ends.reader.set_stale_after_ns(NEVER_STALE_NS);
            await_all(&mut ends.reader, &mut daemon, |it| it.published_ns >= begin_ns)?;
        }
        self.daemon = Some(daemon);
        Ok(())
    }

    /// Kills the daemon without a warning; what it has said can still be read until
    /// [`Link::notice_silence`].
    pub fn kill_daemon(&mut self) {
        self.daemon = None;
    }

    /// The daemon has been silent for too long.
    pub fn notice_silence(&mut self) {
        for ends in &mut self.ends {
            ends.reader.set_stale_after_ns(-1);
        }
    }

    /// Hands over every train's sample of this cycle, and waits for the answers while there is a daemon.
    ///
    /// # Errors
    ///
    /// When a sample is not taken, or the daemon ends or does not answer.
    pub fn exchange(&mut self, samples: &mut [(usize, TrainSample)]) -> Result<(), RigError> {
        for (train, sample) in samples.iter_mut() {
            self.ends[*train].publisher.publish(sample)?;
        }
        let Some(daemon) = &mut self.daemon else { return Ok(()) };
        for (train, sample) in samples {
            let sequence = sample.sequence;
            let is_answer = |it: &ParameterSnapshot| it.sample_sequence >= sequence;
            await_all(&mut self.ends[*train].reader, daemon, is_answer)?;
        }
        Ok(())
    }

    /// What a train's driver may use of a quantity.
    pub fn usable(&self, train: usize, quantity: Quantity) -> Option<&ParameterSnapshot> {
        let answer = self.ends[train].reader.quantity(quantity, monotonic_now_ns()).ok();
        answer.filter(Reading::is_usable).map(|reading| reading.snapshot)
    }

    /// Samples that some pipeline lost.
    pub fn lost(&self) -> u64 {
        let readings = self.ends.iter().flat_map(|ends| ends.reader.readings(0));
        readings.map(|reading| reading.snapshot.samples_lost).sum()
    }
}

/// Polls until the newest snapshot of every pipeline is as wanted.
fn await_all(
    reader: &mut SnapshotReader,
    daemon: &mut Peer,
    is_wanted: impl Fn(&ParameterSnapshot) -> bool,
) -> Result<(), RigError> {
    let (mut looks, start) = (0, Instant::now());
    loop {
        reader.poll();
        if reader.readings(0).filter(|it| is_wanted(it.snapshot)).count() == KINDS.len() {
            return Ok(());
        }
        looks += 1;
        if looks < LOOKS {
            std::thread::yield_now();
            continue;
        }
        std::thread::sleep(SLEEP);
        if looks % 1000 == 0 {
            daemon.require()?;
            if start.elapsed() > PATIENCE {
                return Err(RigError::Silent {
                    what: "the daemon".into(),
                    seconds: PATIENCE.as_secs(),
                });
            }
        }
    }
}

/// A train's file.
fn train_toml(train: &TrainModel) -> String {
    let (name, mass_t, length_m) = (&train.name, 1e-3 * train.mass_kg, train.length_m);
    let gamma = train.rotating_mass_factor;
    let (a, b, c) = (train.resistance.a, train.resistance.b, train.resistance.c);
    let curve = train.curve_constant_n_per_kn_m;
    let mut text = format!(
        "[train]\nname = \"{name}\"\nmass_t = {mass_t}\nlength_m = {length_m}\n\
         rotating_mass_factor = {gamma}\ncars = {}\n\
         [resistance]\na = {a}\nb = {b}\nc = {c}\ncurve_constant_n_per_kn_m = {curve}\n",
        train.cars
    );
    let effort = |curve: &EffortCurve| {
        let points = curve.points().iter().map(|(v, force_n)| format!("[{v}, {}]", 1e-3 * force_n));
        points.collect::<Vec<_>>().join(", ")
    };
    // Writing into a String cannot fail.
    if let Some(traction) = &train.traction {
        let _ = writeln!(text, "[traction]\neffort = [{}]", effort(traction));
    }
    let _ = writeln!(text, "[brake]");
    if let Some(brake) = &train.brake {
        let _ = writeln!(text, "max_force_kn = {}", 1e-3 * brake.force_max_n());
    }
    let gear = &train.brake_gear;
    for (key, value) in [
        ("cylinder_diameter_mm", gear.cylinder_diameter_mm),
        ("disc_radius_mm", gear.disc_radius_mm),
        ("wheel_radius_mm", gear.wheel_radius_mm),
        ("efficiency", gear.efficiency),
        ("ratio", gear.ratio),
        ("friction", gear.friction),
        ("pads", gear.pads),
    ] {
        if let Some(value) = value {
            let _ = writeln!(text, "{key} = {value}");
        }
    }
    text
}
