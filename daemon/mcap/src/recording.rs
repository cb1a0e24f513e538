//! A recording in memory.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use dynocar_shared::{ParameterSnapshot, TrainSample};
pub use mcap::records::Metadata;

use crate::error::{ReadError, ReadProblem};
use crate::event::Event;
use crate::joining::read_all;
use crate::order::{samples_in_order, snapshots_in_order};
use crate::reading::{Item, Raw, Visitor};

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

    fn item(&mut self, item: Item<'_>) -> Result<(), ReadError> {
        match item {
            Item::Metadata(it) => self.metadata.push(it.clone()),
            Item::Attachment { name, content, .. } => {
                self.attachments.push((name, content.into()));
            }
            Item::Sample(it) => self.samples.push(*it),
            Item::Snapshot(it) => self.snapshots.push(*it),
            Item::Event(it) => self.events.push(it.clone()),
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

    /// The same of a recording that rotated: its files in order.
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

    /// The same without its snapshots and events, which are counted.
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

    /// The files of the dataset that is attached, by their names in it.
    pub fn attached_dataset(&self) -> impl Iterator<Item = (&str, &Vec<u8>)> {
        let files = self.attachments.iter();
        files.filter_map(|(name, content)| Some((name.strip_prefix(DATASET_FOLDER)?, content)))
    }

    /// The trains that there are samples of, in order.
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

    fn item(&mut self, item: Item<'_>) -> Result<(), ReadError> {
        match item {
            Item::Sample(_) => self.samples.push(self.log_time),
            Item::Snapshot(_) | Item::Event(_) if self.keeps_samples_only => {
                self.recording.left_out += 1;
                return Ok(());
            }
            Item::Snapshot(_) => self.snapshots.push(self.log_time),
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

/// The trains of samples, in order, each once.
pub fn trains_of(samples: impl Iterator<Item = u64>) -> Vec<u64> {
    samples.collect::<BTreeSet<u64>>().into_iter().collect()
}
