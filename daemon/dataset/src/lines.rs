//! The lines of a CSV file: those above the names, and the rows.

use csv::{ByteRecord, ReaderBuilder};

use super::error::{DatasetError, Problem, SourcePosition};

/// A reader of a text's rows.
pub fn reader(text: &str, delimiter: u8) -> csv::Reader<&[u8]> {
    ReaderBuilder::new()
        .delimiter(delimiter)
        .has_headers(false)
        .flexible(true)
        .from_reader(text.as_bytes())
}

/// A text without its byte-order mark and the lines above the names.
pub fn below<'t>(label: &str, text: &'t str, skip_rows: usize) -> Result<&'t str, DatasetError> {
    let mut rest = text.strip_prefix('\u{feff}').unwrap_or(text);
    for lines in 0..skip_rows {
        let Some(end) = rest.find(['\n', '\r']) else {
            let lines = lines + usize::from(!rest.is_empty());
            let problem = Problem::NothingBelow { skip_rows, lines };
            return Err(SourcePosition::whole(label).problem(problem));
        };
        let is_pair = rest[end..].starts_with("\r\n");
        rest = &rest[end + 1 + usize::from(is_pair)..];
    }
    Ok(rest)
}

/// The line of a text, from 1, in which a record begins. The reader stands at the end of the line before,
/// or before blank lines.
pub fn line_of(text: &str, record: &ByteRecord) -> usize {
    let Some(position) = record.position() else { return 0 };
    let rest = text.as_bytes().get(position.byte() as usize..).unwrap_or_default();
    let ends = rest.iter().take_while(|byte| b"\r\n".contains(byte));
    position.line() as usize + ends.filter(|&&byte| byte == b'\n').count()
}
