//! Files that are replaced as a whole, even when a process dies or the power fails.
//!
//! New content is written into another file, synced to the disk and renamed over the old file; then the directory is
//! synced. At every moment the name holds the old content or the new, never a part of one; when [`replace`] has
//! returned, it holds the new for good. A file or folder that must never be replaced is written in the same way, but
//! gets its name only if nothing else has that name: [`write_once`], [`make_once`].

use std::fs::{File, OpenOptions, Permissions};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rustix::fs::{CWD, RenameFlags, renameat_with};

/// Who may read and write a new file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Rights {
    /// Its owner alone.
    Owner,
    /// The users that the umask admits.
    Usual,
    /// The same as those of another file.
    Like(Permissions),
}

/// Operations of a file system for this module; at each of them power may fail.
pub trait Storage {
    /// Makes a file that was not there, writes it and brings it to the disk.
    ///
    /// # Errors
    ///
    /// The system's answer; a file that was made and not written is removed.
    fn write_new(&self, path: &Path, content: &[u8], rights: &Rights) -> io::Result<()>;

    /// Makes a file that was not there and is to grow: [`Storage::sync_file`] brings its content to the disk,
    /// [`Storage::sync_directory`] its name.
    ///
    /// # Errors
    ///
    /// The system's answer: `AlreadyExists` where the name is taken.
    fn create(&self, path: &Path) -> io::Result<Box<dyn Write + Send>>;

    /// Brings all that was written to a file to the disk.
    ///
    /// # Errors
    ///
    /// The system's answer.
    fn sync_file(&self, path: &Path) -> io::Result<()>;

    /// Gives a file a second name, which has to be free.
    ///
    /// # Errors
    ///
    /// The system's answer.
    fn link(&self, from: &Path, to: &Path) -> io::Result<()>;

    /// Gives a file another name, in place of the file of that name.
    ///
    /// # Errors
    ///
    /// The system's answer.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;

    /// Gives a file or a folder another name, if that is free: `AlreadyExists` where it is not.
    ///
    /// # Errors
    ///
    /// The system's answer.
    fn rename_new(&self, from: &Path, to: &Path) -> io::Result<()>;

    /// Makes a folder for good, with those that it lies in; one that is there stays.
    ///
    /// # Errors
    ///
    /// The system's answer.
    fn make_folder(&self, path: &Path) -> io::Result<()>;

    /// Removes a file.
    ///
    /// # Errors
    ///
    /// The system's answer.
    fn remove(&self, path: &Path) -> io::Result<()>;

    /// Brings the names in a directory to the disk.
    ///
    /// # Errors
    ///
    /// The system's answer.
    fn sync_directory(&self, path: &Path) -> io::Result<()>;
}

/// A file system that several threads use.
pub type SharedStorage = Arc<dyn Storage + Send + Sync>;

/// The file system.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disk;

impl Storage for Disk {
    fn write_new(&self, path: &Path, content: &[u8], rights: &Rights) -> io::Result<()> {
        let mode = if *rights == Rights::Owner { 0o600 } else { 0o666 };
        let mut file = OpenOptions::new().write(true).create_new(true).mode(mode).open(path)?;
        let like = match rights {
            Rights::Like(permissions) => file.set_permissions(permissions.clone()),
            Rights::Owner | Rights::Usual => Ok(()),
        };
        let written = like.and_then(|()| file.write_all(content)).and_then(|()| file.sync_all());
        if written.is_err() {
            // The half-written file is of no use; that it cannot be removed changes nothing.
            let _ = std::fs::remove_file(path);
        }
        written
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn Write + Send>> {
        Ok(Box::new(File::create_new(path)?))
    }

    // The system brings to the disk the data written by any handle of the file.
    fn sync_file(&self, path: &Path) -> io::Result<()> {
        File::open(path)?.sync_data()
    }

    fn link(&self, from: &Path, to: &Path) -> io::Result<()> {
        std::fs::hard_link(from, to)
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        std::fs::rename(from, to)
    }

    fn rename_new(&self, from: &Path, to: &Path) -> io::Result<()> {
        Ok(renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE)?)
    }

    fn make_folder(&self, path: &Path) -> io::Result<()> {
        if path.is_dir() {
            return Ok(());
        }
        let parent = folder_of(path);
        self.make_folder(parent)?;
        match std::fs::create_dir(path) {
            Err(error) if error.kind() != ErrorKind::AlreadyExists => Err(error),
            _ => self.sync_directory(parent),
        }
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        std::fs::remove_file(path)
    }

    fn sync_directory(&self, path: &Path) -> io::Result<()> {
        File::open(path)?.sync_all()
    }
}

/// The last action: the file is replaced, though not yet for good.
const TO_THE_DISK: &str = "bringing the directory to the disk";

/// Failed operation of the system.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {action} failed: {source}")]
pub struct StorageError {
    /// The file or directory.
    pub path: PathBuf,
    /// Attempted action.
    pub action: &'static str,
    /// The system's answer.
    pub source: io::Error,
}

impl StorageError {
    /// Returns whether the file was replaced, and only not brought to the disk for good.
    pub fn is_replaced(&self) -> bool {
        self.action == TO_THE_DISK
    }
}

/// Replaces a file as a whole, through a temporary file in the same directory.
///
/// # Errors
///
/// The system's answer; the file there was stays as it is, unless only its directory could not be
/// brought to the disk.
pub fn replace(
    storage: &(impl Storage + ?Sized),
    path: &Path,
    beside: &Path,
    (content, rights): (&[u8], &Rights),
) -> Result<(), StorageError> {
    write_next_to(storage, beside, content, rights)?;
    if let Err(source) = storage.rename(beside, path) {
        let _ = storage.remove(beside);
        return Err(failed(path, "replacing")(source));
    }
    let directory = folder_of(path);
    storage.sync_directory(directory).map_err(failed(directory, TO_THE_DISK))
}

/// Writes a file that is never replaced, through a temporary file in the same folder, which is made if it is not
/// there.
///
/// # Errors
///
/// The system's answer; `AlreadyExists` where the name is taken, and then nothing is changed.
pub fn write_once(
    storage: &(impl Storage + ?Sized),
    path: &Path,
    beside: &Path,
    content: &[u8],
) -> Result<(), StorageError> {
    let folder = folder_of(path);
    storage.make_folder(folder).map_err(failed(folder, "making the folder"))?;
    write_next_to(storage, beside, content, &Rights::Usual)?;
    if let Err(source) = storage.rename_new(beside, path) {
        let _ = storage.remove(beside);
        return Err(failed(path, "naming")(source));
    }
    storage.sync_directory(folder).map_err(failed(folder, TO_THE_DISK))
}

/// Makes a folder with files that are never replaced, through a temporary folder next to it.
///
/// # Errors
///
/// The system's answer; `AlreadyExists` where the name is taken, and then nothing is changed.
pub fn make_once(
    storage: &(impl Storage + ?Sized),
    folder: &Path,
    beside: &Path,
    files: &[(&str, &[u8])],
) -> Result<(), StorageError> {
    storage.make_folder(beside).map_err(failed(beside, "making the folder"))?;
    for (name, content) in files {
        write_next_to(storage, &beside.join(name), content, &Rights::Usual)?;
    }
    storage.sync_directory(beside).map_err(failed(beside, TO_THE_DISK))?;
    storage.rename_new(beside, folder).map_err(failed(folder, "naming"))?;
    let around = folder_of(folder);
    storage.sync_directory(around).map_err(failed(around, TO_THE_DISK))
}

/// Brings a new file that was written bit by bit to the disk, with its name.
///
/// # Errors
///
/// Returns the system's answer; a folder that one may write in but not read cannot be synced to the disk, and does
/// not count as a failure.
pub fn settle(storage: &(impl Storage + ?Sized), path: &Path) -> io::Result<()> {
    storage.sync_file(path)?;
    match storage.sync_directory(folder_of(path)) {
        Err(error) if error.kind() != ErrorKind::PermissionDenied => Err(error),
        _ => Ok(()),
    }
}

/// Returns a path next to another that no other writer uses, of this process or of any that runs.
pub fn part_of(path: &Path) -> PathBuf {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    path.with_file_name(format!(".{name}.{}-{count}.part", std::process::id()))
}

/// Writes a file under a name that only one writer uses.
fn write_next_to(
    storage: &(impl Storage + ?Sized),
    beside: &Path,
    content: &[u8],
    rights: &Rights,
) -> Result<(), StorageError> {
    // Left by a writer that died. It may be the same file as that under the other name, on
    // a file system that lost half of a renaming: it is removed, not written over.
    match storage.remove(beside) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            return Err(failed(beside, "removing what was left")(error));
        }
        _ => {}
    }
    storage.write_new(beside, content, rights).map_err(failed(beside, "writing"))
}

/// Returns the directory that a file lies in.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn failed<'a>(path: &'a Path, action: &'static str) -> impl FnOnce(io::Error) -> StorageError + 'a {
    move |source| StorageError { path: path.to_path_buf(), action, source }
}
