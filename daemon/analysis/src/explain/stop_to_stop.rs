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
    /// 95 % interval of 1 - after / before, by the same draws.
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
        let medians_of = |drawn: &[&Vec<[f64; 2]>]| {
            [0, 1].map(|side| {
                median(drawn.iter().flat_map(|errors| errors.iter().map(|it| it[side])).collect())
            })
        };
        let all: Vec<&Vec<[f64; 2]>> = by_run.iter().collect();
        let median_mps = medians_of(&all);
        let runs = all.iter().map(|errors| errors.len()).sum();
        let intervals = intervals_95(&by_run, |drawn| {
            let [before, after] = medians_of(drawn);
            Some([before, after, reduction([before, after])])
        });
        (runs > 0).then_some(StopToStop {
            runs,
            median_mps,
            interval_95_mps: intervals.map(|[before, after, _]| [before, after]),
            reduction_interval_95: intervals.map(|it| it[2]),
            errors_mps,
        })
    }
}

/// 1 - after / before; 0 where there was no error.
pub fn reduction([before, after]: [f64; 2]) -> f64 {
    if before > 0.0 { 1.0 - after / before } else { 0.0 }
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
