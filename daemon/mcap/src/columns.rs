//! Columns of tables for the contents of a recording, made from the same tables as the messages.
//!
//! Arrays are written as they are, as lists of fixed length, so that nothing is lost; their contents appear once more
//! under names with units, as in the messages.

use std::sync::LazyLock;

use dynocar_shared::schema::{Field, Missing, unit_of};
use dynocar_shared::{Parameter, ParameterSnapshot, RejectionReason, TrainSample};

use crate::event::{Event, MessageField};
use crate::schema::{
    SAMPLE_FIELDS, SNAPSHOT_FIELDS, SUFFIXES, members_of, suffixed_name, vocabulary_of,
    vocabulary_of_type,
};
use crate::topic::Message;

/// Where a column's values come from.
#[derive(Clone, Copy, Debug)]
pub enum ColumnSource {
    /// The message's number in the recording.
    Number,
    /// Its `log_time`.
    LogTime,
    /// A field of a sample or a snapshot.
    Field(&'static Field),
    /// A parameter's value, which repeats the contents of arrays.
    Value(Parameter),
    /// Addition of [`SUFFIXES`], by the index there: repeats the contents of arrays.
    OfEstimate(Parameter, usize),
    /// How many samples were refused for a reason, which repeats an entry of an array.
    Rejected(RejectionReason),
    /// A field of an event, by its index.
    Event(usize),
}

/// A column.
#[derive(Clone, Debug)]
pub struct RecordingColumn {
    /// Its name, with the unit.
    pub name: String,
    /// The Rust type of an entry; `string` for a text, `bytes`, `time` for ns since 1970.
    pub type_name: &'static str,
    /// Entries of each list; `None` where it holds no lists.
    pub list: Option<usize>,
    /// True where a value may be missing.
    pub is_nullable: bool,
    /// The unit; empty for none.
    pub unit: &'static str,
    /// Meaning of the column.
    pub meaning: String,
    /// Numbers and names, where it holds numbers of a vocabulary.
    pub vocabulary: Option<&'static str>,
    /// Where its values come from.
    pub source: ColumnSource,
}

/// A message of a recording.
#[derive(Clone, Debug, PartialEq)]
pub enum RecordingRow {
    /// A sample.
    Sample(TrainSample),
    /// A snapshot.
    Snapshot(Box<ParameterSnapshot>),
    /// An event.
    Event(Event),
}

/// The columns of samples.
pub static SAMPLES: LazyLock<Vec<RecordingColumn>> =
    LazyLock::new(|| stamps().chain(SAMPLE_FIELDS.iter().filter_map(of_field)).collect());

/// The columns of a pipeline's snapshots.
pub static SNAPSHOTS: LazyLock<Vec<RecordingColumn>> = LazyLock::new(|| {
    let fields = SNAPSHOT_FIELDS.iter().filter_map(of_field);
    let parameters = Parameter::ALL.iter().flat_map(|&it| {
        let name = format!("estimate_{}", it.full_name());
        let value = plain(name, "f64", it.meaning(), ColumnSource::Value(it));
        let suffixed =
            SUFFIXES.into_iter().enumerate().map(move |(index, (_, word, meaning, _))| {
                let name = format!("estimate_{}", suffixed_name(it, word));
                plain(name, "f64", meaning, ColumnSource::OfEstimate(it, index))
            });
        std::iter::once(value).chain(suffixed).map(nullable)
    });
    let rejected = RejectionReason::ALL.iter().map(|&it| {
        plain(format!("rejected_{}", it.name()), "u32", it.meaning(), ColumnSource::Rejected(it))
    });
    stamps().chain(fields).chain(parameters).chain(rejected).collect()
});

/// The columns of events.
pub static EVENTS: LazyLock<Vec<RecordingColumn>> = LazyLock::new(|| {
    let fields = Event::FIELDS.iter().enumerate().map(|(index, it)| {
        let vocabulary = vocabulary_of_type(it.type_name);
        let type_name = if vocabulary.is_some() { "i32" } else { it.type_name };
        let MessageField { name, meaning, is_optional, .. } = it;
        let column = plain((*name).to_owned(), type_name, meaning, ColumnSource::Event(index));
        RecordingColumn { is_nullable: *is_optional, vocabulary, ..column }
    });
    stamps().chain(fields).collect()
});

/// Columns before those of a message's fields.
pub const STAMPS: usize = 2;

fn stamps() -> impl Iterator<Item = RecordingColumn> {
    let number = "The message's place among the recording's, counted from 1.";
    let logged = "When the message was recorded: wall time.";
    [
        plain("message_number".into(), "u64", number, ColumnSource::Number),
        plain("log_time".into(), "time", logged, ColumnSource::LogTime),
    ]
    .into_iter()
}

fn plain(
    name: String,
    type_name: &'static str,
    meaning: &str,
    source: ColumnSource,
) -> RecordingColumn {
    RecordingColumn {
        unit: unit_of(&name),
        name,
        type_name,
        list: None,
        is_nullable: false,
        meaning: meaning.trim().into(),
        vocabulary: None,
        source,
    }
}

fn nullable(column: RecordingColumn) -> RecordingColumn {
    RecordingColumn { is_nullable: true, ..column }
}

/// Returns the column of a layout's field; `None` for one that is said by others.
fn of_field(field: &'static Field) -> Option<RecordingColumn> {
    let name = field.layout.name;
    let column = plain(name.into(), field.entry_type(), field.meaning, ColumnSource::Field(field));
    let column = RecordingColumn {
        list: field.is_array().then(|| field.entries()),
        vocabulary: vocabulary_of(name),
        ..column
    };
    match field.missing {
        Missing::Never => Some(column),
        Missing::Unless(_) => Some(nullable(column)),
        Missing::SaidByOthers => None,
    }
}

impl RecordingColumn {
    /// Returns a column of a table that holds attached files or metadata instead of messages.
    pub fn beside(name: &str, type_name: &'static str, is_nullable: bool) -> Self {
        RecordingColumn { is_nullable, ..plain(name.into(), type_name, "", ColumnSource::Number) }
    }

    /// Returns the type of an entry in Arrow's words.
    pub fn entry_arrow_type(&self) -> &'static str {
        match self.type_name {
            "f64" => "Float64",
            "i64" => "Int64",
            "i32" => "Int32",
            "i8" => "Int8",
            "u64" => "UInt64",
            "u32" => "UInt32",
            "u16" => "UInt16",
            "u8" => "UInt8",
            "time" => "Timestamp(ns, \"UTC\")",
            "bytes" => "Binary",
            _ => "Utf8",
        }
    }

    /// Returns the type in Arrow's words.
    pub fn arrow_type(&self) -> String {
        let entry = self.entry_arrow_type();
        match self.list {
            None => entry.into(),
            Some(entries) => format!("FixedSizeList({entries} x non-null {entry})"),
        }
    }

    /// Returns the numbers and names of its vocabulary in words; empty without one.
    pub fn names(&self) -> String {
        let members = self.vocabulary.map(members_of).unwrap_or_default();
        let members = members.iter().map(|(number, name)| format!("{number} {name}"));
        members.collect::<Vec<_>>().join(", ")
    }

    /// Returns true for a column that only repeats the contents of others.
    pub fn is_repetition(&self) -> bool {
        matches!(
            self.source,
            ColumnSource::Value(_) | ColumnSource::OfEstimate(..) | ColumnSource::Rejected(_)
        )
    }
}

impl RecordingRow {
    /// Returns the same row as a message, for writers of messages.
    pub fn message(&self) -> Message<'_> {
        match self {
            RecordingRow::Sample(it) => Message::Sample(it),
            RecordingRow::Snapshot(it) => Message::Snapshot(it),
            RecordingRow::Event(it) => Message::Event(it),
        }
    }

    /// Appends the words of a column that is neither text nor a stamp; gives false where the value is
    /// missing, and then appends as many zeros.
    pub fn put_words(&self, column: &RecordingColumn, words: &mut Vec<u64>) -> bool {
        let one = |words: &mut Vec<u64>, word: Option<u64>| {
            words.push(word.unwrap_or(0));
            word.is_some()
        };
        match (self, column.source) {
            (RecordingRow::Sample(it), ColumnSource::Field(field)) => {
                let is_there = match field.missing {
                    Missing::Unless(quantity) => it.valid & quantity.bit() != 0,
                    _ => true,
                };
                one(words, is_there.then(|| it.fields()[field.index].word(0)))
            }
            (RecordingRow::Snapshot(it), ColumnSource::Field(field)) => {
                let entries = it.fields()[field.index];
                words.extend((0..entries.count()).map(|index| entries.word(index)));
                true
            }
            (RecordingRow::Snapshot(it), ColumnSource::Value(of)) => {
                one(words, it.value(of).map(f64::to_bits))
            }
            (RecordingRow::Snapshot(it), ColumnSource::OfEstimate(of, index)) => {
                let estimate = it.value(of).zip(it.std(of));
                one(words, estimate.map(|(value, std)| SUFFIXES[index].3(value, std).to_bits()))
            }
            (RecordingRow::Snapshot(it), ColumnSource::Rejected(of)) => {
                one(words, Some(it.rejected(of).into()))
            }
            (RecordingRow::Event(it), ColumnSource::Event(index)) => one(words, it.word(index)),
            _ => one(words, None),
        }
    }

    /// Sets the value of a column; `words` is `None` where the value is missing.
    pub fn set_words(&mut self, column: &RecordingColumn, words: Option<&[u64]>) {
        match (self, column.source, words) {
            (RecordingRow::Sample(it), ColumnSource::Field(field), Some(words)) => {
                it.fields_mut()[field.index].set_word(0, words[0]);
                if let Missing::Unless(quantity) = field.missing {
                    it.valid |= quantity.bit();
                }
            }
            (RecordingRow::Snapshot(it), ColumnSource::Field(field), Some(words)) => {
                let mut fields = it.fields_mut();
                words.iter().enumerate().for_each(|(index, &word)| {
                    fields[field.index].set_word(index, word);
                });
            }
            (RecordingRow::Event(it), ColumnSource::Event(index), words) => {
                it.set_word(index, words.map(|it| it[0]));
            }
            _ => {}
        }
    }
}
