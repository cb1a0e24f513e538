//! A cell of a run's file: its number, or what is wrong with it.

use std::borrow::Cow;

use dynocar_model::units::Unit;

use super::clock::TimeFormat;
use super::manifest::ColumnMapping;
use super::quantity::Quantity;
use super::text_layout::TextLayout;

/// The number in a trimmed cell, `NaN` for an empty one; `None` when it is something else.
pub fn parse_cell(cell: &[u8], decimal: u8) -> Option<f64> {
    if cell.is_empty() {
        return Some(f64::NAN);
    }
    let text = std::str::from_utf8(cell).ok()?;
    if decimal == b',' {
        // A point would be a mark of thousands here, or a mistake: neither is a number.
        return if text.contains('.') { None } else { text.replace(',', ".").parse().ok() };
    }
    text.parse().ok()
}

/// A greater number in SI units is none of a railway's; its square or sum might be infinite.
const MAGNITUDE_MAX: f64 = 1e15;

/// A cell's number as it is kept: in the quantity's unit, `to` which it is converted where it is in another
/// ([`ColumnMapping::converted_to`]); missing when infinite or as good as that.
pub fn held(mapping: &ColumnMapping, to: Option<&Unit>, cell: f64) -> f64 {
    if mapping.quantity == Quantity::CurveRadius && cell.is_infinite() {
        return 0.0;
    }
    let scaled = mapping.scaled(cell);
    let value = to.map_or(scaled, |unit| mapping.unit.convert(scaled, unit));
    if value.abs() <= MAGNITUDE_MAX { value } else { f64::NAN }
}

/// What is wrong with a cell that holds no value; `is_below_names` for one right below the names.
pub fn not_a_value(
    mapping: &ColumnMapping,
    cell: &[u8],
    layout: &TextLayout,
    is_below_names: bool,
) -> String {
    let printable = |letter: char| if letter.is_control() { ' ' } else { letter };
    let text: String = lossy(cell).chars().take(60).map(printable).collect();
    let column = &mapping.column;
    let with_point: Vec<u8> =
        cell.iter().map(|&letter| if letter == b',' { b'.' } else { letter }).collect();
    let of_time = TimeFormat::of_cell(cell);
    let is_time = mapping.quantity == Quantity::Time;
    let hint = if let Some(format) = of_time.first().filter(|_| is_time) {
        let instead = if mapping.format.is_some() { "" } else { " in place of unit" };
        format!("; for such times set format = \"{}\"{instead}", format.name())
    } else if mapping.format.is_none()
        && layout.decimal == b'.'
        && parse_cell(&with_point, b'.').is_some()
    {
        "; for decimal commas set decimal = \",\" in [dataset]".into()
    } else if is_below_names && !layout.units_row {
        "; for a line of units below the names set units_row = true in [dataset]".into()
    } else {
        String::new()
    };
    match &mapping.format {
        None => {
            format!("column '{column}': expected a number or an empty cell, got '{text}'{hint}")
        }
        Some(format) => format!(
            "column '{column}': expected a time as {} (format = \"{}\"), got '{text}'{hint}",
            format.example(),
            format.name()
        ),
    }
}

/// Bytes as text, whatever they are.
pub fn lossy(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(bytes)
}
