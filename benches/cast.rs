//! Closest hits per second on one core, and how they grow with the number of triangles.
//!
//! Segments of 0.13 m, what a drop of 7.8 m/s moves in a tick, in random directions: from anywhere in the
//! bunny's box grown by half a segment, or from within 0.1 m of a bumpy ground of 6 m by 6 m that is cut into
//! more and more triangles. Each mesh is also given to the brute-force baseline, with as many of the segments
//! as make about four million triangle tests; the ratio is per segment. The baseline resolves uvs,
//! `MeshBvh::cast` only the triangle; with one hit in several segments and one uv per hit that is far below
//! its scan.
//!
//! The bunny and the ground of a million triangles are cast at by [`rivals`], too, with the same segments, all on one core.
//! Before anything is timed it is made sure that they hit the same, at the same distances.

use std::time::Instant;

use bevy::prelude::*;
use bevy_weathering::collision::{MeshBvh, MeshTriangles};
use criterion::{Criterion, Throughput};

use crate::hoff::{HoffParticle, HoffReject, HoffSystem};
use crate::measure::{self, Contender};
use crate::rivals::{BareMesh, BevyCaster, BvhCrate, Parry, Welded};
use crate::scene::{self, Random, dune_height};
use crate::{glb, rivals};

const SEGMENTS: usize = 4096;

/// m.
pub const LENGTH: f32 = 0.13;

/// Triangle tests of the baseline per call.
const BRUTE_TESTS: usize = 4_000_000;

/// Triangle tests of Bevy's brute force per call.
const BEVY_TESTS: usize = 32_000_000;

/// What the rivals are given.
const RIVALLED: [&str; 2] = ["bunny", "ground_1m"];

/// A mesh to cast at.
enum Shape {
    /// A model of the repository.
    Glb(&'static str),
    /// Cells along each side.
    Ground(u32),
}

const SHAPES: [(&str, Shape); 6] = [
    ("bunny_1000", Shape::Glb(glb::BUNNY_1000)),
    ("bunny", Shape::Glb(glb::BUNNY)),
    ("ground_1k", Shape::Ground(22)),
    ("ground_10k", Shape::Ground(71)),
    ("ground_100k", Shape::Ground(224)),
    ("ground_1m", Shape::Ground(707)),
];

impl Shape {
    fn triangles(&self) -> MeshTriangles {
        match *self {
            Self::Glb(model) => glb::triangles(model),
            Self::Ground(cells) => {
                let dunes = scene::dunes(Vec2::splat(-3.0), Vec2::splat(6.0), UVec2::splat(cells));
                MeshTriangles::from_mesh(&dunes).expect("dunes have triangles and uvs")
            }
        }
    }

    /// Starts and ends around the surface.
    fn segments(&self, triangles: &MeshTriangles) -> Vec<(Vec3, Vec3)> {
        let points = || triangles.positions.iter().flatten();
        let low = points().fold(Vec3::INFINITY, |low, &p| low.min(p)) - LENGTH / 2.0;
        let high = points().fold(Vec3::NEG_INFINITY, |high, &p| high.max(p)) + LENGTH / 2.0;
        let mut random = Random::new();
        let segment = |_| {
            let start = match self {
                Self::Glb(_) => low + (high - low) * (random.vector() * 0.5 + 0.5),
                Self::Ground(_) => {
                    let at = random.vector() * Vec3::new(3.0, 0.1, 3.0);
                    at + Vec3::Y * dune_height(at.x, at.z)
                }
            };
            (start, start + random.vector().normalize_or(Vec3::X) * LENGTH)
        };
        (0..SEGMENTS).map(segment).collect()
    }
}

/// Of the closest hit, m.
fn distance(bvh: &MeshBvh, &(start, end): &(Vec3, Vec3)) -> Option<f32> {
    bvh.cast(start, end).map(|hit| hit.fraction * LENGTH)
}

/// How many segments hit.
fn hits(bvh: &MeshBvh, segments: &[(Vec3, Vec3)]) -> usize {
    segments.iter().filter(|(start, end)| bvh.cast(*start, *end).is_some()).count()
}

/// Checks that everybody hits the same, then times them by turns.
fn against_rivals(name: &str, bvh: &MeshBvh, segments: &[(Vec3, Vec3)]) {
    let mesh = Welded::new(bvh.triangles());
    let built = |what: &str, begun: Instant| {
        println!("cast/{name}: {what} built in {:.1} ms", begun.elapsed().as_secs_f64() * 1e3);
    };
    let begun = Instant::now();
    let parry = Parry::new(&mesh, segments);
    built("parry3d", begun);
    let begun = Instant::now();
    let tree = BvhCrate::new(&mesh, segments);
    built("bvh", begun);
    let bare = BareMesh::new(&mesh, segments);
    let mut bevy = BevyCaster::new(&mesh, segments);

    let expected: Vec<Option<f32>> = segments.iter().map(|segment| distance(bvh, segment)).collect();
    let few = (BEVY_TESTS / bvh.triangles().positions.len()).clamp(1, SEGMENTS);
    rivals::check("parry3d", &expected, |number| parry.cast(number));
    rivals::check("bvh, nearest first", &expected, |number| tree.nearest_first(number));
    rivals::check("bvh, limited", &expected, |number| tree.limited(number));
    rivals::check("ray_mesh_intersection", &expected[..few], |number| bare.cast(number));
    rivals::check("MeshRayCast", &expected[..few], |number| bevy.cast(number));

    let mut trees = [
        Contender::new("ours", || hits(bvh, segments)),
        Contender::new("parry3d", || (0..SEGMENTS).filter(|&i| parry.cast(i).is_some()).count()),
        Contender::new("bvh_nearest_first", || {
            (0..SEGMENTS).filter(|&i| tree.nearest_first(i).is_some()).count()
        }),
        Contender::new("bvh_limited", || (0..SEGMENTS).filter(|&i| tree.limited(i).is_some()).count()),
    ];
    let label = format!("cast/{name}, {SEGMENTS} segments");
    let [ours, others @ ..] = measure::means(&label, "hits", &mut trees, 10, 2);
    for (other, seconds) in ["parry3d", "bvh nearest first", "bvh limited"].into_iter().zip(others) {
        println!("cast/{name}: {other} {:.0} ns each", seconds * 1e9 / SEGMENTS as f64);
        measure::ratio(&format!("cast/{name} against {other}"), ours, seconds);
    }
    let mut scans = [
        Contender::new("ours", || hits(bvh, &segments[..few])),
        Contender::new("mesh_ray_cast", || (0..few).filter(|&i| bevy.cast(i).is_some()).count()),
        Contender::new("ray_mesh_intersection", || (0..few).filter(|&i| bare.cast(i).is_some()).count()),
    ];
    let label = format!("cast/{name}, {few} segments");
    let [ours, others @ ..] = measure::means(&label, "hits", &mut scans, 5, 1);
    for (other, seconds) in ["MeshRayCast", "ray_mesh_intersection"].into_iter().zip(others) {
        println!("cast/{name}: {other} {:.0} ns each", seconds * 1e9 / few as f64);
        measure::ratio(&format!("cast/{name} against {other}"), ours, seconds);
    }
}

/// Ticks that are looked ahead.
const AHEAD: usize = 8;

/// What other ways of asking would save: the same segments in the order of a curve through space (Morton 1966), as if particles
/// were sorted; and straight flights of [`AHEAD`] ticks cast at once, as a look-ahead over a scene that stands still would,
/// against a cast for each tick that ends with the first hit. The flights take no account of drag, wind or a curved path.
fn other_ways(name: &str, bvh: &MeshBvh, segments: &[(Vec3, Vec3)]) {
    let (low, high) = bvh.bounds();
    let morton = |&(start, _): &(Vec3, Vec3)| {
        let cell = ((start - low) / (high - low) * 1023.0).clamp(Vec3::ZERO, Vec3::splat(1023.0)).as_uvec3();
        (0..30).fold(0u32, |key, bit| key | (cell[bit % 3] >> (bit / 3) & 1) << bit)
    };
    let mut sorted = segments.to_vec();
    sorted.sort_by_key(morton);
    let flights = &segments[..SEGMENTS / AHEAD];
    let tick_by_tick = |&(start, end): &(Vec3, Vec3)| {
        let step = end - start;
        (0..AHEAD).any(|tick| {
            let from = start + step * tick as f32;
            bvh.cast(from, from + step).is_some()
        })
    };
    let at_once =
        |&(start, end): &(Vec3, Vec3)| bvh.cast(start, start + (end - start) * AHEAD as f32).is_some();
    let mut contenders = [
        Contender::new("as they come", || hits(bvh, segments)),
        Contender::new("sorted by space", || hits(bvh, &sorted)),
        Contender::new("tick by tick", || flights.iter().filter(|flight| tick_by_tick(flight)).count()),
        Contender::new("looked ahead", || flights.iter().filter(|flight| at_once(flight)).count()),
    ];
    let label = format!("cast/{name}, other ways");
    let [plain, sorted, ticks, ahead] = measure::means(&label, "hits", &mut contenders, 10, 2);
    measure::ratio(&format!("cast/{name}: sorted by space against as they come"), sorted, plain);
    measure::ratio(&format!("cast/{name}: {AHEAD} ticks looked ahead against tick by tick"), ahead, ticks);
}

/// Runs the group.
pub fn bench(criterion: &mut Criterion) {
    if !measure::wanted("cast") {
        return;
    }
    let mut group = criterion.benchmark_group("cast");
    group.throughput(Throughput::Elements(SEGMENTS as u64));
    let mut results = Vec::new();
    for (name, shape) in SHAPES {
        let triangles = shape.triangles();
        let (count, segments) = (triangles.positions.len(), shape.segments(&triangles));
        let objects = std::slice::from_ref(&triangles.positions);
        let uvs = std::slice::from_ref(&triangles.uvs);
        let mut brute = HoffSystem::new(objects, uvs, HoffReject::Nothing);
        let begun = Instant::now();
        let bvh = MeshBvh::build(triangles);
        let build = begun.elapsed();

        let few = &segments[..(BRUTE_TESTS / count).clamp(1, SEGMENTS)];
        let cast = || hits(&bvh, &segments);
        let scan = || {
            brute.clear();
            // A tick of 1 s at a speed of a segment a second.
            let particle = |(start, end): (Vec3, Vec3)| HoffParticle {
                position: start,
                velocity: end - start,
                age: 0.0,
            };
            brute.emit(few.len(), |i| particle(few[i]));
            brute.tick(1.0, Vec3::ZERO)
        };
        let mut contenders = [Contender::new(name, cast), Contender::new("hoff", scan)];
        contenders[0].bench(&mut group);
        if measure::measuring() {
            let label = format!("cast, {SEGMENTS} and {} segments", few.len());
            let [ours, hoff] = measure::means(&label, "hits", &mut contenders, 10, 2);
            results.push((name, count, build, ours / SEGMENTS as f64, hoff / few.len() as f64));
            drop(contenders);
            if RIVALLED.contains(&name) {
                against_rivals(name, &bvh, &segments);
                other_ways(name, &bvh, &segments);
            }
        }
    }
    group.finish();
    for (name, triangles, build, ours, hoff) in results {
        let (build_ms, millions) = (build.as_secs_f64() * 1e3, 1e-6 / ours);
        println!("cast/{name}: {triangles} triangles, built in {build_ms:.1} ms");
        println!(
            "cast/{name}: {millions:.2} million casts/s, {:.0} ns each; hoff {:.0} ns",
            ours * 1e9,
            hoff * 1e9
        );
        measure::ratio(&format!("cast/{name} against hoff_no_reject"), ours, hoff);
    }
}
