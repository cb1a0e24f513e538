//! A high-fidelity simulator of recorded runs, with which the project checks its claims.
//!
//! From a seed it draws a train of one of four types, a line, and runs in both directions with their load, weather and
//! driver. The truth is a train of many cars that each feel their own gradient, curve and tunnel, under jerk-limited
//! commands and lagging actuators. Undeclared effects act on that truth, or on the sensors; the program under test sees
//! only the declaration and the recordings of the sensors.
//!
//! # Layout
//!
//! - [`settings`]: the requested dataset; [`random`]: a stream of numbers per subject
//! - [`train_maker`], [`line_maker`], [`run_maker`]: train, line and runs
//! - [`deviations`], [`common_deviations`]: small errors of all declarations
//! - [`effects`], [`unlisted`], [`effect_maker`], [`disturbances`]: undeclared effects, and their changes of forces and
//!   sensors
//! - [`driving`], [`permitted_speed`], [`driver`], [`actuators`], [`dynamics`], [`true_run`],
//!   [`couplings`]: driving and motion
//! - [`sensors`], [`defects`], [`gnss`]: the recording
//! - [`truth`], [`oracle`]: the findings of a perfect explainer, and its prediction error
//! - [`columns`], [`dataset_writer`]: the recording as a dataset folder

pub mod actuators;
pub mod columns;
pub mod common_deviations;
pub mod couplings;
pub mod dataset_writer;
pub mod defects;
pub mod deviations;
pub mod disturbances;
pub mod driver;
pub mod driving;
pub mod dynamics;
pub mod effect_maker;
pub mod effects;
pub mod gnss;
pub mod line_maker;
pub mod oracle;
pub mod permitted_speed;
pub mod power;
pub mod random;
pub mod run_maker;
pub mod sensors;
pub mod settings;
pub mod train_maker;
pub mod true_run;
pub mod truth;
pub mod unlisted;

use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::TrainSample;

pub use deviations::TrueDeviations;
pub use effects::TrueEffect;
pub use settings::{
    Defects, EffectRequest, ForceSampling, GnssReceiver, SimulatorSettings, TrainType,
};
pub use unlisted::{Around, Law, Unlisted};

use dynocar_shared::vocabulary::EffectKind;

use disturbances::Disturbances;
use dynamics::TruePhysics;
use effect_maker::{EffectScene, make_effect, suitable_types};
use line_maker::{SimulatedLine, make_line};
use random::{SimulatorRandom, Stream};
use run_maker::{RunPlan, make_plans};
use sensors::{Sensors, make_sensors, measure_run};
use train_maker::{TrueTrain, make_train};
use true_run::{TrueState, drive_run};

/// One simulated run.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedRun {
    /// Plan of the run.
    pub plan: RunPlan,
    /// Undeclared effects of the run.
    pub disturbances: Disturbances,
    /// True states, every 0.05 s.
    pub states: Vec<TrueState>,
    /// Recorded samples.
    pub samples: Vec<TrainSample>,
    /// Positions by GNSS, one for each sample; empty without a receiver.
    pub positions: Vec<Option<gnss::Position>>,
}

/// A simulated dataset with its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedDataset {
    /// Settings of the simulator.
    pub settings: SimulatorSettings,
    /// The train, declared and true.
    pub train: TrueTrain,
    /// The line, declared and true.
    pub line: SimulatedLine,
    /// The undeclared effects.
    pub effects: Vec<TrueEffect>,
    /// The sensors.
    pub sensors: Sensors,
    /// The runs.
    pub runs: Vec<SimulatedRun>,
}

impl SimulatedDataset {
    /// Returns the declared train.
    pub fn declared_train(&self) -> &TrainModel {
        &self.train.declared
    }

    /// Returns the declared track.
    pub fn track(&self) -> &Track {
        &self.line.track
    }
}

/// Simulates a dataset.
///
/// # Panics
///
/// When fewer than two runs, a period of sampling outside 0.1 to 1 s, or a duration below 60 s is
/// asked for.
pub fn simulate(settings: &SimulatorSettings) -> SimulatedDataset {
    let world = SimulatedWorld::from_settings(settings);
    let effects = draw_effects(settings, &world.scene());
    let runs: Vec<SimulatedRun> =
        world.plans.iter().map(|plan| world.run(plan.clone(), &effects)).collect();
    let lengths_s: Vec<f64> =
        runs.iter().map(|run| run.states[run.states.len() - 1].time_s).collect();
    let effects = effects.into_iter().map(|effect| effect.ended_with_runs(&lengths_s)).collect();
    let SimulatedWorld { settings, train, line, sensors, .. } = world;
    SimulatedDataset { settings, train, line, effects, sensors, runs }
}

/// A train, a line and the runs that are planned, before anything is undeclared.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedWorld {
    /// Settings of the simulator.
    pub settings: SimulatorSettings,
    /// The train, declared and true.
    pub train: TrueTrain,
    /// The line, declared and true.
    pub line: SimulatedLine,
    /// The sensors.
    pub sensors: Sensors,
    /// The runs.
    pub plans: Vec<RunPlan>,
}

impl SimulatedWorld {
    /// Draws a world.
    ///
    /// # Panics
    ///
    /// See [`simulate`].
    pub fn from_settings(settings: &SimulatorSettings) -> Self {
        draw_world(settings)
    }

    /// Returns the train and line for which an effect may be drawn.
    pub fn scene(&self) -> EffectScene<'_> {
        EffectScene { train: &self.train, line: &self.line, plans: &self.plans }
    }

    /// Drives and records a run with some effects.
    pub fn run(&self, plan: RunPlan, effects: &[TrueEffect]) -> SimulatedRun {
        simulate_run(&self.settings, &self.train, &self.line, plan, effects, &self.sensors)
    }
}

fn draw_world(settings: &SimulatorSettings) -> SimulatedWorld {
    assert!(settings.runs >= 2, "expected at least 2 runs, got {}", settings.runs);
    let period_s = settings.sample_period_s;
    assert!((0.1..=1.0).contains(&period_s), "expected a period of 0.1 to 1 s, got {period_s} s");
    assert!(settings.duration_s >= 60.0, "expected 60 s or more, got {} s", settings.duration_s);
    let stream = |stream: Stream| SimulatorRandom::new(settings.seed, stream);
    let mut of_train = stream(Stream::Train);
    let drawn_type = of_train.pick(&fitting_types(&settings.effects));
    let train_type = settings.train_type.unwrap_or(drawn_type);
    let train = make_train(train_type, settings.resistance_spread, &mut of_train);
    let mut of_line = stream(Stream::SimulatedLine);
    let has_tunnels =
        of_line.chance(0.5) || settings.effects.kinds().contains(&EffectKind::TunnelDrag);
    let size = (train.declared.length_m, train.handling.speed_max_mps);
    let line = make_line(settings, train_type, size, has_tunnels, &mut of_line);
    let plans = make_plans(settings, &train, &line, &mut stream(Stream::Plans));
    let sensors = make_sensors(&train, settings.sensor_noise, &mut stream(Stream::SensorTypes));
    SimulatedWorld { settings: settings.clone(), train, line, sensors, plans }
}

/// Types of train on which all the effects show; all types when there is no such.
fn fitting_types(request: &EffectRequest) -> Vec<TrainType> {
    let kinds = request.kinds();
    let fits = |train_type: &TrainType| {
        kinds.iter().all(|&kind| suitable_types(kind).contains(train_type))
    };
    let fitting: Vec<TrainType> = TrainType::ALL.into_iter().filter(fits).collect();
    if fitting.is_empty() { TrainType::ALL.to_vec() } else { fitting }
}

fn draw_effects(settings: &SimulatorSettings, scene: &EffectScene<'_>) -> Vec<TrueEffect> {
    match &settings.effects {
        EffectRequest::Exactly(effects) => effects.clone(),
        EffectRequest::LoadsByStop => {
            let mut random = SimulatorRandom::new(settings.seed, Stream::Effects);
            vec![scene.loads_by_stop(&mut random)]
        }
        EffectRequest::AnyLaw => {
            let mut random = SimulatorRandom::new(settings.seed, Stream::Effects);
            vec![scene.any_law(settings.duration_s, &mut random)]
        }
        EffectRequest::Kinds(kinds) => {
            let mut random = SimulatorRandom::new(settings.seed, Stream::Effects);
            kinds
                .iter()
                .filter_map(|&kind| make_effect(kind, scene, settings.duration_s, &mut random))
                .collect()
        }
    }
}

fn simulate_run(
    settings: &SimulatorSettings,
    train: &TrueTrain,
    line: &SimulatedLine,
    plan: RunPlan,
    effects: &[TrueEffect],
    sensors: &Sensors,
) -> SimulatedRun {
    let stream = |stream: Stream| SimulatorRandom::new(settings.seed, stream);
    let disturbances = Disturbances::new(effects, train, line, &plan, settings);
    let physics = TruePhysics { train, line, plan: &plan, disturbances: &disturbances };
    let mut states = drive_run(&physics, settings);
    if settings.deviations.has_couplings {
        couplings::move_leading_car(&physics, &mut states);
    }
    let clean = measure_run(
        &states,
        &plan,
        line,
        (sensors, &disturbances),
        settings,
        &mut stream(Stream::Sensors(plan.number)),
    );
    let samples =
        defects::spoil(clean, &settings.defects, &mut stream(Stream::Defects(plan.number)));
    let positions = settings.gnss.map_or(Vec::new(), |receiver| {
        let mut random = stream(Stream::Gnss(plan.number));
        gnss::positions(&samples, &states, line, (receiver, settings), &mut random)
    });
    SimulatedRun { plan, disturbances, states, samples, positions }
}
