//! A disk that loses what was not brought to it: every state in which a power cut may leave it.
//!
//! The disk is asked what [`Storage`] asks of one, and notes each step. After a cut there are, in
//! any combination: names whose change was not brought to the disk, changed or not, each on its
//! own; and of bytes that were not, none, half, all, or as many zeros. A renaming is whole or not
//! at all, as on every journalling file system.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use dynocar::storage::{Rights, Storage};

/// Changes of names that are taken in any combination; older ones are taken as done.
const NAMES_MAX: usize = 8;

/// Which of its duties a disk neglects, to show that the tests notice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Neglect {
    /// None.
    Nothing,
    /// Bytes are never brought to the disk.
    Bytes,
    /// Names are never brought to the disk.
    Names,
}

#[derive(Clone, Debug)]
enum Step {
    Make {
        path: PathBuf,
        file: usize,
    },
    Write {
        file: usize,
        bytes: Vec<u8>,
    },
    SyncBytes {
        file: usize,
    },
    Rename {
        from: PathBuf,
        to: PathBuf,
        file: usize,
    },
    /// Of a folder: all its files at once.
    RenameFolder {
        from: PathBuf,
        to: PathBuf,
    },
    Remove {
        path: PathBuf,
    },
    SyncNames,
}

/// The disk, with all that was asked of it.
#[derive(Debug)]
pub struct LossyDisk {
    neglect: Neglect,
    steps: RefCell<Vec<Step>>,
    /// Files by name as the running system sees them.
    names: RefCell<BTreeMap<PathBuf, usize>>,
    files: RefCell<usize>,
}

/// What is on the disk after a cut: content by name.
pub type Left = BTreeMap<PathBuf, Vec<u8>>;

impl LossyDisk {
    /// An empty disk.
    pub fn new(neglect: Neglect) -> Self {
        LossyDisk {
            neglect,
            steps: RefCell::default(),
            names: RefCell::default(),
            files: RefCell::default(),
        }
    }

    /// Steps so far: power may be cut after any number of them.
    pub fn steps(&self) -> usize {
        self.steps.borrow().len()
    }

    /// Everything that a cut after so many steps may leave.
    pub fn left_after(&self, count: usize) -> Vec<Left> {
        let mut disk = AfterSteps::default();
        self.steps.borrow()[..count].iter().for_each(|step| disk.take(step));
        disk.left()
    }

    fn note(&self, step: Step) {
        let is_neglected = match step {
            Step::SyncBytes { .. } => self.neglect == Neglect::Bytes,
            Step::SyncNames => self.neglect == Neglect::Names,
            _ => false,
        };
        if !is_neglected {
            self.steps.borrow_mut().push(step);
        }
    }
}

impl Storage for LossyDisk {
    fn write_new(&self, path: &Path, content: &[u8], _: &Rights) -> io::Result<()> {
        if self.names.borrow().contains_key(path) {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        let file = *self.files.borrow();
        self.names.borrow_mut().insert(path.into(), file);
        *self.files.borrow_mut() += 1;
        self.note(Step::Make { path: path.into(), file });
        self.note(Step::Write { file, bytes: content.into() });
        self.note(Step::SyncBytes { file });
        Ok(())
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        let mut names = self.names.borrow_mut();
        let file = names.remove(from).ok_or(io::ErrorKind::NotFound)?;
        names.insert(to.into(), file);
        self.note(Step::Rename { from: from.into(), to: to.into(), file });
        Ok(())
    }

    fn rename_new(&self, from: &Path, to: &Path) -> io::Result<()> {
        if self.names.borrow().keys().any(|name| name.starts_with(to)) {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        if self.names.borrow().contains_key(from) {
            return self.rename(from, to);
        }
        let step = Step::RenameFolder { from: from.into(), to: to.into() };
        apply(&step, &mut self.names.borrow_mut());
        self.note(step);
        Ok(())
    }

    // A folder is there with the files in it.
    fn make_folder(&self, _: &Path) -> io::Result<()> {
        Ok(())
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        self.names.borrow_mut().remove(path).ok_or(io::ErrorKind::NotFound)?;
        self.note(Step::Remove { path: path.into() });
        Ok(())
    }

    fn sync_directory(&self, _: &Path) -> io::Result<()> {
        self.note(Step::SyncNames);
        Ok(())
    }
}

/// Bytes of a file, in memory and for good.
#[derive(Clone, Debug, Default)]
struct Bytes {
    written: Vec<u8>,
    lasting: Option<Vec<u8>>,
}

/// The disk after some steps.
#[derive(Debug, Default)]
struct AfterSteps {
    lasting_names: BTreeMap<PathBuf, usize>,
    changes: Vec<Step>,
    files: BTreeMap<usize, Bytes>,
}

impl AfterSteps {
    fn take(&mut self, step: &Step) {
        match step {
            Step::Write { file, bytes } => {
                self.files.entry(*file).or_default().written.clone_from(bytes);
            }
            Step::SyncBytes { file } => {
                let bytes = self.files.entry(*file).or_default();
                bytes.lasting = Some(bytes.written.clone());
            }
            Step::SyncNames => {
                let changes = std::mem::take(&mut self.changes);
                changes.iter().for_each(|change| apply(change, &mut self.lasting_names));
            }
            Step::Make { .. }
            | Step::Rename { .. }
            | Step::RenameFolder { .. }
            | Step::Remove { .. } => {
                self.changes.push(step.clone());
            }
        }
    }

    fn left(&self) -> Vec<Left> {
        let done = self.changes.len().saturating_sub(NAMES_MAX);
        let (old, open) = self.changes.split_at(done);
        let mut all = Vec::new();
        for chosen in 0..1_u32 << open.len() {
            let mut names = self.lasting_names.clone();
            old.iter().for_each(|change| apply(change, &mut names));
            for (place, change) in open.iter().enumerate() {
                if chosen >> place & 1 == 1 {
                    apply(change, &mut names);
                }
            }
            all.extend(self.with_bytes(&names));
        }
        all
    }

    /// Every combination of the contents that the named files may have.
    fn with_bytes(&self, names: &BTreeMap<PathBuf, usize>) -> Vec<Left> {
        let mut all = vec![Left::new()];
        for (path, file) in names {
            let contents = self.files.get(file).map_or(vec![Vec::new()], Bytes::contents);
            all = all
                .iter()
                .flat_map(|left| {
                    contents.iter().map(|content| {
                        let mut left = left.clone();
                        left.insert(path.clone(), content.clone());
                        left
                    })
                })
                .collect();
        }
        all
    }
}

impl Bytes {
    fn contents(&self) -> Vec<Vec<u8>> {
        match &self.lasting {
            Some(lasting) if *lasting == self.written => vec![lasting.clone()],
            lasting => vec![
                lasting.clone().unwrap_or_default(),
                Vec::new(),
                self.written[..self.written.len() / 2].to_vec(),
                vec![0; self.written.len()],
                self.written.clone(),
            ],
        }
    }
}

fn apply(change: &Step, names: &mut BTreeMap<PathBuf, usize>) {
    match change {
        Step::Make { path, file } => {
            names.insert(path.clone(), *file);
        }
        Step::Rename { from, to, file } => {
            names.remove(from);
            names.insert(to.clone(), *file);
        }
        Step::RenameFolder { from, to } => {
            let inside = |name: &PathBuf| Some(to.join(name.strip_prefix(from).ok()?));
            *names = std::mem::take(names)
                .into_iter()
                .map(|(name, file)| (inside(&name).unwrap_or(name), file))
                .collect();
        }
        Step::Remove { path } => {
            names.remove(path);
        }
        Step::Write { .. } | Step::SyncBytes { .. } | Step::SyncNames => {}
    }
}
