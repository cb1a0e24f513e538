//! The error of a train's models by day, as the daemon's trials measured it.

use std::collections::BTreeSet;

use crate::report::html::legend;
use crate::report::plots::days::{self, Day};
use crate::report::plots::{PlotError, figure, wide_and_narrow};
use dynocar::models::decision::in_force_after;
use dynocar::models::history::History;
use dynocar::models::{Action, ModelHash, Moment};
use dynocar::shadow::record::Trials;

const DAY_S: u64 = 86_400;

/// The plot, as HTML; empty where nothing was measured.
///
/// # Errors
///
/// When it cannot be drawn.
pub fn html(history: &History, trials: &Trials) -> Result<String, PlotError> {
    let measured = trials.models.iter().flat_map(|tried| tried.ledger.days.keys().copied());
    let numbers: BTreeSet<i64> = measured.collect();
    let Some(&first) = numbers.first() else { return Ok(String::new()) };
    let declared = history.models.iter().find(|(stored, _)| stored.origin.parent.is_none());
    let declared = declared.map(|(stored, _)| stored.hash);
    let error_mps = |model: Option<ModelHash>, number: i64| {
        trials.of(model?)?.ledger.days.get(&number)?.rmse_mps()
    };
    let days: Vec<Day> = numbers
        .iter()
        .map(|&number| Day {
            day: (number - first) as f64,
            declared_mps: error_mps(declared, number),
            in_force_mps: error_mps(in_force_on(history, number).or(declared), number),
        })
        .collect();
    let is_change = |action: Action| action != Action::Rejected;
    let last = numbers.last().map_or(first, |last| last + 1);
    let changes: Vec<f64> = history
        .decisions
        .iter()
        .filter(|(_, it)| is_change(it.action))
        .map(|(_, it)| it.at.unix_s as f64 / DAY_S as f64 - first as f64)
        .filter(|at| (-1.0..=(last - first) as f64).contains(at))
        .collect();
    let name = Moment { unix_s: first as u64 * DAY_S }.day();
    let plots = wide_and_narrow(|width| days::draw(&days, &changes, &name, width))?;
    let key = legend(&[("dot after", "in force"), ("ring before", "declared")]);
    let caption = "Open-loop error on the trips that were driven, by day; an upright line where \
                   another model came in force";
    Ok(figure("trace", caption, &key, &plots))
}

/// The model that the decisions had put in force at the end of a day; `None` for what was declared.
fn in_force_on(history: &History, number: i64) -> Option<ModelHash> {
    let end_s = (number + 1) as u64 * DAY_S;
    let before = history.decisions.iter().map(|(_, it)| it).filter(|it| it.at.unix_s < end_s);
    in_force_after(before).pop()
}
