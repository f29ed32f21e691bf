//! A glTF by itself, as a scenario of one scene: every mesh of it gets wet, under a sun, with nothing around it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bevy::math::Vec3;

use super::{
    CameraKey, CameraSpec, LoadedScenario, Scenario, ScenarioError, SceneSpec, SunSpec, WeatherSpec,
};
use crate::scenes::gltf_mesh::plain_name;

impl LoadedScenario {
    /// A scenario with nothing in it but a model and light, seen from where all of the model is seen. Its tree is the folder of the
    /// model, its hash that of the model and of what this names. Nothing is written.
    ///
    /// # Errors
    /// [`ScenarioError`] of the field `scenes[0]`, as for a scenario that names the model.
    pub fn of_model(file: &Path) -> Result<Self, ScenarioError> {
        let place = file.canonicalize().unwrap_or_else(|_| file.to_owned());
        let tree = place.parent().map_or_else(PathBuf::new, Path::to_owned);
        let text = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
        let (name, path) = (text(file.file_stem()), text(place.file_name()));
        let name = plain_name(&name).unwrap_or_else(|| "model".into());
        let mut loaded = Self::made(alone(SceneSpec::new(name, path)), file.into(), tree);
        loaded.read_scenes()?;
        loaded.scenario.camera.keys = vec![view(&loaded.scenario.scenes)];
        loaded.validate()?;
        loaded.hash = loaded.inputs_hash()?;
        Ok(loaded)
    }
}

fn alone(scene: SceneSpec) -> Scenario {
    Scenario {
        seed: 0,
        tick_hz: 60,
        seconds: Scenario::MAX_SECONDS,
        gravity: Vec3::new(0.0, -9.81, 0.0),
        wind: Vec3::ZERO,
        weather: WeatherSpec::default(),
        map_budget: None,
        max_particles: 1_000_000,
        camera: CameraSpec { fov_deg: 40.0, ev100: 12.0, keys: Vec::new() },
        sun: SunSpec::default(),
        environment: None,
        materials: BTreeMap::new(),
        surfaces: Vec::new(),
        scenes: vec![scene],
        emitters: Vec::new(),
        events: Vec::new(),
        flaws: Vec::new(),
    }
}

/// From where all of some scenes is seen.
fn view(scenes: &[SceneSpec]) -> CameraKey {
    let parts = scenes.iter().flat_map(|scene| scene.parts().map(move |(part, _)| (scene, part)));
    let corners = parts.flat_map(|(scene, part)| {
        let placed = scene.transform().compute_affine();
        scene.layout.box_of(part).map(|corner| placed.transform_point3(corner))
    });
    let (low, high) = corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), corner| {
        (low.min(corner), high.max(corner))
    });
    // Also of what is as large as numbers can be.
    let target = (low + high) * 0.5;
    let target =
        if target.is_finite() { target.clamp(Vec3::splat(-1.0e4), Vec3::splat(1.0e4)) } else { Vec3::ZERO };
    let size = (high - low).length();
    let size = if size.is_finite() { size.clamp(0.05, 1000.0) } else { 1000.0 };
    let eye = target + Vec3::new(0.6, 0.45, 1.0).normalize() * (1.6 * size);
    CameraKey { t: 0.0, eye, target }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_is_seen_whole_and_is_what_its_file_is() {
        let folder = tempfile::tempdir().unwrap();
        let bunny = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/bunny_1000.glb");
        let file = folder.path().join("a bunny.glb");
        std::fs::copy(&bunny, &file).unwrap();
        let loaded = LoadedScenario::of_model(&file).unwrap();
        let key = loaded.scenario.camera.keys[0];
        assert!((key.eye - key.target).length() > 0.05 && key.target.is_finite());
        assert_eq!(loaded.tree, folder.path().canonicalize().unwrap());
        assert!(loaded.scenario.surface_names().all(|name| name.starts_with("a_bunny.")));
        assert!(loaded.check_content().unwrap() > 900);
        // What was saved from one does not fit another.
        let hash = LoadedScenario::of_model(&file).unwrap().hash;
        assert_eq!((loaded.hash.len(), &loaded.hash), (64, &hash));
        let other = folder.path().join("another.glb");
        std::fs::copy(&bunny, &other).unwrap();
        assert_ne!(LoadedScenario::of_model(&other).unwrap().hash, hash);
    }

    #[test]
    fn models_that_are_missing_or_reach_out_of_their_folder_are_named() {
        let missing = LoadedScenario::of_model(Path::new("no/such.glb")).unwrap_err().to_string();
        assert!(missing.contains("such.glb"), "{missing}");
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("model.gltf");
        let model = r#"{ "asset": {"version": "2.0"}, "images": [{"uri": "../secret.png"}] }"#;
        std::fs::write(&file, model).unwrap();
        let outside = LoadedScenario::of_model(&file).unwrap_err().to_string();
        assert!(outside.contains("secret.png") && outside.contains("scenes[0].file"), "{outside}");
    }
}
