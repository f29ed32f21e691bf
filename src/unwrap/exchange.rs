//! Giving surfaces the meshes that have their unique uvs, and taking them back.

use bevy::prelude::*;

use super::jobs::{Key, Outcome};
use super::{NotUnwrapped, UnwrapError, UnwrappedFrom, Unwrapping, Unwraps, Wanting};
use crate::collision::{AwaitsUvs, ColliderReport, NotWeatherable, SurfaceCollider, UvSet};
use crate::overlay::{OverlayUv, Weatherable};

type Surface = (
    Entity,
    &'static Weatherable,
    &'static Mesh3d,
    Option<&'static UnwrappedFrom>,
    Option<&'static NotUnwrapped>,
    Option<&'static UvSet>,
    Has<AwaitsUvs>,
    Option<&'static Name>,
);

/// What a surface is to have.
struct Wanted {
    /// The mesh to show, if another than now.
    mesh: Option<Handle<Mesh>>,
    /// What that was made from.
    from: Option<Handle<Mesh>>,
    uvs: UvSet,
    refused: Option<UnwrapError>,
}

/// Gives surfaces the uvs that they asked for, with the meshes that have them, and tells what is wrong with the others.
pub(super) fn exchange_meshes(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut unwraps: ResMut<Unwraps>,
    wanting: Query<(), Wanting>,
    surfaces: Query<Surface>,
) {
    if !std::mem::take(&mut unwraps.news) && wanting.is_empty() {
        return;
    }
    for (entity, surface, shown, from, refused, uvs, waits, name) in &surfaces {
        let label = || name.map_or_else(|| entity.to_string(), ToString::to_string);
        let mut entity = commands.entity(entity);
        // What it showed before, if it shows a copy now.
        let before = from.filter(|_| unwraps.is_unwrapped(shown.id())).map(|from| from.0.clone());
        let asked = surface.wanted_uv();
        let key = unwraps.key(shown.id(), surface.unwrap_options(), &meshes);
        let outcome = match (asked, unwraps.jobs.get(&key)) {
            (OverlayUv::Mesh, _) => Some(Outcome::Given(UvSet::First)),
            (_, Some(job)) => job.outcome.clone(),
            (_, None) => continue,
        };
        let Some(outcome) = outcome else {
            if !waits {
                // It may have been hit in another shape, and with other uvs.
                entity
                    .remove::<(SurfaceCollider, ColliderReport, NotWeatherable, NotUnwrapped)>()
                    .insert(AwaitsUvs);
            }
            continue;
        };
        let wanted = wanted(outcome, asked, shown, before, key, &mut meshes);
        if let Some(error) = &wanted.refused
            && refused.is_none_or(|refused| refused.0 != *error)
        {
            if asked == OverlayUv::Unique {
                error!("{} keeps the texture coordinates of its mesh: {error}", label());
            } else {
                warn!("{}: what falls on one place shows at others, too: {error}", label());
            }
        }
        if wanted.mesh.is_some() && wanted.from.is_some() && wanted.replaces(&meshes) {
            warn!("{}: its mesh's `UV_1` is replaced; what else reads it goes wrong", label());
        }
        if let Some(mesh) = wanted.mesh {
            entity.insert(Mesh3d(mesh));
        }
        match wanted.from {
            Some(source) if from.is_none_or(|from| from.0 != source) => {
                entity.insert(UnwrappedFrom(source));
            }
            None if from.is_some() => {
                entity.remove::<UnwrappedFrom>();
            }
            _ => {}
        }
        if uvs.copied().unwrap_or_default() != wanted.uvs {
            entity.insert(wanted.uvs);
        }
        match wanted.refused {
            Some(error) if refused.is_none_or(|refused| refused.0 != error) => {
                entity.insert(NotUnwrapped(error));
            }
            None if refused.is_some() => {
                entity.remove::<NotUnwrapped>();
            }
            _ => {}
        }
        if waits {
            entity.remove::<AwaitsUvs>();
        }
    }
    // From here on surfaces keep the copies, or nobody wants them.
    unwraps.jobs.values_mut().for_each(|job| job.fresh = None);
}

impl Wanted {
    /// The mesh as it is, which is its own before a copy.
    fn own(before: Option<Handle<Mesh>>, uvs: UvSet, refused: Option<UnwrapError>) -> Self {
        Self { mesh: before, from: None, uvs, refused }
    }

    fn replaces(&self, meshes: &Assets<Mesh>) -> bool {
        let has_second = |mesh: &Mesh| matches!(mesh.try_contains_attribute(Mesh::ATTRIBUTE_UV_1), Ok(true));
        self.from.as_ref().and_then(|from| meshes.get(from)).is_some_and(has_second)
    }
}

/// What a surface is to have by what was found out about its mesh. `before`: its own mesh, if it shows a copy now.
fn wanted(
    outcome: Outcome,
    asked: OverlayUv,
    shown: &Mesh3d,
    before: Option<Handle<Mesh>>,
    key: Key,
    meshes: &mut Assets<Mesh>,
) -> Wanted {
    match outcome {
        Outcome::Given(set) => Wanted::own(before, set, None),
        Outcome::Cut(copy) => {
            let from = match before {
                Some(before) if before.id() == key.mesh => Some(before),
                _ if key.mesh == shown.id() => Some(shown.0.clone()),
                // Somebody gave it a copy that another surface shows.
                _ => meshes.get_strong_handle(key.mesh),
            };
            let mesh = if copy == shown.id() { None } else { meshes.get_strong_handle(copy) };
            Wanted { mesh, from, uvs: UvSet::Second, refused: None }
        }
        Outcome::Refused(error) => {
            let told = asked == OverlayUv::Auto && error.spoils_collider();
            Wanted::own(before, UvSet::First, (!told).then_some(error))
        }
    }
}

/// A surface that is not [`Weatherable`] any more shows its own mesh again.
pub(super) fn release_surface(
    removed: On<Remove, Weatherable>,
    mut commands: Commands,
    unwraps: Res<Unwraps>,
    surfaces: Query<(&Mesh3d, &UnwrappedFrom)>,
) {
    let mut entity = commands.entity(removed.entity);
    if let Ok((shown, from)) = surfaces.get(removed.entity)
        && unwraps.is_unwrapped(shown.id())
    {
        entity.try_insert(Mesh3d(from.0.clone()));
    }
    entity.try_remove::<Unwrapping>();
}
