//! The columns' names: where the mapped ones stand.

use super::cell::lossy;
use super::keys::dataset::SKIP_ROWS;
use super::lines::{CellRow, RowReader};
use super::manifest::ColumnMapping;
use super::names::unknown;
use super::text_layout::TextLayout;

/// Number of lines that are searched for names that stand elsewhere than declared.
const LINES_MAX: usize = 100;

/// In which line the names stand instead, where that is found.
fn elsewhere(text: &str, (layout, mappings): (&TextLayout, &[ColumnMapping])) -> String {
    let holds_names = |line: &str| {
        let mut row = CellRow::default();
        let is_read = RowReader::new(line, layout.delimiter, layout.decimal).read(&mut row);
        let cells = names_of(&row);
        is_read && mappings.iter().flat_map(ColumnMapping::names).all(|name| cells.contains(name))
    };
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let found = text.lines().take(LINES_MAX).position(holds_names);
    found.map_or_else(String::new, |above| {
        format!("; the names stand in line {}: {}", above + 1, SKIP_ROWS.advice(above))
    })
}

/// The names in a row, without spaces around them.
pub fn names_of(row: &CellRow) -> Vec<String> {
    row.cells.iter().map(|cell| lossy(&cell.text).trim().to_owned()).collect()
}

/// The indices of every mapping's columns among the names of a text that is laid out so; or what is wrong with the names.
pub fn find_columns(
    header: &[String],
    text: &str,
    (layout, mappings): (&TextLayout, &[ColumnMapping]),
) -> Result<Vec<Vec<usize>>, String> {
    let index = |mapping: &ColumnMapping, name: &String| {
        let mut found = (0..header.len()).filter(|&index| header[index] == *name);
        match (found.next(), found.count()) {
            (Some(index), 0) => Ok(index),
            (Some(_), more) => {
                Err(format!("column '{name}' occurs {} times in the header", 1 + more))
            }
            (None, _) => {
                let other =
                    [';', ',', '\t', '|'].into_iter().find(|mark| header[0].contains(*mark));
                if let (1, Some(other)) = (header.len(), other) {
                    return Err(format!(
                        "expected columns separated by {:?}, found {other:?} in the header: set \
                         delimiter = \"{}\" in [dataset]",
                        char::from(layout.delimiter),
                        other.escape_default()
                    ));
                }
                let instead = elsewhere(text, (layout, mappings));
                let context = format!(" (for {} in {}{instead})", mapping.quantity, mapping.place);
                let named = header.iter().filter(|other| !other.is_empty());
                Err(unknown("column", name, &context, named.cloned()))
            }
        }
    };
    let indices = |mapping: &ColumnMapping| {
        mapping.names().map(|name| index(mapping, name)).collect::<Result<Vec<usize>, String>>()
    };
    mappings.iter().map(indices).collect()
}
