//! Particles against meshes: swept segments, closest hits, exact uv.
//!
//! Each mesh asset gets one BVH ([`MeshBvh`]) for each set of uvs that is asked for ([`UvSet`]), built off the main thread and
//! shared by all entities that show the mesh. The [`CollisionScene`] holds those entities with their transforms under a BVH of their own. A particle
//! casts the segment it moved in this tick: through the upper BVH in world space, then in the space of each mesh
//! on the way, where the distance is a fraction of the same segment, so that any invertible transform will do.
//! The closest hit, seen from either side, becomes an [`Impact`] with the uv of the point.
//!
//! The loop is parallel over particles. Threads write to their own buffers; one sort by [`Sequence`] merges them,
//! so the order of [`Impacts`] does not depend on the number of threads.
//!
//! Skinned and morphed surfaces have a BVH each, which follows their pose (`deform`).
//!
//! [`Sequence`]: crate::particle::Sequence

mod bvh;
mod colliders;
mod deform;
mod scene;
mod trace;
mod triangles;
mod uvs;

use bevy::prelude::*;

use crate::effect::EffectIndex;
use crate::particle::Sequence;
use crate::schedule::{RetireSystems, WeatheringSystems, WeatheringTick};

pub(crate) use bvh::BoxOverlaps;
pub use bvh::{LocalHit, MeshBvh};
pub use colliders::{ColliderReport, MeshColliders, NotWeatherable, SurfaceCollider};
pub use deform::{Deformer, DeformingCollider, PosedMesh, Shape};
pub use scene::{CollisionScene, SceneHit};
use trace::trace_particles;
pub use trace::{ReportImpacts, SurfaceImpact};
pub use triangles::{MeshTriangles, TriangleError, TriangleReport};
pub use uvs::{AwaitsUvs, UvSet};

/// A particle that hit a surface in this tick.
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
pub struct Impact {
    /// Number of the particle.
    pub sequence: Sequence,
    /// The entity that was hit.
    pub surface: Entity,
    /// Triangle of the surface's mesh, in the mesh's order.
    pub triangle: u32,
    /// World space, metres.
    pub point: Vec3,
    /// Unit normal of the triangle on the side that was hit; world space.
    pub normal: Vec3,
    /// Texture coordinates of the point, as the mesh has them in the surface's [`UvSet`] (any tile).
    pub uv: Vec2,
    /// Change of u and v for one metre on the surface along their own directions. 0 where uv does not vary.
    pub uv_per_metre: Vec2,
    /// Unit directions on the surface in which u and v grow; world space, 0 where they do not.
    pub along: [Vec3; 2],
    /// It was hit from behind.
    pub back: bool,
    /// Velocity at the impact, m/s.
    pub velocity: Vec3,
    /// What hit.
    pub effect: EffectIndex,
    /// Size class of its drops.
    pub class: u8,
    /// Water carried, nanolitres.
    pub volume_nl: u32,
}

/// The impacts of this tick, in the order of [`Impact::sequence`].
#[derive(Resource, Debug, Default)]
pub struct Impacts(pub Vec<Impact>);

/// In `PreUpdate`: meshes become colliders.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ColliderSystems;

/// Builds colliders and traces particles.
pub struct CollisionPlugin;

impl Plugin for CollisionPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<MeshColliders>()
            .init_resource::<CollisionScene>()
            .init_resource::<Impacts>()
            .add_message::<SurfaceImpact>()
            .register_type::<ReportImpacts>()
            .register_type::<UvSet>()
            .add_observer(colliders::release_surface)
            .add_systems(
                PreUpdate,
                (
                    colliders::watch_meshes,
                    colliders::build_colliders,
                    colliders::attach_colliders,
                    colliders::refuse_bare,
                    deform::attach_deforming,
                )
                    .chain()
                    .in_set(ColliderSystems),
            )
            .add_systems(
                WeatheringTick,
                (
                    deform::pose_surfaces,
                    scene::update_collision_scene,
                    trace_particles,
                    trace::report_impacts,
                )
                    .chain()
                    .in_set(WeatheringSystems::Trace)
                    // The dead leave their columns when nobody needs them any more.
                    .before(RetireSystems),
            );
    }
}
