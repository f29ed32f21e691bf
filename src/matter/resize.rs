//! Dust, mud and snow on maps of another size, to the unit.

use super::SurfaceMatter;
use crate::overlay::TILE_SIZE;
use crate::wetting::Shares;

impl SurfaceMatter {
    /// The same matter on maps of another size, shared out as the water beside it. What finds no room on a texel has left the
    /// surface, as when it falls.
    pub(crate) fn resized(&self, shares: &Shares) -> Self {
        if self.is_empty() {
            return self.clone();
        }
        if self.size != shares.from {
            // Of maps that were gone before.
            return Self::default();
        }
        let size = shares.size();
        let mut matter = Self::default();
        matter.wake(size);
        matter.ledger = self.ledger;
        if !self.stirred.is_empty() {
            matter.stirred = vec![0; matter.texels.len()];
        }
        for (texel, held) in (0u32..).zip(&self.texels) {
            if held.is_clean() {
                continue;
            }
            let share = shares.of(texel);
            for (target, units) in share.parts(held.dust) {
                matter.ledger.washed_off += lay(&mut matter.texels[target as usize].dust, units);
            }
            for (target, units) in share.parts(held.mud) {
                matter.ledger.washed_off += lay(&mut matter.texels[target as usize].mud, units);
            }
            for (target, units) in share.parts(held.snow) {
                matter.ledger.slid_off += lay(&mut matter.texels[target as usize].snow, units);
            }
            for (target, units) in share.parts(self.stirred_on(texel)).filter(|&(_, units)| units > 0) {
                let afloat = matter.stirred[target as usize].saturating_add(units);
                matter.stirred[target as usize] = afloat.min(matter.texels[target as usize].dust);
            }
        }
        // On texels of another width snow may slide that lay still.
        let across = size / TILE_SIZE;
        for texel in (0u32..).zip(&matter.texels).filter(|(_, held)| held.snow > 0).map(|(texel, _)| texel) {
            let tile = texel / size / TILE_SIZE * across + texel % size / TILE_SIZE;
            matter.tiles.slide(tile);
            matter.tiles.melt(tile);
        }
        matter
    }
}

/// Adds to an amount; what finds no room.
fn lay(there: &mut u32, units: u32) -> u64 {
    let laid = units.min(u32::MAX - *there);
    *there += laid;
    u64::from(units - laid)
}

#[cfg(test)]
mod tests {
    use bevy::math::{Affine3A, Vec2, Vec3};
    use bevy::prelude::{Mesh, Plane3d};

    use super::*;
    use crate::collision::MeshTriangles;
    use crate::matter::test_world::assert_balanced;
    use crate::matter::{MatterKind, TexelMatter};
    use crate::overlay::Wrap;
    use crate::wetting::TexelGeometry;

    fn plane(size: u32) -> TexelGeometry {
        let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::splat(0.5)));
        let triangles = MeshTriangles::from_mesh(&mesh).unwrap();
        TexelGeometry::new(&triangles, &Affine3A::IDENTITY, Vec3::Y, size, [Wrap::Clamp; 2])
    }

    fn dirty(size: u32) -> SurfaceMatter {
        let mut matter = SurfaceMatter::default();
        matter.wake(size);
        for texel in (0..size * size).step_by(3) {
            let random = u64::from(texel.wrapping_mul(2_654_435_761) >> 12);
            matter.receive(texel, MatterKind::Dust, random % 1009);
            matter.receive(texel, MatterKind::Mud, random % 77);
            matter.receive(texel, MatterKind::Snow, random % 13);
            matter.stir(texel, random % 501);
        }
        matter
    }

    #[test]
    fn not_a_unit_is_lost_down_and_up() {
        for (from, to) in [(64, 32), (64, 16), (16, 32)] {
            let (before, geometry) = (dirty(from), plane(to));
            let after = before.resized(&Shares::new(from, &geometry));
            assert_eq!((after.stock(), after.ledger()), (before.stock(), before.ledger()));
            let afloat = |matter: &SurfaceMatter| matter.stirred.iter().copied().map(u64::from).sum::<u64>();
            assert_eq!(afloat(&after), afloat(&before));
            assert!(after.texels.iter().zip(&after.stirred).all(|(held, &afloat)| afloat <= held.dust));
            assert_eq!(after.texels.len(), (to * to) as usize);
            assert_eq!(after.tiles.melting.len(), (to / TILE_SIZE).pow(2) as usize);
            assert_balanced(&after);
        }
    }

    #[test]
    fn four_become_one_and_what_finds_no_room_is_in_the_ledger() {
        let mut before = SurfaceMatter::default();
        before.wake(32);
        for (texel, dust) in [(0, 10), (1, 20), (32, 5)] {
            before.receive(texel, MatterKind::Dust, dust);
        }
        for texel in [0, 33] {
            before.receive(texel, MatterKind::Mud, u64::from(u32::MAX) - 4);
            before.receive(texel, MatterKind::Snow, u64::from(u32::MAX) - 4);
        }
        let geometry = plane(16);
        let after = before.resized(&Shares::new(32, &geometry));
        assert_eq!(after.texels[0], TexelMatter { dust: 35, mud: u32::MAX, snow: u32::MAX });
        assert_balanced(&after);
        assert!(SurfaceMatter::default().resized(&Shares::new(32, &geometry)).is_empty());
    }

    #[test]
    fn what_lay_on_maps_that_were_gone_before_is_not_there_again() {
        let geometry = plane(16);
        for stale in [16, 64] {
            assert!(dirty(stale).resized(&Shares::new(32, &geometry)).is_empty(), "{stale}");
        }
    }
}
