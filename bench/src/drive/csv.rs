//! The figures for files of CSV.

use super::score::{Difference, Figure, Scored};
use crate::output::{CsvRow, cell};

/// Train, condition and cycle of a service, by its name.
fn service(name: &str) -> CsvRow {
    let mut parts = name.splitn(3, ", ").map(str::to_owned);
    let mut next = || parts.next().unwrap_or_default();
    let (train, condition, cycle) = (next(), next(), next());
    let cycle_ms = cycle.trim_end_matches(" ms").to_owned();
    vec![("train", train), ("condition", condition), ("cycle_ms", cycle_ms)]
}

/// A figure under three names: value, lower and upper end of its interval.
fn ranged(names: [&'static str; 3], figure: Figure, factor: f64, decimals: usize) -> CsvRow {
    let Figure { value, low, high } = figure;
    let cells = [value, low, high].map(|it| cell(Some(factor * it), decimals));
    names.into_iter().zip(cells).collect()
}

macro_rules! names {
    ($name:literal) => {
        [$name, concat!($name, "_low"), concat!($name, "_high")]
    };
}

/// Each service with each kind of parameters.
pub fn drives(scored: &[Scored]) -> Vec<CsvRow> {
    let lines = scored.iter().flat_map(|it| &it.lines);
    let row = |line: &super::score::ReportRow| {
        let mut row = service(&line.scenario);
        row.push(("parameters", line.driver.to_lowercase()));
        row.push(("stops", line.stops.to_string()));
        row.extend(ranged(names!("stop_error_mean_cm"), line.beyond_m, 100.0, 0));
        row.extend(ranged(names!("stop_error_std_cm"), line.spread_m, 100.0, 0));
        row.extend(ranged(names!("within_30_cm_percent"), line.within_03_percent, 1.0, 0));
        row.extend(ranged(names!("within_50_cm_percent"), line.within_05_percent, 1.0, 0));
        row.extend(ranged(names!("energy_percent"), line.energy_percent, 1.0, 1));
        row.extend(ranged(names!("late_s"), line.late_s, 1.0, 1));
        row.push(("jerk_mps3", cell(Some(line.jerk_mps3.value), 2)));
        let is_bounded = line.exceeded.is_some();
        let bounds = if is_bounded { line.bounds.to_string() } else { String::new() };
        row.push(("bounds", bounds));
        row.push(("bounds_exceeded", line.exceeded.map_or(String::new(), |it| it.to_string())));
        row.push(("bound_percent", cell(line.bound_percent, 0)));
        row.push(("fixed_bound_percent", cell(Some(line.fixed_percent), 0)));
        row
    };
    lines.map(row).collect()
}

/// What each answer was worth.
pub fn answers(scored: &[Scored]) -> Vec<CsvRow> {
    let row = |it: &super::score::Answered| {
        let mut row = service(&it.scenario);
        row.extend([
            ("quantity", it.quantity.to_owned()),
            ("usable_percent", cell(Some(it.usable_percent), 1)),
            ("wrong_percent", cell(Some(it.wrong_percent), 2)),
            ("worse_than_declared_percent", cell(Some(it.worse_percent), 1)),
            ("error_percent", cell(it.error_percent[0], 1)),
            ("declared_error_percent", cell(it.error_percent[1], 1)),
            ("first_use_s", cell(it.first_s, 0)),
            ("changes_per_stop", cell(Some(it.changes_per_stop), 1)),
        ]);
        row
    };
    scored.iter().flat_map(|it| &it.answers).map(row).collect()
}

/// What differs beyond the noise.
pub fn differences(scored: &[Scored]) -> Vec<CsvRow> {
    let rows = scored.iter().map(|it| &it.comparison).flat_map(|own| {
        own.differences.iter().map(|Difference { measure, figure, is_better }| {
            let mut row = service(&own.scenario);
            row.push(("measure", (*measure).to_owned()));
            row.extend(ranged(names!("difference"), *figure, 1.0, 3));
            row.push(("verdict", if *is_better { "better" } else { "worse" }.to_owned()));
            row
        })
    });
    rows.collect()
}
