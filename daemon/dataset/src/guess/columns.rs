//! The columns of all files together, with facts on their values, and the marks in their numbers.

use super::facts::Facts;
use super::guessed::{GivenMarks, RecordingText};
use super::layout::{GuessedLayout, layout};
use super::name::Name;
use crate::TextLayout;
use crate::cell::{is_word, parse_cell, truth, ungrouped};
use crate::error::{DatasetError, NO_HEADER, RENAME, SourcePosition};
use crate::lines::{CellRow, RowReader, below};
use crate::text_layout::{Marks, THOUSANDS};

/// A column of the first file's header.
#[derive(Clone, Debug)]
pub struct InspectedColumn {
    /// Its name.
    pub name: Name,
    /// Facts on its values in each file.
    pub facts: Vec<Facts>,
    /// Facts on its values in all files.
    pub all: Facts,
    /// Why it cannot be mapped to any quantity, regardless of its values.
    pub unusable: Option<String>,
}

/// All files, read through.
#[derive(Clone, Debug)]
pub struct InspectedColumns {
    /// Layout of the first file's text, which holds for all files.
    pub layout: GuessedLayout,
    /// The columns, in the order of the first file's header.
    pub columns: Vec<InspectedColumn>,
    /// Rows of values in each file.
    pub rows: Vec<usize>,
}

impl InspectedColumns {
    /// Reads files that are laid out alike.
    ///
    /// # Errors
    ///
    /// Where one of them has no header or no rows, or another layout than the first.
    pub fn read(files: &[RecordingText], given: GivenMarks) -> Result<Self, DatasetError> {
        let of_file = |file: &RecordingText| layout(file.label, file.text, given.delimiter);
        let layouts: Vec<GuessedLayout> = files.iter().map(of_file).collect::<Result<_, _>>()?;
        let Some(first) = layouts.first() else {
            return Err(SourcePosition::whole("no file").problem(NO_HEADER));
        };
        let mut first = first.clone();
        let mut evidence = MarkEvidence::default();
        for (file, it) in files.iter().zip(&layouts) {
            let text = below(file.label, file.text, it.text.skip_rows)?;
            evidence.push_text(text, it.text.delimiter, it.text.lines_above() - it.text.skip_rows);
        }
        let marks = evidence.marks(given.decimal());
        (first.text.decimal, first.text.thousands) = (marks.decimal, marks.thousands);
        for (file, other) in files.iter().zip(&layouts) {
            require_alike(file, other, (files[0].label, &first.text))?;
        }
        let mut columns: Vec<InspectedColumn> = first
            .header
            .iter()
            .map(|name| InspectedColumn {
                name: name.clone(),
                facts: Vec::new(),
                all: Facts::new(),
                unusable: unusable(name, files, &layouts),
            })
            .collect();
        let mut rows = Vec::new();
        for (file, layout) in files.iter().zip(&layouts) {
            let (facts, count) = read_file(file, layout, marks)?;
            for column in &mut columns {
                let place = layout.header.iter().position(|name| *name == column.name);
                let of_file = place.map_or_else(Facts::new, |index| facts[index].clone());
                column.all.merge(&of_file);
                let text = || of_file.text.clone().map(|it| it.of_file(file.label, files.len()));
                column.all.text = column.all.text.take().or_else(text);
                column.facts.push(of_file);
            }
            rows.push(count);
        }
        Ok(InspectedColumns { layout: first, columns, rows })
    }

    /// Returns every column's name, for messages.
    pub fn names(&self) -> String {
        let names: Vec<String> =
            self.columns.iter().map(|column| format!("'{}'", column.name.shown())).collect();
        names.join(", ")
    }
}

/// Returns why no dataset can map a column of this name.
fn unusable(name: &Name, files: &[RecordingText], layouts: &[GuessedLayout]) -> Option<String> {
    files.iter().zip(layouts).find_map(|(file, layout)| {
        match layout.header.iter().filter(|other| *other == name).count() {
            0 => {
                let alike = layout.header.iter().find(|other| other.words == name.words);
                let units = alike.and_then(|it| it.unit.as_ref().zip(name.unit.as_ref()));
                Some(units.map_or_else(
                    || format!("{} has no such column", file.label),
                    |(own, unit)| {
                        let label = file.label;
                        format!(
                            "{label} has it in {own}, not in {unit}: write one unit in all files"
                        )
                    },
                ))
            }
            1 => None,
            count => Some(format!("its name occurs {count} times in {}{RENAME}", file.label)),
        }
    })
}

fn require_alike(
    file: &RecordingText,
    layout: &GuessedLayout,
    (label, first): (&str, &TextLayout),
) -> Result<(), DatasetError> {
    let mark = |mark: u8| format!("{:?}", char::from(mark).to_string());
    let own = &layout.text;
    let shown = |is_there: bool| String::from(if is_there { "there" } else { "not there" });
    let above = |layout: &TextLayout| layout.skip_rows.to_string();
    let all = [
        ("the delimiter", mark(own.delimiter), mark(first.delimiter)),
        ("the number of lines above the names", above(own), above(first)),
        ("a line of units", shown(own.units_row), shown(first.units_row)),
    ];
    let Some((what, found, expected)) = all.into_iter().find(|(_, one, other)| one != other) else {
        return Ok(());
    };
    Err(SourcePosition::whole(file.label).problem(format!(
        "{what} is {found}, but {expected} in {label}: files of one dataset are laid out alike"
    )))
}

/// Reads the facts on the values of every column, and the number of rows.
fn read_file(
    file: &RecordingText,
    layout: &GuessedLayout,
    marks: Marks,
) -> Result<(Vec<Facts>, usize), DatasetError> {
    let TextLayout { skip_rows, delimiter, units_row, .. } = layout.text;
    let text = below(file.label, file.text, skip_rows)?;
    let mut reader = RowReader::new(text, delimiter, marks.decimal);
    let mut facts = vec![Facts::new(); layout.header.len()];
    let above = 1 + usize::from(units_row);
    let (mut row, mut rows) = (CellRow::default(), 0);
    while reader.read(&mut row) {
        rows += 1;
        if rows <= above {
            continue;
        }
        let mut filled =
            row.cells.iter().map(|cell| cell.text.trim_ascii()).filter(|it| !it.is_empty());
        // A footer, or the names again.
        if filled
            .all(|cell| is_word(cell) && parse_cell(cell, marks).is_none() && truth(cell).is_none())
        {
            continue;
        }
        let line = row.line + skip_rows;
        for (facts, cell) in facts.iter_mut().zip(&row.cells) {
            facts.push_cell(line, cell.text.trim_ascii(), marks);
        }
    }
    // Names and units are no rows of values.
    Ok((facts, rows - above))
}

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

    /// Returns the marks, the decimal one as given if it is; without any evidence a point and nothing.
    pub fn marks(&self, given: Option<u8>) -> Marks {
        let (commas, points) = match (self.commas, self.points) {
            (0, 0) => (self.either_comma, self.either_point),
            sure => sure,
        };
        let decimal = given.unwrap_or(if commas > points { b',' } else { b'.' });
        let other = if decimal == b',' { '.' } else { ',' };
        let mut counts = self.thousands;
        let index = THOUSANDS.iter().position(|mark| *mark == other).unwrap_or(0);
        // The other mark stands between groups, where the decimal mark is sure.
        if given.is_some() || self.commas + self.points > 0 {
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
        let Marks { decimal, thousands } = evidence.marks(None);
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
