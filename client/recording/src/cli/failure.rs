//! What a failure is to the command line: wrong input, or work that could not be done.

use dynocar::cli::Failure;

use crate::convert::FromDatasetError;

/// A dataset that makes no recording is wrong input; a recording that cannot be written is not.
pub fn from_dataset_failure(error: FromDatasetError) -> Failure {
    match error {
        FromDatasetError::Dataset(error) => error.into(),
        FromDatasetError::Write { .. } => Failure::Work(error.to_string()),
        error => Failure::Input(error.to_string()),
    }
}
