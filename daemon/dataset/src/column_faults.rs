//! Faults of single columns: fill values, and radii that no track has.

use dynocar_core::plausibility::Severity::Warning;
use toml::Value;

use super::diagnostic::Diagnostic;
use super::fill_values::FillValue;
use super::quantity::Quantity;
use super::resolved::Resolved;

/// Radius in m of the narrowest curve, of trams and mines.
const RADIUS_MIN_M: f64 = 10.0;

/// Returns the faults of a run's columns.
pub(super) fn column_faults(run: &Resolved) -> Vec<Diagnostic> {
    run.fill_values.iter().map(of_fill_value).chain(of_radius(run)).collect()
}

/// Returns that curves are narrower than any track, as where km are read as m.
fn of_radius(run: &Resolved) -> Option<Diagnostic> {
    let radii_m = run.table.column(Quantity::CurveRadius)?.iter().map(|radius_m| radius_m.abs());
    let narrow = radii_m.filter(|radius_m| *radius_m > 0.0 && *radius_m < RADIUS_MIN_M);
    let (count, least_m) = narrow
        .fold((0, f64::INFINITY), |(count, least_m), radius_m| (count + 1, radius_m.min(least_m)));
    let text = format!(
        "curve_radius lies below {RADIUS_MIN_M} m in {count} rows, down to {} m, where no track is: is the unit km?",
        shown(least_m)
    );
    let figures = [
        ("quantity", Quantity::CurveRadius.name().into()),
        ("count", Value::Integer(count)),
        ("least_m", least_m.into()),
    ];
    (count > 0).then(|| Diagnostic::new("narrow_curve", Warning, text, figures))
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
