//! One tick of the matter of one surface.

use super::SurfaceMatter;
use super::shares::ShareScratch;
use super::slide::{Slip, SnowFall, slide};
use super::snow::melt;
use super::wash::bind_dried;
use crate::weather::Weather;
use crate::wetting::{Now, SurfaceWater};

/// Buffers that keep their memory from tick to tick.
#[derive(Debug, Default)]
pub(crate) struct MatterScratch {
    pub(super) shares: ShareScratch,
    pub(super) tiles: Vec<u32>,
    pub(super) slips: Vec<Slip>,
    /// Snow that has fallen off since this was emptied, in order.
    pub(crate) falls: Vec<SnowFall>,
}

impl MatterScratch {
    /// Chooses the tiles that take a step in this tick, in ascending order: spread over the ticks, so that none has to do all.
    pub(super) fn choose_due(&mut self, busy: &[u32], tick: u32, stride: u32) {
        self.tiles.clear();
        let phase = tick % stride;
        self.tiles.extend(busy.iter().copied().filter(|tile| tile.wrapping_mul(7) % stride == phase));
        self.tiles.sort_unstable();
    }
}

/// Binds what has dried, slides and melts what is due in this tick; returns how many tiles took a step. What fell off is in
/// `scratch.falls`. After the water has run.
pub(crate) fn advance_matter(
    water: &mut SurfaceWater,
    matter: &mut SurfaceMatter,
    now: &Now,
    weather: &Weather,
    scratch: &mut MatterScratch,
) -> u32 {
    let Some(matter) = matter.awake(water.size) else {
        // Meant for maps that are gone.
        water.dried.clear();
        return 0;
    };
    // Water that began anew while matter stayed: they share tiles.
    water.wake(now.material.leaves_marks());
    bind_dried(water, matter);
    slide(water, matter, now, scratch) + melt(water, matter, now, weather, scratch)
}

/// Whether [`advance_matter`] has nothing to do: then the surface costs nothing.
pub(crate) fn is_at_rest(water: &SurfaceWater, matter: &SurfaceMatter, weather: &Weather) -> bool {
    let thaws = weather.temperature_c > 0.0 && weather.drying_speed > 0.0;
    water.dried.is_empty() && matter.tiles.sliding.is_empty() && (matter.tiles.melting.is_empty() || !thaws)
}

#[cfg(test)]
mod tests {
    use super::super::test_world::{Ground, Place, assert_balanced, bump};
    use super::super::texel::MatterKind;
    use super::*;
    use rand_pcg::Pcg32;
    use rand_pcg::rand_core::Rng;

    /// Random things happen on a roof in changing weather.
    fn random_day(seed: u64, operations: u32, mut check: impl FnMut(&Ground, &Place, u32)) -> Ground {
        let mut place = Place::slope(52.0, 32, 0.004);
        let mut ground = Ground::dry(&place);
        let mut numbers = Pcg32::new(seed, 1);
        let mut random = |below: u32| numbers.next_u32() % below;
        let mut tick = 1;
        for _ in 0..operations {
            match random(8) {
                kind @ 0..=2 => {
                    let kind = [MatterKind::Dust, MatterKind::Mud, MatterKind::Snow][kind as usize];
                    let center = [0; 2].map(|_| random(32 * 256) as i32);
                    let radius = [0; 2].map(|_| 128 + random(6 * 256) as i32);
                    // Snow comes by the centimetre.
                    let most = if kind == MatterKind::Snow { 1_200_000 } else { 30_000 };
                    ground.put(&place, tick, bump(kind, random(most), center, radius));
                }
                3 | 4 => ground.rain(&place, tick, random(4)),
                5 if random(20) == 0 => {
                    ground.settle_all(&place, tick);
                    place = place.with_from(tick, |weather| {
                        weather.temperature_c = random(30) as f32 - 10.0;
                        weather.drying_speed = random(200) as f32;
                    });
                }
                _ => {
                    tick += 1;
                    ground.step(&place, tick);
                }
            }
            check(&ground, &place, tick);
        }
        ground
    }

    #[test]
    fn every_unit_is_accounted_for_whatever_happens() {
        let mut checks = 0;
        let ground = random_day(11, 10_000, |ground, place, tick| {
            checks += 1;
            assert_balanced(&ground.matter);
            if checks % 100 == 0 {
                ground.assert_water_balanced(place, tick);
            }
        });
        let ledger = ground.matter.ledger;
        // All of it has happened.
        assert!(ledger.washed_off > 0 && ledger.melted > 0 && ledger.slid_off > 0, "{ledger:?}");
        let stock = ground.matter.stock();
        assert!(stock.dust > 0 && stock.mud > 0, "{stock:?}");
    }

    #[test]
    fn the_same_day_ends_the_same() {
        let [one, other, another] = [3, 3, 4].map(|seed| random_day(seed, 2000, |_, _, _| {}));
        assert_eq!(one.matter.texels, other.matter.texels);
        assert_eq!(one.matter.ledger, other.matter.ledger);
        assert_eq!(one.scratch.falls, other.scratch.falls);
        assert_ne!(one.matter.texels, another.matter.texels);
    }

    #[test]
    fn snow_goes_on_sliding_where_the_water_under_it_began_anew() {
        let place = Place::slope(60.0, 32, 0.01).with(|weather| weather.temperature_c = -5.0);
        let mut ground = Ground::dry(&place);
        ground.put(&place, 1, bump(MatterKind::Snow, 900_000_000, [4096; 2], [15 * 256; 2]));
        ground.water.reset();
        assert!(!ground.water.is_wet());
        (2..=20 * Place::HZ).for_each(|tick| {
            ground.step(&place, tick);
        });
        assert!(ground.matter.ledger.slid_off > 0);
        assert_balanced(&ground.matter);
    }

    #[test]
    fn what_lies_at_rest_has_nothing_to_do() {
        let mild = Place::flat(32, 0.01).with(|weather| weather.drying_speed = 1.0);
        let frost = mild.clone().with(|weather| weather.temperature_c = -3.0);
        let mut ground = Ground::dry(&frost);
        let rests =
            |ground: &Ground, place: &Place| is_at_rest(&ground.water, &ground.matter, &place.weather);
        assert!(rests(&ground, &mild));
        let whole = |kind: MatterKind| bump(kind, 9_000, [4096; 2], [31 * 128; 2]);
        ground.put(&frost, 1, whole(MatterKind::Dust));
        assert!(rests(&ground, &mild));
        ground.put(&frost, 1, whole(MatterKind::Snow));
        (2..=2 * Place::HZ).for_each(|tick| {
            ground.step(&frost, tick);
        });
        assert!(rests(&ground, &frost) && !rests(&ground, &mild));
        assert_eq!(ground.matter.ledger.slid_off, 0);
    }
}
