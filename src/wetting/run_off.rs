//! Films that run: along gravity on the real surface, from texel to texel of the mesh.
//!
//! Thin-film (lubrication) flow: a film of depth h on a slope moves at `u = g h² sin b / (3 nu)`, driven by the slope of
//! its *surface*, height plus depth, so that the same law runs down walls, levels out in hollows and fills them. Only what
//! exceeds the retained film moves. Each texel of a busy tile gives to the lower ones among its four neighbours *on the
//! mesh*, which may lie across a uv seam or on a steeper face.
//!
//! Stable for any step and any map: a texel never gives more than it has, and to none of its neighbours more than a quarter
//! of what its surface lies higher. The price is that a film runs at most one texel a step.
//!
//! Moves are whole units: nothing is lost. A tile in which nothing moves goes to rest, and is woken by new water or by a
//! neighbour that begins to drain.
//!
//! Where the mesh ends at a lower edge, or overhangs, water gathers until it is a drop, and leaves as a
//! [drip](super::drip).

use super::drip::{Drip, DripSite};
use super::geometry::{Link, Side};
use super::surface::{Now, SurfaceWater, Tiles, texel_in};
use crate::matter::SurfaceMatter;
use crate::matter::wash::{self, Moved, carry_dust, wash_off};
use crate::overlay::TILE_SIZE;

/// Steps a second, where there are as many ticks.
pub const STEPS_PER_SECOND: u32 = 30;

/// Retained film varies from place to place between these parts of the material's, so that water finds itself runs.
pub const LEAST_RETAINED: f64 = 0.5;
const MOST_RETAINED: f64 = 1.7;

/// Differences of depth that surface tension bridges, mm: on level ground, films this uneven lie still.
const BRIDGED_MM: f32 = 0.1;
/// Water runs where its surface falls by more than this to the next texel, mm.
const LEVEL_MM: f32 = 0.01;
/// Nothing moves slower than this, mm of film a second: what would creep is at rest.
const LEAST_MM_PER_S: f32 = 4.0e-3;
/// A film on a level edge holds until it is this deep: the capillary length of water, mm.
const EDGE_HOLDS_MM: f32 = 2.73;
/// A drop falls when it is this large, mm³ (a dripping tap: 20 to 50), or so deep, mm.
const DROP_MM3: f64 = 25.0;
const DROP_MM: f64 = 4.0;
/// Water hangs from what looks down more than this.
const OVERHANG: f32 = -0.25;

const TILE_TEXELS: usize = (TILE_SIZE * TILE_SIZE) as usize;

/// A tile in which nothing moves faster than this part of a texel a step takes its next step after twice the time; one in
/// which something moves faster than the other, after half of it.
const SLOW: f32 = 0.1;
const FAST: f32 = 0.4;
/// So often can the time be doubled.
pub(super) const MOST_PATIENCE: u8 = 3;

/// Buffers that keep their memory from tick to tick.
#[derive(Debug)]
pub(crate) struct RunScratch {
    film_mm: [f32; TILE_TEXELS],
    moves: Vec<Move>,
    tiles: Vec<u32>,
}

/// Water from one texel to another.
#[derive(Debug, Clone, Copy)]
struct Move {
    from: u32,
    to: u32,
    units: u32,
    /// Both are well inside one tile.
    inside: bool,
    /// Grains that it can carry, by volume, 1/65,536.
    load: u16,
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

/// Moves what runs in this tick; returns how many tiles took a step. Tiles take turns like the squares of a chessboard.
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
    let mut due = std::mem::take(&mut scratch.tiles);
    due.clear();
    due.extend(water.tiles.running.iter().copied().filter(|&tile| {
        let color = (tile % across + tile / across) % 2;
        let patience = water.tiles.patience[tile as usize];
        color * (stride / 2) == phase && (round + tile) % (1 << patience) == 0
    }));
    due.sort_unstable();
    for &tile in &due {
        let patience = water.tiles.patience[tile as usize];
        let seconds = (stride << patience) as f32 / now.hz as f32;
        match step_tile(water, now, tile, seconds, scratch, drips, matter.as_deref_mut()) {
            None => {
                water.tiles.flags[tile as usize] &= !Tiles::RUNNING;
                water.tiles.patience[tile as usize] = 0;
            }
            Some(fastest) => {
                let patience = if fastest > FAST {
                    patience.saturating_sub(1)
                } else if fastest < SLOW {
                    (patience + 1).min(MOST_PATIENCE)
                } else {
                    patience
                };
                water.tiles.patience[tile as usize] = patience;
            }
        }
    }
    if !due.is_empty() {
        let Tiles { running, flags, .. } = &mut water.tiles;
        Tiles::prune(running, flags, Tiles::RUNNING);
    }
    let count = due.len() as u32;
    scratch.tiles = due;
    count
}

/// One step of one tile. The part of a texel that the fastest of it moved; none if nothing moved.
fn step_tile(
    water: &mut SurfaceWater,
    now: &Now,
    tile: u32,
    seconds: f32,
    scratch: &mut RunScratch,
    drips: &mut Vec<Drip>,
    mut matter: Option<&mut SurfaceMatter>,
) -> Option<f32> {
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
    let (mut shed, mut pool, mut fastest) = (false, false, 0.0f32);
    for local in 0..TILE_TEXELS {
        let film = scratch.film_mm[local];
        if f64::from(film) <= LEAST_RETAINED * f64::from(now.material.retained_mm) {
            continue;
        }
        let texel = texel_in(water.size, tile, local);
        let excess = film - retained(now, texel);
        if excess <= 0.0 || now.geometry.area_mm2()[texel as usize] <= 0.0 {
            continue;
        }
        let dusty = matter.as_deref().is_some_and(|matter| matter.texels()[texel as usize].dust > 0);
        let donor = Donor { texel, local, tile, film, excess, dusty };
        pool = true;
        let first = moves.len();
        let (site, speed) = give(water, now, &donor, seconds, &scratch.film_mm, &mut moves);
        fastest = fastest.max(speed);
        if let Some(site) = site
            && shed_drop(water, now, &donor, site, drips, matter.as_deref_mut())
        {
            shed = true;
            // What has dripped cannot run, too.
            moves.truncate(first);
        }
    }
    for step in &moves {
        carry(water, now, tile, step, matter.as_deref_mut());
    }
    let moved = !moves.is_empty() || shed;
    scratch.moves = moves;
    let flags = &mut water.tiles.flags[tile as usize];
    *flags = if pool { *flags | Tiles::POOL } else { *flags & !Tiles::POOL };
    if moved {
        water.tiles.touch(tile);
    }
    moved.then_some(fastest)
}

struct Donor {
    texel: u32,
    local: usize,
    tile: u32,
    film: f32,
    excess: f32,
    /// There are grains to take along.
    dusty: bool,
}

impl Donor {
    /// Whether all its neighbours in the image lie in its tile.
    fn is_inside(&self) -> bool {
        const LAST: usize = TILE_SIZE as usize - 1;
        let (x, y) = (self.local % TILE_SIZE as usize, self.local / TILE_SIZE as usize);
        x > 0 && x < LAST && y > 0 && y < LAST
    }
}

/// Writes down what a texel gives to which neighbours. Where there is an end of the mesh below it, or nothing lower while
/// it overhangs, returns where a drop would leave; and the part of a texel that its water moves.
fn give(
    water: &SurfaceWater,
    now: &Now,
    donor: &Donor,
    seconds: f32,
    films: &[f32; TILE_TEXELS],
    moves: &mut Vec<Move>,
) -> (Option<DripSite>, f32) {
    let geometry = now.geometry;
    let heights = geometry.height();
    let depth = |texel: u32, film: f32| geometry.facing_up(texel).max(0.0) * film;
    let (own_height, own_depth) = (heights[donor.texel as usize], depth(donor.texel, donor.film));
    let is_inside = donor.is_inside();
    let beside = [
        donor.local.wrapping_sub(1),
        donor.local + 1,
        donor.local.wrapping_sub(TILE_SIZE as usize),
        donor.local + TILE_SIZE as usize,
    ];
    let mut out = [(0u32, 0.0f32, false, 0u16); 4];
    let (mut site, mut lower, mut fastest) = (None, false, 0.0f32);
    for (number, side) in Side::ALL.into_iter().enumerate() {
        let distance = geometry.distance(donor.texel, side).max(1e-6);
        match geometry.link(donor.texel, side) {
            Link::Texel(other) => {
                // Most neighbours are those in the image.
                let inside = is_inside && texel_in(water.size, donor.tile, beside[number]) == other;
                let film = if inside { films[beside[number]] } else { film_now(water, now, other) };
                let deeper = own_depth - depth(other, film);
                let deeper = deeper - deeper.clamp(-BRIDGED_MM, BRIDGED_MM);
                let drop_mm = (own_height - heights[other as usize]) * 1000.0 + deeper;
                if drop_mm <= LEVEL_MM {
                    continue;
                }
                lower = true;
                let sine = (drop_mm * 1.0e-3 / distance).min(1.0);
                let speed = speed(donor.film, sine);
                let courant = speed * seconds / distance;
                fastest = fastest.max(courant.min(0.25 * drop_mm / donor.excess));
                let load = if donor.dusty { wash::load(speed, sine) } else { 0 };
                out[number] = (other, (courant * donor.excess).min(0.25 * drop_mm), inside, load);
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
    let sum: f32 = out.iter().map(|(_, mm, ..)| mm).sum();
    let most = 0.9 * donor.excess;
    let scale = if sum > most { most / sum } else { 1.0 };
    let unit_mm = now.scale(water.units, donor.texel).unit_mm as f32;
    for (to, mm, inside, load) in out {
        let mm = mm * scale;
        let units = (mm / unit_mm) as u32;
        if mm > LEAST_MM_PER_S * seconds && units > 0 {
            moves.push(Move { from: donor.texel, to, units, inside, load });
        }
    }
    if site.is_none() && !lower && geometry.facing_up(donor.texel) < OVERHANG {
        site = Some(DripSite::Overhang);
    }
    (site, fastest)
}

/// Mean speed of a film, m/s: `g h² sin b / (3 nu)`, with nu = 1e-6 m²/s.
fn speed(film_mm: f32, sine: f32) -> f32 {
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

/// The film of a texel now, mm, without settling it. Where less than the least retained film lay at its reference time,
/// that: it cannot run, and whether it has shrunk since makes no difference to what comes.
fn film_now(water: &SurfaceWater, now: &Now, texel: u32) -> f32 {
    let state = &water.texels[texel as usize];
    if state.film == 0 {
        return 0.0;
    }
    let scale = now.scale(water.units, texel);
    let stored = f64::from(state.film) * scale.unit_mm;
    if stored <= LEAST_RETAINED * f64::from(now.material.retained_mm) || state.tick == now.tick {
        return stored as f32;
    }
    now.amounts(&scale, texel, state).film_mm as f32
}

/// Moves water. The donor's reference time stays: its film has not run out since then and does not now, so what it loses
/// can be taken from what it had then. So nothing is rounded while it flows.
fn carry(water: &mut SurfaceWater, now: &Now, tile: u32, step: &Move, matter: Option<&mut SurfaceMatter>) {
    let &Move { from, to, units, inside, load } = step;
    let room = u32::MAX - water.texels[to as usize].film;
    let before = water.texels[from as usize].film;
    let units = units.min(room).min(before);
    water.texels[from as usize].film -= units;
    let film = water.texels[to as usize].film;
    let least = LEAST_RETAINED * f64::from(now.material.retained_mm);
    if film == 0
        || f64::from(film) * now.scale(water.units, to).unit_mm <= least
        || (!inside && film_now(water, now, to) == 0.0)
    {
        // It may have run dry in the meantime; those of the own tile have been looked after.
        water.settle(now, to);
    }
    water.film_goes(from, to, units, now.tick);
    water.texels[to as usize].film += units;
    if let Some(matter) = matter {
        carry_dust(water, matter, Moved { from, to, units, film: before, load });
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

/// Lets a drop go if there is one.
fn shed_drop(
    water: &mut SurfaceWater,
    now: &Now,
    donor: &Donor,
    site: DripSite,
    drips: &mut Vec<Drip>,
    matter: Option<&mut SurfaceMatter>,
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
    let before = water.texels[donor.texel as usize].film;
    water.texels[donor.texel as usize].film -= units as u32;
    if let Some(matter) = matter {
        wash_off(water, matter, donor.texel, units, before);
    }
    water.ledger.dripped += units;
    drips.push(Drip { texel: donor.texel, site, water_nl: nl as u32 });
    true
}
