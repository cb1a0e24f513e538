//! All kinds over all seeds.

use std::collections::BTreeMap;

use serde::Serialize;

use super::grade::Grade;
use super::scenario::Scenario;
use crate::output::{self, Record};
use crate::statistics::{mean, median, quantiles, root_mean_square};

/// An error at most so many times another is as good.
const NEAR: f64 = 1.1;

/// What came out for one kind.
#[derive(Clone, Debug, Serialize)]
pub struct KindRow {
    /// The kind that acts; `none` for nulls.
    pub kind: String,
    /// Simulated datasets.
    pub runs: usize,
    /// Answers with the right verdict and the right kind.
    pub right: usize,
    /// What was named instead.
    pub confused_with: BTreeMap<String, usize>,
    /// Median intersection over union of the place.
    pub iou: Option<f64>,
    /// Share of the 95 % intervals of ends of places that hold the true end.
    pub place_coverage: Option<f64>,
    /// Median relative error of the parameters.
    pub parameter_error: Option<f64>,
    /// Share of the 95 % intervals that hold the truth.
    pub coverage: Option<f64>,
    /// Root mean square of the parameters' errors over their standard deviations.
    pub z_rms: Option<f64>,
    /// Median share of the attainable reduction of the error on the holdout runs.
    pub error_reduction_share: Option<f64>,
    /// Share of all answers that leave at most a tenth more error than the true model.
    pub within_a_tenth: Option<f64>,
    /// Share of which the true law with estimated numbers does, for laws that no library holds.
    pub attainable_within_a_tenth: Option<f64>,
    /// Share of all answers that leave at most a tenth more than that, or than the true model.
    pub within_a_tenth_of_attainable: Option<f64>,
}

/// False alarms on nulls.
#[derive(Clone, Debug, Serialize)]
pub struct FalseAlarms {
    /// Datasets without any effect.
    pub runs: usize,
    /// Those for which an effect was named.
    pub raised: usize,
    /// Greatest acceptance score of a candidate: quantiles over the nulls, by share.
    pub strength_quantiles: Vec<(f64, f64)>,
}

/// The result.
#[derive(Clone, Debug, Serialize)]
pub struct Matrix {
    /// By kind.
    pub kinds: Vec<KindRow>,
    /// Of the effects that take a sixth of the error on the holdout runs, how many there are and how many are found.
    pub strong: [usize; 2],
    /// 95 % intervals of parameters over all kinds, those of a profile or a list together as one.
    pub intervals: Intervals,
    /// On nulls.
    pub false_alarms: FalseAlarms,
}

/// 95 % intervals.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Intervals {
    /// All.
    pub all: usize,
    /// Those that hold the truth; shares of lists added up.
    pub held: f64,
}

impl Matrix {
    /// Of what came of every scenario.
    pub fn of(grades: &[(Scenario, Vec<Grade>)]) -> Self {
        let nulls = || grades.iter().filter(|(scenario, _)| scenario.is_null());
        let of_nulls = || nulls().flat_map(|(_, grades)| grades);
        let all = || grades.iter().flat_map(|(_, grades)| grades);
        let strong = || all().filter(|grade| grade.share.is_some());
        let shares = [0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 1.0];
        let scores = of_nulls().map(|grade| grade.acceptance_score).collect();
        let strengths = quantiles(scores, shares).map(|values| shares.into_iter().zip(values));
        Matrix {
            intervals: intervals(all()),
            false_alarms: FalseAlarms {
                runs: of_nulls().count(),
                raised: of_nulls().filter(|grade| !grade.is_right).count(),
                strength_quantiles: strengths.into_iter().flatten().collect(),
            },
            kinds: grades.iter().map(|(scenario, own)| row(scenario.name(), own)).collect(),
            strong: [strong().count(), strong().filter(|grade| grade.is_right).count()],
        }
    }
}

fn share_of(all: impl Iterator<Item = bool>) -> Option<f64> {
    let all: Vec<f64> = all.map(|is_so| f64::from(u8::from(is_so))).collect();
    (!all.is_empty()).then(|| mean(&all))
}

fn intervals<'a>(grades: impl Iterator<Item = &'a Grade>) -> Intervals {
    let mut of_all = Intervals::default();
    for grade in grades.filter(|grade| grade.is_right) {
        let mut lists: BTreeMap<&str, Vec<bool>> = BTreeMap::new();
        for parameter in &grade.parameters {
            lists.entry(&parameter.name).or_default().push(parameter.is_held());
        }
        of_all.all += lists.len();
        of_all.held +=
            lists.into_values().filter_map(|list| share_of(list.into_iter())).sum::<f64>();
    }
    of_all
}

fn row(kind: &str, grades: &[Grade]) -> KindRow {
    let mut confused_with = BTreeMap::new();
    for wrong in grades.iter().filter(|grade| !grade.is_right) {
        let named = format!("{} {}", wrong.verdict, wrong.named.join("+"));
        *confused_with.entry(named.trim().to_string()).or_insert(0) += 1;
    }
    let right: Vec<&Grade> = grades.iter().filter(|grade| grade.is_right).collect();
    let parameters: Vec<_> = right.iter().flat_map(|grade| &grade.parameters).collect();
    let deviations: Vec<f64> = parameters.iter().map(|parameter| parameter.z).collect();
    KindRow {
        kind: kind.into(),
        runs: grades.len(),
        right: right.len(),
        confused_with,
        iou: median(right.iter().filter_map(|grade| grade.iou).collect()),
        place_coverage: share_of(right.iter().flat_map(|grade| grade.ends_held.iter().copied())),
        parameter_error: median(parameters.iter().map(|p| p.error.abs()).collect()),
        coverage: share_of(parameters.iter().map(|parameter| parameter.is_held())),
        z_rms: (!deviations.is_empty()).then(|| root_mean_square(&deviations)),
        within_a_tenth: share_of(
            grades.iter().filter_map(|grade| grade.left_ratio).map(|ratio| ratio <= NEAR),
        ),
        attainable_within_a_tenth: share_of(
            grades.iter().filter_map(|grade| grade.attainable_ratio).map(|ratio| ratio <= NEAR),
        ),
        within_a_tenth_of_attainable: share_of(grades.iter().filter_map(|grade| {
            let (left, attainable) = (grade.left_ratio?, grade.attainable_ratio?);
            Some(left <= NEAR * attainable.max(1.0))
        })),
        error_reduction_share: median(right.iter().filter_map(|grade| grade.share).collect()),
    }
}

/// The matrix as a table for people.
pub fn table(matrix: &Matrix) -> String {
    let record = |row: &KindRow| {
        let confused = row.confused_with.iter().map(|(named, count)| format!("{named} {count}"));
        Record::default()
            .with("kind", &row.kind)
            .with("right", format!("{}/{}", row.right, row.runs))
            .number("IoU", row.iou, 3)
            .number("ends", row.place_coverage, 3)
            .number("error", row.parameter_error, 3)
            .number("cover", row.coverage, 3)
            .number("z", row.z_rms, 3)
            .number("share", row.error_reduction_share, 3)
            .number("tenth", row.within_a_tenth, 3)
            .number("of the law", row.attainable_within_a_tenth, 3)
            .number("beside it", row.within_a_tenth_of_attainable, 3)
            .with("named instead", confused.collect::<Vec<_>>().join(", "))
    };
    let mut text = output::table(&matrix.kinds.iter().map(record).collect::<Vec<_>>());
    let [strong, found] = matrix.strong;
    if strong > 0 {
        text +=
            &format!("effects that make a sixth of the holdout error: {found} of {strong} found\n");
    }
    let Intervals { all, held } = matrix.intervals;
    if all > 0 {
        let share = 100.0 * held / all as f64;
        text +=
            &format!("95 % intervals of parameters that hold the truth: {share:.1} % of {all}\n");
    }
    let FalseAlarms { runs, raised, strength_quantiles } = &matrix.false_alarms;
    text += &format!("false alarms: {raised} of {runs}\n");
    for (share, acceptance_score) in strength_quantiles {
        text += &format!(
            "acceptance score on nulls: {:.0} % below {acceptance_score:.2}\n",
            100.0 * share
        );
    }
    text
}
