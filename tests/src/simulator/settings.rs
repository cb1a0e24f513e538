//! Settings of a simulated dataset.

use dynocar_shared::vocabulary::EffectKind;

use super::deviations::TrueDeviations;
use super::effects::TrueEffect;

/// A kind of train.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrainType {
    /// A locomotive with wagons, up to 28 m/s.
    Freight,
    /// A multiple unit of 2 to 5 cars, up to 44 m/s.
    Regional,
    /// A multiple unit of 4 to 8 cars, up to 25 m/s, with frequent stops.
    Metro,
    /// A unit of 8 cars, up to 84 m/s.
    HighSpeed,
}

impl TrainType {
    /// All four.
    pub const ALL: [TrainType; 4] =
        [TrainType::Freight, TrainType::Regional, TrainType::Metro, TrainType::HighSpeed];

    /// Returns the name for files and people.
    pub const fn name(self) -> &'static str {
        match self {
            TrainType::Freight => "freight",
            TrainType::Regional => "regional",
            TrainType::Metro => "metro",
            TrainType::HighSpeed => "high_speed",
        }
    }
}

/// Which undeclared effects a dataset has.
#[derive(Clone, Debug, PartialEq)]
pub enum EffectRequest {
    /// One effect of each of these kinds with a size and place drawn from the seed; an empty list
    /// gives a null, [`EffectKind::Unknown`] one that no library declares.
    Kinds(Vec<EffectKind>),
    /// Exactly these.
    Exactly(Vec<TrueEffect>),
    /// Another load between every two stations, in each direction.
    LoadsByStop,
    /// One resistance by a law outside the library, drawn from the seed.
    AnyLaw,
}

impl EffectRequest {
    /// No undeclared effect.
    pub fn none() -> Self {
        EffectRequest::Kinds(Vec::new())
    }

    /// Returns the kinds asked for; an exact effect outside the library is [`EffectKind::Unknown`].
    pub fn kinds(&self) -> Vec<EffectKind> {
        match self {
            EffectRequest::Kinds(kinds) => kinds.clone(),
            EffectRequest::LoadsByStop => vec![EffectKind::MassChange],
            EffectRequest::AnyLaw => vec![EffectKind::Unknown],
            EffectRequest::Exactly(effects) => effects.iter().map(TrueEffect::kind).collect(),
        }
    }
}

/// Defects on the way from the sensors to the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Defects {
    /// Share of rows missing one by one.
    pub missing_rows: f64,
    /// Gaps of 1 to 5 s per hour.
    pub gaps_per_hour: f64,
    /// Share of cells (position, forces, pressure, temperature) that are empty.
    pub missing_cells: f64,
    /// Share of rows with a heavy outlier in speed, position or a force.
    pub outliers: f64,
    /// Share of rows that come twice.
    pub repeated_rows: f64,
    /// Share of rows that come after their successor.
    pub swapped_rows: f64,
    /// Standard deviation of the sampling instant as share of the period.
    pub jitter: f64,
}

impl Defects {
    /// A clean recording.
    pub const NONE: Defects = Defects {
        missing_rows: 0.0,
        gaps_per_hour: 0.0,
        missing_cells: 0.0,
        outliers: 0.0,
        repeated_rows: 0.0,
        swapped_rows: 0.0,
        jitter: 0.0,
    };

    /// A poor recording with a little of everything.
    pub const ALL: Defects = Defects {
        missing_rows: 0.01,
        gaps_per_hour: 6.0,
        missing_cells: 0.005,
        outliers: 0.005,
        repeated_rows: 0.001,
        swapped_rows: 0.001,
        jitter: 0.05,
    };
}

/// Everything that determines a simulated dataset.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatorSettings {
    /// The same seed gives the same bytes.
    pub seed: u64,
    /// The kind of train; `None` draws one on which the effects matter.
    pub train_type: Option<TrainType>,
    /// The undeclared effects.
    pub effects: EffectRequest,
    /// Number of runs, at least 2.
    pub runs: usize,
    /// Runs among them that are set aside for scoring.
    pub holdout_runs: usize,
    /// Length in s that a run aims at.
    pub duration_s: f64,
    /// Time in s between samples, 0.1 to 1.
    pub sample_period_s: f64,
    /// Time in s of every run's first sample.
    pub time_offset_s: f64,
    /// Factor on the noise and quanta of all sensors; 0 gives ideal sensors.
    pub sensor_noise: f64,
    /// Factor on the distance of the true from the declared Davis coefficients.
    pub resistance_spread: f64,
    /// A line without gradients and curves.
    pub is_level_and_straight: bool,
    /// Whether the map holds the line's tunnels; else its list of them is empty.
    pub maps_tunnels: bool,
    /// Deviations of everything that is declared.
    pub deviations: TrueDeviations,
    /// Wheel-slip events that a run has on average, where traction allows.
    pub wheel_slips_per_run: f64,
    /// Defects between sensors and file.
    pub defects: Defects,
    /// A GNSS receiver instead of an odometer, and no line file.
    pub gnss: Option<GnssReceiver>,
    /// True when all runs go the same way.
    pub is_one_direction: bool,
    /// Relation of a recorded force to the time around its stamp.
    pub force_sampling: ForceSampling,
}

/// Relation of a recorded force to the time around its stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForceSampling {
    /// The force at the stamp.
    Instant,
    /// The force that acts from the stamp to the next one: the drive holds it.
    Held,
    /// The mean of the time since the stamp before.
    Averaged,
}

/// A GNSS receiver on the train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GnssReceiver {
    /// Standard deviation in m of a position, east and north each.
    pub std_m: f64,
    /// Time constant in s with which its error fades.
    pub fading_s: f64,
    /// Age in s of a position at its stamp.
    pub late_s: f64,
    /// Gaps of 10 to 60 s per hour.
    pub gaps_per_hour: f64,
}

impl GnssReceiver {
    /// Errors of 3.5 m that fade over 12 s, 1.3 s late, with gaps.
    pub const USUAL: GnssReceiver =
        GnssReceiver { std_m: 3.5, fading_s: 12.0, late_s: 1.3, gaps_per_hour: 6.0 };
}

impl SimulatorSettings {
    /// Eight runs of a quarter of an hour at 5 Hz, two of them holdout, with ordinary sensors and
    /// a clean recording.
    pub fn new(seed: u64, effects: EffectRequest) -> Self {
        SimulatorSettings {
            seed,
            train_type: None,
            effects,
            runs: 8,
            holdout_runs: 2,
            duration_s: 900.0,
            sample_period_s: 0.2,
            time_offset_s: 0.0,
            sensor_noise: 1.0,
            resistance_spread: 1.0,
            is_level_and_straight: false,
            maps_tunnels: true,
            deviations: TrueDeviations::PLAIN,
            wheel_slips_per_run: 0.25,
            defects: Defects::NONE,
            gnss: None,
            is_one_direction: false,
            force_sampling: ForceSampling::Instant,
        }
    }

    /// Returns the same with ideal sensors, declared Davis coefficients that are the true ones, no
    /// deviations and no wheel slip: the rest of an error is the effect's or the predictor's.
    pub fn ideal(seed: u64, effects: EffectRequest) -> Self {
        SimulatorSettings {
            sensor_noise: 0.0,
            resistance_spread: 0.0,
            deviations: TrueDeviations::NONE,
            wheel_slips_per_run: 0.0,
            ..SimulatorSettings::new(seed, effects)
        }
    }
}
