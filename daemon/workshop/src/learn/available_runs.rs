//! The available runs: those of datasets in a folder, which may come and go, and of recordings.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use dynocar_analysis::dataset::formats::MCAP;
use dynocar_analysis::dataset::{MANIFEST_FILE, Manifest, RunEntry, recorded_unix_s};
use dynocar_shared::TrainId;
use sha2::{Digest, Sha256};
use tracing::warn;

use super::LearnError;
use super::memory::{KnownFile, LearnerMemory, is_finished, take_up, unpacked_in};
use crate::report::provenance::hex;
use dynocar::dataset::read_text;
use dynocar::models::UtcSecond;
use dynocar::text_file::read_beginning;

/// Length of the beginning of a file that shows the time of its recording.
const BEGINNING_BYTES: u64 = 1 << 16;
/// Greatest depth of folders in the folder of runs.
const DEPTH_MAX: usize = 6;

/// A recorded run of a train.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundRun {
    /// Its unique name: the path of its dataset in the folder of runs, and its file.
    pub name: String,
    /// The folder of its dataset.
    pub dataset: PathBuf,
    /// Its place in the dataset, from 0.
    pub index: usize,
    /// Its file.
    pub path: PathBuf,
    /// When it was recorded: by its file or its dataset, else by a day in its path, else when its file was
    /// last changed.
    pub recorded: UtcSecond,
    /// SHA-256 of its content.
    pub sha256: String,
    /// SHA-256 of the description of its dataset, without which the content says something else.
    pub described: String,
}

impl FoundRun {
    /// Content and description together: another of either is another run.
    pub fn key(&self) -> String {
        format!("{}-{}", &self.sha256[..16], &self.described[..16])
    }
}

/// Where runs are looked for.
#[derive(Clone, Copy, Debug)]
pub struct Places<'a> {
    /// Datasets and recordings, at any depth.
    pub runs: &'a Path,
    /// The learner's own folder.
    pub own: &'a Path,
    /// All trains, by which folders are distinguished.
    pub trains: &'a [TrainId],
}

/// Entry in the folder of runs.
#[derive(Debug, Default)]
struct Lying {
    datasets: Vec<PathBuf>,
    recordings: Vec<PathBuf>,
}

/// Returns the runs of a train, the oldest first, each content once; none older than the horizon before the newest:
/// an archive is learned from as it was recorded.
///
/// # Errors
///
/// When the folder cannot be read, or no recording can be unpacked.
pub fn runs_of(
    train: TrainId,
    places: Places,
    memory: &mut LearnerMemory,
    (now, horizon): (UtcSecond, Duration),
) -> Result<Vec<FoundRun>, LearnError> {
    let mut lying = Lying::default();
    look(places.runs, DEPTH_MAX, &mut lying)
        .map_err(|source| LearnError::Runs { path: places.runs.into(), source })?;
    let is_own = |path: &&PathBuf| is_of(train, path, places);
    let unpacked = places.own.join("runs").join(train.0.to_string());
    for path in lying.recordings.iter().filter(is_own) {
        let Ok((sha256, modified)) = hash_of(path, memory) else { continue };
        take_up((path, &sha256), train, (&unpacked, memory), modified)?;
    }
    let mut runs = Vec::new();
    for folder in lying.datasets.iter().filter(is_own) {
        let name = folder.strip_prefix(places.runs).unwrap_or(folder).display().to_string();
        runs.extend(runs_in(folder, &name, None, memory));
    }
    for (folder, source) in unpacked_in(&unpacked) {
        runs.extend(runs_in(&folder, &source.name, Some(source.recorded), memory));
    }
    let newest = runs.iter().map(|run| run.recorded).max().unwrap_or(now).min(now);
    let oldest = UtcSecond { unix_s: newest.unix_s.saturating_sub(horizon.as_secs()) };
    runs.retain(|run| run.recorded >= oldest);
    runs.sort_by(|one, other| (one.recorded, &one.name).cmp(&(other.recorded, &other.name)));
    let mut seen = std::collections::BTreeSet::new();
    runs.retain(|run| seen.insert(run.key()));
    Ok(runs)
}

fn look(folder: &Path, depth: usize, lying: &mut Lying) -> io::Result<()> {
    if folder.join(MANIFEST_FILE).is_file() {
        lying.datasets.push(folder.into());
        return Ok(());
    }
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(folder)?.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    for path in paths {
        let is_hidden = path.file_name().is_some_and(|it| it.to_string_lossy().starts_with('.'));
        if is_hidden {
            continue;
        }
        if path.is_dir() && depth > 0 {
            // A folder that has gone or is closed holds no runs.
            let _ = look(&path, depth - 1, lying);
        } else if MCAP.is_of(&path) && is_finished(&path) {
            lying.recordings.push(path);
        }
    }
    Ok(())
}

/// Returns whether a path belongs to a train: every path where there is one train only, else a path in a folder named
/// by the train's number, as `7` or `train=7`; a recording outside such folders may hold any train.
fn is_of(train: TrainId, path: &Path, places: Places) -> bool {
    let inside = path.strip_prefix(places.runs).unwrap_or(path);
    let number = |part: Component| {
        let part = part.as_os_str().to_str()?;
        part.strip_prefix("train=").unwrap_or(part).parse().ok().map(TrainId)
    };
    let named = inside.components().filter_map(number).find(|it| places.trains.contains(it));
    match named {
        Some(named) => named == train,
        None => places.trains.len() == 1 || MCAP.is_of(path),
    }
}

/// Returns the runs of a dataset; none of one that cannot be read, which is reported once.
fn runs_in(
    folder: &Path,
    name: &str,
    recorded: Option<UtcSecond>,
    memory: &mut LearnerMemory,
) -> Vec<FoundRun> {
    let path = folder.join(MANIFEST_FILE);
    let label = path.display().to_string();
    let text = read_text(&path).map_err(|problem| format!("{label}: {problem}"));
    let described = hex(text.as_deref().unwrap_or_default().as_bytes());
    let manifest =
        text.and_then(|text| Manifest::parse(&label, &text).map_err(|error| error.to_string()));
    let manifest = match manifest {
        Ok(manifest) => manifest,
        Err(problem) => {
            report_unusable(memory, &described, &problem);
            return Vec::new();
        }
    };
    let mut runs = Vec::new();
    for (index, entry) in manifest.runs.iter().enumerate() {
        let path = folder.join(&entry.file);
        // One that is not there yet is there in a later round.
        let Ok((sha256, modified)) = hash_of(&path, memory) else { continue };
        let name =
            if name.is_empty() { entry.file.clone() } else { format!("{name}/{}", entry.file) };
        let recorded = recorded
            .or_else(|| by_file(&manifest, entry, &path))
            .unwrap_or_else(|| by_path(Path::new(&name), modified));
        let (dataset, described) = (folder.to_path_buf(), described.clone());
        runs.push(FoundRun { name, dataset, index, path, recorded, sha256, described });
    }
    runs
}

/// Reports why something is not used, once for each content.
pub fn report_unusable(memory: &mut LearnerMemory, sha256: &str, problem: &str) {
    if memory.unusable.insert(sha256.to_owned(), problem.to_owned()).is_none() {
        warn!("left out: {problem}");
    }
}

/// SHA-256 of a file's content, and when it was changed.
fn hash_of(path: &Path, memory: &mut LearnerMemory) -> io::Result<(String, UtcSecond)> {
    let known = std::fs::metadata(path)?;
    let modified = known.modified().unwrap_or(SystemTime::UNIX_EPOCH);
    let since = modified.duration_since(UNIX_EPOCH).unwrap_or_default();
    let (bytes, modified_ns) = (known.len(), since.as_nanos() as u64);
    let is_same = |it: &&KnownFile| it.bytes == bytes && it.modified_ns == modified_ns;
    if let Some(known) = memory.files.get(path).filter(is_same) {
        return Ok((known.sha256.clone(), UtcSecond::from_time(modified)));
    }
    let mut digest = Sha256::new();
    let (mut file, mut part) = (File::open(path)?, vec![0; 1 << 16]);
    loop {
        match file.read(&mut part)? {
            0 => break,
            read => digest.update(&part[..read]),
        }
    }
    let sha256: String = digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    let file = KnownFile { bytes, modified_ns, sha256: sha256.clone() };
    memory.files.insert(path.into(), file);
    Ok((sha256, UtcSecond::from_time(modified)))
}

/// Returns the time at which a run was recorded, from its file or its dataset.
fn by_file(manifest: &Manifest, entry: &RunEntry, path: &Path) -> Option<UtcSecond> {
    let beginning = || {
        let bytes = read_beginning(path, BEGINNING_BYTES).ok()?;
        let (text, _) = manifest.layout.encoding.decode_without_bom_handling(&bytes);
        Some(text.into_owned())
    };
    let unix_s = recorded_unix_s(manifest, entry, beginning)?.try_into().ok()?;
    Some(UtcSecond { unix_s })
}

/// Returns the time at which a run was recorded: that of the last change of its file, unless its path names another
/// day, as `2026-11-23` or `day=2026-11-23`.
fn by_path(path: &Path, modified: UtcSecond) -> UtcSecond {
    let day = |part: Component| -> Option<UtcSecond> {
        let part = part.as_os_str().to_str()?;
        let day = part.strip_prefix("day=").unwrap_or(part).get(..10)?;
        format!("{day}T00:00:00Z").parse().ok()
    };
    let named = path.components().rev().find_map(day);
    match named {
        Some(day) if modified.unix_s / 86_400 != day.unix_s / 86_400 => day,
        _ => modified,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_day_in_the_path_is_believed_unless_the_file_says_the_time_of_that_day() {
        let at = |text: &str| text.parse::<UtcSecond>().unwrap();
        let modified = at("2026-11-23T07:00:00Z");
        let by = |path: &str| by_path(Path::new(path), modified).to_string();
        assert_eq!(by("a/runs/1.csv"), "2026-11-23T07:00:00Z");
        assert_eq!(by("2026-11-23/runs/1.csv"), "2026-11-23T07:00:00Z");
        assert_eq!(by("day=2026-10-01/runs/1.csv"), "2026-10-01T00:00:00Z");
        assert_eq!(by("2026-10-01_morning/runs/2026-10-02-1.csv"), "2026-10-02T00:00:00Z");
    }

    #[test]
    fn a_run_is_of_the_day_that_its_file_says_whenever_that_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = |time: &str, date: &str| {
            format!(
                "[dataset]\nname='x'\nskip_rows=1\n[train]\nfile='train.toml'\n[columns]\n\
                 time={{column='t',{time}}}\nspeed={{column='v',unit='km/h'}}\n\
                 [[runs]]\nfile='1.csv'\n{date}\n"
            )
        };
        let recorded = |time: &str, date: &str, cell: &str| {
            let text = format!("Logger\nt,v\n,\n{cell},1\n{}", "x".repeat(1 << 17));
            std::fs::write(folder.path().join("1.csv"), text).unwrap();
            std::fs::write(folder.path().join(MANIFEST_FILE), manifest(time, date)).unwrap();
            let runs = runs_in(folder.path(), "2020-01-02", None, &mut LearnerMemory::default());
            runs[0].recorded.to_string()
        };
        let (iso, clock) = ("format='iso'", "format='clock'");
        assert_eq!(recorded(iso, "", "2026-03-18T07:13:20.2"), "2026-03-18T07:13:20Z");
        assert_eq!(recorded(clock, "date=2026-03-18", "07:13:20.2"), "2026-03-18T07:13:20Z");
        assert_eq!(recorded("unit='s'", "date=2026-03-18", "0"), "2026-03-18T00:00:00Z");
        assert_eq!(recorded(clock, "", "07:13:20.2"), "2020-01-02T00:00:00Z", "else the path's");
    }

    #[test]
    fn folders_with_a_trains_number_are_that_trains() {
        let (runs, trains) = (Path::new("/runs"), [TrainId(1), TrainId(7)]);
        let is_of = |train: u64, path: &str, trains: &[TrainId]| {
            let places = Places { runs, own: Path::new("/own"), trains };
            super::is_of(TrainId(train), &runs.join(path), places)
        };
        assert!(is_of(7, "train=7/2026-11-23", &trains) && !is_of(1, "7/a", &trains));
        assert!(!is_of(1, "a", &trains) && is_of(1, "a", &trains[..1]));
        assert!(is_of(1, "ring/run-000001.mcap", &trains));
    }
}
