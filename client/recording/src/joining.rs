//! The files of a recording that rotated, read as one.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use mcap::records::Metadata;

use crate::reading::{Ending, Item, Raw, ReadError, Visitor, read};

/// Reads the files of a recording that rotated, in order, as if they were one: what each repeats is given
/// once. Gives how each ends.
///
/// # Errors
///
/// As [`read_among`], and when they are not the files of one recording in its order.
pub fn read_all(paths: &[PathBuf], visitor: &mut impl Visitor) -> Result<Vec<Ending>, ReadError> {
    let mut joined =
        Joined { visitor, attached: HashMap::new(), seen: vec![], begins: None, other: None };
    let mut endings = Vec::new();
    let mut newest: Option<(&PathBuf, u64)> = None;
    for (index, path) in paths.iter().enumerate() {
        (joined.begins, joined.other) = (None, None);
        endings.push(read_among(paths.len(), path, &mut joined)?);
        if let Some(name) = joined.other.take() {
            let (path, before) = (path.clone(), paths[index - 1].clone());
            return Err(ReadError::OtherRecording { path, before, name });
        }
        let Some(begins) = joined.begins else { continue };
        if let Some((before, _)) = newest.filter(|it| begins < it.1) {
            return Err(ReadError::OutOfOrder { path: path.clone(), before: before.clone() });
        }
        newest = Some((path, begins));
    }
    Ok(endings)
}

/// Reads one of so many files of a recording. A power cut may leave nothing of the newest but its name, and
/// zeros: among others that is a file that breaks off at its beginning.
///
/// # Errors
///
/// As [`read`].
pub fn read_among(
    count: usize,
    path: &Path,
    visitor: &mut impl Visitor,
) -> Result<Ending, ReadError> {
    match read(path, visitor) {
        Err(ReadError::NotMcap { .. }) if count > 1 && is_nothing(path) => {
            let file_bytes = std::fs::metadata(path).map_or(0, |it| it.len());
            let reason = "nothing of it was brought to the disk".to_owned();
            Ok(Ending::Broken { read_bytes: 0, file_bytes, reason })
        }
        read => read,
    }
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
    /// When the file's first message was recorded.
    begins: Option<u64>,
    /// A file that is attached with other content than before.
    other: Option<String>,
}

impl<V: Visitor> Visitor for Joined<'_, V> {
    fn item(&mut self, item: Item<'_>) {
        match &item {
            Item::Attachment { name, content, .. } => match self.attached.get(name) {
                Some(known) if known == content => return,
                Some(_) => self.other = Some(name.clone()),
                None => {
                    self.attached.insert(name.clone(), content.to_vec());
                }
            },
            Item::Metadata(it) if self.seen.contains(it) => return,
            Item::Metadata(it) => self.seen.push((*it).clone()),
            _ => {}
        }
        self.visitor.item(item);
    }

    fn raw(&mut self, raw: &Raw<'_>) {
        self.begins.get_or_insert(raw.header.log_time);
        self.visitor.raw(raw);
    }
}
