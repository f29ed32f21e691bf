//! Where the texels of a map lie in the space of their mesh: what stamps need to cross from one island of the map to the next.

use std::sync::Arc;

use bevy::ecs::entity::EntityHashMap;
use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use bytemuck::{Pod, Zeroable};

use super::kernel::{cross_axes, unpack_axis};
use super::{MapSize, StampSpace, TILE_SIZE, Weatherable, Wrap};
use crate::collision::{BoxOverlaps, MeshTriangles, SurfaceCollider};
use crate::effect::{EffectTable, WeatherEffect};
use crate::wetting::{MeasureTimer, TexelGeometry, TexelLayout, WetGeometry, surface_points};

/// A texel's place, in whole numbers. A row of the GPU's frame buffer: `TexelFrame` in `shaders/splat.wgsl` has the same
/// fields. Zero where nothing lies.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct TexelFrame {
    /// x, and y above it; 16 bits each, in steps.
    pub xy: u32,
    /// z, 16 bits; above it 1 if something lies here, and 2 if v grows along `along_u` x `normal`, not against it.
    pub z: u32,
    /// Unit normal of the front; signed bytes, 127 for 1.
    pub normal: u32,
    /// The direction in which u grows, likewise. That of v stands upright on both.
    pub along_u: u32,
}

impl TexelFrame {
    const LIES: u32 = 1 << 16;
    const FLIPPED: u32 = 2 << 16;

    fn new(at: [i32; 3], normal: Vec3, along_u: Vec3, along_v: Vec3) -> Self {
        let [x, y, z] = at.map(|along| along.clamp(0, 0xffff) as u32);
        Self {
            xy: x | y << 16,
            z: z | Self::LIES | if normal.cross(along_u).dot(along_v) < 0.0 { Self::FLIPPED } else { 0 },
            normal: pack_axis(normal),
            along_u: pack_axis(along_u),
        }
    }

    /// The directions in which u and v grow, 127 for 1.
    pub(super) fn along(&self) -> [[i32; 3]; 2] {
        let (normal, along_u) = (unpack_axis(self.normal), unpack_axis(self.along_u));
        let along_v = cross_axes(normal, along_u);
        [along_u, if self.z & Self::FLIPPED == 0 { along_v } else { along_v.map(|part| -part) }]
    }

    /// Its place in steps; none where nothing lies.
    pub fn place(&self) -> Option<[i32; 3]> {
        let low = |word: u32| (word & 0xffff) as i32;
        (self.z & Self::LIES != 0).then_some([low(self.xy), low(self.xy >> 16), low(self.z)])
    }
}

/// Three signed bytes, 127 for 1.
pub(super) fn pack_axis(axis: Vec3) -> u32 {
    let [x, y, z] = (axis * 127.0).round().to_array().map(|part| part as i8 as u8);
    u32::from_le_bytes([x, y, z, 0])
}

/// The places of all texels of a surface, in the space of its mesh at rest. Comes with the surface's geometry.
#[derive(Component, Clone)]
pub struct SurfaceFrames(pub(crate) Arc<Frames>, Arc<TexelLayout>);

impl SurfaceFrames {
    /// Measures a mesh for a map of `size` x `size` texels.
    pub fn new(triangles: &MeshTriangles, size: u32, wrap: [Wrap; 2]) -> Self {
        let geometry = TexelGeometry::new(triangles, &Affine3A::IDENTITY, Vec3::Y, size, wrap);
        Self(Arc::new(Frames::new(triangles, &geometry, wrap)), geometry.layout().clone())
    }

    /// Of what was measured by this geometry.
    pub(crate) fn of(frames: Frames, geometry: &TexelGeometry) -> Self {
        Self(Arc::new(frames), geometry.layout().clone())
    }

    /// The texels, row by row.
    pub fn texels(&self) -> &[TexelFrame] {
        &self.0.texels
    }
}

/// What [`SurfaceFrames`] holds.
pub(crate) struct Frames {
    /// Row by row, with a gutter of two texels, or of all that bilinear filtering reads.
    pub(crate) texels: Vec<TexelFrame>,
    low: Vec3,
    /// Length of a step, in units of the mesh.
    step: f32,
    /// Boxes around what lies on each tile, in steps, and which tile it is.
    boxes: BoxOverlaps,
    tiles: Vec<u32>,
}

impl Frames {
    /// Measures a mesh. `geometry` of the same mesh, size and edges; it knows the gutter.
    pub(crate) fn new(triangles: &MeshTriangles, geometry: &TexelGeometry, wrap: [Wrap; 2]) -> Self {
        let size = geometry.size();
        let all = triangles.positions.iter().flatten();
        let (low, high) =
            all.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &at| (low.min(at), high.max(at)));
        let extent = (high - low).max_element();
        let step = if extent.is_finite() && extent > 0.0 { extent / 65_535.0 } else { 1.0 };
        let slopes: Vec<[Vec3; 2]> =
            (0..triangles.positions.len()).map(|index| derivatives(triangles, index)).collect();
        let frame = |at: Vec3, normal: Vec3, [along_u, along_v]: [Vec3; 2]| {
            let place = ((at - low) / step).round().as_ivec3().to_array();
            TexelFrame::new(place, normal, along_u.normalize_or_zero(), along_v.normalize_or_zero())
        };
        let points = surface_points(triangles, &Affine3A::IDENTITY, size, wrap);
        let mut texels = vec![TexelFrame::default(); (size * size) as usize];
        for point in &points {
            let texel = frame(point.position, point.normal, slopes[point.triangle as usize]);
            texels[point.texel as usize] = texel;
        }
        // The gutter goes on straight where the island ends, so that what lies between it and the gutter is right.
        let side = size as i32;
        let offset = |from: u32, to: u32| (to as i32 - from as i32 + side / 2).rem_euclid(side) - side / 2;
        for texel in 0..size * size {
            let Some(source) = geometry.gutter_source(texel) else { continue };
            let Ok(index) = points.binary_search_by_key(&source, |point| point.texel) else { continue };
            let (point, [per_u, per_v]) = (points[index], slopes[points[index].triangle as usize]);
            let (columns, rows) = (offset(source % size, texel % size), offset(source / size, texel / size));
            let away = (per_u * columns as f32 + per_v * rows as f32) / size as f32;
            texels[texel as usize] = frame(point.position + away, point.normal, [per_u, per_v]);
        }
        for tip in geometry.tips() {
            let Ok(source) = points.binary_search_by_key(&tip.source, |point| point.texel) else { continue };
            let (source, [a, b, c]) = (points[source], triangles.positions[tip.triangle as usize]);
            let along = slopes[tip.triangle as usize];
            let away = (along[0] * tip.away.x + along[1] * tip.away.y) / size as f32;
            // A sliver may be stretched on the map, and would lead far away.
            let [per_u, per_v] = slopes[source.triangle as usize];
            let away = away.clamp_length_max((per_u.length() + per_v.length()) / size as f32);
            let place = a + (b - a) * tip.weights[0] + (c - a) * tip.weights[1] + away;
            let normal = (b - a).cross(c - a).try_normalize().unwrap_or(source.normal);
            texels[tip.texel as usize] = frame(place, normal, along);
        }
        let (tiles, boxes) = tile_boxes(&texels, size);
        Self { texels, low, step, boxes: BoxOverlaps::build(&boxes), tiles }
    }

    /// A point of the mesh, in steps.
    pub(crate) fn steps(&self, point: Vec3) -> [i32; 3] {
        ((point - self.low) / self.step).round().as_ivec3().to_array()
    }

    /// Length of a step, in units of the mesh.
    pub(crate) fn step(&self) -> f32 {
        self.step
    }

    /// Calls `touch` for each tile that may hold something within `reach` steps of a place, each once, in no order.
    pub(crate) fn tiles_near(&self, origin: [i32; 3], reach: i32, mut touch: impl FnMut(u32)) {
        let (middle, reach) = (IVec3::from_array(origin).as_vec3(), reach as f32 + 1.0);
        self.boxes.visit((middle - reach, middle + reach), |index| touch(self.tiles[index as usize]));
    }
}

/// How a place on a triangle changes with u and v, in units of the mesh; zero where it does not.
fn derivatives(triangles: &MeshTriangles, index: usize) -> [Vec3; 2] {
    let ([a, b, c], [uv_a, uv_b, uv_c]) = (triangles.positions[index], triangles.uvs[index]);
    let ((ab, ac), (uv_ab, uv_ac)) = ((b - a, c - a), (uv_b - uv_a, uv_c - uv_a));
    let area = uv_ab.perp_dot(uv_ac);
    let sound = |along: Vec3| if along.is_finite() { along } else { Vec3::ZERO };
    [sound((ab * uv_ac.y - ac * uv_ab.y) / area), sound((ac * uv_ab.x - ab * uv_ac.x) / area)]
}

/// The tiles on which anything lies, and boxes around that.
fn tile_boxes(texels: &[TexelFrame], size: u32) -> (Vec<u32>, Vec<(Vec3, Vec3)>) {
    let across = size / TILE_SIZE;
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let mut boxes = vec![empty; (across * across) as usize];
    for (texel, frame) in (0u32..).zip(texels) {
        let Some(place) = frame.place() else { continue };
        let at = IVec3::from_array(place).as_vec3();
        let tile = texel / size / TILE_SIZE * across + texel % size / TILE_SIZE;
        let (low, high) = &mut boxes[tile as usize];
        (*low, *high) = (low.min(at), high.max(at));
    }
    (0u32..).zip(boxes).filter(|(_, (low, _))| low.is_finite()).unzip()
}

/// What is being measured.
#[derive(Resource, Default)]
pub(crate) struct FramesWork {
    tasks: EntityHashMap<Measuring>,
}

/// A surface that is being measured.
struct Measuring {
    /// Of its texels when it was asked for.
    layout: Arc<TexelLayout>,
    task: Option<Task<Frames>>,
    /// The tick in which it was.
    asked_at: u32,
}

type Measurable = (
    Entity,
    &'static Weatherable,
    &'static WetGeometry,
    &'static SurfaceCollider,
    Option<&'static SurfaceFrames>,
);

impl FramesWork {
    /// Whether surfaces are being measured.
    pub(crate) fn is_busy(&self) -> bool {
        !self.tasks.is_empty()
    }
}

/// Measures the surfaces that are stamped on where they are, once there is an effect that paints. Where marks come depends on it, so
/// it counts from the tick on that [`MeasureTiming`](crate::wetting::MeasureTiming) says.
pub(super) fn measure_frames(
    mut commands: Commands,
    effects: Res<EffectTable>,
    timer: MeasureTimer,
    mut work: ResMut<FramesWork>,
    surfaces: Query<Measurable>,
) {
    let work = work.bypass_change_detection();
    let paints = effects.rows().iter().filter_map(|row| row.effect.as_ref()).any(WeatherEffect::paints);
    for (entity, surface, geometry, collider, frames) in surfaces.iter().filter(|_| paints) {
        let layout = geometry.0.layout();
        let measured = frames.is_some_and(|frames| Arc::ptr_eq(&frames.1, layout));
        let wanted = surface.stamps == StampSpace::Surface;
        if !wanted || measured || work.tasks.contains_key(&entity) {
            continue;
        }
        let (bvh, wrap) = (collider.0.clone(), surface.wrap());
        let of = geometry.0.clone();
        let task = AsyncComputeTaskPool::get().spawn(async move { Frames::new(bvh.triangles(), &of, wrap) });
        let measuring = Measuring { layout: layout.clone(), task: Some(task), asked_at: timer.tick() };
        work.tasks.insert(entity, measuring);
    }
    // Last: what is inserted now is seen from the next frame on.
    work.tasks.retain(|entity, Measuring { layout, task, asked_at }| {
        let Some(frames) = timer.take(task, *asked_at) else { return true };
        // What was another shape in the meantime is measured again.
        if surfaces.get(*entity).is_ok_and(|(_, _, current, ..)| Arc::ptr_eq(current.0.layout(), layout)) {
            let measured = SurfaceFrames(Arc::new(frames), layout.clone());
            commands.entity(*entity).insert(measured);
        }
        false
    });
}

/// A surface without maps has no marks any more.
pub(super) fn release_frames(removed: On<Remove, MapSize>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<SurfaceFrames>();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::WeatheringClock;
    use crate::collision::MeshBvh;
    use crate::wetting::MeasureTiming;

    fn frames(mesh: Mesh, size: u32) -> Frames {
        let triangles = MeshTriangles::from_mesh(&mesh).unwrap();
        let wrap = [Wrap::Clamp; 2];
        let geometry = TexelGeometry::new(&triangles, &Affine3A::IDENTITY, Vec3::Y, size, wrap);
        Frames::new(&triangles, &geometry, wrap)
    }

    #[test]
    fn texels_of_a_plane_lie_where_they_are() {
        // u along x, v along z, 2 m wide.
        let frames = frames(Plane3d::new(Vec3::Y, Vec2::ONE).into(), 32);
        for texel in [0u32, 5, 31, 32 * 31, 32 * 17 + 9] {
            let frame = frames.texels[texel as usize];
            let [x, y, z] = frame.place().unwrap();
            let expected = |at: u32| ((at as f32 + 0.5) / 32.0 * 65_535.0).round() as i32;
            assert_eq!((x, y, z), (expected(texel % 32), 0, expected(texel / 32)));
            assert_eq!(frame.normal, pack_axis(Vec3::Y));
            assert_eq!(frame.along(), [[127, 0, 0], [0, 0, 127]]);
        }
    }

    #[test]
    fn tiles_within_reach_are_found_and_far_ones_are_not() {
        let frames = frames(Plane3d::new(Vec3::Y, Vec2::ONE).into(), 64);
        let near = |point: Vec3, reach: i32| {
            let mut tiles = Vec::new();
            frames.tiles_near(frames.steps(point), reach, |tile| tiles.push(tile));
            tiles.sort_unstable();
            tiles
        };
        assert_eq!(near(Vec3::new(-0.9, 0.0, -0.9), 1000), [0]);
        assert_eq!(near(Vec3::new(-0.5, 0.0, -0.9), 2000), [0, 1]);
        assert_eq!(near(Vec3::ZERO, 66_000).len(), 16);
        assert!(near(Vec3::Y * 0.5, 2000).is_empty());
    }

    /// A surface that is measured for an effect that paints, asked for at tick 100.
    fn measured_from(timing: MeasureTiming) -> (World, Entity) {
        AsyncComputeTaskPool::get_or_init(Default::default);
        let mut world = World::new();
        world.init_resource::<FramesWork>();
        world.insert_resource(timing);
        world.insert_resource(WeatheringClock::new(60));
        let mut effects = EffectTable::default();
        let paint = WeatherEffect { bump: 0.5, stamp_radius: Some(0.02), ..default() };
        effects.insert(Handle::default(), paint);
        world.insert_resource(effects);
        let surface = Weatherable::default();
        let mesh: Mesh = Plane3d::new(Vec3::Y, Vec2::ONE).into();
        let triangles = MeshTriangles::from_mesh(&mesh).unwrap();
        let geometry = TexelGeometry::new(&triangles, &Affine3A::IDENTITY, Vec3::Y, 32, surface.wrap());
        let collider = SurfaceCollider(Arc::new(MeshBvh::build(triangles)));
        let entity = world.spawn((surface, WetGeometry(Arc::new(geometry)), collider)).id();
        assert!(!is_measured_at(&mut world, entity, 100));
        (world, entity)
    }

    /// Whether it has frames once a tick has begun.
    fn is_measured_at(world: &mut World, surface: Entity, tick: u32) -> bool {
        world.resource_mut::<WeatheringClock>().go_to(tick);
        let mut schedule = Schedule::default();
        schedule.add_systems(measure_frames);
        schedule.run(world);
        world.get::<SurfaceFrames>(surface).is_some()
    }

    #[test]
    fn marks_know_where_they_lie_from_a_fixed_tick_on_where_runs_have_to_be_alike() {
        let (mut world, surface) = measured_from(MeasureTiming::AfterTicks(15));
        // However early it is ready.
        std::thread::sleep(std::time::Duration::from_millis(50));
        assert!(!is_measured_at(&mut world, surface, 114));
        assert!(world.resource::<FramesWork>().is_busy());
        // However late: it is waited for.
        assert!(is_measured_at(&mut world, surface, 115));
        assert!(!world.resource::<FramesWork>().is_busy());
        let (mut world, surface) = measured_from(MeasureTiming::AfterTicks(15));
        assert!(is_measured_at(&mut world, surface, 115));
    }

    #[test]
    fn elsewhere_they_know_it_as_soon_as_it_is_known() {
        let (mut world, surface) = measured_from(MeasureTiming::WhenReady);
        let begun = std::time::Instant::now();
        while !is_measured_at(&mut world, surface, 100) {
            assert!(begun.elapsed().as_secs() < 30, "never ready");
        }
    }
}
