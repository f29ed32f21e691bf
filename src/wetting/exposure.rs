//! How well air and sun get at each texel, by rays against everything there is.
//!
//! Air: the part of the hemisphere above a point from which nothing is near. Convex places are open and dry first, corners
//! and the ground under things keep their damp. Sun: the cosine of its direction, where it is seen.
//!
//! Both vary slowly, so they are worked out on a grid of [`Exposure::CELLS`] cells a side over the map, in the background,
//! and laid between the cells bilinearly. Until that is done every texel counts as free and shaded.
//!
//! Meshes that are posed count as they are at rest, where their entity stands: what is shaded by a raised arm stays so when the
//! arm comes down. Rays for every pose would cost more than all water does.

use std::sync::Arc;

use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task};

use super::points::surface_points;
use super::{MeasureTiming, Now, SurfaceWater, TexelLayout, WetGeometry};
use crate::clock::WeatheringClock;
use crate::collision::{CollisionScene, MeshBvh, MeshColliders, NotWeatherable, SurfaceCollider};
use crate::material::PorousMaterial;
use crate::overlay::{Unmapped, Weatherable, Wrap};
use crate::weather::{DryingClock, Weather};
use crate::wetmap::{accessibility, sun_visibility};

/// What of the weather's demand gets at each texel of a surface.
#[derive(Component, Debug, Clone, PartialEq)]
pub struct Exposure {
    /// 128 is all that a free, even surface gets.
    air: Vec<u8>,
    /// 255 faces the sun squarely.
    sun: Vec<u8>,
    towards_sun: Option<Vec3>,
}

impl Exposure {
    /// Cells along each side of the map for which rays are cast.
    pub const CELLS: u32 = 96;
    /// Rays that look for air, for each cell.
    pub const RAYS: u32 = 32;
    /// How far away, in metres, nothing is in the way of air any more.
    pub const REACH: f32 = 0.5;

    /// Parts of the demand of air and sun at a texel.
    pub fn at(&self, texel: u32) -> (f64, f64) {
        let [air, sun] = self.bytes_at(texel);
        (f64::from(air) / 128.0, f64::from(sun) / 255.0)
    }

    /// The same; `None` for a texel of another, larger map.
    pub fn get(&self, texel: u32) -> Option<(f64, f64)> {
        let (air, sun) = (self.air.get(texel as usize)?, self.sun.get(texel as usize)?);
        Some((f64::from(*air) / 128.0, f64::from(*sun) / 255.0))
    }

    /// The same as it is stored: 128 and 255 are 1.
    pub fn bytes_at(&self, texel: u32) -> [u8; 2] {
        [self.air[texel as usize], self.sun[texel as usize]]
    }

    /// The same on a map of another size: `from` texels along each side before, `to` by now, a half, a quarter and so on of them or
    /// twice as many. Means of what lay in the place of a texel; it varies too slowly to be looked for anew.
    pub(crate) fn resized(&self, from: u32, to: u32) -> Self {
        let map = |bytes: &[u8]| {
            let ratio = (from / to).max(1);
            let mean = |texel: u32| {
                let (x, y) = (texel % to, texel / to);
                if to > from {
                    return bytes.get((y * from / to * from + x * from / to) as usize).copied().unwrap_or(0);
                }
                let rows = (y * ratio..(y + 1) * ratio).map(|row| row * from + x * ratio);
                let texels = rows.flat_map(|first| first..first + ratio);
                let sum: u32 =
                    texels.filter_map(|texel| bytes.get(texel as usize)).copied().map(u32::from).sum();
                u8::try_from((sum + ratio * ratio / 2) / (ratio * ratio)).unwrap_or(u8::MAX)
            };
            (0..to * to).map(mean).collect()
        };
        Self { air: map(&self.air), sun: map(&self.sun), towards_sun: self.towards_sun }
    }

    /// What is used while there is none.
    pub const FREE: [u8; 2] = [128, 0];

    fn bake(scene: &CollisionScene, job: &Job, towards_sun: Option<Vec3>) -> Self {
        let size = job.size;
        let points = surface_points(job.bvh.triangles(), &job.world_from_mesh, size, job.wrap);
        let cells = Self::CELLS.min(size);
        let cell = |at: u32| at * cells / size;
        let cell_of = |texel: u32| (cell(texel / size) * cells + cell(texel % size)) as usize;
        // How far off the middle of its cell a texel's is, along an axis, in parts of 1 / (2 cells size).
        let off_middle = |at: u32| ((2 * at + 1) * cells).abs_diff((2 * cell(at) + 1) * size);
        // The point of each cell that is nearest to its middle.
        let mut chosen: Vec<Option<(u32, usize)>> = vec![None; (cells * cells) as usize];
        for (number, point) in points.iter().enumerate() {
            let off = off_middle(point.texel % size) + off_middle(point.texel / size);
            let cell = &mut chosen[cell_of(point.texel)];
            if cell.is_none_or(|(least, _)| off < least) {
                *cell = Some((off, number));
            }
        }
        let picked: Vec<_> = chosen.iter().flatten().map(|&(_, number)| points[number]).collect();
        let open = accessibility(scene, &picked, Self::RAYS, Self::REACH);
        let lit = towards_sun.map(|sun| sun_visibility(scene, &picked, sun));
        let mut grid = vec![None; chosen.len()];
        let filled = chosen.iter().enumerate().filter(|(_, cell)| cell.is_some());
        for (number, (cell, _)) in filled.enumerate() {
            grid[cell] = Some([open[number], lit.as_ref().map_or(0.0, |lit| lit[number])]);
        }
        let grid = dilated(grid, cells as usize, job.wrap);
        let mut exposure = Self {
            air: Vec::with_capacity((size * size) as usize),
            sun: Vec::with_capacity((size * size) as usize),
            towards_sun,
        };
        for y in 0..size {
            for x in 0..size {
                let [open, lit] = between_cells(&grid, cells, size, job.wrap, x, y);
                // A free plane, which sees half of everything, gets 1.
                let air = 0.35 + 0.65 * open;
                exposure.air.push((air * 128.0).round().clamp(1.0, 255.0) as u8);
                exposure.sun.push((lit * 255.0).round().clamp(0.0, 255.0) as u8);
            }
        }
        exposure
    }
}

/// Gives cells without surface the mean of those around them, ring by ring.
fn dilated(mut grid: Vec<Option<[f32; 2]>>, side: usize, wrap: [Wrap; 2]) -> Vec<[f32; 2]> {
    for _ in 0..side {
        if grid.iter().all(Option::is_some) {
            break;
        }
        let before = grid.clone();
        for (index, cell) in grid.iter_mut().enumerate().filter(|(_, cell)| cell.is_none()) {
            let (x, y) = (index % side, index / side);
            let (mut sum, mut count) = ([0.0; 2], 0.0);
            for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
                let along = |at: usize, step: i32, wrap: Wrap| match wrap {
                    Wrap::Repeat => (at as i32 + step).rem_euclid(side as i32) as usize,
                    Wrap::Clamp => (at as i32 + step).clamp(0, side as i32 - 1) as usize,
                };
                if let Some(value) = before[along(y, dy, wrap[1]) * side + along(x, dx, wrap[0])] {
                    sum = [sum[0] + value[0], sum[1] + value[1]];
                    count += 1.0;
                }
            }
            if count > 0.0 {
                *cell = Some(sum.map(|value| value / count));
            }
        }
    }
    grid.into_iter().map(|cell| cell.unwrap_or([1.0, 0.0])).collect()
}

/// Bilinear between the middles of cells.
fn between_cells(grid: &[[f32; 2]], cells: u32, size: u32, wrap: [Wrap; 2], x: u32, y: u32) -> [f32; 2] {
    let place = |texel: u32, wrap: Wrap| {
        let at = (texel as f32 + 0.5) * cells as f32 / size as f32 - 0.5;
        let low = at.floor() as i32;
        let inside = |cell: i32| match wrap {
            Wrap::Repeat => cell.rem_euclid(cells as i32) as u32,
            Wrap::Clamp => cell.clamp(0, cells as i32 - 1) as u32,
        };
        (inside(low), inside(low + 1), at - low as f32)
    };
    let ((x0, x1, fx), (y0, y1, fy)) = (place(x, wrap[0]), place(y, wrap[1]));
    let cell = |x: u32, y: u32| grid[(y * cells + x) as usize];
    let mix = |a: [f32; 2], b: [f32; 2], t: f32| [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t];
    mix(mix(cell(x0, y0), cell(x1, y0), fx), mix(cell(x0, y1), cell(x1, y1), fx), fy)
}

/// The work that is under way.
#[derive(Resource, Default)]
pub struct ExposureProgress {
    task: Option<Task<Vec<(Entity, Arc<TexelLayout>, Exposure)>>>,
    /// How many there were when it began.
    surfaces: usize,
    /// The tick in which `task` was begun.
    asked_at: u32,
}

impl ExposureProgress {
    /// Whether rays are being cast.
    pub fn is_busy(&self) -> bool {
        self.task.is_some()
    }

    /// What is under way is of no use any more: all that is wanted is begun anew.
    pub(crate) fn start_over(&mut self) {
        if self.task.is_some() {
            *self = Self::default();
        }
    }
}

struct Job {
    surface: Entity,
    geometry: Arc<TexelLayout>,
    bvh: Arc<MeshBvh>,
    world_from_mesh: Affine3A,
    size: u32,
    wrap: [Wrap; 2],
}

/// Cosine of the angle by which the sun has to move until its shadows are looked for again.
const SUN_MOVED: f32 = 0.99;

type Exposed = (
    Entity,
    &'static WetGeometry,
    &'static SurfaceCollider,
    &'static GlobalTransform,
    &'static mut SurfaceWater,
    Option<&'static PorousMaterial>,
    Option<&'static mut Exposure>,
);

/// Surfaces whose shape is still to come.
type Unmeasured = (
    With<Weatherable>,
    With<Mesh3d>,
    Without<WetGeometry>,
    Without<NotWeatherable>,
    // Without texels there is nothing to come.
    Without<Unmapped>,
);

/// Casts rays for all surfaces when one is new or gone, or the sun has moved.
pub(super) fn bake_exposure(
    mut commands: Commands,
    clock: Res<WeatheringClock>,
    drying: Res<DryingClock>,
    weather: Res<Weather>,
    (colliders, timing): (Res<MeshColliders>, Res<MeasureTiming>),
    mut progress: ResMut<ExposureProgress>,
    unmeasured: Query<(), Unmeasured>,
    mut surfaces: Query<Exposed>,
) {
    if progress.task.is_some() {
        let asked_at = progress.asked_at;
        let Some(baked) = timing.take(&mut progress.task, asked_at, clock.tick()) else { return };
        for (entity, geometry, exposure) in baked {
            let Ok((_, current, _, _, mut water, material, old)) = surfaces.get_mut(entity) else { continue };
            if !Arc::ptr_eq(&geometry, current.0.layout()) {
                if geometry.size != current.0.size() {
                    // Its maps have got another size meanwhile, and what is new is in its way all the same.
                    progress.surfaces = 0;
                }
                continue;
            }
            // What has dried until now has dried by the old one.
            let default = PorousMaterial::default();
            let material = material.unwrap_or(&default);
            if water.is_wet() {
                let now = Now::new(clock.tick(), clock.hz(), &drying, &current.0, old.as_deref(), material);
                water.settle_all(&now);
            }
            match old {
                Some(mut old) => *old = exposure,
                None => {
                    commands.entity(entity).insert(exposure);
                }
            }
        }
        return;
    }
    // Everything that can be in the way has to be there, or it would depend on what was loaded first.
    if colliders.building() > 0 || !unmeasured.is_empty() {
        return;
    }
    let sun = weather.towards_sun();
    let moved = |old: Option<Vec3>| match (old, sun) {
        (Some(old), Some(new)) => old.dot(new) < SUN_MOVED,
        (old, new) => old.is_some() != new.is_some(),
    };
    // What is new is in the way of the others, too.
    let count = surfaces.iter().len();
    let wanted = count != progress.surfaces
        || surfaces.iter().any(|(.., exposure)| exposure.is_none_or(|exposure| moved(exposure.towards_sun)));
    if !wanted || count == 0 {
        return;
    }
    (progress.surfaces, progress.asked_at) = (count, clock.tick());
    let mut jobs: Vec<Job> = Vec::new();
    let mut scene = Vec::new();
    for (surface, geometry, collider, transform, water, ..) in &surfaces {
        let (world_from_mesh, bvh) = (transform.affine(), collider.0.clone());
        scene.push((surface, world_from_mesh, bvh.clone()));
        let (size, wrap) = (water.size, water.wrap);
        jobs.push(Job { surface, geometry: geometry.0.layout().clone(), bvh, world_from_mesh, size, wrap });
    }
    scene.sort_unstable_by_key(|(entity, ..)| *entity);
    progress.task = Some(AsyncComputeTaskPool::get().spawn(async move {
        let scene = CollisionScene::new(scene);
        let bake = |job: Job| {
            let exposure = Exposure::bake(&scene, &job, sun);
            (job.surface, job.geometry, exposure)
        };
        jobs.into_iter().map(bake).collect()
    }));
}

#[cfg(test)]
mod tests {
    use super::super::TexelGeometry;
    use super::*;
    use crate::collision::MeshTriangles;

    #[test]
    fn on_another_map_a_texel_gets_the_mean_of_what_lay_there() {
        let air: Vec<u8> = (0..32 * 32).map(|texel| (texel % 32 * 4 + texel / 32) as u8).collect();
        let sun = air.iter().map(|air| 255 - air).collect();
        let exposure = Exposure { air, sun, towards_sun: Some(Vec3::Y) };
        let half = exposure.resized(32, 16);
        // 0, 4, 1 and 5: halves are rounded up.
        assert_eq!((half.bytes_at(0), half.air.len(), half.towards_sun), ([3, 253], 256, Some(Vec3::Y)));
        assert_eq!(half.bytes_at(17)[0], 13);
        let twice = half.resized(16, 32);
        assert_eq!([0, 1, 32, 33].map(|texel| twice.bytes_at(texel)), [[3, 253]; 4]);
        assert_eq!(twice.bytes_at(2 * 32 + 3)[0], 13);
        assert_eq!(exposure.resized(32, 32), exposure);
    }

    #[test]
    fn rays_are_cast_again_where_a_map_got_another_size_meanwhile() {
        AsyncComputeTaskPool::get_or_init(Default::default);
        let wrap = [Wrap::Clamp; 2];
        let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
        let bvh = Arc::new(MeshBvh::build(MeshTriangles::from_mesh(&mesh).unwrap()));
        let on_map = |size: u32| {
            let geometry = TexelGeometry::new(bvh.triangles(), &Affine3A::IDENTITY, Vec3::Y, size, wrap);
            let water = SurfaceWater::of_size(size, wrap, geometry.mean_mm2());
            (WetGeometry(Arc::new(geometry)), water)
        };
        let mut world = World::new();
        world.insert_resource(WeatheringClock::new(60));
        world.init_resource::<DryingClock>();
        world.init_resource::<Weather>();
        world.init_resource::<MeshColliders>();
        world.init_resource::<MeasureTiming>();
        world.init_resource::<ExposureProgress>();
        let surface = world.spawn((on_map(32), SurfaceCollider(bvh.clone()), GlobalTransform::IDENTITY)).id();
        let look = |world: &mut World| {
            let mut schedule = Schedule::default();
            schedule.add_systems(bake_exposure);
            schedule.run(world);
            world.resource::<ExposureProgress>().is_busy()
        };
        let finish = |world: &mut World| {
            let begun = std::time::Instant::now();
            while look(world) {
                assert!(begun.elapsed() < std::time::Duration::from_secs(60), "never ready");
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
        };
        assert!(look(&mut world));
        // It has something to go by until then.
        let towards_sun = world.resource::<Weather>().towards_sun();
        let before = Exposure { air: vec![7; 256], sun: vec![7; 256], towards_sun };
        world.entity_mut(surface).insert((on_map(16), before.clone()));
        finish(&mut world);
        assert_eq!(world.get::<Exposure>(surface), Some(&before));
        assert!(look(&mut world));
        finish(&mut world);
        assert!(world.get::<Exposure>(surface).is_some_and(|now| now.air.len() == 256 && *now != before));
        // That was all.
        assert!(!look(&mut world));
    }

    #[test]
    fn cells_lie_where_their_texels_do_whatever_the_size_of_the_map() {
        for size in [64, 96, 128, 256, 512, 1024] {
            let cells = Exposure::CELLS.min(size);
            let ramp: Vec<[f32; 2]> =
                (0..cells * cells).map(|cell| [(cell % cells) as f32, (cell / cells) as f32]).collect();
            // But for the outermost cells, which mix with those across the edge.
            for texel in size / cells..size - size.div_ceil(cells) {
                let [x, y] = between_cells(&ramp, cells, size, [Wrap::Repeat; 2], texel, size / 2);
                let at = |texel: u32| (texel as f32 + 0.5) * cells as f32 / size as f32 - 0.5;
                assert!((x - at(texel)).abs() < 1e-3, "{size} {texel}: {x}");
                assert!((y - at(size / 2)).abs() < 1e-3, "{size} {texel}: {y}");
            }
        }
    }
}
