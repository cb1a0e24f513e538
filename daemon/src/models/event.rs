//! Maintenance events: what acted in certain runs, and is no property of a train or a line.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::moment::Moment;
use super::origin::Figure;
use super::text::ModelHash;

/// An interval of a run in which an event acted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EventWindow {
    /// The run, by its file.
    pub run: String,
    /// SHA-256 of the run's file.
    pub sha256: String,
    /// Start in s, in the run's own time.
    pub t_start_s: f64,
    /// End in s.
    pub t_end_s: f64,
}

/// What acted in certain runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MaintenanceEvent {
    /// Its kind.
    pub kind: String,
    /// When it was found.
    pub found: Moment,
    /// When it first and last acted, where the runs' dates are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acted: Option<[Moment; 2]>,
    /// The model in force, against which it was seen.
    pub model: ModelHash,
    /// Where on the line, in m; empty where it is tied to no place.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub intervals_m: Vec<[f64; 2]>,
    /// A sentence for people.
    pub sentence: String,
    /// Its numbers by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub size: BTreeMap<String, Figure>,
    /// Probability that as much is found where nothing acts.
    pub p_value: f64,
    /// The runs in which it acted, and when.
    pub windows: Vec<EventWindow>,
}
