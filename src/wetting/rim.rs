//! How far inside a wet patch a texel lies: the rim dries first.
//!
//! When the rain has stopped and the water stands still, the distance of every wet texel to the nearest dry one is measured
//! over the links of the mesh, up to [`REACH`] texels, and becomes its reserve: what of the weather's demand goes by before
//! its pores dry. Measured once after each shower. The amounts stay as they are, so nothing is seen of it at that moment.

use super::geometry::{Link, Side};
use super::now::Now;
use super::surface::SurfaceWater;
use super::tiles::Tiles;

/// Steps from the rim to where a texel no longer knows of it.
pub const REACH: u32 = 24;

/// Steps from the rim over which it leaves tide marks.
const MARKED: u32 = 8;

/// Seconds without new water after which a shower is over.
pub const SHOWER_SECONDS: f32 = 0.5;

/// Part of what looks fully wet that counts as wet.
const WET_PART: f64 = 0.25;

/// Buffers that keep their memory.
#[derive(Debug, Default)]
pub(crate) struct RimScratch {
    distance: Vec<u8>,
    ring: Vec<u32>,
    next: Vec<u32>,
}

/// Measures the rims if a shower is over; whether it did.
pub(crate) fn measure_rims(water: &mut SurfaceWater, now: &Now, scratch: &mut RimScratch) -> bool {
    let pause = (SHOWER_SECONDS * now.hz as f32) as u32;
    if water.rained_at == 0
        || now.tick < water.rained_at.saturating_add(pause)
        || !water.tiles.running.is_empty()
    {
        return false;
    }
    water.rained_at = 0;
    if now.material.reserve_mm() <= 0.0 {
        return false;
    }
    let RimScratch { distance, ring, next } = scratch;
    const INSIDE: u8 = u8::MAX;
    distance.clear();
    distance.resize(water.texels.len(), 0);
    let least = WET_PART * now.material.seen_mm();
    for texel in 0..water.texels.len() as u32 {
        let state = &water.texels[texel as usize];
        if state.is_dry() {
            continue;
        }
        let amounts = now.amounts(&now.scale(water.units, texel), texel, state);
        if amounts.pores_mm + amounts.film_mm > least {
            distance[texel as usize] = INSIDE;
        }
    }
    // The first ring: wet texels beside dry ones. The end of the mesh is no rim.
    ring.clear();
    let beside = |texel: u32, side: Side| match now.geometry.link(texel, side) {
        Link::Texel(other) => Some(other),
        Link::Edge => None,
    };
    for texel in 0..distance.len() as u32 {
        let is_rim =
            || Side::ALL.iter().any(|&s| beside(texel, s).is_some_and(|o| distance[o as usize] == 0));
        if distance[texel as usize] == INSIDE && is_rim() {
            ring.push(texel);
        }
    }
    for steps in 1..=REACH {
        for &texel in ring.iter() {
            distance[texel as usize] = steps as u8;
        }
        next.clear();
        for &texel in ring.iter() {
            for other in Side::ALL.iter().filter_map(|&side| beside(texel, side)) {
                if distance[other as usize] == INSIDE {
                    distance[other as usize] = steps as u8 + 1;
                    next.push(other);
                }
            }
        }
        std::mem::swap(ring, next);
    }
    for texel in 0..distance.len() as u32 {
        let steps = u32::from(distance[texel as usize]).min(REACH + 1);
        let tile = water.tile_of(texel);
        // Where nothing came, a reserve that has gone by does not come back.
        if steps == 0 || !water.tiles.has(tile, Tiles::RENEWED) {
            continue;
        }
        water.settle(now, texel);
        water.tiles.touch(tile);
        let inside = steps - 1;
        let water = &mut water.texels[texel as usize];
        water.reserve = (inside * 255 / REACH) as u8;
        water.rim = (255 - (inside * 255 / MARKED).min(255)) as u8;
    }
    water.tiles.flags.iter_mut().for_each(|flags| *flags &= !Tiles::RENEWED);
    true
}
