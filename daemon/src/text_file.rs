//! Text files from disk, with an error for everything else at their path.

use std::fs::{File, FileType};
use std::io::{ErrorKind, Read};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;

use dynocar_dataset::FileProblem;
use dynocar_dataset::formats::FORMATS;
use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};

/// A longer file is refused instead of filling the memory.
const BYTES_MAX: u64 = 4 << 30;
/// Message about UTF-16 that is not declared.
const UTF_16: &str =
    "UTF-16: save the file as UTF-8, or, for runs, set encoding = \"utf-16le\" in [dataset]";
/// Bytes that distinguish other formats from text.
const HEAD_BYTES: u64 = 1024;

/// Returns the kind of a path that leads to neither a file nor a folder.
fn irregular(kind: FileType) -> Option<&'static str> {
    let kinds = [
        (kind.is_fifo(), "a pipe"),
        (kind.is_socket(), "a socket"),
        (kind.is_char_device() || kind.is_block_device(), "a device"),
    ];
    kinds.into_iter().find(|(is_it, _)| *is_it).map(|(_, name)| name)
}

/// Returns the format of a file whose first bytes are not text in the encoding; `None` for possible text.
fn other_format(head: &[u8], encoding: &'static Encoding) -> Option<&'static str> {
    if [UTF_16LE, UTF_16BE].contains(&encoding) {
        return None;
    }
    let begins: [(&[u8], &'static str); 14] = [
        (b"MDF     ", "an MF4 or MDF file: export it, as asammdf does with export(\"csv\")"),
        (b"TDSm", "a TDMS file: export it, as npTDMS does with as_dataframe().to_csv()"),
        (b"\x89HDF\r\n", "an HDF5 or MATLAB 7.3 file: export its columns as CSV or Parquet"),
        (b"MATLAB 5.0", "a MATLAB file: export its columns, as writetable does"),
        (
            b"LOGG",
            "a BLF file of CAN frames: decode it to signals first, as asammdf does with a DBC file",
        ),
        (b"SQLite format 3", "an SQLite database: export the table as CSV"),
        (b"#ROSBAG", "a ROS bag: export its topics as CSV"),
        (b"ARROW1", "an Arrow or Feather file: write it as Parquet"),
        (b"\x28\xb5\x2f\xfd", "a zstd file: unpack it first"),
        (&[0x1f, 0x8b], "a gzip file: unpack it first"),
        (b"PK\x03\x04", "a zip file or a workbook: unpack it, or save the sheet as CSV"),
        (b"\xd0\xcf\x11\xe0", "a workbook: save the sheet as CSV"),
        (&[0xff, 0xfe], UTF_16),
        (&[0xfe, 0xff], UTF_16),
    ];
    let mut known = FORMATS.iter().filter_map(|it| it.mark).chain(begins);
    let known = known.find(|(mark, _)| head.starts_with(mark)).map(|(_, name)| name);
    known.or_else(|| match head.iter().position(|&byte| byte == 0) {
        Some(0) => Some("binary data"),
        // Every other byte of letters and digits.
        Some(1) => Some(UTF_16),
        _ => None,
    })
}

fn unreadable(error: std::io::Error) -> FileProblem {
    match error.kind() {
        ErrorKind::NotFound => FileProblem::Missing,
        ErrorKind::IsADirectory => FileProblem::IsFolder,
        kind => FileProblem::Unreadable(kind),
    }
}

/// Refuses, before it is opened, a path that is not a file of a size that can be read: opening a pipe may wait for
/// ever.
///
/// # Errors
///
/// When it is something else, or cannot be looked at.
pub fn require_regular(path: &Path) -> Result<(), FileProblem> {
    let found = std::fs::metadata(path).map_err(unreadable)?;
    if let Some(what) = irregular(found.file_type()) {
        return Err(FileProblem::NotRegular(what));
    }
    if found.is_dir() {
        return Err(FileProblem::IsFolder);
    }
    if found.len() > BYTES_MAX {
        return Err(FileProblem::TooLarge { most: BYTES_MAX, found: found.len() });
    }
    Ok(())
}

/// Reads a text file in UTF-8.
///
/// # Errors
///
/// If there is no file, it is not a regular file, too large, of another format, not UTF-8 or not readable.
pub fn read_text(path: &Path) -> Result<String, FileProblem> {
    in_utf8(read_bytes(path, UTF_8)?)
}

/// Returns the text of bytes in UTF-8.
///
/// # Errors
///
/// If they are of another format or not UTF-8.
pub fn text_of(bytes: Vec<u8>) -> Result<String, FileProblem> {
    require_text(&bytes, UTF_8)?;
    in_utf8(bytes)
}

fn in_utf8(bytes: Vec<u8>) -> Result<String, FileProblem> {
    String::from_utf8(bytes).map_err(|error| {
        let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        FileProblem::NotUtf8 { line: 1 + good.iter().filter(|&&byte| byte == b'\n').count() }
    })
}

/// Refuses the bytes of a file that should be text in an encoding and begins as another format does.
///
/// # Errors
///
/// If they are of another format.
pub fn require_text(bytes: &[u8], encoding: &'static Encoding) -> Result<(), FileProblem> {
    let head = &bytes[..bytes.len().min(HEAD_BYTES as usize)];
    other_format(head, encoding).map_or(Ok(()), |what| Err(FileProblem::NotText(what)))
}

/// Reads a file that should be text in an encoding.
///
/// # Errors
///
/// If there is no file, it is not a regular file, too large, of another format or not readable.
pub fn read_bytes(path: &Path, encoding: &'static Encoding) -> Result<Vec<u8>, FileProblem> {
    let (mut bytes, file) = begin(path, HEAD_BYTES)?;
    require_text(&bytes, encoding)?;
    // A file that grows while it is read is no longer than it was said to be by much.
    file.take(BYTES_MAX).read_to_end(&mut bytes).map_err(unreadable)?;
    Ok(bytes)
}

/// Returns the first bytes of a file, at most `bytes_max`.
///
/// # Errors
///
/// If there is no file, it is not a regular file, too large or not readable.
pub fn read_beginning(path: &Path, bytes_max: u64) -> Result<Vec<u8>, FileProblem> {
    begin(path, bytes_max).map(|(bytes, _)| bytes)
}

fn begin(path: &Path, bytes_max: u64) -> Result<(Vec<u8>, File), FileProblem> {
    require_regular(path)?;
    let mut file = File::open(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    file.by_ref().take(bytes_max).read_to_end(&mut bytes).map_err(unreadable)?;
    Ok((bytes, file))
}
