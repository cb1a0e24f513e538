//! What a failure is to the command line: wrong input, or work that could not be done.

use dynocar::cli::Failure;

use crate::convert::{FromDatasetError, ToDatasetError};
use crate::error::CopyError;

/// A file that is no recording is wrong input; one that cannot be written is not.
pub fn copy_failure(error: CopyError) -> Failure {
    match error {
        CopyError::Read(error) => Failure::Input(error.to_string()),
        CopyError::Write(error) => Failure::Work(error.to_string()),
    }
}

/// A dataset that makes no recording is wrong input; a recording that cannot be written is not.
pub fn from_dataset_failure(error: FromDatasetError) -> Failure {
    match error {
        FromDatasetError::Dataset(error) => error.into(),
        FromDatasetError::Write(_) => Failure::Work(error.to_string()),
        error => Failure::Input(error.to_string()),
    }
}

/// A recording that makes no dataset is wrong input; a dataset that cannot be written is not.
pub fn dataset_failure(error: ToDatasetError) -> Failure {
    match error {
        ToDatasetError::Output(error) => error.into(),
        error => Failure::Input(error.to_string()),
    }
}
