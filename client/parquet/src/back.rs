//! A recording to a new MCAP file.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use dynocar::storage::{Disk, settle};
use dynocar_recording::error::WriteError;
use dynocar_recording::writing::{McapError, RecordingWriter};

use crate::reading::Content;

/// Writes a recording; its messages are those from which the Parquet was made.
///
/// # Errors
///
/// When it cannot be written; then there is no file.
pub fn write_mcap(content: &Content, path: &Path) -> Result<(), WriteError> {
    let file = File::create_new(path).map_err(WriteError::of(path))?;
    let done = write(content, file).and_then(|()| Ok(settle(&Disk, path)?));
    if done.is_err() {
        let _ = std::fs::remove_file(path);
    }
    done.map_err(WriteError::of(path))
}

fn write(content: &Content, file: File) -> Result<(), McapError> {
    let mut writer = RecordingWriter::copy(BufWriter::new(file))?;
    for it in &content.metadata {
        let pairs = it.metadata.iter().map(|(key, value)| (key.as_str(), value.clone()));
        writer.metadata(&it.name, &pairs.collect::<Vec<_>>())?;
    }
    for (name, log_time, data) in &content.attached {
        writer.log_next_at(*log_time);
        writer.attach(name, data, 0)?;
    }
    for message in &content.messages {
        writer.log_next_at(message.log_time);
        writer.write(message.row.message())?;
    }
    writer.finish()?.into_inner().map_err(|error| error.into_error())?;
    Ok(())
}
