//! Reading a scenario with what it includes, and keeping its paths inside its tree.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use ron::Options;
use ron::extensions::Extensions;

use super::merge::{Merged, Origins};
use super::{Scenario, ScenarioError, ScenarioPart};
use crate::input::require_file;

/// A scenario that passed every check that needs no scene.
#[derive(Debug, Clone)]
pub struct LoadedScenario {
    /// What the file says, with what it includes and the variant that was chosen.
    pub scenario: Scenario,
    /// The file.
    pub file: PathBuf,
    /// The folder that its paths are relative to and may not leave; absolute.
    pub tree: PathBuf,
    /// Hash of the file as it was read, of those it includes, and of the name of the variant; 64 hexadecimal digits. What
    /// else the file names is not in it.
    pub hash: String,
    /// The variant that was chosen.
    pub variant: Option<String>,
    /// The names of all variants.
    pub variants: Vec<String>,
    /// The files that it includes, in the order in which they were read.
    pub included: Vec<PathBuf>,
    pub(super) origins: Origins,
}

/// How scenarios are written: an optional value without `Some`, a variant's fields without a second pair of brackets.
pub(crate) fn ron_options() -> Options {
    Options::default().with_default_extension(Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES)
}

/// A value in a file that is wrong.
fn value(file: &Path, field: impl Into<String>, value: &str, expected: impl Into<String>) -> ScenarioError {
    let (field, value, expected) = (field.into(), value.into(), expected.into());
    ScenarioError::Value { file: file.into(), field, value, expected }
}

impl Scenario {
    /// The largest file that is read.
    pub const MAX_FILE_BYTES: u64 = 16 << 20;
    /// How deep files may include each other.
    pub const MAX_INCLUDE_DEPTH: usize = 8;
    /// The most files that are included.
    pub const MAX_INCLUDES: usize = 64;

    /// Reads and checks a scenario and the existence of the files it names.
    ///
    /// # Errors
    /// [`ScenarioError`].
    pub fn load(file: &Path) -> Result<LoadedScenario, ScenarioError> {
        Self::load_variant(file, None)
    }

    /// As [`Self::load`], with one of its variants laid over it.
    ///
    /// # Errors
    /// [`ScenarioError`], also if there is no such variant.
    pub fn load_variant(file: &Path, variant: Option<&str>) -> Result<LoadedScenario, ScenarioError> {
        let mut reader = Reader::default();
        // First, so that what is no scenario is told before what is wrong with its place.
        let part = reader.read(file)?;
        let place =
            file.canonicalize().map_err(|source| ScenarioError::Read { file: file.into(), source })?;
        let folder = place.parent().unwrap_or(Path::new("/"));
        let tree = match folder.parent() {
            Some(above) if folder.ends_with("scenarios") => above,
            _ => folder,
        };
        reader.tree = tree.into();
        reader.lay(part, file, &mut vec![place.clone()])?;
        let variants = std::mem::take(&mut reader.merged.part.variants);
        let names = variants.keys().cloned().collect();
        if let Some(variant) = variant {
            reader.choose(file, variant, variants)?;
        }
        let Reader { merged, hasher, included, .. } = reader;
        let scenario = merged
            .part
            .complete()
            .map_err(|field| value(file, field, "missing", "given, here or included"))?;
        let mut loaded = LoadedScenario {
            scenario,
            file: file.into(),
            tree: tree.into(),
            hash: hasher.finalize().to_hex().to_string(),
            variant: variant.map(Into::into),
            variants: names,
            included,
            origins: merged.origins,
        };
        loaded.read_scenes()?;
        loaded.validate()?;
        Ok(loaded)
    }
}

/// Reads files and lays them over each other.
#[derive(Default)]
struct Reader {
    tree: PathBuf,
    merged: Merged,
    hasher: blake3::Hasher,
    included: Vec<PathBuf>,
}

impl Reader {
    fn read(&mut self, file: &Path) -> Result<ScenarioPart, ScenarioError> {
        let read = |source| ScenarioError::Read { file: file.into(), source };
        require_file(file).map_err(read)?;
        let (size, max) = (std::fs::metadata(file).map_err(read)?.len(), Scenario::MAX_FILE_BYTES);
        if size > max {
            return Err(ScenarioError::TooLarge { file: file.into(), size, max });
        }
        let bytes = std::fs::read(file).map_err(read)?;
        self.hasher.update(&bytes);
        let wrong = |source| ScenarioError::Parse { file: file.into(), source: Box::new(source) };
        ron_options().from_bytes(&bytes).map_err(wrong)
    }

    /// Lays over what is there: first what the part includes, then the part. `open`: the files that are being read, each
    /// included by the one before, `file` last.
    fn lay(
        &mut self,
        mut part: ScenarioPart,
        file: &Path,
        open: &mut Vec<PathBuf>,
    ) -> Result<(), ScenarioError> {
        for (index, path) in std::mem::take(&mut part.include).into_iter().enumerate() {
            let field = format!("include[{index}]");
            let found = resolve(&self.tree, file, &field, &path)?;
            if open.contains(&found) {
                let expected = "a file that does not include this one, on whatever way";
                return Err(value(file, field, &path, expected));
            }
            if self.included.contains(&found) {
                continue;
            }
            if open.len() > Scenario::MAX_INCLUDE_DEPTH {
                let expected = format!("no deeper than {} (MAX_INCLUDE_DEPTH)", Scenario::MAX_INCLUDE_DEPTH);
                return Err(value(file, field, &path, expected));
            }
            if self.included.len() >= Scenario::MAX_INCLUDES {
                let expected = format!("one of at most {} (MAX_INCLUDES)", Scenario::MAX_INCLUDES);
                return Err(value(file, field, &path, expected));
            }
            self.included.push(found.clone());
            let below = self.read(&found)?;
            open.push(found.clone());
            self.lay(below, &found, open)?;
            open.pop();
        }
        self.lay_alone(part, file, "")
    }

    /// Lays a part over what is there that includes nothing.
    fn lay_alone(&mut self, part: ScenarioPart, file: &Path, prefix: &str) -> Result<(), ScenarioError> {
        for (name, variant) in &part.variants {
            let field = |field| format!("{prefix}variants.{name}.{field}");
            if !variant.include.is_empty() {
                return Err(value(file, field("include"), "given", "left out of a variant"));
            }
            if !variant.variants.is_empty() {
                return Err(value(file, field("variants"), "given", "left out of a variant"));
            }
        }
        self.merged.lay(part, file, prefix).map_err(|name| {
            value(file, format!("{prefix}emitter_changes"), &name, "the name of an emitter that is there")
        })
    }

    /// Lays one of the variants over what is there.
    fn choose(
        &mut self,
        file: &Path,
        name: &str,
        mut variants: BTreeMap<String, ScenarioPart>,
    ) -> Result<(), ScenarioError> {
        let Some(part) = variants.remove(name) else {
            let names: Vec<_> = variants.keys().map(String::as_str).collect();
            let expected = match names.as_slice() {
                [] => "left out: there are none".to_owned(),
                names => format!("one of: {}", names.join(", ")),
            };
            return Err(value(file, "variants", name, expected));
        };
        self.hasher.update(b"\0variant\0").update(name.as_bytes());
        self.lay_alone(part, file, &format!("variants.{name}."))
    }
}

/// The file that a path in a file means.
fn resolve(tree: &Path, file: &Path, field: &str, value: &str) -> Result<PathBuf, ScenarioError> {
    let outside = || ScenarioError::Outside {
        file: file.into(),
        field: field.into(),
        value: value.into(),
        tree: tree.into(),
    };
    let path = Path::new(value);
    let plain = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
    if value.is_empty() || !path.components().all(plain) {
        return Err(outside());
    }
    let missing = |source| ScenarioError::Missing {
        file: file.into(),
        field: field.into(),
        value: value.into(),
        source,
    };
    let path = tree.join(path).canonicalize().map_err(missing)?;
    if !path.starts_with(tree) {
        return Err(outside());
    }
    require_file(&path).map_err(missing)?;
    Ok(path)
}

impl LoadedScenario {
    /// A scenario that was made in code, by the name of a file in its tree. It is taken as it is: nothing is checked, and
    /// its `scenes` are empty.
    pub fn made(scenario: Scenario, file: PathBuf, tree: PathBuf) -> Self {
        Self {
            scenario,
            file,
            tree,
            hash: String::new(),
            variant: None,
            variants: Vec::new(),
            included: Vec::new(),
            origins: Origins::default(),
        }
    }

    /// The file a path in the scenario means.
    ///
    /// # Errors
    /// [`ScenarioError::Outside`] for absolute paths, `..`, and links that lead out; [`ScenarioError::Missing`].
    pub fn resolve(&self, field: &str, value: &str) -> Result<PathBuf, ScenarioError> {
        let (file, field) = self.written(field);
        resolve(&self.tree, &file, &field, value)
    }

    /// Where a field of the scenario was written.
    pub(super) fn written(&self, field: &str) -> (PathBuf, String) {
        self.origins.find(field).unwrap_or_else(|| (self.file.clone(), field.to_owned()))
    }

    /// An error about the content of a file that the scenario names.
    pub(super) fn content_error(&self, field: &str, value: &str, reason: impl ToString) -> ScenarioError {
        let (file, field) = self.written(field);
        ScenarioError::Content { file, field, value: value.into(), reason: reason.to_string() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VIEW: &str = "seconds: 2.0, camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))])";

    fn load(files: &[(&str, &str)], variant: Option<&str>) -> Result<LoadedScenario, String> {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let file = folder.path().join("scenarios").join(files[0].0.trim_start_matches("scenarios/"));
        Scenario::load_variant(&file, variant).map_err(|error| error.to_string())
    }

    #[test]
    fn a_file_lies_over_what_it_includes_and_a_variant_over_both() {
        let main = format!(
            r#"(include: ["scenarios/low.ron", "parts/high.ron"], {VIEW}, seed: 3,
                variants: {{"fast": (seed: 4, tick_hz: 90)}})"#
        );
        let files = [
            ("scenarios/main.ron", main.as_str()),
            ("scenarios/low.ron", "(seed: 1, tick_hz: 30, wind: (1.0, 0.0, 0.0), max_particles: 5)"),
            // The second time it changes nothing.
            ("parts/high.ron", r#"(include: ["scenarios/low.ron"], tick_hz: 40, materials: {"clay": ()})"#),
        ];
        let plain = load(&files, None).unwrap();
        assert_eq!((plain.scenario.seed, plain.scenario.tick_hz, plain.scenario.max_particles), (3, 40, 5));
        assert!(plain.scenario.materials.contains_key("clay") && plain.scenario.wind.x == 1.0);
        assert_eq!((plain.included.len(), plain.variants.as_slice()), (2, &["fast".to_owned()][..]));
        let fast = load(&files, Some("fast")).unwrap();
        assert_eq!((fast.scenario.seed, fast.scenario.tick_hz), (4, 90));
        assert_eq!(fast.variant.as_deref(), Some("fast"));
        // What was saved from one does not fit the other.
        assert_ne!(fast.hash, plain.hash);
        let error = load(&files, Some("slow")).unwrap_err();
        assert!(error.contains("`variants`") && error.contains("slow") && error.contains("fast"), "{error}");
    }

    #[test]
    fn a_file_alone_has_the_hash_of_its_bytes() {
        let text = format!("({VIEW})");
        let loaded = load(&[("scenarios/main.ron", &text)], None).unwrap();
        assert_eq!(loaded.hash, blake3::hash(text.as_bytes()).to_hex().to_string());
    }

    #[test]
    fn circles_depths_and_ways_out_are_refused() {
        let including = |path: &str| format!(r#"(include: ["{path}"], {VIEW})"#);
        let refused = |files: &[(&str, &str)], named: &[&str]| {
            let error = load(files, None).unwrap_err();
            assert!(named.iter().all(|name| error.contains(name)), "{named:?}: {error}");
        };
        let main = "scenarios/main.ron";
        refused(&[(main, including(main).as_str())], &["`include[0]`", main]);
        let circle = [(main, including("a.ron")), ("a.ron", including("b.ron")), ("b.ron", including(main))];
        refused(
            &circle.each_ref().map(|(name, text)| (*name, text.as_str())),
            &["b.ron", "`include[0]`", main],
        );
        refused(&[(main, including("../a.ron").as_str())], &["`include[0]`", "outside"]);
        refused(&[(main, including("/etc/hostname").as_str())], &["`include[0]`", "outside"]);
        refused(&[(main, including("none.ron").as_str())], &["`include[0]`", "no such file"]);
        let names: Vec<String> =
            (0..=Scenario::MAX_INCLUDE_DEPTH).map(|depth| format!("{depth}.ron")).collect();
        let mut chain = vec![(main.to_owned(), including("0.ron"))];
        for (depth, name) in names.iter().enumerate() {
            let next = names.get(depth + 1).map_or_else(|| "()".to_owned(), |next| including(next));
            chain.push((name.clone(), next));
        }
        let all: Vec<_> = chain.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
        refused(&all, &["MAX_INCLUDE_DEPTH"]);
    }

    #[test]
    fn what_is_missing_or_wrong_is_named_where_it_is() {
        let error = load(&[("scenarios/main.ron", "(seconds: 1.0)")], None).unwrap_err();
        assert!(error.contains("main.ron") && error.contains("`camera`"), "{error}");
        let main = format!(r#"(include: ["parts/a.ron"], {VIEW})"#);
        let part = r#"(surfaces: [(name: "a", mesh: Sphere(radius: 1.0, sectors: 8, stacks: 8), material: "gold")])"#;
        let error = load(&[("scenarios/main.ron", &main), ("parts/a.ron", part)], None).unwrap_err();
        assert!(error.contains("a.ron: ") && error.contains("`surfaces[0].material`"), "{error}");
        let main = format!(r#"({VIEW}, variants: {{"x": (include: ["parts/a.ron"])}})"#);
        let error = load(&[("scenarios/main.ron", &main)], None).unwrap_err();
        assert!(error.contains("`variants.x.include`"), "{error}");
    }
}
