//! The reference page of the recorded fields, from the same tables as the messages.

use std::fmt::Write;

use dynocar_shared::schema::{Field, unit_of};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{PipelineKind, Reason, Status};

use dynocar_mcap::annotate::messages::MESSAGES;
use dynocar_mcap::columns::{Column, EVENTS, SAMPLES, SNAPSHOTS, STAMPS, Source};
use dynocar_mcap::event::{Event, EventKind};
use dynocar_mcap::message::MessageField;
use dynocar_mcap::schema::{
    ESTIMATE, REJECTED, SAMPLE_FIELDS, SNAPSHOT_FIELDS, SUFFIXES, number, parameter_number,
    rejection_number, scalar, vocabulary_of_type,
};

const HEAD: &str = "# Fields of a recording

`dynocar-recording fields` prints this page from the tables behind the recordings ([guide](guides/recording.md)).

- *Number* and *type* are those of the protobuf message. A missing number is 0, unless its column says *null*.
- *Column* is Arrow's type in Parquet; *null*: missing where not measured. Metadata hold units, meanings and names. Two
  columns come first: `message_number` (`UInt64`, from 1) and `log_time` (`Timestamp(ns, \"UTC\")`).
- *NumPy* is the type and the offset in bytes of `dynocar.SAMPLE_DTYPE` and `dynocar.SNAPSHOT_DTYPE`.
";

const EXPLANATION: &str = "
`explain --annotate` adds these messages, without Parquet.
";

/// The page as Markdown.
pub fn page() -> String {
    let mut page = HEAD.to_owned();
    layout(&mut page, "dynocar.TrainSample", "One cycle of a train.", (&SAMPLE_FIELDS, &SAMPLES));
    layout(
        &mut page,
        "dynocar.ParameterSnapshot",
        "A pipeline's knowledge of one train at one moment.",
        (&SNAPSHOT_FIELDS, &SNAPSHOTS),
    );
    let nested = [("estimate", ESTIMATE, "Estimate"), ("rejected", REJECTED, "Rejected")];
    for (name, number, of_type) in nested {
        let row = Row { name, number: Some(number), of_type, ..Row::default() };
        row.put(&mut page, ALL, &format!("By name, see `dynocar.{of_type}`."));
    }
    table(
        &mut page,
        "dynocar.Estimate",
        &format!(
            "Each is missing unless the pipeline estimates it. The snapshots' columns begin with `estimate_`. \
             Three more fields each have a word before the unit and a number higher by {}.",
            SUFFIXES.map(|(offset, word, ..)| format!("`_{word}` {offset}")).join(", ")
        ),
        PARQUET,
    );
    for column in SNAPSHOTS.iter() {
        let Source::Value(it) = column.source else { continue };
        let row = Row::of(column, parameter_number(it), "double");
        Row { name: it.full_name(), ..row }.put(&mut page, PARQUET, &column.meaning);
    }
    let what = "Samples refused, by reason. The snapshots' columns begin with `rejected_`.";
    table(&mut page, "dynocar.Rejected", what, PARQUET);
    for column in SNAPSHOTS.iter() {
        let Source::Rejected(it) = column.source else { continue };
        let row = Row::of(column, rejection_number(it), "uint32");
        Row { name: it.name(), ..row }.put(&mut page, PARQUET, &column.meaning);
    }
    let columns: Vec<&Column> = EVENTS.iter().collect();
    listed(&mut page, Event::NAME, Event::MEANING, Event::FIELDS, &columns[STAMPS..]);
    page.push_str(EXPLANATION);
    for (name, what, fields) in MESSAGES {
        listed(&mut page, name, what, fields, &[]);
    }
    enumerations(&mut page);
    page
}

/// How many of the columns `column` and `NumPy` a table has.
type Shown = usize;
const ALL: Shown = 2;
const PARQUET: Shown = 1;

/// The cells of these columns.
fn cells(shown: Shown, column: &str, numpy: &str) -> String {
    [column, numpy][..shown].iter().map(|text| format!(" {text} |")).collect()
}

fn table(page: &mut String, name: &str, what: &str, shown: Shown) {
    let (title, line) = (cells(shown, "column", "NumPy"), cells(shown, "---", "---"));
    let _ = write!(
        page,
        "\n## `{name}`\n\n{what}\n\n| field | number | type |{title} unit | meaning |\n\
         | --- | --- | --- |{line} --- | --- |\n"
    );
}

/// A message by the table of its fields, and the columns that they are where they are any.
fn listed(page: &mut String, name: &str, what: &str, fields: &[MessageField], columns: &[&Column]) {
    let shown = if columns.is_empty() { 0 } else { PARQUET };
    table(page, &format!("dynocar.{name}"), &plain(what), shown);
    for (index, it) in fields.iter().enumerate() {
        let of_type = &type_of(vocabulary_of_type(it.type_name), it.type_name);
        let (number, unit) = (it.number, unit_of(it.name));
        let row = match columns.get(index) {
            Some(column) => Row::of(column, number, of_type),
            None => Row { name: it.name, number: Some(number), of_type, unit, ..Row::default() },
        };
        row.put(page, shown, it.meaning);
    }
}

/// A row of a table.
#[derive(Default)]
struct Row<'a> {
    name: &'a str,
    number: Option<u32>,
    of_type: &'a str,
    column: String,
    numpy: String,
    unit: &'a str,
}

impl<'a> Row<'a> {
    fn of(column: &'a Column, number: u32, of_type: &'a str) -> Self {
        let null = if column.is_nullable { ", null" } else { "" };
        Row {
            name: &column.name,
            number: Some(number),
            of_type,
            column: format!("{}{null}", column.arrow_type()),
            numpy: String::new(),
            unit: column.unit,
        }
    }

    fn put(&self, page: &mut String, shown: Shown, meaning: &str) {
        let Row { name, of_type, unit, .. } = self;
        let number = self.number.map_or("".to_owned(), |it| it.to_string());
        let cells = cells(shown, &self.column, &self.numpy);
        let meaning = plain(meaning);
        let _ = writeln!(page, "| `{name}` | {number} | {of_type} |{cells} {unit} | {meaning} |");
    }
}

/// A line of documentation without its links.
fn plain(meaning: &str) -> String {
    meaning
        .trim()
        .replace("[`crate::vocabulary::", "[`")
        .replace("[`crate::", "[`")
        .replace("[`", "`")
        .replace("`]", "`")
}

/// The vocabulary, or else protobuf's name of a Rust type.
fn type_of(vocabulary: Option<&str>, type_name: &str) -> String {
    let scalar = || scalar(type_name).as_str_name().trim_start_matches("TYPE_").to_lowercase();
    vocabulary.map_or_else(scalar, str::to_owned)
}

fn layout(page: &mut String, name: &str, what: &str, (fields, columns): (&[Field], &[Column])) {
    table(page, name, what, ALL);
    for field in fields {
        let shape = if field.is_array() { format!("({},)", field.entries()) } else { "".into() };
        let numpy = format!("`{shape}{}` at {}", field.numpy_type(), field.layout.offset);
        let Some(column) = columns.iter().find(|it| it.name == field.layout.name) else {
            let row = Row { name: field.layout.name, numpy, ..Row::default() };
            row.put(page, ALL, &format!("{} Elsewhere a value is there or not.", field.meaning));
            continue;
        };
        let of_type = type_of(column.vocabulary, field.entry_type());
        let of_type = if field.is_array() { format!("repeated {of_type}") } else { of_type };
        let row = Row::of(column, number(field), &of_type);
        Row { numpy, ..row }.put(page, ALL, field.meaning);
    }
}

fn enumerations(page: &mut String) {
    page.push_str(
        "\n## Numbers and their names\n\nIn the messages the names are in capitals, after that of the \
         vocabulary: `STATUS_ESTIMATED`. [The reading guide](guides/reading.md) explains all but the effects, whose names say it.\n\n",
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
