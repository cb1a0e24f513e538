//! A disk that loses unsynced writes: every state in which a power cut may leave it.
//!
//! The disk takes the requests of [`Storage`] and notes each step. After a cut each name whose change was not synced is
//! changed or unchanged, in any combination; of the unsynced bytes of a file, none, half or all are there, or as many
//! zeros. A renaming happens completely or not at all, as on every journalling file system.
//!
//! [`NotedDisk`] does the same and also writes to a real folder, for tests that also read the files.

mod noted;
mod steps;

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use dynocar::storage::{Rights, Storage};

pub use noted::NotedDisk;
pub use steps::Left;
use steps::{AfterSteps, CutStep, apply};

/// Duty that a disk neglects, to show that the tests notice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Neglect {
    /// None.
    Nothing,
    /// Bytes are never brought to the disk.
    Bytes,
    /// Names are never brought to the disk.
    Names,
}

/// Requests to a disk.
#[derive(Debug)]
struct Asked {
    neglect: Neglect,
    steps: Vec<CutStep>,
    /// Files by name as the running system sees them.
    names: BTreeMap<PathBuf, usize>,
    files: usize,
}

impl Asked {
    fn note(&mut self, step: CutStep) {
        let is_neglected = match step {
            CutStep::SyncBytes { .. } => self.neglect == Neglect::Bytes,
            CutStep::SyncNames { .. } => self.neglect == Neglect::Names,
            _ => false,
        };
        if !is_neglected {
            self.steps.push(step);
        }
    }

    fn make(&mut self, path: &Path) -> io::Result<usize> {
        if self.names.contains_key(path) {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        let file = self.files;
        self.files += 1;
        self.names.insert(path.into(), file);
        self.note(CutStep::Make { path: path.into(), file });
        Ok(file)
    }

    fn file(&self, path: &Path) -> io::Result<usize> {
        Ok(self.names.get(path).copied().ok_or(io::ErrorKind::NotFound)?)
    }
}

/// The disk, with all that was asked of it.
#[derive(Clone, Debug)]
pub struct LossyDisk {
    asked: Arc<Mutex<Asked>>,
}

impl LossyDisk {
    /// Returns an empty disk.
    pub fn new(neglect: Neglect) -> Self {
        let names = BTreeMap::new();
        let asked = Asked { neglect, steps: Vec::new(), names, files: 0 };
        LossyDisk { asked: Arc::new(Mutex::new(asked)) }
    }

    fn asked(&self) -> MutexGuard<'_, Asked> {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Steps so far: power may be cut after any number of them.
    pub fn steps(&self) -> usize {
        self.asked().steps.len()
    }

    /// Returns everything that a cut after `count` steps may leave.
    pub fn left_after(&self, count: usize) -> Vec<Left> {
        let mut disk = AfterSteps::default();
        self.asked().steps[..count].iter().for_each(|step| disk.take(step));
        disk.left()
    }
}

impl Storage for LossyDisk {
    fn write_new(&self, path: &Path, content: &[u8], _: &Rights) -> io::Result<()> {
        let mut asked = self.asked();
        let file = asked.make(path)?;
        asked.note(CutStep::Write { file, bytes: content.into() });
        asked.note(CutStep::SyncBytes { file });
        Ok(())
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn Write + Send>> {
        let file = self.asked().make(path)?;
        Ok(Box::new(Growing { disk: self.clone(), file }))
    }

    fn sync_file(&self, path: &Path) -> io::Result<()> {
        let mut asked = self.asked();
        let file = asked.file(path)?;
        asked.note(CutStep::SyncBytes { file });
        Ok(())
    }

    fn link(&self, from: &Path, to: &Path) -> io::Result<()> {
        let mut asked = self.asked();
        let file = asked.file(from)?;
        asked.names.insert(to.into(), file);
        asked.note(CutStep::Link { to: to.into(), file });
        Ok(())
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        let mut asked = self.asked();
        let file = asked.names.remove(from).ok_or(io::ErrorKind::NotFound)?;
        asked.names.insert(to.into(), file);
        asked.note(CutStep::Rename { from: from.into(), to: to.into(), file });
        Ok(())
    }

    fn rename_new(&self, from: &Path, to: &Path) -> io::Result<()> {
        let mut asked = self.asked();
        if asked.names.keys().any(|name| name.starts_with(to)) {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        if asked.names.contains_key(from) {
            drop(asked);
            return self.rename(from, to);
        }
        let step = CutStep::RenameFolder { from: from.into(), to: to.into() };
        apply(&step, &mut asked.names);
        asked.note(step);
        Ok(())
    }

    // A folder is there with the files in it.
    fn make_folder(&self, _: &Path) -> io::Result<()> {
        Ok(())
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        let mut asked = self.asked();
        asked.names.remove(path).ok_or(io::ErrorKind::NotFound)?;
        asked.note(CutStep::Remove { path: path.into() });
        Ok(())
    }

    fn sync_directory(&self, path: &Path) -> io::Result<()> {
        self.asked().note(CutStep::SyncNames { folder: path.into() });
        Ok(())
    }
}

/// A file of the disk that is written bit by bit.
struct Growing {
    disk: LossyDisk,
    file: usize,
}

impl Write for Growing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.disk.asked().note(CutStep::Write { file: self.file, bytes: bytes.into() });
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
