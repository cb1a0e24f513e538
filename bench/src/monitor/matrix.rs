//! All kinds over all seeds.

use std::collections::BTreeMap;

use dynocar_tests::simulator::{SimulatorSettings, simulate};
use serde::Serialize;

use super::watch::{Watched, watch};
use crate::explain::case::Case;
use crate::explain::matrix::{cases, median};
use crate::explain::scenario::Scenario;
use crate::explain::world::World;
use crate::parallel::over;

/// What is run.
#[derive(Clone, Copy, Debug)]
pub struct Plan<'a> {
    /// The families.
    pub scenarios: &'a [Scenario],
    /// Datasets of each.
    pub seeds: usize,
    /// The first seed.
    pub first_seed: u64,
    /// What is a little wrong besides the effect.
    pub world: World,
    /// Runs of each dataset.
    pub runs: usize,
    /// Datasets at a time.
    pub threads: usize,
}

/// What came out for one kind; times are of motion.
#[derive(Clone, Debug, Serialize)]
pub struct KindRow {
    /// The kind that acts; `none` for nulls.
    pub kind: String,
    /// Simulated datasets in which it acts, or all nulls.
    pub datasets: usize,
    /// Those in which it was named, alone or among alternatives; nulls that stayed silent.
    pub right: usize,
    /// Those in which it was named alone.
    pub alone: usize,
    /// Those in which only others were named.
    pub wrong: usize,
    /// Those in which nothing was named.
    pub missed: usize,
    /// Median time in s from its onset until it was named.
    pub named_after_s: Option<f64>,
    /// Time in s within which nine of ten that were named were.
    pub named_after_90_s: Option<f64>,
    /// Hours driven.
    pub hours: f64,
    /// Hours in which a suspicion stood that did not hold the effect.
    pub wrong_hours: f64,
    /// Hours in which it was named in runs in which it did not act.
    pub stale_hours: f64,
    /// Suspicions without it that were raised.
    pub false_suspicions: usize,
    /// Other kinds that led a suspicion, by how often.
    pub confused_with: BTreeMap<&'static str, usize>,
}

/// The result.
#[derive(Clone, Debug, Serialize)]
pub struct Matrix {
    /// By kind.
    pub kinds: Vec<KindRow>,
    /// Hours driven with nothing undeclared.
    pub null_hours: f64,
    /// Suspicions raised in them.
    pub null_suspicions: usize,
    /// Suspicions in 100 hours.
    pub per_100_h: f64,
}

/// Runs the matrix. Every finished case is reported to `report`.
pub fn run(plan: &Plan<'_>, report: &(dyn Fn(&Case, &Watched) + Sync)) -> Matrix {
    let cases = cases(plan.scenarios, plan.seeds, plan.first_seed, plan.world);
    let watched = over(&cases, plan.threads, |case| {
        let watched = watch(&simulate(&SimulatorSettings { runs: plan.runs, ..case.settings() }));
        report(case, &watched);
        watched
    });
    let rows = plan.scenarios.iter().zip(watched.chunks(plan.seeds.max(1)));
    let kinds: Vec<KindRow> = rows.map(|(scenario, watched)| row(*scenario, watched)).collect();
    let nulls = || {
        let all = kinds.iter().zip(plan.scenarios);
        all.filter(|(_, scenario)| scenario.is_null()).map(|(row, _)| row)
    };
    let null_hours: f64 = nulls().map(|row| row.hours).sum();
    let null_suspicions: usize = nulls().map(|row| row.false_suspicions).sum();
    Matrix {
        null_hours,
        null_suspicions,
        per_100_h: 100.0 * null_suspicions as f64 / null_hours.max(f64::MIN_POSITIVE),
        kinds,
    }
}

fn row(scenario: Scenario, all: &[Watched]) -> KindRow {
    let is_null = scenario.is_null();
    let watched: Vec<&Watched> = all.iter().filter(|it| is_null || it.has_acted).collect();
    let count = |is_so: &dyn Fn(&Watched) -> bool| watched.iter().filter(|it| is_so(it)).count();
    let hours =
        |of: &dyn Fn(&Watched) -> f64| watched.iter().map(|it| of(it)).sum::<f64>() / 3600.0;
    let mut after_s: Vec<f64> = watched.iter().filter_map(|it| it.named_after_s).collect();
    after_s.sort_unstable_by(f64::total_cmp);
    let mut confused_with = BTreeMap::new();
    let mut false_suspicions = 0;
    for it in &watched {
        for (kind, _) in it.raised.iter().filter(|(kind, _)| !it.truth.contains(kind)) {
            *confused_with.entry(kind.name()).or_insert(0) += 1;
            false_suspicions += 1;
        }
    }
    let is_silent = |it: &Watched| it.raised.is_empty();
    let is_right = |it: &Watched| if is_null { is_silent(it) } else { it.named_after_s.is_some() };
    KindRow {
        kind: scenario.name().into(),
        datasets: watched.len(),
        right: count(&is_right),
        alone: count(&|it| it.led_after_s.is_some()),
        wrong: count(&|it| !is_right(it) && !is_silent(it)),
        missed: count(&|it| !is_right(it) && is_silent(it)),
        named_after_90_s: after_s.get((after_s.len() * 9).div_ceil(10).max(1) - 1).copied(),
        named_after_s: median(after_s),
        hours: hours(&|it| it.driven_s),
        wrong_hours: hours(&|it| it.wrong_s),
        stale_hours: hours(&|it| it.stale_s),
        false_suspicions,
        confused_with,
    }
}

/// The matrix as a table for people.
pub fn table(matrix: &Matrix) -> String {
    let mut text = String::from(
        "kind                  right  alone  wrong  missed  after s  90 % s   hours  wrong h  stale h  others that led\n",
    );
    let shown = |value: Option<f64>| value.map_or("      -".into(), |value| format!("{value:7.0}"));
    for row in &matrix.kinds {
        let confused: Vec<String> =
            row.confused_with.iter().map(|(kind, count)| format!("{kind} {count}")).collect();
        text += &format!(
            "{:20} {:3}/{:<3} {:5} {:6} {:7}  {} {} {:7.1} {:8.2} {:8.2}  {}\n",
            row.kind,
            row.right,
            row.datasets,
            row.alone,
            row.wrong,
            row.missed,
            shown(row.named_after_s),
            shown(row.named_after_90_s),
            row.hours,
            row.wrong_hours,
            row.stale_hours,
            confused.join(", ")
        );
    }
    text += &format!(
        "nothing undeclared: {} suspicions in {:.0} h of motion, {:.2} in 100 h\n",
        matrix.null_suspicions, matrix.null_hours, matrix.per_100_h
    );
    text
}
