//! Columns of numbers from one program to another, rows after rows, so that neither waits for the other's last: a
//! line of JSON with the number of rows that are to come, every column's name, and the column that says whose the rows
//! are; then blocks. A block is the number of its rows and these rows' values, column after column, the trains last;
//! one without rows is the last. All numbers take eight bytes with the lowest first.

use std::io::{self, BufRead, Read, Write};

use dynocar_dataset::{RunColumn, RunColumns, TrainColumn};
use serde::{Deserialize, Serialize};

/// Rows and columns that are to come.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Number of rows.
    pub rows: usize,
    /// Each column's name, and whether it has values.
    pub columns: Vec<(String, bool)>,
    /// Name and trains of the column that says whose the rows are.
    pub trains: Option<(String, Vec<String>)>,
}

/// Bytes of a value.
const BYTES: usize = size_of::<f64>();
/// Bytes that are read at once.
const CHUNK: usize = 1 << 16;
/// Largest number of rows for which room is made before they come: a file that promises more may be damaged.
const ROWS_RESERVED_MAX: usize = 1 << 24;

/// Hands columns over.
#[derive(Debug)]
pub struct Sender<W> {
    output: W,
    block: Vec<u8>,
}

impl<W: Write> Sender<W> {
    /// Begins, with what is to come.
    ///
    /// # Errors
    ///
    /// When the other side does not take them.
    pub fn begin(header: &Header, mut output: W) -> io::Result<Self> {
        let mut line = serde_json::to_vec(&[header])?;
        line.push(b'\n');
        output.write_all(&line)?;
        Ok(Sender { output, block: Vec::new() })
    }

    /// Hands rows over: as many values for each column that has some, in the order of the columns, then the trains.
    ///
    /// # Errors
    ///
    /// When the other side does not take them.
    pub fn rows(&mut self, columns: &[Vec<f64>]) -> io::Result<()> {
        let rows = columns.first().map_or(0, Vec::len);
        if rows == 0 {
            return Ok(());
        }
        self.block.clear();
        self.block.extend_from_slice(&(rows as u64).to_le_bytes());
        for values in columns {
            let start = self.block.len();
            self.block.resize(start + values.len() * BYTES, 0);
            let places = self.block[start..].as_chunks_mut().0.iter_mut();
            places.zip(values).for_each(|(bytes, it)| *bytes = it.to_le_bytes());
        }
        self.output.write_all(&self.block)
    }

    /// Ends the columns; what follows is something else.
    ///
    /// # Errors
    ///
    /// When the other side does not take it.
    pub fn end(mut self) -> io::Result<()> {
        self.output.write_all(&0u64.to_le_bytes())?;
        self.output.flush()
    }
}

/// The columns that are handed over, and nothing of what follows them; `None` where none are, or not to their end.
pub fn read(mut input: impl BufRead) -> Option<RunColumns> {
    // Where something went wrong before, the input is a document that says so, which is left.
    if input.fill_buf().ok()?.first() != Some(&b'[') {
        return None;
    }
    let mut line = Vec::new();
    input.read_until(b'\n', &mut line).ok()?;
    let [Header { rows, columns, trains }] = serde_json::from_slice(&line).ok()?;
    let empty = |has_values: bool| {
        has_values.then(|| {
            let mut values = Vec::new();
            // Bytes that do not fit now are asked for again as they come.
            let _ = values.try_reserve_exact(rows.min(ROWS_RESERVED_MAX));
            values
        })
    };
    let columns = columns.into_iter();
    let mut columns: Vec<RunColumn> =
        columns.map(|(name, has_values)| RunColumn { name, values: empty(has_values) }).collect();
    let train_column = |(name, trains)| TrainColumn { name, trains, rows: Vec::new() };
    let mut trains: Option<TrainColumn> = trains.map(train_column);
    let mut chunk = vec![0; CHUNK];
    loop {
        let mut count = [0; BYTES];
        input.read_exact(&mut count).ok()?;
        let rows = usize::try_from(u64::from_le_bytes(count)).ok()?;
        if rows == 0 {
            return Some(RunColumns { columns, trains });
        }
        let values = columns.iter_mut().filter_map(|it| it.values.as_mut());
        for values in values.chain(trains.as_mut().map(|it| &mut it.rows)) {
            take(&mut input, rows, &mut chunk, values)?;
        }
    }
}

/// Takes `rows` values of a column; `None` where they end before.
fn take(input: &mut impl Read, rows: usize, chunk: &mut [u8], values: &mut Vec<f64>) -> Option<()> {
    let mut left = rows.checked_mul(BYTES)?;
    while left > 0 {
        let bytes = &mut chunk[..left.min(CHUNK)];
        input.read_exact(bytes).ok()?;
        left -= bytes.len();
        values.extend(bytes.as_chunks().0.iter().map(|&it| f64::from_le_bytes(it)));
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_arrive_to_the_bit_and_what_is_cut_off_does_not() {
        let names = [("v, \"km/h\"\n", true), ("note", false), ("more than a chunk", true)];
        let columns = names.map(|(name, has_values)| (name.to_owned(), has_values)).into();
        let trains = Some(("unit".to_owned(), vec!["a".to_owned(), "b".to_owned()]));
        let many: Vec<f64> = (0..20_000).map(|it| f64::from(it) * 0.1).collect();
        let mut bytes = Vec::new();
        let header = Header { rows: 3, columns, trains };
        let mut sender = Sender::begin(&header, &mut bytes).unwrap();
        let own = vec![0.0, f64::NAN, 1.0];
        sender.rows(&[vec![0.1, -0.0, f64::MAX], vec![1.0, f64::INFINITY, -1.0], own]).unwrap();
        sender.rows(&[vec![], vec![], vec![]]).unwrap();
        sender.rows(&[many.clone(), many.clone(), vec![1.0; many.len()]]).unwrap();
        sender.end().unwrap();
        bytes.extend(b"after");
        let mut rest = &bytes[..];
        let RunColumns { columns, trains } = read(&mut rest).unwrap();
        let cells: Vec<String> = trains.iter().flat_map(|it| it.cells()).map(Into::into).collect();
        assert_eq!(
            (cells.len(), &cells[..4]),
            (20_003, &["a", "", "b", "b"].map(String::from)[..])
        );
        assert_eq!(rest, b"after");
        let [first, note, last] = &columns[..] else { panic!("{} columns", columns.len()) };
        assert_eq!((first.name.as_str(), note.values.as_ref()), ("v, \"km/h\"\n", None));
        let values = |before: [f64; 3]| Some([&before[..], &many].concat());
        assert_eq!(first.values, values([0.1, -0.0, f64::MAX]));
        assert!(first.values.as_ref().unwrap()[1].is_sign_negative());
        assert_eq!(last.values, values([1.0, f64::INFINITY, -1.0]));
        for length in [0, 5, 70, bytes.len() - "after".len() - 1] {
            assert_eq!(read(&bytes[..length]), None);
        }
    }

    #[test]
    fn a_document_in_place_of_columns_is_left_as_it_is() {
        let mut input = &b"{\"error\": 1}"[..];
        assert_eq!(read(&mut input), None);
        assert_eq!(input, b"{\"error\": 1}");
    }
}
