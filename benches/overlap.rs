//! 100,000 stamps in a frame, 1, 8 and 32 deep on every texel: the compute pass by tiles against quads.
//!
//! | contender | what is timed |
//! |---|---|
//! | `compute` | a frame of the library: stamps into the queue, moved, sorted into tiles, uploaded, painted |
//! | `instanced_quads` | [`Quads::instanced`]: packed, uploaded, one draw |
//! | `draw_per_splat` | [`Quads::one_by_one`]: the same with a draw for each |
//! | `empty_frame` | a frame of the library without stamps, which `compute` holds as well |
//! | `tile_bins` | the sorting alone, which `compute` holds as well |
//!
//! All stamps are domes of one radius, even over a map of 1024 by 1024 with clamped edges; the radius is chosen so that
//! their discs lie as deep as wanted in the mean. Every call paints over what the calls before it left, and ends when the
//! GPU is done. Before anything is timed, both paint the same stamps on fresh maps, and these must be alike. On a slow
//! driver, they take fewer turns.

use std::cell::RefCell;
use std::f32::consts::PI;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_weathering::overlay::{
    OverlayUv, Overlays, Splat, SplatQueue, SplatStats, StampSpace, TileBins, Weatherable, Wrap,
};
use criterion::Criterion;

use crate::headless;
use crate::measure::{self, Contender};
use crate::quads::Quads;
use crate::scene::Random;

const SPLATS: usize = 100_000;
const DEPTHS: [u32; 3] = [1, 8, 32];
/// At most, and as many as the stamps of one depth are worth: at least one.
const ROUNDS: u32 = 3;
const WORTH: Duration = Duration::from_secs(15);
const SURFACE: Weatherable = Weatherable {
    map_size: 1024,
    wrap_u: Wrap::Clamp,
    wrap_v: Wrap::Clamp,
    stamps: StampSpace::Map,
    uv: OverlayUv::Mesh,
};

/// Units of a splat's centre and radius in a texel.
const SUBTEXELS: f32 = 256.0;

/// Shaders are loaded in the background; this long means that they never will be.
const PATIENCE: Duration = Duration::from_secs(60);

/// If a draw for each of [`SPLATS`] took longer, a tenth of them is timed.
const LONGEST: Duration = Duration::from_secs(20);

/// Mean difference of two diffuse maps, of 255, that may come from rounding 32 times in 8 bits. A map that is mirrored or
/// shifted by its stamps' radius is several times that off at depth 1.
const TOLERANCE: f64 = 6.0;

/// Mean coverage of a diffuse map, of 255, below which there is nothing to compare. At depth 1 it is a sixth: a third of a
/// dome's disc is its volume, and stamps cover half.
const LEAST_COVERAGE: f64 = 20.0;

/// So many stamps cover the map so deep in the mean.
fn radius_texels(depth: u32) -> f32 {
    let map = (SURFACE.map_size * SURFACE.map_size) as f32;
    (depth as f32 * map / (PI * SPLATS as f32)).sqrt()
}

fn splats(depth: u32) -> Vec<Splat> {
    let radius = (radius_texels(depth) * SUBTEXELS).round() as i32;
    let end = SURFACE.map_size as f32 * SUBTEXELS;
    let mut random = Random::new();
    let mut coordinate = || (((random.signed() + 1.0) * 0.5 * end) as i32).clamp(0, end as i32 - 1);
    let splat = |_| Splat {
        center: [coordinate(), coordinate()],
        radius: [radius; 2],
        water_nl: 4189,
        tick: 1,
        // Ochre, half covering: far from what rounding may do. Glossy, an eighth covering.
        diffuse: u32::from_le_bytes([200, 120, 60, 128]),
        specular: u32::from_le_bytes([128, 204, 0, 32]),
        bump: 51,
        bump_opacity: 255,
        ..bytemuck::Zeroable::zeroed()
    };
    (0..SPLATS).map(splat).collect()
}

/// A surface that has maps, and whose mesh never comes.
fn spawn(world: &mut World) -> Entity {
    world.spawn((SURFACE, Mesh3d::default())).id()
}

/// The library with one surface.
struct Ours {
    app: App,
    surface: Entity,
}

impl Ours {
    fn new() -> Self {
        let mut app = headless::app();
        let surface = spawn(app.world_mut());
        Self { app, surface }
    }

    /// Puts a surface that nothing has been painted on in the place of this one.
    fn renew(&mut self) {
        let world = self.app.world_mut();
        world.despawn(self.surface);
        self.surface = spawn(world);
    }

    fn push(&mut self, splats: &[Splat]) {
        let mut queue = self.app.world_mut().get_mut::<SplatQueue>(self.surface).unwrap();
        splats.iter().for_each(|&splat| queue.push(splat));
    }

    fn painted(&self) -> u64 {
        self.app.world().resource::<SplatStats>().splats()
    }

    /// Paints in one frame. Returns how many were painted in it.
    fn paint(&mut self, splats: &[Splat]) -> usize {
        let before = self.painted();
        self.push(splats);
        headless::frame(&mut self.app);
        (self.painted() - before) as usize
    }

    /// Paints in as many frames as the first time takes. Returns for how long.
    fn paint_first(&mut self, splats: &[Splat]) -> Duration {
        let all = self.painted() + splats.len() as u64;
        self.push(splats);
        let begun = Instant::now();
        while self.painted() < all {
            assert!(begun.elapsed() < PATIENCE, "splats are not painted");
            headless::frame(&mut self.app);
        }
        begun.elapsed()
    }

    /// Bytes of the diffuse, the specular and the normal map.
    fn read(&self) -> [Vec<u8>; 3] {
        let overlays = self.app.world().get::<Overlays>(self.surface).unwrap();
        let maps = [&overlays.diffuse, &overlays.specular, &overlays.normal];
        maps.map(|map| headless::read_image(&self.app, map))
    }
}

fn mean_difference(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    let sum: u64 = a.iter().zip(b).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.len() as f64
}

/// Opacity of a map, 0..=255.
fn mean_coverage(map: &[u8]) -> f64 {
    let sum: u64 = map.iter().skip(3).step_by(4).map(|&byte| u64::from(byte)).sum();
    sum as f64 * 4.0 / map.len() as f64
}

/// Painters that do not paint the same must not be timed. Returns how many rounds are worth their time.
fn check(group: &str, ours: &mut Ours, quads: &mut Quads, splats: &[Splat]) -> u32 {
    ours.renew();
    let once = ours.paint_first(splats);
    quads.renew();
    quads.instanced(splats);
    let (left, right) = (ours.read(), quads.read());
    let coverage = mean_coverage(&left[0]);
    let [diffuse, specular, normal] = std::array::from_fn(|map| mean_difference(&left[map], &right[map]));
    println!(
        "{group}: mean coverage {coverage:.1} of 255; mean difference of the maps {diffuse:.2}, {specular:.2}, \
         {normal:.2} of 255"
    );
    assert!(coverage > LEAST_COVERAGE, "{group}: nothing to compare, coverage {coverage}");
    assert!(diffuse < TOLERANCE, "{group}: the diffuse maps differ by {diffuse}");

    // One by one or at once, the hardware does the same.
    let few = &splats[..SPLATS / 10];
    quads.renew();
    quads.instanced(few);
    let at_once = quads.read();
    quads.renew();
    quads.one_by_one(few);
    assert!(at_once == quads.read(), "{group}: a draw for each stamp paints something else");
    ((WORTH.as_secs_f64() / once.as_secs_f64()) as u32).clamp(1, ROUNDS)
}

/// How many stamps can be drawn one by one in a time that one likes to wait.
fn affordable_draws(quads: &mut Quads, splats: &[Splat]) -> usize {
    let few = SPLATS / 10;
    let begun = Instant::now();
    quads.one_by_one(&splats[..few]);
    if begun.elapsed() * 10 > LONGEST { few } else { splats.len() }
}

fn compare(depth: u32, ours: &mut Ours, quads: &mut Quads) {
    let group = format!("overlap, {depth} deep");
    let splats = splats(depth);
    let rounds = check(&group, ours, quads, &splats);
    let draws = affordable_draws(quads, &splats);

    let (mut bins, mut headers, mut list) = (TileBins::default(), Vec::new(), Vec::new());
    let mut bin = || {
        headers.clear();
        list.clear();
        let (size, wrap) = (SURFACE.map_size, SURFACE.wrap());
        bins.bin_within(usize::MAX, &splats, size, wrap, None, 0, &mut headers, &mut list);
        list.len()
    };
    let tiles = bin() as f64 / SPLATS as f64;
    let (ours, quads) = (RefCell::new(ours), RefCell::new(quads));
    let mut contenders = [
        Contender::new("compute", || ours.borrow_mut().paint(&splats)),
        Contender::new("instanced_quads", || quads.borrow_mut().instanced(&splats)),
        Contender::new("draw_per_splat", || quads.borrow_mut().one_by_one(&splats[..draws])),
        Contender::new("empty_frame", || ours.borrow_mut().paint(&[])),
        Contender::new("tile_bins", bin),
    ];
    let counted = "splats (in tiles, if binned)";
    let [compute, instanced, one_by_one, empty, binning] =
        measure::means(&group, counted, &mut contenders, rounds, 1);
    let one_by_one = one_by_one * SPLATS as f64 / draws as f64;
    if draws < SPLATS {
        println!("{group}: one by one {draws} were drawn, and the time scaled to {SPLATS}");
    }
    println!(
        "| radius, texels | tiles each | compute ms | quads ms | one by one ms | empty ms | binning ms |"
    );
    println!("|---|---|---|---|---|---|---|");
    let radius = radius_texels(depth);
    let [compute_ms, instanced_ms, one_by_one_ms, empty_ms, binning_ms] =
        [compute, instanced, one_by_one, empty, binning].map(|seconds| seconds * 1e3);
    println!(
        "| {radius:.2} | {tiles:.2} | {compute_ms:.1} | {instanced_ms:.1} | {one_by_one_ms:.1} | {empty_ms:.2} | \
         {binning_ms:.2} |"
    );
    measure::ratio(&format!("{group}: compute against instanced_quads"), compute, instanced);
    measure::ratio(&format!("{group}: compute against draw_per_splat"), compute, one_by_one);
    let bare = compute - empty;
    measure::ratio(
        &format!("{group}: compute without the empty frame against instanced_quads"),
        bare,
        instanced,
    );
}

/// Runs the group.
pub fn bench(_: &mut Criterion) {
    if !measure::wanted("overlap") || !measure::measuring() {
        return;
    }
    let mut ours = Ours::new();
    println!("overlap: {SPLATS} stamps a frame on {}", headless::adapter(&ours.app));
    let (device, queue) = (headless::device(&ours.app), headless::queue(&ours.app));
    let mut quads = Quads::new(device, queue, SURFACE.map_size, SPLATS);
    for depth in DEPTHS {
        compare(depth, &mut ours, &mut quads);
    }
}
