//! A real folder, with a record of the states in which a power cut may leave it.

use std::io::{self, Write};
use std::path::Path;

use dynocar::storage::{Disk, Rights, Storage};

use super::LossyDisk;

/// The file system, with a note of each request.
#[derive(Clone, Debug)]
pub struct NotedDisk {
    /// The disk that notes the requests.
    pub notes: LossyDisk,
}

impl Storage for NotedDisk {
    fn write_new(&self, path: &Path, content: &[u8], rights: &Rights) -> io::Result<()> {
        Disk.write_new(path, content, rights)?;
        self.notes.write_new(path, content, rights)
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn Write + Send>> {
        Ok(Box::new(Both(Disk.create(path)?, self.notes.create(path)?)))
    }

    fn sync_file(&self, path: &Path) -> io::Result<()> {
        self.notes.sync_file(path)
    }

    fn link(&self, from: &Path, to: &Path) -> io::Result<()> {
        Disk.link(from, to)?;
        self.notes.link(from, to)
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        Disk.rename(from, to)?;
        self.notes.rename(from, to)
    }

    fn rename_new(&self, from: &Path, to: &Path) -> io::Result<()> {
        Disk.rename_new(from, to)?;
        self.notes.rename_new(from, to)
    }

    fn make_folder(&self, path: &Path) -> io::Result<()> {
        Disk.make_folder(path)?;
        self.notes.make_folder(path)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        Disk.remove(path)?;
        self.notes.remove(path)
    }

    fn sync_directory(&self, path: &Path) -> io::Result<()> {
        self.notes.sync_directory(path)
    }
}

/// A file of the system and its notes.
struct Both(Box<dyn Write + Send>, Box<dyn Write + Send>);

impl Write for Both {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.0.write(bytes)?;
        self.1.write_all(&bytes[..written])?;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}
