//! The figures as rows of tables.

use super::score::{Answered, Comparison, Difference, Figure, ReportRow};
use crate::output::Record;

/// Train, condition and cycle of a service, by its name.
fn service(name: &str) -> Record {
    let mut parts = name.splitn(3, ", ");
    let mut next = || parts.next().unwrap_or_default();
    Record::default()
        .with("train", next())
        .with("condition", next())
        .with("cycle_ms", next().trim_end_matches(" ms"))
}

/// A figure under three names: value, lower and upper end of its interval.
fn ranged(record: Record, name: &str, figure: Figure, factor: f64, decimals: usize) -> Record {
    record
        .number(name, factor * figure.value, decimals)
        .number(format!("{name}_low"), factor * figure.low, decimals)
        .number(format!("{name}_high"), factor * figure.high, decimals)
}

/// A service with one kind of parameters.
pub fn drive(line: &ReportRow) -> Record {
    let record = service(&line.scenario)
        .with("parameters", line.driver.to_lowercase())
        .with("stops", line.stops);
    let record = [
        ("stop_error_mean_cm", line.beyond_m, 100.0, 0),
        ("stop_error_std_cm", line.spread_m, 100.0, 0),
        ("within_30_cm_percent", line.within_03_percent, 1.0, 0),
        ("within_50_cm_percent", line.within_05_percent, 1.0, 0),
        ("energy_percent", line.energy_percent, 1.0, 1),
        ("late_s", line.late_s, 1.0, 1),
    ]
    .into_iter()
    .fold(record, |record, (name, figure, factor, decimals)| {
        ranged(record, name, figure, factor, decimals)
    });
    record
        .number("jerk_mps3", line.jerk_mps3.value, 2)
        .number("bounds", line.exceeded.map(|_| line.bounds as f64), 0)
        .number("bounds_exceeded", line.exceeded.map(|count| count as f64), 0)
        .number("bound_percent", line.bound_percent, 0)
        .number("fixed_bound_percent", line.fixed_percent, 0)
}

/// What an answer was worth.
pub fn answer(it: &Answered) -> Record {
    service(&it.scenario)
        .with("quantity", it.quantity)
        .number("usable_percent", it.usable_percent, 1)
        .number("wrong_percent", it.wrong_percent, 2)
        .number("worse_than_declared_percent", it.worse_percent, 1)
        .number("error_percent", it.error_percent[0], 1)
        .number("declared_error_percent", it.error_percent[1], 1)
        .number("first_use_s", it.first_s, 0)
        .number("changes_per_stop", it.changes_per_stop, 1)
}

/// What differs beyond the noise.
pub fn differences(own: &Comparison) -> Vec<Record> {
    let row = |Difference { measure, figure, is_better }: &Difference| {
        let record = service(&own.scenario).with("measure", measure);
        let record = ranged(record, "difference", *figure, 1.0, 3);
        record.with("verdict", if *is_better { "better" } else { "worse" })
    };
    own.differences.iter().map(row).collect()
}
