//! The files of a recording: one, or many of which the oldest go.

use std::cell::Cell;
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant, SystemTime};

use dynocar::output::tell;
use dynocar_client::monotonic_now_ns;
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};
use mcap::McapError;

use super::configuration::Configuration;
use super::keeping::{self, KeepError, Keeper};
use super::{RecordError, Recorded};
use crate::event::{Event, EventKind};
use crate::lanes::event;
use crate::writing::{CONFIGURATION, RecordingWriter, WallClock, folder_of_configuration};

/// When a file is full, and how much of them is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rotation {
    /// Bytes after which a new file is begun.
    pub bytes: Option<u64>,
    /// Time after which a new file is begun.
    pub age: Option<Duration>,
    /// The most bytes that all files of the recording take; the oldest are removed.
    pub keep_bytes: Option<u64>,
    /// The age after which a file is removed.
    pub keep_age: Option<Duration>,
}

impl Rotation {
    fn is_on(self) -> bool {
        self.bytes.is_some() || self.age.is_some()
    }
}

/// A file, with the bytes that were handed to the system.
struct Counted {
    file: File,
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

/// The file that is written, and what every new one has to begin with.
pub struct Files {
    output: PathBuf,
    rotation: Rotation,
    path: PathBuf,
    writer: RecordingWriter<Counted>,
    bytes: Rc<Cell<u64>>,
    begun: Instant,
    /// The newest configuration, its number and when it was seen.
    configuration: Option<(Configuration, u32, i64)>,
    recorded: Recorded,
    /// What is kept for good, for a flight recorder.
    keeper: Option<Keeper>,
}

impl Files {
    /// Begins the first file. With rotation its name is the output's with a number that is greater
    /// than all that are there.
    ///
    /// # Errors
    ///
    /// When the name is taken or the file cannot be written.
    pub fn begin(output: &Path, rotation: Rotation) -> Result<Self, RecordError> {
        let path = if rotation.is_on() { next(output) } else { output.to_path_buf() };
        let (writer, bytes) = open(&path)?;
        Ok(Files {
            output: output.into(),
            rotation,
            path,
            writer,
            bytes,
            begun: Instant::now(),
            configuration: None,
            recorded: Recorded::default(),
            keeper: None,
        })
    }

    /// Keeps for good what lies around the events that are reasons to.
    pub fn set_keeper(&mut self, keeper: Keeper) {
        self.keeper = Some(keeper);
        self.tell_keeper(|keeper, files| keeper.begun(files));
    }

    /// A problem of keeping is told, and stops nothing.
    fn tell_keeper(&mut self, work: impl FnOnce(&mut Keeper, &[PathBuf]) -> Result<(), KeepError>) {
        let Some(keeper) = &mut self.keeper else { return };
        let files: Vec<PathBuf> = numbered(&self.output).into_iter().map(|it| it.1).collect();
        if let Err(problem) = work(keeper, &files) {
            tell(&problem.to_string());
        }
    }

    /// The file that is written.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a sample.
    ///
    /// # Errors
    ///
    /// When it cannot be written; so for every other item.
    pub fn sample(&mut self, sample: &TrainSample) -> Result<(), RecordError> {
        self.recorded.samples += 1;
        let written = self.writer.sample(sample, sample.published_ns);
        self.told(written)
    }

    /// Writes a snapshot.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn snapshot(&mut self, snapshot: &ParameterSnapshot) -> Result<(), RecordError> {
        self.recorded.snapshots += 1;
        let written = self.writer.snapshot(snapshot);
        self.told(written)
    }

    /// Writes an event.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.recorded.events += 1;
        if event.kind == EventKind::SamplesLost as i32 {
            self.recorded.lost += event.count.unwrap_or(0);
        }
        let written = self.writer.event(event);
        self.told(written)?;
        if keeping::is_reason(event) {
            self.tell_keeper(|keeper, files| keeper.keep(event, files));
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
        self.told(written)
    }

    /// Hands everything to the system, and begins a new file where this one is full.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        if let Some(text) = self.keeper.as_ref().and_then(Keeper::request) {
            self.event(&event(TrainId(0), EventKind::KeepRequested, text))?;
        }
        self.writer.set_clock(WallClock::now());
        let written = self.writer.flush();
        self.told(written)?;
        let is_full = self.rotation.bytes.is_some_and(|most| self.bytes.get() >= most)
            || self.rotation.age.is_some_and(|most| self.begun.elapsed() >= most);
        if is_full { self.rotate() } else { Ok(()) }
    }

    fn rotate(&mut self) -> Result<(), RecordError> {
        let path = next(&self.output);
        let (writer, bytes) = open(&path)?;
        let full = std::mem::replace(&mut self.writer, writer);
        let written = full.finish().map(|_| ());
        self.told(written)?;
        (self.path, self.bytes, self.begun) = (path, bytes, Instant::now());
        self.attach_newest()?;
        self.tell_keeper(|keeper, files| keeper.begun(files));
        remove_oldest(&self.output, &self.path, self.rotation);
        Ok(())
    }

    /// Writes index and end of the file.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn finish(self) -> Result<Recorded, RecordError> {
        let path = self.path;
        match self.writer.finish() {
            Ok(_) => Ok(self.recorded),
            Err(source) => Err(RecordError::Write { path, source }),
        }
    }

    fn told(&self, written: Result<(), McapError>) -> Result<(), RecordError> {
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

fn open(path: &Path) -> Result<(RecordingWriter<Counted>, Rc<Cell<u64>>), RecordError> {
    let file = File::create_new(path).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => RecordError::Taken { path: path.into() },
        _ => RecordError::Write { path: path.into(), source: error.into() },
    })?;
    let bytes = Rc::new(Cell::new(0));
    let counted = Counted { file, bytes: Rc::clone(&bytes) };
    let writer = RecordingWriter::new(counted, WallClock::now())
        .map_err(|source| RecordError::Write { path: path.into(), source })?;
    Ok((writer, bytes))
}

/// The files of a rotating recording with their numbers, the oldest first.
fn numbered(output: &Path) -> Vec<(u64, PathBuf)> {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy().into_owned() + "-";
    let number_of = |path: &Path| {
        let name = path.file_name()?.to_str()?.strip_prefix(&stem)?.strip_suffix(".mcap")?;
        (name.len() == DIGITS).then(|| name.parse().ok())?
    };
    let folder = dynocar::storage::folder_of(output);
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<(u64, PathBuf)> =
        entries.filter_map(|it| Some((number_of(&it.path())?, it.path()))).collect();
    files.sort();
    files
}

/// Digits of a file's number.
const DIGITS: usize = 6;

/// The name of the next file: `run-000007.mcap` for `run.mcap`.
fn next(output: &Path) -> PathBuf {
    let number = numbered(output).last().map_or(1, |newest| newest.0 + 1);
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    output.with_file_name(format!("{stem}-{number:0DIGITS$}.mcap"))
}

/// Removes the files that are too old, and the oldest until the rest takes no more than it may; never the
/// one that is written.
fn remove_oldest(output: &Path, written: &Path, rotation: Rotation) {
    let most = rotation.keep_bytes.unwrap_or(u64::MAX);
    let oldest = rotation.keep_age.and_then(|age| SystemTime::now().checked_sub(age));
    let found = |(_, path): (u64, PathBuf)| {
        let known = std::fs::metadata(&path).ok()?;
        Some((known.modified().ok()?, known.len(), path))
    };
    let files: Vec<_> = numbered(output).into_iter().filter_map(found).collect();
    let mut total: u64 = files.iter().map(|it| it.1).sum();
    for (modified, length, path) in files.iter().filter(|it| it.2 != written) {
        let is_too_old = oldest.is_some_and(|oldest| *modified < oldest);
        if total > most || is_too_old {
            total -= length;
            // One that cannot be removed is told of when the disk is full.
            let _ = std::fs::remove_file(path);
        }
    }
}
