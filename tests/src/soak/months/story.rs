//! The undeclared effects of each day.

use dynocar_shared::vocabulary::EffectKind;

use crate::simulator::effect_maker::{EffectScene, make_effect};
use crate::simulator::effects::TrueRunWindow;
use crate::simulator::random::{SimulatorRandom, Stream};
use crate::simulator::{SimulatedWorld, TrueEffect};

/// Story of a train over some months.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Story {
    /// No effect; two models that are no better are on trial.
    Nothing,
    /// From the onset on, one effect of a kind, as large as the simulator draws it.
    Appears(EffectKind),
    /// Wheels wear from the onset on, 1.5 % until they are turned at the end.
    WheelsWear,
    /// From the onset to the end, bearings are cold at the start of each run.
    Winter,
    /// On the day of the onset a brake drags.
    BrakeDrags,
}

/// Begin and end of a story, in days from the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StorySpan {
    /// The first day on which something is undeclared.
    pub onset: usize,
    /// The first day on which nothing is undeclared any more.
    pub end: usize,
}

/// How a life is lived.
#[derive(Clone, Copy, Debug)]
pub struct LifeSettings {
    /// Story of the train.
    pub story: Story,
    /// When.
    pub span: StorySpan,
    /// The same seed gives the same life.
    pub seed: u64,
    /// Its days.
    pub days: usize,
    /// Trips of a day.
    pub trips: usize,
    /// Trips of a day that a recorder keeps.
    pub recorded: usize,
    /// See `trips_between_mistakes` of the configuration.
    pub trips_between_mistakes: f64,
}

/// Wear of wheels until they are turned, as a share of the diameter.
const WEAR: f64 = 0.015;

impl Story {
    /// Returns its name: of the story, or of the kind that appears.
    pub fn name(self) -> String {
        match self {
            Story::Nothing => "nothing".into(),
            Story::Appears(kind) => kind.to_string(),
            Story::WheelsWear => "wheels_wear".into(),
            Story::Winter => "winter".into(),
            Story::BrakeDrags => "brake_drags_for_a_day".into(),
        }
    }

    /// Returns the story of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|story| story.name() == name)
    }

    /// Returns every story.
    pub fn all() -> Vec<Self> {
        let kinds = EffectKind::ALL.iter().filter(|&&kind| kind != EffectKind::None);
        let own = [Story::Nothing, Story::WheelsWear, Story::Winter, Story::BrakeDrags];
        own.into_iter().chain(kinds.map(|&kind| Story::Appears(kind))).collect()
    }

    /// Returns the kind of effect that the simulator must have a fitting train and line for.
    pub fn kind(self) -> Option<EffectKind> {
        match self {
            Story::Nothing => None,
            Story::Appears(kind) => Some(kind),
            Story::WheelsWear => Some(EffectKind::WheelDiameter),
            Story::Winter => Some(EffectKind::BearingTemperature),
            Story::BrakeDrags => Some(EffectKind::DraggingBrake),
        }
    }

    /// Returns whether it ends on the last day of its span, else it goes on.
    pub fn ends(self) -> bool {
        matches!(self, Story::WheelsWear | Story::Winter | Story::BrakeDrags)
    }

    /// Returns the undeclared effects on a day in a world.
    pub fn effects(self, world: &SimulatedWorld, span: StorySpan, day: usize) -> Vec<TrueEffect> {
        if day < span.onset || (self.ends() && day >= span.end) {
            return Vec::new();
        }
        let scene = world.scene();
        match self {
            Story::Nothing => Vec::new(),
            Story::Appears(kind) => drawn(world, kind, &scene),
            Story::Winter => drawn(world, EffectKind::BearingTemperature, &scene),
            Story::WheelsWear => {
                let share = (day + 1 - span.onset) as f64 / (span.end - span.onset) as f64;
                // A smaller wheel turns faster: the measured speed exceeds the driven one.
                vec![TrueEffect::WheelDiameter { speed_scale: 1.0 + WEAR * share }]
            }
            Story::BrakeDrags => {
                let mut effects = drawn(world, EffectKind::DraggingBrake, &scene);
                for effect in &mut effects {
                    if let TrueEffect::DraggingBrake { windows, .. } = effect {
                        let (start_s, end_s) = (0.0, f64::INFINITY);
                        let all = world.plans.iter().map(|plan| plan.number);
                        *windows = all.map(|run| TrueRunWindow { run, start_s, end_s }).collect();
                    }
                }
                effects
            }
        }
    }
}

fn drawn(world: &SimulatedWorld, kind: EffectKind, scene: &EffectScene<'_>) -> Vec<TrueEffect> {
    let mut random = SimulatorRandom::new(world.settings.seed, Stream::Effects);
    make_effect(kind, scene, world.settings.duration_s, &mut random).into_iter().collect()
}
