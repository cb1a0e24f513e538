//! The error by which a model is judged: of runs from stop to stop where there are any.
//!
//! Over a whole run every error is carried on: where a stop is cut off or shorter than it was, the
//! predicted train runs on with a speed that the measured one does not have, and the error of all
//! that follows says nothing of the forces there.

use serde::Serialize;

use super::stop_to_stop::{StopToStop, reduction};

/// What of the runs is predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// Each part from a departure to the next standstill, from rest: root mean square of their errors.
    StopToStop,
    /// Whole runs from their first sample to their end, pooled.
    FullRun,
}

/// An error without and with the effects.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// What was predicted.
    pub metric: Metric,
    /// Number of parts from stop to stop, or of runs.
    pub count: usize,
    /// Error in m/s: before and after.
    pub error_mps: [f64; 2],
    /// 95 % intervals of the two; absent where nothing gives them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval_95_mps: Option<[[f64; 2]; 2]>,
    /// 1 - after / before.
    pub reduction: f64,
    /// Its 95 % interval.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reduction_interval_95: Option<[f64; 2]>,
}

impl Judged {
    /// By whole runs, with the intervals of before, after and reduction.
    pub fn by_full_runs(
        count: usize,
        error_mps: [f64; 2],
        intervals_95: Option<[[f64; 2]; 3]>,
    ) -> Self {
        Judged {
            metric: Metric::FullRun,
            count,
            error_mps,
            interval_95_mps: intervals_95.map(|[before, after, _]| [before, after]),
            reduction: reduction(error_mps),
            reduction_interval_95: intervals_95.map(|it| it[2]),
        }
    }

    /// What was predicted, in words that follow "runs".
    pub fn predicted(&self) -> String {
        match (self.metric, self.count) {
            (Metric::FullRun, _) => String::new(),
            (Metric::StopToStop, 1) => ", from stop to stop".into(),
            (Metric::StopToStop, count) => format!(", from stop to stop ({count} sections)"),
        }
    }
}

impl From<&StopToStop> for Judged {
    fn from(found: &StopToStop) -> Self {
        Judged {
            metric: Metric::StopToStop,
            count: found.runs,
            error_mps: found.rms_mps,
            interval_95_mps: found.rms_interval_95_mps,
            reduction: reduction(found.rms_mps),
            reduction_interval_95: found.reduction_interval_95,
        }
    }
}
