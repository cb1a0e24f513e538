//! The columns' names: where the mapped ones stand.

use super::cell::lossy;
use super::error::Problem;
use super::lines::{Row, RowReader};
use super::manifest::ColumnMapping;
use super::names::Choices;
use super::text_layout::TextLayout;

/// So many lines are searched for names that stand elsewhere than declared.
const LINES_MAX: usize = 100;

/// What is wrong with the names, with the line in which they stand instead where that is found.
pub fn misplaced(
    problem: Problem,
    text: &str,
    (layout, mappings): (&TextLayout, &[ColumnMapping]),
) -> Problem {
    let Problem::UnknownName { what, name, context, choices } = problem else { return problem };
    let holds_names = |line: &str| {
        let mut row = Row::default();
        let is_read = RowReader::new(line, layout.delimiter, layout.decimal).read(&mut row);
        let cells = names_of(&row);
        is_read && mappings.iter().all(|mapping| cells.contains(&mapping.column))
    };
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let found = text.lines().take(LINES_MAX).position(holds_names);
    let hint = found.map_or_else(String::new, |above| {
        format!("; the names stand in line {}: set skip_rows = {above} in [dataset]", above + 1)
    });
    let context = context.strip_suffix(')').map_or(context.clone(), |it| format!("{it}{hint})"));
    Problem::UnknownName { what, name, context, choices }
}

/// The names in a row, without spaces around them.
pub fn names_of(row: &Row) -> Vec<String> {
    row.cells.iter().map(|cell| lossy(&cell.text).trim().to_owned()).collect()
}

/// The index of a mapped column among the names.
pub fn find_column(
    mapping: &ColumnMapping,
    header: &[String],
    layout: &TextLayout,
) -> Result<usize, Problem> {
    let name = &mapping.column;
    let count = header.iter().filter(|other| *other == name).count();
    match count {
        1 => Ok(header.iter().position(|other| other == name).unwrap_or(0)),
        0 => {
            let other = [';', ',', '\t', '|'].into_iter().find(|mark| header[0].contains(*mark));
            Err(match (header.len(), other) {
                (1, Some(found)) => {
                    Problem::OtherDelimiter { expected: char::from(layout.delimiter), found }
                }
                _ => {
                    let context = format!(" (for {} in {})", mapping.quantity, mapping.place);
                    let named = header.iter().filter(|other| !other.is_empty());
                    let choices = Choices::new(name, named.cloned());
                    Problem::UnknownName { what: "column", name: name.clone(), context, choices }
                }
            })
        }
        _ => Err(Problem::RepeatedColumn { column: name.clone(), count }),
    }
}
