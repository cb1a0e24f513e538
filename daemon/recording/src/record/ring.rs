//! The files of a recording that rotates: their names, and how long ago they ended, whatever happens to the clock on the wall.
//!
//! A file that this recorder ended has the age that the monotonic clock gives it. Of those that were there
//! before only their dates are known; they grow older by the monotonic clock from then on.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// A file of the ring.
#[derive(Clone, Debug)]
pub struct Aged {
    /// Where it is.
    pub path: PathBuf,
    /// Since it ended; nothing for the one that is written.
    pub age: Duration,
}

/// Facts on a file that has ended.
#[derive(Clone, Copy, Debug)]
struct Ended {
    /// The date that it bears.
    date: SystemTime,
    /// How old it was at a moment.
    age: Duration,
    at: Instant,
}

/// The ages of a ring's files.
#[derive(Debug)]
pub struct Ages {
    ended: HashMap<PathBuf, Ended>,
}

fn date_of(path: &Path) -> Option<SystemTime> {
    std::fs::metadata(path).and_then(|it| it.modified()).ok()
}

impl Ages {
    /// The files that a recorder finds when it begins: as old as their dates say, or new where those lie
    /// ahead.
    pub fn of_what_is_there(output: &Path) -> Self {
        let (now, at) = (SystemTime::now(), Instant::now());
        let ended = |(_, path): (u64, PathBuf)| {
            let date = date_of(&path)?;
            Some((path, Ended { date, age: now.duration_since(date).unwrap_or_default(), at }))
        };
        Ages { ended: numbered(output).into_iter().filter_map(ended).collect() }
    }

    /// A file was begun: those before it have ended.
    pub fn note_ended(&mut self, output: &Path, begun: &Path) {
        let at = Instant::now();
        let files = numbered(output);
        self.ended.retain(|path, _| files.iter().any(|it| it.1 == *path));
        for (_, path) in files.into_iter().filter(|it| it.1 != begun) {
            if let Some(date) = date_of(&path) {
                self.ended.entry(path).or_insert(Ended { date, age: Duration::ZERO, at });
            }
        }
    }

    /// All files, the oldest first: none is younger than one after it. Who dates a file back makes it older.
    pub fn of_files(&self, output: &Path) -> Vec<Aged> {
        let mut least = Duration::ZERO;
        let files = numbered(output).into_iter().rev().map(|(_, path)| {
            let age = self.ended.get(&path).map_or(Duration::ZERO, |it| {
                let back = date_of(&path).and_then(|date| it.date.duration_since(date).ok());
                it.age + it.at.elapsed() + back.unwrap_or_default()
            });
            least = least.max(age);
            Aged { path, age: least }
        });
        let mut files: Vec<Aged> = files.collect();
        files.reverse();
        files
    }
}

/// The files of a rotating recording with their numbers, the oldest first.
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

/// The name of the next file: `run-000007.mcap` for `run.mcap`.
pub fn next(output: &Path) -> PathBuf {
    let number = numbered(output).last().map_or(1, |newest| newest.0 + 1);
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    output.with_file_name(format!("{stem}-{number:0DIGITS$}.mcap"))
}
