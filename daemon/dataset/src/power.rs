//! The electric power that a run records, from which its traction force may come.

use std::borrow::Cow;

use super::quantity::Quantity;
use super::table::Table;

/// A run's power in W, row by row, `NaN` where missing, what is fed back negative: the drive's own
/// power, else the line's.
pub(super) fn recorded_w(table: &Table) -> Option<Cow<'_, [f64]>> {
    table.filled(Quantity::TractionPower).map(Cow::from).or_else(|| line_power_w(table))
}

/// Power from the line in W, by its own column, else by voltage and current.
pub(super) fn line_power_w(table: &Table) -> Option<Cow<'_, [f64]>> {
    if let Some(power_w) = table.filled(Quantity::LinePower) {
        return Some(power_w.into());
    }
    let (volts, amperes) =
        table.filled(Quantity::LineVoltage).zip(table.filled(Quantity::LineCurrent))?;
    Some(volts.iter().zip(amperes).map(|(volts, amperes)| volts * amperes).collect())
}
