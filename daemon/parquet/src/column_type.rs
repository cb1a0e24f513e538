//! Types of the columns of a Parquet file, in Arrow's terms, determined by the file's own schema and by Arrow's, which
//! programs that use Arrow leave in the file.

use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type as PhysicalType};
use parquet::schema::types::Type;

use crate::table::Hint;

/// Kind of a column's cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellKind {
    /// True or false.
    Truth,
    /// Whole numbers.
    Integer {
        /// False where they are never negative.
        is_signed: bool,
    },
    /// Numbers in floating point.
    Float,
    /// Decimal numbers.
    Decimal {
        /// Digits after the point.
        scale: i32,
    },
    /// Times.
    Time {
        /// Times in a second.
        per_second: u64,
    },
    /// Texts.
    Text,
    /// Nothing: every value is missing.
    Nothing,
    /// Something else.
    Other,
}

/// Type of a column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnType {
    /// Its kind.
    pub kind: CellKind,
    /// Its name, as Arrow has it.
    pub words: String,
}

impl ColumnType {
    fn new(kind: CellKind, words: impl Into<String>) -> Self {
        ColumnType { kind, words: words.into() }
    }

    fn time(name: &str, per_second: u64, zone: &str) -> Self {
        let unit = match per_second {
            1 => "s",
            1_000 => "ms",
            1_000_000 => "µs",
            _ => "ns",
        };
        ColumnType::new(CellKind::Time { per_second }, format!("{name}({unit}{zone})"))
    }

    /// Returns the type of a field of a file's schema; `hint` is that of Arrow's schema.
    pub fn from_field(field: &Type, hint: Option<Hint>) -> Self {
        let info = field.get_basic_info();
        let is_repeated =
            info.has_repetition() && info.repetition() == parquet::basic::Repetition::REPEATED;
        match field {
            Type::GroupType { .. } => ColumnType::new(CellKind::Other, nested(field)),
            Type::PrimitiveType { .. } if is_repeated => ColumnType::new(
                CellKind::Other,
                format!("List(non-null {})", plain(field, None).words),
            ),
            Type::PrimitiveType { .. } => plain(field, hint),
        }
    }
}

/// Lists and structures in words.
fn nested(field: &Type) -> String {
    let words = |it: &Type| ColumnType::from_field(it, None).words;
    let fields = field.get_fields();
    if let (true, [list]) = (is_list(field), fields) {
        let entry = Some(list).filter(|it| it.is_group()).and_then(|it| it.get_fields().first());
        return format!("List({})", words(entry.unwrap_or(list)));
    }
    let fields: Vec<String> =
        fields.iter().map(|it| format!("{:?}: {}", it.name(), words(it))).collect();
    let is_map = field.get_basic_info().converted_type() == ConvertedType::MAP;
    format!("{}({})", if is_map { "Map" } else { "Struct" }, fields.join(", "))
}

/// Returns true for a list of entries.
pub fn is_list(field: &Type) -> bool {
    let info = field.get_basic_info();
    field.is_group()
        && (info.logical_type_ref() == Some(&LogicalType::List)
            || info.converted_type() == ConvertedType::LIST)
}

/// Returns the type of a primitive field.
fn plain(field: &Type, hint: Option<Hint>) -> ColumnType {
    use PhysicalType::{
        BOOLEAN, BYTE_ARRAY, DOUBLE, FIXED_LEN_BYTE_ARRAY, FLOAT, INT32, INT64, INT96,
    };
    let info = field.get_basic_info();
    let said = info.logical_type_ref().cloned().or_else(|| said_before(field));
    let physical = field.get_physical_type();
    let bits = if physical == INT32 { 32 } else { 64 };
    match (physical, said) {
        (_, Some(LogicalType::Unknown)) => ColumnType::new(CellKind::Nothing, "Null"),
        (BOOLEAN, _) => ColumnType::new(CellKind::Truth, "Boolean"),
        (FLOAT, _) => ColumnType::new(CellKind::Float, "Float32"),
        (DOUBLE, _) => ColumnType::new(CellKind::Float, "Float64"),
        (INT96, _) => ColumnType::time("Timestamp", 1_000_000_000, ""),
        (INT32 | INT64, Some(LogicalType::Integer(it))) => {
            let sign = if it.is_signed { "" } else { "U" };
            ColumnType::new(
                CellKind::Integer { is_signed: it.is_signed },
                format!("{sign}Int{}", it.bit_width),
            )
        }
        (_, Some(LogicalType::Decimal(it))) => {
            let bits = if it.precision > 38 { 256 } else { 128 };
            let words = format!("Decimal{bits}({}, {})", it.precision, it.scale);
            ColumnType::new(CellKind::Decimal { scale: it.scale }, words)
        }
        (INT32 | INT64, Some(LogicalType::Time(it))) => {
            ColumnType::time(&format!("Time{bits}"), per_second(it.unit), "")
        }
        (INT64, Some(LogicalType::Timestamp(it))) => {
            let zone = if it.is_adjusted_to_u_t_c { ", \"UTC\"" } else { "" };
            ColumnType::time("Timestamp", per_second(it.unit), zone)
        }
        (INT32, Some(LogicalType::Date)) => ColumnType::new(CellKind::Other, "Date32"),
        (INT32 | INT64, None) => match hint {
            Some(Hint::Time { name: "Time", per_second }) => {
                ColumnType::time(&format!("Time{bits}"), per_second, "")
            }
            Some(Hint::Time { name, per_second }) => ColumnType::time(name, per_second, ""),
            Some(Hint::Date) => ColumnType::new(CellKind::Other, "Date64"),
            _ => ColumnType::new(CellKind::Integer { is_signed: true }, format!("Int{bits}")),
        },
        (BYTE_ARRAY, Some(LogicalType::String | LogicalType::Json)) => {
            ColumnType::new(CellKind::Text, "Utf8")
        }
        (BYTE_ARRAY, _) if hint == Some(Hint::Text) => ColumnType::new(CellKind::Text, "Utf8"),
        (FIXED_LEN_BYTE_ARRAY, Some(LogicalType::Float16)) => {
            ColumnType::new(CellKind::Float, "Float16")
        }
        (FIXED_LEN_BYTE_ARRAY, _) if info.converted_type() == ConvertedType::INTERVAL => {
            ColumnType::new(CellKind::Other, "Interval(DayTime)")
        }
        (FIXED_LEN_BYTE_ARRAY, _) => ColumnType::new(CellKind::Other, "FixedSizeBinary"),
        _ => ColumnType::new(CellKind::Other, "Binary"),
    }
}

fn per_second(unit: TimeUnit) -> u64 {
    match unit {
        TimeUnit::MILLIS => 1_000,
        TimeUnit::MICROS => 1_000_000,
        TimeUnit::NANOS => 1_000_000_000,
    }
}

/// Returns the logical type of files from before there were some.
fn said_before(field: &Type) -> Option<LogicalType> {
    let integer = |bits, is_signed| LogicalType::integer(bits, is_signed);
    Some(match field.get_basic_info().converted_type() {
        ConvertedType::UTF8 => LogicalType::String,
        ConvertedType::JSON => LogicalType::Json,
        ConvertedType::DECIMAL => LogicalType::decimal(field.get_scale(), field.get_precision()),
        ConvertedType::DATE => LogicalType::Date,
        ConvertedType::TIME_MILLIS => LogicalType::time(true, TimeUnit::MILLIS),
        ConvertedType::TIME_MICROS => LogicalType::time(true, TimeUnit::MICROS),
        ConvertedType::TIMESTAMP_MILLIS => LogicalType::timestamp(true, TimeUnit::MILLIS),
        ConvertedType::TIMESTAMP_MICROS => LogicalType::timestamp(true, TimeUnit::MICROS),
        ConvertedType::UINT_8 => integer(8, false),
        ConvertedType::UINT_16 => integer(16, false),
        ConvertedType::UINT_32 => integer(32, false),
        ConvertedType::UINT_64 => integer(64, false),
        ConvertedType::INT_8 => integer(8, true),
        ConvertedType::INT_16 => integer(16, true),
        ConvertedType::INT_32 => integer(32, true),
        ConvertedType::INT_64 => integer(64, true),
        _ => return None,
    })
}
