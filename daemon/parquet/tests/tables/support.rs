//! Recordings and tables for the tests.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use arrow_array::{ArrayRef, RecordBatch};
use dynocar_mcap::columns::RecordingRow;
use dynocar_mcap::error::ReadError;
use dynocar_mcap::reading::{Raw, RecordingItem, Visitor, read};
use dynocar_mcap::recording::Metadata;
use dynocar_mcap::writing::RecordingWriter;
use parquet::arrow::ArrowWriter;

/// Contents of a file, message by message.
#[derive(Debug, Default, PartialEq)]
pub struct Everything {
    /// Topic, number, both times, bytes.
    pub messages: Vec<(String, u32, u64, u64, Vec<u8>)>,
    /// Name, time, content.
    pub attached: Vec<(String, u64, Vec<u8>)>,
    pub metadata: Vec<Metadata>,
}

impl Everything {
    pub fn of(path: &Path) -> Self {
        let mut everything = Everything::default();
        let ending = read(path, &mut everything).expect("a recording");
        assert!(ending.words(path).is_none(), "it is whole");
        everything
    }
}

impl Visitor for Everything {
    type Error = ReadError;

    fn item(&mut self, item: RecordingItem<'_>) -> Result<(), ReadError> {
        match item {
            RecordingItem::Metadata(it) => self.metadata.push(it.clone()),
            RecordingItem::Attachment { name, log_time, content, .. } => {
                self.attached.push((name, log_time, content.into()));
            }
            _ => {}
        }
        Ok(())
    }

    fn raw(&mut self, raw: &Raw<'_>) -> Result<(), ReadError> {
        let (topic, header) = (raw.channel.topic.clone(), &raw.header);
        let times = (header.log_time, header.publish_time);
        self.messages.push((topic, header.sequence, times.0, times.1, raw.data.into()));
        Ok(())
    }
}

/// Writes a recording with a configuration attached.
pub fn write(path: &Path, messages: &[(u64, RecordingRow)]) {
    let mut writer = RecordingWriter::copy(File::create_new(path).unwrap()).unwrap();
    writer.metadata("dynocar", &[("version", "of old".to_owned())]).unwrap();
    let files =
        [("configuration-1/daemon.toml", "[daemon]\n"), ("configuration-1/train-1.toml", TRAIN)];
    for (name, text) in files {
        writer.log_next_at(7);
        writer.attach(name, text.as_bytes(), 0).unwrap();
    }
    writer.metadata("configuration", &[("number", "1".into()), ("seen", "2".into())]).unwrap();
    for (log_time, row) in messages {
        writer.log_next_at(*log_time);
        writer.write(row.message()).unwrap();
    }
    writer.finish().unwrap();
}

pub const TRAIN: &str = "[train]\nmass_t = 100\nlength_m = 80\nrotating_mass_factor = 0.05\n\
    [resistance]\na = 1\nb = 0\nc = 0\n";

/// A Parquet file of somebody else.
pub fn table(path: &Path, columns: Vec<(&str, ArrayRef)>) {
    let batch = RecordBatch::try_from_iter(columns).unwrap();
    let mut writer =
        ArrowWriter::try_new(File::create(path).unwrap(), batch.schema(), None).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
}

/// An array that is shared.
pub fn shared(array: impl arrow_array::Array + 'static) -> ArrayRef {
    Arc::new(array)
}

/// Carries out a command of the workshop; gives the message of a failure and its exit status.
pub fn command(words: &[&str]) -> Result<(), (String, u8)> {
    dynocar_workshop::cli::execute(words.iter().copied()).map_err(|failure| {
        let answer = failure.answer().expect("a failure in words");
        (answer.message, answer.exit_status)
    })
}
