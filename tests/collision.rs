//! The collision scene against brute force in double precision.
//!
//! Single precision may see the edge of a triangle, or the end of a segment, a little beside where it is.
//! So the brute force also finds crossings up to [`MARGIN`] outside, and calls those doubtful that are not
//! at least as far inside. The scene must name one of them, and may not pass one that is beyond doubt.

use std::sync::Arc;

use bevy::asset::RenderAssetUsages;
use bevy::math::{Affine3A, DVec2, DVec3, Vec3A};
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_weathering::collision::{CollisionScene, MeshBvh, MeshTriangles, SceneHit, TriangleReport};

use crate::common::{Random, bunny};

/// How far single precision may be off, in barycentric coordinates and in the fraction of a segment.
const MARGIN: f64 = 1e-5;
/// How far a hit may be off the plane of its triangle; metres. The fraction follows: it may be off by more
/// on a short segment, and on one that grazes the triangle.
const DEPTH_TOLERANCE: f64 = 2e-6;
/// How far the scene's uv may be from that of the same crossing.
const UV_TOLERANCE: f64 = 1e-3;

/// A mesh as lists of numbers, good or bad.
struct Lists {
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    indices: Vec<u32>,
}

impl Lists {
    fn bunny() -> Self {
        let triangles = bunny();
        let positions: Vec<_> = triangles.positions.as_flattened().iter().map(Vec3::to_array).collect();
        let uvs = triangles.uvs.as_flattened().iter().map(Vec2::to_array).collect();
        let indices = (0..positions.len() as u32).collect();
        Self { positions, uvs, indices }
    }

    /// A bunny between whose triangles there are many that cannot be hit, and how many of each kind.
    fn spoilt_bunny() -> (Self, TriangleReport) {
        let Self { mut positions, mut uvs, indices } = Self::bunny();
        let first = positions.len() as u32;
        positions.extend([[0.0; 3], [0.25, 0.0, 0.0], [0.5, 0.0, 0.0]]);
        positions.extend([[0.0, f32::NAN, 0.0], [f32::INFINITY, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        uvs.extend([[0.0; 2], [0.0; 2], [0.0; 2], [0.0; 2], [0.0; 2], [0.0, f32::NAN]]);
        let point = [first, first + 1, first];
        let line = [first, first + 1, first + 2];
        let not_a_number = [first, first + 1, first + 3];
        let infinite = [first, first + 4, first + 1];
        let no_uv = [first + 5, first, first + 1];
        let beyond = [first, first + 1, u32::MAX];
        let bad = [point, line, not_a_number, infinite, no_uv, beyond];

        let mut mixed = Vec::new();
        let mut report = TriangleReport { total: indices.len() as u32 / 3, ..default() };
        for (number, corners) in indices.chunks_exact(3).enumerate() {
            if number % 10 == 0 {
                mixed.extend(bad.as_flattened());
                report.total += 6;
                report.degenerate += 2;
                report.non_finite += 3;
                report.out_of_range += 1;
            }
            mixed.extend(corners);
        }
        (Self { positions, uvs, indices: mixed }, report)
    }

    fn to_mesh(&self) -> Mesh {
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, self.positions.clone())
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, self.uvs.clone())
            .with_inserted_indices(Indices::U32(self.indices.clone()))
    }
}

/// A triangle in world space.
struct Triangle {
    surface: Entity,
    /// Number in its mesh, bad ones counted.
    number: u32,
    corners: [DVec3; 3],
    uvs: [DVec2; 3],
    /// A box around it, a little too large.
    low: Vec3A,
    high: Vec3A,
}

impl Triangle {
    /// `None` if it cannot be hit.
    fn new(surface: Entity, number: usize, mesh: &Lists, world_from_mesh: &Affine3A) -> Option<Self> {
        const SLACK: Vec3A = Vec3A::splat(1e-3);
        let indices = [0, 1, 2].map(|corner| mesh.indices[number * 3 + corner] as usize);
        if indices.iter().any(|&index| index >= mesh.positions.len()) {
            return None;
        }
        let local = indices.map(|index| Vec3::from_array(mesh.positions[index]).as_dvec3());
        let uvs = indices.map(|index| Vec2::from_array(mesh.uvs[index]).as_dvec2());
        let twice_area = (local[1] - local[0]).cross(local[2] - local[0]).length();
        if !(twice_area > 1e-12 && twice_area.is_finite() && uvs.iter().all(|uv| uv.is_finite())) {
            return None;
        }
        let corners = local.map(|corner| world_from_mesh.as_daffine3().transform_point3(corner));
        let [a, b, c] = corners;
        let low = a.min(b).min(c).as_vec3a() - SLACK;
        let high = a.max(b).max(c).as_vec3a() + SLACK;
        Some(Self { surface, number: number as u32, corners, uvs, low, high })
    }

    /// Möller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997, with [`MARGIN`].
    fn cross(&self, start: DVec3, end: DVec3) -> Option<Crossing<'_>> {
        let [a, b, c] = self.corners;
        let (ab, ac, along) = (b - a, c - a, end - start);
        let p = along.cross(ac);
        // 0 for a segment in the plane of the triangle; then nothing below is within bounds.
        let determinant = ab.dot(p);
        let from_a = start - a;
        let q = from_a.cross(ab);
        let weight_b = from_a.dot(p) / determinant;
        let weight_c = along.dot(q) / determinant;
        let weights = [1.0 - weight_b - weight_c, weight_b, weight_c];
        let crossing = Crossing { triangle: self, fraction: ac.dot(q) / determinant, weights };
        crossing.is_within(-MARGIN).then_some(crossing)
    }
}

/// Where a segment crosses a triangle, or nearly does.
struct Crossing<'a> {
    triangle: &'a Triangle,
    /// Of the segment.
    fraction: f64,
    /// Barycentric coordinates.
    weights: [f64; 3],
}

impl Crossing<'_> {
    /// Whether it is this far inside triangle and segment.
    fn is_within(&self, margin: f64) -> bool {
        let [a, b, c] = self.weights;
        [a, b, c, self.fraction, 1.0 - self.fraction].iter().all(|&bound| bound >= margin)
    }

    fn is_of(&self, hit: &SceneHit) -> bool {
        (self.triangle.surface, self.triangle.number) == (hit.surface, hit.triangle)
    }

    fn uv(&self) -> DVec2 {
        self.triangle.uvs.iter().zip(self.weights).map(|(&uv, weight)| uv * weight).sum()
    }

    /// Unit normal on the side from which `along` comes.
    fn normal(&self, along: DVec3) -> DVec3 {
        let [a, b, c] = self.triangle.corners;
        let normal = (b - a).cross(c - a).normalize();
        if normal.dot(along) > 0.0 { -normal } else { normal }
    }

    /// Fails unless the hit says what the crossing says.
    fn check(&self, hit: &SceneHit, start: Vec3, end: Vec3) {
        let what = format!("{hit:?} on the segment from {start} to {end}");
        let along = (end - start).as_dvec3();
        let normal = self.normal(along);
        let depth = (f64::from(hit.fraction) - self.fraction) * normal.dot(along);
        assert!(depth.abs() < DEPTH_TOLERANCE, "{what}: the fraction is {}", self.fraction);
        assert!(hit.point.distance(start.lerp(end, hit.fraction)) < 1e-6, "{what}: that is not the point");
        assert!(hit.uv.as_dvec2().distance(self.uv()) < UV_TOLERANCE, "{what}: the uv is {}", self.uv());
        assert!(hit.normal.as_dvec3().distance(normal) < 1e-4, "{what}: the normal is {normal}");
    }
}

/// A scene twice: as the crate has it, and as a list of triangles.
struct Scene {
    scene: CollisionScene,
    triangles: Vec<Triangle>,
}

impl Scene {
    fn new(surfaces: &[(&Lists, Transform)]) -> Self {
        let mut world = World::new();
        let mut triangles = Vec::new();
        let mut instances = Vec::new();
        for (mesh, transform) in surfaces {
            let surface = world.spawn_empty().id();
            let world_from_mesh = transform.compute_affine();
            let numbers = 0..mesh.indices.len() / 3;
            triangles.extend(numbers.filter_map(|n| Triangle::new(surface, n, mesh, &world_from_mesh)));
            let readable = MeshTriangles::from_mesh(&mesh.to_mesh()).expect("most triangles are good");
            instances.push((surface, world_from_mesh, Arc::new(MeshBvh::build(readable))));
        }
        Self { scene: CollisionScene::new(instances), triangles }
    }

    /// All crossings on or nearly on the segment.
    fn crossings(&self, start: Vec3, end: Vec3) -> Vec<Crossing<'_>> {
        let (low, high) = (Vec3A::from(start.min(end)), Vec3A::from(start.max(end)));
        let (start, end) = (start.as_dvec3(), end.as_dvec3());
        self.triangles
            .iter()
            .filter(|triangle| (low.cmple(triangle.high) & high.cmpge(triangle.low)).all())
            .filter_map(|triangle| triangle.cross(start, end))
            .collect()
    }

    /// Through the whole scene, or as short as what a particle moves in a tick, near a triangle.
    fn segment(&self, random: &mut Random) -> (Vec3, Vec3) {
        if random.below(2) == 0 {
            return (random.in_cube(2.5), random.in_cube(2.5));
        }
        let triangle = &self.triangles[random.below(self.triangles.len())];
        let middle = (triangle.corners.iter().sum::<DVec3>() / 3.0).as_vec3();
        (middle + random.in_cube(0.1), middle + random.in_cube(0.1))
    }
}

/// The bunny as it is, stretched and turned, mirrored, and among triangles that cannot be hit.
fn scene() -> Scene {
    let bunny = Lists::bunny();
    let (spoilt, _) = Lists::spoilt_bunny();
    let turned = Quat::from_euler(EulerRot::YXZ, 0.7, -1.1, 2.0);
    Scene::new(&[
        (&bunny, Transform::from_xyz(-1.0, -0.5, 0.25)),
        (
            &bunny,
            Transform::from_xyz(0.75, 0.25, -0.5).with_rotation(turned).with_scale(Vec3::new(2.0, 0.5, 1.3)),
        ),
        (&bunny, Transform::from_xyz(0.5, -1.5, 0.75).with_scale(Vec3::new(-1.2, 0.9, 1.0))),
        (&spoilt, Transform::from_xyz(-0.75, 0.5, -1.0).with_rotation(Quat::from_rotation_x(0.4))),
    ])
}

#[test]
fn closest_hits_equal_brute_force() {
    const SEGMENTS: usize = 100_000;
    let scene = scene();
    let mut random = Random(1997);
    let (mut hits, mut differing) = (0, 0);
    for _ in 0..SEGMENTS {
        let (start, end) = scene.segment(&mut random);
        let crossings = scene.crossings(start, end);
        let first = |margin: f64| {
            let fractions = crossings.iter().filter(|c| c.is_within(margin)).map(|c| c.fraction);
            fractions.fold(f64::INFINITY, f64::min)
        };
        let (expected, beyond_doubt) = (first(0.0), first(MARGIN));
        let fraction = match scene.scene.cast(start, end) {
            None => f64::INFINITY,
            Some(hit) => {
                hits += 1;
                let crossing = crossings.iter().find(|crossing| crossing.is_of(&hit));
                let crossing =
                    crossing.unwrap_or_else(|| panic!("{hit:?} from {start} to {end} is not there"));
                crossing.check(&hit, start, end);
                crossing.fraction
            }
        };
        assert!(fraction <= beyond_doubt + MARGIN, "from {start} to {end}: {fraction}, not {beyond_doubt}");
        if fraction != expected && (fraction - expected).abs() > MARGIN {
            differing += 1;
        }
    }
    assert!(hits >= SEGMENTS / 5, "only {hits} segments hit anything: the comparison means little");
    assert!(differing < SEGMENTS / 1000, "{differing} segments hit something else, close to an edge");
}

#[test]
fn triangles_that_cannot_be_hit_are_counted_by_kind() {
    let (spoilt, expected) = Lists::spoilt_bunny();
    let triangles = MeshTriangles::from_mesh(&spoilt.to_mesh()).unwrap();
    assert_eq!(triangles.report, expected);
    assert_eq!(triangles.positions.len(), 1000);
}

#[test]
fn segments_without_length_or_end_hit_nothing() {
    let scene = scene();
    let inside = scene.triangles[0].corners[0].as_vec3();
    for (start, end) in [
        (inside, inside),
        (inside, Vec3::NAN),
        (Vec3::NAN, inside),
        (inside, Vec3::INFINITY),
        (Vec3::NEG_INFINITY, inside),
    ] {
        assert_eq!(scene.scene.cast(start, end), None, "{start} to {end}");
    }
}

#[test]
fn surfaces_that_cannot_be_placed_are_left_out() {
    let bunny = Lists::bunny();
    let scene = Scene::new(&[
        (&bunny, Transform::from_scale(Vec3::new(1.0, 0.0, 1.0))),
        (&bunny, Transform::from_xyz(f32::NAN, 0.0, 0.0)),
        (&bunny, Transform::from_xyz(2.0, 0.0, 0.0)),
        (&bunny, Transform::from_scale(Vec3::splat(f32::INFINITY))),
    ]);
    assert_eq!(scene.scene.len(), 1);
    let hit = scene.scene.cast(Vec3::new(2.0, 5.0, 0.0), Vec3::new(2.0, -5.0, 0.0));
    assert!(hit.is_some_and(|hit| hit.point.y > 0.0), "{hit:?}");
    assert_eq!(scene.scene.cast(Vec3::new(0.0, 5.0, 0.0), Vec3::new(0.0, -5.0, 0.0)), None);
}
