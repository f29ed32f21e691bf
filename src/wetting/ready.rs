//! Telling when surfaces are ready, and which never will be.

use bevy::prelude::*;

use super::WetGeometry;
use crate::collision::{NotWeatherable, TriangleError};
use crate::overlay::Unmapped;

/// A [`Weatherable`](crate::overlay::Weatherable) entity is ready: it is hit, has maps, and keeps what falls on it from the next
/// tick on. That is some frames after its mesh is loaded; what falls before is lost to it. Comes again when it has got other maps.
#[derive(Message, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
pub struct SurfaceReady {
    /// The surface.
    pub surface: Entity,
}

/// A [`Weatherable`](crate::overlay::Weatherable) entity does not get wet. Also an error in the log.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct SurfaceRefused {
    /// The surface.
    pub surface: Entity,
    /// Why.
    pub reason: Refusal,
}

/// Why a surface does not get wet.
#[derive(thiserror::Error, Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Refusal {
    /// It has no mesh, or nothing of it can be hit; as in [`NotWeatherable`]. Until it shows another one.
    #[error("its mesh cannot be weathered: {0}")]
    Mesh(TriangleError),
    /// The [`MapBudget`](crate::overlay::MapBudget) has no room for its maps; as in [`Unmapped::Refused`]. Until there is.
    #[error("there is no room for its maps in the `MapBudget`")]
    NoRoom,
}

/// What it takes to be wet comes last: its texels are measured by its collider and its maps.
pub(super) fn tell_ready(added: On<Add, WetGeometry>, mut ready: MessageWriter<SurfaceReady>) {
    ready.write(SurfaceReady { surface: added.entity });
}

pub(super) fn tell_refused_mesh(
    inserted: On<Insert, NotWeatherable>,
    reasons: Query<&NotWeatherable>,
    mut refused: MessageWriter<SurfaceRefused>,
) {
    let surface = inserted.entity;
    if let Ok(&NotWeatherable(error)) = reasons.get(surface) {
        refused.write(SurfaceRefused { surface, reason: Refusal::Mesh(error) });
    }
}

/// Who is evicted is told of by [`SurfaceEvicted`](crate::overlay::SurfaceEvicted).
pub(super) fn tell_refused_maps(
    inserted: On<Insert, Unmapped>,
    reasons: Query<&Unmapped>,
    mut refused: MessageWriter<SurfaceRefused>,
) {
    let surface = inserted.entity;
    if reasons.get(surface) == Ok(&Unmapped::Refused) {
        refused.write(SurfaceRefused { surface, reason: Refusal::NoRoom });
    }
}
