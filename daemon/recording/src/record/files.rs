//! The files of a recording: one, or many, of which the oldest are removed.

use std::cell::Cell;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use dynocar::storage::{SharedStorage, folder_of};
use dynocar_mcap::writing::{
    CONFIGURATION, McapError, RecordingWriter, WallClock, folder_of_configuration,
};
use dynocar_shared::TrainId;
use dynocar_transport::monotonic_now_ns;

use super::housekeeping::{Housekeeper, Rotation, Task};
use super::keeping::{self, EventKeeper};
use super::ring::next;
use super::{Configuration, RecordError, Recorded};
use dynocar_mcap::event::{Event, EventKind};
use dynocar_mcap::topic::Message;

/// A file, with the bytes that were handed to the system.
struct Counted {
    file: Box<dyn Write + Send>,
    bytes: Rc<Cell<u64>>,
}

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.bytes.set(self.bytes.get() + written as u64);
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

/// The file that is being written, and the state that every new one begins with.
pub struct RecordingFiles {
    storage: SharedStorage,
    output: PathBuf,
    rotation: Rotation,
    path: PathBuf,
    writer: RecordingWriter<Counted>,
    bytes: Rc<Cell<u64>>,
    begun: Instant,
    /// How often files are brought to the disk; `None` for never.
    sync: Option<Duration>,
    /// When that was asked for.
    synced: Instant,
    /// The newest configuration, its number and when it was seen.
    configuration: Option<(Configuration, u32, i64)>,
    recorded: Recorded,
    housekeeper: Housekeeper,
    /// The folder in which a flight recorder is asked to keep a moment.
    ring: Option<PathBuf>,
}

impl RecordingFiles {
    /// Begins the first file. With rotation its name is the output's with a number that is greater than those of all
    /// files there. Files are brought to the disk no more often than every `sync`, and a keeper keeps for good the
    /// files around the events that are reasons to do so.
    ///
    /// # Errors
    ///
    /// When the name is taken or the file cannot be written.
    pub fn begin(
        storage: SharedStorage,
        output: &Path,
        rotation: Rotation,
        sync: Option<Duration>,
        keeper: Option<EventKeeper>,
    ) -> Result<Self, RecordError> {
        let path = if rotation.is_on() { next(output) } else { output.to_path_buf() };
        let (writer, bytes) = open(&storage, &path)?;
        let ring = keeper.is_some().then(|| folder_of(output).into());
        let mut housekeeper = Housekeeper::new(Arc::clone(&storage), output, rotation, keeper);
        housekeeper.ask(Task::Begun { file: path.clone() });
        Ok(RecordingFiles {
            housekeeper,
            storage,
            output: output.into(),
            rotation,
            path,
            writer,
            bytes,
            begun: Instant::now(),
            sync,
            synced: Instant::now(),
            configuration: None,
            recorded: Recorded::default(),
            ring,
        })
    }

    /// From now on a thread of its own brings files to the disk, keeps and removes them.
    ///
    /// # Errors
    ///
    /// When the system gives no thread.
    pub fn keep_house_in_parallel(self) -> Result<Self, RecordError> {
        let housekeeper = self.housekeeper.in_parallel().map_err(RecordError::Thread)?;
        Ok(RecordingFiles { housekeeper, ..self })
    }

    /// Returns the samples, snapshots and events that no power cut takes any more.
    pub fn lasting(&self) -> u64 {
        self.housekeeper.lasting()
    }

    /// Returns the file that is written.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a message.
    ///
    /// # Errors
    ///
    /// When it cannot be written; so for all else.
    pub fn write(&mut self, message: Message<'_>) -> Result<(), RecordError> {
        match message {
            Message::Sample(_) => self.recorded.samples += 1,
            Message::Snapshot(_) => self.recorded.snapshots += 1,
            Message::Event(event) => {
                self.recorded.events += 1;
                if event.kind() == EventKind::SamplesLost {
                    self.recorded.lost += event.count.unwrap_or(0);
                }
            }
        }
        let written = self.writer.write(message);
        self.checked(written)?;
        if let Message::Event(event) = message
            && keeping::is_reason(event)
        {
            self.housekeeper.ask(Task::Keep { event: event.clone() });
        }
        Ok(())
    }

    /// Attaches the configuration of a daemon that has come, unless it is the one before.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn attach(&mut self, configuration: Configuration) -> Result<(), RecordError> {
        let number = match &self.configuration {
            Some((known, _, _)) if *known == configuration => return Ok(()),
            Some((_, number, _)) => number + 1,
            None => 1,
        };
        self.configuration = Some((configuration, number, monotonic_now_ns()));
        self.attach_newest()
    }

    fn attach_newest(&mut self) -> Result<(), RecordError> {
        let Some((configuration, number, seen_ns)) = &self.configuration else { return Ok(()) };
        let written = attach(&mut self.writer, configuration, *number, *seen_ns);
        self.checked(written)
    }

    /// Hands everything to the system, has it brought to the disk when it is time to, and begins a new file
    /// where this one is full.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        if let Some(text) = self.ring.as_deref().and_then(keeping::requested) {
            let asked = Event::now(TrainId(0), EventKind::KeepRequested, text);
            self.write(Message::Event(&asked))?;
        }
        self.writer.set_clock(WallClock::now());
        let written = self.writer.flush();
        self.checked(written)?;
        let is_full = self.rotation.bytes.is_some_and(|most| self.bytes.get() >= most)
            || self.rotation.age.is_some_and(|most| self.begun.elapsed() >= most);
        if is_full {
            return self.rotate();
        }
        let is_time = self.sync.is_some_and(|every| self.synced.elapsed() >= every);
        if is_time && !self.housekeeper.is_settling() {
            self.settle();
        }
        Ok(())
    }

    /// Has the file brought to the disk, unless that is not wanted.
    fn settle(&mut self) {
        if self.sync.is_some() {
            self.synced = Instant::now();
            let (file, items) = (self.path.clone(), self.recorded.items());
            self.housekeeper.ask(Task::Settle { file, items });
        }
    }

    fn rotate(&mut self) -> Result<(), RecordError> {
        let path = next(&self.output);
        let (writer, bytes) = open(&self.storage, &path)?;
        let full = std::mem::replace(&mut self.writer, writer);
        let written = full.finish().map(|_| ());
        self.checked(written)?;
        self.settle();
        (self.path, self.bytes, self.begun) = (path.clone(), bytes, Instant::now());
        self.attach_newest()?;
        self.housekeeper.ask(Task::Begun { file: path.clone() });
        self.housekeeper.ask(Task::RemoveOldest { written: path });
        Ok(())
    }

    /// Writes index and end of the file, and waits until it is on the disk.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn finish(mut self) -> Result<Recorded, RecordError> {
        let RecordingFiles { writer, path, .. } = self;
        writer.finish().map_err(|source| RecordError::Write { path: path.clone(), source })?;
        if self.sync.is_some() {
            self.housekeeper.ask(Task::Settle { file: path, items: self.recorded.items() });
        }
        self.housekeeper.finish();
        Ok(self.recorded)
    }

    fn checked(&self, written: Result<(), McapError>) -> Result<(), RecordError> {
        written.map_err(|source| RecordError::Write { path: self.path.clone(), source })
    }
}

fn attach(
    writer: &mut RecordingWriter<Counted>,
    configuration: &Configuration,
    number: u32,
    seen_ns: i64,
) -> Result<(), McapError> {
    let folder = folder_of_configuration(number);
    for (name, content) in &configuration.files {
        writer.attach(&format!("{folder}/{name}"), content.as_bytes(), seen_ns)?;
    }
    writer.metadata(
        CONFIGURATION,
        &[
            ("number", number.to_string()),
            ("seen_monotonic_ns", seen_ns.to_string()),
            ("path", configuration.path.display().to_string()),
        ],
    )
}

fn open(
    storage: &SharedStorage,
    path: &Path,
) -> Result<(RecordingWriter<Counted>, Rc<Cell<u64>>), RecordError> {
    let file = storage.create(path).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => RecordError::Taken { path: path.into() },
        ErrorKind::IsADirectory => RecordError::Folder { path: path.into() },
        _ => RecordError::Unmade { path: path.into(), source: error },
    })?;
    let bytes = Rc::new(Cell::new(0));
    let counted = Counted { file, bytes: Rc::clone(&bytes) };
    let writer = RecordingWriter::new(counted, WallClock::now())
        .map_err(|source| RecordError::Write { path: path.into(), source })?;
    Ok((writer, bytes))
}
