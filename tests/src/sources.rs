//! The project's own sources, for the tests of how they are built.

use std::path::{Path, PathBuf};

/// The source folders of all packages.
pub const FOLDERS: [&str; 19] = [
    "shared/src",
    "shared/transport/src",
    "client/src",
    "client/python/src",
    "daemon/model/src",
    "daemon/core/src",
    "daemon/estimators/src",
    "daemon/dataset/src",
    "daemon/analysis/src",
    "daemon/fmu/src",
    "daemon/src",
    "daemon/workshop/src",
    "daemon/mcap/src",
    "daemon/recording/src",
    "daemon/parquet/src",
    "daemon/live/src",
    "daemon/watch/src",
    "bench/src",
    "tests/src",
];

/// Returns the folder of the workspace.
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Returns all files of Rust in a folder of the workspace.
///
/// # Panics
///
/// When there is no such folder.
pub fn rust_files(folder: &str) -> Vec<PathBuf> {
    let (mut files, mut open) = (Vec::new(), vec![workspace().join(folder)]);
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).expect("a source folder") {
            let path = entry.expect("a folder entry").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                files.push(path);
            }
        }
    }
    files
}

/// Returns true for a file that holds only tests or helpers of tests.
pub fn is_of_tests(path: &Path) -> bool {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    name.ends_with("tests") || name == "test_runs"
}

/// Returns how many lines an item takes from its head on: to its semicolon, or to the brace that closes it at the same
/// indentation, as `cargo fmt` sets it.
pub fn item_lines(lines: &[&str]) -> usize {
    let head = lines.first().copied().unwrap_or_default();
    let indent = &head[..head.len() - head.trim_start().len()];
    let is_at_head = |line: &str| line.len() - line.trim_start().len() == indent.len();
    let ends_head = |line: &&str| is_at_head(line) && line.ends_with(['{', ';', '}']);
    let Some(last) = lines.iter().position(ends_head) else { return lines.len() };
    let close = format!("{indent}}}");
    let is_close = |line: &&str| line.strip_suffix(';').unwrap_or(line) == close;
    let closes =
        if lines[last].ends_with('{') { lines[last..].iter().position(is_close) } else { Some(0) };
    closes.map_or(lines.len(), |more| last + more + 1)
}

/// Returns a source without its tests.
pub fn without_tests(text: &str) -> Vec<&str> {
    let lines: Vec<&str> = text.lines().collect();
    let (mut kept, mut at) = (Vec::new(), 0);
    while at < lines.len() {
        if lines[at].trim() == "#[cfg(test)]" {
            at += 1 + item_lines(&lines[at + 1..]);
        } else {
            kept.push(lines[at]);
            at += 1;
        }
    }
    kept
}
