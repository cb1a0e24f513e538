//! Columns with values that no train has, which validation refuses sample by sample.

use dynocar_core::plausibility::Severity::Warning;
use dynocar_shared::SampleField;
use toml::Value;

use super::diagnostic::Diagnostic;
use super::quantity::Quantity;
use super::resolved::Resolved;

/// The bounds of the sample, beyond which validation refuses it, and of places on the earth.
const PLAUSIBLE: [(Quantity, (f64, f64)); 7] = [
    (Quantity::Acceleration, SampleField::Acceleration.range()),
    (Quantity::SpecificForce, SampleField::SpecificForce.range()),
    (Quantity::BrakeCylinderPressure, SampleField::BrakeCylinderPressure.range()),
    (Quantity::AmbientTemperature, SampleField::AmbientTemperature.range()),
    (Quantity::Gradient, SampleField::Gradient.range()),
    (Quantity::Latitude, (-90.0, 90.0)),
    (Quantity::Longitude, (-180.0, 180.0)),
];

/// Returns a diagnostic for each column with values that are refused.
pub(super) fn implausible_columns(run: &Resolved) -> Vec<Diagnostic> {
    let mut diagnostics = Vec::new();
    for (quantity, (low, high)) in PLAUSIBLE {
        let Some(column) = run.table.column(quantity) else { continue };
        let is_outside = |value: &&f64| !value.is_nan() && !(low..=high).contains(*value);
        let count = column.iter().filter(is_outside).count();
        if count > 0 {
            let unit = quantity.unit().name();
            let text = format!(
                "{quantity} lies outside {low} to {high} {unit} in {count} rows, and those samples \
                 are refused: is the unit right?"
            );
            let figures = [
                ("quantity", quantity.name().into()),
                ("count", Value::Integer(count as i64)),
                ("low", low.into()),
                ("high", high.into()),
                ("unit", unit.into()),
            ];
            diagnostics.push(Diagnostic::new("implausible", Warning, text, figures));
        }
    }
    diagnostics
}
