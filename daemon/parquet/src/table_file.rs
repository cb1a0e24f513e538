//! A file of a table while it is written, one part of the rows after the other.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use dynocar_mcap::columns::RecordingColumn;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int32Type, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};

use crate::table::{encoded, file_schema};

/// Cells of a column, row after row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    /// Numbers as words, as many for each row as a list has entries; 0 for missing ones.
    pub words: Vec<u64>,
    /// The texts or byte strings that are not missing, for a column of these.
    pub bytes: Vec<ByteArray>,
    /// Whether a row has a value.
    pub is_there: Vec<bool>,
}

impl Cells {
    /// Adds a row with a word.
    pub fn put_word(&mut self, word: u64) {
        self.words.push(word);
        self.is_there.push(true);
    }

    /// Adds a row with bytes.
    pub fn put_bytes(&mut self, bytes: Option<&[u8]>) {
        self.bytes.extend(bytes.map(ByteArray::from));
        self.is_there.push(bytes.is_some());
    }
}

/// A file of a table.
pub struct TableFile {
    columns: Vec<RecordingColumn>,
    writer: SerializedFileWriter<File>,
}

impl TableFile {
    /// Begins a new file; `said` are its metadata.
    ///
    /// # Errors
    ///
    /// When it cannot be written, or is there already.
    pub fn create(
        path: &Path,
        columns: Vec<RecordingColumn>,
        mut said: Vec<KeyValue>,
    ) -> Result<Self, ParquetError> {
        said.push(encoded(&columns));
        let properties = Arc::new(properties(&columns, said));
        let file = File::create_new(path)?;
        let writer = SerializedFileWriter::new(file, file_schema(&columns)?, properties)?;
        Ok(TableFile { columns, writer })
    }

    /// Adds rows.
    ///
    /// # Errors
    ///
    /// When they cannot be written.
    pub fn write(&mut self, cells: Vec<Cells>) -> Result<(), ParquetError> {
        if cells.iter().all(|it| it.is_there.is_empty()) {
            return Ok(());
        }
        let mut part = self.writer.next_row_group()?;
        for (column, cells) in self.columns.iter().zip(cells) {
            let Some(writer) = part.next_column()? else { break };
            write_column(column, &cells, writer)?;
        }
        part.close()?;
        Ok(())
    }

    /// Adds to the metadata.
    pub fn say(&mut self, said: KeyValue) {
        self.writer.append_key_value_metadata(said);
    }

    /// Ends the file.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn finish(self) -> Result<(), ParquetError> {
        self.writer.close().map(|_| ())
    }
}

fn write_column(
    column: &RecordingColumn,
    cells: &Cells,
    writer: SerializedColumnWriter,
) -> Result<(), ParquetError> {
    match column.type_name {
        "string" | "bytes" => put::<ByteArrayType>(column, &cells.is_there, &cells.bytes, writer),
        "f64" => put_words::<DoubleType>(column, cells, f64::from_bits, writer),
        "time" | "i64" | "u64" => put_words::<Int64Type>(column, cells, u64::cast_signed, writer),
        _ => put_words::<Int32Type>(column, cells, |it| it as i32, writer),
    }
}

/// Writes the words that are there as numbers.
fn put_words<T: DataType>(
    column: &RecordingColumn,
    cells: &Cells,
    number: impl Fn(u64) -> T::T,
    writer: SerializedColumnWriter,
) -> Result<(), ParquetError> {
    let rows = cells.words.chunks(column.list.unwrap_or(1)).zip(&cells.is_there);
    let numbers: Vec<T::T> =
        rows.filter(|it| *it.1).flat_map(|it| it.0).map(|&it| number(it)).collect();
    put::<T>(column, &cells.is_there, &numbers, writer)
}

fn put<T: DataType>(
    column: &RecordingColumn,
    is_there: &[bool],
    values: &[T::T],
    mut writer: SerializedColumnWriter,
) -> Result<(), ParquetError> {
    let (levels, starts) = match column.list {
        Some(entries) => {
            // Each list's first entry begins a row.
            let start = |index| i16::from(index % entries != 0);
            (Some(vec![1; values.len()]), Some((0..values.len()).map(start).collect::<Vec<_>>()))
        }
        None if column.is_nullable => {
            (Some(is_there.iter().map(|it| (*it).into()).collect()), None)
        }
        None => (None, None),
    };
    writer.typed::<T>().write_batch(values, levels.as_deref(), starts.as_deref())?;
    writer.close()
}

/// Returns the numbers by their differences or by their bytes: dictionaries take numbers for the same that are equal
/// but not the same to the bit.
fn properties(columns: &[RecordingColumn], said: Vec<KeyValue>) -> WriterProperties {
    let mut builder = WriterProperties::builder()
        .set_key_value_metadata(Some(said))
        .set_dictionary_enabled(false)
        .set_compression(Compression::ZSTD(ZstdLevel::default()));
    for column in columns {
        let encoding = match column.type_name {
            "string" | "bytes" => continue,
            _ if column.list.is_some() => continue,
            "f64" => Encoding::BYTE_STREAM_SPLIT,
            _ => Encoding::DELTA_BINARY_PACKED,
        };
        builder = builder.set_column_encoding(column.name.as_str().into(), encoding);
    }
    builder.build()
}
