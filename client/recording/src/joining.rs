//! The files of a recording that rotated, read as one.

use std::collections::HashMap;
use std::path::PathBuf;

use mcap::records::Metadata;

use crate::reading::{Ending, Item, Raw, ReadError, Visitor, read_among};

/// Reads the files of a recording that rotated, in order, as if they were one: what each repeats is told
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
    for (place, path) in paths.iter().enumerate() {
        (joined.begins, joined.other) = (None, None);
        endings.push(read_among(paths.len(), path, &mut joined)?);
        if let Some(name) = joined.other.take() {
            let (path, before) = (path.clone(), paths[place - 1].clone());
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
