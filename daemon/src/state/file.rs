//! The bytes of a state file: a header line, then the content; reasons why a file is refused.
//!
//! ```text
//! dynocar-state 1 <bytes of content> <checksum of content, 16 hexadecimal digits>
//! ```
//!
//! A file is replaced as a whole, see [`mod@crate::storage`].

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use crate::storage::{self, Disk, Rights, Storage};

/// Why a state file is refused; the daemon then starts cold.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {problem}")]
pub struct StateError {
    /// The file or directory.
    pub path: PathBuf,
    /// Problem of the file.
    pub problem: StateProblem,
}

/// Problem of a state file.
#[derive(Debug, thiserror::Error)]
pub enum StateProblem {
    /// The system does not give or take the file.
    #[error("{action} failed: {source}")]
    System {
        /// Attempted action.
        action: &'static str,
        /// The system's answer.
        source: io::Error,
    },
    /// The file does not begin as a state file does.
    #[error("not a state file of Dynocar")]
    NotAState,
    /// The file is of another schema.
    #[error("state schema {found}, expected {expected}")]
    Schema {
        /// Its schema.
        found: String,
        /// The schema of this release.
        expected: u32,
    },
    /// The file is longer or shorter than it was written.
    #[error("torn: expected {expected} bytes after the header, found {found}")]
    Torn {
        /// Bytes by the header.
        expected: usize,
        /// Bytes there are.
        found: usize,
    },
    /// The content differs from the content that was written.
    #[error("corrupt: checksum {saved:016x} saved, {calculated:016x} calculated")]
    Corrupt {
        /// Checksum in the header.
        saved: u64,
        /// Checksum of the content.
        calculated: u64,
    },
    /// The content is whole but cannot be understood, or not be written.
    #[error("{0}")]
    Malformed(String),
    /// The file is of another train, wheel set or model.
    #[error("foreign: its {what} is {saved}, expected {ours}")]
    Foreign {
        /// Which part of the key differs.
        what: &'static str,
        /// The file's.
        saved: String,
        /// The configuration's.
        ours: String,
    },
}

impl StateProblem {
    /// Of this file or directory.
    pub fn at(self, path: &Path) -> StateError {
        StateError { path: path.into(), problem: self }
    }
}

/// Version of the state file.
pub const SCHEMA: u32 = 1;
/// First word of the header.
const MAGIC: &str = "dynocar-state";
/// Largest state file in bytes; a longer file is foreign.
const BYTES_MAX: u64 = 1 << 20;

/// 64-bit FNV-1a: detects incomplete and damaged content; it is no defence against forgery.
pub fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// Reads the content of a state file; `None` when there is no file.
///
/// # Errors
///
/// When the file is not a whole state file of this schema.
pub fn read(path: &Path) -> Result<Option<String>, StateError> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(source) => return Err(failed(path, "opening")(source)),
    };
    let mut bytes = Vec::new();
    file.take(BYTES_MAX).read_to_end(&mut bytes).map_err(failed(path, "reading"))?;
    content_of(path, &bytes).map(Some)
}

/// Checks the bytes of a state file and gives its content.
///
/// # Errors
///
/// When they are not a whole state file of this schema.
pub fn content_of(path: &Path, bytes: &[u8]) -> Result<String, StateError> {
    let none = || StateProblem::NotAState.at(path);
    let end = bytes.iter().position(|&byte| byte == b'\n').ok_or_else(none)?;
    let header = std::str::from_utf8(&bytes[..end]).map_err(|_| none())?;
    let words: Vec<&str> = header.split(' ').collect();
    let [MAGIC, schema, rest @ ..] = &words[..] else { return Err(none()) };
    if *schema != SCHEMA.to_string() {
        let found = (*schema).to_owned();
        return Err(StateProblem::Schema { found, expected: SCHEMA }.at(path));
    }
    let [length, sum] = rest else { return Err(none()) };
    let expected: usize = length.parse().map_err(|_| none())?;
    let saved = u64::from_str_radix(sum, 16).map_err(|_| none())?;
    let content = &bytes[end + 1..];
    if content.len() != expected {
        return Err(StateProblem::Torn { expected, found: content.len() }.at(path));
    }
    let calculated = checksum(content);
    if calculated != saved {
        return Err(StateProblem::Corrupt { saved, calculated }.at(path));
    }
    String::from_utf8(content.to_vec()).map_err(|_| none())
}

/// Returns the bytes of a state file with this content.
pub fn bytes_of(content: &str) -> Vec<u8> {
    let sum = checksum(content.as_bytes());
    format!("{MAGIC} {SCHEMA} {} {sum:016x}\n{content}", content.len()).into_bytes()
}

/// Replaces a state file as a whole.
///
/// # Errors
///
/// The system's answer; the file there was stays as it is.
pub fn replace(path: &Path, content: &str) -> Result<(), StateError> {
    replace_on(&Disk, path, content)
}

/// Replaces a state file as a whole, for the daemon after a process that dies; does not bring it to the disk.
///
/// # Errors
///
/// The system's answer; the file there was stays as it is.
pub fn leave(path: &Path, content: &str) -> Result<(), StateError> {
    let new = beside(path);
    let write = || {
        let mut options = OpenOptions::new();
        let options = options.write(true).create(true).truncate(true).mode(0o600);
        options.open(&new)?.write_all(&bytes_of(content))
    };
    write().map_err(failed(&new, "writing"))?;
    std::fs::rename(&new, path).map_err(failed(path, "renaming"))
}

/// As [`replace`], on any storage.
///
/// # Errors
///
/// As [`replace`].
pub fn replace_on(storage: &impl Storage, path: &Path, content: &str) -> Result<(), StateError> {
    let new = (&bytes_of(content)[..], &Rights::Owner);
    storage::replace(storage, path, &beside(path), new)
        .map_err(|error| failed(&error.path, error.action)(error.source))
}

/// One name for each state file, so that dead writers leave at most one behind; a train has one
/// daemon and hence one writer.
fn beside(path: &Path) -> PathBuf {
    path.with_extension("state.new")
}

fn failed<'a>(
    path: &'a Path,
    action: &'static str,
) -> impl FnOnce(std::io::Error) -> StateError + 'a {
    move |source| StateProblem::System { action, source }.at(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_replaced_file_is_read_back_and_closed_to_others() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("train-1.state");
        assert_eq!(read(&path).unwrap(), None);
        for content in ["one\n", "another, longer one\n", ""] {
            replace(&path, content).unwrap();
            assert_eq!(read(&path).unwrap().as_deref(), Some(content));
        }
        let mode = std::fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing beside it");
    }

    #[test]
    fn a_file_cut_off_anywhere_is_refused() {
        let whole = bytes_of("schema content\nof two lines\n");
        for length in 0..whole.len() {
            let refusal = content_of(Path::new("x"), &whole[..length]);
            assert!(refusal.is_err(), "cut to {length} bytes");
        }
        assert!(content_of(Path::new("x"), &[&whole[..], b"x"].concat()).is_err(), "one too many");
    }

    #[test]
    fn a_file_with_any_bit_flipped_is_refused() {
        let whole = bytes_of("schema content\nof two lines\n");
        let original = content_of(Path::new("x"), &whole).unwrap();
        for index in 0..whole.len() {
            for bit in 0..8 {
                let mut rotten = whole.clone();
                rotten[index] ^= 1 << bit;
                // A digit of the checksum may change its case, which changes nothing.
                let read = content_of(Path::new("x"), &rotten);
                assert!(read.is_err() || read.unwrap() == original, "byte {index}, bit {bit}");
            }
        }
    }

    #[test]
    fn another_schema_is_named() {
        let newer = b"dynocar-state 2 0 cbf29ce484222325\n";
        let message = content_of(Path::new("x"), newer).unwrap_err().to_string();
        assert_eq!(message, "x: state schema 2, expected 1");
    }
}
