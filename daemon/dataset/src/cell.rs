//! A cell of a run's file: its number, or its fault.

use std::borrow::Cow;

use dynocar_model::units::Unit;

use super::clock::TimeFormat;
use super::keys::column::{FORMAT, UNIT};
use super::keys::dataset::{DECIMAL, THOUSANDS as GROUPS, UNITS_ROW};
use super::manifest::ColumnMapping;
use super::quantity::Quantity;
use super::text_layout::{Marks, THOUSANDS, TextLayout};

/// The typographic minus.
const MINUS: char = '\u{2212}';
/// Words of programs for a missing number, in small letters.
const MISSING: &str = "n/a na n.a. n/d nd n.d. n.v. k.a. #n/a #na #n/v #nv #n/d <na> <null> nan null (null) none nil nat - . ? \
                       * missing bad bad_input i/o_timeout error err fault fehler invalid inv ungültig no_data nodata \
                       undefined undef unknown unavailable overflow underflow void empty leer";

/// Returns the number in a trimmed cell, `NaN` for an empty cell or a word for a missing value; `None` for other text.
pub fn parse_cell(cell: &[u8], marks: Marks) -> Option<f64> {
    if cell.is_empty() {
        return Some(f64::NAN);
    }
    let text = std::str::from_utf8(cell).ok()?;
    let number = match marks.thousands.filter(|mark| text.contains(*mark)) {
        Some(mark) => decimal(&ungrouped(text, mark, char::from(marks.decimal))?, marks.decimal),
        None => decimal(text, marks.decimal),
    };
    let otherwise = || plain(text).and_then(|it| decimal(&it, marks.decimal));
    number.or_else(|| is_missing(text).then_some(f64::NAN)).or_else(otherwise)
}

/// Returns a number that is written otherwise: with a typographic minus, Fortran's exponent, or as a spreadsheet's
/// text.
fn plain(text: &str) -> Option<String> {
    let own = text.strip_prefix("=\"").and_then(|it| it.strip_suffix('"')).unwrap_or(text);
    let is_number = own.starts_with(['+', '-', '.', MINUS]) || own.starts_with(char::is_numeric);
    is_number.then(|| own.replace(MINUS, "-").replace("D+", "e+").replace("D-", "e-"))
}

fn decimal(text: &str, mark: u8) -> Option<f64> {
    if mark == b',' {
        // A point would be a mark of thousands here, or a mistake: neither is a number.
        return if text.contains('.') { None } else { text.replace(',', ".").parse().ok() };
    }
    text.parse().ok()
}

/// Returns a number without the marks between its groups of three digits; `None` where they stand elsewhere.
pub fn ungrouped(text: &str, mark: char, decimal: char) -> Option<String> {
    let (whole, fraction) = text.split_once(decimal).map_or((text, None), |(a, b)| (a, Some(b)));
    let is_digits = |it: &str| it.bytes().all(|byte| byte.is_ascii_digit());
    let unsigned = whole.trim_start_matches(['+', '-']);
    let mut groups = unsigned.split(mark);
    let first = groups.next()?;
    let is_first = (1..=3).contains(&first.len()) && is_digits(first);
    let is_grouped = is_first && groups.all(|group| group.len() == 3 && is_digits(group));
    let rest = fraction.map_or(String::new(), |it| format!("{decimal}{it}"));
    is_grouped.then(|| whole.replace(mark, "") + &rest)
}

/// Returns true for a word, or marks, that say that a number is missing.
pub fn is_missing(text: &str) -> bool {
    let folded = text.to_lowercase().replace(' ', "_");
    let is_mark = |letter: char| "-_.*?/#".contains(letter);
    let is_of_marks = folded.len() > 1 && folded.chars().all(is_mark);
    // Spreadsheets name an error in their user's language.
    let is_error = folded.starts_with('#') && folded.ends_with(['!', '?']);
    let is_no_number =
        ["1.#", "nan("].iter().any(|it| folded.trim_start_matches('-').starts_with(it));
    is_of_marks || is_error || is_no_number || MISSING.split(' ').any(|word| word == folded)
}

/// 1 for a word that says yes, 0 for one that says no.
pub fn truth(cell: &[u8]) -> Option<f64> {
    let word = std::str::from_utf8(cell).ok()?.to_lowercase();
    match &word[..] {
        "true" | "yes" | "on" | "ja" | "wahr" | "oui" | "vrai" | "si" | "ein" => Some(1.0),
        "false" | "no" | "off" | "nein" | "falsch" | "non" | "faux" | "aus" => Some(0.0),
        _ => None,
    }
}

/// Returns true for a cell that begins as no number does: a word.
pub fn is_word(cell: &[u8]) -> bool {
    let cell = cell.strip_prefix(b"=\"").unwrap_or(cell);
    let cell = cell.strip_prefix(MINUS.encode_utf8(&mut [0; 3]).as_bytes()).unwrap_or(cell);
    let first = cell.iter().find(|byte| !b"+-.,".contains(byte));
    first.is_some_and(|byte| !byte.is_ascii_digit())
}

/// Largest number in SI units that a railway has; the square or sum of a greater one might be infinite.
const MAGNITUDE_MAX: f64 = 1e15;

/// Returns a cell's number as it is kept: in the quantity's unit, `to` which it is converted where it is in another
/// ([`ColumnMapping::converted_to`]); missing when infinite or as good as that.
pub fn held(mapping: &ColumnMapping, to: Option<&Unit>, cell: f64) -> f64 {
    if mapping.quantity == Quantity::CurveRadius && cell.is_infinite() {
        return 0.0;
    }
    let scaled = mapping.scaled(cell);
    let value = to.map_or(scaled, |unit| mapping.unit.convert(scaled, unit));
    if value.abs() <= MAGNITUDE_MAX { value } else { f64::NAN }
}

/// Describes the fault of a cell that holds no value; `is_below_names` for one right below the names.
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
        format!("; for such times set {}{instead}", FORMAT.assign(format!("\"{}\"", format.name())))
    } else if mapping.format.is_some() && parse_cell(cell, layout.marks()).is_some() {
        let units: Vec<&str> = Unit::of(mapping.quantity.dimension()).map(|it| it.name()).collect();
        format!(
            ", a plain number; for those set {} (or {}) in place of {}",
            UNIT.assign(format!("\"{}\"", mapping.quantity.unit().name())),
            units.join(", "),
            FORMAT.name
        )
    } else if mapping.format.is_none()
        && layout.decimal == b'.'
        && parse_cell(&with_point, Marks::plain(b'.')).is_some()
    {
        format!("; for decimal commas {}", DECIMAL.advice("\",\""))
    } else if mapping.format.is_none()
        && layout.decimal == b','
        && parse_cell(cell, Marks::plain(b'.')).is_some()
    {
        format!("; for decimal points {}", DECIMAL.advice("\".\""))
    } else if mapping.quantity == Quantity::Position && is_of_km_and_m(&lossy(cell)) {
        format!("; {METRES_ALONE}")
    } else if let Some(mark) = grouping(cell, layout) {
        format!("; for marks of thousands {}", GROUPS.advice(format!("{mark:?}")))
    } else if is_below_names && !layout.units_row {
        format!("; for a line of units below the names {}", UNITS_ROW.advice(true))
    } else {
        String::new()
    };
    match &mapping.format {
        None => {
            format!("column '{column}': expected a number or an empty cell, got '{text}'{hint}")
        }
        Some(format) => format!(
            "column '{column}': expected a time as {} ({}), got '{text}'{hint}",
            format.example(),
            FORMAT.assign(format!("\"{}\"", format.name()))
        ),
    }
}

/// Remedy of a chainage as railways write it.
pub const METRES_ALONE: &str = "write a chainage of km and m as metres: 12345 for 12+345";

/// Returns whether a cell holds a chainage as `12+345` or `12+345.6`: km, and three digits of m.
pub fn is_of_km_and_m(cell: &str) -> bool {
    let Some((km, m)) = cell.split_once('+') else { return false };
    let (whole, part) = m.split_once(['.', ',']).unwrap_or((m, ""));
    let is_digits = |it: &str| it.bytes().all(|letter| letter.is_ascii_digit());
    !km.is_empty() && whole.len() == 3 && [km, whole, part].into_iter().all(is_digits)
}

/// Returns the mark that would make a number of a cell, were it between groups of three digits.
fn grouping(cell: &[u8], layout: &TextLayout) -> Option<String> {
    let with = |thousands| Marks { thousands: Some(thousands), ..layout.marks() };
    let mark = THOUSANDS.into_iter().filter(|mark| *mark != char::from(layout.decimal));
    mark.map(|mark| (mark, with(mark)))
        .find(|(_, marks)| parse_cell(cell, *marks).is_some())
        .map(|(mark, _)| mark.to_string())
}

/// Returns bytes as text, with the invalid ones replaced.
pub fn lossy(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(bytes)
}
