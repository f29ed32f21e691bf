//! What [brushes](crate::brush) do to the water of a texel.

use super::{Now, SurfaceWater, TexelWater, note_arrival};
use crate::emitter::Source;

impl SurfaceWater {
    /// A brush brings water to a texel, now. Makes room for the first.
    pub(crate) fn paint(&mut self, now: &Now, texel: u32, units: u64) {
        self.wake(now.material.leaves_marks());
        let tile = self.add(now, texel, units);
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
