//! Taking a surface back to what it held before.

use super::SurfaceWater;
use super::tiles::Tiles;
use crate::matter::SurfaceMatter;

impl SurfaceWater {
    /// Takes its water, and the matter beside it, back to earlier states of theirs, accounts included: whatever came, left or
    /// moved since then has not. What was there dries and is absorbed as if it had been left alone. Nothing happens if its
    /// maps have another size by now.
    pub fn put_back(
        &mut self,
        matter: &mut SurfaceMatter,
        water_before: &SurfaceWater,
        matter_before: &SurfaceMatter,
    ) {
        if (self.size, self.units, self.wrap) != (water_before.size, water_before.units, water_before.wrap) {
            return;
        }
        let shown: Vec<u32> = (0..self.tiles.flags.len() as u32)
            .filter(|&tile| self.tiles.has(tile, Tiles::WET) || self.tiles.has(tile, Tiles::DIRTY))
            .collect();
        // There is room on the GPU by now, and it shows what is forgotten.
        let (has_marks, has_matter) = (!self.marks.is_empty(), !matter.is_empty());
        *self = water_before.clone();
        *matter = matter_before.clone();
        if has_matter {
            matter.wake(self.size);
        }
        if shown.is_empty() {
            return;
        }
        self.wake(has_marks);
        if !matter.is_empty() {
            self.notes_dried = true;
        }
        for tile in shown {
            self.tiles.touch(tile);
        }
        for tile in 0..self.tiles.flags.len() as u32 {
            if self.tiles.has(tile, Tiles::WET) {
                self.tiles.touch(tile);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::{Affine3A, Vec3};
    use bevy::prelude::{Mesh, Plane3d, Vec2};

    use super::*;
    use crate::collision::MeshTriangles;
    use crate::overlay::{Weatherable, Wrap};
    use crate::wetting::TexelGeometry;

    #[test]
    fn what_was_there_before_comes_back_and_all_that_changed_is_drawn_anew() {
        let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
        let triangles = MeshTriangles::from_mesh(&mesh).unwrap();
        let surface = Weatherable { map_size: 32, ..Default::default() };
        let geometry = TexelGeometry::new(&triangles, &Affine3A::IDENTITY, Vec3::Y, 32, [Wrap::Repeat; 2]);
        let mut water = SurfaceWater::new(&surface, geometry.mean_mm2());
        let mut matter = SurfaceMatter::default();
        let dry = (water.clone(), matter.clone());
        water.cover(&geometry, 0.1, 0.02, 5);
        let wet = (water.clone(), matter.clone());
        water.cover(&geometry, 0.3, 0.0, 9);
        water.tiles.dirty.clear();
        water.tiles.flags.iter_mut().for_each(|flags| *flags &= !Tiles::DIRTY);

        water.put_back(&mut matter, &wet.0, &wet.1);
        assert_eq!((water.texels(), water.ledger()), (wet.0.texels(), wet.0.ledger()));
        let tiles = water.tiles.flags.len();
        assert_eq!(water.tiles.dirty.len(), tiles);

        water.put_back(&mut matter, &dry.0, &dry.1);
        assert!(water.texels().iter().all(|texel| texel.is_dry()));
        assert_eq!((water.ledger(), water.tiles.dirty.len()), (dry.0.ledger(), tiles));
        // Dry, but there to be drawn.
        assert!(water.is_wet());
    }
}
