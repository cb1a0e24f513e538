//! A recording in memory.

use std::path::Path;

use dynocar_shared::{ParameterSnapshot, TrainSample};

use crate::event::Event;
use crate::reading::{Ending, Item, Raw, ReadError, Visitor, read};

/// What a recording holds, each kind in the order in which it was written.
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
    pub metadata: Vec<mcap::records::Metadata>,
    /// The topics, each once.
    pub topics: Vec<String>,
    /// Where a file broke off, in words.
    pub broken: Option<String>,
}

impl Visitor for Recording {
    fn item(&mut self, item: Item<'_>) {
        match item {
            Item::Metadata(it) => self.metadata.push(it.clone()),
            Item::Attachment { name, content, .. } => {
                self.attachments.push((name, content.into()));
            }
            Item::Sample(it) => self.samples.push(*it),
            Item::Snapshot(it) => self.snapshots.push(*it),
            Item::Event(it) => self.events.push(it.clone()),
        }
    }

    fn raw(&mut self, raw: &Raw<'_>) {
        if self.topics.last() != Some(&raw.channel.topic)
            && !self.topics.contains(&raw.channel.topic)
        {
            self.topics.push(raw.channel.topic.clone());
        }
    }
}

impl Recording {
    /// Reads a recording as far as it is whole.
    ///
    /// # Errors
    ///
    /// When it is none, or holds no sample.
    pub fn load(path: &Path) -> Result<Self, ReadError> {
        let mut recording = Recording::default();
        if let Ending::Broken { read_bytes, file_bytes, reason } = read(path, &mut recording)? {
            let shown = path.display();
            recording.broken = Some(format!(
                "{shown}: breaks off: {read_bytes} of {file_bytes} bytes can be read ({reason})"
            ));
        }
        if recording.samples.is_empty() {
            let found = match recording.topics.as_slice() {
                [] => "no message".to_owned(),
                topics => topics.join(", "),
            };
            return Err(ReadError::NoSamples { path: path.into(), found });
        }
        Ok(recording)
    }

    /// The trains that there are samples of, in order.
    pub fn trains(&self) -> Vec<u64> {
        let mut trains: Vec<u64> = self.samples.iter().map(|it| it.train_id).collect();
        trains.sort_unstable();
        trains.dedup();
        trains
    }
}
