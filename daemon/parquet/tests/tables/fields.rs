//! The Arrow schema, the columns and the page of the fields agree.

use arrow_schema::Schema;
use dynocar_mcap::columns::{EVENTS, RecordingColumn, RecordingRow, SAMPLES, SNAPSHOTS};
use dynocar_mcap::event::Event;
use dynocar_parquet::writing::write_folder;
use dynocar_shared::schema::{unit_end, unit_of};
use dynocar_shared::{ParameterSnapshot, RejectionReason, TrainId, TrainSample};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::support::write;

/// The schemas that Arrow reads of the files of samples, snapshots and events.
fn schemas() -> [Schema; 3] {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let sample = TrainSample::empty(TrainId(1));
    let snapshot = ParameterSnapshot { train_id: 1, ..ParameterSnapshot::empty() };
    let rows = [
        RecordingRow::Sample(sample),
        RecordingRow::Snapshot(snapshot.into()),
        RecordingRow::Event(Event::default()),
    ];
    write(&at("run.mcap"), &rows.map(|it| (1, it)));
    write_folder(&[at("run.mcap")], &at("run.parquet")).unwrap();
    ["samples-1", "snapshots-1-", "events"].map(|name| {
        let mut files = std::fs::read_dir(at("run.parquet")).unwrap().map(|it| it.unwrap().path());
        let is_it =
            |it: &std::path::PathBuf| it.file_name().unwrap().to_str().unwrap().starts_with(name);
        let file = std::fs::File::open(files.find(is_it).expect(name)).unwrap();
        let builder = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
        (**builder.schema()).clone()
    })
}

fn page() -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/recording_fields.md");
    std::fs::read_to_string(path).expect("the page")
}

/// Returns name and column of each row of a message's table on the page.
fn rows(page: &str, message: &str) -> Vec<[String; 2]> {
    let start = page.find(&format!("## `dynocar.{message}`")).expect("a table");
    let end = page[start + 1..].find("\n## ").map_or(page.len(), |it| start + 1 + it);
    let rows = page[start..end].lines().filter(|it| it.starts_with("| `"));
    rows.map(|row| {
        let cells: Vec<&str> = row.trim_matches('|').split(" | ").map(str::trim).collect();
        [cells[0].trim_matches('`').to_owned(), cells[1].into()]
    })
    .collect()
}

/// The columns of a parameter: as the page says, a word before the unit.
fn of_estimate(name: &str) -> Vec<String> {
    let (end, _) = unit_end(name);
    let stem = name.strip_suffix(end).expect("it ends with its unit");
    let words = ["", "_std", "_low", "_high"];
    words.iter().map(|word| format!("estimate_{stem}{word}{end}")).collect()
}

fn in_words(schema: &Schema, columns: &[RecordingColumn]) -> Vec<[String; 3]> {
    let said = |it: &arrow_schema::Field| {
        let null = if it.is_nullable() { ", null" } else { "" };
        let unit = it.metadata().get("unit").cloned().unwrap_or_default();
        [it.name().clone(), format!("{}{null}", it.data_type()), unit]
    };
    assert_eq!(schema.fields().len(), columns.len());
    schema.fields().iter().skip(2).map(|it| said(it)).collect()
}

#[test]
fn the_page_shows_the_arrow_type_of_every_column_and_the_schema_has_them_all() {
    let page = page();
    let tables = [
        (&*SAMPLES, &["TrainSample"][..]),
        (&*SNAPSHOTS, &["ParameterSnapshot", "Estimate"]),
        (&*EVENTS, &["Event"]),
    ];
    for ((columns, messages), schema) in tables.into_iter().zip(schemas()) {
        let mut declared = Vec::new();
        for message in messages {
            for [name, column] in rows(&page, message) {
                let names = match *message {
                    "Estimate" => of_estimate(&name),
                    _ => vec![name],
                };
                // `valid` is not a column. A name ends with its unit.
                if !column.is_empty() {
                    declared.extend(names.into_iter().map(|it| {
                        let unit = unit_of(&it).to_owned();
                        [it, column.clone(), unit]
                    }));
                }
            }
        }
        if messages.contains(&"Estimate") {
            let rejected = |it: &RejectionReason| format!("rejected_{}", it.name());
            let of = |it| [rejected(it), "UInt32".to_owned(), String::new()];
            declared.extend(RejectionReason::ALL.iter().map(of));
        }
        assert_eq!(in_words(&schema, columns), declared);
    }
}

#[test]
fn fields_say_unit_meaning_and_the_names_of_their_numbers() {
    let [_, schema, _] = schemas();
    let said = |name: &str, key: &str| {
        schema.field_with_name(name).unwrap().metadata().get(key).cloned().unwrap_or_default()
    };
    assert_eq!(said("estimate_resistance_c_n_per_kn_per_mps2", "unit"), "N/kN per (m/s)²");
    assert!(said("status", "names").contains("estimated"), "{}", said("status", "names"));
    assert!(schema.fields().iter().all(|it| it.metadata()["meaning"].len() > 8));
}
