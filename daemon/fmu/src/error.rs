//! Reasons why a call is refused.

use std::path::PathBuf;

use dynocar_analysis::dataset::DatasetError;
use dynocar_core::pipeline::SettingError;

/// Why a call of the FMU is refused. The instance is as it was before, except for the variables of a row that were set
/// before the refused one.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// No variable has this value reference.
    #[error("no variable has the value reference {0}")]
    UnknownReference(u32),
    /// The variable is of another type than the function's.
    #[error("{name} is of type {is}, not {expected}")]
    WrongType {
        /// The variable.
        name: &'static str,
        /// Its type.
        is: &'static str,
        /// The function's type.
        expected: &'static str,
    },
    /// An output is not set.
    #[error("{0} is an output and cannot be set")]
    NotAnInput(&'static str),
    /// A number that the input cannot have.
    #[error("{name} = {value}: expected {expected}")]
    BadValue {
        /// The input or argument.
        name: &'static str,
        /// The number.
        value: f64,
        /// Expected value, in words.
        expected: &'static str,
    },
    /// A step that the train cannot take.
    #[error(
        "communicationStepSize = {step_s}: expected {least_s} to {most_s} s; a dead time of the forces \
         needs steps that are not too short"
    )]
    BadStep {
        /// The step in s.
        step_s: f64,
        /// The shortest in s.
        least_s: f64,
        /// The longest in s.
        most_s: f64,
    },
    /// A step that does not begin where the one before ended.
    #[error(
        "currentCommunicationPoint = {time_s} s: expected {next_s} s, the end of the step before; steps are not \
         taken back, repeated or left out"
    )]
    OffPoint {
        /// Where the step begins, in s.
        time_s: f64,
        /// Where it should, in s.
        next_s: f64,
    },
    /// The call comes at the wrong time.
    #[error("{call} is not allowed {now}")]
    WrongOrder {
        /// Name of the call.
        call: &'static str,
        /// Where the instance stands, in words.
        now: &'static str,
    },
    /// A pointer that must not be null is null.
    #[error("{0} is NULL")]
    Null(&'static str),
    /// A text is not UTF-8, or has a NUL in it.
    #[error("{0} is no text in UTF-8")]
    NotText(&'static str),
    /// The function is not among the declared capabilities.
    #[error("{0} is not supported")]
    NotSupported(&'static str),
    /// A file is to be found inside the FMU, but nobody knows where that is.
    #[error(
        "{0:?} is no local folder: name the files by absolute paths in train_file and track_file"
    )]
    NoFolder(String),
    /// No train is described.
    #[error("{}: no such file; the FMU holds no train: set train_file", .0.display())]
    NoTrain(PathBuf),
    /// A file cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A file says something wrong.
    #[error(transparent)]
    Description(#[from] DatasetError),
    /// An estimator cannot be built for the train.
    #[error(transparent)]
    Setting(#[from] SettingError),
}
