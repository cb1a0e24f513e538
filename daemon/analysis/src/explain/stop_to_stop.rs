//! Errors from stop to stop, and the error that judges a model: that of runs from stop to stop where there are any.
//! Each of these runs goes from a departure, at the last sample at rest, to the next standstill. Each counts by itself,
//! since a few runs that creep would dominate a pooled error.
//!
//! Over a whole run every error is carried on: where a stop is cut off or shortened in the recording, the predicted
//! train runs on with a speed that the measured train does not have, and all later errors say nothing of the forces
//! there.

use std::ops::Range;

use dynocar_model::simulate::{OpenLoopRecording, STANDING_MPS, departs};
use serde::Serialize;

use crate::statistics::intervals_95;
use crate::statistics::{median, rms};

/// Least moving time in s of a run that counts: a shorter one is a shunt in a queue, and shows little.
const STOP_RUN_MOVING_MIN_S: f64 = 10.0;

/// Returns the runs from stop to stop that can be simulated from departure to standstill: first sample,
/// at rest, and one past the last, at rest again.
pub fn stop_runs(recording: &OpenLoopRecording) -> Vec<Range<usize>> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let mut runs = Vec::new();
    let mut from = None;
    for index in 0..samples.len() {
        let is_lost = !recording.is_simulated(index) || (index > 0 && recording.starts(index));
        if is_lost {
            from = None;
        } else if let Some(start) = from
            && samples[index].speed_mps <= STANDING_MPS
        {
            let moving = |at: &usize| samples[*at].speed_mps > STANDING_MPS;
            let moving_s: f64 =
                (start + 1..=index).filter(moving).map(|at| time_s[at] - time_s[at - 1]).sum();
            if moving_s >= STOP_RUN_MOVING_MIN_S {
                runs.push(start..index + 1);
            }
            from = None;
        }
        if departs(samples, index) && recording.is_simulated(index) {
            from = Some(index);
        }
    }
    runs
}

/// The middle of the errors of the runs from stop to stop, without and with the effects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StopToStop {
    /// Number of runs from stop to stop.
    pub runs: usize,
    /// Median of their root mean square errors in m/s: before and after.
    pub median_mps: [f64; 2],
    /// 95 % intervals of the two by bootstrap over the recorded runs, over those from stop to stop
    /// where there is one recorded run only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval_95_mps: Option<[[f64; 2]; 2]>,
    /// Root mean square of their errors in m/s, each with the same weight: before and after. An effect that acts at few
    /// places does not move the median.
    pub rms_mps: [f64; 2],
    /// 95 % intervals of the two by the same draws.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_interval_95_mps: Option<[[f64; 2]; 2]>,
    /// 95 % interval of 1 - after / before of these root mean squares.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reduction_interval_95: Option<[f64; 2]>,
    /// The errors in m/s themselves, before and after, by recorded run.
    #[serde(skip)]
    pub errors_mps: Vec<Vec<[f64; 2]>>,
}

impl StopToStop {
    /// Of errors in m/s before and after, by recorded run; `None` without any.
    pub fn from_errors(errors_mps: Vec<Vec<[f64; 2]>>) -> Option<Self> {
        let mut by_run = errors_mps.clone();
        by_run.retain(|errors| !errors.is_empty());
        if let [only] = &by_run[..] {
            by_run = only.iter().map(|pair| vec![*pair]).collect();
        }
        let sides_of = |drawn: &[&Vec<[f64; 2]>], of: fn(&mut [f64]) -> f64| {
            [0, 1].map(|side| {
                let own = drawn.iter().flat_map(|errors| errors.iter().map(|it| it[side]));
                of(&mut own.collect::<Vec<f64>>())
            })
        };
        let (median, rms) =
            (|own: &mut [f64]| median(own).unwrap_or(0.0), |own: &mut [f64]| rms(own));
        let all: Vec<&Vec<[f64; 2]>> = by_run.iter().collect();
        let runs = all.iter().map(|errors| errors.len()).sum();
        let intervals = intervals_95(&by_run, |drawn| {
            let ([before, after], rms) = (sides_of(drawn, median), sides_of(drawn, rms));
            Some([before, after, rms[0], rms[1], reduction(rms)])
        });
        (runs > 0).then_some(StopToStop {
            runs,
            median_mps: sides_of(&all, median),
            interval_95_mps: intervals.map(|[before, after, ..]| [before, after]),
            rms_mps: sides_of(&all, rms),
            rms_interval_95_mps: intervals.map(|[_, _, before, after, _]| [before, after]),
            reduction_interval_95: intervals.map(|it| it[4]),
            errors_mps,
        })
    }
}

/// 1 - after / before; 0 where there was no error.
pub fn reduction([before, after]: [f64; 2]) -> f64 {
    if before > 0.0 { 1.0 - after / before } else { 0.0 }
}

/// Predicted part of the runs.
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
    /// Predicted part of the runs.
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

    /// Returns the predicted part, in words that follow "runs".
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

#[cfg(test)]
mod tests {
    use dynocar_model::force::ResolvedSample;
    use dynocar_model::simulate::{Prediction, QuadraticForces, Restart, SpeedError};
    use dynocar_model::train::Davis;

    use super::*;
    use crate::explain::evidence::coasting;

    fn recorded(samples: Vec<ResolvedSample>) -> OpenLoopRecording {
        OpenLoopRecording::new(samples).unwrap()
    }

    fn predict(recording: &OpenLoopRecording, restart: Restart) -> Prediction {
        let mut prediction = Prediction::new();
        let davis = Davis { a: 1.5, b: 0.02, c: 0.004 };
        prediction.simulate(recording, &QuadraticForces::declared(recording, davis), restart);
        prediction
    }

    #[test]
    fn a_run_from_stop_to_stop_is_predicted_from_its_departure() {
        // Two runs of a minute between stands; a force of 1 kN too much is reported in the second.
        let pulled = |k: usize| {
            let second = k as f64 * 0.2;
            let within_s = second % 120.0;
            let (traction_n, brake_n) = match within_s {
                ..20.0 => (0.0, 60e3),
                ..50.0 => (60e3, 0.0),
                ..60.0 => (0.0, 0.0),
                _ => (0.0, 60e3),
            };
            let forces = (Some(traction_n), Some(brake_n));
            ResolvedSample {
                traction_force_n: forces.0,
                brake_force_n: forces.1,
                speed_mps: 0.0,
                time_ns: (second * 1e9).round() as i64,
                ..coasting()
            }
        };
        let made = recorded((0..1200).map(pulled).collect());
        let true_mps = predict(&made, Restart::FullRun).speed_mps().to_vec();
        let with = |gain: f64| {
            let samples = (0..1200).map(|k| {
                let sample = ResolvedSample { speed_mps: true_mps[k], ..pulled(k) };
                let gain = if k >= 600 { gain } else { 1.0 };
                let traction_force_n = sample.traction_force_n.map(|force| gain * force);
                ResolvedSample { traction_force_n, ..sample }
            });
            recorded(samples.collect())
        };
        let wrong = with(1.1);
        let runs = stop_runs(&wrong);
        assert_eq!(runs.len(), 2, "{runs:?}");
        for run in &runs {
            assert!(true_mps[run.start] <= 0.3 && true_mps[run.start + 1] > 0.3);
            assert!(true_mps[run.end - 1] <= 0.3 && true_mps[run.end - 2] > 0.3);
        }
        let prediction = predict(&wrong, Restart::AtDepartures);
        let error = |run| SpeedError::within(&wrong, &prediction, run).rmse_mps().unwrap();
        let errors_mps: Vec<f64> = runs.into_iter().map(error).collect();
        assert!(errors_mps[0] < 0.01 && errors_mps[1] > 0.3, "{errors_mps:?}");
        // A run that starts or ends in motion is not a trip between stops, nor is one with a gap of the forces.
        let mut gap: Vec<_> = with(1.0).samples().to_vec();
        for sample in &mut gap[150..180] {
            sample.traction_force_n = None;
        }
        assert_eq!(stop_runs(&recorded(gap)).len(), 1);
        assert_eq!(stop_runs(&recorded(with(1.0).samples()[150..600].to_vec())), Vec::new());
    }

    #[test]
    fn the_median_is_of_all_runs_from_stop_to_stop_and_lies_in_its_interval() {
        let by_run = (0..6).map(|k| vec![[0.1 * f64::from(k + 1), 0.1], [3.0, 0.2], [0.2, 0.3]]);
        let found = StopToStop::from_errors(by_run.chain([Vec::new()]).collect()).unwrap();
        assert_eq!((found.runs, found.median_mps[1]), (18, 0.2));
        assert!((found.median_mps[0] - 0.35).abs() < 1e-12, "{found:?}");
        // The three metres a second of one part in three are in the root mean square.
        assert!((found.rms_mps[0] - 1.7504).abs() < 0.001, "{found:?}");
        let [low, high] = found.interval_95_mps.unwrap()[0];
        assert!(low < 0.35 && 0.35 < high && high < 3.0, "{found:?}");
    }

    #[test]
    fn a_single_recorded_run_is_drawn_by_its_parts_and_one_part_has_no_interval() {
        let parts =
            StopToStop::from_errors(vec![vec![[0.2, 0.1], [0.4, 0.3], [0.5, 0.3]]]).unwrap();
        assert_eq!(parts.interval_95_mps.map(|it| it[0]), Some([0.2, 0.5]));
        let one = StopToStop::from_errors(vec![vec![[0.2, 0.1]]]).unwrap();
        assert_eq!((one.runs, one.interval_95_mps), (1, None));
        assert_eq!(StopToStop::from_errors(vec![Vec::new()]), None);
    }
}
