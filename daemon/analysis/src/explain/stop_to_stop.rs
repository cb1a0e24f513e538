//! Errors from stop to stop: each run from a departure to the next standstill for itself, since a
//! pooled error is ruled by a few runs that creep.

use serde::Serialize;

use super::bootstrap::intervals_95;

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
    /// Root mean square of their errors in m/s, each as much as any other: before and after. What acts at
    /// few places moves no median.
    pub rms_mps: [f64; 2],
    /// 95 % intervals of the two by the same draws.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_interval_95_mps: Option<[[f64; 2]; 2]>,
    /// 95 % interval of 1 - after / before of that.
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
        let sides_of = |drawn: &[&Vec<[f64; 2]>], of: fn(Vec<f64>) -> f64| {
            [0, 1].map(|side| {
                of(drawn.iter().flat_map(|errors| errors.iter().map(|it| it[side])).collect())
            })
        };
        let all: Vec<&Vec<[f64; 2]>> = by_run.iter().collect();
        let runs = all.iter().map(|errors| errors.len()).sum();
        let intervals = intervals_95(&by_run, |drawn| {
            let ([median, median_after], rms) = (sides_of(drawn, median), sides_of(drawn, rms));
            Some([median, median_after, rms[0], rms[1], reduction(rms)])
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

/// Root mean square; 0 of none.
fn rms(values: Vec<f64>) -> f64 {
    let squares: f64 = values.iter().map(|value| value * value).sum();
    (squares / values.len().max(1) as f64).sqrt()
}

/// The middle value, the mean of the two middle ones of an even number; 0 of none.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    match values.len() {
        0 => 0.0,
        count => 0.5 * (values[(count - 1) / 2] + values[count / 2]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
