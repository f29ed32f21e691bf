//! Closest hits per second on one core, and how they grow with the number of triangles.
//!
//! Segments of 0.13 m, what a drop of 7.8 m/s moves in a tick, in random directions: from anywhere in the
//! bunny's box grown by half a segment, or from within 0.1 m of a bumpy ground of 6 m by 6 m that is cut into
//! more and more triangles. Each mesh is also given to the brute-force baseline, with as many of the segments
//! as make about four million triangle tests; the ratio is per segment. The baseline resolves uvs,
//! `MeshBvh::cast` only the triangle; with one hit in several segments and one uv per hit that is far below
//! its scan.

use std::time::Instant;

use bevy::prelude::*;
use bevy_weathering::collision::{MeshBvh, MeshTriangles};
use criterion::{Criterion, Throughput};

use crate::glb;
use crate::hoff::{HoffParticle, HoffReject, HoffSystem};
use crate::measure::{self, Contender};
use crate::scene::Random;

const SEGMENTS: usize = 4096;

/// m.
const LENGTH: f32 = 0.13;

/// Triangle tests of the baseline per call.
const BRUTE_TESTS: usize = 4_000_000;

/// A mesh to cast at.
enum Shape {
    /// A model of the repository.
    Glb(&'static str),
    /// Cells along each side.
    Ground(u16),
}

const SHAPES: [(&str, Shape); 6] = [
    ("bunny_1000", Shape::Glb(glb::BUNNY_1000)),
    ("bunny", Shape::Glb(glb::BUNNY)),
    ("ground_1k", Shape::Ground(22)),
    ("ground_10k", Shape::Ground(71)),
    ("ground_100k", Shape::Ground(224)),
    ("ground_1m", Shape::Ground(707)),
];

/// m; broad dunes with ripples on them.
fn height(x: f32, z: f32) -> f32 {
    0.15 * (2.1 * x + 0.3).sin() * (1.7 * z).cos() + 0.03 * (19.0 * x).sin() * (23.0 * z).sin()
}

fn bumpy_ground(cells: u16) -> MeshTriangles {
    let mut triangles = MeshTriangles::default();
    let corner = |column: u16, row: u16| {
        let uv = Vec2::new(f32::from(column), f32::from(row)) / f32::from(cells);
        let at = (uv - 0.5) * 6.0;
        (Vec3::new(at.x, height(at.x, at.y), at.y), uv)
    };
    for row in 0..cells {
        for column in 0..cells {
            let (a, b) = (corner(column, row), corner(column + 1, row));
            let (c, d) = (corner(column, row + 1), corner(column + 1, row + 1));
            for corners in [[a, c, b], [b, c, d]] {
                triangles.source.push(triangles.positions.len() as u32);
                triangles.positions.push(corners.map(|(position, _)| position));
                triangles.uvs.push(corners.map(|(_, uv)| uv));
            }
        }
    }
    triangles.report.total = triangles.positions.len() as u32;
    triangles
}

impl Shape {
    fn triangles(&self) -> MeshTriangles {
        match *self {
            Self::Glb(model) => glb::triangles(model),
            Self::Ground(cells) => bumpy_ground(cells),
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
                    at + Vec3::Y * height(at.x, at.z)
                }
            };
            (start, start + random.vector().normalize_or(Vec3::X) * LENGTH)
        };
        (0..SEGMENTS).map(segment).collect()
    }
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
        let cast = || segments.iter().filter(|(start, end)| bvh.cast(*start, *end).is_some()).count();
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
