//! Copies of recordings: everything that can be read, with an index and an end.

use std::collections::{HashMap, HashSet};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use dynocar::storage::{Storage, settle};
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Attachment, McapError, WriteOptions, Writer};

use crate::joining::read_among;
use crate::reading::{ChannelInfo, Ending, Item, Raw, ReadError, Visitor};

type Output = BufWriter<Box<dyn Write + Send>>;

/// The writer of a copy.
pub type CopyWriter = Writer<NoSeek<Output>>;

/// Why a file is not copied.
#[derive(Debug)]
pub enum CopyError {
    /// It cannot be read at all.
    Read(ReadError),
    /// The copy cannot be written.
    Write(McapError),
}

/// What was copied.
#[derive(Clone, Debug, PartialEq)]
pub struct Copied {
    /// Messages.
    pub messages: u64,
    /// Attached files.
    pub attachments: u64,
    /// How each file ended.
    pub endings: Vec<Ending>,
}

/// Copies what can be read of files, in their order, into a new one, ours or not; `watcher` is given what
/// they hold, and `add` writes what is to follow. A file that is attached to several is so once. When it has
/// returned, the new one is on the disk.
///
/// # Errors
///
/// When one is no MCAP file, or the new one cannot be written; then there is none.
pub fn copy<V: Visitor>(
    storage: &dyn Storage,
    from: &[PathBuf],
    to: &Path,
    watcher: &mut V,
    add: impl FnOnce(&mut CopyWriter, &mut V) -> Result<(), McapError>,
) -> Result<Copied, CopyError> {
    let file = storage.create(to).map_err(|error| CopyError::Write(error.into()))?;
    let done = copy_into(from, BufWriter::new(file), watcher, add).and_then(|copied| {
        settle(storage, to).map_err(|error| CopyError::Write(error.into()))?;
        Ok(copied)
    });
    if done.is_err() {
        // It holds nothing that the first does not.
        let _ = storage.remove(to);
    }
    done
}

fn copy_into<V: Visitor>(
    from: &[PathBuf],
    file: Output,
    watcher: &mut V,
    add: impl FnOnce(&mut CopyWriter, &mut V) -> Result<(), McapError>,
) -> Result<Copied, CopyError> {
    let options = WriteOptions::new().profile("dynocar").disable_seeking(true);
    let writer = options.create(NoSeek::new(file)).map_err(CopyError::Write)?;
    let mut copier = Copier {
        writer,
        channels: HashMap::new(),
        carried: HashSet::new(),
        messages: 0,
        attachments: 0,
        failed: None,
        watcher,
    };
    let read: Result<Vec<Ending>, ReadError> =
        from.iter().map(|path| read_among(from.len(), path, &mut copier)).collect();
    let Copier { mut writer, messages, attachments, mut failed, watcher, .. } = copier;
    if read.is_ok() && failed.is_none() {
        failed = add(&mut writer, watcher).err();
    }
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
        (Ok(endings), None) => {
            writer.finish().map_err(CopyError::Write)?;
            let written = writer.into_inner().into_inner().into_inner();
            written.map_err(|error| CopyError::Write(error.into_error().into()))?;
            Ok(Copied { messages, attachments, endings })
        }
    }
}

struct Copier<'v, V> {
    writer: CopyWriter,
    channels: HashMap<u16, (ChannelInfo, u16)>,
    /// Attached files and metadata that were written, as they were.
    carried: HashSet<Vec<u8>>,
    messages: u64,
    attachments: u64,
    failed: Option<McapError>,
    watcher: &'v mut V,
}

impl<V> Copier<'_, V> {
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
            Item::Metadata(metadata) => {
                let key = format!("{metadata:?}").into_bytes();
                if self.carried.insert(key) { self.writer.write_metadata(metadata) } else { Ok(()) }
            }
            Item::Attachment { name, log_time, media_type, content } => {
                let key = [name.as_bytes(), &[0], content].concat();
                if !self.carried.insert(key) {
                    return Ok(());
                }
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

impl<V: Visitor> Visitor for Copier<'_, V> {
    fn item(&mut self, item: Item<'_>) {
        self.watcher.item(item.clone());
        if self.failed.is_none() {
            let done = self.other(item);
            self.note(done);
        }
    }

    fn raw(&mut self, raw: &Raw<'_>) {
        self.watcher.raw(raw);
        if self.failed.is_none() {
            let done = self.message(raw);
            self.note(done);
        }
    }
}
