//! The streams of messages of a recording and of a live view.

use dynocar::operator::pipeline_name;
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainSample};
use prost::Message as _;

use crate::codec::{encode_sample, encode_snapshot};
use crate::event::Event;
use crate::schema::{EVENT, SAMPLE, SNAPSHOT};

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
