//! The matter of one surface: its texels, which tiles of them are busy, and what has become of it.
//!
//! Everything that changes an amount goes through the methods here, in whole units: what came is on the surface, or the
//! [`MatterLedger`] says where it went.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::texel::{MatterKind, TexelMatter, pour, take};
use crate::overlay::TILE_SIZE;
use crate::wetting::Tiles;

/// Dust, mud and snow on a surface. Beside [`SurfaceWater`](crate::wetting::SurfaceWater), whose units and tiles it shares;
/// empty until the first of it comes.
#[derive(Component, Debug, Clone, Default)]
pub struct SurfaceMatter {
    /// Texels along each side; 0 while nothing has come.
    pub(crate) size: u32,
    /// Row by row.
    pub(crate) texels: Vec<TexelMatter>,
    /// Of the loose grains of each texel those that float in its film, units; never more than there are. Empty until the first
    /// are lifted.
    pub(super) stirred: Vec<u32>,
    pub(crate) tiles: MatterTiles,
    pub(crate) ledger: MatterLedger,
}

/// What has become of the matter of a surface; units.
///
/// `received_dust + received_mud` is the dust and mud on it, `washed_off` and `wiped`; `received_snow` is the snow on it,
/// `melted`, `slid_off` and `wiped_snow`. To the unit.
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MatterLedger {
    /// Came as dust.
    pub received_dust: u64,
    /// Came as mud.
    pub received_mud: u64,
    /// Came as snow.
    pub received_snow: u64,
    /// Dust and mud that left with drips and spilled water, or found no room.
    pub washed_off: u64,
    /// Snow that became water of the surface.
    pub melted: u64,
    /// Snow that left over an edge, or found no room.
    pub slid_off: u64,
    /// Dust and mud that a [brush](crate::brush) took away.
    #[serde(default)]
    pub wiped: u64,
    /// Snow that a brush took away.
    #[serde(default)]
    pub wiped_snow: u64,
}

/// Matter on a surface at a moment; units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MatterStock {
    /// Loose.
    pub dust: u64,
    /// Bound.
    pub mud: u64,
    /// As water.
    pub snow: u64,
}

/// Which tiles have something to do: flags, and lists of those that are set, in any order.
#[derive(Debug, Clone, Default)]
pub(crate) struct MatterTiles {
    pub(crate) flags: Vec<u8>,
    /// Snow that may slide.
    pub(crate) sliding: Vec<u32>,
    /// Snow, which melts when it is warm.
    pub(crate) melting: Vec<u32>,
}

impl MatterTiles {
    /// Snow that may slide.
    pub(crate) const SNOW_MOVES: u8 = 1;
    /// Snow lies here.
    pub(crate) const MELTS: u8 = 2;

    fn set(list: &mut Vec<u32>, flags: &mut u8, flag: u8, tile: u32) {
        if *flags & flag == 0 {
            *flags |= flag;
            list.push(tile);
        }
    }

    /// Its snow may slide.
    pub(crate) fn slide(&mut self, tile: u32) {
        Self::set(&mut self.sliding, &mut self.flags[tile as usize], Self::SNOW_MOVES, tile);
    }

    /// It has got snow.
    pub(crate) fn melt(&mut self, tile: u32) {
        Self::set(&mut self.melting, &mut self.flags[tile as usize], Self::MELTS, tile);
    }

    pub(crate) fn has(&self, tile: u32, flag: u8) -> bool {
        self.flags[tile as usize] & flag != 0
    }

    /// Takes tiles whose flag has been cleared out of the lists.
    pub(crate) fn prune(&mut self) {
        let Self { flags, sliding, melting } = self;
        Tiles::prune(sliding, flags, Self::SNOW_MOVES);
        Tiles::prune(melting, flags, Self::MELTS);
    }
}

impl SurfaceMatter {
    /// As it was saved. `stirred`: of each texel, or empty; `flags`: those of each tile.
    pub(crate) fn from_saved(
        size: u32,
        texels: Vec<TexelMatter>,
        mut stirred: Vec<u32>,
        flags: &[u8],
        ledger: MatterLedger,
    ) -> Self {
        let mut tiles = MatterTiles { flags: vec![0; flags.len()], ..default() };
        for (tile, &flags) in flags.iter().enumerate() {
            if flags & MatterTiles::SNOW_MOVES != 0 {
                tiles.slide(tile as u32);
            }
            if flags & MatterTiles::MELTS != 0 {
                tiles.melt(tile as u32);
            }
        }
        // Of a stranger's folder.
        for (stirred, texel) in stirred.iter_mut().zip(&texels) {
            *stirred = (*stirred).min(texel.dust);
        }
        Self { size, texels, stirred, tiles, ledger }
    }

    /// Flags of each tile.
    pub(crate) fn tile_flags(&self) -> &[u8] {
        &self.tiles.flags
    }

    /// The texels, row by row; empty while nothing has come.
    pub fn texels(&self) -> &[TexelMatter] {
        &self.texels
    }

    /// Of the loose grains of each texel, row by row, those that float in its film; units. Empty while none has been lifted.
    pub fn stirred(&self) -> &[u32] {
        &self.stirred
    }

    /// What has become of it.
    pub fn ledger(&self) -> MatterLedger {
        self.ledger
    }

    /// Whether nothing has ever come.
    pub fn is_empty(&self) -> bool {
        self.texels.is_empty()
    }

    /// Bytes it holds.
    pub fn bytes(&self) -> usize {
        self.texels.capacity() * size_of::<TexelMatter>()
            + self.stirred.capacity() * size_of::<u32>()
            + self.tiles.flags.capacity()
    }

    /// Sum over all texels.
    pub fn stock(&self) -> MatterStock {
        self.texels.iter().fold(MatterStock::default(), |sum, texel| MatterStock {
            dust: sum.dust + u64::from(texel.dust),
            mud: sum.mud + u64::from(texel.mud),
            snow: sum.snow + u64::from(texel.snow),
        })
    }

    /// Makes room for the first matter on maps of `size` x `size` texels. What was on maps of another size is gone.
    pub(crate) fn wake(&mut self, size: u32) {
        if self.size != size {
            self.reset();
            self.size = size;
            self.texels = vec![TexelMatter::default(); (size * size) as usize];
            self.tiles.flags = vec![0; (size / TILE_SIZE).pow(2) as usize];
        }
    }

    /// Itself, if anything has come on maps of this size.
    pub(crate) fn awake(&mut self, size: u32) -> Option<&mut Self> {
        (self.size == size && !self.texels.is_empty()).then_some(self)
    }

    /// Clean again, as on the first day.
    pub(crate) fn reset(&mut self) {
        *self = Self::default();
    }

    /// Matter that comes to a texel.
    pub(crate) fn receive(&mut self, texel: u32, kind: MatterKind, units: u64) {
        let (here, ledger) = (&mut self.texels[texel as usize], &mut self.ledger);
        let (amount, received, lost) = match kind {
            MatterKind::Dust => (&mut here.dust, &mut ledger.received_dust, &mut ledger.washed_off),
            MatterKind::Mud => (&mut here.mud, &mut ledger.received_mud, &mut ledger.washed_off),
            MatterKind::Snow => (&mut here.snow, &mut ledger.received_snow, &mut ledger.slid_off),
        };
        let added = units.min(u64::from(u32::MAX - *amount));
        *amount += added as u32;
        *received += units;
        *lost += units - added;
    }

    /// Loose grains become bound soil.
    pub(crate) fn bind(&mut self, texel: u32, units: u64) -> u32 {
        let TexelMatter { dust, mud, .. } = &mut self.texels[texel as usize];
        let bound = pour(dust, mud, units);
        self.keep_stirred(texel);
        bound
    }

    /// Bound soil becomes loose grains, which float.
    pub(crate) fn loosen(&mut self, texel: u32, units: u64) -> u32 {
        let TexelMatter { dust, mud, .. } = &mut self.texels[texel as usize];
        let loosened = pour(mud, dust, units);
        self.lift(texel, loosened);
        loosened
    }

    /// Grains of a texel that float.
    pub(crate) fn stirred_on(&self, texel: u32) -> u32 {
        self.stirred.get(texel as usize).copied().unwrap_or(0)
    }

    /// Up to so many of the grains that lie loose float from now on; how many it were.
    pub(crate) fn stir(&mut self, texel: u32, units: u64) -> u32 {
        let lying = self.texels[texel as usize].dust - self.stirred_on(texel);
        let lifted = units.min(u64::from(lying)) as u32;
        self.lift(texel, lifted);
        lifted
    }

    /// So many more float, of those that are there.
    fn lift(&mut self, texel: u32, units: u32) {
        if units == 0 {
            return;
        }
        if self.stirred.is_empty() {
            self.stirred = vec![0; self.texels.len()];
        }
        self.stirred[texel as usize] += units;
    }

    /// No more float than there are.
    fn keep_stirred(&mut self, texel: u32) {
        if let Some(stirred) = self.stirred.get_mut(texel as usize) {
            *stirred = (*stirred).min(self.texels[texel as usize].dust);
        }
    }

    /// Loose grains go to another texel, up to so many of them afloat.
    pub(crate) fn move_dust(&mut self, from: u32, to: u32, units: u64, afloat: u64) -> u32 {
        let mut there = self.texels[to as usize].dust;
        let moved = pour(&mut self.texels[from as usize].dust, &mut there, units);
        self.texels[to as usize].dust += moved;
        let afloat = afloat.min(u64::from(self.stirred_on(from).min(moved))) as u32;
        if afloat > 0 {
            self.stirred[from as usize] -= afloat;
            self.stirred[to as usize] += afloat;
        }
        self.keep_stirred(from);
        moved
    }

    /// Snow goes to another texel.
    pub(crate) fn move_snow(&mut self, from: u32, to: u32, units: u64) -> u32 {
        let mut there = self.texels[to as usize].snow;
        let moved = pour(&mut self.texels[from as usize].snow, &mut there, units);
        self.texels[to as usize].snow += moved;
        moved
    }

    /// Loose grains leave the surface with water.
    pub(crate) fn wash_off(&mut self, texel: u32, units: u64) -> u32 {
        let gone = take(&mut self.texels[texel as usize].dust, units);
        if let Some(stirred) = self.stirred.get_mut(texel as usize) {
            // What floats goes first.
            *stirred = stirred.saturating_sub(gone);
        }
        self.ledger.washed_off += u64::from(gone);
        gone
    }

    /// Snow leaves the surface as snow.
    pub(crate) fn slide_off(&mut self, texel: u32, units: u64) -> u32 {
        let gone = take(&mut self.texels[texel as usize].snow, units);
        self.ledger.slid_off += u64::from(gone);
        gone
    }

    /// A brush takes a part of what lies on a texel away, 0..=1; how much it was.
    pub(crate) fn wipe(&mut self, texel: u32, part: f64) -> u64 {
        let Some(here) = self.texels.get_mut(texel as usize) else { return 0 };
        // The conversion saturates, and takes NaN for 0; `take` takes no more than there is.
        let share = |amount: u32| (f64::from(amount) * part).round() as u64;
        let [dust, mud, snow] = [&mut here.dust, &mut here.mud, &mut here.snow].map(|amount| {
            let units = share(*amount);
            u64::from(take(amount, units))
        });
        self.keep_stirred(texel);
        self.ledger.wiped += dust + mud;
        self.ledger.wiped_snow += snow;
        dust + mud + snow
    }

    /// Snow becomes water, which the caller puts there.
    pub(crate) fn melt(&mut self, texel: u32, units: u64) -> u32 {
        let gone = take(&mut self.texels[texel as usize].snow, units);
        self.ledger.melted += u64::from(gone);
        gone
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matter::test_world::assert_balanced;

    #[test]
    fn what_finds_no_room_is_in_the_ledger() {
        let mut matter = SurfaceMatter::default();
        assert!(matter.is_empty() && matter.awake(16).is_none());
        matter.wake(16);
        for kind in [MatterKind::Dust, MatterKind::Mud, MatterKind::Snow] {
            matter.receive(7, kind, u64::from(u32::MAX) - 5);
            matter.receive(7, kind, 100);
        }
        assert_eq!(matter.texels[7], TexelMatter { dust: u32::MAX, mud: u32::MAX, snow: u32::MAX });
        assert_eq!((matter.ledger.washed_off, matter.ledger.slid_off), (190, 95));
        // Neither goes where there is no room.
        assert_eq!([matter.bind(7, 9), matter.loosen(7, 9)], [0, 0]);
        matter.receive(8, MatterKind::Dust, 50);
        assert_eq!(
            [matter.move_dust(8, 7, 9, 0), matter.move_dust(7, 8, 9, 0), matter.bind(8, 20)],
            [0, 9, 20]
        );
        assert_balanced(&matter);
    }

    #[test]
    fn maps_of_another_size_begin_clean_and_the_same_size_keeps_what_it_has() {
        let mut matter = SurfaceMatter::default();
        matter.wake(32);
        matter.receive(3, MatterKind::Snow, 8);
        matter.tiles.slide(3);
        matter.wake(32);
        assert_eq!(matter.stock().snow, 8);
        assert!(matter.awake(16).is_none() && matter.awake(32).is_some());
        matter.wake(16);
        assert_eq!((matter.texels.len(), matter.stock().snow, matter.ledger.received_snow), (256, 0, 0));
        assert!(matter.tiles.sliding.is_empty());
    }

    #[test]
    fn no_more_grains_float_than_there_are() {
        let mut matter = SurfaceMatter::default();
        matter.wake(16);
        matter.receive(3, MatterKind::Dust, 100);
        assert!(matter.stirred().is_empty());
        assert_eq!([matter.stir(3, 30), matter.stir(3, 900), matter.stir(3, 1)], [30, 70, 0]);
        // What goes along afloat is afloat there.
        assert_eq!(matter.move_dust(3, 4, 50, 20), 50);
        assert_eq!([matter.stirred_on(3), matter.stirred_on(4)], [50, 20]);
        matter.bind(3, 10);
        matter.wash_off(4, 15);
        assert_eq!([matter.stirred_on(3), matter.stirred_on(4)], [40, 5]);
        // Of 35 that are left there 5 float.
        matter.wipe(4, 1.0);
        assert_eq!((matter.stirred_on(4), matter.stir(4, 9)), (0, 0));
        assert_eq!((matter.loosen(3, 6), matter.stirred_on(3)), (6, 46));
        assert_balanced(&matter);
    }

    #[test]
    fn what_was_saved_goes_on_where_it_was() {
        let mut matter = SurfaceMatter::default();
        matter.wake(32);
        matter.receive(40, MatterKind::Snow, 77);
        matter.tiles.melt(1);
        matter.tiles.melt(2);
        matter.tiles.slide(2);
        matter.receive(41, MatterKind::Dust, 90);
        matter.stir(41, 60);
        let (texels, stirred) = (matter.texels.clone(), matter.stirred.clone());
        let again = SurfaceMatter::from_saved(32, texels, stirred, matter.tile_flags(), matter.ledger);
        assert_eq!((again.stock(), again.ledger), (matter.stock(), matter.ledger));
        assert_eq!((again.stirred_on(41), again.stirred_on(40)), (60, 0));
        assert_eq!((again.tiles.melting, again.tiles.sliding), (vec![1, 2], vec![2]));
    }
}
