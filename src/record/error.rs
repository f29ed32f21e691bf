//! What can go wrong with a recording.

use std::path::{Path, PathBuf};

use crate::save::SaveError;
use crate::scenario::ScenarioError;

/// Why a session could not be recorded, written down or gone back in. Every variant names the file or the time.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum RecordError {
    /// The scenario, or something that it names, cannot be used.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A file or folder cannot be read or written.
    #[error("cannot record into {}: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The session cannot be put into words.
    #[error("cannot record into {}: {source}", .path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<ron::Error>,
    },
    /// What was kept of an earlier moment cannot be put back.
    #[error(transparent)]
    Save(#[from] SaveError),
    /// Nothing is being recorded.
    #[error("nothing is being recorded")]
    NotRecording,
    /// It is not ready for that: the scene is loading, or time is being gone back in.
    #[error("the session is not ready: the scene is still loading, or time is being gone back in")]
    Busy,
    /// A time that has not been recorded.
    #[error("second {seconds} has not been recorded: there are {recorded} seconds")]
    NotRecorded {
        /// The time that was asked for.
        seconds: f64,
        /// What there is.
        recorded: f64,
    },
}

impl RecordError {
    pub(super) fn write(path: &Path, source: std::io::Error) -> Self {
        Self::Write { path: path.into(), source }
    }
}
