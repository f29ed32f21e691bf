//! Texture coordinates of their own for surfaces whose mesh has none that are unique.
//!
//! Maps lie over the uvs of a mesh. Where those tile, or halves of a mesh share them, a drop on one place shows at
//! another; where faces are points of a palette, at none. [`shares_texels`] finds such meshes, [`unwrapped`] gives them a
//! second set, [`Mesh::ATTRIBUTE_UV_1`], and leaves the first for textures.
//!
//! Each mesh of a surface that wants it ([`OverlayUv`]) is looked at in the background
//! ([`unique_uvs`]). What has unique uvs keeps its mesh; what has none shows a copy of it that has, made once for each mesh and
//! [`UnwrapOptions`] and shared by all surfaces that show it. [`UvSet`] tells which uvs colliders, and so maps and water, and
//! the shader take. Until that is known a surface has no collider ([`AwaitsUvs`]). [`UnwrappedFrom`] remembers what it
//! showed, and what it shows again when it asks no more. A mesh that changes is looked at again, and its copy changes in place.
//!
//! # Tangents
//! The normal map of the material goes on lying in the frame of the mesh: `UV_0` and its tangents. What falls on the surface
//! lies in the frame of the map, which on a surface with second uvs is another: slopes along *its* u and v. No tangents are
//! stored for that; the shader finds the directions of u and v from how position and uv change over the screen, and tilts the
//! normal that the material has by then (`shaders/weathered.wgsl`).
//!
//! Not here: a choice where seams go. Islands thinner than a 512th of the map are not seen to lie on each other.

mod charts;
mod choice;
mod error;
mod exchange;
mod jobs;
#[cfg(test)]
mod mesh_checks;
mod overlap;
#[cfg(test)]
mod surface_checks;

use bevy::prelude::*;

pub use charts::{UnwrapOptions, unwrapped};
pub use choice::{MapTrianglesError, UniqueUvs, map_triangles, unique_uvs};
pub use error::UnwrapError;
pub use jobs::Unwraps;
pub use overlap::{UvOverlap, measure_overlap, shares_texels};

use crate::collision::{AwaitsUvs, ColliderSystems, UvSet};
use crate::overlay::{OverlayUv, Weatherable};

/// The mesh that this surface showed before it got an unwrapped copy.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct UnwrappedFrom(pub Handle<Mesh>);

/// Why a surface that asked for unique texture coordinates keeps those of its mesh. Reported once.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct NotUnwrapped(pub UnwrapError);

/// What this module knows of a surface.
type Unwrapping = (UnwrappedFrom, NotUnwrapped, AwaitsUvs, UvSet);

/// Surfaces that are new, have changed what they ask for, or show another mesh.
type Wanting = (With<Weatherable>, Or<(Changed<Weatherable>, Changed<Mesh3d>)>);

/// In `PreUpdate`, before colliders: meshes are looked at and unwrapped, and surfaces get their copies.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct UnwrapSystems;

/// Gives surfaces texture coordinates of their own. Without it all have those of their meshes.
pub struct UnwrapPlugin;

impl Plugin for UnwrapPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Unwraps>()
            .register_type::<OverlayUv>()
            .add_observer(exchange::release_surface)
            .add_systems(
                PreUpdate,
                (jobs::watch_meshes, jobs::run_unwraps, exchange::exchange_meshes)
                    .chain()
                    .in_set(UnwrapSystems)
                    // A surface is hit in the mesh that it shows from now on.
                    .before(ColliderSystems),
            );
    }
}
