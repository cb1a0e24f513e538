//! The files of a recording that rotated, read as one.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use mcap::records::Metadata;

use crate::error::{ReadError, ReadProblem};
use crate::reading::{FileEnding, Raw, RecordingItem, Visitor, read};

/// Reads the files of a recording that rotated, in order, as if they were one: what each repeats is given
/// once. Gives how each ends.
///
/// # Errors
///
/// As [`read_among`], and when they are not the files of one recording in its order.
pub fn read_all<V: Visitor>(
    paths: &[PathBuf],
    visitor: &mut V,
) -> Result<Vec<FileEnding>, V::Error> {
    let (attached, files_of, seen) = (HashMap::new(), HashMap::new(), Vec::new());
    let path = PathBuf::new();
    let mut joined = Joined { visitor, attached, files_of, seen, path, begins: None };
    let mut endings = Vec::new();
    let mut newest: Option<(&PathBuf, u64)> = None;
    for path in paths {
        joined.path.clone_from(path);
        joined.begins = None;
        endings.push(read_among(paths.len(), path, &mut joined)?);
        let Some(begins) = joined.begins else { continue };
        if let Some((before, _)) = newest.filter(|it| begins < it.1) {
            let problem = ReadProblem::OutOfOrder { before: before.clone() };
            return Err(ReadError::of(path)(problem).into());
        }
        newest = Some((path, begins));
    }
    Ok(endings)
}

/// Reads one of several files of a recording. A power cut may leave nothing of the newest but its name, and zeros:
/// among others that is a file that breaks off at its beginning.
///
/// # Errors
///
/// As [`read`].
pub fn read_among<V: Visitor>(
    count: usize,
    path: &Path,
    visitor: &mut V,
) -> Result<FileEnding, V::Error> {
    if count > 1 && is_nothing(path) {
        let file_bytes = std::fs::metadata(path).map_or(0, |it| it.len());
        let reason = "nothing of it was brought to the disk".to_owned();
        return Ok(FileEnding::Broken { read_bytes: 0, file_bytes, reason });
    }
    read(path, visitor)
}

/// True for a file without a byte other than 0, and for one that ends within the first bytes of MCAP.
fn is_nothing(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    let mut start = Vec::new();
    let mut bytes = BufReader::new(file).bytes().map_while(Result::ok);
    start.extend(bytes.by_ref().take(mcap::MAGIC.len()));
    start.len() < mcap::MAGIC.len() && mcap::MAGIC.starts_with(&start)
        || start.iter().all(|&byte| byte == 0) && bytes.all(|byte| byte == 0)
}

/// Several files as one.
struct Joined<'v, V> {
    visitor: &'v mut V,
    attached: HashMap<String, Vec<u8>>,
    seen: Vec<Metadata>,
    /// The file in which each was attached first.
    files_of: HashMap<String, PathBuf>,
    path: PathBuf,
    /// When the file's first message was recorded.
    begins: Option<u64>,
}

impl<V: Visitor> Visitor for Joined<'_, V> {
    type Error = V::Error;

    fn item(&mut self, item: RecordingItem<'_>) -> Result<(), V::Error> {
        match &item {
            RecordingItem::Attachment { name, content, .. } => match self.attached.get(name) {
                Some(known) if known == content => return Ok(()),
                Some(_) => {
                    let name = name.clone();
                    let problem = match self.files_of.get(&name) {
                        Some(before) if *before != self.path => {
                            ReadProblem::OtherRecording { before: before.clone(), name }
                        }
                        _ => ReadProblem::Merged { name },
                    };
                    return Err(ReadError::of(&self.path)(problem).into());
                }
                None => {
                    self.attached.insert(name.clone(), content.to_vec());
                    self.files_of.insert(name.clone(), self.path.clone());
                }
            },
            RecordingItem::Metadata(it) if self.seen.contains(it) => return Ok(()),
            RecordingItem::Metadata(it) => self.seen.push((*it).clone()),
            _ => {}
        }
        self.visitor.item(item)
    }

    fn raw(&mut self, raw: &Raw<'_>) -> Result<(), V::Error> {
        self.begins.get_or_insert(raw.header.log_time);
        self.visitor.raw(raw)
    }
}
