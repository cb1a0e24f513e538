//! Simulated scenarios: one kind, two at once, or a poor recording, and the usual errors besides.

use clap::ValueEnum;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::{
    Defects, Deviations, Effect, EffectRequest, Law, SimulatorSettings, TrainType, Unlisted,
};

/// A world that effects happen in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum World {
    /// Everything but the effect is as declared, to a good survey and calibrated sensors.
    Plain,
    /// Trains of cars on couplings, in a wind of each day.
    Coupled,
    /// Weights, map, curve constant, winds, forces and wheels, all a little wrong at once.
    Rough,
    /// The same, with another rotating mass and rounded gradients.
    Rougher,
}

impl World {
    /// By how much things are wrong in it.
    pub fn deviations(self) -> Deviations {
        match self {
            World::Plain => Deviations::PLAIN,
            World::Coupled => Deviations::COUPLED,
            World::Rough => Deviations::ROUGH,
            World::Rougher => Deviations::ROUGHER,
        }
    }

    /// Kinds that are in this world, small, whatever else acts: to name them is no error.
    pub fn everyday(self) -> &'static [EffectKind] {
        match self {
            World::Plain | World::Coupled => &[],
            World::Rough | World::Rougher => &[
                EffectKind::ActuatorDelay,
                EffectKind::BearingTemperature,
                EffectKind::CurveResistance,
                EffectKind::GradientError,
                EffectKind::MassChange,
                EffectKind::TractionGain,
                EffectKind::WheelDiameter,
                EffectKind::Wind,
            ],
        }
    }
}

/// A family of datasets; a seed makes one of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scenario {
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
const FAMILIES: [(Scenario, &str); 8] = [
    (Scenario::Two, "two_effects"),
    (Scenario::Alike, "level_straight_line"),
    (Scenario::UnmappedTunnel, "unmapped_tunnel"),
    (Scenario::SlowForce, "slow_force"),
    (Scenario::AnyLaw, "any_law"),
    (Scenario::LoadsByStop, "loads_by_stop"),
    (Scenario::PoorNull, "none_poor_recording"),
    (Scenario::Poor, "poor_recording"),
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

impl Scenario {
    /// All of them, in the order of the table.
    pub fn all() -> Vec<Scenario> {
        let kinds = EffectKind::ALL.iter().copied().map(Scenario::Kind);
        kinds.chain(FAMILIES.map(|(family, _)| family)).collect()
    }

    /// Its name on the command line and in the table.
    pub fn name(self) -> &'static str {
        match self {
            Scenario::Kind(kind) => kind.name(),
            other => FAMILIES.iter().find(|it| it.0 == other).map_or("", |it| it.1),
        }
    }

    /// True when nothing undeclared acts.
    pub fn is_null(self) -> bool {
        matches!(self, Scenario::Kind(EffectKind::None) | Scenario::PoorNull)
    }

    /// The undeclared kinds of the dataset with this seed.
    pub fn kinds(self, seed: u64) -> Vec<EffectKind> {
        let drawn = |count: usize| (seed % count as u64) as usize;
        match self {
            Scenario::Kind(EffectKind::None) | Scenario::PoorNull => Vec::new(),
            Scenario::Kind(kind) => vec![kind],
            Scenario::Alike => vec![EffectKind::RotatingMass],
            Scenario::UnmappedTunnel => vec![EffectKind::TunnelDrag],
            Scenario::SlowForce | Scenario::AnyLaw => vec![EffectKind::Unknown],
            Scenario::LoadsByStop => vec![EffectKind::MassChange],
            Scenario::Two => PAIRS[drawn(PAIRS.len())].to_vec(),
            Scenario::Poor => vec![POOR[drawn(POOR.len())]],
        }
    }

    /// Returns the settings of the simulator in a world.
    pub fn settings(self, seed: u64, world: World) -> SimulatorSettings {
        let effects = match self {
            // 0.5 to 1.1 N/kN at half the speed below which it acts.
            Scenario::SlowForce => EffectRequest::Exactly(vec![Effect::Unlisted(Unlisted {
                law: Law::Slow { below_mps: 15.0, least_mps: 3.0 },
                n_per_kn: 0.5 + 0.1 * (seed % 7) as f64,
            })]),
            Scenario::AnyLaw => EffectRequest::AnyLaw,
            Scenario::LoadsByStop => EffectRequest::LoadsByStop,
            _ => EffectRequest::Kinds(self.kinds(seed)),
        };
        let ordinary = SimulatorSettings::new(seed, effects);
        let is_poor = matches!(self, Scenario::PoorNull | Scenario::Poor);
        let by_stop = self == Scenario::LoadsByStop;
        let load_share = if by_stop { LOAD_SCATTER } else { 0.0 };
        let deviations = Deviations { load_share, ..world.deviations() };
        // Trains that stop often; elsewhere there are hardly any loads.
        let stopping = [TrainType::Regional, TrainType::Metro][(seed % 2) as usize];
        let train_type = by_stop.then_some(stopping);
        let defects = if is_poor { HEAVY } else { Defects::NONE };
        SimulatorSettings {
            defects,
            is_level_and_straight: self == Scenario::Alike,
            maps_tunnels: self != Scenario::UnmappedTunnel,
            deviations,
            train_type,
            ..ordinary
        }
    }

    /// The kind that is hardly distinguishable from the one that acts, and whether no data of the family distinguish
    /// the two.
    pub fn competing(self) -> Option<(EffectKind, bool)> {
        match self {
            Scenario::Alike => Some((EffectKind::MassChange, true)),
            Scenario::UnmappedTunnel => Some((EffectKind::LocalResistance, false)),
            _ => None,
        }
    }
}
