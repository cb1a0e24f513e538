//! The streams of messages of a recording and of a live view, and their messages: samples and snapshots as protobuf and
//! back, to the bit.

use dynocar::operator::pipeline_name;
use dynocar_shared::layout::Words;
use dynocar_shared::schema::{Field, Missing};
use dynocar_shared::snapshot::PARAMETERS_MAX;
use dynocar_shared::{
    Parameter, ParameterSnapshot, PipelineKind, RejectionReason, TrainId, TrainSample,
};
use prost::encoding::{
    DecodeContext, WireType, decode_key, decode_varint, encode_key, encode_varint, skip_field,
};
use prost::{DecodeError, Message as _};

use crate::event::Event;
use crate::schema::{
    ESTIMATE, EVENT, REJECTED, SAMPLE, SAMPLE_FIELDS, SNAPSHOT, SNAPSHOT_FIELDS, SUFFIXES, number,
    parameter_number, rejection_number,
};

/// The encoding of every message and of its schema.
pub const ENCODING: &str = "protobuf";
/// The channel's metadata that names the layout in shared memory.
pub const LAYOUT: &str = "layout";

/// One stream of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Topic {
    /// A train's samples.
    Samples(u64),
    /// A train's snapshots of one pipeline, by its number and that of its kind.
    Snapshots(u64, u32, u32),
    /// The events of all trains.
    Events,
}

impl Topic {
    /// Returns its name.
    pub fn name(self) -> String {
        match self {
            Topic::Samples(train) => format!("/train/{train}/samples"),
            Topic::Snapshots(train, index, kind) => {
                let pipeline = pipeline_name(index, PipelineKind::from_number(kind));
                format!("/train/{train}/{pipeline}")
            }
            Topic::Events => "/events".to_owned(),
        }
    }

    /// Returns the name of its messages' schema, and the layout in shared memory that they are made from.
    pub fn schema_and_layout(self) -> (&'static str, &'static str) {
        match self {
            Topic::Samples(_) => (SAMPLE, TrainSample::WIRE_NAME),
            Topic::Snapshots(..) => (SNAPSHOT, ParameterSnapshot::WIRE_NAME),
            Topic::Events => (EVENT, EVENT),
        }
    }
}

/// A message of a stream.
#[derive(Clone, Copy, Debug)]
pub enum Message<'a> {
    /// A controller's sample.
    Sample(&'a TrainSample),
    /// A pipeline's snapshot.
    Snapshot(&'a ParameterSnapshot),
    /// An event.
    Event(&'a Event),
}

impl Message<'_> {
    /// Returns its stream.
    pub fn topic(self) -> Topic {
        match self {
            Message::Sample(it) => Topic::Samples(it.train_id),
            Message::Snapshot(it) => {
                Topic::Snapshots(it.train_id, it.pipeline_index, it.pipeline_kind)
            }
            Message::Event(_) => Topic::Events,
        }
    }

    /// Returns its number in its stream, 0 for events, and when it was published, in ns of the host's monotonic clock.
    pub fn number_and_time_ns(self) -> (u64, i64) {
        match self {
            Message::Sample(it) => (it.sequence, it.published_ns),
            Message::Snapshot(it) => (it.sequence, it.published_ns),
            Message::Event(it) => (0, it.monotonic_ns),
        }
    }

    /// Appends it as protobuf.
    pub fn encode(self, out: &mut Vec<u8>) {
        match self {
            Message::Sample(it) => encode_sample(it, out),
            Message::Snapshot(it) => encode_snapshot(it, out),
            // A vector takes any length.
            Message::Event(it) => drop(it.encode(out)),
        }
    }
}

/// Why bytes are not one of our messages.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CodecError {
    /// The bytes are no protobuf message.
    #[error("not a protobuf message: {0}")]
    Malformed(#[from] DecodeError),
    /// A field is of another type.
    #[error("{field}: expected {expected}, found wire type {found:?}")]
    OtherType {
        /// The field.
        field: &'static str,
        /// Its type.
        expected: &'static str,
        /// Wire type in the message.
        found: WireType,
    },
    /// The bytes end within a field.
    #[error("{field}: the message ends within it")]
    CutOff {
        /// The field.
        field: &'static str,
    },
    /// An array has more entries than the layout has places for.
    #[error("{field}: more entries than {most}")]
    TooMany {
        /// The field.
        field: &'static str,
        /// The places.
        most: usize,
    },
}

/// Appends a sample's message.
pub fn encode_sample(sample: &TrainSample, out: &mut Vec<u8>) {
    for (field, words) in SAMPLE_FIELDS.iter().zip(sample.fields()) {
        match field.missing {
            Missing::Unless(quantity) if sample.valid & quantity.bit() != 0 => {
                put(field, words.word(0), number(field), out);
            }
            Missing::Unless(_) | Missing::SaidByOthers => {}
            Missing::Never => put_field(field, words, out),
        }
    }
}

/// Appends a snapshot's message.
pub fn encode_snapshot(snapshot: &ParameterSnapshot, out: &mut Vec<u8>) {
    for (field, words) in SNAPSHOT_FIELDS.iter().zip(snapshot.fields()) {
        put_field(field, words, out);
    }
    put_nested(ESTIMATE, out, |out| {
        let count = (snapshot.parameter_count as usize).min(PARAMETERS_MAX);
        for index in 0..count {
            let known = Parameter::from_number(snapshot.parameters[index]);
            let Some(parameter) = known else { continue };
            let (number, value) = (parameter_number(parameter), snapshot.values[index]);
            let std = snapshot.covariance_at(index, index).max(0.0).sqrt();
            put_double(number, value, out);
            for (offset, .., of) in SUFFIXES {
                put_double(number + offset, of(value, std), out);
            }
        }
    });
    put_nested(REJECTED, out, |out| {
        for &reason in RejectionReason::ALL {
            let count = snapshot.rejected(reason);
            if count > 0 {
                encode_key(rejection_number(reason), WireType::Varint, out);
                encode_varint(u64::from(count), out);
            }
        }
    });
}

/// Reads a sample's message.
///
/// # Errors
///
/// If the bytes are not a valid sample message.
pub fn decode_sample(message: &[u8]) -> Result<TrainSample, CodecError> {
    let mut sample = TrainSample::empty(TrainId(0));
    sample.direction = 0;
    let mut valid = 0;
    decode(message, &SAMPLE_FIELDS, &mut sample.fields_mut(), |field| {
        if let Missing::Unless(quantity) = field.missing {
            valid |= quantity.bit();
        }
    })?;
    sample.valid = valid;
    Ok(sample)
}

/// Reads a snapshot's message.
///
/// # Errors
///
/// If the bytes are not a valid snapshot message.
pub fn decode_snapshot(message: &[u8]) -> Result<ParameterSnapshot, CodecError> {
    let mut snapshot = ParameterSnapshot::empty();
    (snapshot.status, snapshot.reason) = (0, 0);
    decode(message, &SNAPSHOT_FIELDS, &mut snapshot.fields_mut(), |_| {})?;
    Ok(snapshot)
}

fn put_double(number: u32, value: f64, out: &mut Vec<u8>) {
    encode_key(number, WireType::SixtyFourBit, out);
    out.extend(value.to_le_bytes());
}

fn put_nested(number: u32, out: &mut Vec<u8>, write: impl FnOnce(&mut Vec<u8>)) {
    let mut content = Vec::with_capacity(128);
    write(&mut content);
    if !content.is_empty() {
        encode_key(number, WireType::LengthDelimited, out);
        encode_varint(content.len() as u64, out);
        out.extend(content);
    }
}

fn is_double(field: &Field) -> bool {
    field.entry_type() == "f64"
}

fn put_word(field: &Field, word: u64, out: &mut Vec<u8>) {
    if is_double(field) {
        out.extend(word.to_le_bytes());
    } else {
        encode_varint(word, out);
    }
}

fn put(field: &Field, word: u64, number: u32, out: &mut Vec<u8>) {
    let wire_type = if is_double(field) { WireType::SixtyFourBit } else { WireType::Varint };
    encode_key(number, wire_type, out);
    put_word(field, word, out);
}

/// A number unless it is 0, or the entries of an array up to the last that is not.
fn put_field(field: &Field, words: &dyn Words, out: &mut Vec<u8>) {
    let Some(last) = (0..words.count()).rev().find(|&index| words.word(index) != 0) else { return };
    if !field.is_array() {
        return put(field, words.word(0), number(field), out);
    }
    put_nested(number(field), out, |out| {
        (0..=last).for_each(|index| put_word(field, words.word(index), out));
    });
}

fn decode(
    mut message: &[u8],
    fields: &'static [Field],
    words: &mut [&mut dyn Words],
    mut seen: impl FnMut(&Field),
) -> Result<(), CodecError> {
    while !message.is_empty() {
        let (number, wire_type) = decode_key(&mut message)?;
        let Some(field) = fields.get((number as usize).wrapping_sub(1)) else {
            skip_field(wire_type, number, &mut message, DecodeContext::default())?;
            continue;
        };
        seen(field);
        let words = &mut *words[field.index];
        if field.is_array() && wire_type == WireType::LengthDelimited {
            let length = decode_varint(&mut message)? as usize;
            let (mut entries, rest) = message.split_at_checked(length).ok_or(cut_off(field))?;
            message = rest;
            let mut index = 0;
            while !entries.is_empty() {
                let word = take(field, &mut entries)?;
                if index == words.count() {
                    let (field, most) = (field.layout.name, words.count());
                    return Err(CodecError::TooMany { field, most });
                }
                words.set_word(index, word);
                index += 1;
            }
        } else if !field.is_array() && is_of(field, wire_type) {
            words.set_word(0, take(field, &mut message)?);
        } else {
            let (field, expected) = (field.layout.name, field.layout.type_name);
            return Err(CodecError::OtherType { field, expected, found: wire_type });
        }
    }
    Ok(())
}

fn is_of(field: &Field, wire_type: WireType) -> bool {
    match wire_type {
        WireType::SixtyFourBit => is_double(field),
        WireType::Varint => !is_double(field),
        _ => false,
    }
}

fn cut_off(field: &Field) -> CodecError {
    CodecError::CutOff { field: field.layout.name }
}

fn take(field: &Field, bytes: &mut &[u8]) -> Result<u64, CodecError> {
    if !is_double(field) {
        return Ok(decode_varint(bytes)?);
    }
    let (word, rest) = bytes.split_first_chunk::<8>().ok_or(cut_off(field))?;
    *bytes = rest;
    Ok(u64::from_le_bytes(*word))
}
