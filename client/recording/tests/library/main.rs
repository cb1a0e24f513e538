//! What the library of recordings promises; the recorder as a process is in `process.rs`.

mod annotate;
mod codec;
mod fields;
mod files;
mod keeping;
mod rotation;
mod rows;
mod support;
mod verify;
