//! A glTF by itself: every mesh of it gets wet, under a sun, with nothing around it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bevy::gltf::GltfAssetLabel;
use bevy::prelude::*;
use bevy_weathering::overlay::Weatherable;
use bevy_weathering::scenario::{
    AssetTree, CameraKey, CameraSpec, LoadedScenario, Scenario, SceneEntity, SunSpec, WeatherSpec,
};
use bevy_weathering::scenes::gltf_mesh::read_meshes;

use super::shades::Cover;

/// Texels of a map per metre of the mesh's size, before they are rounded.
const TEXELS_PER_METRE: f32 = 256.0;

/// The root of a model whose meshes are to get wet.
#[derive(Component)]
pub struct Model;

pub fn plugin(app: &mut App) {
    app.add_systems(PreUpdate, weather_meshes);
}

/// Whether a file is a model, by its name.
pub fn is_model(file: &Path) -> bool {
    let extension = file.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    ["glb", "gltf"].iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// A scenario with nothing in it but light, seen from where all of the model is seen. Reads the model's meshes, so that what
/// is wrong with it is known before anything is shown, and keeps the files that it names within its folder.
///
/// # Errors
/// What is wrong, with the file.
pub fn bare_scenario(file: &Path) -> Result<LoadedScenario, String> {
    let meshes = read_meshes(file).map_err(|error| error.to_string())?;
    let corners = meshes.iter().flat_map(|mesh| {
        let corners = mesh.triangles.positions.iter().flatten();
        corners.map(move |&corner| mesh.transform.transform_point3(corner))
    });
    let (low, high) = corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), corner| {
        (low.min(corner), high.max(corner))
    });
    let (target, size) = ((low + high) * 0.5, (high - low).length().clamp(0.05, 1000.0));
    let target = if target.is_finite() { target } else { Vec3::ZERO };
    let eye = target + Vec3::new(0.6, 0.45, 1.0).normalize() * (1.6 * size);
    let place = file.canonicalize().unwrap_or_else(|_| file.to_owned());
    let tree = place.parent().map_or_else(PathBuf::new, Path::to_owned);
    let scenario = Scenario {
        seed: 0,
        tick_hz: 60,
        seconds: Scenario::MAX_SECONDS,
        gravity: Vec3::new(0.0, -9.81, 0.0),
        wind: Vec3::ZERO,
        weather: WeatherSpec::default(),
        map_budget: None,
        max_particles: 1_000_000,
        camera: CameraSpec { fov_deg: 40.0, ev100: 12.0, keys: vec![CameraKey { t: 0.0, eye, target }] },
        sun: SunSpec::default(),
        environment: None,
        materials: BTreeMap::new(),
        surfaces: Vec::new(),
        emitters: Vec::new(),
        events: Vec::new(),
        flaws: Vec::new(),
    };
    let loaded = LoadedScenario::made(scenario, file.into(), tree);
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    loaded.validate_gltf("model", &name).map_err(|error| error.to_string())?;
    Ok(loaded)
}

/// Light in the shade: of a model by itself, which has nothing around it, or of a scene.
pub fn light_shade(world: &mut World, is_model: bool) {
    let scene = GlobalAmbientLight::default();
    let brightness = if is_model { 1500.0 } else { scene.brightness };
    world.insert_resource(GlobalAmbientLight { brightness, ..scene });
}

/// Spawns the model of a bare scenario.
pub fn spawn(world: &mut World, loaded: &LoadedScenario) {
    let Some(name) = loaded.file.file_name() else { return };
    let absolute = loaded.tree.join(name);
    let path = match world.get_resource::<AssetTree>() {
        Some(AssetTree(tree)) if *tree == loaded.tree => PathBuf::from(name),
        _ => absolute,
    };
    let scene = world.resource::<AssetServer>().load(GltfAssetLabel::Scene(0).from_asset(path));
    world.spawn((SceneEntity, Model, Name::new("model"), WorldAssetRoot(scene), Transform::default()));
}

/// Meshes of models get wet, as soon as they are there; those without texture coordinates are given some.
fn weather_meshes(
    mut commands: Commands,
    meshes: Res<Assets<Mesh>>,
    models: Query<(), With<Model>>,
    parents: Query<&ChildOf>,
    shown: Query<
        (Entity, &Mesh3d),
        (With<MeshMaterial3d<StandardMaterial>>, Without<Weatherable>, Without<Cover>),
    >,
    transforms: Query<&GlobalTransform>,
) {
    if models.is_empty() {
        return;
    }
    for (entity, handle) in &shown {
        if !models.contains(parents.root_ancestor(entity)) {
            continue;
        }
        let Some(mesh) = meshes.get(&handle.0) else { continue };
        let scale = transforms.get(entity).map_or(1.0, |transform| transform.scale().abs().max_element());
        commands.entity(entity).insert(Weatherable { map_size: map_size(mesh, scale), ..default() });
    }
}

/// Texels along each side of a mesh's maps, by how large it is.
fn map_size(mesh: &Mesh, scale: f32) -> u32 {
    let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(|positions| positions.as_float3());
    let (low, high) = positions
        .unwrap_or_default()
        .iter()
        .map(|&corner| Vec3::from_array(corner))
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), corner| {
            (low.min(corner), high.max(corner))
        });
    texels((high - low).length() * scale)
}

/// A power of two from 128 to 1024, by the size of the mesh, metres.
fn texels(metres: f32) -> u32 {
    // The conversion takes NaN for 0.
    ((metres * TEXELS_PER_METRE).clamp(0.0, 1024.0) as u32).next_power_of_two().clamp(128, 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_are_as_large_as_the_mesh_asks_for() {
        assert_eq!(
            [0.0, 0.6, 1.5, 100.0, f32::NAN, f32::NEG_INFINITY].map(texels),
            [128, 256, 512, 1024, 128, 128]
        );
    }

    #[test]
    fn models_are_known_by_their_names() {
        let is = |name: &str| is_model(Path::new(name));
        assert!(is("a/b.glb") && is("B.GLTF") && !is("c.ron") && !is("glb"));
    }

    #[test]
    fn every_mesh_of_a_model_gets_wet_and_no_other() {
        let mut app = App::new();
        app.init_resource::<Assets<Mesh>>();
        plugin(&mut app);
        let world = app.world_mut();
        let mut shown = |mesh: Mesh| {
            let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
            world.spawn((Mesh3d(mesh), MeshMaterial3d(Handle::<StandardMaterial>::default()))).id()
        };
        let cube = || Mesh::from(Cuboid::new(0.4, 0.4, 0.4));
        let with_uvs = shown(cube());
        let without = shown(cube().with_removed_attribute(Mesh::ATTRIBUTE_UV_0));
        let elsewhere = shown(cube());
        let model = world.spawn(Model).id();
        let node = world.spawn(ChildOf(model)).id();
        for mesh in [with_uvs, without] {
            world.entity_mut(mesh).insert(ChildOf(node));
        }
        app.update();
        let is_wet = |mesh: Entity| app.world().get::<Weatherable>(mesh).is_some();
        assert_eq!([with_uvs, without, elsewhere].map(is_wet), [true, true, false]);
    }

    #[test]
    fn a_model_is_seen_whole_and_a_missing_one_is_named() {
        let bunny = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/bunny.glb");
        let loaded = bare_scenario(&bunny).unwrap();
        let key = loaded.scenario.camera.keys[0];
        assert!((key.eye - key.target).length() > 0.05 && key.target.is_finite());
        assert!(loaded.tree.ends_with("models"));
        let missing = bare_scenario(Path::new("no/such.glb")).unwrap_err();
        assert!(missing.contains("such.glb"), "{missing}");
        // A picture from elsewhere.
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("model.gltf");
        let positions = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        std::fs::write(folder.path().join("corners.bin"), positions.map(f32::to_le_bytes).as_flattened())
            .unwrap();
        let model = r#"{
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                "min": [0, 0, 0], "max": [1, 1, 0]}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "buffers": [{"uri": "corners.bin", "byteLength": 36}],
            "images": [{"uri": "PLACE"}]
        }"#;
        std::fs::write(&file, model.replace("PLACE", "../secret.png")).unwrap();
        let outside = bare_scenario(&file).unwrap_err();
        assert!(outside.contains("secret.png"), "{outside}");
    }
}
