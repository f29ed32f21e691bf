//! What can be wrong with a saved scene.

use std::path::PathBuf;

use crate::picture::PictureError;

/// Why a scene could not be saved or restored. Every variant names the file.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum SaveError {
    /// A file or folder cannot be written.
    #[error("cannot write {}: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file cannot be read.
    #[error("cannot read {}: {source}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The state is not RON of the right shape.
    #[error("{}:{source}", .path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Where and what.
        source: Box<ron::error::SpannedError>,
    },
    /// The state cannot be put into words.
    #[error("cannot write {}: {source}", .path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<ron::Error>,
    },
    /// A map cannot be written or read.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// A value does not fit.
    #[error("{}: `{field}` is {value}, but must be {expected}", .path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// What of it.
        field: String,
        /// What it is.
        value: String,
        /// What it must be.
        expected: String,
    },
}
