//! Changing what is compiled into a surface's shader without losing sight of the surface.
//!
//! Bevy does not draw what it has no pipeline for, and makes pipelines in the background. So a surface keeps the shader it
//! has, and an understudy, a child that shows the same mesh with the next one, makes Bevy compile it. When no pipeline is
//! waited for any more, the surface takes over the new shader and the understudy leaves. It casts a shadow where the surface
//! does, since that has a pipeline of its own for each shader. Of what is blended it shows nothing: twice would be seen.
//!
//! So it is with the first shader of a surface, too, which is the dry one's stand-in until then ([`Rehearsed`]).
//!
//! Where pipelines are compiled at once there is nothing to wait for, and no understudy.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use bevy::camera::visibility::{NoFrustumCulling, RenderLayers};
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::mesh::morph::MeshMorphWeights;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::prelude::*;
use bevy::render::render_resource::PipelineCache;
use bevy::render::{Render, RenderApp, RenderPlugin, RenderSystems};

use super::{PorousKey, WeatheredMaterial};
use crate::overlay::Weatherable;

/// A child of a [`Weatherable`] surface that is there for a moment, to have its next shader compiled.
#[derive(Component, Reflect, Debug)]
#[reflect(Component)]
pub struct Understudy {
    /// Frames since it came.
    frames: u32,
}

impl Understudy {
    /// Frames until it has been drawn for sure, also when drawing lags behind.
    const REHEARSAL: u32 = 4;
    /// Frames after which it takes over in any case.
    const PATIENCE: u32 = 1200;
}

/// The first shader of a surface has been compiled, this one: it is not lost from sight when it is exchanged.
#[derive(Component)]
pub(super) struct Rehearsed(pub(super) PorousKey);

/// How many pipelines are being made; the same number in the main and in the render world.
#[derive(Resource, Clone, Default)]
struct Waiting(Arc<AtomicUsize>);

/// Whether shaders are changed with an understudy.
#[derive(Resource, Clone, Copy, PartialEq, Eq)]
pub(super) enum ShaderChanges {
    /// At once: pipelines are compiled when they are asked for.
    AtOnce,
    /// When the next one is compiled.
    WhenCompiled,
}

pub(super) fn plugin(app: &mut App) {
    let at_once = app
        .get_added_plugins::<RenderPlugin>()
        .first()
        .is_some_and(|plugin| plugin.synchronous_pipeline_compilation);
    app.register_type::<Understudy>();
    if at_once {
        app.insert_resource(ShaderChanges::AtOnce);
        return;
    }
    let waiting = Waiting::default();
    app.insert_resource(ShaderChanges::WhenCompiled)
        .insert_resource(waiting.clone())
        .add_systems(Last, take_over);
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app.insert_resource(waiting).add_systems(Render, count_waiting.in_set(RenderSystems::Cleanup));
}

fn count_waiting(cache: Res<PipelineCache>, waiting: Res<Waiting>) {
    waiting.0.store(cache.waiting_pipelines().count(), Ordering::Relaxed);
}

/// Lets an understudy show what a surface will show next.
pub(super) fn rehearse(commands: &mut Commands, surface: Entity, next: Handle<WeatheredMaterial>) {
    commands
        .entity(surface)
        .clone_and_spawn_with_opt_in(|cloner| {
            // What the choice of a pipeline, and being seen at all, depends on.
            cloner.allow::<(Mesh3d, SkinnedMesh, MeshMorphWeights, RenderLayers)>();
            cloner.allow::<(NoFrustumCulling, NotShadowCaster, NotShadowReceiver)>();
        })
        .insert((
            Understudy { frames: 0 },
            Name::new("understudy"),
            MeshMaterial3d(next),
            Transform::IDENTITY,
            ChildOf(surface),
        ));
}

/// What an understudy shows: the next shader's pipeline, but nothing to see where it would be blended over the surface.
pub(super) fn part_of(mut next: WeatheredMaterial) -> WeatheredMaterial {
    let is_blended =
        !matches!(next.base.alpha_mode, AlphaMode::Opaque | AlphaMode::Mask(_) | AlphaMode::AlphaToCoverage);
    if is_blended {
        next.base.base_color = Color::NONE;
        next.base.emissive = LinearRgba::BLACK;
    }
    next
}

/// Gives surfaces their next shader once it is compiled.
fn take_over(
    mut commands: Commands,
    waiting: Res<Waiting>,
    mut materials: ResMut<Assets<WeatheredMaterial>>,
    mut understudies: Query<(Entity, &mut Understudy, &ChildOf, &MeshMaterial3d<WeatheredMaterial>)>,
    surfaces: Query<&MeshMaterial3d<WeatheredMaterial>, (With<Weatherable>, Without<Understudy>)>,
) {
    for (entity, mut understudy, surface, next) in &mut understudies {
        understudy.frames += 1;
        let compiled = understudy.frames > Understudy::REHEARSAL && waiting.0.load(Ordering::Relaxed) == 0;
        if !compiled && understudy.frames < Understudy::PATIENCE {
            continue;
        }
        if let Some(key) = materials.get(next).map(|next| next.extension.key) {
            if let Ok(material) = surfaces.get(surface.parent()) {
                if let Some(mut material) = materials.get_mut(material) {
                    material.extension.key = key;
                }
            } else {
                commands.entity(surface.parent()).try_insert(Rehearsed(key));
            }
        }
        commands.entity(entity).despawn();
    }
}
