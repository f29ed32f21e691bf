//! Water that spreads inside the pores.
//!
//! Richards' equation without gravity: `d theta / dt = div(D(theta) grad theta)`, with the diffusivity of building materials
//! `D = 3.8 (S / theta_s)² 1000^(theta/theta_s - 1)` (Hall and Hoff 2012): wet matter gives fast, dry matter takes slowly,
//! so that a patch grows with a sharp front and then stays. Steps are long (half a second), since it is slow; what would
//! move less than can be seen is at rest.
//!
//! Not here: matter below the uppermost layer, and gravity in the pores.

use super::geometry::{Link, Side};
use super::now::Now;
use super::surface::SurfaceWater;
use super::tiles::{Tiles, texel_in};
use crate::overlay::TILE_SIZE;

/// Steps a second.
pub const STEPS_PER_SECOND: u32 = 2;

/// What moves less than this, in parts of what looks fully wet, is at rest.
const LEAST_PART: f64 = 2.0e-3;

/// Buffers that keep their memory from tick to tick.
#[derive(Debug, Default)]
pub(crate) struct SpreadScratch {
    tiles: Vec<u32>,
    moves: Vec<(u32, u32, u32)>,
}

/// Diffusivity in mm²/s at a saturation, of matter with a sorptivity in mm/√min and a pore volume of 0..=1.
pub fn diffusivity(sorptivity: f64, pore_volume: f64, saturation: f64) -> f64 {
    let scale = sorptivity / pore_volume.max(1e-3);
    3.8 * scale * scale * 1000f64.powf(saturation.clamp(0.0, 1.0) - 1.0) / 60.0
}

/// Spreads what is due in this tick; returns how many tiles were visited.
pub(crate) fn spread(water: &mut SurfaceWater, now: &Now, scratch: &mut SpreadScratch) -> u32 {
    let stride = (now.hz / STEPS_PER_SECOND).max(1);
    let phase = now.tick % stride;
    let SpreadScratch { tiles, moves } = scratch;
    tiles.clear();
    // Spread over the ticks, so that none has to do all.
    tiles.extend(water.tiles.spreading.iter().copied().filter(|tile| tile.wrapping_mul(7) % stride == phase));
    if tiles.is_empty() {
        return 0;
    }
    tiles.sort_unstable();
    let seconds = f64::from(stride) / f64::from(now.hz);
    for &tile in tiles.iter() {
        moves.clear();
        let filling = collect_moves(water, now, tile, seconds, moves);
        if moves.is_empty() && !filling {
            water.tiles.flags[tile as usize] &= !Tiles::SPREADING;
            continue;
        }
        for &(from, to, units) in moves.iter() {
            let units = units.min(water.texels[from as usize].pores);
            water.settle(now, to);
            let room = u32::MAX - water.texels[to as usize].pores;
            let units = units.min(room);
            water.texels[from as usize].pores -= units;
            water.pores_give(from, to, units, now.tick);
            water.texels[to as usize].pores += units;
            let target = water.tile_of(to);
            water.tiles.touch(target);
            water.tiles.spread(target);
        }
        water.tiles.touch(tile);
    }
    let Tiles { spreading, flags, .. } = &mut water.tiles;
    Tiles::prune(spreading, flags, Tiles::SPREADING);
    tiles.len() as u32
}

/// What the texels of a tile give to their neighbours, each pair seen from the side that has more. Whether any of them is
/// still filling: then there will be more to give.
fn collect_moves(
    water: &mut SurfaceWater,
    now: &Now,
    tile: u32,
    seconds: f64,
    moves: &mut Vec<(u32, u32, u32)>,
) -> bool {
    let mut filling = false;
    let capacity = now.matter.capacity_mm;
    let least = LEAST_PART * now.material.seen_mm();
    let (sorptivity, pore_volume) = (f64::from(now.material.sorptivity), f64::from(now.material.pore_volume));
    let most = diffusivity(sorptivity, pore_volume, 1.0);
    for local in 0..(TILE_SIZE * TILE_SIZE) as usize {
        let texel = texel_in(water.size, tile, local);
        if water.texels[texel as usize].is_dry() {
            continue;
        }
        let distance = |side| f64::from(now.geometry.distance(texel, side)) * 1000.0;
        let nearest = distance(Side::PlusU).min(distance(Side::PlusV));
        // Marks grow where texels are settled.
        if water.marks.is_empty() && most * seconds * capacity < least * nearest * nearest {
            continue;
        }
        let amounts = water.settle(now, texel);
        // Pores that have no number for more take up no more.
        let room = water.texels[texel as usize].pores < u32::MAX;
        filling |= room && amounts.film_mm > 0.0 && amounts.pores_mm < 0.999 * capacity;
        let own = amounts.pores_mm / capacity;
        if own * capacity < least {
            continue;
        }
        let unit_mm = now.scale(water.units, texel).unit_mm;
        // Nobody takes more than one who is quite dry and yet takes as fast as this one gives.
        let fastest = diffusivity(sorptivity, pore_volume, own);
        if fastest * seconds / (nearest * nearest) * own * capacity < least {
            continue;
        }
        for side in Side::ALL {
            let Link::Texel(other) = now.geometry.link(texel, side) else { continue };
            let state = water.texels[other as usize];
            let theirs = now.amounts(&now.scale(water.units, other), other, &state).pores_mm / capacity;
            let difference = own - theirs;
            if difference * capacity <= least {
                continue;
            }
            let between = 0.5 * (fastest + diffusivity(sorptivity, pore_volume, theirs));
            let distance_mm = distance(side);
            // Less than a quarter of the difference: then four neighbours cannot turn it round.
            let part = (between * seconds / (distance_mm * distance_mm)).min(0.2);
            let mm = part * difference * capacity;
            let units = (mm / unit_mm) as u32;
            if mm > least && units > 0 {
                moves.push((texel, other, units));
            }
        }
    }
    filling
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wet_matter_gives_a_thousand_times_faster_than_dry() {
        let brick = |saturation| diffusivity(2.0, 0.3, saturation);
        assert!((brick(1.0) - 2.815).abs() < 0.01, "{}", brick(1.0));
        assert!((brick(1.0) / brick(0.0) - 1000.0).abs() < 1e-6);
    }
}
