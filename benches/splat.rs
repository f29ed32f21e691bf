//! Splats on the CPU: painting them, and sorting them into tiles for the GPU.
//!
//! 10,000 stamps of 5 texels radius, evenly spread over a map of 1024 by 1024 that repeats.
//! [`CpuMaps::paint`] is all the work of a run without a renderer; [`TileBins::bin_within`] is what a frame with one
//! costs the CPU, apart from the upload. The ratio tells how much of the work the GPU takes over.

use bevy_weathering::overlay::{CpuMaps, Splat, StampAtlas, TileBins, Weatherable, Wrap};
use criterion::{Criterion, Throughput};

use crate::measure::{self, Contender};
use crate::scene::Random;

const SPLATS: usize = 10_000;
const MAP_SIZE: u32 = 1024;

/// Units of a splat's centre and radius in a texel.
const SUBTEXELS: i32 = 256;

fn splats() -> Vec<Splat> {
    let mut random = Random::new();
    let mut coordinate = || {
        let end = MAP_SIZE as i32 * SUBTEXELS;
        (((random.signed() + 1.0) * 0.5 * end as f32) as i32).clamp(0, end - 1)
    };
    let splat = |_| Splat {
        center: [coordinate(), coordinate()],
        radius: [5 * SUBTEXELS; 2],
        water_nl: 4189,
        tick: 1,
        // Brown, half covering; glossy, an eighth covering.
        diffuse: u32::from_le_bytes([23, 14, 8, 128]),
        specular: u32::from_le_bytes([128, 204, 0, 32]),
        bump: 51,
        bump_opacity: 255,
        ..bytemuck::Zeroable::zeroed()
    };
    (0..SPLATS).map(splat).collect()
}

/// Runs the group.
pub fn bench(criterion: &mut Criterion) {
    if !measure::wanted("splat") {
        return;
    }
    let splats = splats();
    let wrap = [Wrap::Repeat; 2];
    let surface =
        Weatherable { map_size: MAP_SIZE, wrap_u: wrap[0], wrap_v: wrap[1], ..Weatherable::default() };
    let mut maps = CpuMaps::new(&surface);
    let paint = || {
        maps.paint(&splats, &StampAtlas::default(), None);
        splats.len()
    };
    let (mut bins, mut headers, mut list) = (TileBins::default(), Vec::new(), Vec::new());
    let bin = || {
        headers.clear();
        list.clear();
        bins.bin_within(usize::MAX, &splats, MAP_SIZE, wrap, None, 0, &mut headers, &mut list);
        list.len()
    };
    let mut contenders = [Contender::new("cpu_paint", paint), Contender::new("tile_bins", bin)];
    let mut group = criterion.benchmark_group("splat");
    group.throughput(Throughput::Elements(SPLATS as u64));
    for contender in &mut contenders {
        contender.bench(&mut group);
    }
    group.finish();
    if measure::measuring() {
        let [paint, bin] = measure::means("splat", "splats (in tiles, if binned)", &mut contenders, 10, 5);
        let nanos = |seconds: f64| seconds * 1e9 / SPLATS as f64;
        println!("splat: {:.0} ns to paint one, {:.0} ns to bin one", nanos(paint), nanos(bin));
        measure::ratio("splat/tile_bins against cpu_paint", bin, paint);
    }
}
