//! `dynocar explain` over seeded simulations of every kind of effect and of nulls: all kinds over all seeds in numbers,
//! or the time for 1, 4 and 16 times the data.
//!
//! - [`scenario`]: the simulated effects, the usual errors, and their datasets
//! - [`grade`]: the answer against the truth, and against the true law with estimated numbers
//! - [`parameters`]: numbers and places of an answer against the true ones

pub mod grade;
pub mod parameters;
pub mod scenario;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use dynocar::output::report_line;
use dynocar_analysis::explain::over_time::CHANCE_MAX;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::{SimulatorSettings, simulate};
use serde_json::{Value, json};

use self::grade::{Attained, Grade, grade};
use self::parameters::ParameterGrade;
use self::scenario::{
    ExplainScenario, ExplainWorld, FamilyArguments, SimulatedCase, explained, read,
};
use crate::ending::until_due;
use crate::output::{BenchError, Record, counts, during, table};
use crate::statistics::{median, quantiles, root_mean_square, share};

/// Every kind of undeclared effect, and nulls, over simulated datasets: power, false alarms,
/// confusions, localisation, parameters and their coverage.
#[derive(Debug, Args)]
pub struct ExplainBenchArguments {
    #[command(flatten)]
    family: FamilyArguments,
    /// Instead of the matrix, the time for 1, 4 and 16 times the data: one dataset of each kind
    /// (none, tunnel_drag, dragging_brake and wind unless chosen) with more runs, then longer ones
    #[arg(long, conflicts_with_all = ["seeds", "threads", "write", "verbose", "world"])]
    growth: bool,
    /// Write the simulated datasets with their truth into this folder
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
}

impl ExplainBenchArguments {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// When there is no such kind, or a file cannot be written.
    pub fn run(&self) -> Result<(), BenchError> {
        let family = &self.family;
        if self.growth {
            use EffectKind::{DraggingBrake, None, TunnelDrag, Wind};
            let few = [None, TunnelDrag, DraggingBrake, Wind].map(ExplainScenario::Kind).to_vec();
            let sizes = growth(&family.scenarios(few)?, family.first_seed);
            return family.output.give(&sizes, || table(&sizes));
        }
        let scenarios = family.scenarios(ExplainScenario::all())?;
        if let Some(folder) = &self.write {
            for case in family.cases(&scenarios) {
                case.write(folder).map_err(during(folder.display()))?;
            }
        }
        let grades = family.over(&scenarios, |case| {
            let simulated = case.simulate();
            let graded = grade(&simulated, case, &explained(&read(&simulated)));
            if family.verbose {
                print_case(case, &graded);
            }
            graded
        });
        let (all, words) = summary(&grades);
        family.output.give(&all, || words)
    }
}

/// One dataset's outcome on standard error.
fn print_case(case: &SimulatedCase, grade: &Grade) {
    let kinds: Vec<_> = case.scenario.kinds(case.seed).iter().map(|kind| kind.name()).collect();
    let off = |parameters: &[ParameterGrade]| {
        let each = parameters.iter();
        let each = each.map(|p| format!("{} {:+.3} ({:+.1} sd)", p.name, p.error, p.z));
        each.collect::<Vec<_>>().join(", ")
    };
    report_line(&format!(
        "{} seed {}: {} {} {} iou {:?} ends {}/{} share {:?} {}",
        if grade.is_right { "right" } else { "WRONG" },
        case.seed,
        kinds.join("+"),
        grade.verdict,
        grade.named.join("+"),
        grade.iou,
        grade.ends_held.iter().filter(|held| **held).count(),
        grade.ends_held.len(),
        grade.attained.and_then(|it| it.share),
        off(&grade.parameters)
    ));
    if !grade.held_out.is_empty() {
        report_line(&format!("    by the runs held out {}", off(&grade.held_out)));
    }
    report_line(&format!("    {}", off(&grade.davis)));
    report_line(&format!("    acceptance score {:.2}", grade.acceptance_score));
    for detail in &grade.details {
        report_line(&format!("    {detail}"));
    }
}

/// Ratio up to which one error counts as equal to another.
const NEAR: f64 = 1.1;
/// Shares of nulls whose greatest acceptance score of a candidate is reported.
const SHARES: [f64; 7] = [0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 1.0];

/// Returns the results of every scenario, for machines and for people.
fn summary(grades: &[(ExplainScenario, Vec<Grade>)]) -> (Value, String) {
    let kinds: Vec<Record> = grades.iter().map(|(kind, own)| record(kind.name(), own)).collect();
    let all = || grades.iter().flat_map(|(_, grades)| grades);
    let nulls = || grades.iter().filter(|(kind, _)| kind.is_null()).flat_map(|(_, own)| own);
    let strong = || all().filter(|grade| grade.attained.is_some_and(|it| it.share.is_some()));
    let (many, found) = (strong().count(), strong().filter(|grade| grade.is_right).count());
    let (intervals, held) = intervals(all());
    let (runs, raised) = (nulls().count(), nulls().filter(|grade| !grade.is_right).count());
    let scores = quantiles(nulls().map(|grade| grade.acceptance_score).collect(), SHARES);
    let scores: Vec<(f64, f64)> =
        scores.into_iter().flat_map(|scores| SHARES.into_iter().zip(scores)).collect();
    let mut text = table(&kinds);
    if many > 0 {
        text +=
            &format!("effects that make a sixth of the holdout error: {found} of {many} found\n");
    }
    if intervals > 0 {
        let percent = 100.0 * held / intervals as f64;
        text += &format!(
            "95 % intervals of parameters that hold the truth: {percent:.1} % of {intervals}\n"
        );
        let every: Vec<bool> = all()
            .filter(|grade| grade.is_right)
            .flat_map(|grade| grade.parameters.iter().map(ParameterGrade::is_held))
            .collect();
        text += &format!(
            "the same, every value of a profile or list by itself: {:.1} % of {}\n",
            100.0 * share(every.iter().copied()),
            every.len()
        );
    }
    let right = || all().filter(|grade| grade.is_right);
    let davis: Vec<bool> =
        right().flat_map(|grade| grade.davis.iter().map(ParameterGrade::is_held)).collect();
    if !davis.is_empty() {
        let percent = 100.0 * share(davis.iter().copied());
        let count = davis.len();
        text +=
            &format!("95 % intervals of a, b, c that hold the truth: {percent:.1} % of {count}\n");
    }
    let held_out: Vec<bool> =
        right().flat_map(|grade| grade.held_out.iter().map(ParameterGrade::is_held)).collect();
    let chances: Vec<f64> =
        right().flat_map(|grade| grade.held_out_chances.iter().copied()).collect();
    if !held_out.is_empty() {
        let percent = 100.0 * share(held_out.iter().copied());
        let different = chances.iter().filter(|chance| **chance < CHANCE_MAX).count();
        text += &format!(
            "95 % intervals of the runs held out that hold the truth: {percent:.1} % of {}\n\
             effects said to differ in the runs held out: {different} of {}\n",
            held_out.len(),
            chances.len()
        );
    }
    text += &format!("false alarms: {raised} of {runs}\n");
    for (share, score) in &scores {
        text += &format!("acceptance score on nulls: {:.0} % below {score:.2}\n", 100.0 * share);
    }
    let alarms = json!({ "runs": runs, "raised": raised, "strength_quantiles": scores });
    let intervals = json!({ "all": intervals, "held": held });
    let strong = json!([many, found]);
    let all = json!({
        "kinds": kinds, "strong": strong, "intervals": intervals, "false_alarms": alarms,
    });
    (all, text)
}

fn share_of(all: impl Iterator<Item = bool>) -> Option<f64> {
    let mut all = all.peekable();
    all.peek().is_some().then(|| share(all))
}

/// 95 % intervals of parameters, those of a profile or a list together as one, and how many of them hold the truth,
/// shares of lists added up.
fn intervals<'a>(grades: impl Iterator<Item = &'a Grade>) -> (usize, f64) {
    let (mut all, mut held) = (0, 0.0);
    for grade in grades.filter(|grade| grade.is_right) {
        let mut lists: BTreeMap<&str, Vec<bool>> = BTreeMap::new();
        for parameter in &grade.parameters {
            lists.entry(&parameter.name).or_default().push(parameter.is_held());
        }
        all += lists.len();
        held += lists.into_values().filter_map(|list| share_of(list.into_iter())).sum::<f64>();
    }
    (all, held)
}

/// Returns the record of one kind; medians are of right answers, and shares of a tenth of all.
fn record(kind: &str, grades: &[Grade]) -> Record {
    let mut instead = BTreeMap::new();
    for wrong in grades.iter().filter(|grade| !grade.is_right) {
        let named = format!("{} {}", wrong.verdict, wrong.named.join("+"));
        *instead.entry(named.trim().to_string()).or_insert(0) += 1;
    }
    let right: Vec<&Grade> = grades.iter().filter(|grade| grade.is_right).collect();
    let parameters: Vec<_> = right.iter().flat_map(|grade| &grade.parameters).collect();
    let deviations: Vec<f64> = parameters.iter().map(|parameter| parameter.z).collect();
    let z = (!deviations.is_empty()).then(|| root_mean_square(&deviations));
    let near = |of: fn(&Grade) -> Option<f64>| {
        share_of(grades.iter().filter_map(of).map(|ratio| ratio <= NEAR))
    };
    let beside = grades.iter().filter_map(|grade| {
        let Attained { left_ratio, attainable_ratio, .. } = grade.attained?;
        Some(left_ratio <= NEAR * attainable_ratio?.max(1.0))
    });
    let of_right = |of: fn(&Grade) -> Option<f64>| {
        median(right.iter().filter_map(|grade| of(grade)).collect())
    };
    Record::default()
        .with("kind", kind)
        .with("right", format!("{}/{}", right.len(), grades.len()))
        .number("IoU", of_right(|it| it.iou), 3)
        .number("ends", share_of(right.iter().flat_map(|it| it.ends_held.iter().copied())), 3)
        .number("error", median(parameters.iter().map(|it| it.error.abs()).collect()), 3)
        .number("cover", share_of(parameters.iter().map(|it| it.is_held())), 3)
        .number("z", z, 3)
        .number("share", of_right(|it| it.attained?.share), 3)
        .number("tenth", near(|it| Some(it.attained?.left_ratio)), 3)
        .number("of the law", near(|it| it.attained?.attainable_ratio), 3)
        .number("beside it", share_of(beside), 3)
        .with("named instead", counts(&instead))
}

/// Factors by which the data are multiplied.
const FACTORS: [usize; 3] = [1, 4, 16];

/// Explains one dataset of each scenario at every size, one after the other on one thread.
fn growth(scenarios: &[ExplainScenario], seed: u64) -> Vec<Record> {
    let mut sizes = Vec::new();
    for axis in ["runs", "duration"] {
        let mut first_us = None;
        for factor in until_due(FACTORS) {
            let grown = |settings: SimulatorSettings| match axis {
                "runs" => SimulatorSettings {
                    runs: factor * settings.runs,
                    holdout_runs: factor * settings.holdout_runs,
                    ..settings
                },
                _ => SimulatorSettings {
                    duration_s: factor as f64 * settings.duration_s,
                    ..settings
                },
            };
            let (mut runs, mut duration_s, mut samples, mut seconds) = (0, 0.0, 0, 0.0);
            for scenario in scenarios {
                let settings = grown(scenario.settings(seed, ExplainWorld::Plain));
                (runs, duration_s) = (settings.runs, settings.duration_s);
                let dataset = read(&simulate(&settings));
                samples += dataset.runs.iter().map(|run| run.samples.len()).sum::<usize>();
                let since = Instant::now();
                explained(&dataset);
                seconds += since.elapsed().as_secs_f64();
            }
            report_line(&format!("{axis} x{factor}: {seconds:.1} s"));
            let sample_us = 1e6 * seconds / samples as f64;
            let first_us = *first_us.get_or_insert(sample_us);
            let size = Record::default()
                .with("grows", axis)
                .with("times", factor)
                .with("runs", runs)
                .number("each s", duration_s, 0)
                .with("samples", samples)
                .number("time s", seconds, 2)
                .number("us/sample", sample_us, 1)
                .number("to first", sample_us / first_us, 2);
            sizes.push(size);
        }
    }
    sizes
}
