//! A file that is not a recording in Parquet is refused by name, with the expected contents.

use std::fs::File;
use std::path::Path;

use arrow_array::{Array, ArrayRef, Float64Array, RecordBatch, StringArray};
use arrow_schema::DataType;
use dynocar_mcap::columns::RecordingRow;
use dynocar_parquet::reading::read;
use dynocar_parquet::writing::write_folder;
use dynocar_shared::{SampleField, TrainId, TrainSample};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use proptest::prelude::*;

use crate::support::{command, shared, table, write};

/// Returns the message of every command for a wrong path.
fn refusal(path: &Path) -> String {
    let (shown, out) = (path.display().to_string(), path.with_extension("out"));
    let out = out.display().to_string();
    let mut printed = String::new();
    for arguments in [&["convert", &shown, "-o", &out][..], &["verify", &shown]] {
        let status;
        (printed, status) = command(arguments).unwrap_err();
        assert_eq!(status, 2, "{arguments:?}: {printed}");
        assert!(printed.starts_with(&shown), "{printed}");
        assert!(!Path::new(&out).exists());
    }
    printed
}

fn recording(folder: &Path) -> std::path::PathBuf {
    let sample = TrainSample::empty(TrainId(1)).with(SampleField::Speed, 3.0);
    let messages: Vec<(u64, RecordingRow)> =
        (0..50).map(|it| (it, RecordingRow::Sample(sample))).collect();
    write(&folder.join("run.mcap"), &messages);
    write_folder(&[folder.join("run.mcap")], &folder.join("run.parquet")).unwrap();
    folder.join("run.parquet/samples-1.parquet")
}

#[test]
fn other_formats_broken_files_and_tables_of_others_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let whole = std::fs::read(recording(folder.path())).unwrap();
    std::fs::create_dir(at("empty.parquet")).unwrap();
    table(&at("own.parquet"), vec![("t", shared(Float64Array::from(vec![1.0])))]);
    let cases: [(&str, Option<&[u8]>, &str); 7] = [
        ("text.parquet", Some(b"time_s,speed_mps\n0,1\n"), "not a Parquet file that can be read"),
        ("nothing.parquet", Some(b""), "not a Parquet file that can be read"),
        ("cut.parquet", Some(&whole[..whole.len() / 2]), "not a Parquet file that can be read"),
        ("gone.parquet", None, "No such file"),
        (
            "empty.parquet",
            None,
            "not a recording: expected Parquet that `dynocar convert` has written",
        ),
        (
            "own.parquet",
            None,
            "not a recording: expected Parquet that `dynocar convert` has written",
        ),
        ("folder.parquet", None, "folder.parquet/b.parquet: not a recording"),
    ];
    std::fs::create_dir(at("folder.parquet")).unwrap();
    std::fs::write(at("folder.parquet/a.parquet"), &whole).unwrap();
    std::fs::copy(at("own.parquet"), at("folder.parquet/b.parquet")).unwrap();
    for (name, content, expected) in cases {
        if let Some(content) = content {
            std::fs::write(at(name), content).unwrap();
        }
        let printed = refusal(&at(name));
        assert!(printed.contains(expected), "{printed}");
    }
}

/// Writes a table of samples with one column replaced or left out; `layout` is the layout that it states.
fn altered(path: &Path, from: &Path, column: &str, other: Option<ArrayRef>, layout: Option<&str>) {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(from).unwrap()).unwrap();
    let said = builder.metadata().file_metadata().key_value_metadata().cloned().unwrap();
    let batch = builder.build().unwrap().next().unwrap().unwrap();
    let schema = batch.schema();
    let columns =
        schema.fields().iter().zip(batch.columns()).filter_map(|(field, array)| match &other {
            Some(other) if field.name() == column => Some((field.name().clone(), other.clone())),
            None if field.name() == column => None,
            _ => Some((field.name().clone(), array.clone())),
        });
    let batch = RecordBatch::try_from_iter(columns.collect::<Vec<_>>()).unwrap();
    let said: Vec<KeyValue> = said
        .into_iter()
        .filter(|it| it.key != "ARROW:schema")
        .map(|mut it| {
            if let (true, Some(layout)) = (it.key == "dynocar.layout", layout) {
                it.value = Some(layout.to_owned());
            }
            it
        })
        .collect();
    let properties = WriterProperties::builder().set_key_value_metadata(Some(said)).build();
    let file = File::create(path).unwrap();
    let mut writer = ArrowWriter::try_new(file, batch.schema(), Some(properties)).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
}

#[test]
fn a_table_of_another_release_or_without_a_column_or_with_another_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let from = recording(folder.path());
    let path = folder.path().join("altered.parquet");
    let shown = path.display().to_string();
    let rows = 50;
    let texts = shared(StringArray::from(vec!["x"; rows]));
    let nulls: ArrayRef = arrow_array::new_null_array(&DataType::Int64, rows);
    assert!(nulls.is_null(0));
    let cases = [
        ("speed_mps", Some(texts), None, "column speed_mps: expected Float64, found Utf8"),
        ("speed_mps", None, None, "no column speed_mps: expected one of Float64"),
        ("time_ns", Some(nulls), None, "column time_ns, row 1: expected a value, found none"),
        (
            "",
            None,
            Some("dynocar.TrainSample.0123456789abcdef"),
            "samples: recorded with another schema: expected dynocar.TrainSample.",
        ),
    ];
    for (column, other, layout, expected) in cases {
        altered(&path, &from, column, other, layout);
        let printed = refusal(&path);
        assert!(printed.contains(&format!("{shown}: {expected}")), "{printed}");
    }
    altered(&path, &from, "", None, None);
    assert_eq!(read(&path).unwrap().messages.len(), rows, "else it is read");
}

#[test]
fn nothing_is_overwritten_and_no_format_is_converted_into_itself() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path());
    let shown = |name: &str| folder.path().join(name).display().to_string();
    let cases = [
        ("run.mcap", "run.parquet", "exists already"),
        ("run.parquet", "other.parquet", "it is Parquet already"),
        ("run.mcap", "other.mcap", "it is MCAP already"),
        ("run.parquet", "run.mcap", "exists already"),
    ];
    for (from, to, expected) in cases {
        let (words, status) = command(&["convert", &shown(from), "-o", &shown(to)]).unwrap_err();
        assert_eq!(status, 2, "{from} to {to}");
        assert!(words.contains(expected), "{words}");
    }
}

#[test]
fn a_folder_is_all_there_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path());
    let (mcap, out) = (folder.path().join("run.mcap"), folder.path().join("no/such.parquet"));
    let words = ["convert", mcap.to_str().unwrap(), "-o", out.to_str().unwrap()];
    let (words, status) = command(&words).unwrap_err();
    assert_eq!(status, 1, "{words}");
    assert!(words.contains("such.parquet: cannot be written"), "{words}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn damaged_bytes_make_no_reader_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        thread_local! {
            static WHOLE: Vec<u8> = {
                let folder = tempfile::tempdir().unwrap();
                std::fs::read(recording(folder.path())).unwrap()
            };
        }
        let mut bytes = WHOLE.with(Clone::clone);
        for (place, byte) in changes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("damaged.parquet");
        std::fs::write(&path, &bytes).unwrap();
        let _ = read(&path);
    }
}

#[test]
fn a_file_whose_end_is_damaged_anywhere_is_refused_or_read_and_nothing_panics() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(recording(folder.path())).unwrap();
    let path = folder.path().join("damaged.parquet");
    let mut refused = 0;
    // The footer: it lists the positions of all parts, and the library takes some of its numbers for granted.
    for index in whole.len().saturating_sub(3000)..whole.len() {
        let mut bytes = whole.clone();
        bytes[index] ^= 0x95;
        std::fs::write(&path, &bytes).unwrap();
        refused += usize::from(read(&path).is_err());
    }
    assert!(refused > 300, "{refused}");
}
