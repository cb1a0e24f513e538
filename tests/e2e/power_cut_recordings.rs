//! Recordings after a power cut: the files on the disk can be read, kept events are whole or absent, and no recorder
//! waits for a disk.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

use dynocar::storage::{Disk, Rights, Storage};
use dynocar_mcap::copying::recover_on;
use dynocar_mcap::event::{Event, EventKind};
use dynocar_mcap::reading::{FileEnding, read};
use dynocar_mcap::recording::Recording;
use dynocar_mcap::topic::Message;
use dynocar_recording::record::{EventKeeper, Keeping, RecordingFiles, Rotation};
use dynocar_shared::{TrainId, TrainSample};
use dynocar_tests::power_cut::{Left, LossyDisk, Neglect, NotedDisk};

const HOUR: Duration = Duration::from_secs(3600);
/// Number of recorded samples, and the number after which they are handed to the system.
const SAMPLES: u64 = 120;
const FLUSH: u64 = 20;
/// The sample after which a suspicion rises.
const SUSPICION: u64 = 75;

/// A folder in memory: the disk is simulated, so that the test waits for no real one.
fn place() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm").unwrap()
}

fn sample(sequence: u64) -> TrainSample {
    TrainSample { sequence, ..TrainSample::empty(TrainId(1)) }
}

/// Statement at a moment, after a number of steps of the disk.
#[derive(Clone, Debug)]
struct Mark {
    steps: usize,
    /// Samples that were said to last.
    lasting: u64,
    /// The first sample of the oldest file of the ring.
    oldest: u64,
    /// The stretch that was said to be kept.
    kept: Option<PathBuf>,
}

/// A flight recorder's run on a disk that is noted.
struct Run {
    folder: tempfile::TempDir,
    notes: LossyDisk,
    marks: Vec<Mark>,
}

impl Run {
    fn on(neglect: Neglect) -> Run {
        let folder = place();
        let notes = LossyDisk::new(neglect);
        let disk = Arc::new(NotedDisk { notes: notes.clone() });
        let keeping = Keeping { before: HOUR, after: HOUR, most_bytes: 1 << 30 };
        let rotation =
            Rotation { bytes: Some(4_500), keep_bytes: Some(14_000), ..Rotation::default() };
        let keeper = EventKeeper::begin(disk.clone(), folder.path(), keeping).unwrap();
        let output = folder.path().join("ring.mcap");
        let begun =
            RecordingFiles::begin(disk, &output, rotation, Some(Duration::ZERO), Some(keeper));
        let mut files = begun.unwrap();
        let mut run = Run { folder, notes, marks: Vec::new() };
        let mut firsts = BTreeMap::from([(files.path().to_path_buf(), 1)]);
        let mut events = 0;
        for sequence in 1..=SAMPLES {
            files.write(Message::Sample(&sample(sequence))).unwrap();
            if sequence == SUSPICION {
                let kind = EventKind::SuspicionRaised;
                let text = "dragging_brake".into();
                let event = Event { kind: kind as i32, train_id: 1, text, ..Event::default() };
                files.write(Message::Event(&event)).unwrap();
                events = 1;
            }
            if sequence % FLUSH == 0 || sequence == SUSPICION {
                files.flush().unwrap();
                firsts.entry(files.path().to_path_buf()).or_insert(sequence + 1);
                let lasting = files.lasting().saturating_sub(events);
                run.mark(lasting, &firsts);
            }
        }
        files.finish().unwrap();
        run.mark(SAMPLES, &firsts);
        run
    }

    fn mark(&mut self, lasting: u64, firsts: &BTreeMap<PathBuf, u64>) {
        let oldest = firsts.iter().find(|it| it.0.exists()).map_or(1, |it| *it.1);
        let kept = std::fs::read_dir(self.folder.path().join("kept")).unwrap().flatten().next();
        let steps = self.notes.steps();
        self.marks.push(Mark { steps, lasting, oldest, kept: kept.map(|it| it.path()) });
    }

    /// Cuts the power after every step; gives how many different disks were looked at, and the first that was
    /// not as promised.
    fn cut(&self) -> (usize, Option<String>) {
        let (mut seen, mut names, mut known) = (HashSet::new(), HashSet::new(), Known::new());
        let random = RandomState::new();
        for count in 0..=self.notes.steps() {
            let before = self.marks.iter().rfind(|it| it.steps <= count);
            let after = self.marks.iter().find(|it| it.steps >= count);
            let promise = Promise {
                lasting: before.map_or(0, |it| it.lasting),
                oldest: after.or(before).map_or(1, |it| it.oldest),
                kept: before.and_then(|it| it.kept.clone()),
                oldest_kept: self
                    .marks
                    .iter()
                    .find(|it| it.kept.is_some())
                    .map_or(1, |it| it.oldest),
            };
            for left in self.notes.left_after(count) {
                let left: Left =
                    left.into_iter().map(|(name, it)| (self.inside(&name), it)).collect();
                let is_new_place = names.insert(left.keys().cloned().collect::<Vec<_>>());
                let seen_by = random.hash_one((&left, promise.lasting, promise.oldest));
                if !seen.insert(seen_by) {
                    continue;
                }
                let checked = check(&left, &promise, &mut known)
                    .and_then(|()| if is_new_place { go_on(&left) } else { Ok(()) });
                if let Err(problem) = checked {
                    return (seen.len(), Some(format!("after {count} steps: {problem}")));
                }
            }
        }
        (seen.len(), None)
    }

    /// A name as it is below the ring's folder.
    fn inside(&self, name: &Path) -> PathBuf {
        name.strip_prefix(self.folder.path()).unwrap().into()
    }
}

/// Checks the files after a power cut, as a user finds them at the next start.
fn check(left: &Left, promise: &Promise, known: &mut Known) -> Result<(), String> {
    let mut folders: BTreeMap<&str, Vec<&Vec<u8>>> = BTreeMap::new();
    for (name, content) in left.iter().filter(|it| it.0.extension().is_some_and(|it| it == "mcap"))
    {
        let folder = name.parent().unwrap().to_str().unwrap();
        folders.entry(folder).or_default().push(content);
    }
    let ring = sequences(folders.remove("").unwrap_or_default(), known);
    is_whole(&ring, promise.oldest, promise.lasting).map_err(|it| format!("ring: {it}"))?;
    let kept = promise.kept.as_ref().map(|it| it.file_name().unwrap().to_str().unwrap());
    if let Some(missing) = kept.filter(|&it| !folders.contains_key(&*format!("kept/{it}"))) {
        return Err(format!("{missing} is gone"));
    }
    for (folder, files) in folders.into_iter().filter(|it| !it.0.starts_with("kept/.")) {
        let account = left.get(&Path::new(folder).join("stretch.toml"));
        let account = String::from_utf8_lossy(account.map_or(&[], |it| &it[..]));
        if !account.contains("dragging_brake") || account.parse::<toml::Table>().is_err() {
            return Err(format!("{folder}: its account is {account:?}"));
        }
        is_whole(&sequences(files, known), promise.oldest_kept, promise.lasting)
            .map_err(|it| format!("{folder}: {it}"))?;
    }
    Ok(())
}

/// Files that a disk has to hold.
struct Promise {
    lasting: u64,
    oldest: u64,
    kept: Option<PathBuf>,
    oldest_kept: u64,
}

/// Samples by the contents of the files.
type Known = HashMap<Vec<Vec<u8>>, Vec<u64>>;

/// The samples of files that are recovered together.
fn sequences(files: Vec<&Vec<u8>>, known: &mut Known) -> Vec<u64> {
    let contents: Vec<Vec<u8>> = files.into_iter().cloned().collect();
    known.entry(contents).or_insert_with_key(|contents| recovered(contents)).clone()
}

fn recovered(contents: &[Vec<u8>]) -> Vec<u64> {
    let place = place();
    let (path, names) = (place.path().join("whole.mcap"), 0..contents.len());
    let files: Vec<PathBuf> = names.map(|it| place.path().join(format!("{it:03}.mcap"))).collect();
    for (path, content) in files.iter().zip(contents) {
        std::fs::write(path, content).unwrap();
    }
    // A single file of which nothing is left is reported as no recording.
    let notes = LossyDisk::new(Neglect::Nothing);
    if files.is_empty() || recover_on(&NotedDisk { notes }, &files, &path).is_err() {
        return Vec::new();
    }
    let mut recording = Recording::default();
    assert_eq!(read(&path, &mut recording).unwrap(), FileEnding::Whole);
    recording.samples.iter().map(|it| it.sequence).collect()
}

/// No sample is missing from the oldest that has to be there to the newest that was said to last, and all
/// are in order.
fn is_whole(sequences: &[u64], oldest: u64, lasting: u64) -> Result<(), String> {
    let is_in_order = sequences.windows(2).all(|it| it[0] < it[1]);
    let there = sequences.iter().filter(|it| (oldest..=lasting).contains(it)).count() as u64;
    if !is_in_order || there < (lasting + 1).saturating_sub(oldest) {
        let (first, last) = (sequences.first(), sequences.last());
        let found = format!("{first:?} to {last:?}, in order {is_in_order}");
        return Err(format!("{found}; expected {oldest} to {lasting}, found {there}"));
    }
    Ok(())
}

/// The next flight recorder starts from any files that are left.
fn go_on(left: &Left) -> Result<(), String> {
    let place = place();
    let ring = place.path();
    for (name, content) in left {
        std::fs::create_dir_all(ring.join(name).parent().unwrap()).unwrap();
        std::fs::write(ring.join(name), content).unwrap();
    }
    let keeping = Keeping { before: HOUR, after: HOUR, most_bytes: 1 << 30 };
    let disk = Arc::new(NotedDisk { notes: LossyDisk::new(Neglect::Nothing) });
    let keeper = EventKeeper::begin(disk.clone(), ring, keeping).map_err(|it| it.to_string())?;
    let rotation = Rotation { bytes: Some(4_500), ..Rotation::default() };
    let (output, sync) = (ring.join("ring.mcap"), Some(Duration::ZERO));
    let begun = RecordingFiles::begin(disk, &output, rotation, sync, Some(keeper));
    let mut files = begun.map_err(|it| it.to_string())?;
    files.write(Message::Sample(&sample(1_000_000))).map_err(|it| it.to_string())?;
    files.finish().map(|_| ()).map_err(|it| it.to_string())
}

#[test]
fn a_power_cut_leaves_what_was_brought_to_the_disk_and_kept_events_whole_or_not_at_all() {
    let run = Run::on(Neglect::Nothing);
    let last = run.marks.last().unwrap();
    assert!(last.oldest > 1, "the ring has gone round");
    assert!(run.marks.iter().rev().nth(1).unwrap().lasting > SAMPLES / 2, "{:?}", run.marks);
    assert!(last.kept.is_some());
    let (looked_at, broken) = run.cut();
    assert_eq!(broken, None);
    assert!(looked_at > 1000, "only {looked_at} disks");
}

#[test]
fn a_disk_that_keeps_bytes_or_names_of_recordings_back_is_noticed() {
    for neglect in [Neglect::Bytes, Neglect::Names] {
        assert!(Run::on(neglect).cut().1.is_some(), "{neglect:?}");
    }
}

/// Cuts the power after every step of a file being made whole; gives the first disk that was not as promised.
fn cut_recovery(neglect: Neglect) -> Option<String> {
    let folder = place();
    let (from, to) = (folder.path().join("run.mcap"), folder.path().join("whole.mcap"));
    let mut files =
        RecordingFiles::begin(Arc::new(Disk), &from, Rotation::default(), None, None).unwrap();
    for sequence in 1..=200 {
        files.write(Message::Sample(&sample(sequence))).unwrap();
    }
    files.finish().unwrap();
    let notes = LossyDisk::new(neglect);
    recover_on(&NotedDisk { notes: notes.clone() }, &[from], &to).unwrap();
    let whole = std::fs::read(&to).unwrap();
    for count in 0..=notes.steps() {
        for left in notes.left_after(count) {
            let there = left.get(&to);
            if count == notes.steps() && there != Some(&whole) {
                return Some("it is lost though it was reported to be there".into());
            }
            let Some(content) = there.filter(|it| **it != whole) else { continue };
            std::fs::write(folder.path().join("left.mcap"), content).unwrap();
            let ending = read(&folder.path().join("left.mcap"), &mut ());
            if matches!(ending, Ok(FileEnding::Whole)) {
                return Some(format!("after {count} steps a part looks whole"));
            }
        }
    }
    None
}

#[test]
fn what_was_made_whole_is_on_the_disk_when_that_is_reported_and_a_part_of_it_never_looks_whole() {
    assert_eq!(cut_recovery(Neglect::Nothing), None);
    for neglect in [Neglect::Bytes, Neglect::Names] {
        assert!(cut_recovery(neglect).is_some(), "{neglect:?} is noticed");
    }
}

/// A disk that takes bytes, and brings none of them to where they last until it is let go.
#[derive(Default)]
struct Stalled {
    is_let_go: Mutex<bool>,
    let_go: Condvar,
}

impl Stalled {
    fn wait(&self) {
        let is_let_go = self.is_let_go.lock().unwrap();
        drop(self.let_go.wait_while(is_let_go, |it| !*it).unwrap());
    }
}

impl Storage for Stalled {
    fn write_new(&self, path: &Path, content: &[u8], rights: &Rights) -> io::Result<()> {
        Disk.write_new(path, content, rights)
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn Write + Send>> {
        Disk.create(path)
    }

    fn sync_file(&self, _: &Path) -> io::Result<()> {
        self.wait();
        Ok(())
    }

    fn link(&self, from: &Path, to: &Path) -> io::Result<()> {
        Disk.link(from, to)
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        Disk.rename(from, to)
    }

    fn rename_new(&self, from: &Path, to: &Path) -> io::Result<()> {
        Disk.rename_new(from, to)
    }

    fn make_folder(&self, path: &Path) -> io::Result<()> {
        Disk.make_folder(path)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        Disk.remove(path)
    }

    fn sync_directory(&self, _: &Path) -> io::Result<()> {
        self.wait();
        Ok(())
    }
}

#[test]
fn whoever_records_does_not_wait_for_a_disk_that_stalls() {
    let folder = tempfile::tempdir().unwrap();
    let disk = Arc::new(Stalled::default());
    let output = folder.path().join("run.mcap");
    let rotation = Rotation { bytes: Some(50_000), ..Rotation::default() };
    let begun = RecordingFiles::begin(disk.clone(), &output, rotation, Some(Duration::ZERO), None);
    let mut files = begun.unwrap().keep_house_in_parallel().unwrap();
    for sequence in 1..=5000 {
        files.write(Message::Sample(&sample(sequence))).unwrap();
        if sequence % 100 == 0 {
            files.flush().unwrap();
        }
    }
    assert_eq!(files.lasting(), 0, "nothing is said to last that does not");
    let entries = std::fs::read_dir(folder.path()).unwrap().flatten();
    let mut parts: Vec<PathBuf> = entries.map(|it| it.path()).collect();
    parts.sort();
    assert!(parts.len() > 2, "{parts:?}");
    let contents: Vec<Vec<u8>> = parts.iter().map(|it| std::fs::read(it).unwrap()).collect();
    assert_eq!(recovered(&contents), (1..=5000).collect::<Vec<_>>());
    *disk.is_let_go.lock().unwrap() = true;
    disk.let_go.notify_all();
    let start = Instant::now();
    while files.lasting() < 5000 {
        files.flush().unwrap();
        assert!(start.elapsed() < Duration::from_secs(60), "{} last", files.lasting());
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(files.finish().unwrap().samples, 5000);
}
