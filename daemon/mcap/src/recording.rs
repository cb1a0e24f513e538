//! A recording in memory: its messages in the order in which they were recorded, even if another tool has reordered
//! them.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use dynocar_shared::{ParameterSnapshot, TrainSample};
pub use mcap::records::Metadata;

use crate::copying::read_all;
use crate::error::{ReadError, ReadProblem};
use crate::event::Event;
use crate::reading::{Raw, RecordingItem, Visitor};

/// Contents of a recording, each kind in its order.
#[derive(Debug, Default)]
pub struct Recording {
    /// Samples, in the order in which they were written.
    pub samples: Vec<TrainSample>,
    /// Snapshots, in that order.
    pub snapshots: Vec<ParameterSnapshot>,
    /// Events, in that order.
    pub events: Vec<Event>,
    /// Attached files: name and content.
    pub attachments: Vec<(String, Vec<u8>)>,
    /// Metadata, in order.
    pub metadata: Vec<Metadata>,
    /// The topics, each once.
    pub topics: Vec<String>,
    /// Where a file broke off, in words.
    pub broken: Option<String>,
    /// Snapshots and events that were read and not kept.
    pub left_out: usize,
}

impl Visitor for Recording {
    type Error = ReadError;

    fn item(&mut self, item: RecordingItem<'_>) -> Result<(), ReadError> {
        match item {
            RecordingItem::Metadata(it) => self.metadata.push(it.clone()),
            RecordingItem::Attachment { name, content, .. } => {
                self.attachments.push((name, content.into()));
            }
            RecordingItem::Sample(it) => self.samples.push(*it),
            RecordingItem::Snapshot(it) => self.snapshots.push(*it),
            RecordingItem::Event(it) => self.events.push(it.clone()),
        }
        Ok(())
    }

    fn raw(&mut self, raw: &Raw<'_>) -> Result<(), ReadError> {
        if self.topics.last() != Some(&raw.channel.topic)
            && !self.topics.contains(&raw.channel.topic)
        {
            self.topics.push(raw.channel.topic.clone());
        }
        Ok(())
    }
}

impl Recording {
    /// Reads a recording as far as it is whole.
    ///
    /// # Errors
    ///
    /// If the file is not a recording, or holds no sample.
    pub fn load(path: &Path) -> Result<Self, ReadError> {
        Recording::load_all(&[path.into()])
    }

    /// Returns the same of a recording that rotated: its files in order.
    ///
    /// # Errors
    ///
    /// If one file is not a recording, the files are not of one recording, or none holds a sample.
    ///
    /// # Panics
    ///
    /// Without a file.
    pub fn load_all(paths: &[PathBuf]) -> Result<Self, ReadError> {
        Logged::default().read(paths)
    }

    /// Returns the same without its snapshots and events, which are counted.
    ///
    /// # Errors
    ///
    /// As [`load_all`](Self::load_all).
    ///
    /// # Panics
    ///
    /// Without a file.
    pub fn of_samples(paths: &[PathBuf]) -> Result<Self, ReadError> {
        Logged { keeps_samples_only: true, ..Logged::default() }.read(paths)
    }

    /// Returns the files of the dataset that is attached, by their names in it.
    pub fn attached_dataset(&self) -> impl Iterator<Item = (&str, &Vec<u8>)> {
        let files = self.attachments.iter();
        files.filter_map(|(name, content)| Some((name.strip_prefix(DATASET_FOLDER)?, content)))
    }

    /// Returns the trains that there are samples of, in order.
    pub fn trains(&self) -> Vec<u64> {
        trains_of(self.samples.iter().map(|it| it.train_id))
    }
}

/// The folder in which a dataset's files are attached.
pub const DATASET_FOLDER: &str = "dataset/";

/// A recording that is read, with the times at which its messages were logged.
#[derive(Debug, Default)]
struct Logged {
    recording: Recording,
    log_time: u64,
    samples: Vec<u64>,
    snapshots: Vec<u64>,
    keeps_samples_only: bool,
}

impl Visitor for Logged {
    type Error = ReadError;

    fn item(&mut self, item: RecordingItem<'_>) -> Result<(), ReadError> {
        match item {
            RecordingItem::Sample(_) => self.samples.push(self.log_time),
            RecordingItem::Snapshot(_) | RecordingItem::Event(_) if self.keeps_samples_only => {
                self.recording.left_out += 1;
                return Ok(());
            }
            RecordingItem::Snapshot(_) => self.snapshots.push(self.log_time),
            _ => {}
        }
        self.recording.item(item)
    }

    fn raw(&mut self, raw: &Raw<'_>) -> Result<(), ReadError> {
        self.log_time = raw.header.log_time;
        self.recording.raw(raw)
    }
}

impl Logged {
    /// Returns the recording in order, each message once.
    fn read(mut self, paths: &[PathBuf]) -> Result<Recording, ReadError> {
        let endings = read_all(paths, &mut self)?;
        let Logged { mut recording, samples, snapshots, .. } = self;
        samples_in_order(&mut recording.samples, &samples);
        snapshots_in_order(&mut recording.snapshots, &snapshots);
        let broken: Vec<String> =
            endings.iter().zip(paths).filter_map(|(ending, path)| ending.words(path)).collect();
        recording.broken = (!broken.is_empty()).then(|| broken.join("; "));
        if recording.samples.is_empty() {
            let found = match recording.topics.as_slice() {
                [] => "no message".to_owned(),
                topics => topics.join(", "),
            };
            return Err(ReadError::of(&paths[0])(ReadProblem::NoSamples { found }));
        }
        Ok(recording)
    }
}

/// Returns the trains of samples, in order, each once.
pub fn trains_of(samples: impl Iterator<Item = u64>) -> Vec<u64> {
    samples.collect::<BTreeSet<u64>>().into_iter().collect()
}

/// Puts samples into order by the times at which they were logged, each once.
fn samples_in_order(samples: &mut Vec<TrainSample>, logged: &[u64]) {
    put_in_order(samples, logged, |it| Place {
        of: (it.train_id, 0),
        published_ns: it.published_ns,
        number: (0, it.sequence),
    });
}

/// The same of snapshots.
fn snapshots_in_order(snapshots: &mut Vec<ParameterSnapshot>, logged: &[u64]) {
    put_in_order(snapshots, logged, |it| Place {
        of: (it.train_id, it.pipeline_index),
        published_ns: it.published_ns,
        number: (it.epoch, it.sequence),
    });
}

/// Place of a message among those of its controller or pipeline.
struct Place {
    of: (u64, u32),
    published_ns: i64,
    number: (u64, u64),
}

/// Sorts messages by the times at which they were logged where any stands behind a later one, and drops those that
/// stand there twice. A clock that was set back, or numbers that begin anew, are no such order: the other goes on.
fn put_in_order<M: Copy + PartialEq>(
    messages: &mut Vec<M>,
    logged: &[u64],
    place: impl Fn(&M) -> Place,
) {
    let mut before: HashMap<(u64, u32), (u64, Place)> = HashMap::new();
    let is_behind = |(message, &time): (&M, &u64)| {
        let own = place(message);
        let falls = before.get(&own.of).is_some_and(|(earlier, it)| {
            time <= *earlier && own.published_ns <= it.published_ns && own.number <= it.number
        });
        before.insert(own.of, (time, own));
        falls
    };
    if !messages.iter().zip(logged).any(is_behind) {
        return;
    }
    let mut sorted: Vec<(u64, M)> = logged.iter().copied().zip(messages.drain(..)).collect();
    sorted.sort_by_key(|(time, message)| {
        let own = place(message);
        (*time, own.published_ns, own.number, own.of)
    });
    messages.extend(sorted.into_iter().map(|(_, message)| message));
    messages.dedup();
}
