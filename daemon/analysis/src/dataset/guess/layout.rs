//! How a file's text falls into cells: delimiter, decimal mark and header.

use csv::{ByteRecord, ReaderBuilder};

use super::name::Name;
use super::problem::{GuessError, GuessProblem};
use super::spelling;
use crate::dataset::table::parse_cell;
use crate::dataset::{Place, Problem};

/// What may separate cells, in the order of preference.
const DELIMITERS: [u8; 4] = *b";\t|,";
/// So many rows tell the delimiter and the decimal mark.
const ROWS_MAX: usize = 200;

/// How a file's text falls into cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Between the cells of a row.
    pub delimiter: u8,
    /// Between a number and its fraction; `None` where no number has one.
    pub decimal: Option<u8>,
    /// The columns' names.
    pub header: Vec<Name>,
}

/// A reader of a text's rows.
pub fn reader(text: &str, delimiter: u8) -> csv::Reader<&[u8]> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    ReaderBuilder::new()
        .delimiter(delimiter)
        .has_headers(false)
        .flexible(true)
        .from_reader(text.as_bytes())
}

/// Tells the layout of a file.
///
/// # Errors
///
/// Where the first line holds no names of columns, or nothing follows.
pub fn layout(label: &str, text: &str) -> Result<Layout, GuessError> {
    let readings = DELIMITERS.map(|delimiter| (delimiter, first_rows(text, delimiter)));
    let [(_, rows), ..] = &readings;
    if rows.iter().all(|row| row.is_empty() || row.iter().all(|cell| cell.trim().is_empty())) {
        return Err(Place::whole(label).problem(Problem::NoHeader).into());
    }
    let best = readings.iter().max_by(|one, other| fit(&one.1).total_cmp(&fit(&other.1)));
    let Some((delimiter, rows)) = best.filter(|(_, rows)| rows.iter().any(|row| row.len() > 1))
    else {
        let found = Name::parse(&rows[0].join(",")).shown();
        return Err(GuessError::new(Place::line(label, 1), GuessProblem::OneColumn { found }));
    };
    let decimal = decimal(&rows[1..]);
    judge_header(label, rows, decimal)?;
    let header = rows[0].iter().map(|cell| Name::parse(cell)).collect();
    Ok(Layout { delimiter: *delimiter, decimal, header })
}

fn first_rows(text: &str, delimiter: u8) -> Vec<Vec<String>> {
    let mut reader = reader(text, delimiter);
    let (mut rows, mut record) = (Vec::new(), ByteRecord::new());
    while rows.len() <= ROWS_MAX && matches!(reader.read_byte_record(&mut record), Ok(true)) {
        rows.push(record.iter().map(|cell| String::from_utf8_lossy(cell).into()).collect());
    }
    rows
}

/// How well the rows fall into columns: the more columns the better, where rows agree on them with
/// each other and with the header.
fn fit(rows: &[Vec<String>]) -> f64 {
    let Some(width) = usual_width(rows).filter(|width| *width > 1) else { return 0.0 };
    let agree = rows.iter().filter(|row| row.len() == width).count();
    let of_header = if rows[0].len() == width { 1.0 } else { 0.05 };
    of_header * width as f64 * (agree as f64 / rows.len() as f64).powi(2)
}

/// The number of cells that most rows have.
fn usual_width(rows: &[Vec<String>]) -> Option<usize> {
    let mut widths: Vec<usize> = rows.iter().map(Vec::len).collect();
    widths.sort_unstable();
    widths.get(widths.len() / 2).copied()
}

/// The decimal mark: what stands within most of the numbers that have one.
fn decimal(rows: &[Vec<String>]) -> Option<u8> {
    let (mut commas, mut points) = (0, 0);
    for cell in rows.iter().flatten().map(|cell| cell.trim().as_bytes()) {
        let is_number = |mark| parse_cell(cell, mark).is_some();
        commas += usize::from(cell.contains(&b',') && is_number(b','));
        points += usize::from(cell.contains(&b'.') && is_number(b'.'));
    }
    match (commas, points) {
        (0, 0) => None,
        _ if commas > points => Some(b','),
        _ => Some(b'.'),
    }
}

fn judge_header(label: &str, rows: &[Vec<String>], decimal: Option<u8>) -> Result<(), GuessError> {
    let header = &rows[0];
    let refuse = |line, problem| Err(GuessError::new(Place::line(label, line), problem));
    let is_number = |cell: &String| {
        let cell = cell.trim();
        !cell.is_empty() && parse_cell(cell.as_bytes(), decimal.unwrap_or(b'.')).is_some()
    };
    let Some(second) = rows.get(1) else {
        return Err(Place::whole(label).problem(Problem::NoRows).into());
    };
    if header.iter().any(is_number) && header.iter().all(|it| is_number(it) || it.trim().is_empty())
    {
        let found = header[0].trim().to_string();
        return refuse(1, GuessProblem::NoNames { found });
    }
    let usual = usual_width(&rows[1..]).unwrap_or(0);
    if header.len() < usual {
        let (found, usual) = (header.len(), usual);
        return refuse(1, GuessProblem::LinesAbove { found, usual });
    }
    let filled: Vec<&String> = second.iter().filter(|cell| !cell.trim().is_empty()).collect();
    let strip = |cell: &str| cell.trim().trim_matches(['[', ']', '(', ')']).to_string();
    let units = filled.iter().filter(|cell| spelling::is_unit(&strip(cell))).count();
    if units > 0 && 2 * units >= filled.len() && !filled.iter().any(|cell| is_number(cell)) {
        return refuse(2, GuessProblem::UnitsLine { found: filled[0].trim().into() });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> (char, Option<char>, usize) {
        let layout = layout("a.csv", text).unwrap();
        let decimal = layout.decimal.map(char::from);
        (char::from(layout.delimiter), decimal, layout.header.len())
    }

    fn refusal(text: &str) -> String {
        layout("a.csv", text).unwrap_err().to_string()
    }

    #[test]
    fn delimiter_and_decimal_mark_are_told_apart() {
        assert_eq!(told("t,v\n0,1.5\n1,2.5\n"), (',', Some('.'), 2));
        assert_eq!(told("t;v\n0;1,5\n1;2,5\n"), (';', Some(','), 2));
        assert_eq!(told("t;v\n0,5;1,5\n1;2,5\n"), (';', Some(','), 2));
        assert_eq!(told("t\tv\tF\n0\t1\t3\n"), ('\t', None, 3));
        assert_eq!(told("t|v\n0|1.5\n"), ('|', Some('.'), 2));
        assert_eq!(told("t,v\n\"0,5\",\"1,5\"\n"), (',', Some(','), 2));
        assert_eq!(told("\u{feff}t;v, measured\n0;1.0\n"), (';', Some('.'), 2));
        assert_eq!(told("t,v,note\n0,1.5,\"a;b\"\n1,1.5,\"c;d\"\n"), (',', Some('.'), 3));
    }

    #[test]
    fn what_has_no_header_or_no_rows_is_refused_with_its_line() {
        assert!(refusal("").contains("a.csv: expected a header line"));
        assert!(refusal("\n\n").contains("expected a header line"));
        assert!(refusal("t,v\n").contains("a.csv: expected rows of values below the header"));
        assert!(refusal("hello\nworld\n").starts_with("a.csv:1: expected names of columns"));
        assert!(refusal("0,1\n1,2\n").starts_with("a.csv:1: expected names of columns, found '0'"));
        let message = refusal("Recorder X,v2\nt,v,F\n0,1,2\n1,2,3\n2,3,4\n");
        assert!(message.contains("2 cells") && message.contains("3"), "{message}");
        let message = refusal("t,v\ns,km/h\n0,1\n");
        assert!(message.starts_with("a.csv:2: expected values, found units ('s')"), "{message}");
    }
}
