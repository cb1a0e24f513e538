//! Numbers that a recorder writes in the place of a missing value, as 9999 or 65535: cells that hold one count as
//! missing.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use dynocar_model::units::Dimension;

use super::chainage;
use super::manifest::{ColumnMapping, Manifest};
use super::order::quantile;
use super::quantity::Quantity;
use super::table::Table;

/// Greatest share of a column's values that one number may have and still stand for missing ones.
const SHARE_MAX: f64 = 0.5;
/// Ranges of the other values by which a usual fill value lies outside of them; any other number lies further out.
const RANGES: (f64, f64) = (1.0, 3.0);
/// How often a usual fill value, any other number, and one within the range of the other values has to occur.
const COUNTS: (usize, usize, usize) = (2, 3, 5);
/// Fewer different values in a column of forces or powers are the steps of a handle.
const DISTINCT_MIN: usize = 10;
/// A number within the range of the others stands alone: it differs from its neighbours by this many usual steps...
const LEAP_STEPS: f64 = 10.0;
/// ... at this share of the ends of its intervals, of which there are this many.
const LEAP_SHARE: f64 = 0.8;
const INTERVALS_MIN: usize = 3;
/// Relative difference within which a converted cell is the number that it was.
const ROUNDING: f64 = 1e-9;

/// A number in the place of missing values.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FillValue {
    pub quantity: Quantity,
    /// Name of the column.
    pub column: String,
    /// As it stands in the cells.
    pub value: f64,
    /// How many cells held it.
    pub count: usize,
    /// Least and greatest of the other cells.
    pub others: (f64, f64),
}

/// Takes the fill values out of the columns of a run whose rows are in order.
pub(super) fn take_out(table: &mut Table, manifest: &Manifest) -> Vec<FillValue> {
    let mut found = Vec::new();
    for mapping in manifest.columns.iter().filter(|it| may_hold_one(it.quantity)) {
        let Some(column) = table.column(mapping.quantity) else { continue };
        let mut cells = cells(mapping, column);
        let known = found.len();
        while found.len() < known + 3
            && let Some(value) =
                USUAL.far(&cells, mapping.quantity).or_else(|| USUAL.within(&cells))
        {
            take_from(mapping, &mut cells, |_, cell| cell == value, &mut found);
        }
        if found.len() > known {
            remove(table, mapping.quantity, &cells);
        }
    }
    take_out_positions(table, manifest, &mut found);
    found
}

/// Takes the positions out that repeat where the train is not.
fn take_out_positions(table: &mut Table, manifest: &Manifest, found: &mut Vec<FillValue>) {
    let mapping = manifest.mapping(Quantity::Position);
    let Some((mapping, position_m)) = mapping.zip(table.filled(Quantity::Position)) else { return };
    let column = |quantity| table.column(quantity).unwrap_or_default();
    let away = chainage::away(column(Quantity::Time), position_m, column(Quantity::Speed));
    if away.is_empty() {
        return;
    }
    let mut counts: BTreeMap<u64, usize> = BTreeMap::new();
    let mut is_away = vec![false; position_m.len()];
    for row in away {
        *counts.entry(position_m[row].to_bits()).or_default() += 1;
        is_away[row] = true;
    }
    let bits: Vec<u64> = position_m.iter().map(|it| it.to_bits()).collect();
    let mut cells = cells(mapping, position_m);
    for (value, _) in counts.into_iter().filter(|(_, count)| *count >= COUNTS.0) {
        take_from(mapping, &mut cells, |row, _| is_away[row] && bits[row] == value, found);
    }
    remove(table, Quantity::Position, &cells);
}

/// Returns whether a number far from the others can only stand for missing values: one of a count, or a radius of
/// straight track, says something.
fn may_hold_one(quantity: Quantity) -> bool {
    use Quantity::{CurveRadius, Position, Time};
    quantity.dimension() != Dimension::Count && !matches!(quantity, CurveRadius | Position | Time)
}

/// Returns the values of a column as they stood in its cells, but for the last digits.
fn cells(mapping: &ColumnMapping, column: &[f64]) -> Vec<f64> {
    let unit = mapping.converted_to();
    let scaled = |value: f64| match &unit {
        Some(unit) => unit.convert(value, &mapping.unit),
        None => value,
    };
    column.iter().map(|value| (scaled(*value) - mapping.offset) / mapping.scale).collect()
}

/// Returns a converted cell as it was written: the conversion there and back leaves the last digits uncertain.
fn written(cell: f64) -> f64 {
    format!("{cell:.9e}").parse().unwrap_or(cell)
}

/// Empties the chosen cells, and adds the value that they held.
fn take_from(
    mapping: &ColumnMapping,
    cells: &mut [f64],
    is_fill: impl Fn(usize, f64) -> bool,
    found: &mut Vec<FillValue>,
) {
    let (mut value, mut count) = (f64::NAN, 0);
    for (row, cell) in cells.iter_mut().enumerate() {
        if is_fill(row, *cell) {
            (value, count) = (*cell, count + 1);
            *cell = f64::NAN;
        }
    }
    let others = cells
        .iter()
        .filter(|it| !it.is_nan())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), it| (it.min(low), it.max(high)));
    let (quantity, column) = (mapping.quantity, mapping.column.clone());
    let (value, others) = (written(value), (written(others.0), written(others.1)));
    found.push(FillValue { quantity, column, value, count, others });
}

/// Removes the values whose cells were emptied.
fn remove(table: &mut Table, quantity: Quantity, cells: &[f64]) {
    let column = table.column(quantity).unwrap_or_default();
    let kept = |(value, cell): (&f64, &f64)| if cell.is_nan() { f64::NAN } else { *value };
    let values = column.iter().zip(cells).map(kept).collect();
    table.replace(quantity, values);
}

/// Returns whether recorders write a number in the place of a missing value.
pub fn is_usual(cell: f64) -> bool {
    USUAL.holds(cell)
}

/// The numbers that recorders use: digits of 9 alone, and the ends of whole numbers of 16, 24 and 32 bits, each with a
/// decimal point somewhere.
struct Usual {
    sorted: Vec<f64>,
}

static USUAL: LazyLock<Usual> = LazyLock::new(Usual::new);

impl Usual {
    fn new() -> Self {
        let nines = (2..=7).flat_map(|digits| {
            let all = 10_f64.powi(digits) - 1.0;
            (0..=digits - 2).map(move |places| all / 10_f64.powi(places))
        });
        let bits = [15, 16, 23, 24, 31, 32].map(|bits| 2_f64.powi(bits));
        let ends = bits.into_iter().flat_map(|end| [end - 1.0, end]);
        let ends = ends.flat_map(|end| (0..=4).map(move |places| end / 10_f64.powi(places)));
        let mut sorted: Vec<f64> = nines.chain(ends).collect();
        sorted.sort_by(f64::total_cmp);
        Usual { sorted }
    }

    fn holds(&self, cell: f64) -> bool {
        let size = cell.abs();
        let place = self.sorted.partition_point(|it| *it < size * (1.0 - ROUNDING));
        self.sorted.get(place).is_some_and(|it| *it <= size * (1.0 + ROUNDING))
    }

    /// Returns the least or greatest cell, where it repeats exactly, far from all others.
    fn far(&self, cells: &[f64], quantity: Quantity) -> Option<f64> {
        let there = || cells.iter().copied().filter(|it| !it.is_nan());
        let (mut high, mut below) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        let (mut low, mut above) = (f64::INFINITY, f64::INFINITY);
        for cell in there() {
            if cell > high {
                (high, below) = (cell, high);
            } else if cell < high {
                below = below.max(cell);
            }
            if cell < low {
                (low, above) = (cell, low);
            } else if cell > low {
                above = above.min(cell);
            }
        }
        let inner_low = if self.holds(low) { above } else { low };
        let inner_high = if self.holds(high) { below } else { high };
        let candidates = [(high, below, below - inner_low), (low, above, inner_high - above)];
        let is_force = matches!(
            quantity.dimension(),
            Dimension::Force | Dimension::Power | Dimension::Pressure | Dimension::Ratio
        ) && quantity != Quantity::Gradient;
        candidates.into_iter().find_map(|(end, next, range)| {
            let is_usual = self.holds(end);
            let (ranges, count_min) = match is_usual {
                true => (RANGES.0, COUNTS.0),
                false => (RANGES.1, COUNTS.1),
            };
            let size = if quantity == Quantity::TrainMass { 3.0 } else { 1.0 } * next.abs();
            let is_far = (end - next).abs() > ranges * range.max(size);
            if !is_far || !next.is_finite() || !range.is_finite() || range < 0.0 {
                return None;
            }
            let count = there().filter(|it| *it == end).count();
            let is_rare = count as f64 <= SHARE_MAX * there().count() as f64;
            let distinct_min = if is_force || !is_usual { DISTINCT_MIN } else { 1 };
            let is_alone = is_usual || intervals(cells, end).count() > 1;
            (count >= count_min && is_rare && is_alone && has_distinct(cells, end, distinct_min))
                .then_some(end)
        })
    }

    /// Returns a usual fill value within the range of the others, which comes and goes by leaps.
    fn within(&self, cells: &[f64]) -> Option<f64> {
        let mut counts: BTreeMap<u64, usize> = BTreeMap::new();
        // 99.9 and 999 may well be measured.
        let is_long = |it: f64| self.holds(it) && !matches!(it.abs(), 99.0..=999.99);
        for cell in cells.iter().filter(|it| is_long(**it)) {
            *counts.entry(cell.to_bits()).or_default() += 1;
        }
        let often = counts.into_iter().filter(|(_, count)| *count >= COUNTS.2);
        often.map(|(bits, _)| f64::from_bits(bits)).find(|&value| leaps(cells, value))
    }
}

/// Returns whether there are several different cells other than this one.
fn has_distinct(cells: &[f64], value: f64, count: usize) -> bool {
    let mut distinct: Vec<f64> = Vec::new();
    for &cell in cells.iter().filter(|it| !it.is_nan() && **it != value) {
        if !distinct.contains(&cell) {
            distinct.push(cell);
        }
        if distinct.len() >= count {
            return true;
        }
    }
    false
}

/// Returns the first row of each interval that holds a value, and the row after it.
fn intervals(cells: &[f64], value: f64) -> impl Iterator<Item = (usize, usize)> + '_ {
    let starts = (0..cells.len()).filter(move |&row| {
        cells[row] == value && row.checked_sub(1).is_none_or(|before| cells[before] != value)
    });
    starts.map(move |start| {
        let rest = cells[start..].iter().position(|it| *it != value);
        (start, rest.map_or(cells.len(), |rest| start + rest))
    })
}

/// Returns whether a value comes and goes by leaps, as the others do not.
fn leaps(cells: &[f64], value: f64) -> bool {
    let others: Vec<f64> =
        cells.iter().copied().filter(|it| !it.is_nan() && *it != value).collect();
    let mut steps: Vec<f64> = others
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .filter(|step| *step > 0.0)
        .collect();
    let Some(usual) = quantile(&mut steps, 0.5) else { return false };
    let intervals: Vec<(usize, usize)> = intervals(cells, value).collect();
    let ends = intervals.iter().flat_map(|&(start, end)| {
        [start.checked_sub(1), Some(end)].map(|row| row.and_then(|row| cells.get(row)))
    });
    let ends: Vec<f64> = ends.flatten().copied().filter(|it| !it.is_nan()).collect();
    let wide = ends.iter().filter(|it| (**it - value).abs() > LEAP_STEPS * usual).count();
    intervals.len() >= INTERVALS_MIN && wide as f64 >= LEAP_SHARE * ends.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(cells: &[f64], quantity: Quantity) -> Option<f64> {
        USUAL.far(cells, quantity).or_else(|| USUAL.within(cells))
    }

    /// Returns cells that go up and down between two numbers, with another one in some of them.
    fn cells((low, high): (f64, f64), fill: f64, every: usize) -> Vec<f64> {
        let wave = |row: usize| 0.5 * (1.0 - (0.01 * row as f64).cos());
        let cell = |row: usize| low + (high - low) * (100.0 * wave(row)).round() / 100.0;
        (0..2000).map(|row| if row % every == every - 1 { fill } else { cell(row) }).collect()
    }

    #[test]
    fn a_repeated_number_apart_from_all_others_stands_for_missing_values() {
        let gradient = |fill| found(&cells((-8.0, 9.0), fill, 50), Quantity::Gradient);
        for fill in [99.0, -99.0, 99.9, 9999.0, -9999.0, 32.767, 65535.0, -1000.0] {
            assert_eq!(gradient(fill), Some(fill));
        }
        for value in [9.0, 12.0, -15.0, 25.0] {
            assert_eq!(gradient(value), None, "{value} may be a gradient");
        }
        let force = |fill| found(&cells((0.0, 300e3), fill, 50), Quantity::TractionForce);
        assert_eq!(force(65535.0), Some(65535.0), "within the range, but by leaps");
        assert_eq!(force(-32768.0), Some(-32768.0));
        assert_eq!(force(60e3), None);
        let mass = |fill| found(&cells((452.0, 452.0), fill, 50), Quantity::TrainMass);
        assert_eq!((mass(9999.0), mass(999.0)), (Some(9999.0), None));
    }

    #[test]
    fn loads_steps_and_single_values_are_no_fill_values() {
        let loads: Vec<f64> = (0..900).map(|row| [120.0, 400.0, 120.0][row / 300]).collect();
        assert_eq!(found(&loads, Quantity::TrainMass), None);
        let notches: Vec<f64> = (0..900).map(|row| [0.0, 20.0, 99.0][row / 7 % 3]).collect();
        assert_eq!(found(&notches, Quantity::TractionForce), None);
        let mut single = cells((0.0, 30.0), 5.0, 50);
        single[700] = 9999.0;
        assert_eq!(found(&single, Quantity::Speed), None, "an outlier");
    }
}
