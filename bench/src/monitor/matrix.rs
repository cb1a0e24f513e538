//! All kinds over all seeds.

use std::collections::BTreeMap;

use serde::Serialize;

use super::watch::Watched;
use crate::explain::scenario::Scenario;
use crate::output::{self, Record};
use crate::statistics::median;

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

impl Matrix {
    /// Of what came of every scenario.
    pub fn of(watched: &[(Scenario, Vec<Watched>)]) -> Self {
        let kinds: Vec<KindRow> =
            watched.iter().map(|(scenario, own)| row(*scenario, own)).collect();
        let nulls = || kinds.iter().zip(watched).filter(|(_, (scenario, _))| scenario.is_null());
        let null_hours: f64 = nulls().map(|(row, _)| row.hours).sum();
        let null_suspicions: usize = nulls().map(|(row, _)| row.false_suspicions).sum();
        let per_100_h = 100.0 * null_suspicions as f64 / null_hours.max(f64::MIN_POSITIVE);
        Matrix { null_hours, null_suspicions, per_100_h, kinds }
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
    let record = |row: &KindRow| {
        let confused = row.confused_with.iter().map(|(kind, count)| format!("{kind} {count}"));
        Record::default()
            .with("kind", &row.kind)
            .with("right", format!("{}/{}", row.right, row.datasets))
            .with("alone", row.alone)
            .with("wrong", row.wrong)
            .with("missed", row.missed)
            .number("after s", row.named_after_s, 0)
            .number("90 % s", row.named_after_90_s, 0)
            .number("hours", row.hours, 1)
            .number("wrong h", row.wrong_hours, 2)
            .number("stale h", row.stale_hours, 2)
            .with("others that led", confused.collect::<Vec<_>>().join(", "))
    };
    let rows: Vec<Record> = matrix.kinds.iter().map(record).collect();
    let Matrix { null_hours, null_suspicions, per_100_h, .. } = matrix;
    output::table(&rows)
        + &format!(
            "nothing undeclared: {null_suspicions} suspicions in {null_hours:.0} h of motion, \
             {per_100_h:.2} in 100 h\n"
        )
}
