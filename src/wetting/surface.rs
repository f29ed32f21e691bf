//! The water of one surface: its texels, and what has become of it.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::evolve::Amounts;
use super::look::WaterLook;
use super::now::Now;
use super::origin::Origins;
use super::texel::{TexelWater, Units};
use super::tiles::{Tiles, tile_at};
use super::{Marks, TexelGeometry};
use crate::emitter::Source;
use crate::overlay::{TILE_SIZE, Weatherable, Wrap};

/// All water in and on a surface. Beside [`Weatherable`](crate::overlay::Weatherable); empty until the first water comes.
#[derive(Component, Debug, Clone)]
pub struct SurfaceWater {
    /// Texels along each side.
    pub(crate) size: u32,
    pub(crate) wrap: [Wrap; 2],
    pub(crate) units: Units,
    /// Row by row; empty while it has never been wet.
    pub(crate) texels: Vec<TexelWater>,
    /// What drying left behind; empty unless the material asks for it.
    pub(crate) marks: Vec<Marks>,
    pub(crate) tiles: Tiles,
    pub(crate) ledger: Ledger,
    /// Tick of the last water from outside; 0 for none since the rim was measured.
    pub(crate) rained_at: u32,
    /// Whether matter lies on it that a film binds when it dries up.
    pub(crate) notes_dried: bool,
    /// If so: texels whose film has dried up, until [`matter`](crate::matter) takes note.
    pub(crate) dried: Vec<u32>,
    /// Where its water came from; empty unless somebody asks.
    pub(crate) origins: Origins,
}

/// What has become of the water of a surface; units.
///
/// `received + painted` is the water in and on it, `evaporated`, `dripped`, `spilled` and `wiped`. To the unit.
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Ledger {
    /// Came with particles.
    pub received: u64,
    /// Evaporated, as far as it is booked: what evaporates at rest is booked when a texel is next touched.
    pub evaporated: u64,
    /// Left as drips.
    pub dripped: u64,
    /// Ran off beyond what a texel can hold.
    pub spilled: u64,
    /// Came by a [brush](crate::brush).
    #[serde(default)]
    pub painted: u64,
    /// Taken away by a brush.
    #[serde(default)]
    pub wiped: u64,
}

impl SurfaceWater {
    /// Dry maps for a surface, as large as it allows, whose texels have this mean area, mm².
    pub fn new(surface: &Weatherable, mean_mm2: f32) -> Self {
        Self::of_size(surface.texels(), surface.wrap(), mean_mm2)
    }

    /// Dry maps with so many texels along each side, of this mean area, mm², and these edges.
    pub fn of_size(size: u32, wrap: [Wrap; 2], mean_mm2: f32) -> Self {
        Self {
            size,
            wrap,
            units: Units::for_area(mean_mm2),
            texels: Vec::new(),
            marks: Vec::new(),
            tiles: Tiles::default(),
            ledger: Ledger::default(),
            rained_at: 0,
            notes_dried: false,
            dried: Vec::new(),
            origins: Origins::default(),
        }
    }

    /// As it was saved. `tiles`: flags and patience of each.
    pub(crate) fn from_saved(
        size: u32,
        shift: u32,
        texels: Vec<TexelWater>,
        marks: Vec<Marks>,
        tiles: &[(u8, u8)],
        ledger: Ledger,
        rained_at: u32,
    ) -> Self {
        let mut water = Self::new(&Weatherable { map_size: size, ..default() }, 1.0);
        water.units = Units { shift: shift.min(Units::MAX_SHIFT) };
        (water.texels, water.marks, water.ledger, water.rained_at) = (texels, marks, ledger, rained_at);
        water.tiles.flags = vec![0; tiles.len()];
        water.tiles.patience =
            tiles.iter().map(|&(_, patience)| patience.min(super::run_off::MOST_PATIENCE)).collect();
        for (tile, &(flags, _)) in tiles.iter().enumerate() {
            let tile = tile as u32;
            let set = |flag: u8| flags & flag != 0;
            if set(Tiles::RUNNING) {
                water.tiles.run(tile);
            }
            if set(Tiles::SPREADING) {
                water.tiles.spread(tile);
            }
            if set(Tiles::WET) {
                water.tiles.touch(tile);
            }
            water.tiles.flags[tile as usize] |= flags & (Tiles::POOL | Tiles::RENEWED);
        }
        water
    }

    /// Flags and patience of each tile, but for what is only about drawing.
    pub(crate) fn tile_states(&self) -> impl Iterator<Item = (u8, u8)> {
        let flags = self.tiles.flags.iter().map(|flags| flags & !Tiles::DIRTY);
        flags.zip(self.tiles.patience.iter().copied())
    }

    /// Texels along each side.
    pub fn size(&self) -> u32 {
        self.size
    }

    /// The texels, row by row; empty while it has never been wet.
    pub fn texels(&self) -> &[TexelWater] {
        &self.texels
    }

    /// What drying left behind, row by row; empty unless the material asks for it.
    pub fn marks(&self) -> &[Marks] {
        &self.marks
    }

    /// What a unit of its volumes is.
    pub fn units(&self) -> Units {
        self.units
    }

    /// What has become of its water.
    pub fn ledger(&self) -> Ledger {
        self.ledger
    }

    /// Whether nothing runs or spreads: then it costs nothing.
    pub fn is_at_rest(&self) -> bool {
        self.tiles.running.is_empty() && self.tiles.spreading.is_empty()
    }

    /// Whether water has ever come.
    pub fn is_wet(&self) -> bool {
        !self.texels.is_empty()
    }

    /// Bytes it holds: state, and flags of tiles.
    pub fn bytes(&self) -> usize {
        self.texels.capacity() * size_of::<TexelWater>()
            + self.marks.capacity() * size_of::<Marks>()
            + 2 * self.tiles.flags.capacity()
            + self.origins.bytes()
    }

    /// Covers all of the surface with water, beside what it has: film and absorbed, mm. It has been there for so long that
    /// it is seen at once.
    pub fn cover(&mut self, geometry: &TexelGeometry, film_mm: f32, absorbed_mm: f32, tick: u32) {
        self.wake(false);
        let tick = tick.max(1);
        for texel in 0..self.texels.len() as u32 {
            let area = geometry.area_mm2()[texel as usize];
            if area <= 0.0 {
                continue;
            }
            let units = |mm: f32| (f64::from(mm.max(0.0)) / self.units.mm_on(area)).round() as u32;
            let water = &mut self.texels[texel as usize];
            let before = water.total();
            water.film = water.film.saturating_add(units(film_mm));
            water.pores = water.pores.saturating_add(units(absorbed_mm));
            (water.tick, water.shown, water.filmed) = (tick, u8::MAX, u8::MAX);
            self.ledger.received += water.total() - before;
        }
        for tile in 0..self.tiles.flags.len() as u32 {
            self.tiles.touch(tile);
            self.tiles.renew(tile);
            self.tiles.run(tile);
            self.tiles.spread(tile);
        }
        self.rained_at = tick;
    }

    /// Makes room for the first water.
    pub(crate) fn wake(&mut self, marks: bool) {
        if self.texels.is_empty() {
            self.texels = vec![TexelWater::default(); (self.size * self.size) as usize];
            self.tiles.flags = vec![0; (self.size / TILE_SIZE).pow(2) as usize];
            self.tiles.patience = self.tiles.flags.clone();
        }
        self.make_room_for_origins();
        if marks && self.marks.is_empty() {
            self.marks = vec![Marks::default(); self.texels.len()];
        }
    }

    /// Dry again, as on the first day.
    pub(crate) fn reset(&mut self) {
        self.texels.clear();
        self.marks.clear();
        self.tiles = Tiles::default();
        self.ledger = Ledger::default();
        self.rained_at = 0;
        self.notes_dried = false;
        self.dried.clear();
        self.make_room_for_origins();
    }

    /// The tile of a texel.
    pub(crate) fn tile_of(&self, texel: u32) -> u32 {
        let (x, y) = (texel % self.size, texel / self.size);
        tile_at(self.size, x, y)
    }

    /// Brings a texel to the present and returns what it holds.
    pub(crate) fn settle(&mut self, now: &Now, texel: u32) -> Amounts {
        let scale = now.scale(self.units, texel);
        let water = &mut self.texels[texel as usize];
        if water.tick >= now.tick {
            return scale.amounts(water);
        }
        if water.is_dry() {
            *water = TexelWater { tick: now.tick, ..default() };
            return Amounts::default();
        }
        let amounts = now.amounts(&scale, texel, water);
        let look = now.look(&amounts, water);
        let (pores_before, had_film) = (scale.amounts(water).pores_mm, water.film > 0);
        self.ledger.evaporated += scale.commit(water, amounts, look, now.tick, jitter(texel, now.tick));
        if self.notes_dried && had_film && water.film == 0 {
            self.dried.push(texel);
        }
        if let Some(marks) = self.marks.get_mut(texel as usize) {
            let left = amounts.film_mm + amounts.pores_mm;
            marks.grow(now.material, pores_before - left, water.rim);
        }
        amounts
    }

    /// Brings all texels to the present, before something changes that their past depended on.
    pub(crate) fn settle_all(&mut self, now: &Now) {
        for texel in 0..self.texels.len() as u32 {
            if !self.texels[texel as usize].is_dry() {
                self.settle(now, texel);
                let tile = self.tile_of(texel);
                self.tiles.touch(tile);
            }
        }
    }

    /// Adds water to a texel, now; returns its tile. What does not fit is spilled.
    pub(crate) fn add(&mut self, now: &Now, texel: u32, units: u64) -> u32 {
        // Under a shower most texels have been brought to the present by the drop before.
        if self.texels[texel as usize].tick < now.tick {
            self.settle(now, texel);
        }
        let tile = self.tile_of(texel);
        if self.origins.is_kept() && self.texels[texel as usize].is_dry() {
            self.origins.begin(texel, Source::UNKNOWN, now.tick);
        }
        let water = &mut self.texels[texel as usize];
        let room = u64::from(u32::MAX - water.film);
        let added = units.min(room);
        water.film += added as u32;
        self.ledger.spilled += units - added;
        self.tiles.touch(tile);
        tile
    }

    /// Film and absorbed water of all texels now, and what has evaporated by now; units.
    pub(crate) fn stock(&self, now: &Now) -> Stock {
        let mut stock = Stock { evaporated: self.ledger.evaporated, ..default() };
        for (texel, water) in self.texels.iter().enumerate().filter(|(_, water)| !water.is_dry()) {
            let scale = now.scale(self.units, texel as u32);
            let mut copy = *water;
            let amounts = now.amounts(&scale, texel as u32, water);
            if copy.tick < now.tick {
                stock.evaporated += scale.commit(&mut copy, amounts, WaterLook::default(), now.tick, 0.0);
            }
            stock.film += u64::from(copy.film);
            stock.pores += u64::from(copy.pores);
        }
        stock
    }
}

/// An even number in [0, 1) for a texel at a tick.
pub(crate) fn jitter(texel: u32, tick: u32) -> f64 {
    let hash = (texel.wrapping_mul(0x9e37_79b9) ^ tick).wrapping_mul(0x85eb_ca6b);
    let hash = (hash ^ (hash >> 15)).wrapping_mul(0xc2b2_ae35);
    f64::from(hash ^ (hash >> 16)) / 4_294_967_296.0
}

/// Where the water of a surface is at a moment; units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Stock {
    /// On it.
    pub film: u64,
    /// In it.
    pub pores: u64,
    /// Gone into the air.
    pub evaporated: u64,
}

#[cfg(test)]
mod tests {
    use super::super::texel::Scale;
    use super::*;

    #[test]
    fn what_changes_by_less_than_a_byte_a_time_changes_in_the_long_run() {
        let scale = Scale { unit_mm: 1.0e-6, reserve_mm: 0.05 };
        let (mut reserve, mut shown, mut steps) = (0, 0, 0);
        for texel in 0..200 {
            let mut water = TexelWater { film: 9, pores: 9, reserve: 200, shown: 20, ..default() };
            for tick in 1..=400 {
                let amounts = scale.amounts(&water);
                // A fifth of a step each.
                let less = Amounts { reserve_mm: amounts.reserve_mm - 0.05 / 255.0 / 5.0, ..amounts };
                let wetness = (f64::from(water.shown) + 0.2) / 255.0;
                let look = WaterLook { wetness, gloss: 0.0, film: 1.0 };
                scale.commit(&mut water, less, look, tick, jitter(texel, tick));
            }
            reserve += u32::from(water.reserve);
            shown += u32::from(water.shown);
            steps += 1;
        }
        assert!((reserve as f32 / steps as f32 - 120.0).abs() < 2.0, "{reserve}");
        assert!((shown as f32 / steps as f32 - 100.0).abs() < 2.0, "{shown}");
    }
}
