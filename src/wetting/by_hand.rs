//! What [brushes](crate::brush) do to the water of a texel.

use super::{Now, SurfaceWater, TexelWater, note_arrival};
use crate::emitter::Source;

impl SurfaceWater {
    /// A brush brings water to a texel, now: it presses it into the pores, as far as there is room, and it is seen at once, in a
    /// pause, too. Makes room for the first.
    pub(crate) fn paint(&mut self, now: &Now, texel: u32, units: u64) {
        self.wake(now.material.leaves_marks());
        let tile = self.add(now, texel, units);
        let capacity = (now.matter.capacity_mm / now.scale(self.units, texel).unit_mm) as u32;
        let water = &mut self.texels[texel as usize];
        let pressed = water.film.min(capacity.saturating_sub(water.pores));
        (water.film, water.pores) = (water.film - pressed, water.pores + pressed);
        (water.shown, water.filmed) = (u8::MAX, u8::MAX);
        self.ledger.painted += units;
        self.origins.take_over(texel, Source::BY_HAND);
        note_arrival(self, now, texel, tile);
        self.rained_at = now.tick;
    }

    /// A brush takes a part of a texel's water away, 0..=1, now; how much it was, units.
    pub(crate) fn wipe(&mut self, now: &Now, texel: u32, part: f64) -> u64 {
        if self.texels.get(texel as usize).is_none_or(TexelWater::is_dry) {
            return 0;
        }
        self.settle(now, texel);
        let water = &mut self.texels[texel as usize];
        let before = water.total();
        // Never more than there is: the conversion saturates, and takes NaN for 0.
        let left = |units: u32| units - ((f64::from(units) * part).round() as u32).min(units);
        (water.film, water.pores) = (left(water.film), left(water.pores));
        let gone = before - water.total();
        self.ledger.wiped += gone;
        if gone > 0 {
            let tile = self.tile_of(texel);
            self.tiles.touch(tile);
            // What stands or soaks beside it may come over.
            self.tiles.run(tile);
            if now.matter.capacity_mm > 0.0 {
                self.tiles.spread(tile);
            }
        }
        gone
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::{Affine3A, Vec3};

    use super::*;
    use crate::material::PorousMaterial;
    use crate::overlay::Wrap;
    use crate::weather::DryingClock;
    use crate::wetting::TexelGeometry;
    use crate::wetting::test_meshes::{floor, sheet, turned_round};

    #[test]
    fn what_a_brush_brings_is_in_the_pores_and_seen_at_once() {
        let mesh = turned_round(sheet(2, floor, |point| point));
        let wrap = [Wrap::Clamp; 2];
        let geometry = TexelGeometry::new(&mesh, &Affine3A::IDENTITY, Vec3::Y, 16, wrap);
        let mut water = SurfaceWater::of_size(16, wrap, geometry.mean_mm2());
        let material = PorousMaterial { capacity_mm: 0.4, ..Default::default() };
        let drying = DryingClock::default();
        let now = Now::new(5, 60, &drying, &geometry, None, &material);
        let texel = 16 * 8 + 8;
        let unit_mm = geometry.unit_mm(water.units, texel);
        let units = |mm: f64| (mm / unit_mm).round() as u64;
        water.paint(&now, texel, units(0.3));
        let held = |water: &SurfaceWater| water.texels[texel as usize];
        assert_eq!((held(&water).film, u64::from(held(&water).pores)), (0, units(0.3)));
        water.paint(&now, texel, units(0.3));
        let scale = now.scale(water.units, texel);
        let amounts = now.amounts(&scale, texel, &held(&water));
        assert!((amounts.pores_mm - 0.4).abs() < 1e-3 && (amounts.film_mm - 0.2).abs() < 1e-3, "{amounts:?}");
        assert_eq!((held(&water).shown, held(&water).filmed, held(&water).tick), (255, 255, 5));
        assert_eq!(held(&water).total(), water.ledger.painted);
    }
}
