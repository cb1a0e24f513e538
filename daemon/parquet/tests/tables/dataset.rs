//! Parquet files of any program in place of CSV.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, BooleanArray, Decimal128Array, DictionaryArray, DurationMillisecondArray,
    Float32Array, Float64Array, Int16Array, Int32Array, RecordBatch, StringArray,
    Time32MillisecondArray, TimestampMicrosecondArray, UInt64Array,
};
use dynocar_analysis::dataset::text_layout::TrainRows;
use dynocar_analysis::dataset::{
    ColumnMapping, Dataset, DatasetFiles, FileProblem, MANIFEST_FILE, Manifest, formats,
};
use dynocar_dataset::{RunColumn, RunContent};
use dynocar_model::units::{Dimension, Unit};
use dynocar_parquet::columns::{columns_of, columns_of_bytes};

use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;

use crate::support::{TRAIN, shared, table};

/// Columns that are wanted, with their units.
fn wanted(columns: &[(&str, &str)]) -> Vec<ColumnMapping> {
    let mapping = |(column, unit): &(&str, &str)| {
        let dimensions = [Dimension::Time, Dimension::Speed, Dimension::Force, Dimension::Count];
        let mut units = dimensions.into_iter().filter_map(|it| Unit::find(it, unit));
        ColumnMapping { unit: units.next().expect(unit), ..ColumnMapping::of_time(column) }
    };
    columns.iter().map(mapping).collect()
}

fn read(path: &Path, columns: &[(&str, &str)]) -> Vec<RunColumn> {
    let found = columns_of(path, &wanted(columns), &TrainRows::All).unwrap();
    let bytes = std::fs::read(path).unwrap();
    let again = columns_of_bytes(bytes, &wanted(columns), &TrainRows::All).unwrap();
    assert_eq!(format!("{found:?}"), format!("{again:?}"));
    found.columns
}

/// The numbers of one column, `None` where missing.
fn numbers(columns: &[RunColumn], name: &str) -> Vec<Option<f64>> {
    let column = columns.iter().find(|it| it.name == name).expect(name);
    let values = column.values.as_ref().expect(name).iter();
    values.map(|&it| (!it.is_nan()).then_some(it)).collect()
}

#[test]
fn numbers_truths_and_times_of_every_kind_become_numbers_and_what_is_missing_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.parquet");
    let at = vec![Some(1_700_000_000_000_001), Some(1_700_000_000_500_000), None];
    let keys = Int32Array::from(vec![Some(0), None, Some(0)]);
    let repeated = DictionaryArray::new(keys, shared(Float64Array::from(vec![2.5])));
    let decimals = Decimal128Array::from(vec![Some(-1234), Some(5), None]);
    table(
        &path,
        vec![
            ("at", shared(TimestampMicrosecondArray::from(at).with_timezone("+02:00"))),
            ("since", shared(DurationMillisecondArray::from(vec![-1500, 0, 250]))),
            ("clock", shared(Time32MillisecondArray::from(vec![1, 86_399_999, 0]))),
            ("note", shared(StringArray::from(vec!["a", "b", "c"]))),
            ("v, km/h", shared(Float32Array::from(vec![Some(0.1), None, Some(f32::NAN)]))),
            ("force", shared(Int16Array::from(vec![-3, 0, 7]))),
            ("slides", shared(BooleanArray::from(vec![Some(true), Some(false), None]))),
            ("big", shared(UInt64Array::from(vec![u64::MAX, 0, 1]))),
            ("again", shared(repeated)),
            ("dec", shared(decimals.with_precision_and_scale(9, 2).unwrap())),
        ],
    );
    let some = |values: [f64; 3]| values.map(Some);
    let cases = [
        ("at", "s", [Some(1_700_000_000.000_001), Some(1_700_000_000.5), None]),
        ("since", "ms", some([-1500.0, 0.0, 250.0])),
        ("clock", "s", some([0.001, 86_399.999, 0.0])),
        // As the file means it: a tenth, not the nearest number of 32 bits.
        ("v, km/h", "km/h", [Some(0.1), None, None]),
        ("force", "kN", some([-3.0, 0.0, 7.0])),
        ("slides", "1", [Some(1.0), Some(0.0), None]),
        ("big", "1", some([u64::MAX as f64, 0.0, 1.0])),
        ("again", "kN", [Some(2.5), None, Some(2.5)]),
        ("dec", "1", [Some(-12.34), Some(0.05), None]),
    ];
    let all = read(&path, &cases.map(|(name, unit, _)| (name, unit)));
    for (name, _, expected) in cases {
        assert_eq!(numbers(&all, name), expected, "{name}");
    }
    assert!(all.iter().any(|it| it.name == "note" && it.values.is_none()));
    // Times are returned in the declared unit, independent of the unit in the file.
    assert_eq!(numbers(&read(&path, &[("since", "s")]), "since"), some([-1.5, 0.0, 0.25]));
    let without = read(&path, &[("speed", "m/s"), ("force", "kN")]);
    assert!(without.iter().all(|it| it.values.is_none()), "the names state the choices");
    assert_eq!(without.len(), 10);
}

/// The demo's files, its runs as Parquet.
struct AsParquet {
    folder: PathBuf,
    tables: PathBuf,
}

impl DatasetFiles for AsParquet {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        let text = std::fs::read_to_string(self.folder.join(path)).unwrap();
        // Marks of CSV do not concern Parquet.
        let text = text.replace(".csv\"", ".parquet\"");
        Ok(text.replace("[dataset]\n", "[dataset]\ndelimiter = \";\"\ndecimal = \",\"\n"))
    }

    fn read_run(&self, path: &str, manifest: &Manifest) -> Result<RunContent, FileProblem> {
        assert!(formats::PARQUET.is_of(path));
        let columns = columns_of(&self.tables.join(path), &manifest.columns, &TrainRows::All);
        Ok(RunContent::Columns(columns.unwrap()))
    }
}

#[test]
fn a_dataset_of_parquet_files_is_read_as_one_of_csv() {
    let folder = tempfile::tempdir().unwrap();
    let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/demo");
    std::fs::create_dir(folder.path().join("runs")).unwrap();
    for number in [1, 2, 3, 6] {
        let mut reader = csv::Reader::from_path(demo.join(format!("runs/0{number}.csv"))).unwrap();
        let names: Vec<String> = reader.headers().unwrap().iter().map(Into::into).collect();
        let mut columns = vec![Vec::new(); names.len()];
        for record in reader.records() {
            for (column, cell) in columns.iter_mut().zip(record.unwrap().iter()) {
                column.push(cell.parse::<f64>().ok());
            }
        }
        let arrays = columns.into_iter().map(|it| Arc::new(Float64Array::from(it)) as ArrayRef);
        let named = names.iter().map(String::as_str).zip(arrays).collect();
        table(&folder.path().join(format!("runs/0{number}.parquet")), named);
    }
    let files = AsParquet { folder: demo.clone(), tables: folder.path().into() };
    let mut found = Dataset::load(&files).unwrap();
    let expected = dynocar::dataset::load(&demo).unwrap();
    for run in &mut found.runs {
        run.file = run.file.replace(".parquet", ".csv");
    }
    assert!(found == expected, "the same samples to the bit");
}

#[test]
fn columns_that_hold_no_numbers_are_named_with_what_they_hold() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.parquet");
    let list =
        arrow_array::ListArray::from_iter_primitive::<arrow_array::types::Float64Type, _, _>(vec![
            Some(vec![Some(1.0)]),
            None,
        ]);
    table(
        &path,
        vec![
            ("t", shared(TimestampMicrosecondArray::from(vec![0, 1]))),
            ("v", shared(list)),
            ("who", shared(StringArray::from(vec!["a", "b"]))),
        ],
    );
    let cases = [
        (["v", "m/s"], "column v: expected numbers, true and false, or times, found List(Float64)"),
        (["who", "s"], "column who: expected numbers, true and false, or times, found Utf8"),
        (["t", "m/s"], "column t: expected numbers in m/s, found Timestamp(µs)"),
    ];
    for ([column, unit], expected) in cases {
        let refused = columns_of(&path, &wanted(&[(column, unit)]), &TrainRows::All);
        assert_eq!(refused.unwrap_err().to_string(), expected);
    }
}

#[test]
fn every_compression_of_other_tools_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let values: Vec<f64> = (0..5000).map(|row| f64::from(row % 97) * 0.1).collect();
    for compression in [
        Compression::UNCOMPRESSED,
        Compression::SNAPPY,
        Compression::GZIP(Default::default()),
        Compression::BROTLI(Default::default()),
        Compression::LZ4,
        Compression::LZ4_RAW,
        Compression::ZSTD(Default::default()),
    ] {
        let path = folder.path().join("own.parquet");
        let array = shared(Float64Array::from(values.clone()));
        let batch = RecordBatch::try_from_iter([("v", array)]).unwrap();
        let set = WriterProperties::builder().set_compression(compression).build();
        let file = std::fs::File::create(&path).unwrap();
        let mut writer = ArrowWriter::try_new(file, batch.schema(), Some(set)).unwrap();
        writer.write(&batch).unwrap();
        writer.close().unwrap();
        let found = read(&path, &[("v", "m/s")]);
        assert!(found[0].values.as_ref() == Some(&values), "{compression:?}");
    }
}

#[test]
fn whose_the_rows_are_is_handed_over_of_texts_and_numbers_of_every_kind() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.parquet");
    let turns = |names: [&'static str; 2]| (0..60).map(move |row| names[row / 2 % 2]);
    let texts = |names| shared(StringArray::from_iter_values(turns(names)));
    let coded: DictionaryArray<Int32Type> =
        turns(["a", "b"]).enumerate().map(|(row, it)| (row != 1).then_some(it)).collect();
    let numbers = Int16Array::from_iter_values((0..60).map(|row| 7 + row % 3));
    let floats = Float64Array::from_iter((0..60).map(|row| (row != 1).then_some(7.0)));
    let by = |name: &str| TrainRows::Of { column: name.to_owned(), value: String::new() };
    for (name, column, rows, expected) in [
        ("vehicle_id", texts(["ice1", "re2"]), TrainRows::Unsaid, Some(["ice1", "ice1", "re2"])),
        ("Train", shared(coded), TrainRows::Unsaid, Some(["a", "", "b"])),
        (" unit no ", shared(numbers), TrainRows::Unsaid, Some(["7", "8", "9"])),
        ("Zug", shared(floats), TrainRows::Unsaid, Some(["7", "", "7"])),
        ("note", texts(["x", "y"]), TrainRows::Unsaid, None),
        ("note", texts(["x", "y"]), by("note"), Some(["x", "x", "y"])),
        ("train", texts(["x", "y"]), by("note"), None),
    ] {
        let v = shared(Float64Array::from_iter_values((0..60).map(f64::from)));
        table(&path, vec![("v", v), (name, column)]);
        for wants in [&[][..], &[("v", "m/s")]] {
            let found = columns_of(&path, &wanted(wants), &rows).unwrap();
            let trains = found.trains.as_ref();
            let cells = trains.map(|it| it.cells().take(3).collect::<Vec<_>>());
            assert_eq!(cells, expected.map(Vec::from), "{name}");
            assert!(trains.is_none_or(|it| it.rows.len() == 60 && it.name == name.trim()));
        }
    }
}

/// A dataset of one file of two trains.
struct OfTwoTrains {
    manifest: String,
    train: String,
    table: PathBuf,
}

impl DatasetFiles for OfTwoTrains {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        Ok(if path == MANIFEST_FILE { self.manifest.clone() } else { self.train.clone() })
    }

    fn read_run(&self, _path: &str, manifest: &Manifest) -> Result<RunContent, FileProblem> {
        let columns = columns_of(&self.table, &manifest.columns, &manifest.train_rows);
        Ok(RunContent::Columns(columns.unwrap()))
    }
}

#[test]
fn the_rows_of_one_train_are_chosen_of_a_table_of_several_in_any_order() {
    let folder = tempfile::tempdir().unwrap();
    let own = (0..200).map(|row| (f64::from(row) * 0.2, "ice1", f64::from(row) * 0.05));
    let other = (0..200).map(|row| (f64::from(row) * 0.2 + 0.1, "re2", 20.0));
    let one_after_the_other: Vec<(f64, &str, f64)> = own.chain(other).collect();
    let mut by_time = one_after_the_other.clone();
    by_time.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut backwards = by_time.clone();
    backwards.reverse();
    for (order, rows) in
        [("in turn", one_after_the_other), ("by time", by_time), ("backwards", backwards)]
    {
        let table_path = folder.path().join(format!("{order}.parquet"));
        let numbers = |of: fn(&(f64, &str, f64)) -> f64| {
            shared(Float64Array::from_iter_values(rows.iter().map(of)))
        };
        let trains = shared(StringArray::from_iter_values(rows.iter().map(|it| it.1)));
        let columns =
            vec![("t", numbers(|it| it.0)), ("vehicle_id", trains), ("v", numbers(|it| it.2))];
        table(&table_path, columns);
        let load = |rows: &str| {
            let manifest = format!(
                "[dataset]\nname = \"x\"\n[train]\nfile = \"train.toml\"\n{rows}\n[columns]\ntime = {{ column = \
                 \"t\", unit = \"s\" }}\nspeed = {{ column = \"v\", unit = \"m/s\" }}\n[[runs]]\nfile = \"a.parquet\"\n"
            );
            Dataset::load(&OfTwoTrains { manifest, train: TRAIN.into(), table: table_path.clone() })
        };
        let of = |column: &str, value: &str| {
            load(&format!("rows = {{ column = \"{column}\", value = \"{value}\" }}"))
        };
        let found = of("vehicle_id", "ice1").unwrap();
        let speeds = found.runs[0].samples.iter().map(|it| it.speed_mps);
        assert!(speeds.eq((0..200).map(|row| f64::from(row) * 0.05)), "{order}");
        let other = of("vehicle_id", "re2").unwrap();
        assert!(other.runs[0].samples.len() == 200, "{order}");
        assert!(other.runs[0].samples.iter().all(|it| it.speed_mps == 20.0), "{order}");
        for (found, words) in [
            (load(""), "of 2 trains, by column 'vehicle_id': "),
            (
                of("vehicle_id", "ice2"),
                "no row of train 'ice2' in column 'vehicle_id'; the rows are of 2 trains",
            ),
            (of("unit", "ice1"), "no column 'unit' for [train] rows"),
        ] {
            let message = found.unwrap_err().to_string();
            assert!(message.contains(words), "{order}: {message}");
        }
    }
}
