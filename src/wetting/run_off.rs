//! Films that run: along gravity on the real surface, from texel to texel of the mesh.
//!
//! Thin-film (lubrication) flow: a film of depth h on a slope moves at `u = g h² sin b / (3 nu)`, driven by the slope of
//! its *surface*, height plus depth, so that the same law runs down walls, levels out in hollows and fills them. Only what
//! exceeds the retained film moves. Each texel of a busy tile gives to the lower ones among its four neighbours *on the
//! mesh*, which may lie across a uv seam or on a steeper face.
//!
//! Stable for any step and any map: a texel never gives more than it has, nor so much that its neighbour would stand
//! higher than itself. The price is that a film runs at most one texel a step.
//!
//! Moves are whole units: nothing is lost. A tile in which nothing moves goes to rest, and is woken by new water or by a
//! neighbour that begins to drain.
//!
//! Where the mesh ends at a lower edge, or overhangs, water gathers until it is a drop, and leaves as a
//! [drip](super::drip).

use super::drip::{Drip, DripSite};
use super::geometry::{Link, Side};
use super::surface::{Now, SurfaceWater, Tiles};
use crate::overlay::TILE_SIZE;

/// Steps a second, where there are as many ticks.
pub const STEPS_PER_SECOND: u32 = 30;

/// Retained film varies from place to place between these parts of the material's, so that water finds itself runs.
pub const LEAST_RETAINED: f64 = 0.5;
const MOST_RETAINED: f64 = 1.7;

/// Differences of level that surface tension bridges, mm.
const LEVEL_MM: f32 = 0.02;
/// A step moves no less than this, mm: what would creep is at rest.
const LEAST_MOVE_MM: f32 = 5.0e-4;
/// A film on a level edge holds until it is this deep: the capillary length of water, mm.
const EDGE_HOLDS_MM: f32 = 2.73;
/// A drop falls when it is this large, mm³ (a dripping tap: 20 to 50), or so deep, mm.
const DROP_MM3: f64 = 25.0;
const DROP_MM: f64 = 4.0;
/// Water hangs from what looks down more than this.
const OVERHANG: f32 = -0.25;

const TILE_TEXELS: usize = (TILE_SIZE * TILE_SIZE) as usize;

/// Buffers that keep their memory from tick to tick.
#[derive(Debug)]
pub(crate) struct RunScratch {
    film_mm: [f32; TILE_TEXELS],
    moves: Vec<(u32, u32, u32)>,
    tiles: Vec<u32>,
}

impl Default for RunScratch {
    fn default() -> Self {
        Self { film_mm: [0.0; TILE_TEXELS], moves: Vec::new(), tiles: Vec::new() }
    }
}

/// Ticks between two steps of a tile.
pub(crate) fn stride(hz: u32) -> u32 {
    (hz / STEPS_PER_SECOND).max(1)
}

/// Moves what runs in this tick. Tiles take turns like the squares of a chessboard.
pub(crate) fn run_off(
    water: &mut SurfaceWater,
    now: &Now,
    scratch: &mut RunScratch,
    drips: &mut Vec<Drip>,
) -> u32 {
    let stride = stride(now.hz);
    let across = water.size / TILE_SIZE;
    let phase = now.tick % stride;
    let mut due = std::mem::take(&mut scratch.tiles);
    due.clear();
    due.extend(water.tiles.running.iter().copied().filter(|tile| {
        let color = (tile % across + tile / across) % 2;
        color * (stride / 2) == phase
    }));
    due.sort_unstable();
    let seconds = stride as f32 / now.hz as f32;
    for &tile in &due {
        if !step_tile(water, now, tile, seconds, scratch, drips) {
            water.tiles.flags[tile as usize] &= !Tiles::RUNNING;
        }
    }
    if !due.is_empty() {
        let Tiles { running, flags, .. } = &mut water.tiles;
        running.retain(|&tile| flags[tile as usize] & Tiles::RUNNING != 0);
    }
    let count = due.len() as u32;
    scratch.tiles = due;
    count
}

/// One step of one tile; whether anything moved.
fn step_tile(
    water: &mut SurfaceWater,
    now: &Now,
    tile: u32,
    seconds: f32,
    scratch: &mut RunScratch,
    drips: &mut Vec<Drip>,
) -> bool {
    let mut pool = false;
    for local in 0..TILE_TEXELS {
        let texel = texel_in(water.size, tile, local);
        let film = film_now(water, now, texel);
        scratch.film_mm[local] = film;
        if film == 0.0 && water.texels[texel as usize].film > 0 {
            water.settle(now, texel);
        }
    }
    let mut moves = std::mem::take(&mut scratch.moves);
    moves.clear();
    let mut shed = false;
    for local in 0..TILE_TEXELS {
        let film = scratch.film_mm[local];
        let texel = texel_in(water.size, tile, local);
        let excess = film - retained(now, texel);
        if excess <= 0.0 || now.geometry.area_mm2()[texel as usize] <= 0.0 {
            continue;
        }
        let donor = Donor { texel, film, excess };
        pool |= true;
        if let Some(site) = give(water, now, tile, &donor, seconds, &scratch.film_mm, &mut moves) {
            shed |= shed_drop(water, now, &donor, site, drips);
        }
    }
    for &(from, to, units) in &moves {
        carry(water, now, from, to, units);
    }
    let moved = !moves.is_empty() || shed;
    scratch.moves = moves;
    let flags = &mut water.tiles.flags[tile as usize];
    *flags = if pool { *flags | Tiles::POOL } else { *flags & !Tiles::POOL };
    if moved {
        water.tiles.touch(tile);
    }
    moved
}

struct Donor {
    texel: u32,
    film: f32,
    excess: f32,
}

/// Writes down what a texel gives to which neighbours. Where there is an end of the mesh below it, or nothing lower while
/// it overhangs, returns where a drop would leave.
fn give(
    water: &SurfaceWater,
    now: &Now,
    tile: u32,
    donor: &Donor,
    seconds: f32,
    films: &[f32; TILE_TEXELS],
    moves: &mut Vec<(u32, u32, u32)>,
) -> Option<DripSite> {
    let geometry = now.geometry;
    let heights = geometry.height();
    let level =
        |texel: u32, film: f32| heights[texel as usize] * 1000.0 + geometry.facing_up(texel).max(0.0) * film;
    let own_level = level(donor.texel, donor.film);
    let mut out = [(0u32, 0.0f32); 4];
    let mut site = None;
    let mut lower = false;
    for (slot, side) in out.iter_mut().zip(Side::ALL) {
        let distance = geometry.distance(donor.texel, side).max(1e-6);
        match geometry.link(donor.texel, side) {
            Link::Texel(other) => {
                let drop_mm = own_level - level(other, neighbour_film(water, now, tile, other, films));
                if drop_mm <= LEVEL_MM {
                    continue;
                }
                lower = true;
                let courant = speed(donor.film, drop_mm, distance) * seconds / distance;
                *slot = (other, (courant * donor.excess).min(0.25 * drop_mm));
            }
            Link::Edge => {
                let rise = match geometry.link(donor.texel, side.opposite()) {
                    Link::Texel(behind) => heights[behind as usize] - heights[donor.texel as usize],
                    Link::Edge => 0.0,
                };
                if rise > 0.02 * distance || donor.film > EDGE_HOLDS_MM {
                    site = Some(DripSite::Edge(side));
                }
            }
        }
    }
    let sum: f32 = out.iter().map(|(_, mm)| mm).sum();
    let most = 0.9 * donor.excess;
    let scale = if sum > most { most / sum } else { 1.0 };
    let unit_mm = now.scale(water.units, donor.texel).unit_mm as f32;
    for (other, mm) in out {
        let mm = mm * scale;
        if mm > LEAST_MOVE_MM {
            moves.push((donor.texel, other, (mm / unit_mm) as u32));
        }
    }
    if site.is_none() && !lower && geometry.facing_up(donor.texel) < OVERHANG {
        site = Some(DripSite::Overhang);
    }
    site
}

/// Mean speed of a film, m/s: `g h² sin b / (3 nu)`, with nu = 1e-6 m²/s.
fn speed(film_mm: f32, drop_mm: f32, distance: f32) -> f32 {
    let sine = (drop_mm * 1.0e-3 / distance).min(1.0);
    let depth = film_mm * 1.0e-3;
    9.81 * depth * depth * sine / 3.0e-6
}

/// The film that stays on a texel, mm: a little more here, a little less there.
fn retained(now: &Now, texel: u32) -> f32 {
    let hash = texel.wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
    let hash = (hash ^ (hash >> 15)).wrapping_mul(0x85eb_ca6b);
    let part = f64::from(hash >> 8) / f64::from(1u32 << 24);
    now.material.retained_mm * (LEAST_RETAINED + (MOST_RETAINED - LEAST_RETAINED) * part * part) as f32
}

fn texel_in(size: u32, tile: u32, local: usize) -> u32 {
    let across = size / TILE_SIZE;
    let (x, y) = (local as u32 % TILE_SIZE, local as u32 / TILE_SIZE);
    (tile / across * TILE_SIZE + y) * size + tile % across * TILE_SIZE + x
}

/// The film of a texel now, mm, without settling it.
fn film_now(water: &SurfaceWater, now: &Now, texel: u32) -> f32 {
    let state = &water.texels[texel as usize];
    if state.film == 0 {
        return 0.0;
    }
    now.amounts(&now.scale(water.units, texel), texel, state).film_mm as f32
}

fn neighbour_film(water: &SurfaceWater, now: &Now, tile: u32, texel: u32, films: &[f32; TILE_TEXELS]) -> f32 {
    if water.tile_of(texel) == tile {
        let (x, y) = (texel % water.size % TILE_SIZE, texel / water.size % TILE_SIZE);
        return films[(y * TILE_SIZE + x) as usize];
    }
    film_now(water, now, texel)
}

/// Moves water. The donor's reference time stays: its film has not run out since then and does not now, so what it loses
/// can be taken from what it had then. So nothing is rounded while it flows.
fn carry(water: &mut SurfaceWater, now: &Now, from: u32, to: u32, units: u32) {
    let room = u32::MAX - water.texels[to as usize].film;
    let units = units.min(room).min(water.texels[from as usize].film);
    water.texels[from as usize].film -= units;
    if film_now(water, now, to) > 0.0 {
        water.texels[to as usize].film += units;
    } else {
        water.settle(now, to);
        water.texels[to as usize].film += units;
    }
    let (source, target) = (water.tile_of(from), water.tile_of(to));
    water.tiles.touch(target);
    super::soak::note_arrival(water, now, to);
    if source != target && water.tiles.has(target, Tiles::POOL) {
        water.tiles.run(target);
    }
    wake_uphill(water, now, from, source);
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

/// Lets a drop go if there is one.
fn shed_drop(
    water: &mut SurfaceWater,
    now: &Now,
    donor: &Donor,
    site: DripSite,
    drips: &mut Vec<Drip>,
) -> bool {
    let unit_mm = now.scale(water.units, donor.texel).unit_mm;
    let excess =
        ((f64::from(donor.excess) / unit_mm) as u64).min(u64::from(water.texels[donor.texel as usize].film));
    if water.units.mm3(excess) < DROP_MM3 && f64::from(donor.film) < DROP_MM {
        return false;
    }
    let whole = |mm3: f64| (mm3 * 1000.0) as u64;
    let nl = water.units.whole_nl(excess).min(whole(2.0 * DROP_MM3));
    if nl == 0 {
        return false;
    }
    let units = water.units.from_nl(nl);
    water.texels[donor.texel as usize].film -= units as u32;
    water.ledger.dripped += units;
    drips.push(Drip { texel: donor.texel, site, water_nl: nl as u32 });
    true
}
