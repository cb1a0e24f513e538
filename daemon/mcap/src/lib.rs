//! Recordings of samples and snapshots as [MCAP](https://mcap.dev) files with protobuf messages: read, written, copied
//! and annotated. Another package records.
//!
//! Samples are the truth of a recording: the daemon's pipelines are functions of them, so that every snapshot can be
//! computed again. `dynocar replay --verify` does so.
//!
//! # Layout
//!
//! - [`schema`]: the protobuf messages, made from the layouts of sample and snapshot
//! - [`columns`]: the same as columns of tables, for writers of tables
//! - [`event`]: messages that are declared once, and events around samples and snapshots
//! - [`topic`]: the streams of messages; samples and snapshots as messages and back, to the bit
//! - [`writing`], [`reading`]: MCAP files, written without seeking and read as far as they are whole
//! - [`recording`]: a recording, of one file or more, in memory, in the order in which it was recorded
//! - [`copying`]: copies of recordings, ours or not; repair of a truncated file
//! - [`annotate`]: an explanation next to the data
//! - [`error`]: errors of files, with their paths
//!
//! # Examples
//!
//! ```
//! use dynocar_mcap::topic::{decode_sample, encode_sample};
//! use dynocar_shared::{SampleField, TrainId, TrainSample};
//!
//! let sample = TrainSample::empty(TrainId(1)).with(SampleField::Speed, 21.5);
//! let mut message = Vec::new();
//! encode_sample(&sample, &mut message);
//! assert_eq!(decode_sample(&message)?.get(SampleField::Speed), Some(21.5));
//! # Ok::<(), dynocar_mcap::topic::CodecError>(())
//! ```

pub mod annotate;
pub mod columns;
pub mod copying;
pub mod error;
pub mod event;
pub mod reading;
pub mod recording;
pub mod schema;
pub mod topic;
pub mod writing;
