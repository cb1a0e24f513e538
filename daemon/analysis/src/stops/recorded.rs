//! A recorded stop, and what was read from it.

use serde::Serialize;

use super::deceleration_curve::DecelerationPoint;
use super::deceleration_law::StoppingDistance;
use super::find::FoundBy;
use super::friction::FrictionPoint;
use crate::dataset::Role;

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
    /// For a stop held out: what the law said of it.
    pub predicted: Option<StoppingDistance>,
    /// The friction behind it.
    pub friction: Vec<FrictionPoint>,
}
