//! Parquet files of anybody in place of CSV.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, BooleanArray, Decimal128Array, DictionaryArray, DurationMillisecondArray,
    Float32Array, Float64Array, Int16Array, RecordBatch, StringArray, Time32MillisecondArray,
    TimestampMicrosecondArray, UInt64Array,
};
use dynocar::columns_stream;
use dynocar::programs::ErrorDocument;
use dynocar_analysis::dataset::{Dataset, DatasetFiles, FileProblem, Manifest, is_parquet};
use dynocar_dataset::{RunColumn, RunContent};
use dynocar_parquet::numbers::{Wanted, send_columns};

use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;

use crate::support::{program, shared, table};

fn read(path: &Path, wanted: &[(&str, &str)]) -> Vec<RunColumn> {
    let wanted = wanted.iter().map(|it| Wanted { column: it.0.into(), unit: it.1.into() });
    let mut bytes = Vec::new();
    send_columns(path, &wanted.collect::<Vec<_>>(), &mut bytes).unwrap().unwrap();
    columns_stream::read(&bytes[..]).unwrap()
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
        ("dec", "1", [Some(-12.34), Some(0.05), None]),
    ];
    let all = read(&path, &cases.map(|(name, unit, _)| (name, unit)));
    for (name, _, expected) in cases {
        assert_eq!(numbers(&all, name), expected, "{name}");
    }
    assert!(all.iter().any(|it| it.name == "note" && it.values.is_none()));
    // Times are given in the unit that is declared, whatever the file counts in.
    assert_eq!(numbers(&read(&path, &[("since", "s")]), "since"), some([-1.5, 0.0, 0.25]));
    let without = read(&path, &[("speed", "m/s"), ("force", "kN")]);
    assert!(without.iter().all(|it| it.values.is_none()), "the names state the choices");
    assert_eq!(without.len(), 9);
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
        assert!(is_parquet(path));
        let columns = manifest.columns.iter();
        let pairs: Vec<_> = columns.map(|it| (it.column.as_str(), it.unit.name())).collect();
        Ok(RunContent::Columns(read(&self.tables.join(path), &pairs)))
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
    let shown = path.display().to_string();
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
        let output = program(&["columns", &shown, "--column", column, unit, "--json", "-"]);
        assert_eq!(output.status.code(), Some(2));
        let answer: ErrorDocument = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!((answer.error.message.as_str(), answer.error.exit_status), (expected, 2));
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
fn rows_of_several_trains_in_turn_are_refused_with_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.parquet");
    let shown = path.display().to_string();
    let turns = |names: [&'static str; 2]| (0..60).map(move |row| names[row / 2 % 2]);
    let texts = |names| shared(StringArray::from_iter_values(turns(names)));
    let coded: DictionaryArray<Int32Type> = turns(["a", "b"]).collect();
    let numbers = Int16Array::from_iter_values((0..60).map(|row| 7 + row % 3));
    let changed =
        StringArray::from_iter_values((0..60).map(|row| if row < 30 { "1" } else { "2" }));
    for (name, column, expected) in [
        (
            "vehicle_id",
            texts(["ice1", "re2"]),
            Some("of 2 trains, by column 'vehicle_id': 'ice1', 're2'"),
        ),
        ("Train", shared(coded), Some("of 2 trains, by column 'Train': 'a', 'b'")),
        ("unit no", shared(numbers), Some("of 3 trains, by column 'unit no': '7', '8', '9'")),
        ("note", texts(["x", "y"]), None),
        ("vehicle_id", texts(["ice1", "ice1"]), None),
        ("train number", shared(changed), None),
    ] {
        let v = shared(Float64Array::from_iter_values((0..60).map(f64::from)));
        table(&path, vec![("v", v), (name, column)]);
        let output = program(&["columns", &shown, "--of-one-train", "--column", "v", "m/s"]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        match expected {
            Some(words) => {
                assert!(output.status.code() == Some(2) && said.contains(words), "{said}")
            }
            None => assert!(output.status.success(), "{name}: {said}"),
        }
    }
}
