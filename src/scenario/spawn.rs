//! Building the scene, and waiting until all of it is there.

use std::path::PathBuf;

use bevy::asset::LoadState;
use bevy::camera::Exposure;
use bevy::core_pipeline::prepass::DepthPrepass;
use bevy::gltf::GltfAssetLabel;
use bevy::light::{CascadeShadowConfigBuilder, EnvironmentMapLight, Skybox};
use bevy::prelude::*;
use bevy::render::RenderApp;

use super::content::{Content, Looks};
use super::follow::{follow_effect, follow_effect_files};
use super::motion::{ScenarioCamera, move_camera};
use super::scene_spawn::{AwaitedScene, fill_scenes, spawn_scenes};
use super::timeline::{MaterialHandles, apply_events_plugin, camera_keys, emitter_motion, insert_events};
use super::{Digest, LoadedScenario, MeshSpec, Scenario, ScenarioError};
use crate::clock::ClockPlugin;
use crate::collision::{ColliderSystems, MeshColliders, NotWeatherable, SurfaceCollider};
use crate::effect::{EffectSystems, EffectTable, WeatherEffect};
use crate::emitter::{EmissionSeed, Emitter};
use crate::material::{PlayedWetMap, Playing};
use crate::overlay::{FramesWork, OverlayUv, StampSystems, TexelArea, Unmapped, Weatherable};
use crate::particle::{Forces, ParticleConfig};
use crate::save::{AddedEmitter, RemovedEmitter};
use crate::unwrap::{NotUnwrapped, UnwrapSystems};
use crate::wetting::{self, ExposureProgress, MeasureProgress, MeasureSystems};

/// Spawns a scenario and runs it once everything is loaded. Virtual time stands still until then.
///
/// Sets the tick rate, so add it after [`WeatheringPlugins`](crate::WeatheringPlugins).
pub struct ScenarioPlugin {
    content: std::sync::Mutex<Option<Content>>,
    scenario: LoadedScenario,
    looks: Looks,
    /// In place of the scenario's own.
    pub seed: Option<u64>,
}

impl ScenarioPlugin {
    /// Loads what the scenario names. `looks` is false for runs without a renderer.
    ///
    /// # Errors
    /// [`ScenarioError::Content`] for files that cannot be used.
    pub fn new(scenario: LoadedScenario, looks: bool) -> Result<Self, ScenarioError> {
        Self::with_looks(scenario, Looks::drawn(looks))
    }

    /// For runs without a renderer that are [exported](crate::export::Snapshot): surfaces have their dry materials. Nothing else
    /// differs, and there is nothing to draw.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_materials(scenario: LoadedScenario) -> Result<Self, ScenarioError> {
        Self::with_looks(scenario, Looks::Materials)
    }

    fn with_looks(scenario: LoadedScenario, looks: Looks) -> Result<Self, ScenarioError> {
        let content = std::sync::Mutex::new(Some(scenario.content(looks)?));
        Ok(Self { content, scenario, looks, seed: None })
    }
}

/// The running scenario.
#[derive(Resource, Debug, Clone)]
pub(super) struct CurrentScenario(pub(super) LoadedScenario);

/// What a scenario has spawned: it goes when another takes its place.
#[derive(Component, Debug, Default, Clone, Copy)]
pub struct SceneEntity;

/// The effect that an emitter of the scenario has by its file, whatever it sends out now.
#[derive(Component, Debug, Clone)]
pub(crate) struct OwnEffect {
    /// With what somebody has edited of it.
    pub(crate) handle: Handle<WeatherEffect>,
    /// As it was read.
    pub(crate) read: WeatherEffect,
}

/// The folder that the app's asset server reads from, where it may be another than the scenario's tree: then files of the
/// scenario are loaded by absolute paths, which the asset server must allow. If it is the same, and the asset server watches it,
/// effects follow their files.
#[derive(Resource, Debug, Clone)]
pub struct AssetTree(pub PathBuf);

/// How far the scenario is.
#[derive(Resource, Debug, Default)]
pub enum ScenarioStatus {
    /// Meshes are being loaded, unwrapped where they need it, and their BVHs built.
    #[default]
    Loading,
    /// Time runs.
    Ready,
    /// Something that the scenario names cannot be used.
    Failed(ScenarioError),
}

/// A surface of the scenario.
#[derive(Component, Debug, Clone)]
pub struct ScenarioSurface {
    /// Its number in the scenario.
    pub index: u32,
    /// Its name there.
    pub name: String,
}

impl Plugin for ScenarioPlugin {
    fn build(&self, app: &mut App) {
        set_up(app.world_mut(), &self.scenario, self.seed);
        app.init_resource::<Digest>()
            .register_type::<AddedEmitter>()
            .register_type::<RemovedEmitter>()
            .add_systems(
                PreUpdate,
                watch_loading
                    .run_if(is_loading)
                    .after(ColliderSystems)
                    .after(MeasureSystems)
                    .after(StampSystems),
            )
            .add_systems(PreUpdate, follow_effect_files.before(EffectSystems))
            // What they show is built in the same frame.
            .add_systems(
                PreUpdate,
                fill_scenes.run_if(is_loading).before(UnwrapSystems).before(ColliderSystems),
            )
            .add_systems(Update, move_camera);
        apply_events_plugin(app);

        let content = self.content.lock().ok().and_then(|mut content| content.take());
        let Some(content) = content else { return };
        let mut looks = Looks::drawn(app.get_sub_app(RenderApp).is_some());
        if looks == Looks::None && self.looks == Looks::Materials {
            looks = Looks::Materials;
            // Only what draws would have brought it.
            if !app.world().contains_resource::<Assets<StandardMaterial>>() {
                app.init_asset::<StandardMaterial>();
            }
        }
        spawn_scene(app.world_mut(), &self.scenario, content, looks);
    }
}

/// Clock, weather and limits of a scenario that begins. Virtual time stands still until all of it is there.
pub(super) fn set_up(world: &mut World, loaded: &LoadedScenario, seed: Option<u64>) {
    let scenario = &loaded.scenario;
    ClockPlugin { hz: scenario.tick_hz }.insert_clock(world);
    world.insert_resource(EmissionSeed(seed.unwrap_or(scenario.seed)));
    world.insert_resource(Forces { gravity: scenario.gravity });
    world.insert_resource(scenario.weather());
    world.insert_resource(ParticleConfig { max_alive: scenario.max_particles });
    world.insert_resource(CurrentScenario(loaded.clone()));
    world.insert_resource(scenario.map_budget().unwrap_or_default());
    insert_events(world, scenario);
    world.insert_resource(ScenarioStatus::Loading);
    world.resource_mut::<Time<Virtual>>().pause();
}

/// What the asset server calls a file of the scenario.
pub(super) fn asset_path(world: &World, loaded: &LoadedScenario, path: &str) -> String {
    match world.get_resource::<AssetTree>() {
        Some(AssetTree(tree)) if *tree != loaded.tree => {
            loaded.tree.join(path).to_string_lossy().into_owned()
        }
        _ => path.to_owned(),
    }
}

pub(super) fn spawn_scene(world: &mut World, loaded: &LoadedScenario, content: Content, looks: Looks) {
    let scenario = &loaded.scenario;
    for (index, effect) in content.effects.into_iter().enumerate() {
        if let Some(emitter) = spawn_emitter(world, scenario, index, effect) {
            follow_effect(world, loaded, index, emitter);
        }
    }
    let mut materials = Vec::new();
    if looks != Looks::None {
        for ((name, spec), maps) in scenario.materials.iter().zip(content.materials) {
            let (material, textures) = maps.into_material(spec, &mut world.resource_mut::<Assets<Image>>());
            let handle = world.resource_mut::<Assets<StandardMaterial>>().add(material);
            materials.push((name, handle, textures));
        }
    }
    let mut wet_maps = content.wet_maps.into_iter();
    for (index, (spec, mesh)) in scenario.surfaces.iter().zip(content.meshes).enumerate() {
        let wet_map = wet_maps.next().flatten().map(|map| world.resource_mut::<Assets<Image>>().add(map));
        let mesh = match (&spec.mesh, mesh) {
            (MeshSpec::File(path), _) => {
                let label = GltfAssetLabel::Primitive { mesh: 0, primitive: 0 };
                let path = asset_path(world, loaded, path);
                world.resource::<AssetServer>().load(label.from_asset(path))
            }
            (_, Some(mesh)) => world.resource_mut::<Assets<Mesh>>().add(mesh),
            (_, None) => continue,
        };
        let transform = spec.transform();
        let surface = ScenarioSurface { index: index as u32, name: spec.name.clone() };
        let mut entity = world.spawn((
            SceneEntity,
            Name::new(spec.name.clone()),
            surface,
            spec.maps,
            Mesh3d(mesh),
            transform,
            GlobalTransform::from(transform),
        ));
        if let (Some(map), Some(played)) = (wet_map, &spec.wet_map) {
            entity.insert(PlayedWetMap {
                map,
                seconds: played.seconds,
                t_fill: played.t_fill,
                from_tick: (played.start * scenario.tick_hz as f32).round() as u32,
                playing: if played.dries { Playing::Drying } else { Playing::Wetting },
            });
        }
        if let Some(material) = scenario.materials.get(&spec.material) {
            entity.insert((material.porous, material.water));
        }
        if let Some((_, material, textures)) = materials.iter().find(|(name, ..)| **name == spec.material) {
            entity.insert((MeshMaterial3d(material.clone()), textures.clone()));
        }
    }
    spawn_scenes(world, loaded, looks);
    let handles = materials.into_iter().map(|(_, material, textures)| (material, textures));
    world.insert_resource(MaterialHandles(handles.collect()));
    if looks == Looks::All {
        spawn_view(world, loaded, content.environment);
    }
}

/// An emitter of the scenario, by its number; off until its hours or events say otherwise.
pub(crate) fn spawn_emitter(
    world: &mut World,
    scenario: &Scenario,
    index: usize,
    effect: WeatherEffect,
) -> Option<Entity> {
    let spec = scenario.emitters.get(index)?;
    let handle = world.resource_mut::<Assets<WeatherEffect>>().add(effect.clone());
    world.resource_mut::<EffectTable>().insert(handle.clone(), effect.clone());
    let emitter = Emitter {
        effect: handle.clone(),
        rate: spec.rate,
        shape: spec.shape,
        flow: spec.flow,
        speed: spec.initial_speed(),
        spread: spec.spread_deg.to_radians(),
        lifetime: spec.lifetime,
        stream: index as u32,
        enabled: false,
    };
    let named = (SceneEntity, Name::new(spec.name.clone()), OwnEffect { handle, read: effect });
    Some(world.spawn((named, emitter, emitter_motion(scenario, spec))).id())
}

fn spawn_view(
    world: &mut World,
    loaded: &LoadedScenario,
    maps: Option<crate::scenes::environment::EnvironmentMaps>,
) {
    let scenario = &loaded.scenario;
    let [red, green, blue] = scenario.sun.color;
    world.spawn((
        SceneEntity,
        Name::new("sun"),
        DirectionalLight {
            illuminance: scenario.sun.illuminance,
            color: Color::linear_rgb(red, green, blue),
            shadow_maps_enabled: scenario.sun.shadows,
            ..default()
        },
        CascadeShadowConfigBuilder { maximum_distance: 40.0, first_cascade_far_bound: 6.0, ..default() }
            .build(),
        Transform::default().looking_to(scenario.sun.direction, Vec3::Y),
    ));
    let mut camera = world.spawn((
        SceneEntity,
        Name::new("camera"),
        Camera3d::default(),
        Msaa::Sample4,
        // Particles fade into what is close behind them.
        DepthPrepass,
        Exposure { ev100: scenario.camera.ev100 },
        Projection::from(PerspectiveProjection { fov: scenario.camera.fov_deg.to_radians(), ..default() }),
        ScenarioCamera { keys: camera_keys(scenario) },
    ));
    let (Some(maps), Some(spec)) = (maps, &scenario.environment) else { return };
    let rotation = Quat::from_rotation_y(spec.turn_deg.to_radians());
    let camera_id = camera.id();
    camera.insert(Transform::default());
    let mut images = world.resource_mut::<Assets<Image>>();
    let light = EnvironmentMapLight {
        diffuse_map: images.add(maps.diffuse),
        specular_map: images.add(maps.specular),
        intensity: spec.intensity,
        rotation,
        ..default()
    };
    let skybox = Skybox { image: Some(images.add(maps.skybox)), brightness: spec.intensity, rotation };
    let mut camera = world.entity_mut(camera_id);
    camera.insert(light);
    if spec.skybox {
        camera.insert(skybox);
    }
}

fn is_loading(status: Res<ScenarioStatus>) -> bool {
    matches!(*status, ScenarioStatus::Loading)
}

/// Lets time run when every surface can be hit, with the uvs that it asks for, or says which cannot.
fn watch_loading(
    current: Res<CurrentScenario>,
    assets: Res<AssetServer>,
    colliders: Res<MeshColliders>,
    surfaces: Query<(
        &ScenarioSurface,
        &Weatherable,
        &Mesh3d,
        Option<&NotWeatherable>,
        Option<&NotUnwrapped>,
    )>,
    unfinished: Query<
        (),
        (
            With<ScenarioSurface>,
            // Refused for want of room, which the log tells.
            Without<Unmapped>,
            Or<(Without<SurfaceCollider>, Without<TexelArea>, Without<wetting::Exposure>)>,
        ),
    >,
    awaited: Query<&AwaitedScene>,
    (exposure, measuring, frames): (Res<ExposureProgress>, Res<MeasureProgress>, Res<FramesWork>),
    mut status: ResMut<ScenarioStatus>,
    mut time: ResMut<Time<Virtual>>,
) {
    let scenario = &current.0.scenario;
    if let Some(error) = awaited.iter().find_map(|scene| scene.state(&current.0, &assets).err()) {
        *status = ScenarioStatus::Failed(error);
        return;
    }
    for (surface, maps, mesh, refused, not_unwrapped) in &surfaces {
        let scene = scenario.scene_of(surface.index);
        let shape = match scenario.surfaces.get(surface.index as usize).map(|spec| &spec.mesh) {
            Some(MeshSpec::File(path)) => path.as_str(),
            _ => surface.name.as_str(),
        };
        let (field, value, reason) = match (refused, assets.get_load_state(&mesh.0), not_unwrapped) {
            (Some(NotWeatherable(error)), ..) => ("mesh", shape, error.to_string()),
            (None, Some(LoadState::Failed(error)), _) => ("mesh", shape, error.to_string()),
            (None, _, Some(NotUnwrapped(error))) if maps.uv == OverlayUv::Unique => {
                ("maps.uv", "Unique", format!("{shape}: {error}"))
            }
            _ => continue,
        };
        let field = match (scene, field) {
            (Some(scene), "mesh") => format!("scenes[{scene}].file"),
            (Some(scene), field) => format!("scenes[{scene}].{field}"),
            (None, field) => format!("surfaces[{}].{field}", surface.index),
        };
        *status = ScenarioStatus::Failed(current.0.content_error(&field, value, reason));
        return;
    }
    let is_busy = colliders.building() > 0 || measuring.is_busy() || exposure.is_busy() || frames.is_busy();
    if unfinished.is_empty() && !is_busy {
        *status = ScenarioStatus::Ready;
        time.unpause();
    }
}
