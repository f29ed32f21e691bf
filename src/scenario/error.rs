//! What can be wrong with a scenario.

use std::path::PathBuf;

/// Why a scenario was refused. Every variant names the file.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {source}", .file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is too large to be a scenario.
    #[error("{}: has {size} bytes; a scenario has at most {max} (MAX_FILE_BYTES)", .file.display())]
    TooLarge {
        /// The file.
        file: PathBuf,
        /// Bytes.
        size: u64,
        /// The cap.
        max: u64,
    },
    /// The file is not RON of the right shape: a syntax error, or a field that is missing or unknown.
    #[error("{}:{source}", .file.display())]
    Parse {
        /// The file.
        file: PathBuf,
        /// Where and what.
        source: Box<ron::error::SpannedError>,
    },
    /// A value is out of range.
    #[error("{}: field `{field}` is {value}, but must be {expected}", .file.display())]
    Value {
        /// The file.
        file: PathBuf,
        /// Path of the field.
        field: String,
        /// What it is.
        value: String,
        /// What it must be.
        expected: String,
    },
    /// A path that leads out of the scenario's tree, or is absolute.
    #[error("{}: field `{field}` is \"{value}\", which is outside the scenario's tree {}",
        .file.display(), .tree.display())]
    Outside {
        /// The file.
        file: PathBuf,
        /// Path of the field.
        field: String,
        /// The path.
        value: String,
        /// The tree.
        tree: PathBuf,
    },
    /// A file that is not there.
    #[error("{}: field `{field}` is \"{value}\", but there is no such file: {source}", .file.display())]
    Missing {
        /// The file.
        file: PathBuf,
        /// Path of the field.
        field: String,
        /// The path.
        value: String,
        /// Why.
        source: std::io::Error,
    },
    /// A file that is there but cannot be used.
    #[error("{}: field `{field}` is \"{value}\", which cannot be used: {reason}", .file.display())]
    Content {
        /// The file.
        file: PathBuf,
        /// Path of the field.
        field: String,
        /// The path, or what stands for it.
        value: String,
        /// Why.
        reason: String,
    },
}
