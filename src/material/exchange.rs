//! Exchanging a `StandardMaterial` for its weathered form, and keeping the two in step.

use bevy::prelude::*;

use super::{ClockBuffer, PorousExtension, PorousMaterial, PorousUniform, WeatheredMaterial};
use crate::overlay::{Overlays, TexelAreas, Weatherable};

/// The material a weathered entity had. Its asset may go on being edited: the weathered form follows.
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(Component)]
pub struct DryMaterial(pub Handle<StandardMaterial>);

type Surface =
    (&'static Weatherable, &'static Overlays, &'static TexelAreas, Option<&'static PorousMaterial>);

/// Exchanges the material of surfaces that have their maps; also of entities that a glTF scene spawns later.
pub(super) fn exchange_materials(
    mut commands: Commands,
    clock: Res<ClockBuffer>,
    standard: Res<Assets<StandardMaterial>>,
    mut weathered: ResMut<Assets<WeatheredMaterial>>,
    new: Query<(Entity, Surface, &MeshMaterial3d<StandardMaterial>)>,
) {
    for (entity, (surface, maps, areas, porous), material) in &new {
        let Some(base) = standard.get(material) else { continue };
        let params = PorousUniform::new(&porous.copied().unwrap_or_default(), surface, areas.mean_mm2);
        let extension = PorousExtension::new(params, maps, clock.0.clone());
        let handle = weathered.add(WeatheredMaterial { base: base.clone(), extension });
        commands
            .entity(entity)
            .remove::<MeshMaterial3d<StandardMaterial>>()
            .insert((MeshMaterial3d(handle), DryMaterial(material.0.clone())));
    }
}

/// Gives a surface that is not [`Weatherable`] any more its dry material back.
pub(super) fn release_surface(
    removed: On<Remove, Weatherable>,
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
        let Some(base) = standard.get(*id) else { continue };
        for (_, material) in surfaces.iter().filter(|(dry, _)| dry.0.id() == *id) {
            if let Some(mut material) = weathered.get_mut(material) {
                material.base = base.clone();
            }
        }
    }
}

/// Copies edits of [`PorousMaterial`], and new maps, into the weathered material.
pub(super) fn follow_porous_materials(
    mut weathered: ResMut<Assets<WeatheredMaterial>>,
    changed: Query<
        (Surface, &MeshMaterial3d<WeatheredMaterial>),
        Or<(Changed<PorousMaterial>, Changed<Overlays>, Changed<TexelAreas>)>,
    >,
) {
    for ((surface, maps, areas, porous), material) in &changed {
        let params = PorousUniform::new(&porous.copied().unwrap_or_default(), surface, areas.mean_mm2);
        if let Some(mut material) = weathered.get_mut(material) {
            let clock = material.extension.clock.clone();
            material.extension = PorousExtension::new(params, maps, clock);
        }
    }
}
