//! Tests of the library of recordings, and of the recorder as a process (`process`).

mod annotate;
mod codec;
mod fields;
mod files;
mod keeping;
mod orders;
mod process;
mod rewritten;
mod rotation;
mod rows;
mod support;
mod support_site;
mod verify;
