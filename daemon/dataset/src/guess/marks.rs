//! Marks in numbers: before their fraction, and between groups of three digits.

use crate::cell::{is_word, ungrouped};
use crate::lines::{CellRow, RowReader};
use crate::text_layout::{Marks, THOUSANDS};

/// Evidence of the cells of files on their marks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MarkEvidence {
    /// Cells in which a comma, and a point, can be nothing but a decimal mark.
    commas: usize,
    points: usize,
    /// Cells in which each mark can be nothing but one of thousands.
    thousands: [usize; THOUSANDS.len()],
    /// Cells whose only comma, or point, stands before three digits.
    either_comma: usize,
    either_point: usize,
}

impl MarkEvidence {
    /// Adds the evidence of a text's rows, without the lines above them.
    pub fn push_text(&mut self, text: &str, delimiter: u8, lines_above: usize) {
        let mut reader = RowReader::new(text, delimiter, b'.');
        let (mut row, mut rows) = (CellRow::default(), 0);
        while reader.read(&mut row) {
            rows += 1;
            for cell in row.cells.iter().filter(|_| rows > lines_above) {
                self.push(cell.text.trim_ascii());
            }
        }
    }

    /// Takes in a cell.
    fn push(&mut self, cell: &[u8]) {
        if !cell.iter().any(|byte| !byte.is_ascii_digit()) || is_word(cell) || cell.contains(&b':')
        {
            return;
        }
        let Ok(text) = std::str::from_utf8(cell) else { return };
        let count = |mark: char| text.matches(mark).count();
        let is_grouped = |mark: char, decimal: char| {
            ungrouped(text, mark, decimal)
                .and_then(|it| it.replace(decimal, ".").parse::<f64>().ok())
                .is_some()
        };
        for (index, mark) in THOUSANDS.into_iter().enumerate().filter(|(_, mark)| count(*mark) > 0)
        {
            let decimals = [',', '.'].into_iter().filter(|decimal| *decimal != mark);
            for decimal in decimals.filter(|decimal| is_grouped(mark, *decimal)) {
                let is_plain = matches!(mark, '.' | ',') && count(mark) == 1 && count(decimal) == 0;
                // A number of three decimals below one has no groups.
                let has_decimal = count(decimal) == 1;
                self.thousands[index] += usize::from(!is_plain);
                self.commas += usize::from(has_decimal && decimal == ',');
                self.points += usize::from(has_decimal && decimal == '.');
            }
        }
        let is_number = |mark: &str| text.replacen(mark, ".", 1).parse::<f64>().is_ok();
        let (points, commas) = (count('.'), count(','));
        let before_three = |mark: char| {
            let is_zero = text.trim_start_matches(['+', '-']).starts_with('0');
            !is_zero && ungrouped(text, mark, ';').is_some()
        };
        match (commas, points) {
            (1, 0) if before_three(',') => self.either_comma += 1,
            (0, 1) if before_three('.') => self.either_point += 1,
            (1, 0) => self.commas += usize::from(is_number(",")),
            (0, 1) => self.points += usize::from(is_number(".")),
            _ => {}
        }
    }

    /// Returns the marks; without any evidence a point and nothing.
    pub fn marks(&self) -> Marks {
        let (commas, points) = match (self.commas, self.points) {
            (0, 0) => (self.either_comma, self.either_point),
            sure => sure,
        };
        let decimal = if commas > points { b',' } else { b'.' };
        let other = if decimal == b',' { '.' } else { ',' };
        let mut counts = self.thousands;
        let index = THOUSANDS.iter().position(|mark| *mark == other).unwrap_or(0);
        // The other mark stands between groups, where the decimal mark is sure.
        if self.commas + self.points > 0 {
            counts[index] += if other == '.' { self.either_point } else { self.either_comma };
        }
        let most =
            THOUSANDS.into_iter().zip(counts).filter(|(mark, _)| *mark != char::from(decimal));
        let most = most.max_by_key(|(_, count)| *count).filter(|(_, count)| *count > 0);
        Marks { decimal, thousands: most.map(|(mark, _)| mark) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marks(cells: &[&str]) -> (char, Option<char>) {
        let mut evidence = MarkEvidence::default();
        cells.iter().for_each(|cell| evidence.push(cell.as_bytes()));
        let Marks { decimal, thousands } = evidence.marks();
        (decimal.into(), thousands)
    }

    #[test]
    fn marks_are_recognised_by_all_cells_together() {
        assert_eq!(marks(&["1.755,5", "0", "12,5"]), (',', Some('.')));
        assert_eq!(marks(&["1,755.5", "0.125"]), ('.', Some(',')));
        assert_eq!(marks(&["1\u{202f}755,5"]), (',', Some('\u{202f}')));
        assert_eq!(marks(&["1'755.5", "2.5"]), ('.', Some('\'')));
        assert_eq!(marks(&["12 345 678", "1,5"]), (',', Some(' ')));
        assert_eq!(
            marks(&["342.400", "61,2"]),
            (',', Some('.')),
            "integers beside a decimal comma"
        );
        assert_eq!(marks(&["1,234,567", "2.5"]), ('.', Some(',')));
        assert_eq!(marks(&["12.345", "3.141"]), ('.', None), "three decimals");
        assert_eq!(marks(&["12,345"]), (',', None));
        assert_eq!(marks(&["0.125", "12.345"]), ('.', None));
        assert_eq!(marks(&["1.5", "2026-03-18", "n/a", "18.03.2026", ""]), ('.', None));
        assert_eq!(marks(&["1", "2"]), ('.', None));
    }
}
