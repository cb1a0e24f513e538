//! Files as seen from a folder.

use std::path::{Component, Path, PathBuf};

/// The way from a folder, which need not be there yet, to a file.
pub fn from_folder(folder: &Path, file: &Path) -> PathBuf {
    relative(&real(file), &real(folder))
}

/// A path without links, as far as it is there.
pub fn real(path: &Path) -> PathBuf {
    let full = std::path::absolute(path).unwrap_or_else(|_| path.into());
    for known in full.ancestors() {
        if let Ok(start) = known.canonicalize() {
            let rest = full.strip_prefix(known).unwrap_or(Path::new(""));
            return start.join(rest).components().collect();
        }
    }
    full
}

/// The way from a folder to a file, both in full.
fn relative(file: &Path, folder: &Path) -> PathBuf {
    let (file, folder): (Vec<Component>, Vec<Component>) =
        (file.components().collect(), folder.components().collect());
    let shared = file.iter().zip(&folder).take_while(|(one, other)| one == other).count();
    let up = folder[shared..].iter().map(|_| Component::ParentDir);
    up.chain(file[shared..].iter().copied()).collect()
}
