//! Reading a scenario, and keeping its paths inside its tree.

use std::path::{Component, Path, PathBuf};

use ron::extensions::Extensions;

use super::{Scenario, ScenarioError};

/// A scenario that passed every check that needs no scene.
#[derive(Debug, Clone)]
pub struct LoadedScenario {
    /// What the file says.
    pub scenario: Scenario,
    /// The file.
    pub file: PathBuf,
    /// The folder that its paths are relative to and may not leave; absolute.
    pub tree: PathBuf,
    /// Hash of the file as it was read, 64 hexadecimal digits. What the file names is not in it.
    pub hash: String,
}

impl Scenario {
    /// The largest file that is read.
    pub const MAX_FILE_BYTES: u64 = 16 << 20;

    /// Reads and checks a scenario and the existence of the files it names.
    ///
    /// # Errors
    /// [`ScenarioError`].
    pub fn load(file: &Path) -> Result<LoadedScenario, ScenarioError> {
        let read = |source| ScenarioError::Read { file: file.into(), source };
        let size = std::fs::metadata(file).map_err(read)?.len();
        if size > Self::MAX_FILE_BYTES {
            return Err(ScenarioError::TooLarge { file: file.into(), size, max: Self::MAX_FILE_BYTES });
        }
        let bytes = std::fs::read(file).map_err(read)?;
        // An optional value may be written without `Some`, a model's parameters without a second pair of brackets.
        let options = ron::Options::default()
            .with_default_extension(Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES);
        let scenario: Self = options
            .from_bytes(&bytes)
            .map_err(|source| ScenarioError::Parse { file: file.into(), source: source.into() })?;
        let folder = file.canonicalize().map_err(read)?;
        let folder = folder.parent().unwrap_or(Path::new("/"));
        let tree = match folder.parent() {
            Some(above) if folder.ends_with("scenarios") => above,
            _ => folder,
        };
        let hash = blake3::hash(&bytes).to_hex().to_string();
        let loaded = LoadedScenario { scenario, file: file.into(), tree: tree.into(), hash };
        loaded.validate()?;
        Ok(loaded)
    }
}

impl LoadedScenario {
    /// The file a path in the scenario means.
    ///
    /// # Errors
    /// [`ScenarioError::Outside`] for absolute paths, `..`, and links that lead out; [`ScenarioError::Missing`].
    pub fn resolve(&self, field: &str, value: &str) -> Result<PathBuf, ScenarioError> {
        let outside = || ScenarioError::Outside {
            file: self.file.clone(),
            field: field.into(),
            value: value.into(),
            tree: self.tree.clone(),
        };
        let path = Path::new(value);
        let plain = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
        if value.is_empty() || !path.components().all(plain) {
            return Err(outside());
        }
        let path = self.tree.join(path).canonicalize().map_err(|source| ScenarioError::Missing {
            file: self.file.clone(),
            field: field.into(),
            value: value.into(),
            source,
        })?;
        if path.starts_with(&self.tree) { Ok(path) } else { Err(outside()) }
    }

    /// An error about the content of a file that the scenario names.
    pub(super) fn content_error(&self, field: &str, value: &str, reason: impl ToString) -> ScenarioError {
        ScenarioError::Content {
            file: self.file.clone(),
            field: field.into(),
            value: value.into(),
            reason: reason.to_string(),
        }
    }
}
