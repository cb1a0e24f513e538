//! Copies of recordings: everything that can be read, with an index and an end.

use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use dynocar::storage::{Disk, Storage, settle};
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, McapError, WriteOptions, Writer};

use super::error::{CopyError, ReadError, ReadProblem, WriteError};
use super::reading::{ChannelInfo, FileEnding, Raw, RecordingItem, Visitor, read};

type Output = BufWriter<Box<dyn Write + Send>>;

/// The writer of a copy.
pub type CopyWriter = Writer<NoSeek<Output>>;

/// Summary of the copied messages.
#[derive(Clone, Debug, PartialEq)]
pub struct Copied {
    /// Messages.
    pub messages: u64,
    /// Attached files.
    pub attachments: u64,
    /// How each file ended.
    pub endings: Vec<FileEnding>,
}

/// Copies the readable part of files, in their order, into a new one, and brings it to the disk; the files may come
/// from other recorders. A file that is attached to several of them is copied once. If a power cut left one of several
/// files empty, the others are copied nevertheless.
///
/// # Errors
///
/// If one is not an MCAP file, or the new one cannot be written; then no file is left.
pub fn recover(from: &[PathBuf], to: &Path) -> Result<Copied, CopyError> {
    recover_on(&Disk, from, to)
}

/// Returns the same on any storage.
///
/// # Errors
///
/// As [`recover`].
pub fn recover_on(storage: &dyn Storage, from: &[PathBuf], to: &Path) -> Result<Copied, CopyError> {
    copy(storage, from, to, &mut (), |_, ()| Ok(()))
}

/// The same; `watcher` is given the contents of the files, and `add` writes the messages that are to follow.
///
/// # Errors
///
/// As [`recover`], and those of `add`.
pub fn copy<V: Visitor<Error = CopyError>, E: From<CopyError>>(
    storage: &dyn Storage,
    from: &[PathBuf],
    to: &Path,
    watcher: &mut V,
    add: impl FnOnce(&mut CopyWriter, &mut V) -> Result<(), E>,
) -> Result<Copied, E> {
    let failed = |error| CopyError::from(WriteError::of::<McapError>(to)(error));
    let file = storage.create(to).map_err(|error| failed(error.into()))?;
    let options = WriteOptions::new().profile("dynocar").disable_seeking(true).compression(None);
    let writer = options.create(NoSeek::new(BufWriter::new(file))).map_err(failed)?;
    let mut copier = Copier {
        writer,
        to,
        channels: HashMap::new(),
        carried: HashSet::new(),
        messages: 0,
        attachments: 0,
        watcher,
    };
    let read = from.iter().map(|path| read_among(from.len(), path, &mut copier));
    let read: Result<Vec<FileEnding>, CopyError> = read.collect();
    let Copier { mut writer, messages, attachments, watcher, .. } = copier;
    let filled = read.map_err(E::from).and_then(|endings| {
        add(&mut writer, watcher)?;
        writer.finish().map_err(failed)?;
        Ok(endings)
    });
    // A writer that is not finished is taken apart, for it would finish when it is dropped.
    let written = writer.into_inner().into_inner().into_inner();
    let done = filled.and_then(|endings| {
        written.map_err(|error| failed(error.into_error().into()))?;
        settle(storage, to).map_err(|error| failed(error.into()))?;
        Ok(Copied { messages, attachments, endings })
    });
    if done.is_err() {
        // It holds nothing that the first does not.
        let _ = storage.remove(to);
    }
    done
}

struct Copier<'v, V> {
    writer: CopyWriter,
    to: &'v Path,
    channels: HashMap<u16, (ChannelInfo, u16)>,
    /// Attached files and metadata that were written, as they were.
    carried: HashSet<Vec<u8>>,
    messages: u64,
    attachments: u64,
    watcher: &'v mut V,
}

impl<V> Copier<'_, V> {
    fn checked(&self, written: Result<(), McapError>) -> Result<(), CopyError> {
        Ok(written.map_err(WriteError::of(self.to))?)
    }

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

    fn other(&mut self, item: RecordingItem<'_>) -> Result<(), McapError> {
        match item {
            RecordingItem::Metadata(metadata) => {
                let key = format!("{metadata:?}").into_bytes();
                if self.carried.insert(key) { self.writer.write_metadata(metadata) } else { Ok(()) }
            }
            RecordingItem::Attachment { name, log_time, media_type, content } => {
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
}

impl<V: Visitor<Error = CopyError>> Visitor for Copier<'_, V> {
    type Error = CopyError;

    fn item(&mut self, item: RecordingItem<'_>) -> Result<(), CopyError> {
        self.watcher.item(item.clone())?;
        let written = self.other(item);
        self.checked(written)
    }

    fn raw(&mut self, raw: &Raw<'_>) -> Result<(), CopyError> {
        self.watcher.raw(raw)?;
        let written = self.message(raw);
        self.checked(written)
    }
}

/// Reads the files of a recording that rotated, in order, as if they were one: contents that each file repeats are
/// given once. Returns how each file ends.
///
/// # Errors
///
/// As [`read_among`], and when they are not the files of one recording in its order.
pub fn read_all<V: Visitor>(
    paths: &[PathBuf],
    visitor: &mut V,
) -> Result<Vec<FileEnding>, V::Error> {
    let (attached, files_of, seen) = (HashMap::new(), HashMap::new(), Vec::new());
    let path = PathBuf::new();
    let mut joined = Joined { visitor, attached, files_of, seen, path, begins: None };
    let mut endings = Vec::new();
    let mut newest: Option<(&PathBuf, u64)> = None;
    for path in paths {
        joined.path.clone_from(path);
        joined.begins = None;
        endings.push(read_among(paths.len(), path, &mut joined)?);
        let Some(begins) = joined.begins else { continue };
        if let Some((before, _)) = newest.filter(|it| begins < it.1) {
            let problem = ReadProblem::OutOfOrder { before: before.clone() };
            return Err(ReadError::of(path)(problem).into());
        }
        newest = Some((path, begins));
    }
    Ok(endings)
}

/// Reads one of several files of a recording. A power cut may leave nothing of the newest but its name, and zeros:
/// among others that is a file that breaks off at its beginning.
///
/// # Errors
///
/// As [`read`].
pub fn read_among<V: Visitor>(
    count: usize,
    path: &Path,
    visitor: &mut V,
) -> Result<FileEnding, V::Error> {
    if count > 1 && is_nothing(path) {
        let file_bytes = std::fs::metadata(path).map_or(0, |it| it.len());
        let reason = "nothing of it was brought to the disk".to_owned();
        return Ok(FileEnding::Broken { read_bytes: 0, file_bytes, reason });
    }
    read(path, visitor)
}

/// Returns true for a file without a byte other than 0, and for one that ends within the first bytes of MCAP.
fn is_nothing(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    let mut start = Vec::new();
    let mut bytes = BufReader::new(file).bytes().map_while(Result::ok);
    start.extend(bytes.by_ref().take(mcap::MAGIC.len()));
    start.len() < mcap::MAGIC.len() && mcap::MAGIC.starts_with(&start)
        || start.iter().all(|&byte| byte == 0) && bytes.all(|byte| byte == 0)
}

/// Several files as one.
struct Joined<'v, V> {
    visitor: &'v mut V,
    attached: HashMap<String, Vec<u8>>,
    seen: Vec<Metadata>,
    /// The file in which each was attached first.
    files_of: HashMap<String, PathBuf>,
    path: PathBuf,
    /// When the file's first message was recorded.
    begins: Option<u64>,
}

impl<V: Visitor> Visitor for Joined<'_, V> {
    type Error = V::Error;

    fn item(&mut self, item: RecordingItem<'_>) -> Result<(), V::Error> {
        match &item {
            RecordingItem::Attachment { name, content, .. } => match self.attached.get(name) {
                Some(known) if known == content => return Ok(()),
                Some(_) => {
                    let name = name.clone();
                    let problem = match self.files_of.get(&name) {
                        Some(before) if *before != self.path => {
                            ReadProblem::OtherRecording { before: before.clone(), name }
                        }
                        _ => ReadProblem::Merged { name },
                    };
                    return Err(ReadError::of(&self.path)(problem).into());
                }
                None => {
                    self.attached.insert(name.clone(), content.to_vec());
                    self.files_of.insert(name.clone(), self.path.clone());
                }
            },
            RecordingItem::Metadata(it) if self.seen.contains(it) => return Ok(()),
            RecordingItem::Metadata(it) => self.seen.push((*it).clone()),
            _ => {}
        }
        self.visitor.item(item)
    }

    fn raw(&mut self, raw: &Raw<'_>) -> Result<(), V::Error> {
        self.begins.get_or_insert(raw.header.log_time);
        self.visitor.raw(raw)
    }
}
