//! All files that a scenario is made of, to tell whether any of them has changed since.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::{LoadedScenario, MeshSpec, ScenarioError, SurfaceTextureSpec, TextureSpec};
use crate::effect::WeatherEffect;

impl LoadedScenario {
    /// Every file that the scenario names, and every file that those name in turn, each once and in order; without its own.
    ///
    /// # Errors
    /// [`ScenarioError`] for a file that is gone or cannot be used.
    pub fn named_files(&self) -> Result<Vec<PathBuf>, ScenarioError> {
        let scenario = &self.scenario;
        let mut files = BTreeSet::new();
        for (index, emitter) in scenario.emitters.iter().enumerate() {
            let (field, name) = (format!("emitters[{index}].effect"), &emitter.effect);
            let path = self.resolve(&field, name)?;
            let bytes = std::fs::read(&path).map_err(|error| self.content_error(&field, name, error))?;
            let effect = WeatherEffect::from_ron(&bytes);
            let effect = effect.map_err(|error| self.content_error(&field, name, error))?;
            files.insert(path);
            for stamp in effect.stamps.files() {
                let beside = Path::new(name).with_file_name(stamp);
                files.insert(self.resolve(&field, &beside.to_string_lossy())?);
            }
        }
        for (index, surface) in scenario.surfaces.iter().enumerate() {
            let field = format!("surfaces[{index}]");
            if let MeshSpec::File(mesh) = &surface.mesh {
                files.extend(self.gltf_files(&format!("{field}.mesh"), mesh)?);
            }
            if let Some(map) = &surface.wet_map {
                files.insert(self.resolve(&format!("{field}.wet_map.map"), &map.map)?);
            }
        }
        for (index, scene) in scenario.scenes.iter().enumerate() {
            files.extend(self.gltf_files(&format!("scenes[{index}].file"), &scene.file)?);
        }
        for (name, material) in &scenario.materials {
            let field = format!("materials.{name}");
            if let TextureSpec::Photo(photo) = &material.texture {
                files.insert(self.resolve(&format!("{field}.texture"), photo)?);
            }
            if let SurfaceTextureSpec::File(surface) = &material.surface {
                files.insert(self.resolve(&format!("{field}.surface"), surface)?);
            }
            if let Some(wet) = &material.wet_color {
                files.insert(self.resolve(&format!("{field}.wet_color"), wet)?);
            }
        }
        if let Some(environment) = &scenario.environment {
            files.insert(self.resolve("environment.map", &environment.map)?);
        }
        Ok(files.into_iter().collect())
    }

    /// Hash of the scenario and of all files of [`Self::named_files`], by their names in the tree and their content; 64
    /// hexadecimal digits. Where the tree lies does not matter.
    ///
    /// # Errors
    /// [`ScenarioError`] for a file that is gone or cannot be used.
    pub fn inputs_hash(&self) -> Result<String, ScenarioError> {
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.hash.as_bytes());
        for path in self.named_files()? {
            let name = path.strip_prefix(&self.tree).unwrap_or(&path);
            let bytes = std::fs::read(&path)
                .map_err(|error| self.content_error("a file it names", &name.to_string_lossy(), error))?;
            // Of one length each, so that nothing can be taken for something else.
            for part in [name.as_os_str().as_encoded_bytes(), bytes.as_slice()] {
                hasher.update(blake3::hash(part).as_bytes());
            }
        }
        Ok(hasher.finalize().to_hex().to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    const SCENARIO: &str = r#"(
        seconds: 1.0,
        camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
        environment: (map: "sky.exr"),
        materials: {"clay": (texture: Photo("clay.png"), wet_color: "wet.png", surface: File("relief.png"))},
        surfaces: [(
            name: "mesh",
            mesh: File("mesh.gltf"),
            material: "clay",
            wet_map: (map: "map.png", seconds: 1.0),
        )],
        emitters: [(
            name: "rain",
            effect: "effects/rain.effect.ron",
            rate: 1.0,
            speed: 1.0,
            keys: [(position: (0.0, 1.0, 0.0), target: (0.0, 0.0, 0.0))],
        )],
    )"#;
    const FILES: [(&str, &str); 9] = [
        ("clay.png", "a"),
        ("effects/mark.png", "b"),
        ("effects/rain.effect.ron", r#"(stamps: Images(diffuse: "mark.png", variants: 1))"#),
        ("map.png", "d"),
        ("mesh.bin", "e"),
        ("mesh.gltf", r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "mesh.bin", "byteLength": 1}]}"#),
        ("relief.png", "g"),
        ("sky.exr", "h"),
        ("wet.png", "i"),
    ];

    fn write(folder: &Path) -> LoadedScenario {
        std::fs::create_dir_all(folder.join("effects")).unwrap();
        for (name, content) in FILES.into_iter().chain([("scene.ron", SCENARIO), ("other.png", "z")]) {
            std::fs::write(folder.join(name), content).unwrap();
        }
        Scenario::load(&folder.join("scene.ron")).unwrap()
    }

    #[test]
    fn all_files_are_found_also_those_that_files_name() {
        let folder = tempfile::tempdir().unwrap();
        let loaded = write(folder.path());
        let names: Vec<_> = loaded
            .named_files()
            .unwrap()
            .iter()
            .map(|path| path.strip_prefix(&loaded.tree).unwrap().to_str().unwrap().to_owned())
            .collect();
        assert_eq!(names, FILES.map(|(name, _)| name));
    }

    #[test]
    fn every_file_counts_and_where_they_lie_does_not() {
        let (folder, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let loaded = write(folder.path());
        let hash = loaded.inputs_hash().unwrap();
        assert_eq!(hash.len(), 64);
        assert_eq!(write(elsewhere.path()).inputs_hash().unwrap(), hash);
        for (name, content) in FILES {
            let path = folder.path().join(name);
            std::fs::write(&path, format!("{content} ")).unwrap();
            assert_ne!(loaded.inputs_hash().unwrap(), hash, "{name}");
            std::fs::write(&path, content).unwrap();
        }
        std::fs::write(folder.path().join("other.png"), "changed").unwrap();
        assert_eq!(loaded.inputs_hash().unwrap(), hash);
        std::fs::write(folder.path().join("scene.ron"), format!("{SCENARIO} ")).unwrap();
        let again = Scenario::load(&folder.path().join("scene.ron")).unwrap();
        assert_ne!(again.inputs_hash().unwrap(), hash);
        std::fs::remove_file(folder.path().join("mesh.bin")).unwrap();
        assert!(loaded.inputs_hash().unwrap_err().to_string().contains("mesh.bin"));
    }
}
