//! A recording that broke off made whole: everything that can be read, with an index and an end.

use std::collections::HashMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{Attachment, McapError, WriteOptions, Writer};

use crate::reading::{ChannelInfo, Ending, Item, Raw, ReadError, Visitor, read};

/// Why a file is not made whole.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// It cannot be read at all.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The whole file cannot be written.
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What stopped it.
        source: McapError,
    },
}

/// What was brought over.
#[derive(Clone, Debug, PartialEq)]
pub struct Recovered {
    /// Messages.
    pub messages: u64,
    /// Attached files.
    pub attachments: u64,
    /// How the broken file ended.
    pub ending: Ending,
}

/// Copies what can be read of a file into a new one, ours or not.
///
/// # Errors
///
/// When it is no MCAP file, or the new one cannot be written; then there is none.
pub fn recover(from: &Path, to: &Path) -> Result<Recovered, RecoverError> {
    let failed = |source| RecoverError::Write { path: to.into(), source };
    let file = File::create_new(to).map_err(|error| failed(error.into()))?;
    let done = copy(from, file);
    if done.is_err() {
        // It holds nothing that the broken one does not.
        let _ = std::fs::remove_file(to);
    }
    done.map_err(|error| match error {
        CopyError::Read(error) => error.into(),
        CopyError::Write(error) => failed(error),
    })
}

enum CopyError {
    Read(ReadError),
    Write(McapError),
}

fn copy(from: &Path, file: File) -> Result<Recovered, CopyError> {
    let options = WriteOptions::new().profile("dynocar");
    let writer = options.create(BufWriter::new(file)).map_err(CopyError::Write)?;
    let mut copier =
        Copier { writer, channels: HashMap::new(), messages: 0, attachments: 0, failed: None };
    let read = read(from, &mut copier);
    let Copier { mut writer, messages, attachments, failed, .. } = copier;
    // A writer that is not to be finished is taken apart, for it would finish when it is dropped.
    match (read, failed) {
        (_, Some(error)) => {
            writer.into_inner();
            Err(CopyError::Write(error))
        }
        (Err(error), None) => {
            writer.into_inner();
            Err(CopyError::Read(error))
        }
        (Ok(ending), None) => {
            writer.finish().map_err(CopyError::Write)?;
            let written = writer.into_inner().into_inner();
            written.map_err(|error| CopyError::Write(error.into_error().into()))?;
            Ok(Recovered { messages, attachments, ending })
        }
    }
}

struct Copier {
    writer: Writer<BufWriter<File>>,
    channels: HashMap<u16, (ChannelInfo, u16)>,
    messages: u64,
    attachments: u64,
    failed: Option<McapError>,
}

impl Copier {
    fn message(&mut self, raw: &Raw<'_>) -> Result<(), McapError> {
        let known = self.channels.get(&raw.header.channel_id);
        let channel_id = match known.filter(|it| it.0 == *raw.channel) {
            Some(known) => known.1,
            None => {
                let ChannelInfo { topic, encoding, metadata, schema } = raw.channel;
                let schema = match schema {
                    Some((name, encoding, data)) => self.writer.add_schema(name, encoding, data)?,
                    None => 0,
                };
                let id = self.writer.add_channel(schema, topic, encoding, metadata)?;
                self.channels.insert(raw.header.channel_id, (raw.channel.clone(), id));
                id
            }
        };
        self.messages += 1;
        self.writer.write_to_known_channel(&MessageHeader { channel_id, ..raw.header }, raw.data)
    }

    fn other(&mut self, item: Item<'_>) -> Result<(), McapError> {
        match item {
            Item::Metadata(metadata) => self.writer.write_metadata(metadata),
            Item::Attachment { name, log_time, media_type, content } => {
                self.attachments += 1;
                self.writer.attach(&Attachment {
                    log_time,
                    create_time: log_time,
                    name,
                    media_type,
                    data: content.into(),
                })
            }
            _ => Ok(()),
        }
    }

    fn note(&mut self, done: Result<(), McapError>) {
        if let Err(error) = done {
            self.failed.get_or_insert(error);
        }
    }
}

impl Visitor for Copier {
    fn item(&mut self, item: Item<'_>) {
        if self.failed.is_none() {
            let done = self.other(item);
            self.note(done);
        }
    }

    fn raw(&mut self, raw: &Raw<'_>) {
        if self.failed.is_none() {
            let done = self.message(raw);
            self.note(done);
        }
    }
}
