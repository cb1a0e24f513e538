//! Recordings to datasets, without loss.
//!
//! A dataset made of a recording holds each sample as a row with all of its fields under their own names;
//! `dataset.toml` maps those that are quantities of a dataset. From such rows the same samples come back, to the bit. A
//! recording made of a dataset has the dataset's files attached, and gives them back.

mod recorded_dataset;
mod rows;
mod to_dataset;

pub use recorded_dataset::{FileContent, RecordedDataset};
pub use rows::{RowError, from_rows, is_rows, to_rows};
pub use to_dataset::{ModelFiles, ToDatasetError, Unpacked, dataset_of, to_dataset, unpack};
