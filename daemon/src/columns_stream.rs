//! Columns of numbers from one program to another: a line of JSON with every column's name and the number of
//! its values, then these values, column after column, each as eight bytes with the lowest first.

use std::io::{self, Write};

use dynocar_dataset::RunColumn;

/// Name and number of values of each column; `None` for one whose values are not handed over.
type Header = Vec<(String, Option<usize>)>;

/// Bytes of a value.
const BYTES: usize = size_of::<f64>();

/// Hands columns over.
///
/// # Errors
///
/// When the other side does not take them.
pub fn write(columns: &[RunColumn], mut output: impl Write) -> io::Result<()> {
    let header: Header =
        columns.iter().map(|it| (it.name.clone(), it.values.as_ref().map(Vec::len))).collect();
    serde_json::to_writer(&mut output, &header)?;
    output.write_all(b"\n")?;
    for value in columns.iter().filter_map(|it| it.values.as_ref()).flatten() {
        output.write_all(&value.to_le_bytes())?;
    }
    output.flush()
}

/// The columns that were handed over; `None` for bytes that are none.
pub fn read(bytes: &[u8]) -> Option<Vec<RunColumn>> {
    let end = bytes.iter().position(|&byte| byte == b'\n')?;
    let header: Header = serde_json::from_slice(&bytes[..end]).ok()?;
    let mut rest = &bytes[end + 1..];
    let mut columns = Vec::with_capacity(header.len());
    for (name, count) in header {
        let values = match count {
            None => None,
            Some(count) => {
                let (numbers, behind) = rest.split_at_checked(count.checked_mul(BYTES)?)?;
                rest = behind;
                Some(numbers.as_chunks().0.iter().map(|&it| f64::from_le_bytes(it)).collect())
            }
        };
        columns.push(RunColumn { name, values });
    }
    rest.is_empty().then_some(columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_arrive_to_the_bit_and_what_is_cut_off_does_not() {
        let column = |name: &str, values| RunColumn { name: name.into(), values };
        let columns = [
            column("v, \"km/h\"\n", Some(vec![0.1, -0.0, f64::MAX])),
            column("note", None),
            column("empty", Some(vec![])),
        ];
        let mut bytes = Vec::new();
        write(&columns, &mut bytes).unwrap();
        assert_eq!(read(&bytes).unwrap(), columns);
        for length in [0, 5, bytes.len() - 1] {
            assert_eq!(read(&bytes[..length]), None);
        }
        assert_eq!(read(&[&bytes[..], &[0]].concat()), None);
    }
}
