//! What a failure is to the command line: wrong input, or work that could not be done.

use dynocar::cli::Failure;

use crate::annotate::AnnotateError;
use crate::convert::{FromDatasetError, ToDatasetError};
use crate::error::CopyError;
use crate::record::{KeepError, RecordError};

/// A file that is no recording is wrong input; one that cannot be written is not.
impl From<CopyError> for Failure {
    fn from(error: CopyError) -> Self {
        match error {
            CopyError::Read(error) => Failure::input(error),
            CopyError::Write(error) => Failure::work(error),
        }
    }
}

/// A dataset that makes no recording is wrong input; a recording that cannot be written is not.
impl From<FromDatasetError> for Failure {
    fn from(error: FromDatasetError) -> Self {
        match error {
            FromDatasetError::Dataset(error) => error.into(),
            FromDatasetError::Write(_) => Failure::work(error),
            error => Failure::input(error),
        }
    }
}

/// A recording that makes no dataset is wrong input; a dataset that cannot be written is not.
impl From<ToDatasetError> for Failure {
    fn from(error: ToDatasetError) -> Self {
        match error {
            ToDatasetError::Output(error) => error.into(),
            error => Failure::input(error),
        }
    }
}

/// A recording that is another than the one explained is wrong input.
impl From<AnnotateError> for Failure {
    fn from(error: AnnotateError) -> Self {
        match error {
            AnnotateError::Copy(error) => error.into(),
            error => Failure::input(error),
        }
    }
}

/// A name that is taken is wrong input.
impl From<RecordError> for Failure {
    fn from(error: RecordError) -> Self {
        match error {
            RecordError::Taken { .. } | RecordError::Ring(KeepError::Taken { .. }) => {
                Failure::input(error)
            }
            error => Failure::work(error),
        }
    }
}
