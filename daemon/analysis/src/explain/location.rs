//! Location of an effect, and its uncertainty.

use std::collections::BTreeMap;

use serde::Serialize;

/// An interval of time in a run, in the recording's own time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunWindow {
    /// The run's file.
    pub run: String,
    /// Start in s.
    pub t_start_s: f64,
    /// End in s.
    pub t_end_s: f64,
}

/// A range of a covariate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CovariateRange {
    /// Its name with the unit.
    pub name: String,
    /// Lowest and highest value.
    pub range: [f64; 2],
}

/// Uncertainty of a window's ends.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WindowUncertainty {
    /// The run's file.
    pub run: String,
    /// 95 % interval of the start in s.
    pub t_start_s: [f64; 2],
    /// 95 % interval of the end in s; absent for an end that was not estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t_end_s: Option<[f64; 2]>,
}

/// How surely a place is known: 95 % intervals of the ends that were estimated.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PlaceUncertainty {
    /// Of both ends of every interval, in m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intervals_m: Option<Vec<[[f64; 2]; 2]>>,
    /// Of the windows that were estimated from the speeds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub windows: Option<Vec<WindowUncertainty>>,
    /// Of the least and the greatest value of the covariate; `null` where the data end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<[Option<[f64; 2]>; 2]>,
    /// Probability that the effect acts in a run, for all fit runs where the runs were chosen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run_probability: Option<BTreeMap<String, f64>>,
}

/// Where an effect acts; all that is given holds together.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Location {
    /// Chainages in m of the train's centre.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intervals_m: Option<Vec<[f64; 2]>>,
    /// Stretches of time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub windows: Option<Vec<RunWindow>>,
    /// Files of the runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub runs: Option<Vec<String>>,
    /// Lowest and highest speed in m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_range_mps: Option<[f64; 2]>,
    /// A covariate and its range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covariate: Option<CovariateRange>,
    /// How surely that is known, where it was estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncertainty_95: Option<PlaceUncertainty>,
}

impl Location {
    /// A place that is a set of intervals; nothing given for an empty set.
    pub fn of_intervals(intervals_m: Vec<[f64; 2]>) -> Self {
        Location {
            intervals_m: (!intervals_m.is_empty()).then_some(intervals_m),
            ..Location::default()
        }
    }

    /// Returns whether the place may be in a run, by its file.
    pub fn may_be_in(&self, file: &str) -> bool {
        self.runs.as_ref().is_none_or(|runs| runs.iter().any(|run| run == file))
            && self.windows.as_ref().is_none_or(|all| all.iter().any(|own| own.run == file))
    }
}
