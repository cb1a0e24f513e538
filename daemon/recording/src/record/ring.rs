//! The files of a recording that rotates: their names, and how long ago they ended, even when the wall clock is set.
//!
//! A file that this recorder ended has its age by the monotonic clock. The files that were there before follow one
//! another as closely as their dates say, but no file counts as longer than a part of the ring; their ages grow while a
//! recorder runs.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// A file of the ring.
#[derive(Clone, Debug)]
pub struct Aged {
    /// Path of the file.
    pub path: PathBuf,
    /// Time since it ended; zero for the file that is being written.
    pub age: Duration,
}

/// How old an ended file was at a moment.
#[derive(Clone, Copy, Debug)]
struct Ended {
    age: Duration,
    at: Instant,
}

/// The ages of a ring's files.
#[derive(Debug)]
pub struct Ages {
    ended: HashMap<PathBuf, Ended>,
}

impl Ages {
    /// Returns the files that a recorder finds when it begins; none took longer than `part`, where that is known.
    pub fn from_existing(output: &Path, part: Option<Duration>) -> Self {
        let (at, mut age) = (Instant::now(), Duration::ZERO);
        let (mut ended, mut later) = (HashMap::new(), None::<SystemTime>);
        for (_, path) in numbered(output).into_iter().rev() {
            let Ok(date) = std::fs::metadata(&path).and_then(|it| it.modified()) else { continue };
            let gap = later.and_then(|it| it.duration_since(date).ok()).unwrap_or_default();
            age += gap.min(part.unwrap_or(gap));
            later = Some(date);
            ended.insert(path, Ended { age, at });
        }
        Ages { ended }
    }

    /// A file was begun: those before it have ended.
    pub fn note_ended(&mut self, output: &Path, begun: &Path) {
        let at = Instant::now();
        let files = numbered(output);
        self.ended.retain(|path, _| files.iter().any(|it| it.1 == *path));
        for (_, path) in files.into_iter().filter(|it| it.1 != begun) {
            self.ended.entry(path).or_insert(Ended { age: Duration::ZERO, at });
        }
    }

    /// Returns all files, the oldest first: none is younger than one after it.
    pub fn of_files(&self, output: &Path) -> Vec<Aged> {
        let mut least = Duration::ZERO;
        let files = numbered(output).into_iter().rev().map(|(_, path)| {
            let age = self.ended.get(&path).map(|it| it.age + it.at.elapsed());
            least = least.max(age.unwrap_or_default());
            Aged { path, age: least }
        });
        let mut files: Vec<Aged> = files.collect();
        files.reverse();
        files
    }
}

/// Returns the files of a rotating recording with their numbers, the oldest first.
pub fn numbered(output: &Path) -> Vec<(u64, PathBuf)> {
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

/// Returns the name of the next file: `run-000007.mcap` for `run.mcap`.
pub fn next(output: &Path) -> PathBuf {
    let number = numbered(output).last().map_or(1, |newest| newest.0 + 1);
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    output.with_file_name(format!("{stem}-{number:0DIGITS$}.mcap"))
}
