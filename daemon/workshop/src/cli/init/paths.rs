//! Files as a dataset names them: from its folder.

use std::path::{Path, PathBuf};

use dynocar_analysis::dataset::SourcePosition;

use crate::paths::{self, real};
use dynocar::cli::Failure;

/// The paths of existing files from a folder that need not be there yet.
///
/// # Errors
///
/// A file that is given twice, or whose name no TOML file can hold, is an input failure.
pub fn from_folder(folder: &Path, files: &[PathBuf]) -> Result<Vec<String>, Failure> {
    let mut seen: Vec<PathBuf> = Vec::new();
    let mut paths = Vec::new();
    for file in files {
        let refuse = |words: &str| {
            let label = file.display().to_string();
            Failure::At(SourcePosition::whole(&label), format!("{label}: {words}"))
        };
        let full = real(file);
        if seen.contains(&full) {
            return Err(refuse("expected every run once, found the file twice"));
        }
        let path = paths::from_folder(folder, file);
        let text = path.to_str().ok_or_else(|| refuse("expected a name in UTF-8"))?;
        paths.push(text.into());
        seen.push(full);
    }
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_named_from_the_folder_whether_it_is_there_or_not() {
        let site = tempfile::tempdir().unwrap();
        let at = |name: &str| site.path().join(name);
        std::fs::create_dir_all(at("raw/day")).unwrap();
        std::fs::write(at("raw/day/1.csv"), "").unwrap();
        let named = |folder: &str| from_folder(&at(folder), &[at("raw/day/1.csv")]).unwrap();
        assert_eq!(named("raw"), ["day/1.csv"]);
        assert_eq!(named("raw/day"), ["1.csv"]);
        assert_eq!(named("new/train"), ["../../raw/day/1.csv"]);
        std::os::unix::fs::symlink(at("raw"), at("link")).unwrap();
        assert_eq!(named("link"), ["day/1.csv"]);
        let twice = [at("raw/day/1.csv"), at("link/day/./1.csv")];
        assert!(from_folder(&at("raw"), &twice).is_err());
    }
}
