//! Films that run: along gravity on the real surface, from texel to texel of the mesh.
//!
//! Thin-film (lubrication) flow: a film of depth h on a slope moves at `u = g h² sin b / (3 nu)`, driven by the slope of
//! its *surface*, height plus depth, so that the same law runs down walls, levels out in hollows and fills them. Only what
//! exceeds the retained film moves. Each texel of a busy tile gives to the lower ones among its four neighbours *on the
//! mesh*, which may lie across a uv seam or on a steeper face.
//!
//! Stable for any step and any map: a texel never gives more than it has, and to none of its neighbours more than a quarter
//! of what its surface lies higher, or less if the neighbour is smaller. The price is that a film runs at most one texel a step.
//!
//! Tiles take turns like the squares of a chessboard. Those of one colour are all looked at as they are (`flow`), by several threads if
//! there are many; then what they are about to do is done, tile by tile. So it does not matter who looked at which.
//!
//! Moves are whole units: nothing is lost. A tile in which nothing moves goes to rest, and is woken by new water or by a
//! neighbour that begins to drain.
//!
//! Where the mesh ends at a lower edge, or overhangs, water gathers until it is a drop, and leaves as a
//! [drip](super::drip).

use super::drip::Drip;
use super::flow::{Block, Films, LEAST_RETAINED, Move, Shed, TileStep, UnitDepth, look_at};
use super::geometry::{Link, Side};
use super::now::Now;
use super::surface::SurfaceWater;
use super::tiles::Tiles;
use crate::matter::SurfaceMatter;
use crate::matter::wash::{Moved, carry_dust, wash_off};
use crate::overlay::TILE_SIZE;
use crate::particle::for_each_chunk;

/// Steps a second, where there are as many ticks.
pub const STEPS_PER_SECOND: u32 = 30;

/// A tile in which nothing moves faster than this part of a texel a step takes its next step after twice the time; one in
/// which something moves faster than the other, after half of it.
const SLOW: f32 = 0.1;
const FAST: f32 = 0.4;
/// So often can the time be doubled.
pub(super) const MOST_PATIENCE: u8 = 3;

/// Tiles that a thread looks at in one go. One takes some tens of microseconds, about as long as waking a thread.
const BLOCK_TILES: usize = 8;

/// Buffers that keep their memory from tick to tick.
#[derive(Debug, Default)]
pub(crate) struct RunScratch {
    /// Whether several threads may look at tiles. Not while other threads do other surfaces: one that waits for its helpers may be
    /// given another surface meanwhile, which needs these buffers.
    pub(super) has_helpers: bool,
    due: Vec<u32>,
    blocks: Vec<Block>,
}

/// Ticks between two steps of a tile.
pub(crate) fn stride(hz: u32) -> u32 {
    (hz / STEPS_PER_SECOND).max(1)
}

/// Moves what runs in this tick; returns how many tiles took a step.
pub(crate) fn run_off(
    water: &mut SurfaceWater,
    now: &Now,
    scratch: &mut RunScratch,
    drips: &mut Vec<Drip>,
    mut matter: Option<&mut SurfaceMatter>,
) -> u32 {
    let stride = stride(now.hz);
    let across = water.size / TILE_SIZE;
    let (phase, round) = (now.tick % stride, now.tick / stride);
    let color = |tile: u32| (tile % across + tile / across) % 2;
    let RunScratch { has_helpers, due, blocks } = scratch;
    due.clear();
    due.extend(water.tiles.running.iter().copied().filter(|&tile| {
        let patience = water.tiles.patience[tile as usize];
        color(tile) * (stride / 2) == phase && (round + tile) % (1 << patience) == 0
    }));
    if due.is_empty() {
        return 0;
    }
    // Below 60 ticks a second both colours have their turn in one tick.
    due.sort_unstable_by_key(|&tile| (color(tile), tile));
    let (black, white) = due.split_at(due.partition_point(|&tile| color(tile) == 0));
    for tiles in [black, white] {
        let blocks = look_at_all(water, now, matter.as_deref(), tiles, blocks, *has_helpers);
        // Before anything moves: what moves wakes tiles again.
        for step in blocks.iter().flat_map(|block| &block.steps) {
            note_pace(&mut water.tiles, step);
        }
        for block in blocks.iter() {
            do_steps(water, now, block, drips, matter.as_deref_mut());
        }
    }
    let Tiles { running, flags, .. } = &mut water.tiles;
    Tiles::prune(running, flags, Tiles::RUNNING);
    due.len() as u32
}

/// Seconds of the next step of a tile.
fn step_seconds(water: &SurfaceWater, now: &Now, tile: u32) -> f32 {
    (stride(now.hz) << water.tiles.patience[tile as usize]) as f32 / now.hz as f32
}

/// Looks at tiles of one colour; returns the blocks in which it says what they are about to do, in their order.
fn look_at_all<'a>(
    water: &SurfaceWater,
    now: &Now,
    matter: Option<&SurfaceMatter>,
    tiles: &[u32],
    blocks: &'a mut Vec<Block>,
    has_helpers: bool,
) -> &'a [Block] {
    let count = tiles.len().div_ceil(BLOCK_TILES);
    if blocks.len() < count {
        blocks.resize_with(count, Block::default);
    }
    let blocks = &mut blocks[..count];
    let look = |(tiles, block): (&[u32], &mut Block)| {
        block.clear();
        for &tile in tiles {
            look_at(water, now, matter, tile, step_seconds(water, now, tile), block);
        }
    };
    let chunks = tiles.chunks(BLOCK_TILES).zip(blocks.iter_mut());
    if has_helpers {
        for_each_chunk(chunks, look);
    } else {
        chunks.for_each(look);
    }
    blocks
}

/// When a tile takes its next step.
fn note_pace(tiles: &mut Tiles, step: &TileStep) {
    let tile = step.tile as usize;
    let (flags, patience) = (&mut tiles.flags[tile], &mut tiles.patience[tile]);
    *flags = if step.pool { *flags | Tiles::POOL } else { *flags & !Tiles::POOL };
    match step.fastest {
        None => {
            *flags &= !Tiles::RUNNING;
            *patience = 0;
        }
        Some(fastest) if fastest > FAST => *patience = patience.saturating_sub(1),
        Some(fastest) if fastest < SLOW => *patience = (*patience + 1).min(MOST_PATIENCE),
        Some(_) => {}
    }
}

/// Does what the tiles of a block were about to do.
fn do_steps(
    water: &mut SurfaceWater,
    now: &Now,
    block: &Block,
    drips: &mut Vec<Drip>,
    mut matter: Option<&mut SurfaceMatter>,
) {
    let mut unit = UnitDepth::UNKNOWN;
    let (mut dried, mut sheds, mut moves) = (0, 0, 0);
    for step in &block.steps {
        for &texel in &block.dried[dried..step.dried] {
            water.settle(now, texel);
        }
        for shed in &block.sheds[sheds..step.sheds] {
            let_go(water, now, step.tile, shed, drips, matter.as_deref_mut());
        }
        for moved in &block.moves[moves..step.moves] {
            carry(water, now, step.tile, moved, &mut unit, matter.as_deref_mut());
        }
        if step.fastest.is_some() {
            water.tiles.touch(step.tile);
        }
        (dried, sheds, moves) = (step.dried, step.sheds, step.moves);
    }
}

/// Moves water. The donor's reference time stays: its film has not run out since then and does not now, so what it loses
/// can be taken from what it had then. So nothing is rounded while it flows.
fn carry(
    water: &mut SurfaceWater,
    now: &Now,
    tile: u32,
    step: &Move,
    unit: &mut UnitDepth,
    matter: Option<&mut SurfaceMatter>,
) {
    let &Move { from, to, units, gone, inside, load } = step;
    let room = u32::MAX - water.texels[to as usize].film;
    let before = water.texels[from as usize].film;
    let units = units.min(room).min(before);
    water.texels[from as usize].film -= units;
    let film = water.texels[to as usize].film;
    let least = LEAST_RETAINED * f64::from(now.material.retained_mm);
    if film == 0
        || f64::from(film) * unit.on(now, water.units, to) <= least
        || (!inside && Films::new(water, now).of(to) == 0.0)
    {
        // It may have run dry in the meantime; those of the own tile have been looked after.
        water.settle(now, to);
    }
    water.film_goes(from, to, units, now.tick);
    water.texels[to as usize].film += units;
    if let Some(matter) = matter {
        // Grains are in the film that is there now, not in what has been absorbed or has evaporated.
        let film = before.saturating_sub(gone).max(units);
        carry_dust(water, matter, Moved { from, to, units, film, load });
    }
    if inside {
        return;
    }
    let target = water.tile_of(to);
    water.tiles.touch(target);
    super::soak::note_arrival(water, now, to, target);
    if target != tile && water.tiles.has(target, Tiles::POOL) {
        water.tiles.run(target);
    }
    wake_uphill(water, now, from, tile);
}

/// A texel that drains may let its neighbours' water in other tiles go.
fn wake_uphill(water: &mut SurfaceWater, now: &Now, texel: u32, own: u32) {
    for side in Side::ALL {
        if let Link::Texel(other) = now.geometry.link(texel, side) {
            let tile = water.tile_of(other);
            if tile != own && water.tiles.has(tile, Tiles::POOL) {
                water.tiles.run(tile);
            }
        }
    }
}

/// Lets a drop go.
fn let_go(
    water: &mut SurfaceWater,
    now: &Now,
    tile: u32,
    shed: &Shed,
    drips: &mut Vec<Drip>,
    matter: Option<&mut SurfaceMatter>,
) {
    let &Shed { texel, site, water_nl, gone } = shed;
    let before = water.texels[texel as usize].film;
    // It was no more than the film, which has not become less since.
    let units = water.units.from_nl(u64::from(water_nl));
    let taken = u32::try_from(units).unwrap_or(u32::MAX);
    let Some(left) = before.checked_sub(taken) else { return };
    water.texels[texel as usize].film = left;
    let soil_nl = matter
        .map_or(0, |matter| wash_off(water, matter, texel, water_nl, before.saturating_sub(gone).max(taken)));
    water.ledger.dripped += units;
    drips.push(Drip { texel, site, water_nl, soil_nl });
    wake_uphill(water, now, texel, tile);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::PorousMaterial;
    use crate::overlay::Wrap;
    use crate::weather::{DryingClock, Weather};
    use crate::wetting::TexelGeometry;
    use crate::wetting::test_meshes::{floor, sheet, turned_round};
    use bevy::math::{Affine3A, Vec2, Vec3};
    use bevy::tasks::ComputeTaskPool;

    const HZ: u32 = 60;
    const WRAP: [Wrap; 2] = [Wrap::Clamp; 2];

    /// A glazed square that falls by so much along v, and its water.
    struct Slope {
        geometry: TexelGeometry,
        material: PorousMaterial,
        drying: DryingClock,
        water: SurfaceWater,
        scratch: RunScratch,
        drips: Vec<Drip>,
    }

    impl Slope {
        fn new(size: u32, side: f32, fall: f32) -> Self {
            let place = |point| (floor(point) - Vec3::Y * fall * point.y) * side;
            let mesh = turned_round(sheet(2, place, |point| point));
            let geometry = TexelGeometry::new(&mesh, &Affine3A::IDENTITY, Vec3::Y, size, WRAP);
            let mut water = SurfaceWater::of_size(size, WRAP, geometry.mean_mm2());
            water.wake(false);
            let mut drying = DryingClock::default();
            drying.change(&Weather { drying_speed: 30.0, ..Default::default() }, 0, HZ);
            let material = PorousMaterial { capacity_mm: 0.0, retained_mm: 0.04, ..Default::default() };
            let (scratch, drips) = (RunScratch::default(), Vec::new());
            Self { geometry, material, drying, water, scratch, drips }
        }

        fn film_mm(&self, texel: u32) -> f64 {
            f64::from(self.water.texels[texel as usize].film) * self.geometry.unit_mm(self.water.units, texel)
        }

        fn step(&mut self, tick: u32, poured: &[(u32, u64)]) {
            let now = Now::new(tick, HZ, &self.drying, &self.geometry, None, &self.material);
            for &(texel, nl) in poured {
                let units = self.water.units.from_nl(nl);
                let tile = self.water.add(&now, texel, units);
                crate::wetting::note_arrival(&mut self.water, &now, texel, tile);
                self.water.ledger.received += units;
            }
            run_off(&mut self.water, &now, &mut self.scratch, &mut self.drips, None);
            let ledger = self.water.ledger;
            let held: u64 = self.water.texels.iter().map(|texel| texel.total()).sum();
            assert_eq!(ledger.received, held + ledger.evaporated + ledger.dripped + ledger.spilled);
        }
    }

    #[test]
    fn it_does_not_matter_how_many_threads_look() {
        ComputeTaskPool::get_or_init(Default::default);
        let end_with = |has_helpers: bool| {
            let mut slope = Slope::new(128, 0.5, 0.6);
            slope.scratch.has_helpers = has_helpers;
            slope.water.cover(&slope.geometry, 0.12, 0.0, 1);
            for tick in 1..=240 {
                let poured: Vec<(u32, u64)> =
                    (0..40).map(|number| ((tick * 7919 + number * 4637) % (128 * 128), 20_000)).collect();
                slope.step(tick, &poured);
            }
            assert!(slope.drips.len() > 10, "{}", slope.drips.len());
            slope
        };
        let (one, many) = (end_with(false), end_with(true));
        assert_eq!(one.water.texels, many.water.texels);
        assert_eq!(one.drips, many.drips);
        assert_eq!((one.water.ledger, &one.water.tiles.flags), (many.water.ledger, &many.water.tiles.flags));
        assert_eq!(one.water.tiles.running, many.water.tiles.running);
    }

    #[test]
    fn an_edge_lets_go_of_as_much_as_comes() {
        // Texels of a decimetre: six litres a second come to one of the lowest, far more than drops could take.
        let mut slope = Slope::new(16, 1.6, 0.5);
        let lowest = 15 * 16 + 8;
        let mut deepest = 0.0f64;
        for tick in 1..=240 {
            slope.step(tick, &[(lowest, 100_000_000)]);
            deepest = deepest.max(slope.film_mm(lowest));
        }
        // Two ticks bring less than 20 mm.
        assert!(deepest < 30.0, "{deepest} mm stand at an edge");
        assert!(slope.water.ledger.dripped > slope.water.ledger.received * 9 / 10);
    }

    #[test]
    fn what_large_texels_give_does_not_stand_higher_on_small_ones() {
        // Half of a floor has 30 of 32 columns, the other half two: its texels are 15 times as large.
        let on_map = |point: Vec2| {
            let u = if point.x <= 0.5 { point.x * 1.875 } else { 0.9375 + (point.x - 0.5) * 0.125 };
            Vec2::new(u, point.y)
        };
        let mesh = turned_round(sheet(2, |point| floor(point) * 0.32, on_map));
        let mut slope = Slope::new(32, 0.32, 0.0);
        slope.geometry = TexelGeometry::new(&mesh, &Affine3A::IDENTITY, Vec3::Y, 32, WRAP);
        slope.water = SurfaceWater::of_size(32, WRAP, slope.geometry.mean_mm2());
        slope.water.wake(false);
        let area = |texel: u32| slope.geometry.area_mm2()[texel as usize];
        assert!(area(31) > 14.0 * area(0), "{} {}", area(31), area(0));
        let deep: Vec<(u32, u64)> = (0..32 * 32)
            .filter(|texel| texel % 32 >= 30)
            .map(|texel| (texel, (2500.0 * area(texel)) as u64))
            .collect();
        slope.step(1, &deep);
        for tick in 2..=10 * HZ {
            slope.step(tick, &[]);
            let deepest = (0..32 * 32).map(|texel| slope.film_mm(texel)).fold(0.0, f64::max);
            assert!(deepest < 2.51, "tick {tick}: {deepest} mm");
        }
        let reached = [29, 25, 20].map(|texel| slope.film_mm(texel));
        assert!(reached[0] > 0.2, "it has not run: {reached:?}");
    }

    #[test]
    fn a_drop_that_falls_wakes_what_stands_beside_it() {
        let mut slope = Slope::new(32, 0.32, 0.0);
        slope.water.cover(&slope.geometry, 2.0, 0.0, 1);
        // All is at rest, but for the tile of one deep texel at the edge, beside the next tile.
        let edge = 31 * 32 + 15;
        let (own, next) = (slope.water.tile_of(edge), slope.water.tile_of(edge + 1));
        let tiles = &mut slope.water.tiles;
        for tile in 0..tiles.flags.len() {
            tiles.flags[tile] = (tiles.flags[tile] & !Tiles::RUNNING) | Tiles::POOL;
        }
        tiles.running.clear();
        tiles.run(own);
        let unit_mm = slope.geometry.unit_mm(slope.water.units, edge);
        let more = (2.0 / unit_mm) as u32;
        slope.water.texels[edge as usize].film += more;
        slope.water.ledger.received += u64::from(more);
        // Own is of the second colour: its turn is in odd ticks.
        slope.step(3, &[]);
        assert_eq!(slope.drips.len(), 1, "{:?}", slope.drips);
        assert!(slope.water.tiles.has(next, Tiles::RUNNING));
    }

    #[test]
    fn a_tile_that_rests_is_woken_by_what_another_gives_it_in_the_same_step() {
        // Both are due: a wall drains into a floor on which nothing moves yet. Water crosses the border, and goes on.
        for hz in [10, 30, 60, 144] {
            let mut slope = Slope::new(32, 0.32, 1.0);
            for tick in 1..=20 * hz {
                let now = Now::new(tick, hz, &slope.drying, &slope.geometry, None, &slope.material);
                if tick == 1 {
                    for column in 0..32 {
                        let units = slope.water.units.from_nl(600_000);
                        let tile = slope.water.add(&now, column, units);
                        crate::wetting::note_arrival(&mut slope.water, &now, column, tile);
                        slope.water.ledger.received += units;
                    }
                }
                run_off(&mut slope.water, &now, &mut slope.scratch, &mut slope.drips, None);
            }
            let rows = |from: u32, to: u32| {
                (from * 32..to * 32).map(|texel| slope.water.texels[texel as usize].total()).sum::<u64>()
            };
            assert!(rows(16, 32) + slope.water.ledger.dripped > rows(0, 16), "{hz}");
            let ledger = slope.water.ledger;
            assert_eq!(ledger.received, rows(0, 32) + ledger.evaporated + ledger.dripped + ledger.spilled);
        }
    }
}
