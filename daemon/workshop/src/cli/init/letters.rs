//! The letters of recordings that nobody described.

use std::path::PathBuf;

use dynocar_analysis::dataset::encoding::{decoded, guessed};
use dynocar_analysis::dataset::{FileProblem, SourcePosition};
use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};

use dynocar::cli::Failure;
use dynocar::text_file::{read_beginning, read_bytes};

/// Name and text of a file.
pub type NamedText = (String, String);

/// Files in the encoding that they share, and that.
///
/// # Errors
///
/// When one cannot be read, or is written in other letters than the others.
pub fn texts(paths: &[PathBuf]) -> Result<(Vec<NamedText>, &'static Encoding), Failure> {
    let mut files = Vec::new();
    for path in paths {
        let label = path.display().to_string();
        let unread = |problem: FileProblem| problem.of(&label);
        // In UTF-16 every other byte may be 0, which is a mark of other formats elsewhere.
        let begins = guessed(&read_beginning(path, 2).map_err(unread)?);
        let is_wide = [UTF_16LE, UTF_16BE].contains(&begins);
        let bytes = read_bytes(path, if is_wide { begins } else { UTF_8 }).map_err(unread)?;
        files.push((label, guessed(&bytes), bytes));
    }
    // What holds plain letters only is written in any of them.
    let is_plain = |bytes: &[u8]| bytes.is_ascii();
    let special = files.iter().find(|(_, _, bytes)| !is_plain(bytes));
    let (first, encoding) =
        special.map_or((String::new(), UTF_8), |(label, encoding, _)| (label.clone(), *encoding));
    let mut texts = Vec::new();
    for (label, own, bytes) in files {
        if own != encoding && !is_plain(&bytes) {
            let words = format!(
                "{label}: the encoding is {}, but {} in {first}: files of one dataset are laid out \
                 alike",
                own.name(),
                encoding.name()
            );
            return Err(Failure::At(SourcePosition::whole(&label), words));
        }
        let text = decoded(bytes, encoding).map_err(|problem| problem.of(&label))?;
        texts.push((label, text));
    }
    Ok((texts, encoding))
}
