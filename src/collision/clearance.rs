//! How far it is, at least, from anywhere in a scene to the nearest surface.
//!
//! A grid over the scene's box knows for each cell how many cells away the nearest one with a triangle in it is. A segment
//! goes through it in leaps: from a cell to the rim of the cube around it that is empty, and so on. One that comes to its end
//! without entering a cell with a triangle hits nothing, and is not cast. Most particles are in the air most of the time: this is
//! all they cost. It only ever says no where there is nothing to hit, so hits are the same with and without it.
//!
//! Worked out in the background once a scene has kept still for some frames; while surfaces move, all segments are cast.

use bevy::math::Vec3A;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};

use super::CollisionScene;

/// Frames that a scene has to keep still.
const STILL_FRAMES: u32 = 30;

/// What is under way.
#[derive(Default)]
pub(super) struct ClearanceWork {
    still: u32,
    task: Option<Task<Option<Clearance>>>,
}

/// Works out the clearance of a scene that keeps still.
pub(super) fn measure_clearance(mut scene: ResMut<CollisionScene>, mut work: Local<ClearanceWork>) {
    if scene.is_changed() {
        // Meant for another scene.
        *work = ClearanceWork::default();
        return;
    }
    if let Some(task) = &mut work.task {
        if let Some(clearance) = check_ready(task) {
            // The scene is the same: to those who look for changes, too.
            scene.bypass_change_detection().set_clearance(clearance);
            work.task = None;
        }
    } else if work.still < STILL_FRAMES {
        work.still += 1;
        if work.still == STILL_FRAMES
            && let Some(measure) = scene.clearance_work()
        {
            work.task = Some(AsyncComputeTaskPool::get().spawn(async move { measure() }));
        }
    }
}

/// The most cells, at a byte each: so many that the grid still fits a cache of the second level.
const MOST_CELLS: f32 = 100_000.0;

/// The most cells along the longest side of the box.
const MOST_ALONG: f32 = 512.0;

/// So much, in cells, a leap goes beyond the rim of the cube that it leaves, to be in the next cell for certain.
const BEYOND: f32 = 1e-3;

/// So much larger, in cells, all cells are when triangles are looked for in them: more than a leap may pass of a cell whose corner
/// it cuts, with what rounding adds to that on a grid of [`MOST_ALONG`] cells.
const LARGER: f32 = 5.0 * BEYOND;

/// A way that is shorter, in cells, is as good as none.
const STANDS_STILL: f32 = 1e-20;

/// After so many leaps a segment is cast: it creeps along a surface.
const MOST_LEAPS: u32 = 12;

/// Distances to the nearest surface, cell by cell.
#[derive(Debug, Clone)]
pub(super) struct Clearance {
    low: Vec3,
    cell: f32,
    /// 1 / `cell`.
    cells_per_metre: f32,
    size: UVec3,
    /// Steps to the nearest cell that holds a part of a triangle, diagonal ones too; x runs fastest.
    steps: Vec<u8>,
}

impl Clearance {
    /// Of triangles in world space that lie in the box.
    pub(super) fn new((low, high): (Vec3, Vec3), triangles: impl Iterator<Item = [Vec3; 3]>) -> Option<Self> {
        let extent = high - low;
        let finest = extent.max_element() / MOST_ALONG;
        let cell = (extent.max(Vec3::splat(finest)).element_product() / MOST_CELLS).cbrt().max(finest);
        if !(extent.is_finite() && cell > 0.0) {
            return None;
        }
        let size = (extent / cell).ceil().as_uvec3().max(UVec3::ONE);
        let count = size.element_product() as usize;
        let mut grid = Self { low, cell, cells_per_metre: cell.recip(), size, steps: vec![u8::MAX; count] };
        triangles.for_each(|triangle| grid.mark(triangle));
        grid.measure();
        Some(grid)
    }

    fn index(&self, at: UVec3) -> usize {
        ((at.z * self.size.y + at.y) * self.size.x + at.x) as usize
    }

    /// Marks the cells that the plane of a triangle cuts within its box.
    fn mark(&mut self, [a, b, c]: [Vec3; 3]) {
        let half = Vec3::splat((0.5 + LARGER) * self.cell) + self.low.abs().max_element() * 1e-6;
        let cell_of = |point: Vec3| {
            let at = (point - self.low) / self.cell;
            at.max(Vec3::ZERO).as_uvec3().min(self.size - UVec3::ONE)
        };
        let margin = half - 0.5 * self.cell;
        let from = cell_of(a.min(b).min(c) - margin);
        let to = cell_of(a.max(b).max(c) + margin);
        // By doubles: that of a long and thin one would lean so much that its plane misses cells at its far end.
        let [from_a, from_b, from_c] = [a, b, c].map(|corner| corner.as_dvec3());
        let normal = (from_b - from_a).cross(from_c - from_a).normalize_or_zero().as_vec3();
        let reach = normal.abs().dot(half);
        for z in from.z..=to.z {
            for y in from.y..=to.y {
                for x in from.x..=to.x {
                    let at = UVec3::new(x, y, z);
                    let middle = self.low + (at.as_vec3() + 0.5) * self.cell;
                    if normal.dot(middle - a).abs() <= reach {
                        let index = self.index(at);
                        self.steps[index] = 0;
                    }
                }
            }
        }
    }

    /// The chessboard distance of every cell to the nearest marked one, in two passes (Rosenfeld and Pfaltz 1966).
    fn measure(&mut self) {
        let size = self.size.as_ivec3();
        let before: Vec<IVec3> = (0..27)
            .map(|number| IVec3::new(number % 3 - 1, number / 3 % 3 - 1, number / 9 - 1))
            .take(13)
            .collect();
        let cells = size.element_product();
        let place =
            |index: i32| IVec3::new(index % size.x, index / size.x % size.y, index / (size.x * size.y));
        for forward in [true, false] {
            for number in 0..cells {
                let index = if forward { number } else { cells - 1 - number };
                let at = place(index);
                let mut least = self.steps[index as usize];
                for &step in &before {
                    let beside = if forward { at + step } else { at - step };
                    if beside.cmpge(IVec3::ZERO).all() && beside.cmplt(size).all() {
                        let there = self.steps[self.index(beside.as_uvec3())];
                        least = least.min(there.saturating_add(1));
                    }
                }
                self.steps[index as usize] = least;
            }
        }
    }

    /// Whether a segment hits nothing for certain. One that begins outside the box may hit something.
    #[inline]
    pub(super) fn is_clear(&self, start: Vec3A, end: Vec3A) -> bool {
        let (low, size) = (Vec3A::from(self.low), Vec3A::from(self.size.as_vec3()));
        let start = (start - low) * self.cells_per_metre;
        let way = (end - low) * self.cells_per_metre - start;
        // Where it does not move, it leaves a cube after a very long time.
        let way = Vec3A::select(way.abs().cmplt(Vec3A::splat(STANDS_STILL)), Vec3A::splat(STANDS_STILL), way);
        let per_way = way.recip();
        let forward = Vec3A::select(way.cmpgt(Vec3A::ZERO), Vec3A::ONE, Vec3A::ZERO);
        let beyond = BEYOND / way.abs().max_element();
        // Exact: there are fewer cells than a float has whole numbers.
        let strides = Vec3A::new(1.0, size.x, size.x * size.y);
        let (mut at, mut done) = (start, 0.0);
        for leap in 0..MOST_LEAPS {
            if !(at.cmpge(Vec3A::ZERO) & at.cmplt(size)).all() {
                // Out of the box, there is nothing more to hit. What is not a number is nowhere, and not clear.
                return leap != 0 && at.is_finite();
            }
            let cell = at.floor();
            let steps = self.steps[cell.dot(strides) as usize];
            if steps == 0 {
                return false;
            }
            // The cube of empty cells around this one, and where the way leaves it.
            let steps = f32::from(steps);
            let rim = cell + forward * (2.0 * steps - 1.0) - (steps - 1.0);
            done = ((rim - start) * per_way).min_element().max(done) + beyond;
            if done >= 1.0 {
                return true;
            }
            at = start + way * done;
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::{MeshBvh, MeshTriangles};
    use crate::scenes::meshes::ground;
    use bevy::math::DVec3;

    #[test]
    fn what_is_called_clear_hits_nothing_and_much_is_called_clear() {
        let ball = Mesh::from(Sphere::new(0.5)).translated_by(Vec3::new(0.3, 0.9, -0.2));
        let mut triangles = MeshTriangles::from_mesh(&ball).unwrap();
        let floor = MeshTriangles::from_mesh(&ground(Vec2::splat(4.0), UVec2::splat(3)).unwrap()).unwrap();
        triangles.positions.extend(floor.positions);
        triangles.uvs.extend(floor.uvs);
        triangles.source = (0..triangles.positions.len() as u32).collect();
        let bvh = MeshBvh::build(triangles);
        let grid = Clearance::new(bvh.bounds(), bvh.triangles().positions.iter().copied()).unwrap();
        let (low, high) = bvh.bounds();
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u32 << 24) as f32
        };
        let (mut clear, mut hits) = (0, 0);
        for _ in 0..50_000 {
            let start = low + (high - low) * Vec3::new(random(), random(), random());
            let way = Vec3::new(random(), random(), random()) - 0.5;
            let end = start + way * 0.5 * random();
            let hit = bvh.cast(start, end).is_some();
            let is_clear = grid.is_clear(start.into(), end.into());
            assert!(!(hit && is_clear), "{start} {end}");
            clear += u32::from(is_clear);
            hits += u32::from(hit);
        }
        assert!(clear > 35_000 && hits > 1_000, "{clear} {hits}");
    }

    /// Coordinates in [-1, 1).
    struct Random(u64);

    impl Random {
        fn vector(&mut self) -> Vec3 {
            Vec3::from_array([0; 3].map(|_| {
                self.0 =
                    self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (self.0 >> 40) as f32 / (1u32 << 23) as f32 - 1.0
            }))
        }
    }

    /// Whether a segment hits a triangle, by doubles.
    fn hits(start: Vec3, end: Vec3, corners: &[Vec3; 3]) -> bool {
        let [start, end] = [start, end].map(|point| point.as_dvec3());
        let [a, b, c]: [DVec3; 3] = corners.map(|corner| corner.as_dvec3());
        let (way, ab, ac) = (end - start, b - a, c - a);
        let normal = ab.cross(ac);
        let part = (a - start).dot(normal) / way.dot(normal);
        let at = start + way * part - a;
        let to_b = at.cross(ac).dot(normal) / normal.length_squared();
        let to_c = ab.cross(at).dot(normal) / normal.length_squared();
        // The NaN of a parallel one fails.
        (0.0..=1.0).contains(&part) && to_b >= 0.0 && to_c >= 0.0 && to_b + to_c <= 1.0
    }

    /// Of triangles, within a box that is a little larger, as that of a scene is.
    fn grid_of(triangles: &[[Vec3; 3]]) -> (Clearance, Vec3, Vec3) {
        let corners = || triangles.iter().flatten();
        let low = corners().fold(Vec3::INFINITY, |low, &corner| low.min(corner));
        let high = corners().fold(Vec3::NEG_INFINITY, |high, &corner| high.max(corner));
        let pad = 8e-6 * low.abs().max(high.abs()).max_element();
        let (low, high) = (low - pad, high + pad);
        (Clearance::new((low, high), triangles.iter().copied()).unwrap(), low, high)
    }

    #[test]
    fn nothing_is_hidden_in_small_large_flat_or_far_scenes_along_axes_and_from_borders_and_surfaces() {
        let mut random = Random(3);
        let (mut clear, mut hit) = (0, 0);
        for scale in [1e-3_f32, 1.0, 1e6] {
            for (away, thick) in [(0.0_f32, 1.0_f32), (10.0, 0.0), (1000.0, 0.01)] {
                let squash = Vec3::new(1.0, thick, 1.0);
                let place = |point: Vec3| (point * squash + Vec3::new(away, -away, 0.3 * away)) * scale;
                let mut triangles =
                    vec![[Vec3::NEG_X - Vec3::Z, Vec3::X - Vec3::Z, Vec3::X + Vec3::Z].map(place)];
                for _ in 0..8 {
                    let middle = random.vector();
                    triangles.push([0; 3].map(|_| place(middle + random.vector() * 0.5)));
                }
                let (grid, low, high) = grid_of(&triangles);
                for round in 0..2000 {
                    let anywhere = low + (high - low) * (random.vector() * 0.5 + 0.5);
                    let reach = [0.01_f32, 0.1, 1.0, 10.0][round % 4] * (high - low).max_element();
                    let (way, axis) = (random.vector() * reach, Vec3::AXES[round / 4 % 3]);
                    let (start, way) = match round / 12 % 6 {
                        0 => (anywhere, way),
                        // Along an axis, straight across it, and hardly along it.
                        1 => (anywhere, way * axis),
                        2 => (anywhere, way * (Vec3::ONE - axis)),
                        3 => (anywhere, way * (Vec3::ONE - axis * 0.99999)),
                        // From the border of a cell.
                        4 => {
                            let border = grid.low + ((anywhere - grid.low) / grid.cell).round() * grid.cell;
                            (anywhere * (Vec3::ONE - axis) + border * axis, way)
                        }
                        // From a surface.
                        _ => {
                            let [a, b, c] = triangles[round % triangles.len()];
                            ((a + b + c) / 3.0, way)
                        }
                    };
                    let end = start + way;
                    let is_clear = grid.is_clear(start.into(), end.into());
                    let is_hit = triangles.iter().any(|corners| hits(start, end, corners));
                    assert!(!(is_hit && is_clear), "{start} {end}, {scale} {away} {thick}");
                    clear += u32::from(is_clear);
                    hit += u32::from(is_hit);
                }
            }
        }
        assert!(clear > 4000 && hit > 2000, "{clear} {hit}");
    }

    #[test]
    fn a_wire_as_long_as_the_scene_is_not_called_clear() {
        let mut random = Random(5);
        for _ in 0..20 {
            let (from, along) = (random.vector() * 5.0, random.vector().normalize_or(Vec3::X));
            let beside = from + along * (8.0 + random.vector().x) + random.vector() * 1e-4;
            let wire = [from, from + along * 10.0, beside];
            let corner = [Vec3::ZERO, Vec3::Y, Vec3::Z].map(|point| point - 5.0);
            let (grid, ..) = grid_of(&[wire, corner]);
            for _ in 0..4000 {
                // Points of the triangle.
                let weights = random.vector().abs();
                let weights = weights / weights.element_sum();
                let at = wire[0] * weights.x + wire[1] * weights.y + wire[2] * weights.z;
                let way = random.vector() * 0.06;
                let (start, end) = (at - way, at + way);
                if hits(start, end, &wire) {
                    assert!(!grid.is_clear(start.into(), end.into()), "{start} {end}");
                }
            }
        }
    }

    #[test]
    fn nothing_and_nonsense_are_never_clear() {
        assert!(Clearance::new((Vec3::INFINITY, Vec3::NEG_INFINITY), std::iter::empty()).is_none());
        assert!(Clearance::new((Vec3::ZERO, Vec3::ZERO), std::iter::empty()).is_none());
        let grid =
            Clearance::new((Vec3::ZERO, Vec3::ONE), [[Vec3::ZERO, Vec3::X, Vec3::Y]].into_iter()).unwrap();
        assert!(!grid.is_clear(Vec3A::NAN, Vec3A::ONE) && !grid.is_clear(Vec3A::splat(0.9), Vec3A::NAN));
        assert!(!grid.is_clear(Vec3A::splat(0.9), Vec3A::splat(0.8).with_y(f32::NEG_INFINITY)));
        assert!(!grid.is_clear(Vec3A::splat(5.0), Vec3A::splat(5.1)));
        assert!(grid.is_clear(Vec3A::splat(0.9), Vec3A::splat(0.8)));
        // Straight along an axis, and nowhere at all.
        assert!(grid.is_clear(Vec3A::splat(0.9), Vec3A::new(0.1, 0.9, 0.9)));
        assert!(grid.is_clear(Vec3A::splat(0.5), Vec3A::splat(0.5)));
        assert!(!grid.is_clear(Vec3A::new(0.2, 0.2, 0.9), Vec3A::new(0.2, 0.2, 0.0)));
    }
}
