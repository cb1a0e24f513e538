//! The streams of messages, of recordings and of what is served live.

use dynocar::operator::pipeline_name;
use dynocar_shared::{ParameterSnapshot, PipelineKind, TrainId, TrainSample};

use crate::schema::{EVENT, SAMPLE, SNAPSHOT};

/// The encoding of every message and of its schema.
pub const ENCODING: &str = "protobuf";
/// The channel's metadata that names the layout in shared memory.
pub const LAYOUT: &str = "layout";

/// One stream of messages.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// Name of its messages' schema.
    pub schema: &'static str,
    /// The layout in shared memory that the messages are made from.
    pub layout: &'static str,
}

impl Topic {
    /// A train's samples.
    pub fn of_samples(train: TrainId) -> Self {
        let name = format!("/train/{train}/samples");
        Topic { name, schema: SAMPLE, layout: TrainSample::WIRE_NAME }
    }

    /// The snapshots of one pipeline.
    pub fn of_snapshots(train: TrainId, index: u32, kind: Option<PipelineKind>) -> Self {
        let name = format!("/train/{train}/{}", pipeline_name(index, kind));
        Topic { name, schema: SNAPSHOT, layout: ParameterSnapshot::WIRE_NAME }
    }

    /// The events of all trains.
    pub fn of_events() -> Self {
        Topic { name: "/events".to_owned(), schema: EVENT, layout: EVENT }
    }
}
