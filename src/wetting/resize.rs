//! Maps of another size: what lies on them is shared out among the texels of the new ones, to the unit.
//!
//! Where maps get smaller, a texel gets what lay on the four (or sixteen, ...) in whose place it is. Where they get larger, four
//! share what lay on one: equal parts in whole units, of which the first of them, row by row, get what is left over. Only texels
//! on which the mesh lies get any: what would fall beside an island goes to the texel of the island that the gutter shows.
//!
//! What is no amount is taken from the texel that held most: the times, the reserve, the nearness to a rim, whose the water was.
//! How wet it looked, and marks, are means over what lay there.

use super::texel::TexelWater;
use super::tiles::Tiles;
use super::{Ledger, Marks, Origin, SurfaceWater, TexelGeometry};
use crate::overlay::TILE_SIZE;

/// Who gets what lay on a texel of a map of another size.
pub(crate) struct Shares<'a> {
    /// Texels along each side of the old map.
    pub(crate) from: u32,
    /// The surface on the new map.
    to: &'a TexelGeometry,
}

/// The texels that get what lay on one, at least one and at most four.
pub(crate) struct Share {
    texels: [u32; 4],
    count: usize,
}

impl Share {
    fn of_one(texel: u32) -> Self {
        Self { texels: [texel; 4], count: 1 }
    }

    /// Each of the texels, and its part of an amount. Together they are that amount.
    pub(crate) fn parts(&self, amount: u32) -> impl Iterator<Item = (u32, u32)> {
        let count = self.count as u32;
        let (each, rest) = (amount / count, amount % count);
        let texels = self.texels[..self.count].iter();
        (0u32..).zip(texels).map(move |(number, &texel)| (texel, each + u32::from(number < rest)))
    }
}

impl<'a> Shares<'a> {
    /// From a map of `from` texels along each side to that of `to`: twice as many, or a half, a quarter and so on.
    pub(crate) fn new(from: u32, to: &'a TexelGeometry) -> Self {
        Self { from, to }
    }

    /// Texels along each side of the new map.
    pub(crate) fn size(&self) -> u32 {
        self.to.size()
    }

    /// Who gets what lay on a texel.
    pub(crate) fn of(&self, texel: u32) -> Share {
        let (x, y, size) = (texel % self.from, texel / self.from, self.size());
        if size <= self.from {
            let ratio = self.from / size;
            return Share::of_one(self.on_mesh(y / ratio * size + x / ratio));
        }
        let first = 2 * y * size + 2 * x;
        let four = [first, first + 1, first + size, first + size + 1];
        let mut share = Share { texels: [first; 4], count: 0 };
        for texel in four.into_iter().filter(|&texel| self.to.lies(texel)) {
            share.texels[share.count] = texel;
            share.count += 1;
        }
        if share.count > 0 {
            return share;
        }
        Share::of_one(four.into_iter().find_map(|texel| self.to.gutter_source(texel)).unwrap_or(first))
    }

    /// Itself, or the texel of the island beside which it lies. What is farther out stays where it is.
    fn on_mesh(&self, texel: u32) -> u32 {
        if self.to.lies(texel) { texel } else { self.to.gutter_source(texel).unwrap_or(texel) }
    }
}

/// What a new texel is made from, beside amounts.
#[derive(Clone, Copy, Default)]
struct Mix {
    /// Old texels.
    count: u32,
    /// Sums over them.
    shown: u32,
    filmed: u32,
    marks: Marks,
    /// The one that held most, and how much; the first of several.
    wettest: u32,
    most: u64,
}

impl Mix {
    fn add(&mut self, texel: u32, held: &TexelWater, marks: Marks) {
        if self.count == 0 || held.total() > self.most {
            (self.wettest, self.most) = (texel, held.total());
        }
        self.count += 1;
        // How a dry texel looked when it was last wet is not seen any more.
        if !held.is_dry() {
            self.shown += u32::from(held.shown);
            self.filmed += u32::from(held.filmed);
        }
        self.marks.efflorescence += marks.efflorescence;
        self.marks.tide += marks.tide;
    }

    /// The mean of bytes, rounded to the nearest.
    fn mean(&self, sum: u32) -> u8 {
        u8::try_from((sum + self.count / 2) / self.count.max(1)).unwrap_or(u8::MAX)
    }
}

impl SurfaceWater {
    /// The same water on maps of another size. `from`: the surface on the maps that it is on, `to`: on the new ones, as for
    /// `Shares`. Its texels have been brought to the present, and of what has dried note has been taken.
    pub(crate) fn resized(&self, from: &TexelGeometry, to: &TexelGeometry) -> Self {
        let mut water = Self::of_size(to.size(), self.wrap, to.mean_mm2());
        if self.ledger == Ledger::default() && !self.is_wet() {
            // Nothing is counted in the old units.
            return water;
        }
        (water.units, water.ledger, water.rained_at) = (self.units, self.ledger, self.rained_at);
        water.notes_dried = self.notes_dried;
        if !self.is_wet() {
            return water;
        }
        water.origins.ask(self.origins.is_kept(), 0);
        water.wake(!self.marks.is_empty());
        let shares = Shares::new(self.size, to);
        let mut mixes = vec![Mix::default(); water.texels.len()];
        for (texel, held) in (0u32..).zip(&self.texels) {
            // What lies beside the mesh is no part of any mean.
            if held.is_dry() && !from.lies(texel) {
                continue;
            }
            let share = shares.of(texel);
            let marks = self.marks.get(texel as usize).copied().unwrap_or_default();
            for ((target, film), (_, pores)) in share.parts(held.film).zip(share.parts(held.pores)) {
                water.lay(target, film, pores);
                mixes[target as usize].add(texel, held, marks);
            }
        }
        for (target, mix) in (0u32..).zip(&mixes) {
            if mix.count > 0 {
                water.take_after(target, mix, self);
            }
        }
        water.take_over_tiles(self);
        water
    }

    /// Adds amounts to a texel; what finds no room in its pores lies on it, what finds none there either is spilled.
    fn lay(&mut self, texel: u32, film: u32, pores: u32) {
        let there = &mut self.texels[texel as usize];
        let absorbed = pores.min(u32::MAX - there.pores);
        there.pores += absorbed;
        let film = u64::from(film) + u64::from(pores - absorbed);
        let laid = film.min(u64::from(u32::MAX - there.film));
        there.film += laid as u32;
        self.ledger.spilled += film - laid;
    }

    /// What is no amount, of what was mixed.
    fn take_after(&mut self, target: u32, mix: &Mix, before: &Self) {
        let wettest = before.texels[mix.wettest as usize];
        let there = &mut self.texels[target as usize];
        (there.tick, there.reserve, there.rim) = (wettest.tick, wettest.reserve, wettest.rim);
        there.shown = mix.mean(mix.shown);
        there.filmed = if there.film > 0 { mix.mean(mix.filmed) } else { 0 };
        if let Some(marks) = self.marks.get_mut(target as usize) {
            let count = mix.count as f32;
            *marks = Marks { efflorescence: mix.marks.efflorescence / count, tide: mix.marks.tide / count };
        }
        if let Some(Origin { source, since }) = before.origin(mix.wettest) {
            self.origins.begin(target, source, since);
        }
    }

    /// Tiles that were wet are drawn anew, and whatever lies in them is looked at again: on texels of another width it may run.
    fn take_over_tiles(&mut self, before: &Self) {
        let (across, across_before) = (self.size / TILE_SIZE, before.size / TILE_SIZE);
        let place = |at: u32, from: u32, to: u32| at * to / from;
        for tile in 0..across * across {
            let (x, y) = (tile % across, tile / across);
            let along = |at: u32| {
                let first = place(at, across, across_before);
                first..place(at + 1, across, across_before).max(first + 1)
            };
            let flags = along(y)
                .flat_map(|row| along(x).map(move |column| row * across_before + column))
                .filter_map(|old| before.tiles.flags.get(old as usize))
                .fold(0u8, |all, flags| all | flags);
            if flags & Tiles::WET != 0 {
                self.tiles.touch(tile);
            }
            if flags & Tiles::RENEWED != 0 {
                self.tiles.renew(tile);
            }
        }
        for texel in 0..self.texels.len() as u32 {
            let TexelWater { film, pores, .. } = self.texels[texel as usize];
            if film == 0 && pores == 0 {
                continue;
            }
            let tile = self.tile_of(texel);
            self.tiles.touch(tile);
            if film > 0 {
                self.tiles.run(tile);
            }
            if pores > 0 {
                self.tiles.spread(tile);
            }
        }
        for list in [&mut self.tiles.running, &mut self.tiles.spreading, &mut self.tiles.dirty] {
            list.sort_unstable();
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::{Affine3A, Vec2, Vec3};
    use bevy::prelude::{Mesh, Plane3d};

    use super::*;
    use crate::collision::MeshTriangles;
    use crate::emitter::Source;
    use crate::overlay::Wrap;

    const WRAP: [Wrap; 2] = [Wrap::Clamp; 2];

    fn geometry(triangles: &MeshTriangles, size: u32) -> TexelGeometry {
        TexelGeometry::new(triangles, &Affine3A::IDENTITY, Vec3::Y, size, WRAP)
    }

    fn plane(size: u32) -> TexelGeometry {
        let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::splat(0.5)));
        geometry(&MeshTriangles::from_mesh(&mesh).unwrap(), size)
    }

    /// A triangle over an eighth of the map, with a border askew to the texels.
    fn corner(size: u32) -> TexelGeometry {
        let corners = [Vec2::ZERO, Vec2::new(0.53, 0.07), Vec2::new(0.11, 0.49)];
        let triangles = MeshTriangles {
            positions: vec![corners.map(|at| Vec3::new(at.x, 0.0, at.y))],
            uvs: vec![corners],
            source: vec![0],
            ..Default::default()
        };
        geometry(&triangles, size)
    }

    /// Uneven amounts on all texels that lie on the mesh.
    fn wet(geometry: &TexelGeometry) -> SurfaceWater {
        let mut water = SurfaceWater::of_size(geometry.size(), WRAP, geometry.mean_mm2());
        water.wake(true);
        for texel in (0..water.texels.len() as u32).filter(|&texel| geometry.lies(texel)) {
            let random = texel.wrapping_mul(2_654_435_761) >> 12;
            let here = &mut water.texels[texel as usize];
            (here.film, here.pores, here.tick) = (random % 1009, random % 5003 / (1 + texel % 3), 1 + texel);
            (here.shown, here.filmed, here.reserve) = (200, 100, (texel % 251) as u8);
            water.ledger.received += here.total();
            let tile = water.tile_of(texel);
            water.tiles.touch(tile);
        }
        water
    }

    fn held(water: &SurfaceWater) -> [u64; 2] {
        water.texels.iter().fold([0; 2], |[film, pores], texel| {
            [film + u64::from(texel.film), pores + u64::from(texel.pores)]
        })
    }

    #[test]
    fn not_a_unit_is_lost_down_and_up_and_all_lies_on_the_mesh() {
        for (from, to) in [(128u32, 64u32), (128, 16), (32, 64), (64, 64)] {
            for shape in [plane, corner] {
                let (old, new) = (shape(from), shape(to));
                let before = wet(&old);
                let after = before.resized(&old, &new);
                assert_eq!(held(&after), held(&before), "{from} to {to}");
                assert_eq!((after.ledger, after.units, after.size), (before.ledger, before.units, to));
                for (texel, water) in (0u32..).zip(&after.texels) {
                    assert!(water.is_dry() || (new.lies(texel) && water.tick > 0), "{from} to {to}: {texel}");
                }
                let is_dirty = |texel: u32| after.tiles.has(after.tile_of(texel), Tiles::DIRTY);
                let mut wet = (0u32..).zip(&after.texels).filter(|(_, water)| !water.is_dry());
                assert!(wet.all(|(texel, _)| is_dirty(texel)));
                assert!(after.tiles.running.is_sorted() && after.tiles.spreading.is_sorted());
            }
        }
    }

    #[test]
    fn four_become_one_after_the_wettest_of_them() {
        let (old, new) = (plane(32), plane(16));
        let mut before = SurfaceWater::of_size(32, WRAP, old.mean_mm2());
        before.origins.ask(true, 0);
        before.wake(true);
        let four = [(0, 5, 0), (1, 0, 7), (32, 30, 9), (33, 0, 0)];
        for (texel, film, pores) in four {
            let texel = texel as usize;
            before.texels[texel] =
                TexelWater { film, pores, tick: 3 + film, shown: 100, filmed: 60, ..Default::default() };
            before.marks[texel] = Marks { efflorescence: 0.25, tide: if texel == 1 { 0.4 } else { 0.0 } };
        }
        before.texels[32].reserve = 77;
        before.origins.begin(32, Source(4), 21);
        before.ledger.received = 51;
        let after = before.resized(&old, &new);
        let expected =
            TexelWater { film: 35, pores: 16, tick: 33, shown: 75, filmed: 45, reserve: 77, rim: 0 };
        assert_eq!(after.texels[0], expected);
        assert_eq!(after.marks[0], Marks { efflorescence: 0.25, tide: 0.1 });
        assert_eq!(after.origin(0), Some(Origin { source: Source(4), since: 21 }));
        assert!(after.texels[1..].iter().all(TexelWater::is_dry));
    }

    #[test]
    fn one_becomes_four_and_the_first_of_them_get_what_is_left_over() {
        let (old, new) = (plane(16), plane(32));
        let mut before = SurfaceWater::of_size(16, WRAP, old.mean_mm2());
        before.wake(false);
        before.texels[17] = TexelWater { film: 6, pores: 15, tick: 9, shown: 33, ..Default::default() };
        before.ledger.received = 21;
        let after = before.resized(&old, &new);
        let of = |texel: u32| (after.texels[texel as usize].film, after.texels[texel as usize].pores);
        assert_eq!([66, 67, 98, 99].map(of), [(2, 4), (2, 4), (1, 4), (1, 3)]);
        assert!([66, 67, 98, 99].iter().all(|&texel| after.texels[texel as usize].tick == 9));
        // And back again.
        let again = after.resized(&new, &old);
        assert_eq!(again.texels[17], before.texels[17]);
    }

    #[test]
    fn what_finds_no_room_is_spilled() {
        let (old, new) = (plane(32), plane(16));
        let mut before = SurfaceWater::of_size(32, WRAP, old.mean_mm2());
        before.wake(false);
        for texel in [0usize, 1] {
            (before.texels[texel].film, before.texels[texel].pores) = (u32::MAX, u32::MAX - 5);
            (before.texels[texel].tick, before.ledger.received) = (1, u64::from(u32::MAX) * 4 - 10);
        }
        let after = before.resized(&old, &new);
        let [film, pores] = held(&after);
        assert_eq!([film, pores], [u64::from(u32::MAX); 2]);
        assert_eq!(after.ledger.received, film + pores + after.ledger.spilled);
    }

    #[test]
    fn what_never_was_wet_counts_in_units_of_its_new_texels() {
        let (old, new) = (plane(128), plane(16));
        let before = SurfaceWater::of_size(128, WRAP, old.mean_mm2());
        let after = before.resized(&old, &new);
        assert!(!after.is_wet() && after.units.shift < before.units.shift);
    }
}
