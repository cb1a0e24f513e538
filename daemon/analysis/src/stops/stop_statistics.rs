//! A recorded stop, and all stops of a dataset together: their speeds, lengths, decelerations and standing times.

use serde::Serialize;

use super::deceleration_curve::DecelerationPoint;
use super::deceleration_law::StoppingDistance;
use super::find::FoundBy;
use super::friction::FrictionPoint;
use crate::dataset::Role;
use crate::statistics::span;

/// Step in m/s of the initial speeds of stops that are counted together.
const STEP_MPS: f64 = 5.0;
/// Step in m/s of the speeds at which decelerations are counted together.
const SPEEDS_MPS: f64 = 2.0;

/// The median of some values, and the interval in which 80 % of them lie.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QuantileRange {
    /// A tenth of the values is below.
    pub low: f64,
    /// Half of the values is below.
    pub median: f64,
    /// A tenth of the values is above.
    pub high: f64,
}

impl QuantileRange {
    fn from_values(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let at = |share: f64| sorted[(share * last as f64).round() as usize];
        Some(QuantileRange { low: at(0.1), median: at(0.5), high: at(0.9) })
    }
}

/// Stops from speeds next to each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FromSpeed {
    /// The speeds in m/s, from and to.
    pub from_mps: [f64; 2],
    /// How many stops.
    pub stops: usize,
    /// Their distances in m.
    pub distance_m: QuantileRange,
    /// Their times in s.
    pub time_s: QuantileRange,
    /// Their mean decelerations in m/s².
    pub mean_deceleration_mps2: QuantileRange,
}

/// Decelerations of all stops at a speed: the drivers' choice, and the least that the brake can give.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DecelerationSpread {
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Stops that passed it.
    pub stops: usize,
    /// Their decelerations in m/s²; the hardest tenth lies above `high`.
    pub deceleration_mps2: QuantileRange,
}

/// All stops together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StopStatistics {
    /// By the speed that they began at, from slow to fast.
    pub from_speeds: Vec<FromSpeed>,
    /// Decelerations over speed, from slow to fast.
    pub decelerations: Vec<DecelerationSpread>,
    /// Times in s that the train stood; `None` where it never went on.
    pub dwell_s: Option<QuantileRange>,
}

impl StopStatistics {
    /// Sums some stops up.
    pub fn from_stops(stops: &[RecordedStop]) -> Self {
        let ends_mps = span(stops.iter().map(|it| it.from_mps)).unwrap_or([0.0; 2]);
        let from_speeds = (0..).map(|step| f64::from(step) * STEP_MPS);
        let from_speeds = from_speeds.take_while(|it| *it <= ends_mps[1]).filter_map(|from_mps| {
            let bounds = [from_mps, from_mps + STEP_MPS];
            let within: Vec<&RecordedStop> =
                stops.iter().filter(|it| (bounds[0]..bounds[1]).contains(&it.from_mps)).collect();
            let spread = |of: fn(&RecordedStop) -> f64| {
                QuantileRange::from_values(&within.iter().map(|it| of(it)).collect::<Vec<f64>>())
            };
            Some(FromSpeed {
                from_mps: bounds,
                stops: within.len(),
                distance_m: spread(|it| it.distance_m)?,
                time_s: spread(|it| it.time_s)?,
                mean_deceleration_mps2: spread(|it| it.mean_deceleration_mps2)?,
            })
        });
        let speeds = (1..).map(|step| f64::from(step) * SPEEDS_MPS);
        let decelerations = speeds.take_while(|it| *it <= ends_mps[1]).filter_map(|speed_mps| {
            let at = stops.iter().filter_map(|stop| {
                let point = stop.decelerations.iter().find(|it| it.speed_mps == speed_mps)?;
                Some(point.deceleration_mps2)
            });
            let values: Vec<f64> = at.collect();
            let deceleration_mps2 = QuantileRange::from_values(&values)?;
            Some(DecelerationSpread { speed_mps, stops: values.len(), deceleration_mps2 })
        });
        let dwells: Vec<f64> = stops.iter().filter_map(|it| it.dwell_s).collect();
        StopStatistics {
            from_speeds: from_speeds.collect(),
            decelerations: decelerations.collect(),
            dwell_s: QuantileRange::from_values(&dwells),
        }
    }
}

/// How a train was brought to a stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Manner {
    /// By all of the brake from its command on.
    Full,
    /// As the driver wanted: the deceleration is his, and no law of the brake.
    Modulated,
}

/// A recorded stop.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordedStop {
    /// The run's file.
    pub file: String,
    /// Role of the run.
    pub role: Role,
    /// Time in s at which the brake was applied, as in the file.
    pub from_s: f64,
    /// Speed in m/s then.
    pub from_mps: f64,
    /// Distance in m from then to standstill.
    pub distance_m: f64,
    /// Time in s from then to standstill.
    pub time_s: f64,
    /// Mean deceleration in m/s² over that time.
    pub mean_deceleration_mps2: f64,
    /// Time in s until the train moved again; `None` where the run ends before.
    pub dwell_s: Option<f64>,
    /// Mean gradient in ‰ along the travel, which is taken out of the decelerations; `None` where it is unknown.
    pub gradient_permille: Option<f64>,
    /// Sign that the brake was applied.
    pub found_by: FoundBy,
    /// Whether the brake was applied in full.
    pub manner: Manner,
    /// Whether the wheels slid, so that their speed is not the train's.
    pub has_slid: bool,
    /// Time in s from the brake's first sign until traction was gone; `None` where the record does not show it.
    pub cut_off_s: Option<f64>,
    /// Why it shows no law of the brake; `None` for a stop that does.
    pub no_law: Option<String>,
    /// Deceleration at whole m/s, from fast to slow.
    pub decelerations: Vec<DecelerationPoint>,
    /// For a holdout stop: the prediction of the law.
    pub predicted: Option<StoppingDistance>,
    /// The friction behind it.
    pub friction: Vec<FrictionPoint>,
}
