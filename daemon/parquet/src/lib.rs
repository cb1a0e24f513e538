//! Recordings as Parquet, without loss and back; and Parquet files of any program as columns of numbers.
//!
//! A recording is a folder: one file of samples for each train, one of snapshots for each pipeline, one of events, one
//! of the attachments of an MCAP file and one of its metadata. `message_number` gives the order in which the messages
//! were recorded. A file of samples alone is a recording too: it carries the configuration.
//!
//! # Layout
//!
//! - [`table`]: the tables of a recording, after `dynocar_mcap::columns`, with Arrow's schema in addition to Parquet's
//! - [`column_type`], [`file`](mod@file): types of the columns of a file, their cells, and why a file cannot be read
//! - [`columns`]: a Parquet file of any program as columns of numbers, and the train of each row
//! - [`reading`]: Parquet to the messages of a recording, and to MCAP
//! - [`table_file`], [`writing`]: MCAP to Parquet
//!
//! # Examples
//!
//! ```
//! use dynocar_mcap::topic::Message;
//! use dynocar_mcap::writing::{RecordingWriter, WallClock};
//! use dynocar_shared::{SampleField, TrainId, TrainSample};
//!
//! let folder = tempfile::tempdir()?;
//! let (mcap, tables) = (folder.path().join("run.mcap"), folder.path().join("run"));
//! let mut recording = RecordingWriter::new(std::fs::File::create(&mcap)?, WallClock::now())?;
//! let sample = TrainSample::empty(TrainId(1)).with(SampleField::Speed, 21.5);
//! recording.write(Message::Sample(&sample))?;
//! recording.finish()?;
//!
//! assert_eq!(dynocar_parquet::writing::write_folder(&[mcap], &tables)?.samples, 1);
//! let read = dynocar_parquet::reading::read(&tables)?.into_recording();
//! assert_eq!(read.samples[0].get(SampleField::Speed), Some(21.5));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod column_type;
pub mod columns;
pub mod file;
pub mod reading;
pub mod table;
pub mod table_file;
pub mod writing;
