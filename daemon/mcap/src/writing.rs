//! Writing MCAP files without seeking: flushed messages can be read, even after an abrupt end.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::io::Write;
use std::time::{SystemTime, UNIX_EPOCH};

use dynocar_shared::{ParameterSnapshot, TrainSample};
use dynocar_transport::monotonic_now_ns;
pub use mcap::McapError;
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, WriteOptions, Writer};

use crate::schema::DESCRIPTORS;
use crate::topic::{ENCODING, LAYOUT, Message, Topic};

/// Name of the metadata record at the beginning of every recording.
pub const METADATA: &str = "dynocar";
/// Name of the metadata record that belongs to an attached configuration.
pub const CONFIGURATION: &str = "configuration";

/// Returns the folder in which a configuration of this number is attached.
pub fn folder_of_configuration(number: u32) -> String {
    format!("configuration-{number}")
}

/// Bytes after which a chunk ends by itself.
const CHUNK_BYTES: u64 = 1 << 20;
const LIBRARY: &str = concat!("dynocar ", env!("CARGO_PKG_VERSION"));

/// Offset of the wall clock to the host's monotonic clock.
#[derive(Clone, Copy, Debug)]
pub struct WallClock {
    offset_ns: i64,
}

impl WallClock {
    /// Compares both clocks.
    pub fn now() -> Self {
        let wall = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |it| it.as_nanos());
        WallClock { offset_ns: i64::try_from(wall).unwrap_or(i64::MAX) - monotonic_now_ns() }
    }

    /// Returns a clock on which both are the same, for data that was recorded on another host.
    pub fn of_another_host() -> Self {
        WallClock { offset_ns: 0 }
    }

    /// Returns the nanoseconds since 1970 of a moment on the monotonic clock.
    pub fn wall_ns(self, monotonic_ns: i64) -> u64 {
        u64::try_from(self.offset_ns.saturating_add(monotonic_ns)).unwrap_or(0)
    }
}

/// A file that is recorded into.
pub struct RecordingWriter<W: Write> {
    /// `None` once it is finished or has failed.
    writer: Option<Writer<NoSeek<W>>>,
    channels: HashMap<Topic, u16>,
    clock: WallClock,
    /// Time at which the next message is logged, independent of the clock.
    log_time: Option<u64>,
    message: Vec<u8>,
}

impl<W: Write> RecordingWriter<W> {
    /// Begins a file.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn new(output: W, clock: WallClock) -> Result<Self, McapError> {
        let mut recording = RecordingWriter::copy(output)?;
        recording.set_clock(clock);
        recording.metadata(
            METADATA,
            &[
                ("version", env!("CARGO_PKG_VERSION").to_owned()),
                ("sample", TrainSample::WIRE_NAME.to_owned()),
                ("snapshot", ParameterSnapshot::WIRE_NAME.to_owned()),
            ],
        )?;
        Ok(recording)
    }

    /// Begins a file for data that was recorded before, its metadata included.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn copy(output: W) -> Result<Self, McapError> {
        let writer = WriteOptions::new()
            .profile("dynocar")
            .library(LIBRARY)
            .disable_seeking(true)
            // Uncompressed, so that a file that was cut can be read up to its last byte.
            .compression(None)
            .chunk_size(Some(CHUNK_BYTES))
            .create(NoSeek::new(output))?;
        Ok(RecordingWriter {
            writer: Some(writer),
            channels: HashMap::new(),
            clock: WallClock::of_another_host(),
            log_time: None,
            message: Vec::with_capacity(2048),
        })
    }

    /// Logs the next message or attached file at this wall time, independent of the clock.
    pub fn log_next_at(&mut self, log_time: u64) {
        self.log_time = Some(log_time);
    }

    /// Takes another comparison of the clocks for the messages from now on.
    pub fn set_clock(&mut self, clock: WallClock) {
        self.clock = clock;
    }

    /// Writes a metadata record.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn metadata(&mut self, name: &str, pairs: &[(&str, String)]) -> Result<(), McapError> {
        let pairs = pairs.iter().map(|(key, value)| ((*key).to_owned(), value.clone()));
        let metadata = Metadata { name: name.to_owned(), metadata: pairs.collect() };
        self.carry(|writer| writer.write_metadata(&metadata))
    }

    /// Attaches a file.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn attach(
        &mut self,
        name: &str,
        content: &[u8],
        monotonic_ns: i64,
    ) -> Result<(), McapError> {
        let log_time = self.logged(monotonic_ns);
        let media_type = match name.rsplit_once('.').map(|it| it.1) {
            Some("csv") => "text/csv",
            Some("parquet") => "application/vnd.apache.parquet",
            _ => "application/toml",
        };
        self.carry(|writer| {
            writer.attach(&Attachment {
                log_time,
                create_time: log_time,
                name: name.to_owned(),
                media_type: media_type.to_owned(),
                data: Cow::Borrowed(content),
            })
        })
    }

    /// Writes a message, logged when it was published.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn write(&mut self, message: Message<'_>) -> Result<(), McapError> {
        let channel_id = self.channel(message.topic())?;
        let (sequence, at_ns) = message.number_and_time_ns();
        let log_time = self.logged(at_ns);
        // As many bits as the format has room for; the whole number is in the message.
        let sequence = sequence as u32;
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        let mut encoded = std::mem::take(&mut self.message);
        encoded.clear();
        message.encode(&mut encoded);
        let written = self.carry(|writer| writer.write_to_known_channel(&header, &encoded));
        self.message = encoded;
        written
    }

    /// Ends the chunk, so that all that was written can be read.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn flush(&mut self) -> Result<(), McapError> {
        self.carry(Writer::flush)
    }

    /// Writes index and end; gives the file back.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn finish(mut self) -> Result<W, McapError> {
        self.carry(|writer| writer.finish().map(|_| ()))?;
        let writer = self.writer.take().ok_or(McapError::AttemptedWriteAfterFailure)?;
        Ok(writer.into_inner().into_inner())
    }

    fn channel(&mut self, topic: Topic) -> Result<u16, McapError> {
        if let Some(&known) = self.channels.get(&topic) {
            return Ok(known);
        }
        let (schema, layout) = topic.schema_and_layout();
        let metadata = BTreeMap::from([(LAYOUT.to_owned(), layout.to_owned())]);
        let mut id = 0;
        self.carry(|writer| {
            let schema = writer.add_schema(schema, ENCODING, &DESCRIPTORS)?;
            id = writer.add_channel(schema, &topic.name(), ENCODING, &metadata)?;
            Ok(())
        })?;
        self.channels.insert(topic, id);
        Ok(id)
    }

    fn logged(&mut self, monotonic_ns: i64) -> u64 {
        self.log_time.take().unwrap_or_else(|| self.clock.wall_ns(monotonic_ns))
    }

    /// Does something with the writer; a failed one is let go, for it would write on when dropped.
    fn carry(
        &mut self,
        work: impl FnOnce(&mut Writer<NoSeek<W>>) -> Result<(), McapError>,
    ) -> Result<(), McapError> {
        let writer = self.writer.as_mut().ok_or(McapError::AttemptedWriteAfterFailure)?;
        let done = work(writer);
        if done.is_err()
            && let Some(failed) = self.writer.take()
        {
            failed.into_inner();
        }
        done
    }
}

/// Nobody finishes a recording that was not asked to end: it would look whole.
impl<W: Write> Drop for RecordingWriter<W> {
    fn drop(&mut self) {
        if let Some(writer) = self.writer.take() {
            writer.into_inner();
        }
    }
}
