//! glTF scenes in the world: nodes at once, what they show once the file is loaded.
//!
//! Entities, their order and their places are what was read with the scenario. So nothing that an asset server does decides about
//! them, and a surface has its mesh, its maps and its material at the same moment: when the file is there with all that it
//! names. The scene that Bevy makes of the file is not spawned; its meshes and materials are taken by their labels.

use std::collections::BTreeMap;
use std::path::PathBuf;

use bevy::asset::{AssetPath, DependencyLoadState, LoadState, RecursiveDependencyLoadState};
use bevy::camera::visibility::NoFrustumCulling;
use bevy::gltf::{Gltf, GltfAssetLabel, GltfMaterial};
use bevy::mesh::morph::MeshMorphWeights;
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::prelude::*;
use bevy::render::render_resource::Face;

use super::content::Looks;
use super::spawn::{CurrentScenario, asset_path};
use super::{LoadedScenario, ScenarioError, ScenarioStatus, ScenarioSurface, SceneEntity};
use crate::material::{PorousMaterial, StandingWater};
use crate::overlay::Weatherable;
use crate::scenes::gltf_mesh::ScenePart;

/// The material that the file of a scene has for a surface.
#[derive(Component, Debug, Clone)]
pub(super) struct FileLook(pub(super) Handle<StandardMaterial>);

/// A scene whose file is being loaded, on its root.
#[derive(Component, Debug)]
pub(super) struct AwaitedScene {
    /// Its number in the scenario.
    scene: usize,
    gltf: Handle<Gltf>,
    /// What the asset server calls the file.
    path: PathBuf,
    /// In the order of the layout.
    nodes: Vec<Entity>,
    /// In the order of its parts.
    surfaces: Vec<Entity>,
    looks: Looks,
}

impl AwaitedScene {
    /// How far its file is: `Ok(true)` when all of it is there.
    pub(super) fn state(&self, loaded: &LoadedScenario, assets: &AssetServer) -> Result<bool, ScenarioError> {
        let spec = &loaded.scenario.scenes[self.scene];
        let failed = |error: &dyn std::fmt::Display| {
            Err(loaded.content_error(&format!("scenes[{}].file", self.scene), &spec.file, error))
        };
        match assets.get_load_states(&self.gltf) {
            Some((LoadState::Failed(error), ..)) => failed(&error),
            Some((_, DependencyLoadState::Failed(error), _)) => failed(&error),
            Some((.., RecursiveDependencyLoadState::Failed(error))) => failed(&error),
            Some((LoadState::Loaded, DependencyLoadState::Loaded, RecursiveDependencyLoadState::Loaded)) => {
                Ok(true)
            }
            _ => Ok(false),
        }
    }
}

/// Spawns the nodes of all scenes, and begins to load their files.
pub(super) fn spawn_scenes(world: &mut World, loaded: &LoadedScenario, looks: Looks) {
    let mut index = loaded.scenario.surfaces.len() as u32;
    for (scene, spec) in loaded.scenario.scenes.iter().enumerate() {
        if !world.contains_resource::<Assets<Gltf>>() {
            let (field, reason) = (format!("scenes[{scene}].file"), "this app has no GltfPlugin");
            let error = loaded.content_error(&field, &spec.file, reason);
            world.insert_resource(ScenarioStatus::Failed(error));
            return;
        }
        // Not parsed: a `#` in its name is part of its name.
        let path = PathBuf::from(asset_path(world, loaded, &spec.file));
        let gltf = world.resource::<AssetServer>().load::<Gltf>(path.clone());
        let transform = spec.transform();
        let place = (transform, GlobalTransform::from(transform), Visibility::default());
        let root = world.spawn((SceneEntity, Name::new(spec.name.clone()), place)).id();
        let mut nodes: Vec<Entity> = Vec::new();
        // As Bevy will propagate them.
        let mut places: Vec<GlobalTransform> = Vec::new();
        for node in &spec.layout.nodes {
            let (above, from) = match node.parent {
                Some(parent) => (nodes[parent], places[parent]),
                None => (root, GlobalTransform::from(transform)),
            };
            let place = from.mul_transform(node.transform);
            nodes.push(world.spawn((node.transform, place, Visibility::default(), ChildOf(above))).id());
            places.push(place);
        }
        let mut surfaces = Vec::new();
        for part in &spec.layout.parts {
            let surface = ScenarioSurface { index, name: part.name.clone() };
            let name = Name::new(part.name.clone());
            let place = places[part.node].mul_transform(Transform::IDENTITY);
            let place = (Transform::IDENTITY, place, ChildOf(nodes[part.node]));
            // Not with its maps: whoever looks at it meanwhile sees what it is made of already.
            let porous: PorousMaterial = spec.porous.unwrap_or_default();
            let made_of = (porous, StandingWater::default());
            surfaces.push(world.spawn((SceneEntity, name, surface, made_of, place)).id());
            index += 1;
        }
        world.entity_mut(root).insert(AwaitedScene { scene, gltf, path, nodes, surfaces, looks });
    }
}

/// Gives the surfaces of scenes what they show, once it is there for all of them: which file comes first must not decide which
/// surface does.
pub(super) fn fill_scenes(
    mut commands: Commands,
    current: Res<CurrentScenario>,
    assets: Res<AssetServer>,
    awaited: Query<(Entity, &AwaitedScene)>,
) {
    // What fails is told by whoever waits for all of it.
    let is_there =
        |(_, scene): (Entity, &AwaitedScene)| scene.state(&current.0, &assets).is_ok_and(|all| all);
    if awaited.is_empty() || !awaited.iter().all(is_there) {
        return;
    }
    let mut roots: Vec<_> = awaited.iter().map(|(root, scene)| (scene.scene, root)).collect();
    roots.sort_unstable();
    for (_, root) in roots {
        commands.queue(move |world: &mut World| fill(world, root));
    }
}

fn fill(world: &mut World, root: Entity) {
    // Another scenario may have taken its place.
    let awaited = world.get_entity_mut(root).ok().and_then(|mut root| root.take::<AwaitedScene>());
    let Some(awaited) = awaited else { return };
    let current = world.resource::<CurrentScenario>().0.clone();
    let spec = &current.scenario.scenes[awaited.scene];
    let mut looks = FileLooks { awaited: &awaited, made: BTreeMap::new() };
    for (&surface, (part, maps)) in awaited.surfaces.iter().zip(spec.parts()) {
        let label = GltfAssetLabel::Primitive { mesh: part.mesh, primitive: part.primitive };
        let Some(mesh) = handle::<Mesh>(world, label.from_asset(awaited.path.clone())) else {
            // It was there when the scenario was read, but files may change.
            let field = format!("scenes[{}].file", awaited.scene);
            let error = current.content_error(&field, &spec.file, format!("it has no {label} any more"));
            world.insert_resource(ScenarioStatus::Failed(error));
            return;
        };
        let look = looks.of(world, part);
        let pose = pose(world, &awaited, part);
        let Ok(mut entity) = world.get_entity_mut(surface) else { continue };
        if let Some(pose) = pose {
            // Where it is seen is its joints' to say.
            entity.insert((pose, NoFrustumCulling));
        }
        if !part.weights.is_empty() {
            entity.insert(MeshMorphWeights::Value { weights: part.weights.clone() });
        }
        if let Some(look) = look {
            entity.insert((MeshMaterial3d(look.clone()), FileLook(look)));
        }
        let maps: Weatherable = maps;
        entity.insert((Mesh3d(mesh), maps));
    }
}

/// A part of a file that is loaded.
fn handle<A: Asset>(world: &World, path: AssetPath<'static>) -> Option<Handle<A>> {
    world.resource::<AssetServer>().get_handle(path)
}

fn pose(world: &World, awaited: &AwaitedScene, part: &ScenePart) -> Option<SkinnedMesh> {
    let skin = part.skin.as_ref()?;
    let label = GltfAssetLabel::InverseBindMatrices(skin.index);
    let inverse_bindposes =
        handle::<SkinnedMeshInverseBindposes>(world, label.from_asset(awaited.path.clone()))?;
    let joints = skin.joints.iter().filter_map(|&joint| awaited.nodes.get(joint).copied()).collect();
    Some(SkinnedMesh { inverse_bindposes, joints })
}

/// The materials of a file, as its surfaces show them.
struct FileLooks<'a> {
    awaited: &'a AwaitedScene,
    /// By number, and whether it is turned inside out.
    made: BTreeMap<(Option<usize>, bool), Handle<StandardMaterial>>,
}

impl FileLooks<'_> {
    fn of(&mut self, world: &mut World, part: &ScenePart) -> Option<Handle<StandardMaterial>> {
        if self.awaited.looks == Looks::None {
            return None;
        }
        let key = (part.material, part.is_mirrored);
        if let Some(look) = self.made.get(&key) {
            return Some(look.clone());
        }
        let look = self.find(world, key)?;
        self.made.insert(key, look.clone());
        Some(look)
    }

    fn find(
        &self,
        world: &mut World,
        (number, is_mirrored): (Option<usize>, bool),
    ) -> Option<Handle<StandardMaterial>> {
        let label = |is_scale_inverted| match number {
            Some(index) => GltfAssetLabel::Material { index, is_scale_inverted },
            None => GltfAssetLabel::DefaultMaterial,
        };
        // Where there is a renderer, Bevy has made it already.
        let path = AssetPath::from(self.awaited.path.clone());
        let made = handle(world, path.clone().with_label(format!("{}/std", label(is_mirrored))));
        if made.is_some() {
            return made;
        }
        // What the format takes where a file says nothing.
        let unsaid = GltfMaterial { metallic: 1.0, perceptual_roughness: 1.0, ..default() };
        let described = number.and_then(|_| handle::<GltfMaterial>(world, label(false).from_asset(path)));
        let described =
            described.and_then(|of| world.get_resource::<Assets<GltfMaterial>>()?.get(&of).cloned());
        let mut material = standard(&described.unwrap_or(unsaid));
        if is_mirrored && material.cull_mode.is_some() && number.is_some() {
            material.cull_mode = Some(Face::Front);
        }
        Some(world.get_resource_mut::<Assets<StandardMaterial>>()?.add(material))
    }
}

/// What a file says of a material, for apps in which Bevy's renderer does not do that: what is exported of it.
fn standard(of: &GltfMaterial) -> StandardMaterial {
    StandardMaterial {
        base_color: of.base_color,
        base_color_channel: of.base_color_channel.clone(),
        base_color_texture: of.base_color_texture.clone(),
        emissive: of.emissive,
        emissive_channel: of.emissive_channel.clone(),
        emissive_texture: of.emissive_texture.clone(),
        perceptual_roughness: of.perceptual_roughness,
        metallic: of.metallic,
        metallic_roughness_channel: of.metallic_roughness_channel.clone(),
        metallic_roughness_texture: of.metallic_roughness_texture.clone(),
        reflectance: of.reflectance,
        specular_tint: of.specular_tint,
        specular_transmission: of.specular_transmission,
        thickness: of.thickness,
        ior: of.ior,
        attenuation_distance: of.attenuation_distance,
        attenuation_color: of.attenuation_color,
        normal_map_channel: of.normal_map_channel.clone(),
        normal_map_texture: of.normal_map_texture.clone(),
        occlusion_channel: of.occlusion_channel.clone(),
        occlusion_texture: of.occlusion_texture.clone(),
        clearcoat: of.clearcoat,
        clearcoat_perceptual_roughness: of.clearcoat_perceptual_roughness,
        anisotropy_strength: of.anisotropy_strength,
        anisotropy_rotation: of.anisotropy_rotation,
        double_sided: of.double_sided,
        cull_mode: of.cull_mode,
        unlit: of.unlit,
        alpha_mode: of.alpha_mode,
        uv_transform: of.uv_transform,
        ..default()
    }
}
