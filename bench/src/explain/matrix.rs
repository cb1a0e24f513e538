//! All kinds over all seeds.

use std::collections::BTreeMap;

use serde::Serialize;

use super::case::{Case, explained, read};
use super::grade::{Grade, grade};
use super::scenario::Scenario;
use super::world::World;
use crate::parallel::over;

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

/// The middle of some values, the upper one of two.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    values.sort_unstable_by(f64::total_cmp);
    Some(values[values.len() / 2])
}

/// Every scenario with every seed, scenario by scenario.
pub fn cases(scenarios: &[Scenario], seeds: usize, first_seed: u64, world: World) -> Vec<Case> {
    let of = |scenario: Scenario| {
        let seeds = first_seed..first_seed + seeds as u64;
        seeds.map(move |seed| Case { scenario, seed, world })
    };
    scenarios.iter().flat_map(|&scenario| of(scenario)).collect()
}

/// Runs the matrix over [`cases`] of these scenarios, on `threads` threads. Every finished case is
/// reported to `report`.
pub fn run(
    scenarios: &[Scenario],
    cases: &[Case],
    threads: usize,
    report: &(dyn Fn(&Case, &Grade) + Sync),
) -> Matrix {
    let seeds = cases.len() / scenarios.len().max(1);
    let grades = over(cases, threads, |case| {
        let simulated = case.simulate();
        let explanation = explained(&read(&simulated));
        let graded = grade(&simulated, case, &explanation);
        report(case, &graded);
        graded
    });
    let rows = scenarios.iter().zip(grades.chunks(seeds.max(1)));
    let nulls = rows.clone().filter(|(scenario, _)| scenario.is_null());
    let raised = nulls.clone().map(|(_, grades)| grades.iter().filter(|g| !g.is_right).count());
    let strengths = nulls.clone().flat_map(|(_, grades)| grades.iter().map(|g| g.acceptance_score));
    let strengths: Vec<f64> = strengths.collect();
    Matrix {
        intervals: intervals(&grades),
        false_alarms: FalseAlarms {
            runs: nulls.map(|(_, grades)| grades.len()).sum(),
            raised: raised.sum(),
            strength_quantiles: quantiles(strengths),
        },
        kinds: rows.map(|(scenario, grades)| row(scenario.name(), grades)).collect(),
    }
}

fn quantiles(mut values: Vec<f64>) -> Vec<(f64, f64)> {
    values.sort_unstable_by(f64::total_cmp);
    let last = values.len().saturating_sub(1) as f64;
    let at = |share: f64| Some((share, *values.get((share * last).round() as usize)?));
    [0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 1.0].into_iter().filter_map(at).collect()
}

fn root_mean_square(all: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let count = all.len() as f64;
    (count > 0.0).then(|| (all.map(|one| one * one).sum::<f64>() / count).sqrt())
}

/// Share of what is true; `None` of nothing.
fn share_of(all: impl Iterator<Item = bool>) -> Option<f64> {
    let (mut count, mut held) = (0, 0);
    for own in all {
        count += 1;
        held += usize::from(own);
    }
    (count > 0).then(|| f64::from(held as u32) / f64::from(count))
}

fn intervals(grades: &[Grade]) -> Intervals {
    let mut of_all = Intervals::default();
    for grade in grades.iter().filter(|grade| grade.is_right) {
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
    KindRow {
        kind: kind.into(),
        runs: grades.len(),
        right: right.len(),
        confused_with,
        iou: median(right.iter().filter_map(|grade| grade.iou).collect()),
        place_coverage: share_of(right.iter().flat_map(|grade| grade.ends_held.iter().copied())),
        parameter_error: median(parameters.iter().map(|p| p.error.abs()).collect()),
        coverage: share_of(parameters.iter().map(|parameter| parameter.is_held())),
        z_rms: root_mean_square(parameters.iter().map(|parameter| parameter.z)),
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
    let mut text = String::from(
        "kind                  right      IoU   ends  error  cover      z  share  tenth  (law   of it)  named instead\n",
    );
    let shown = |value: Option<f64>| value.map_or("     -".into(), |value| format!("{value:6.3}"));
    for row in &matrix.kinds {
        let confused: Vec<String> =
            row.confused_with.iter().map(|(named, count)| format!("{named} {count}")).collect();
        text += &format!(
            "{:20} {:3}/{:<3} {} {} {} {} {} {} {} {} {}  {}\n",
            row.kind,
            row.right,
            row.runs,
            shown(row.iou),
            shown(row.place_coverage),
            shown(row.parameter_error),
            shown(row.coverage),
            shown(row.z_rms),
            shown(row.error_reduction_share),
            shown(row.within_a_tenth),
            shown(row.attainable_within_a_tenth),
            shown(row.within_a_tenth_of_attainable),
            confused.join(", ")
        );
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
