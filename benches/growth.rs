//! How a tick grows: by triangles, by surfaces, by particles. And what it takes until such a scene is ready.
//!
//! Rain on dunes of 6 m by 6 m, the schedule of a tick alone. Particles carry no water: what that costs grows with texels, and is
//! in [`wetting`](crate::wetting).
//!
//! | series | what grows | what stays |
//! |---|---|---|
//! | triangles | one ground is cut into more and more | 100,000 particles/s from 3 m |
//! | surfaces | the same ground is cut into tiles, each with a mesh and maps of its own | the same; triangles and texels in all |
//! | particles | those alive, from 28 m, at the speed at which drag holds them: they hit after 2 s | 120,000 triangles |
//!
//! Cases differ in size by orders of magnitude, so they are not timed by turns. Memory is the growth of the resident memory of
//! this process: mesh, BVH, texels, and the app around them; n/a where there is no `/proc`. A case that would take more than
//! [`MOST_BYTES`], or than there is, is left out and says so.

use std::time::Instant;

use bevy::prelude::*;
use bevy_weathering::overlay::{Weatherable, Wrap};
use bevy_weathering::particle::ParticleConfig;
use criterion::Criterion;

use crate::bytes::{available, resident};
use crate::measure;
use crate::scene::{HZ, Placed, dunes, sky};
use crate::sim::{Readiness, Setup, Sim};

/// Cells along each side: 968, 10,082, 100,352, 999,698 and 9,999,392 triangles.
const CELLS: [u32; 5] = [22, 71, 224, 707, 2236];

/// Tiles along x and z, and texels along a side of their maps: some 12 mm each.
const TILES: [(u32, u32, u32); 4] = [(1, 1, 512), (5, 2, 160), (10, 10, 48), (40, 25, 16)];

/// Cells of all tiles together; every grid of [`TILES`] divides them.
const TILED_CELLS: UVec2 = UVec2::new(240, 250);

/// Particles alive.
const ALIVE: [u32; 5] = [1_000, 10_000, 100_000, 1_000_000, 2_000_000];

/// Particles a second, where their number stays.
const RATE: f32 = 100_000.0;

/// m/s: the terminal speed of water from a hose.
const SPEED: f32 = 14.0;

/// m; low, so that many are among the dunes at any time.
const LOW: f32 = 3.0;

/// m; two seconds above the ground.
const HIGH: f32 = 28.0;

/// Seconds of flight from [`HIGH`].
const FLIGHT: f32 = HIGH / SPEED;

/// The most a case may take, bytes.
const MOST_BYTES: f64 = 8.0e9;

/// While a BVH is built, memory is taken that is given back afterwards.
const PEAK_TO_REST: f64 = 2.0;

/// m.
const SIDE: f32 = 6.0;

/// The ground, in tiles.
fn ground(cells: UVec2, tiles: UVec2, map_size: u32) -> Vec<Placed> {
    let maps = Weatherable { map_size, wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, ..default() };
    let size = Vec2::splat(SIDE) / tiles.as_vec2();
    let tile = |number: u32| {
        let at = UVec2::new(number % tiles.x, number / tiles.x).as_vec2();
        (dunes(at * size - SIDE / 2.0, size, cells / tiles), Vec3::ZERO, maps)
    };
    (0..tiles.element_product()).map(tile).collect()
}

fn rained_on(surfaces: Vec<Placed>, rate: f32, height: f32) -> Sim {
    let setup = Setup { rate, drag: true, water: false, ..default() };
    let mut sim = Sim::with(setup, surfaces, |effect, rate| sky(effect, rate, height, SPEED));
    // More than the largest case has in flight.
    sim.world_mut().insert_resource(ParticleConfig { max_alive: 4_000_000 });
    sim
}

/// Fills the air, then times; particles alive at the end and mean microseconds of a tick.
fn timed(sim: &mut Sim, flight: f32, ticks: u32) -> (usize, f64) {
    // Dunes are not level: some fly a little longer.
    for _ in 0..(flight * HZ as f32) as u32 + 10 {
        sim.tick();
    }
    let begun = Instant::now();
    let mut alive = 0;
    for _ in 0..ticks {
        alive = sim.tick();
    }
    (alive, begun.elapsed().as_secs_f64() * 1e6 / f64::from(ticks))
}

/// Growth of resident memory since `before`, bytes.
fn grown_since(before: Option<u64>) -> Option<f64> {
    Some(resident()?.saturating_sub(before?) as f64)
}

fn print_case(series: &str, count: usize, sim: &Sim, grown: Option<f64>, (alive, micros): (usize, f64)) {
    let Readiness { hit, wetted } = sim.readiness();
    let [hit, wetted] = [hit, wetted].map(|time| time.as_secs_f64());
    let grown = grown.map_or("n/a".to_owned(), |bytes| format!("{:.0}", bytes * 1e-6));
    println!(
        "growth/{series}: {count:>9} | {alive:>8} alive | {micros:>10.1} us a tick | BVH after {hit:.2} s, texels after \
         {wetted:.2} s | {grown} MB"
    );
}

fn by_triangles() {
    let mut bytes_of_one = 0.0;
    for cells in CELLS {
        let count = 2 * (cells * cells) as usize;
        let predicted = PEAK_TO_REST * bytes_of_one * count as f64;
        let most = available().map_or(MOST_BYTES, |bytes| MOST_BYTES.min(bytes as f64));
        if predicted > most {
            let [predicted, most] = [predicted, most].map(|bytes| bytes * 1e-9);
            println!(
                "growth/triangles: {count:>9} | left out: would take {predicted:.1} GB of {most:.1} that it may"
            );
            continue;
        }
        let before = resident();
        let surfaces = ground(UVec2::splat(cells), UVec2::ONE, 512);
        let mut sim = rained_on(surfaces, RATE, LOW);
        let grown = grown_since(before);
        bytes_of_one = grown.unwrap_or_default() / count as f64;
        let times = timed(&mut sim, LOW / SPEED, 100);
        print_case("triangles", count, &sim, grown, times);
    }
}

fn by_surfaces() {
    for (columns, rows, map_size) in TILES {
        let before = resident();
        let surfaces = ground(TILED_CELLS, UVec2::new(columns, rows), map_size);
        let count = surfaces.len();
        let mut sim = rained_on(surfaces, RATE, LOW);
        let grown = grown_since(before);
        let times = timed(&mut sim, LOW / SPEED, 100);
        print_case("surfaces", count, &sim, grown, times);
    }
}

/// Each in a scene of its own, so that memory is of one case.
fn by_particles() {
    for alive in ALIVE {
        let before = resident();
        let mut sim = rained_on(ground(TILED_CELLS, UVec2::ONE, 512), alive as f32 / FLIGHT, HIGH);
        let ticks = if alive < 1_000_000 { 100 } else { 20 };
        let times = timed(&mut sim, FLIGHT, ticks);
        let grown = grown_since(before);
        print_case("particles", alive as usize, &sim, grown, times);
        println!("growth/particles: {:.1} ns a particle and tick", times.1 * 1e3 / times.0.max(1) as f64);
    }
}

/// Runs the group. Not measured by criterion, only filtered like its groups.
pub fn bench(_: &mut Criterion) {
    if !measure::wanted("growth") || !measure::measuring() {
        return;
    }
    println!();
    by_triangles();
    by_surfaces();
    by_particles();
}
