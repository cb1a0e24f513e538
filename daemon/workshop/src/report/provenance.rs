//! Provenance of a report: command, versions, content of the dataset.

use std::time::SystemTime;

use dynocar_analysis::dataset::MANIFEST_FILE;
use sha2::{Digest, Sha256};

use crate::dataset;
use dynocar::dataset::{DatasetSource, LoadError};
use dynocar::stamp::UtcSecond;

/// A file and the digest of its content.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileDigest {
    /// Its path in the dataset.
    pub path: String,
    /// Its size.
    pub bytes: usize,
    /// SHA-256 of its content.
    pub sha256: String,
}

/// Origin of a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Provenance {
    /// The command line.
    pub command: String,
    /// Version of the program.
    pub version: &'static str,
    /// Kind of machine.
    pub machine: String,
    /// Day, in UTC.
    pub day: String,
    /// The files that were read: manifest, train, line, runs.
    pub files: Vec<FileDigest>,
    /// SHA-256 of the lines `<sha256>  <path>` of all files in this order.
    pub sha256: String,
}

impl Provenance {
    /// Of a report on a dataset made now; `command` makes the same report.
    ///
    /// # Errors
    ///
    /// When a file of the dataset cannot be read.
    pub fn new<'p>(
        source: impl Into<DatasetSource<'p>>,
        command: String,
    ) -> Result<Self, LoadError> {
        Ok(Provenance::of_files(digests(source.into())?, command, SystemTime::now()))
    }

    /// Of a report on these files made at an instant.
    pub fn of_files(files: Vec<FileDigest>, command: String, made: SystemTime) -> Self {
        let lines: String =
            files.iter().map(|file| format!("{}  {}\n", file.sha256, file.path)).collect();
        Provenance {
            command,
            version: env!("CARGO_PKG_VERSION"),
            machine: format!("{} on {}", std::env::consts::OS, std::env::consts::ARCH),
            day: UtcSecond::from_time(made).day(),
            files,
            sha256: hex(lines.as_bytes()),
        }
    }

    /// Returns a shell command that gives the same hash in the dataset's folder.
    pub fn check_command(&self) -> String {
        let paths: Vec<String> = self.files.iter().map(|file| for_shell(&file.path)).collect();
        format!("sha256sum {} | sha256sum", paths.join(" "))
    }
}

fn digests(source: DatasetSource) -> Result<Vec<FileDigest>, LoadError> {
    let (files, head) = dataset::open(source)?;
    let manifest = &head.manifest;
    let mut paths = vec![MANIFEST_FILE.to_string(), manifest.train_file.path.clone()];
    paths.extend(manifest.track_file.as_ref().map(|file| file.path.clone()));
    paths.extend(manifest.runs.iter().map(|run| run.file.clone()));
    let digest = |path: String| {
        // A file that was read a moment ago and is gone now has no content to state.
        let content = files.bytes(&path);
        FileDigest { bytes: content.len(), sha256: hex(&content), path }
    };
    Ok(paths.into_iter().map(digest).collect())
}

/// SHA-256 of some bytes, in hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the command line of this process, as one would type it.
pub fn own_command_line() -> String {
    command_line(std::env::args().skip(1))
}

/// Returns a command line of the program with these arguments, as one would type it.
pub fn command_line(arguments: impl IntoIterator<Item = String>) -> String {
    let words = arguments.into_iter().map(|argument| for_shell(&argument));
    std::iter::once("dynocar".to_string()).chain(words).collect::<Vec<_>>().join(" ")
}

/// Returns a word, or a path, as a shell takes it.
pub fn for_shell(word: &str) -> String {
    let is_plain = |letter: char| letter.is_alphanumeric() || "-_./=:,+@%".contains(letter);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.into();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_line_can_be_typed_again() {
        let arguments = ["explain", "my data", "it's", "--report", "a.html"].map(String::from);
        assert_eq!(command_line(arguments), r"dynocar explain 'my data' 'it'\''s' --report a.html");
    }

    #[test]
    fn paths_are_quoted_for_a_shell_where_they_must_be() {
        assert_eq!(for_shell("a/b-1.toml"), "a/b-1.toml");
        assert_eq!(for_shell("my train"), "'my train'");
        assert_eq!(for_shell("it's"), "'it'\\''s'");
    }

    #[test]
    fn hashes_are_those_of_the_standard() {
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(hex(b"abc"), abc);
    }
}
