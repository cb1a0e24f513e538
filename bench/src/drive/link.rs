//! Trains whose drivers ask a daemon in a separate process. In each cycle every train's sample goes through its
//! channel, and the drivers wait until every pipeline has answered it. So the daemon misses no sample, however much
//! faster than real time the simulation runs, and a seed gives the same figures on any machine.

use dynocar::config::IdleStrategy;
use dynocar_client::{Reading, SamplePublisher, SnapshotReader};
use dynocar_model::train::{EffortCurve, TrainModel};
use dynocar_shared::{ParameterSnapshot, PipelineKind, Quantity, TrainId, TrainSample};
use dynocar_tests::process::{DaemonSite, Process};
use dynocar_transport::monotonic_now_ns;
use serde_json::json;

use crate::output::BenchError;
use crate::rig::site::{DaemonPlan, ThreadPlan, await_all};

/// Pipelines recommended by config/daemon.toml, with the friction of the brake, which these trains can provide.
const KINDS: [PipelineKind; 4] = [
    PipelineKind::TrainKalman,
    PipelineKind::AdhesionLaw,
    PipelineKind::BrakeSmoother,
    PipelineKind::ResidualMonitor,
];
/// The simulated clock is not the host's: on a busy machine the daemon must not seem silent.
const NEVER_STALE_NS: i64 = 600_000_000_000;

/// A controller's ends of its two channels.
struct Ends {
    reader: SnapshotReader,
    publisher: SamplePublisher,
}

/// The trains' channels and the daemon behind them.
pub struct Link {
    ends: Vec<Ends>,
    daemon: Option<Process>,
    plan: DaemonPlan,
    /// Last, for it takes the folder away.
    site: DaemonSite,
}

impl Link {
    /// Opens channels for some trains of a model, and starts the daemon that serves them.
    ///
    /// # Errors
    ///
    /// When a process, file or channel cannot be had.
    pub fn open(train: &TrainModel, trains: usize) -> Result<Self, BenchError> {
        let site = DaemonSite::new();
        site.write("train.toml", &train_toml(train)?);
        let fast = ThreadPlan {
            name: "fast",
            core: None,
            idle: IdleStrategy::Event,
            priority: None,
            pipelines: KINDS.to_vec(),
        };
        let lines = "[state]\nkeep = false\n".to_owned();
        let plan = DaemonPlan { trains: trains as u64, threads: vec![fast], lines };
        let mut ends = Vec::with_capacity(trains);
        for id in (1..=trains as u64).map(TrainId) {
            let reader = SnapshotReader::open(&site.host(), id)?;
            ends.push(Ends { reader, publisher: SamplePublisher::open(&site.host(), id)? });
        }
        let mut link = Link { ends, daemon: None, plan, site };
        link.start_daemon()?;
        Ok(link)
    }

    /// Starts a daemon, and waits until it serves every train.
    ///
    /// # Errors
    ///
    /// When it does not come to it.
    pub fn start_daemon(&mut self) -> Result<(), BenchError> {
        let begin_ns = monotonic_now_ns();
        let mut daemon = self.plan.start(&self.site)?;
        for ends in &mut self.ends {
            ends.reader.set_stale_after_ns(NEVER_STALE_NS);
            let is_new = |it: &ParameterSnapshot| it.published_ns >= begin_ns;
            await_all(&mut ends.reader, &mut daemon, KINDS.len(), is_new)?;
        }
        self.daemon = Some(daemon);
        Ok(())
    }

    /// Kills the daemon without a warning; its last answers can still be read until [`Link::notice_silence`].
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
    pub fn exchange(&mut self, samples: &mut [(usize, TrainSample)]) -> Result<(), BenchError> {
        for (train, sample) in samples.iter_mut() {
            self.ends[*train].publisher.publish(sample)?;
        }
        let Some(daemon) = &mut self.daemon else { return Ok(()) };
        for (train, sample) in samples {
            let sequence = sample.sequence;
            let is_answer = |it: &ParameterSnapshot| it.sample_sequence >= sequence;
            await_all(&mut self.ends[*train].reader, daemon, KINDS.len(), is_answer)?;
        }
        Ok(())
    }

    /// Returns the snapshot of a quantity that a train's driver may use.
    pub fn usable(&self, train: usize, quantity: Quantity) -> Option<&ParameterSnapshot> {
        let answer = self.ends[train].reader.quantity(quantity, monotonic_now_ns()).ok();
        answer.filter(Reading::is_usable).map(|reading| reading.snapshot)
    }

    /// Returns the samples that some pipeline lost.
    pub fn lost(&self) -> u64 {
        let readings = self.ends.iter().flat_map(|ends| ends.reader.readings(0));
        readings.map(|reading| reading.snapshot.samples_lost).sum()
    }
}

/// Returns the train's file.
fn train_toml(train: &TrainModel) -> Result<String, BenchError> {
    let effort = |curve: &EffortCurve| -> Vec<[f64; 2]> {
        curve.points().iter().map(|(speed_mps, force_n)| [*speed_mps, 1e-3 * force_n]).collect()
    };
    let (davis, gear) = (&train.resistance, &train.brake_gear);
    Ok(toml::to_string(&json!({
        "train": {
            "name": train.name,
            "mass_t": 1e-3 * train.mass_kg,
            "length_m": train.length_m,
            "rotating_mass_factor": train.rotating_mass_factor,
            "cars": train.cars,
        },
        "resistance": {
            "a": davis.a, "b": davis.b, "c": davis.c,
            "curve_constant_n_per_kn_m": train.curve_constant_n_per_kn_m,
        },
        "traction": { "effort": train.traction.as_ref().map_or(Vec::new(), effort) },
        "brake": {
            "max_force_kn": train.brake.as_ref().map_or(0.0, |it| 1e-3 * it.force_max_n()),
            "cylinder_diameter_mm": gear.cylinder_diameter_mm,
            "disc_radius_mm": gear.disc_radius_mm,
            "wheel_radius_mm": gear.wheel_radius_mm,
            "efficiency": gear.efficiency,
            "ratio": gear.ratio,
            "friction": gear.friction,
            "pads": gear.pads,
        },
    }))?)
}
