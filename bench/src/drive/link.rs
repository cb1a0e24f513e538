//! Trains whose drivers ask a daemon in a separate process, and the daemon's usable answers as the drivers' parameters,
//! with their errors.
//!
//! In each cycle every train's sample goes through its channel, and the drivers wait until every pipeline has answered
//! it. So the daemon misses no sample, however much faster than real time the simulation runs, and a seed gives the
//! same figures on any machine.

use dynocar::config::IdleStrategy;
use dynocar_client::{Reading, SamplePublisher, SnapshotReader};
use dynocar_model::train::{Davis, EffortCurve, TrainModel};
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::stopping::RailAdhesion;
use dynocar_shared::{
    Parameter, ParameterSnapshot, PipelineKind, Quantity, TrainId, TrainSample, Uncertain,
};
use dynocar_tests::process::{DaemonSite, Process};
use dynocar_transport::monotonic_now_ns;
use serde_json::json;

use super::knowledge::Knowledge;
use super::train::Train;
use crate::output::BenchError;
use crate::rig::site::{DaemonPlan, ThreadPlan, await_all};
use crate::scenarios::score::{Answer, COUNTS_MPS, QuantityScore};

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

/// Quantities that the driver asks for.
pub const ASKED: [Quantity; 4] =
    [Quantity::Resistance, Quantity::Mass, Quantity::BrakeFriction, Quantity::Adhesion];

fn value(snapshot: &ParameterSnapshot, parameter: Parameter) -> Option<Uncertain> {
    Some(Uncertain::new(snapshot.value(parameter)?, snapshot.std(parameter)?))
}

/// Returns the declared parameters with each usable answer in its place.
pub fn learned<'a>(
    declared: &Knowledge,
    declared_friction: f64,
    speed_mps: f64,
    usable: impl Fn(Quantity) -> Option<&'a ParameterSnapshot>,
) -> Knowledge {
    let mut known = *declared;
    if let Some(mass_t) = usable(Quantity::Mass).and_then(|it| value(it, Parameter::Mass)) {
        known.mass_kg = Uncertain::new(1e3 * mass_t.value, 1e3 * mass_t.std);
    }
    if let Some(snapshot) = usable(Quantity::Resistance)
        && let Some(at) = snapshot.resistance_at(speed_mps)
    {
        let davis = [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC];
        let [a, b, c] = davis.map(|parameter| snapshot.value(parameter).unwrap_or_default());
        // The estimated resistance is that of still air; the wind of the day is part of the unexplained force.
        let weight_kn = 1e-3 * known.mass_kg.value * GRAVITY_MPS2;
        let [unexplained, std] = [snapshot.unexplained_force_n, snapshot.unexplained_force_std_n]
            .map(|force_n| force_n / weight_kn);
        known.davis = Davis { a: a + unexplained, b, c };
        known.w0_std_n_per_kn = at.w0_std_n_per_kn.hypot(std);
    }
    // Where the rail carries less than the brake exerts, the brake shows nothing of itself.
    let rail = usable(Quantity::Adhesion).and_then(RailAdhesion::learned);
    let friction =
        usable(Quantity::BrakeFriction).and_then(|it| value(it, Parameter::DiscFriction));
    if rail.is_some() {
        known.rail = rail;
    } else if let Some(friction) = friction {
        // Only brake force over mass slows the train, and the friction presumes the declared mass.
        let share = known.mass_kg.value / (declared.mass_kg.value * declared_friction);
        known.brake_scale = Uncertain::new(share * friction.value, share * friction.std);
    }
    known
}

/// Answers of the last braking that a driver keeps for the next one: the daemon calls them stale once the train no
/// longer brakes, which is when the next braking is planned. No stop is bounded by them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AnswerMemory {
    brake_scale: Option<Uncertain>,
    rail: Option<RailAdhesion>,
    was_braking: bool,
    saw_rail: bool,
}

impl AnswerMemory {
    /// Returns the parameters by which the driver drives, from the answers usable now, by [`ASKED`].
    pub fn recall(
        &mut self,
        learned: &Knowledge,
        is_usable: [bool; 4],
        is_braking: bool,
    ) -> Knowledge {
        let mut known = *learned;
        if is_usable[2] && !is_usable[3] {
            self.brake_scale = Some(learned.brake_scale);
        } else if let Some(kept) = self.brake_scale {
            known.brake_scale = kept;
        }
        if is_usable[3] {
            (self.rail, self.saw_rail) = (learned.rail, true);
        } else {
            known.rail = self.rail;
        }
        if self.was_braking && !is_braking {
            // A whole braking that the rail did not limit.
            if !self.saw_rail {
                self.rail = None;
            }
            self.saw_rail = false;
        }
        self.was_braking = is_braking;
        known
    }
}

/// Adds a cycle of the moving train to the scores of the declared and the learned parameters, in the order of
/// [`ASKED`]; brake and adhesion count while the train brakes.
pub fn count(
    scores: &mut [QuantityScore; 4],
    train: &Train,
    is_braking: bool,
    declared: &Knowledge,
    learned: &Knowledge,
    is_usable: [bool; 4],
) {
    let speed_mps = train.speed_mps();
    if speed_mps < COUNTS_MPS {
        return;
    }
    let w0 = |davis: &Davis| davis.w0_n_per_kn(speed_mps);
    let adhesion = match learned.rail {
        Some(RailAdhesion::Law(law, scale)) => {
            let at = law.adhesion(speed_mps);
            Uncertain::new(at * scale.value, at * scale.std)
        }
        _ => Uncertain::exact(f64::NAN),
    };
    let w0_found = Uncertain::new(w0(&learned.davis), learned.w0_std_n_per_kn);
    let answers = [
        Answer::of(w0_found, w0(&declared.davis), w0(&train.davis())),
        Answer::of(learned.mass_kg, declared.mass_kg.value, train.mass_kg),
        Answer::of(learned.brake_scale, 1.0, train.brake_scale()),
        Answer::of(adhesion, f64::INFINITY, train.adhesion(speed_mps)),
    ];
    let cycle_ms = f64::from(train.service.cycle_ms);
    for (index, answer) in answers.into_iter().enumerate() {
        if index < 2 || is_braking {
            let score = &mut scores[index];
            let time_s = 1e-3 * (score.cycles + 1) as f64 * cycle_ms;
            score.push(time_s, 1e-3 * cycle_ms, is_usable[index].then_some(answer));
        }
    }
}
