//! Reading MCAP files as far as they are whole.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use dynocar_shared::{ParameterSnapshot, TrainSample};
use mcap::records::{MessageHeader, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, parse_record};
use prost::Message;

use crate::error::{CopyError, ReadError, ReadProblem};
use crate::event::Event;
use crate::schema::{EVENT, SAMPLE, SNAPSHOT, is_described_alike};
use crate::topic::{decode_sample, decode_snapshot};

/// How a file ends.
#[derive(Clone, Debug, PartialEq)]
pub enum FileEnding {
    /// The file ends with its index and its last bytes.
    Whole,
    /// The file breaks off before its end, or is damaged.
    Broken {
        /// Bytes up to which it was read.
        read_bytes: u64,
        /// The file's length.
        file_bytes: u64,
        /// Reason why the reading stopped.
        reason: String,
    },
}

impl FileEnding {
    /// Returns where a file breaks off, in words; `None` for a whole one.
    pub fn words(&self, path: &Path) -> Option<String> {
        let FileEnding::Broken { read_bytes, file_bytes, reason } = self else { return None };
        let shown = path.display();
        Some(format!(
            "{shown}: breaks off: {read_bytes} of {file_bytes} bytes can be read ({reason})"
        ))
    }
}

/// An item of a recording, in the order of writing.
#[derive(Clone, Debug)]
pub enum RecordingItem<'a> {
    /// Names and values.
    Metadata(&'a mcap::records::Metadata),
    /// A file.
    Attachment {
        /// Its name.
        name: String,
        /// When it was attached, in ns since 1970.
        log_time: u64,
        /// Its kind.
        media_type: String,
        /// Its content.
        content: &'a [u8],
    },
    /// A controller's sample.
    Sample(&'a TrainSample),
    /// A pipeline's snapshot.
    Snapshot(&'a ParameterSnapshot),
    /// An event.
    Event(&'a Event),
}

/// A message or a channel of another writer, for programs that copy a file.
#[derive(Debug)]
pub struct Raw<'a> {
    /// The channel.
    pub channel: &'a ChannelInfo,
    /// Number and times.
    pub header: MessageHeader,
    /// The message.
    pub data: &'a [u8],
}

/// A channel as the file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelInfo {
    /// The topic.
    pub topic: String,
    /// Encoding of its messages.
    pub encoding: String,
    /// Metadata by the writer.
    pub metadata: std::collections::BTreeMap<String, String>,
    /// Name, encoding and bytes of its schema; `None` without one.
    pub schema: Option<(String, String, Vec<u8>)>,
}

/// Receiver of the contents of a file.
pub trait Visitor {
    /// Why nothing more is taken.
    type Error: From<ReadError>;

    /// Takes something of ours.
    ///
    /// # Errors
    ///
    /// When nothing more is taken.
    fn item(&mut self, item: RecordingItem<'_>) -> Result<(), Self::Error>;

    /// Takes every message, ours or not, before it is read.
    ///
    /// # Errors
    ///
    /// When nothing more is taken.
    fn raw(&mut self, _: &Raw<'_>) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// Nobody.
impl Visitor for () {
    type Error = CopyError;

    fn item(&mut self, _: RecordingItem<'_>) -> Result<(), CopyError> {
        Ok(())
    }
}

/// Largest ratio of a chunk's bytes to those of its compressed file.
const EXPANSION_MAX: u64 = 64;
/// Largest size in bytes of a chunk that is larger than its file.
const EXPANDED_BYTES: u64 = 256 << 20;

/// Reads a file and passes on its contents as far as it is whole.
///
/// # Errors
///
/// When it is no recording that can be read, or nothing more is taken; a file that breaks off is one.
pub fn read<V: Visitor>(path: &Path, visitor: &mut V) -> Result<FileEnding, V::Error> {
    let unreadable = ReadError::of::<std::io::Error>(path);
    let not_mcap = || ReadError::of(path)(ReadProblem::NotMcap).into();
    let mut file = File::open(path).map_err(&unreadable)?;
    let file_bytes = file.metadata().map_err(&unreadable)?.len();
    // A damaged length asks for little more memory than a compressed file of this size may need.
    let expanded = file_bytes.saturating_mul(EXPANSION_MAX).min(EXPANDED_BYTES);
    let limit = usize::try_from(file_bytes.max(expanded)).unwrap_or(usize::MAX);
    let options = LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(limit);
    let mut reader = LinearReader::new_with_options(options);
    let mut records =
        Records { path, schemas: HashMap::new(), channels: HashMap::new(), messages: 0 };
    let mut given = 0;
    let mut good = 0;
    let reason = loop {
        match reader.next_event() {
            None => return Ok(FileEnding::Whole),
            Some(Ok(LinearReadEvent::ReadRequest(need))) => {
                let read = file.read(reader.insert(need)).map_err(&unreadable)?;
                reader.notify_read(read);
                given += read as u64;
            }
            Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                match records.take(opcode, data, visitor) {
                    Ok(()) => good = given,
                    Err(Stop::Refused(error)) => return Err(error),
                    Err(Stop::Broken(error)) => break error,
                }
            }
            Some(Err(McapError::BadMagic)) if good == 0 => return Err(not_mcap()),
            Some(Err(McapError::UnexpectedEof)) if given < 8 => return Err(not_mcap()),
            Some(Err(error)) => break error,
        }
    };
    let reason = reason.to_string();
    Ok(FileEnding::Broken { read_bytes: good, file_bytes, reason })
}

/// Why reading stops.
enum Stop<E> {
    /// The file is damaged from here on.
    Broken(McapError),
    /// The file cannot be read, or nothing more is taken.
    Refused(E),
}

impl<E> From<McapError> for Stop<E> {
    fn from(error: McapError) -> Self {
        Stop::Broken(error)
    }
}

struct Records<'p> {
    path: &'p Path,
    schemas: HashMap<u16, (String, String, Vec<u8>)>,
    channels: HashMap<u16, ChannelInfo>,
    messages: u64,
}

impl Records<'_> {
    fn take<V: Visitor>(
        &mut self,
        opcode: u8,
        data: &[u8],
        visitor: &mut V,
    ) -> Result<(), Stop<V::Error>> {
        if opcode == op::ATTACHMENT && !has_room_for_its_parts(data) {
            return Err(Stop::Broken(McapError::UnexpectedEof));
        }
        let given = match parse_record(opcode, data)? {
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, (header.name, header.encoding, data.into_owned()));
                Ok(())
            }
            Record::Channel(it) => {
                let schema = self.schemas.get(&it.schema_id).cloned();
                let (topic, encoding) = (it.topic, it.message_encoding);
                let known = ChannelInfo { topic, encoding, metadata: it.metadata, schema };
                let required = require_our_layout(&known);
                self.channels.insert(it.id, known);
                required.map_err(|problem| ReadError::of(self.path)(problem).into())
            }
            Record::Message { header, data } => {
                self.messages += 1;
                return self.message(header, &data, visitor);
            }
            Record::Metadata(metadata) => visitor.item(RecordingItem::Metadata(&metadata)),
            Record::Attachment { header, data, .. } => {
                let (name, log_time) = (header.name, header.log_time);
                let media_type = header.media_type;
                visitor.item(RecordingItem::Attachment {
                    name,
                    log_time,
                    media_type,
                    content: &data,
                })
            }
            _ => Ok(()),
        };
        given.map_err(Stop::Refused)
    }

    fn message<V: Visitor>(
        &self,
        header: MessageHeader,
        data: &[u8],
        visitor: &mut V,
    ) -> Result<(), Stop<V::Error>> {
        let Some(channel) = self.channels.get(&header.channel_id) else {
            let unknown = McapError::UnknownChannel(header.sequence, header.channel_id);
            return Err(Stop::Broken(unknown));
        };
        let mut give = || {
            visitor.raw(&Raw { channel, header, data })?;
            let malformed = |source| {
                let (topic, number) = (channel.topic.clone(), self.messages);
                ReadError::of(self.path)(ReadProblem::Malformed { topic, number, source })
            };
            match channel.schema.as_ref().map(|it| it.0.as_str()) {
                Some(SAMPLE) => {
                    visitor.item(RecordingItem::Sample(&decode_sample(data).map_err(malformed)?))
                }
                Some(SNAPSHOT) => visitor
                    .item(RecordingItem::Snapshot(&decode_snapshot(data).map_err(malformed)?)),
                Some(EVENT) => {
                    let event = Event::decode(data).map_err(|error| malformed(error.into()))?;
                    visitor.item(RecordingItem::Event(&event))
                }
                _ => Ok(()),
            }
        };
        give().map_err(Stop::Refused)
    }
}

fn require_our_layout(channel: &ChannelInfo) -> Result<(), ReadProblem> {
    let expected = match channel.schema.as_ref().map(|it| it.0.as_str()) {
        Some(SAMPLE) => TrainSample::WIRE_NAME,
        Some(SNAPSHOT) => ParameterSnapshot::WIRE_NAME,
        _ => return Ok(()),
    };
    let topic = channel.topic.clone();
    match channel.metadata.get("layout") {
        Some(found) if found == expected => Ok(()),
        Some(found) => Err(ReadProblem::OtherSchema { topic, expected, found: found.clone() }),
        // Tools that rewrite messages keep their descriptions, but not the channel's metadata.
        None if channel.schema.as_ref().is_some_and(|it| is_described_alike(&it.0, &it.2)) => {
            Ok(())
        }
        None => Err(ReadProblem::NoLayout { topic }),
    }
}

/// Returns whether an attachment's record holds its two times, its two texts, its length and its checksum:
/// the parser takes that for granted.
fn has_room_for_its_parts(record: &[u8]) -> bool {
    let text_end = |start: usize| {
        let length = record.get(start..start.checked_add(4)?)?.first_chunk::<4>()?;
        start.checked_add(4)?.checked_add(u32::from_le_bytes(*length) as usize)
    };
    let parts_end = text_end(16).and_then(text_end).and_then(|end| end.checked_add(8 + 4));
    parts_end.is_some_and(|end| end <= record.len())
}
