//! An open Parquet file: its columns, the cells of one column after the other, and reasons why it cannot be read.
//!
//! The library that reads Parquet takes some of a file's numbers for granted, and panics where a damaged file has
//! others. For us that is an error of the file like any other.

use std::any::Any;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

use dynocar_mcap::error::{AtPath, ReadProblem};
use parquet::column::reader::ColumnReaderImpl;
use parquet::data_type::DataType;
use parquet::file::metadata::KeyValue;
use parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};
use parquet::schema::types::Type;

use crate::column_type::{CellKind, ColumnType, is_list};
use crate::table::{Hint, hints};

pub use parquet::column::reader::ColumnReader;

/// Rows decoded at once: few enough that they stay in the processor's memory until they are taken.
const BATCH_ROWS: usize = 8192;
/// Rows for which room is made before they come: a file that promises more may be damaged.
const ROWS_RESERVED_MAX: usize = 1 << 24;

/// A Parquet file.
pub struct ParquetFile {
    reader: Box<dyn FileReader>,
    /// Its columns.
    pub columns: Vec<FileColumn>,
}

/// A column of a Parquet file.
#[derive(Clone, Debug)]
pub struct FileColumn {
    /// Its name.
    pub name: String,
    /// Its type.
    pub column_type: ColumnType,
    /// The type of the entries, where it holds lists of plain values.
    pub entries: Option<ColumnType>,
    /// The place of its values.
    leaf: usize,
}

/// A column in a part of a file's rows.
pub struct ColumnPart {
    /// Reads its values.
    pub reader: ColumnReader,
    /// The layout of its cells.
    pub cells: CellLayout,
}

/// Layout of the cells in a part of a column.
#[derive(Clone, Copy, Debug)]
pub struct CellLayout {
    rows: usize,
    /// The level of a value that is there.
    level: i16,
}

impl ParquetFile {
    /// Opens a file of anybody.
    ///
    /// # Errors
    ///
    /// When it is no Parquet.
    pub fn open(content: impl ChunkReader + 'static) -> Result<Self, TableProblem> {
        let reader = SerializedFileReader::new(content).map_err(TableProblem::not_parquet)?;
        let metadata = reader.metadata().file_metadata();
        let schema = metadata.schema_descr();
        let mut hints = hints(metadata.key_value_metadata().map_or(&[], |it| it));
        let fields = schema.root_schema().get_fields();
        // Another tool may have changed the columns and left the metadata.
        hints.resize(if hints.len() == fields.len() { fields.len() } else { 0 }, Hint::None);
        hints.resize(fields.len(), Hint::None);
        // A structure has several places of values, of which none is read.
        let of_leaf = |leaf| (schema.get_column_root_idx(leaf), leaf);
        let leaves: BTreeMap<usize, usize> = (0..schema.num_columns()).map(of_leaf).collect();
        let column = |(field, hint): (usize, Hint)| FileColumn {
            name: fields[field].name().to_owned(),
            column_type: ColumnType::from_field(&fields[field], Some(hint)),
            entries: entry_of(&fields[field]).map(|it| ColumnType::from_field(it, None)),
            leaf: leaves.get(&field).copied().unwrap_or(0),
        };
        let columns = hints.into_iter().enumerate().map(column).collect();
        Ok(ParquetFile { reader: Box::new(reader), columns })
    }

    /// Returns its metadata.
    pub fn key_values(&self) -> &[KeyValue] {
        self.reader.metadata().file_metadata().key_value_metadata().map_or(&[], |it| it)
    }

    /// Returns the number of its rows for which room may be made.
    pub fn rows_reserved(&self) -> usize {
        let rows = self.reader.metadata().file_metadata().num_rows();
        rows.try_into().unwrap_or(0).min(ROWS_RESERVED_MAX)
    }

    /// Reads a column, part of the rows after part.
    ///
    /// # Errors
    ///
    /// When the file is damaged, and as `take`.
    pub fn read(
        &self,
        column: &FileColumn,
        mut take: impl FnMut(ColumnPart) -> Result<(), TableProblem>,
    ) -> Result<(), TableProblem> {
        for index in 0..self.reader.num_row_groups() {
            let group = self.reader.get_row_group(index).map_err(TableProblem::not_parquet)?;
            let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            let level = group.metadata().column(column.leaf).column_descr().max_def_level();
            let reader = group.get_column_reader(column.leaf).map_err(TableProblem::not_parquet)?;
            take(ColumnPart { reader, cells: CellLayout { rows, level } })?;
        }
        Ok(())
    }
}

/// Returns the entries of a field that holds lists of plain values.
fn entry_of(field: &Type) -> Option<&Type> {
    let entries = if is_list(field) { only_field(field)? } else { return None };
    only_field(entries).filter(|it| it.is_primitive())
}

fn only_field(group: &Type) -> Option<&Type> {
    if !group.is_group() {
        return None;
    }
    let [only] = group.get_fields() else { return None };
    Some(only)
}

impl CellLayout {
    /// Takes each row's value, `None` where it is missing.
    ///
    /// # Errors
    ///
    /// When the file is damaged.
    pub fn each<T: DataType>(
        self,
        reader: ColumnReaderImpl<T>,
        mut take: impl FnMut(Option<&T::T>),
    ) -> Result<(), TableProblem> {
        self.batches(reader, |values, levels, _| {
            if levels.iter().all(|it| *it == self.level) {
                values.iter().for_each(|it| take(Some(it)));
            } else {
                let mut values = values.iter();
                for level in levels {
                    take(if *level == self.level { values.next() } else { None });
                }
            }
            Ok(())
        })
    }

    /// Takes each row's list of as many entries.
    ///
    /// # Errors
    ///
    /// When the file is damaged, or a list has other than `entries` entries.
    pub fn each_list<T: DataType>(
        self,
        reader: ColumnReaderImpl<T>,
        entries: usize,
        mut take: impl FnMut(&[T::T]),
    ) -> Result<(), TableProblem> {
        self.batches(reader, |values, levels, starts| {
            // Each list's first entry has the level 0.
            let is_whole =
                |it: &[i16]| it.len() == entries && it[0] == 0 && it[1..].iter().all(|it| *it > 0);
            if levels.len() != values.len() || !starts.chunks(entries).all(is_whole) {
                return Err(damaged(&format!("lists of other than {entries} entries")));
            }
            values.chunks(entries).for_each(&mut take);
            Ok(())
        })
    }

    fn batches<T: DataType>(
        self,
        mut reader: ColumnReaderImpl<T>,
        mut take: impl FnMut(&[T::T], &[i16], &[i16]) -> Result<(), TableProblem>,
    ) -> Result<(), TableProblem> {
        let (mut values, mut levels, mut starts) = (Vec::new(), Vec::new(), Vec::new());
        let mut rows = 0;
        loop {
            values.clear();
            levels.clear();
            starts.clear();
            let read = reader
                .read_records(BATCH_ROWS, Some(&mut levels), Some(&mut starts), &mut values)
                .map_err(TableProblem::not_parquet)?;
            if read.0 == 0 {
                break;
            }
            rows += read.0;
            take(&values, &levels, &starts)?;
        }
        if rows == self.rows {
            Ok(())
        } else {
            Err(damaged(&format!("{rows} of {} rows", self.rows)))
        }
    }
}

/// Returns the error of a file that holds something else than it says.
pub fn damaged(found: &str) -> TableProblem {
    TableProblem::NotParquet(format!("damaged: {found}"))
}

impl FileColumn {
    /// Returns the error of a column whose type is not the expected one.
    pub fn refused(&self, expected: impl Into<String>) -> TableProblem {
        TableProblem::OtherType {
            column: self.name.clone(),
            expected: expected.into(),
            found: self.column_type.words.clone(),
        }
    }

    /// Returns whether its values are of a kind.
    pub fn is(&self, kind: CellKind) -> bool {
        self.column_type.kind == kind
    }
}

/// Why a Parquet file, or a folder of them, cannot be read.
pub type ParquetFileError = AtPath<TableProblem>;

/// Errors of a Parquet file.
#[derive(Debug, thiserror::Error)]
pub enum TableProblem {
    /// The system does not give the file.
    #[error(transparent)]
    Unreadable(#[from] std::io::Error),
    /// The file is of another format, or broken.
    #[error("not a Parquet file that can be read: {0}")]
    NotParquet(String),
    /// The file is Parquet, but not written by Dynocar.
    #[error(
        "not a recording: expected Parquet that `dynocar convert` has written; other Parquet files are \
         the runs of a dataset, named in its dataset.toml"
    )]
    NotOurs,
    /// A column is not there.
    #[error("no column {column}: expected one of {expected}")]
    NoColumn {
        /// Its name.
        column: String,
        /// Its type.
        expected: String,
    },
    /// A column holds something else.
    #[error("column {column}: expected {expected}, found {found}")]
    OtherType {
        /// The column.
        column: String,
        /// Expected type or value.
        expected: String,
        /// Type or value in the file.
        found: String,
    },
    /// A value is missing that never is.
    #[error("column {column}, row {row}: expected a value, found none")]
    NoValue {
        /// The column.
        column: String,
        /// The row, counted from 1.
        row: usize,
    },
    /// The contents are not a readable recording.
    #[error(transparent)]
    Recording(#[from] ReadProblem),
}

impl TableProblem {
    /// Returns the error of a file that is not readable Parquet.
    pub fn not_parquet(problem: impl std::fmt::Display) -> Self {
        // The library's message is a sentence, some with its own title.
        let problem = problem.to_string();
        TableProblem::NotParquet(problem.trim_start_matches("Parquet argument error: ").to_owned())
    }
}

thread_local! {
    /// True while this thread reads a file: then a panic is no news.
    static IS_READING: Cell<bool> = const { Cell::new(false) };
}

/// Reads a file; a panic of the library is reported as an error of the file.
///
/// # Errors
///
/// As the work, and where the file makes the library panic.
pub fn guarded<T>(work: impl FnOnce() -> Result<T, TableProblem>) -> Result<T, TableProblem> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let former_hook = take_hook();
        set_hook(Box::new(move |panic| {
            if !IS_READING.get() {
                former_hook(panic);
            }
        }));
    });
    IS_READING.set(true);
    // Half-done work is dropped with the error.
    let done = catch_unwind(AssertUnwindSafe(work));
    IS_READING.set(false);
    done.unwrap_or_else(|panic| {
        Err(TableProblem::NotParquet(format!("damaged: {}", words(panic.as_ref()))))
    })
}

fn words(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("unreadable")
}
