//! Scenarios times pipelines, in numbers.

use std::sync::Arc;

use dynocar_core::pipeline::Pipeline;
use dynocar_core::pipeline::settings::SettingError;
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::{PipelineKind, Quantity, TrainId};
use serde::Serialize;

use super::bound::Bound;
use super::drive::Drive;
use super::rows::NamedScenario;
use super::score::{Score, answer, least_deviation};
use super::world::{LoadSource, Scenario, World};
use crate::output::Record;
use crate::parallel;
use crate::statistics::median;

/// Speed in m/s from which an answer counts.
const COUNTS_MPS: f64 = 2.0;
/// Time in s from which errors are compared with the bound, and how much later each next time.
const COMPARED_FIRST_S: f64 = 60.0;
const COMPARED_GROWTH: f64 = 1.35;
/// What is asked for.
const QUANTITIES: [Quantity; 2] = [Quantity::Resistance, Quantity::Mass];

/// What is measured.
pub struct Plan<'a> {
    /// The rows.
    pub scenarios: &'a [NamedScenario],
    /// The pipelines in each.
    pub kinds: &'a [PipelineKind],
    /// Drives for each.
    pub seeds: u64,
    /// The first seed.
    pub first_seed: u64,
    /// Hours of each drive.
    pub hours: f64,
    /// Rows at a time.
    pub threads: usize,
}

/// One quantity of one pipeline in one scenario, over all drives.
#[derive(Clone, Debug, Serialize)]
pub struct ReportRow {
    /// The scenario.
    pub scenario: String,
    /// The pipeline.
    pub pipeline: &'static str,
    /// The quantity.
    pub quantity: &'static str,
    /// Share of the moving time in which it may be used, in %.
    pub usable_percent: f64,
    /// Share of those cycles with the truth within the 95 % interval, in %.
    pub covered_percent: f64,
    /// Median time in s until the first use.
    pub first_s: Option<f64>,
    /// Changes of usable in an hour.
    pub changes_per_h: f64,
    /// Longest time in s with a usable answer more than 4 deviations off.
    pub wrong_s: f64,
    /// Root of the mean square of the usable answers' errors, in % of the truth.
    pub error_percent: f64,
    /// The same over the root of the mean square of their standard deviations.
    pub error_over_deviation: f64,
    /// Errors at some instants of the drive over the joint Cramér–Rao bound there.
    pub error_over_bound: Option<f64>,
}

/// Measures everything.
///
/// # Errors
///
/// When a kind cannot be built.
pub fn run(plan: &Plan<'_>) -> Result<Vec<ReportRow>, SettingError> {
    let cases: Vec<(&NamedScenario, PipelineKind)> = plan
        .scenarios
        .iter()
        .flat_map(|row| plan.kinds.iter().map(move |&kind| (row, kind)))
        .collect();
    let lines = parallel::over(&cases, plan.threads, |(row, kind)| measure(plan, row, *kind));
    Ok(lines.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
}

/// The settings that a user of the scenario has: load and map are known exactly where they are.
fn settings(kind: PipelineKind, scenario: &Scenario) -> Option<EstimatorSettings> {
    let mut settings = EstimatorSettings::default_of(kind)?;
    if let EstimatorSettings::TrainKalman(own) = &mut settings {
        if scenario.load == LoadSource::Exact {
            own.mass_std_percent = 0.0;
        }
        own.gradient_std_permille = scenario.map_std_permille;
    }
    Some(settings)
}

fn measure(
    plan: &Plan<'_>,
    row: &NamedScenario,
    kind: PipelineKind,
) -> Result<Vec<ReportRow>, SettingError> {
    let Some(settings) = settings(kind, &row.scenario) else { return Ok(Vec::new()) };
    let mut totals = QUANTITIES.map(|_| (Score::default(), Vec::new()));
    for seed in plan.first_seed..plan.first_seed + plan.seeds {
        let world = World::draw(row.scenario, seed);
        let train = Arc::new(world.declared.clone());
        let estimator = settings.build(&train)?;
        let pipeline = Pipeline::new(TrainId(1), 0, train, None, estimator);
        for ((total, firsts), score) in totals.iter_mut().zip(driven(pipeline, world, plan.hours)) {
            total.join(&score);
            firsts.push(score.first_s.unwrap_or(f64::INFINITY));
        }
    }
    let answered = |quantity: &Quantity| settings.answers(*quantity);
    let lines = QUANTITIES.iter().zip(totals).filter(|(quantity, _)| answered(quantity));
    Ok(lines.map(|(quantity, total)| line(plan, row, kind, *quantity, total)).collect())
}

/// One drive.
fn driven(mut pipeline: Pipeline, world: World, hours: f64) -> [Score; 2] {
    let cycle_s = 1.0 / f64::from(world.scenario.rate_hz);
    let mut bound = (world.scenario.speed_noise_mps > 0.0).then(|| Bound::new(&world, hours));
    let mut next_s = COMPARED_FIRST_S;
    let mut drive = Drive::new(world);
    let mut scores = QUANTITIES.map(|_| Score::default());
    for cycle in 0..(3600.0 * hours / cycle_s) as u64 {
        let (time_s, moment) = (cycle as f64 * cycle_s, drive.advance());
        if let Some(bound) = &mut bound {
            bound.see(drive.world(), &drive.truth(), cycle_s);
        }
        let snapshot = pipeline.process(&moment.sample);
        if moment.speed_mps < COUNTS_MPS {
            continue;
        }
        let answers = QUANTITIES.map(|quantity| answer(snapshot, quantity, &moment));
        for (score, answer) in scores.iter_mut().zip(answers) {
            score.push(time_s, cycle_s, answer);
        }
        if time_s >= next_s {
            next_s = COMPARED_GROWTH * time_s;
            let Some(least) = bound.as_ref().and_then(Bound::covariance) else { continue };
            for ((score, answer), quantity) in scores.iter_mut().zip(answers).zip(QUANTITIES) {
                if let Some(answer) = answer {
                    score.compare(answer.error, least_deviation(&least, quantity, &moment));
                }
            }
        }
    }
    scores
}

fn line(
    plan: &Plan<'_>,
    row: &NamedScenario,
    kind: PipelineKind,
    quantity: Quantity,
    (total, firsts): (Score, Vec<f64>),
) -> ReportRow {
    let usable = total.usable.max(1) as f64;
    ReportRow {
        scenario: row.name.clone(),
        pipeline: kind.name(),
        quantity: quantity.name(),
        usable_percent: 100.0 * total.usable as f64 / total.cycles.max(1) as f64,
        covered_percent: 100.0 * total.covered as f64 / usable,
        first_s: median(firsts).filter(|it| it.is_finite()),
        changes_per_h: total.changes as f64 / (plan.hours * plan.seeds as f64),
        wrong_s: total.wrong_s,
        error_percent: 100.0 * (total.error_square / usable).sqrt(),
        error_over_deviation: (total.error_square / total.deviation_square.max(f64::MIN_POSITIVE))
            .sqrt(),
        error_over_bound: total.over_bound(),
    }
}

/// A line for people and for a file of CSV.
pub fn record(plan: &Plan<'_>, line: &ReportRow) -> Record {
    let (traffic, condition) = line.scenario.split_once(", ").unwrap_or((&line.scenario, ""));
    let used = |value: f64| Some(value).filter(|_| line.usable_percent > 0.0);
    Record::default()
        .with("traffic", traffic)
        .with("condition", condition)
        .with("pipeline", line.pipeline)
        .with("quantity", line.quantity)
        .with("seeds", plan.seeds)
        .with("first_seed", plan.first_seed)
        .number("usable_percent", line.usable_percent, 1)
        .number("coverage_percent", used(line.covered_percent), 1)
        .number("first_use_s", line.first_s, 0)
        .number("changes_per_h", line.changes_per_h, 1)
        .number("longest_wrong_s", line.wrong_s, 1)
        .number("error_percent", used(line.error_percent), 2)
        .number("error_over_std", used(line.error_over_deviation), 2)
        .number("error_over_bound", line.error_over_bound, 2)
}
