//! A recording as text.

use std::path::Path;

use ron::ser::PrettyConfig;

use super::RecordError;
use crate::output::write_atomic;
use crate::scenario::{Scenario, ron_options};

/// Writes a file under a temporary name and renames it.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), RecordError> {
    write_atomic(path, bytes).map_err(|source| RecordError::write(path, source))
}

/// What a file says, behind a remark of a line or none.
pub(super) fn text_of(scenario: &Scenario, file: &Path, remark: &str) -> Result<String, RecordError> {
    // Lists and their items have lines of their own, what is in them has not.
    let config = PrettyConfig::new().depth_limit(2);
    let text = ron_options()
        .to_string_pretty(scenario, config)
        .map_err(|source| RecordError::Encode { path: file.into(), source: Box::new(source) })?;
    let remark = remark.lines().map(|line| format!("// {line}\n")).collect::<String>();
    Ok(format!("// A recorded session of `weathering sandbox`.\n{remark}{text}\n"))
}
