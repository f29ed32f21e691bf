//! What can go wrong with a replay.

use std::path::PathBuf;

use crate::export::ExportError;
use crate::picture::PictureError;
use crate::save::SaveError;
use crate::scenario::ScenarioError;

/// Why a replay did not finish.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum ReplayError {
    /// The scenario, or something it names, cannot be used.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// An option is out of range.
    #[error("option `{option}` is {value}, but must be {expected}")]
    Option {
        /// Its name.
        option: &'static str,
        /// What it is.
        value: String,
        /// What it must be.
        expected: String,
    },
    /// No graphics driver.
    #[error(
        "no graphics adapter found; install a Vulkan driver (Debian/Ubuntu: mesa-vulkan-drivers has one that needs \
         no GPU), or run with --no-render"
    )]
    NoAdapter,
    /// A file could not be written.
    #[error("cannot write {}: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A picture or a map could not be written.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The graphics driver failed in the middle: the device was lost, or refused what it was given.
    #[error("{0}; nothing can be drawn any more")]
    Renderer(String),
    /// The renderer did not answer.
    #[error("gave up after {seconds} s waiting for {what}")]
    TimedOut {
        /// What did not come.
        what: &'static str,
        /// How long it was waited for.
        seconds: u64,
    },
    /// The scene could not be saved or restored.
    #[error(transparent)]
    Save(#[from] SaveError),
    /// The scene could not be exported.
    #[error("the export: {0}")]
    Export(#[source] Box<ExportError>),
    /// The report could not be written as JSON.
    #[error("cannot write the report: {0}")]
    Report(#[from] serde_json::Error),
}
