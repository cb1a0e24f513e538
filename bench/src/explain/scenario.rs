//! Simulated scenarios: one kind, two at once, or a poor recording, and the usual errors besides; and the simulated
//! datasets of `explain` and `monitor`.

use std::io;
use std::path::Path;

use clap::{Args, ValueEnum};
use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::explain::{Explanation, explain};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::dataset_writer::{
    dataset_files, read_files, write_dataset, write_truth,
};
use dynocar_tests::simulator::{
    Defects, EffectRequest, Law, SimulatedDataset, SimulatorSettings, TrainType, TrueDeviations,
    TrueEffect, Unlisted, simulate,
};

use crate::ending;
use crate::output::{BenchError, OutputArguments, at_least, named};

/// The simulated world in which an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ExplainWorld {
    /// Everything but the effect is as declared, within the errors of a good survey and of calibrated sensors.
    Plain,
    /// Trains of cars on couplings, in a wind of each day.
    Coupled,
    /// Weights, map, curve constant, winds, forces and wheels, all a little wrong at once.
    Rough,
    /// The same, with another rotating mass and rounded gradients.
    Rougher,
}

impl ExplainWorld {
    /// Returns the size of the deviations in this world.
    pub fn deviations(self) -> TrueDeviations {
        match self {
            ExplainWorld::Plain => TrueDeviations::PLAIN,
            ExplainWorld::Coupled => TrueDeviations::COUPLED,
            ExplainWorld::Rough => TrueDeviations::ROUGH,
            ExplainWorld::Rougher => TrueDeviations::ROUGHER,
        }
    }

    /// Returns the kinds of the small effects that always act in this world: an answer may name them.
    pub fn everyday(self) -> &'static [EffectKind] {
        // The last is a deviation of the rougher world alone.
        const KINDS: [EffectKind; 9] = [
            EffectKind::ActuatorDelay,
            EffectKind::BearingTemperature,
            EffectKind::CurveResistance,
            EffectKind::GradientError,
            EffectKind::MassChange,
            EffectKind::TractionGain,
            EffectKind::WheelDiameter,
            EffectKind::Wind,
            EffectKind::RotatingMass,
        ];
        match self {
            ExplainWorld::Plain | ExplainWorld::Coupled => &[],
            ExplainWorld::Rough => &KINDS[..KINDS.len() - 1],
            ExplainWorld::Rougher => &KINDS,
        }
    }
}

/// A family of datasets; a seed makes one of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExplainScenario {
    /// One undeclared effect of this kind; [`EffectKind::None`] for a null.
    Kind(EffectKind),
    /// Two effects of kinds drawn from the seed.
    Two,
    /// A rotating mass on a level, straight line, where another mass does the same.
    Alike,
    /// A tunnel that the map lacks: where its trains drive alike, a resistance does the same.
    UnmappedTunnel,
    /// A force that only slow trains feel, which no library holds.
    SlowForce,
    /// A force by a law drawn from the seed, which no library holds.
    AnyLaw,
    /// Another load between every two stations, and each a little different from run to run.
    LoadsByStop,
    /// A null recorded with gaps, repeats and heavy outliers.
    PoorNull,
    /// One effect of a kind drawn from the seed, recorded so.
    Poor,
}

/// The families that are no single kind, by name.
const FAMILIES: [(ExplainScenario, &str); 8] = [
    (ExplainScenario::Two, "two_effects"),
    (ExplainScenario::Alike, "level_straight_line"),
    (ExplainScenario::UnmappedTunnel, "unmapped_tunnel"),
    (ExplainScenario::SlowForce, "slow_force"),
    (ExplainScenario::AnyLaw, "any_law"),
    (ExplainScenario::LoadsByStop, "loads_by_stop"),
    (ExplainScenario::PoorNull, "none_poor_recording"),
    (ExplainScenario::Poor, "poor_recording"),
];

/// Pairs that a train meets and that no data of this kind confuse.
const PAIRS: [[EffectKind; 2]; 10] = {
    use EffectKind::{
        ActuatorDelay, BearingTemperature, CurveResistance, DraggingBrake, GradientShift,
        LocalResistance, MassChange, TractionGain, TunnelDrag, WheelDiameter, Wind,
    };
    [
        [TunnelDrag, Wind],
        [CurveResistance, TractionGain],
        [GradientShift, DraggingBrake],
        [WheelDiameter, TunnelDrag],
        [MassChange, CurveResistance],
        [ActuatorDelay, TractionGain],
        [BearingTemperature, CurveResistance],
        [LocalResistance, Wind],
        [TractionGain, DraggingBrake],
        [GradientShift, WheelDiameter],
    ]
};

/// Kinds that a poor recording is tried with.
const POOR: [EffectKind; 6] = [
    EffectKind::TunnelDrag,
    EffectKind::CurveResistance,
    EffectKind::DraggingBrake,
    EffectKind::GradientShift,
    EffectKind::TractionGain,
    EffectKind::Wind,
];

/// Standard deviation of a load from run to run where loads change at every stop.
const LOAD_SCATTER: f64 = 0.012;

/// One row in fifty wildly wrong, with a little of everything else.
const HEAVY: Defects = Defects { outliers: 0.02, ..Defects::ALL };

impl ExplainScenario {
    /// Returns all of them, in the order of the table.
    pub fn all() -> Vec<ExplainScenario> {
        let kinds = EffectKind::ALL.iter().copied().map(ExplainScenario::Kind);
        kinds.chain(FAMILIES.map(|(family, _)| family)).collect()
    }

    /// Returns its name on the command line and in the table.
    pub fn name(self) -> &'static str {
        match self {
            ExplainScenario::Kind(kind) => kind.name(),
            other => FAMILIES.iter().find(|it| it.0 == other).map_or("", |it| it.1),
        }
    }

    /// Returns whether nothing undeclared acts.
    pub fn is_null(self) -> bool {
        matches!(self, ExplainScenario::Kind(EffectKind::None) | ExplainScenario::PoorNull)
    }

    /// Returns the undeclared kinds of the dataset with this seed.
    pub fn kinds(self, seed: u64) -> Vec<EffectKind> {
        let drawn = |count: usize| (seed % count as u64) as usize;
        match self {
            ExplainScenario::Kind(EffectKind::None) | ExplainScenario::PoorNull => Vec::new(),
            ExplainScenario::Kind(kind) => vec![kind],
            ExplainScenario::Alike => vec![EffectKind::RotatingMass],
            ExplainScenario::UnmappedTunnel => vec![EffectKind::TunnelDrag],
            ExplainScenario::SlowForce | ExplainScenario::AnyLaw => vec![EffectKind::Unknown],
            ExplainScenario::LoadsByStop => vec![EffectKind::MassChange],
            ExplainScenario::Two => PAIRS[drawn(PAIRS.len())].to_vec(),
            ExplainScenario::Poor => vec![POOR[drawn(POOR.len())]],
        }
    }

    /// Returns the settings of the simulator in a world.
    pub fn settings(self, seed: u64, world: ExplainWorld) -> SimulatorSettings {
        let effects = match self {
            // 0.5 to 1.1 N/kN at half the speed below which it acts.
            ExplainScenario::SlowForce => {
                EffectRequest::Exactly(vec![TrueEffect::Unlisted(Unlisted {
                    law: Law::Slow { below_mps: 15.0, least_mps: 3.0 },
                    n_per_kn: 0.5 + 0.1 * (seed % 7) as f64,
                })])
            }
            ExplainScenario::AnyLaw => EffectRequest::AnyLaw,
            ExplainScenario::LoadsByStop => EffectRequest::LoadsByStop,
            _ => EffectRequest::Kinds(self.kinds(seed)),
        };
        let ordinary = SimulatorSettings::new(seed, effects);
        let is_poor = matches!(self, ExplainScenario::PoorNull | ExplainScenario::Poor);
        let by_stop = self == ExplainScenario::LoadsByStop;
        let load_share = if by_stop { LOAD_SCATTER } else { 0.0 };
        let deviations = TrueDeviations { load_share, ..world.deviations() };
        // Trains that stop often; elsewhere there are hardly any loads.
        let stopping = [TrainType::Regional, TrainType::Metro][(seed % 2) as usize];
        let train_type = by_stop.then_some(stopping);
        let defects = if is_poor { HEAVY } else { Defects::NONE };
        SimulatorSettings {
            defects,
            is_level_and_straight: self == ExplainScenario::Alike,
            maps_tunnels: self != ExplainScenario::UnmappedTunnel,
            deviations,
            train_type,
            ..ordinary
        }
    }

    /// Returns the kind that is hardly distinguishable from the one that acts, and whether no data of the family
    /// distinguish the two.
    pub fn competing(self) -> Option<(EffectKind, bool)> {
        match self {
            ExplainScenario::Alike => Some((EffectKind::MassChange, true)),
            ExplainScenario::UnmappedTunnel => Some((EffectKind::LocalResistance, false)),
            _ => None,
        }
    }
}

/// A simulated case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SimulatedCase {
    /// The family.
    pub scenario: ExplainScenario,
    /// The seed.
    pub seed: u64,
    /// The simulated world.
    pub world: ExplainWorld,
    /// Number of runs, a quarter of them held out.
    pub runs: usize,
}

impl SimulatedCase {
    /// Simulates the case.
    pub fn simulate(&self) -> SimulatedDataset {
        simulate(&self.settings())
    }

    /// Returns the settings of the simulator.
    pub fn settings(&self) -> SimulatorSettings {
        let holdout_runs = (self.runs / 4).max(1);
        let settings = self.scenario.settings(self.seed, self.world);
        SimulatorSettings { runs: self.runs, holdout_runs, ..settings }
    }

    /// Writes the dataset, with its truth next to it, as `<kind>-<seed>` into a folder.
    ///
    /// # Errors
    ///
    /// When the files cannot be written.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        let name = format!("{}-{}", self.scenario.name(), self.seed);
        let simulated = self.simulate();
        write_dataset(&simulated, &folder.join(&name))?;
        write_truth(&simulated, &folder.join(name + ".truth.json"))
    }
}

/// The simulated datasets of a command, and the destination of its result.
#[derive(Debug, Args)]
pub struct FamilyArguments {
    /// Simulated datasets for each kind
    #[arg(long, default_value_t = 20, value_parser = at_least(1))]
    seeds: usize,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    pub first_seed: u64,
    /// Only this kind, as tunnel_drag, or none, two_effects, none_poor_recording; may be repeated
    #[arg(long = "kind", value_name = "NAME")]
    kinds: Vec<String>,
    /// Errors simulated besides the effect
    #[arg(long, value_enum, default_value_t = ExplainWorld::Plain)]
    world: ExplainWorld,
    /// Runs of a dataset, a quarter of them held out
    #[arg(long, default_value_t = 8, value_parser = at_least(2))]
    runs: usize,
    /// Datasets at a time
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Print the outcome of every dataset on standard error
    #[arg(long)]
    pub verbose: bool,
    #[command(flatten)]
    pub output: OutputArguments,
}

impl FamilyArguments {
    /// Returns the scenarios asked for, else the usual ones.
    ///
    /// # Errors
    ///
    /// When there is no such kind.
    pub fn scenarios(
        &self,
        usual: Vec<ExplainScenario>,
    ) -> Result<Vec<ExplainScenario>, BenchError> {
        let all: Vec<_> = ExplainScenario::all().into_iter().map(|it| (it.name(), it)).collect();
        let chosen = self.kinds.iter().map(|name| named("--kind", name, &all));
        if self.kinds.is_empty() { Ok(usual) } else { chosen.collect() }
    }

    /// Returns every scenario with every seed, scenario by scenario.
    pub fn cases(&self, scenarios: &[ExplainScenario]) -> Vec<SimulatedCase> {
        let (first, world, runs) = (self.first_seed, self.world, self.runs);
        let seeds = move || first..first + self.seeds as u64;
        let of = |&scenario| seeds().map(move |seed| SimulatedCase { scenario, seed, world, runs });
        scenarios.iter().flat_map(of).collect()
    }

    /// Does the work on every case until the command is to end; returns the results by scenario.
    pub fn over<R: Clone + Send>(
        &self,
        scenarios: &[ExplainScenario],
        work: impl Fn(&SimulatedCase) -> R + Sync,
    ) -> Vec<(ExplainScenario, Vec<R>)> {
        let results = ending::over_until_due(&self.cases(scenarios), self.threads, work);
        let by_scenario = results.chunks(self.seeds.max(1)).map(<[R]>::to_vec);
        scenarios.iter().copied().zip(by_scenario).collect()
    }
}

/// Reads a simulated dataset through its files, as the program does.
///
/// # Panics
///
/// When the simulator's files are refused.
pub fn read(simulated: &SimulatedDataset) -> Dataset {
    read_files(&dataset_files(simulated))
}

/// Explains a simulated dataset.
///
/// # Panics
///
/// When a run has no usable sample.
pub fn explained(dataset: &Dataset) -> Explanation {
    explain(dataset, &|_, _| {}).expect("usable runs")
}
