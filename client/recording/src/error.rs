//! What is wrong with a file, and which.

use std::error::Error;
use std::fmt::{Debug, Display, Formatter};
use std::path::{Path, PathBuf};

use crate::reading::ReadProblem;

/// What is wrong with a file or a folder.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct AtPath<P> {
    /// Which.
    pub path: PathBuf,
    /// What.
    pub problem: P,
}

impl<P> AtPath<P> {
    /// For a file, what makes an error of what is wrong with it.
    pub fn of<T: Into<P>>(path: &Path) -> impl Fn(T) -> Self {
        move |problem| AtPath { path: path.into(), problem: problem.into() }
    }
}

/// Why a file is no recording that can be read.
pub type ReadError = AtPath<ReadProblem>;
/// Why a file or a folder cannot be written.
pub type WriteError = AtPath<Unwritten>;

/// What stopped the writing: any error, so that this is none itself.
#[derive(Debug)]
pub struct Unwritten(Box<dyn Error + Send + Sync>);

impl Display for Unwritten {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "cannot be written: {}", self.0)
    }
}

impl<E: Error + Send + Sync + 'static> From<E> for Unwritten {
    fn from(error: E) -> Self {
        Unwritten(Box::new(error))
    }
}

/// Why a recording does not become another file.
#[derive(Debug, thiserror::Error)]
pub enum CopyError {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The other file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}
