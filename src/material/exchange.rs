//! Exchanging a `StandardMaterial` for its weathered form, and keeping the two in step.

use bevy::core_pipeline::prepass::DeferredPrepass;
use bevy::material::OpaqueRendererMethod;
use bevy::prelude::*;

use super::uniform::SurfaceLook;
use super::warm_up::{ShaderChanges, Understudy, rehearse};
use super::{
    ClockBuffer, PlayedWetMap, PorousExtension, PorousMaterial, StandingWater, WeatheredMaterial,
    WettingTextures,
};
use crate::clock::WeatheringClock;
use crate::collision::UvSet;
use crate::matter::MatterLook;
use crate::overlay::{MapSize, Overlays, SurfaceTraces, TexelArea, Weatherable};

/// The material a weathered entity had. Its asset may go on being edited: the weathered form follows.
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(Component)]
pub struct DryMaterial(pub Handle<StandardMaterial>);

type Surface = (
    &'static Overlays,
    &'static SurfaceTraces,
    Option<&'static PorousMaterial>,
    Option<&'static StandingWater>,
    Option<&'static WettingTextures>,
    Option<&'static PlayedWetMap>,
    Option<&'static UvSet>,
);

/// What changes the constants of a surface.
type Edited = Or<(
    Changed<PorousMaterial>,
    Changed<StandingWater>,
    Changed<WettingTextures>,
    Changed<PlayedWetMap>,
    Changed<Overlays>,
    Changed<SurfaceTraces>,
    Changed<UvSet>,
)>;

/// Before its texels are measured nothing can hit a surface, so there is nothing to show on it.
type Hittable = (With<Weatherable>, With<TexelArea>);

fn extension(
    (maps, traces, porous, standing, textures, played, uvs): (
        &Overlays,
        &SurfaceTraces,
        Option<&PorousMaterial>,
        Option<&StandingWater>,
        Option<&WettingTextures>,
        Option<&PlayedWetMap>,
        Option<&UvSet>,
    ),
    buffer: &ClockBuffer,
    clock: &WeatheringClock,
    matter: &MatterLook,
) -> PorousExtension {
    let none = WettingTextures::default();
    let look = SurfaceLook {
        porous: porous.copied().unwrap_or_default(),
        standing: standing.copied(),
        textures: textures.unwrap_or(&none),
        maps,
        played,
        hz: clock.hz(),
        traces: *traces,
        uvs: uvs.copied().unwrap_or_default(),
    };
    let played = played.map(|played| played.map.clone());
    PorousExtension::new(look.key(), look.uniform(), maps, look.textures, played, buffer.0.clone(), matter)
}

/// The dry material as the weathered one needs it.
fn weathered_base(dry: &StandardMaterial, extension: &PorousExtension) -> StandardMaterial {
    let mut base = dry.clone();
    // Deferred lighting knows no pores. Forward surfaces are drawn beside deferred ones.
    base.opaque_render_method = OpaqueRendererMethod::Forward;
    if extension.params.wet_translucency > 0.0 {
        // Above 0 compiles the lighting of the far side in; how much of it is seen is the wetness's to say.
        base.diffuse_transmission = base.diffuse_transmission.max(f32::MIN_POSITIVE);
    }
    base
}

/// Exchanges the material of surfaces that have their maps; also of entities that a glTF scene spawns later.
pub(super) fn exchange_materials(
    mut commands: Commands,
    buffer: Res<ClockBuffer>,
    clock: Res<WeatheringClock>,
    matter: Res<MatterLook>,
    deferred_cameras: Query<(), With<DeferredPrepass>>,
    standard: Res<Assets<StandardMaterial>>,
    mut weathered: ResMut<Assets<WeatheredMaterial>>,
    new: Query<(Entity, Surface, &MeshMaterial3d<StandardMaterial>), Hittable>,
) {
    for (entity, surface, material) in &new {
        let Some(dry) = standard.get(material) else { continue };
        if dry.opaque_render_method != OpaqueRendererMethod::Forward && !deferred_cameras.is_empty() {
            info_once!("weathered surfaces are drawn forward, before cameras with a deferred prepass, too");
        }
        let extension = extension(surface, &buffer, &clock, &matter);
        let handle = weathered.add(WeatheredMaterial { base: weathered_base(dry, &extension), extension });
        commands
            .entity(entity)
            .remove::<MeshMaterial3d<StandardMaterial>>()
            .insert((MeshMaterial3d(handle), DryMaterial(material.0.clone())));
    }
}

/// Gives a surface that has no maps any more, or is not [`Weatherable`] any more, its dry material back: the weathered one
/// would keep its maps.
pub(super) fn release_surface(
    removed: On<Remove, MapSize>,
    mut commands: Commands,
    dry: Query<&DryMaterial>,
) {
    let Ok(material) = dry.get(removed.entity) else { return };
    commands
        .entity(removed.entity)
        .try_remove::<(MeshMaterial3d<WeatheredMaterial>, DryMaterial)>()
        .try_insert(MeshMaterial3d(material.0.clone()));
}

/// Copies edits of a dry material into the weathered ones made from it.
pub(super) fn follow_dry_materials(
    mut events: MessageReader<AssetEvent<StandardMaterial>>,
    standard: Res<Assets<StandardMaterial>>,
    mut weathered: ResMut<Assets<WeatheredMaterial>>,
    surfaces: Query<(&DryMaterial, &MeshMaterial3d<WeatheredMaterial>)>,
) {
    for event in events.read() {
        let AssetEvent::Modified { id } = event else { continue };
        let Some(dry) = standard.get(*id) else { continue };
        for (_, material) in surfaces.iter().filter(|(material, _)| material.0.id() == *id) {
            if let Some(mut material) = weathered.get_mut(material) {
                material.base = weathered_base(dry, &material.extension);
            }
        }
    }
}

/// Copies what users edit, new maps, and the first water into the weathered material.
pub(super) fn follow_surfaces(
    mut commands: Commands,
    buffer: Res<ClockBuffer>,
    clock: Res<WeatheringClock>,
    matter: Res<MatterLook>,
    changes: Res<ShaderChanges>,
    standard: Res<Assets<StandardMaterial>>,
    mut weathered: ResMut<Assets<WeatheredMaterial>>,
    changed: Query<(Entity, Surface, &DryMaterial, &MeshMaterial3d<WeatheredMaterial>), Edited>,
    understudies: Query<(Entity, &ChildOf), With<Understudy>>,
) {
    for (entity, surface, dry, handle) in &changed {
        let Some(mut material) = weathered.get_mut(handle) else { continue };
        let extension = extension(surface, &buffer, &clock, &matter);
        if let Some(dry) = standard.get(&dry.0) {
            material.base = weathered_base(dry, &extension);
        }
        let old = material.extension.key;
        let next = WeatheredMaterial { base: material.base.clone(), extension: extension.clone() };
        material.extension = extension;
        if next.extension.key != old && *changes == ShaderChanges::WhenCompiled {
            material.extension.key = old;
            drop(material);
            let next = weathered.add(next);
            rehearse(&mut commands, entity, next, &understudies);
        }
    }
}
