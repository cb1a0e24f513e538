//! What the library of recordings promises, and the recorder as a process (`process`).

mod annotate;
mod codec;
mod fields;
mod files;
mod keeping;
mod process;
mod rotation;
mod rows;
mod support;
mod support_site;
mod verify;
