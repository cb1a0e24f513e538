//! Destinations of results: standard output, standard error and files, for every program of the project.
//!
//! A reader that has gone away ends the printing and nothing else; a full disk is an error in words. A file is written
//! under another name and takes its own name once it is whole, so that even after an abrupt end of the program the old
//! or the new file is there, never a part of one.
//! [`Redrawn`] writes lines on a terminal that later lines replace.

use std::fs::{File, Metadata};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::termios::tcgetwinsize;
use serde::Serialize;

use crate::storage::{self, Disk, Rights, Storage, folder_of};

/// Why a result cannot be given.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// Standard output cannot be written.
    #[error("standard output: cannot be written: {0}")]
    StandardOutput(io::Error),
    /// A file cannot be written.
    #[error("{}: cannot be written: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// A name under which a result would cost data.
    #[error("{}: {problem}", path.display())]
    Name {
        /// The file.
        path: PathBuf,
        /// Problem, and the expected state.
        problem: &'static str,
    },
    /// A number or name that JSON cannot hold.
    #[error("the result cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
}

/// Writes text to standard output; a reader that has gone away is no failure.
///
/// # Errors
///
/// When standard output cannot be written.
pub fn print(text: &str) -> Result<(), OutputError> {
    let mut output = io::stdout().lock();
    match output.write_all(text.as_bytes()).and_then(|()| output.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(OutputError::StandardOutput(error))
        }
        _ => Ok(()),
    }
}

/// Writes a line to standard error. A line that cannot be written there, or that nobody reads from there for a second,
/// is lost: there is no other place to report it.
pub fn report_line(line: &str) {
    let stderr = io::stderr();
    let second = Timespec { tv_sec: 1, tv_nsec: 0 };
    if poll(&mut [PollFd::new(&stderr, PollFlags::OUT)], Some(&second)) == Ok(0) {
        return;
    }
    let _ = io::stderr().lock().write_all(format!("{line}\n").as_bytes());
}

/// Returns whether `--json` is to go to standard output, where then nothing else may go.
pub fn is_standard_output(file: &Path) -> bool {
    file == Path::new("-")
}

/// Gives a result: to machines where they want it, and to people unless standard output is taken.
///
/// # Errors
///
/// When it cannot be written.
pub fn give(
    json: Option<&Path>,
    result: &impl Serialize,
    for_people: impl FnOnce() -> String,
) -> Result<(), OutputError> {
    if let Some(file) = json {
        write_json(file, result)?;
    }
    if json.is_some_and(is_standard_output) { Ok(()) } else { print(&for_people()) }
}

/// Writes a machine-readable result to a file, `-` for standard output.
///
/// # Errors
///
/// When it cannot be written.
pub fn write_json(file: &Path, value: &impl Serialize) -> Result<(), OutputError> {
    let text = serde_json::to_string_pretty(value)? + "\n";
    if is_standard_output(file) { print(&text) } else { write_file(file, &text) }
}

/// Refuses, before the work begins, a name under which no file that begins with `mark` can be
/// written: a folder, a file in a folder that is not there, or a `.toml` or `.csv` file that begins
/// otherwise and so is most likely somebody's data.
///
/// # Errors
///
/// Problem of the name.
pub fn require_file(path: &Path, mark: &str) -> Result<(), OutputError> {
    let refuse = |kind, words| {
        Err(OutputError::File { path: path.into(), source: io::Error::new(kind, words) })
    };
    if is_standard_output(path) {
        return Ok(());
    }
    let has_folder = path.file_name().is_some() && folder_of(path).is_dir();
    match std::fs::metadata(path) {
        Ok(found) if found.is_dir() => refuse(ErrorKind::IsADirectory, "it is a folder"),
        Ok(found) if found.is_file() && is_data(path) && !begins_with(path, mark) => {
            let problem = "exists and is none of this command's results: give another name";
            Err(OutputError::Name { path: path.into(), problem })
        }
        Ok(_) => Ok(()),
        Err(_) if has_folder => Ok(()),
        Err(_) => refuse(ErrorKind::NotFound, "there is no such folder"),
    }
}

/// Refuses to replace a file in a folder for results that another command wrote.
///
/// # Errors
///
/// Existing state.
pub fn require_replaceable(file: &Path, mark: &str) -> Result<(), OutputError> {
    if file.exists() { require_file(file, mark) } else { Ok(()) }
}

/// Refuses wrong names of results like [`require_file`]; each with how such a file begins.
///
/// # Errors
///
/// Problem of the first wrong one.
pub fn require_files(files: &[(&Option<PathBuf>, &str)]) -> Result<(), OutputError> {
    let named = files.iter().filter_map(|(file, mark)| Some((file.as_ref()?, mark)));
    named.into_iter().try_for_each(|(file, mark)| require_file(file, mark))
}

/// Refuses, before the work begins, a name that is taken, be it by a link that leads nowhere.
///
/// # Errors
///
/// When something is there.
pub fn require_new(path: &Path) -> Result<(), OutputError> {
    if std::fs::symlink_metadata(path).is_ok() { Err(taken(path)) } else { Ok(()) }
}

fn taken(path: &Path) -> OutputError {
    let problem = "exists already, and is not overwritten: nothing was written; give another \
                   folder, or move it away";
    OutputError::Name { path: path.into(), problem }
}

/// Refuses, before the work begins, a file in the place of a folder for results.
///
/// # Errors
///
/// When there is a file.
pub fn require_folder(path: &Path) -> Result<(), OutputError> {
    if !path.exists() || path.is_dir() {
        return Ok(());
    }
    let source = io::Error::new(ErrorKind::NotADirectory, "it is no folder");
    Err(OutputError::File { path: path.into(), source })
}

fn is_data(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "toml" || extension == "csv")
}

fn begins_with(path: &Path, mark: &str) -> bool {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|it| it.take(mark.len() as u64).read_to_end(&mut start));
    // An empty file holds nothing that could be lost.
    read.is_ok() && (start.is_empty() || start == mark.as_bytes())
}

/// Writes a file of a folder, which is made when it is not there.
///
/// # Errors
///
/// When the folder cannot be made or the file not be written.
pub fn write_in_folder(folder: &Path, name: &str, content: &str) -> Result<PathBuf, OutputError> {
    let path = folder.join(name);
    std::fs::create_dir_all(folder)
        .map_err(|source| OutputError::File { path: path.clone(), source })?;
    write_file(&path, content)?;
    Ok(path)
}

/// Writes files that are not there yet, all of them or none, into a folder, which is made when it is not there. Files
/// that somebody else writes meanwhile stay.
///
/// # Errors
///
/// When one of them is there, or cannot be written.
pub fn write_new_in_folder(folder: &Path, files: &[(&str, &str)]) -> Result<(), OutputError> {
    let mut written: Vec<PathBuf> = Vec::new();
    for (name, content) in files {
        let path = folder.join(name);
        let made = std::fs::create_dir_all(folder)
            .and_then(|()| Disk.write_new(&path, content.as_bytes(), &Rights::Usual));
        if let Err(source) = made {
            for path in written {
                // Without the others it would be half an answer; that it stays harms nobody.
                let _ = std::fs::remove_file(path);
            }
            return Err(match source.kind() {
                ErrorKind::AlreadyExists => taken(&path),
                _ => OutputError::File { path, source },
            });
        }
        written.push(path);
    }
    Ok(())
}

/// Writes a file as a whole. A link stays a link; a device or a pipe is written as it is.
///
/// # Errors
///
/// When it cannot be written; the file there was stays as it is.
pub fn write_file(path: &Path, content: &(impl AsRef<[u8]> + ?Sized)) -> Result<(), OutputError> {
    let target = std::fs::canonicalize(path).unwrap_or_else(|_| path.into());
    let known = std::fs::metadata(&target).ok();
    let written = match known {
        Some(known) if !known.is_file() => std::fs::write(&target, content),
        known => replace(&target, known, content.as_ref()),
    };
    written.map_err(|source| OutputError::File { path: path.into(), source })
}

fn replace(target: &Path, known: Option<Metadata>, content: &[u8]) -> io::Result<()> {
    let mut name = std::ffi::OsString::from(".");
    name.push(target.file_name().unwrap_or_default());
    name.push(format!(".{}.part", std::process::id()));
    let rights = known.map_or(Rights::Usual, |known| Rights::Like(known.permissions()));
    match storage::replace(&Disk, target, &folder_of(target).join(name), (content, &rights)) {
        // A folder that one may write in but not read cannot be brought to the disk.
        Err(error) if !error.is_replaced() => Err(error.source),
        _ => Ok(()),
    }
}

/// Columns of a terminal that does not report their number.
const USUAL_COLUMNS: usize = 80;

/// Returns whether the terminal takes letters beyond ASCII, by its locale.
pub fn is_utf8() -> bool {
    let named = |name| std::env::var(name).ok().filter(|it: &String| !it.is_empty());
    let locale = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().find_map(named).unwrap_or_default();
    let locale = locale.to_ascii_lowercase();
    locale.contains("utf-8") || locale.contains("utf8")
}

/// Returns whether lines can be replaced, and boxes and bars drawn: not on a terminal of the type `dumb`.
pub fn can_draw() -> bool {
    std::env::var("TERM").is_ok_and(|it| !it.is_empty() && it != "dumb") && is_utf8()
}

/// Latest drawing on the terminal of standard error.
#[derive(Debug, Default)]
pub struct Redrawn {
    lines: usize,
}

impl Redrawn {
    /// Draws lines over those drawn before; each is cut to the terminal's width.
    pub fn draw(&mut self, lines: &[String]) {
        let mut stderr = io::stderr().lock();
        let columns = tcgetwinsize(&stderr).map_or(0, |size| usize::from(size.ws_col));
        let columns = if columns == 0 { USUAL_COLUMNS } else { columns };
        // A terminal that is gone shows nothing.
        let _ = stderr.write_all(drawing(self.lines, lines, columns).as_bytes());
        self.lines = lines.len();
    }
}

/// Returns the letters that draw lines over the lines drawn before.
fn drawing(before: usize, lines: &[String], columns: usize) -> String {
    let up = if before > 0 { format!("\x1b[{before}A") } else { String::new() };
    let cut = |line: &String| line.chars().take(columns.saturating_sub(1)).collect::<String>();
    up + &lines.iter().map(|line| format!("\r\x1b[2K{}\n", cut(line))).collect::<String>()
}

/// Returns a bar of a share from 0 to 1, `letters` letters long.
pub fn bar(share: f64, letters: usize) -> String {
    let full = (share.clamp(0.0, 1.0) * letters as f64).round() as usize;
    "█".repeat(full) + &"░".repeat(letters - full)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_replaced_as_a_whole_with_its_rights_and_through_links() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("a.json"), folder.path().join("link"));
        write_file(&file, "a longer one\n").unwrap();
        std::fs::set_permissions(&file, PermissionsExt::from_mode(0o640)).unwrap();
        symlink(&file, &link).unwrap();
        write_file(&link, "new\n").unwrap();
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "new\n");
        assert_eq!(std::fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o640);
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(names(folder.path()), ["a.json", "link"], "nothing beside it");
    }

    #[test]
    fn new_files_are_all_written_or_none_and_never_over_another() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let new = at("new/deep");
        write_new_in_folder(&new, &[("a", "1"), ("b", "2")]).unwrap();
        assert_eq!(names(&new), ["a", "b"]);
        let error = write_new_in_folder(&new, &[("c", "3"), ("b", "4")]).unwrap_err();
        assert!(matches!(error, OutputError::Name { .. }), "{error}");
        assert_eq!(names(&new), ["a", "b"], "no half of an answer");
        assert_eq!(std::fs::read_to_string(new.join("b")).unwrap(), "2");
        symlink(at("nowhere"), at("link")).unwrap();
        assert!(require_new(&at("link")).is_err() && require_new(&at("free")).is_ok());
        let error = write_new_in_folder(folder.path(), &[("link", "x")]).unwrap_err();
        assert!(matches!(error, OutputError::Name { .. }) && !at("nowhere").exists());
    }

    #[test]
    fn a_full_disk_is_named() {
        let error = write_file(Path::new("/dev/full"), "x").unwrap_err().to_string();
        assert!(error.starts_with("/dev/full: cannot be written: No space left"), "{error}");
    }

    #[test]
    fn names_that_would_cost_somebody_data_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("dataset.toml"), "[dataset]\n").unwrap();
        std::fs::write(at("grown.toml"), "# Grown from train.toml\n").unwrap();
        std::fs::write(at("old.json"), "anything").unwrap();
        let refused = |name: &str, mark: &str| require_file(&at(name), mark).is_err();
        assert!(refused("dataset.toml", "{"));
        assert!(require_file(Path::new(""), "{").is_err());
        assert!(refused("", "{") && refused("nowhere/a.json", "{"));
        assert!(!refused("grown.toml", "# Grown") && refused("grown.toml", "{"));
        assert!(!refused("old.json", "{") && !refused("new.csv", "{"));
        assert!(require_folder(&at("old.json")).is_err() && require_folder(&at("new")).is_ok());
        assert!(require_file(Path::new("-"), "{").is_ok());
    }
}

#[cfg(test)]
mod redrawn_tests {
    use super::*;

    #[test]
    fn lines_are_written_over_those_before_and_cut_to_the_width() {
        let lines = ["one".to_owned(), "a long line".to_owned()];
        assert_eq!(drawing(0, &lines, 7), "\r\x1b[2Kone\n\r\x1b[2Ka long\n");
        assert_eq!(drawing(2, &lines[..1], 80), "\x1b[2A\r\x1b[2Kone\n");
    }

    #[test]
    fn a_bar_is_as_full_as_its_share() {
        assert_eq!([bar(0.0, 4), bar(0.5, 4), bar(2.0, 4)], ["░░░░", "██░░", "████"]);
    }
}
