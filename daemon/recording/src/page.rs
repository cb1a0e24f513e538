//! The reference page of the recorded fields, from the same tables as the messages.

use std::fmt::Write;

use dynocar_shared::schema::Field;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{PipelineKind, Reason, Status};

use dynocar_mcap::annotate::MESSAGES;
use dynocar_mcap::columns::{ColumnSource, EVENTS, RecordingColumn, SAMPLES, SNAPSHOTS, STAMPS};
use dynocar_mcap::event::{Event, EventKind, MessageField};
use dynocar_mcap::schema::{SAMPLE_FIELDS, SNAPSHOT_FIELDS, SUFFIXES, scalar, vocabulary_of_type};

const HEAD: &str = "# Fields of a recording

`dynocar-recording fields` prints this page from the tables behind the recordings ([guide](guides/recording.md)).

- A name ends with its unit. Every file holds the schema of its messages, with the numbers of their fields.
- *Column* is Arrow's type in Parquet, *null* where a value may be missing. Two columns come first: `message_number`
  (`UInt64`, from 1) and `log_time` (`Timestamp(ns, \"UTC\")`).
- *NumPy* is the type and the offset in bytes of `dynocar.SAMPLE_DTYPE` and `dynocar.SNAPSHOT_DTYPE`.
";

const REJECTED: &str = "
## `dynocar.Rejected`

Samples refused, with a field for each [reason](guides/reading.md#why-samples-are-refused): `uint32`, in a snapshot's
column `rejected_<reason>` of `UInt32`.
";

const EXPLANATION: &str = "
`explain --annotate` adds these messages, without Parquet.
";

/// Returns the page as Markdown.
pub fn page() -> String {
    let mut page = HEAD.to_owned();
    layout(&mut page, "dynocar.TrainSample", "One cycle of a train.", (&SAMPLE_FIELDS, &SAMPLES));
    layout(
        &mut page,
        "dynocar.ParameterSnapshot",
        "A pipeline's knowledge of one train at one moment.",
        (&SNAPSHOT_FIELDS, &SNAPSHOTS),
    );
    table(
        &mut page,
        "dynocar.Estimate",
        &format!(
            "The estimates of a snapshot by name, in columns that begin with `estimate_`; each is missing unless \
             the pipeline estimates it. Three more fields have {} before the unit.",
            SUFFIXES.map(|(_, word, ..)| format!("`_{word}`")).join(", ")
        ),
        PARQUET,
    );
    for column in SNAPSHOTS.iter() {
        let ColumnSource::Value(it) = column.source else { continue };
        Row { name: it.full_name(), ..Row::of(column) }.put(&mut page, PARQUET, &column.meaning);
    }
    page.push_str(REJECTED);
    let columns: Vec<&RecordingColumn> = EVENTS.iter().collect();
    listed(&mut page, Event::NAME, Event::MEANING, Event::FIELDS, &columns[STAMPS..]);
    page.push_str(EXPLANATION);
    for (name, what, fields) in MESSAGES {
        listed(&mut page, name, what, fields, &[]);
    }
    enumerations(&mut page);
    page
}

/// The columns of a table between the name and the meaning of a field.
type Shown = &'static [&'static str];
const ALL: Shown = &["column", "NumPy"];
const PARQUET: Shown = &["column"];
const MESSAGE: Shown = &["type"];

fn table(page: &mut String, name: &str, what: &str, shown: Shown) {
    let titles: String = shown.iter().map(|title| format!(" {title} |")).collect();
    let lines = " --- |".repeat(shown.len());
    let _ = write!(
        page,
        "\n## `{name}`\n\n{what}\n\n| field |{titles} meaning |\n| --- |{lines} --- |\n"
    );
}

/// A message by the table of its fields, and the columns that they are where they are any.
fn listed(
    page: &mut String,
    name: &str,
    what: &str,
    fields: &[MessageField],
    columns: &[&RecordingColumn],
) {
    let shown = if columns.is_empty() { MESSAGE } else { PARQUET };
    table(page, &format!("dynocar.{name}"), &plain(what), shown);
    for (index, it) in fields.iter().enumerate() {
        let of_type = type_of(vocabulary_of_type(it.type_name), it.type_name);
        let row = match columns.get(index) {
            Some(column) => Row::of(column),
            None => Row { name: it.name, column: of_type, ..Row::default() },
        };
        row.put(page, shown, it.meaning);
    }
}

/// A row of a table.
#[derive(Default)]
struct Row<'a> {
    name: &'a str,
    column: String,
    numpy: String,
}

impl<'a> Row<'a> {
    fn of(column: &'a RecordingColumn) -> Self {
        let null = if column.is_nullable { ", null" } else { "" };
        let of_type = format!("{}{null}", column.arrow_type());
        Row { name: &column.name, column: of_type, ..Row::default() }
    }

    fn put(&self, page: &mut String, shown: Shown, meaning: &str) {
        let cells = [&self.column, &self.numpy];
        let cells: String = cells[..shown.len()].iter().map(|it| format!(" {it} |")).collect();
        let _ = writeln!(page, "| `{}` |{cells} {} |", self.name, plain(meaning));
    }
}

/// Returns a line of documentation without its links.
fn plain(meaning: &str) -> String {
    meaning
        .trim()
        .replace("[`crate::vocabulary::", "[`")
        .replace("[`crate::", "[`")
        .replace("[`", "`")
        .replace("`]", "`")
}

/// Returns the vocabulary, or else protobuf's name of a Rust type.
fn type_of(vocabulary: Option<&str>, type_name: &str) -> String {
    let scalar = || scalar(type_name).as_str_name().trim_start_matches("TYPE_").to_lowercase();
    vocabulary.map_or_else(scalar, str::to_owned)
}

fn layout(
    page: &mut String,
    name: &str,
    what: &str,
    (fields, columns): (&[Field], &[RecordingColumn]),
) {
    table(page, name, what, ALL);
    for field in fields {
        let shape = if field.is_array() { format!("({},)", field.entries()) } else { "".into() };
        let numpy = format!("`{shape}{}` at {}", field.numpy_type(), field.layout.offset);
        let Some(column) = columns.iter().find(|it| it.name == field.layout.name) else {
            let row = Row { name: field.layout.name, numpy, ..Row::default() };
            row.put(page, ALL, &format!("{} Elsewhere a value is there or not.", field.meaning));
            continue;
        };
        Row { numpy, ..Row::of(column) }.put(page, ALL, field.meaning);
    }
}

fn enumerations(page: &mut String) {
    page.push_str(
        "\n## Numbers and their names\n\nIn the messages the names are in capitals, after that of the \
         vocabulary: `STATUS_ESTIMATED`. [The reading guide](guides/reading.md) explains all but the effects.\n\n",
    );
    macro_rules! names {
        ($($name:ident)*) => {$(
            let all = $name::ALL.iter().map(|it| format!("{} `{}`", *it as u32, it.name()));
            let _ = writeln!(page, "- `{}`: {}", stringify!($name), all.collect::<Vec<_>>().join(", "));
        )*};
    }
    names!(PipelineKind Status Reason EffectKind);
    page.push_str("\n| EventKind | name | meaning |\n| --- | --- | --- |\n");
    for it in EventKind::ALL {
        let _ = writeln!(page, "| {} | {} | {} |", *it as u32, it.name(), plain(it.meaning()));
    }
}
