//! Faults of single columns: fill values.

use dynocar_core::plausibility::Severity::Warning;
use toml::Value;

use super::diagnostic::Diagnostic;
use super::fill_values::FillValue;
use super::resolved::Resolved;

/// Returns the faults of a run's columns.
pub(super) fn column_faults(run: &Resolved) -> Vec<Diagnostic> {
    run.fill_values.iter().map(of_fill_value).collect()
}

fn of_fill_value(fill: &FillValue) -> Diagnostic {
    let FillValue { quantity, column, value, count, others: (low, high) } = fill;
    let [value_shown, low, high] = [*value, *low, *high].map(shown);
    let text = format!(
        "column '{column}' holds {value_shown} in {count} rows, apart from its other values, {low} to {high}: taken for \
         missing values of {quantity}; leave such cells empty in the file"
    );
    let figures = [
        ("quantity", quantity.name().into()),
        ("value", (*value).into()),
        ("count", Value::Integer(*count as i64)),
    ];
    Diagnostic::new("fill_value", Warning, text, figures)
}

/// Returns a cell's number with up to three places.
fn shown(cell: f64) -> String {
    let text = format!("{cell:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}
