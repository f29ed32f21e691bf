//! What the films of a tile are about to do: looked at, and not touched.
//!
//! Whoever looks at a tile reads the surface as it is before the step and writes down what will be done ([`Block`]). So tiles can be
//! looked at in any order, and by many threads; `run_off` then does it, tile by tile.

use super::drip::DripSite;
use super::evolve::film_left;
use super::geometry::{Link, Side};
use super::now::Now;
use super::surface::SurfaceWater;
use super::texel::Units;
use super::tiles::texel_in;
use crate::matter::{SurfaceMatter, wash};
use crate::overlay::TILE_SIZE;
use crate::weather::Demand;

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

const SIDE: usize = TILE_SIZE as usize;
const TILE_TEXELS: usize = SIDE * SIDE;

/// What some tiles are about to do. Keeps its memory from tick to tick.
#[derive(Debug)]
pub(super) struct Block {
    film_mm: [f32; TILE_TEXELS],
    /// Tile by tile.
    pub(super) steps: Vec<TileStep>,
    /// Texels whose films have dried up.
    pub(super) dried: Vec<u32>,
    pub(super) sheds: Vec<Shed>,
    pub(super) moves: Vec<Move>,
}

/// What one tile is about to do. Its parts of the lists of its block end where it says, and begin where those of the tile before end.
#[derive(Debug, Clone, Copy)]
pub(super) struct TileStep {
    pub(super) tile: u32,
    pub(super) dried: usize,
    pub(super) sheds: usize,
    pub(super) moves: usize,
    /// It has a film that is free to move.
    pub(super) pool: bool,
    /// The part of a texel that the fastest of it moves; none if nothing moves.
    pub(super) fastest: Option<f32>,
}

/// Water from one texel to another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Move {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) units: u32,
    /// Of the film of `from` at its reference time, units that are gone by now.
    pub(super) gone: u32,
    /// Both are well inside one tile.
    pub(super) inside: bool,
    /// Grains that it can carry, by volume, 1/65,536.
    pub(super) load: u16,
}

/// A drop that falls.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shed {
    pub(super) texel: u32,
    pub(super) site: DripSite,
    pub(super) water_nl: u32,
    /// As of a [`Move`].
    pub(super) gone: u32,
}

impl Default for Block {
    fn default() -> Self {
        let film_mm = [0.0; TILE_TEXELS];
        Self { film_mm, steps: Vec::new(), dried: Vec::new(), sheds: Vec::new(), moves: Vec::new() }
    }
}

impl Block {
    /// Empties it for the next step.
    pub(super) fn clear(&mut self) {
        self.steps.clear();
        self.dried.clear();
        self.sheds.clear();
        self.moves.clear();
    }
}

/// Depth of a unit. Kept, since the texels of a triangle have one area.
#[derive(Debug, Clone, Copy)]
pub(super) struct UnitDepth {
    area: f32,
    unit_mm: f64,
}

impl UnitDepth {
    /// None is known yet.
    pub(super) const UNKNOWN: Self = Self { area: f32::NAN, unit_mm: 0.0 };

    /// Depth of a unit on a texel, mm.
    #[inline]
    pub(super) fn on(&mut self, now: &Now, units: Units, texel: u32) -> f64 {
        let area = now.geometry.area_mm2()[texel as usize];
        if area != self.area {
            *self = Self { area, unit_mm: now.geometry.unit_mm(units, texel) };
        }
        self.unit_mm
    }
}

/// Films as they are now, of texels that are not brought to the present for it.
pub(super) struct Films<'a> {
    water: &'a SurfaceWater,
    now: &'a Now<'a>,
    /// The least film that is retained anywhere, mm.
    least: f64,
    unit: UnitDepth,
    /// The reference tick of the texel before, and what has gone by since: many have the same.
    since: u32,
    seconds: f64,
    demand: Demand,
}

impl<'a> Films<'a> {
    pub(super) fn new(water: &'a SurfaceWater, now: &'a Now<'a>) -> Self {
        let least = LEAST_RETAINED * f64::from(now.material.retained_mm);
        let unit = UnitDepth::UNKNOWN;
        Self { water, now, least, unit, since: now.tick, seconds: 0.0, demand: Demand::default() }
    }

    /// The film of a texel, mm. Where less than the least retained film lay at its reference time, that: it cannot run, and
    /// whether it has shrunk since makes no difference to what comes.
    #[inline]
    pub(super) fn of(&mut self, texel: u32) -> f32 {
        let state = &self.water.texels[texel as usize];
        if state.film == 0 {
            return 0.0;
        }
        let now = self.now;
        let unit_mm = self.unit.on(now, self.water.units, texel);
        let stored = f64::from(state.film) * unit_mm;
        if stored <= self.least || state.tick >= now.tick {
            return stored as f32;
        }
        if state.tick != self.since {
            self.since = state.tick;
            self.seconds = f64::from(now.tick - state.tick) / f64::from(now.hz);
            self.demand = now.demand - now.drying.until(state.tick);
        }
        let (air, sun) = now.exposure.map_or((1.0, 0.0), |exposure| exposure.at(texel));
        let pores = f64::from(state.pores) * unit_mm;
        film_left(stored, pores, now.matter, self.seconds, self.demand.at(air, sun)) as f32
    }
}

struct Donor {
    texel: u32,
    local: usize,
    film: f32,
    excess: f32,
    unit_mm: f64,
    /// There are grains to take along.
    dusty: bool,
}

impl Donor {
    /// Of its film at its reference time, units that are gone by now; for those who look at grains.
    fn gone(&self, water: &SurfaceWater) -> u32 {
        if !self.dusty {
            return 0;
        }
        let stored = water.texels[self.texel as usize].film;
        stored - ((f64::from(self.film) / self.unit_mm).round() as u32).min(stored)
    }

    /// Number within its tile of the texel beside it in the image, if that lies in the tile.
    fn beside(&self, side: Side) -> Option<usize> {
        let (x, y) = (self.local % SIDE, self.local / SIDE);
        match side {
            Side::MinusU => (x > 0).then(|| self.local - 1),
            Side::PlusU => (x + 1 < SIDE).then(|| self.local + 1),
            Side::MinusV => (y > 0).then(|| self.local - SIDE),
            Side::PlusV => (y + 1 < SIDE).then(|| self.local + SIDE),
        }
    }

    /// Whether all its neighbours in the image lie in its tile.
    fn is_inside(&self) -> bool {
        Side::ALL.into_iter().all(|side| self.beside(side).is_some())
    }
}

/// Writes down what a tile is about to do in a step of so many seconds.
pub(super) fn look_at(
    water: &SurfaceWater,
    now: &Now,
    matter: Option<&SurfaceMatter>,
    tile: u32,
    seconds: f32,
    block: &mut Block,
) {
    let mut films = Films::new(water, now);
    let corner = texel_in(water.size, tile, 0);
    let texel_at = |local: usize| corner + (local / SIDE) as u32 * water.size + (local % SIDE) as u32;
    for local in 0..TILE_TEXELS {
        let texel = texel_at(local);
        let film = films.of(texel);
        block.film_mm[local] = film;
        if film == 0.0 && water.texels[texel as usize].film > 0 {
            block.dried.push(texel);
        }
    }
    let (before, mut pool, mut fastest) = ((block.sheds.len(), block.moves.len()), false, 0.0f32);
    for local in 0..TILE_TEXELS {
        let film = block.film_mm[local];
        if f64::from(film) <= films.least {
            continue;
        }
        let texel = texel_at(local);
        let excess = film - retained(now, texel);
        if excess <= 0.0 || now.geometry.area_mm2()[texel as usize] <= 0.0 {
            continue;
        }
        pool = true;
        let dusty = matter.is_some_and(|matter| matter.texels()[texel as usize].dust > 0);
        let unit_mm = films.unit.on(now, water.units, texel);
        let donor = Donor { texel, local, film, excess, unit_mm, dusty };
        let first = block.moves.len();
        let (site, speed) = give(&mut films, &donor, seconds, &block.film_mm, &mut block.moves);
        fastest = fastest.max(speed);
        if let Some(site) = site
            && let Some(water_nl) = drop_nl(water, &donor)
        {
            block.sheds.push(Shed { texel, site, water_nl, gone: donor.gone(water) });
            // What drips cannot run, too.
            block.moves.truncate(first);
        }
    }
    let (sheds, moves) = (block.sheds.len(), block.moves.len());
    let fastest = ((sheds, moves) != before).then_some(fastest);
    block.steps.push(TileStep { tile, dried: block.dried.len(), sheds, moves, pool, fastest });
}

/// Writes down what a texel gives to which neighbours. Where there is an end of the mesh below it, or nothing lower while
/// it overhangs, returns where a drop would leave; and the part of a texel that its water moves.
fn give(
    films: &mut Films,
    donor: &Donor,
    seconds: f32,
    in_tile: &[f32; TILE_TEXELS],
    moves: &mut Vec<Move>,
) -> (Option<DripSite>, f32) {
    let (geometry, size) = (films.now.geometry, films.water.size);
    let (heights, areas) = (geometry.height(), geometry.area_mm2());
    let depth = |texel: u32, film: f32| geometry.facing_up(texel).max(0.0) * film;
    let (own_height, own_depth) = (heights[donor.texel as usize], depth(donor.texel, donor.film));
    let lengths = [Side::PlusU, Side::PlusV].map(|side| geometry.distance(donor.texel, side).max(1e-6));
    let is_inside = donor.is_inside();
    let mut out = [(0u32, 0.0f32, false, 0u16); 4];
    let (mut site, mut lower, mut fastest) = (None, false, 0.0f32);
    for (number, side) in Side::ALL.into_iter().enumerate() {
        let distance = lengths[side.axis()];
        match geometry.link(donor.texel, side) {
            Link::Texel(other) => {
                let [columns, rows] = side.offset();
                let in_image = donor.texel.wrapping_add_signed(columns + rows * size as i32);
                // Most neighbours are those in the image, and have been looked at.
                let beside = donor.beside(side).filter(|_| other == in_image);
                let film = beside.map_or_else(|| films.of(other), |local| in_tile[local]);
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
                // Half of what would make both as high; as four may do so at once, a quarter of the drop for texels of one size.
                // What a large one gives is deep on a small one.
                let most =
                    drop_mm * (0.5 / (1.0 + areas[donor.texel as usize] / areas[other as usize])).min(0.25);
                fastest = fastest.max(courant.min(most / donor.excess));
                let load = if donor.dusty { wash::load(speed, sine) } else { 0 };
                let inside = is_inside && beside.is_some();
                out[number] = (other, (courant * donor.excess).min(most), inside, load);
            }
            Link::Edge => {
                let rise = match geometry.link(donor.texel, side.opposite()) {
                    Link::Texel(behind) => heights[behind as usize] - own_height,
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
    let unit_mm = donor.unit_mm as f32;
    let gone = donor.gone(films.water);
    for (to, mm, inside, load) in out {
        let mm = mm * scale;
        let units = (mm / unit_mm) as u32;
        if mm > LEAST_MM_PER_S * seconds && units > 0 {
            moves.push(Move { from: donor.texel, to, units, gone, inside, load });
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

/// How much leaves a texel whose water may leave, whole nanolitres; none while it is no drop yet. A drop is no larger than two of the
/// least, unless more than that stands deeper than an edge can hold: then it is a gush, or the film would grow without end where
/// more arrives than drops can take.
fn drop_nl(water: &SurfaceWater, donor: &Donor) -> Option<u32> {
    let units = |mm: f64| (mm / donor.unit_mm) as u64;
    let held = u64::from(water.texels[donor.texel as usize].film);
    let excess = units(f64::from(donor.excess)).min(held);
    let film = f64::from(donor.film);
    if water.units.mm3(excess) < DROP_MM3 && film < DROP_MM {
        return None;
    }
    let two_drops = (2.0 * DROP_MM3 * 1000.0) as u64;
    let too_deep = water.units.whole_nl(units(film - DROP_MM));
    let nl = water.units.whole_nl(excess).min(two_drops.max(too_deep));
    u32::try_from(nl).ok().filter(|&nl| nl > 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::PorousMaterial;
    use crate::test_random::Random;
    use crate::weather::{DryingClock, Weather};
    use crate::wetting::TexelGeometry;
    use crate::wetting::TexelWater;
    use crate::wetting::test_meshes::{floor, sheet, turned_round};
    use bevy::math::{Affine3A, Vec3};

    #[test]
    fn films_are_those_that_settling_would_find() {
        let mesh = turned_round(sheet(3, floor, |point| point));
        let wrap = [crate::overlay::Wrap::Clamp; 2];
        let geometry = TexelGeometry::new(&mesh, &Affine3A::IDENTITY, Vec3::Y, 32, wrap);
        let mut drying = DryingClock::default();
        for (tick, speed) in [(0, 600.0), (70, 3000.0), (150, 20.0)] {
            drying.change(&Weather { drying_speed: speed, ..Default::default() }, tick, 60);
        }
        let material = PorousMaterial { capacity_mm: 0.4, retained_mm: 0.1, ..Default::default() };
        let now = Now::new(300, 60, &drying, &geometry, None, &material);
        let mut water = SurfaceWater::of_size(32, wrap, geometry.mean_mm2());
        water.wake(false);
        let mut random = Random(7);
        for texel in &mut water.texels {
            let (film, pores, tick) = (random.below(900_000), random.below(400_000), 1 + random.below(300));
            *texel = TexelWater { film, pores, tick, ..Default::default() };
        }
        let mut films = Films::new(&water, &now);
        let (mut dry, mut left) = (0, 0);
        for texel in 0..32 * 32 {
            let state = &water.texels[texel as usize];
            let scale = now.scale(water.units, texel);
            let stored = f64::from(state.film) * scale.unit_mm;
            let exact = now.amounts(&scale, texel, state).film_mm;
            let least = LEAST_RETAINED * f64::from(material.retained_mm);
            let expected = if stored <= least { stored } else { exact };
            assert_eq!(films.of(texel), expected as f32, "{texel} {state:?}");
            dry += u32::from(exact == 0.0);
            left += u32::from(exact > 0.0);
        }
        assert!(dry > 50 && left > 50, "{dry} {left}");
    }
}
