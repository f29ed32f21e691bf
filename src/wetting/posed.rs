//! Surfaces that are posed: water runs by the slopes of their pose.
//!
//! Heights, slopes and distances of texels are measured again, in the background, when an edge of a triangle leans by some
//! two degrees more or less than when they were measured last, and only while something lies on the surface that they can
//! move. What lay still in a hollow is looked at again. A surface that moves all the time is measured over and over, as fast as that
//! goes; until it is done, or until a fixed tick ([`MeasureTiming`]), water runs by the old slopes.
//!
//! Links do not change with the pose, and areas are left as they are at rest, so that an amount keeps its depth: a film that
//! is stretched gets no thinner. A pose with a vertex that is not a number, or a thousand kilometres away, is passed over.

use std::sync::Arc;

use bevy::math::{Affine3A, Vec3A};
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task};

use super::tiles::Tiles;
use super::{MeasureTiming, SurfaceWater, TexelGeometry, TexelLayout, WetGeometry};
use crate::clock::WeatheringClock;
use crate::collision::{DeformingCollider, PosedMesh, SurfaceCollider};
use crate::matter::SurfaceMatter;
use crate::overlay::Weatherable;

/// An edge leans another way if its sine has changed by this much.
const LEANS: f32 = 0.03;

/// No vertex of a pose that counts is farther from the origin, metres.
const FARTHEST: f32 = 1.0e6;

/// The pose by which the slopes of a surface were measured, or are.
#[derive(Component)]
pub(super) struct PosedSlopes {
    /// Of its vertices, metres above anything.
    heights: Vec<f32>,
    /// The surface at rest: it begins with the slopes of that.
    rest: Arc<TexelGeometry>,
    /// It may have been posed since it was last looked at.
    unseen: bool,
    task: Option<Task<TexelGeometry>>,
    /// The tick in which `task` was begun.
    asked_at: u32,
}

impl PosedSlopes {
    /// None are known but those at rest.
    fn at_rest(rest: Arc<TexelGeometry>) -> Self {
        Self { heights: Vec::new(), rest, unseen: true, task: None, asked_at: 0 }
    }

    /// Whether the pose leans so much differently from the last one measured that slopes are another matter. One that is
    /// nonsense does not.
    fn differs(&self, posed: &PosedMesh, world_from_shape: &Affine3A) -> bool {
        let positions = posed.positions();
        let is_sound = |at: &Vec3| at.is_finite() && at.abs().max_element() <= FARTHEST;
        if !world_from_shape.is_finite() || !positions.iter().all(is_sound) {
            return false;
        }
        if self.heights.len() != positions.len() {
            return true;
        }
        posed.vertices().iter().any(|&[a, b, c]| {
            [b, c].into_iter().any(|other| {
                let (from, to) = (a as usize, other as usize);
                let edge = world_from_shape.transform_vector3(positions[to] - positions[from]);
                let before = self.heights[to] - self.heights[from];
                (edge.y - before).abs() > LEANS * edge.length()
            })
        })
    }

    /// Begins to measure, at this tick.
    fn measure(&mut self, posed: &PosedMesh, world_from_shape: Affine3A, tick: u32) {
        let up = Vec3::from(world_from_shape.matrix3.transpose() * Vec3A::Y);
        self.heights.clear();
        self.heights.extend(posed.positions().iter().map(|position| up.dot(*position)));
        self.asked_at = tick;
        // A copy of the places alone: whoever holds the shape itself keeps it from changing in place.
        let (mesh, positions, rest) = (posed.mesh().clone(), posed.positions().to_vec(), self.rest.clone());
        self.task = Some(AsyncComputeTaskPool::get().spawn(async move {
            let place = |vertex: u32| world_from_shape.transform_point3(positions[vertex as usize]);
            let vertices = mesh.deformer().map_or(&[][..], |deformer| &deformer.corners()[..]);
            let corners: Vec<[Vec3; 3]> = vertices.iter().map(|corners| corners.map(place)).collect();
            let mirrored = world_from_shape.matrix3.determinant() < 0.0;
            rest.posed(&mesh.triangles().uvs, &corners, mirrored, Vec3::Y)
        }));
    }

    /// The slopes, once, when their time has come, if they are still wanted.
    fn finished(
        &mut self,
        layout: &Arc<TexelLayout>,
        timing: MeasureTiming,
        tick: u32,
    ) -> Option<TexelGeometry> {
        let geometry = timing.take(&mut self.task, self.asked_at, tick)?;
        Arc::ptr_eq(geometry.layout(), layout).then_some(geometry)
    }
}

type Posable = (
    Entity,
    Option<Ref<'static, DeformingCollider>>,
    Ref<'static, GlobalTransform>,
    &'static mut WetGeometry,
    &'static mut SurfaceWater,
    Option<&'static mut SurfaceMatter>,
    Option<&'static mut PosedSlopes>,
);

/// Measures the slopes of surfaces that have taken another pose.
pub(super) fn measure_posed_slopes(
    mut commands: Commands,
    clock: Res<WeatheringClock>,
    timing: Res<MeasureTiming>,
    mut surfaces: Query<
        Posable,
        (With<Weatherable>, With<SurfaceCollider>, Or<(With<DeformingCollider>, With<PosedSlopes>)>),
    >,
) {
    for (entity, deforming, transform, mut geometry, mut water, mut matter, slopes) in &mut surfaces {
        let Some(deforming) = deforming else {
            // Rigid again.
            commands.entity(entity).remove::<(PosedSlopes, super::prepare::Measured)>();
            continue;
        };
        let Some(mut slopes) = slopes else {
            commands.entity(entity).insert(PosedSlopes::at_rest(geometry.0.clone()));
            continue;
        };
        if deforming.is_changed() || transform.is_changed() {
            slopes.unseen = true;
        }
        if let Some(posed) = slopes.finished(geometry.0.layout(), *timing, clock.tick()) {
            geometry.0 = Arc::new(posed);
            // It is drawn as before until it moves.
            wake(
                water.bypass_change_detection(),
                matter.as_mut().map(|matter| matter.bypass_change_detection()),
            );
        }
        if !Arc::ptr_eq(slopes.rest.layout(), geometry.0.layout()) {
            // Measured anew, at rest. What is being measured still is of no use.
            *slopes = PosedSlopes::at_rest(geometry.0.clone());
        }
        if !slopes.unseen || slopes.task.is_some() || !may_move(&water, matter.as_deref()) {
            continue;
        }
        let Some(posed) = deforming.posed() else { continue };
        slopes.unseen = false;
        let world_from_shape = deforming.world_from_shape(&transform);
        if slopes.differs(posed, &world_from_shape) {
            slopes.measure(posed, world_from_shape, clock.tick());
        }
    }
}

/// Water runs by the slopes at rest again, as before a pose was measured for the first time.
pub(crate) fn forget_poses(world: &mut World) {
    let mut surfaces = world.query::<(&mut WetGeometry, &mut PosedSlopes)>();
    for (mut geometry, mut slopes) in surfaces.iter_mut(world) {
        // Else it was measured anew, at rest, and that has not been seen yet.
        if Arc::ptr_eq(slopes.rest.layout(), geometry.0.layout()) {
            geometry.0 = slopes.rest.clone();
        }
        *slopes = PosedSlopes::at_rest(geometry.0.clone());
    }
}

/// Whether there is anything on the surface that runs or slides, or would if it could.
fn may_move(water: &SurfaceWater, matter: Option<&SurfaceMatter>) -> bool {
    water.tiles.flags.iter().any(|flags| flags & (Tiles::RUNNING | Tiles::POOL) != 0)
        || matter.is_some_and(|matter| !matter.tiles.melting.is_empty())
}

/// What lay still may move by the new slopes.
fn wake(water: &mut SurfaceWater, matter: Option<&mut SurfaceMatter>) {
    for tile in 0..water.tiles.flags.len() as u32 {
        if water.tiles.has(tile, Tiles::POOL) {
            water.tiles.run(tile);
        }
    }
    if let Some(matter) = matter {
        for index in 0..matter.tiles.melting.len() {
            let tile = matter.tiles.melting[index];
            matter.tiles.slide(tile);
        }
    }
}
