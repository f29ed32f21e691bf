//! Snow that slides: off steep places, and down from piles of itself.
//!
//! On ground less steep than its angle of repose all snow stays. On steeper ground friction holds a part of its weight, and
//! cohesion a thin layer, `h = c / (rho g (sin b - cos b tan phi))`: Coulomb's law on an infinite slope (McClung and Schaerer
//! 2006, *The Avalanche Handbook*). What is more slides to the neighbour *on the mesh* to which the surface of the snow falls
//! most steeply. The snow itself is a slope, too: a pile steeper than the angle of repose slides apart, so that below a
//! roof there is a cone and no column.
//!
//! Stable for any step: a texel gives to one neighbour, and no more than a quarter of what stands above the angle of repose.
//! The price is that snow creeps where it is much deeper than texels are wide. Where a steep surface ends, snow gathers to a
//! clump and falls ([`SnowFall`]); a level rim holds its snow.
//!
//! Not here: slabs that break off as a whole; speed that sliding snow gains; dust that slides along.

use super::snow::RELATIVE_DENSITY;
use super::{MatterScratch, MatterTiles, SurfaceMatter};
use crate::overlay::TILE_SIZE;
use crate::wetting::{DripSite, Link, Now, Side, SurfaceWater, texel_in};

/// Steps a second.
pub const STEPS_PER_SECOND: u32 = 15;

/// tan phi: of the angle of repose, 35°.
const REPOSE: f64 = 0.7002;

/// c: cohesion of fresh snow to what it lies on, Pa. Holds 5 mm of snow on a wall, 1 cm at 60°.
const COHESION_PA: f64 = 5.0;

/// Density of fresh snow, kg/m³, and gravity, m/s².
const DENSITY: f64 = 1000.0 * RELATIVE_DENSITY;
const GRAVITY: f64 = 9.81;

/// What is held varies from place to place between these parts of the law's, so that snow does not come off all at once.
const LEAST_HELD: f64 = 0.6;
const MOST_HELD: f64 = 1.4;

/// Moves of less, in mm of snow, are at rest.
const LEAST_MM: f64 = 0.02;

/// A clump falls when it is this large, mm³ of water.
const CLUMP_MM3: f64 = 10.0;

/// Snow falls from what looks down more than this.
const OVERHANG: f32 = -0.25;

/// Snow that falls off a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SnowFall {
    /// The texel it leaves.
    pub texel: u32,
    /// From where on it.
    pub site: DripSite,
    /// Whole nanolitres of water, in the surface's units.
    pub units: u32,
}

/// Snow from one texel to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Slip {
    from: u32,
    to: u32,
    units: u32,
}

/// The depth of snow that a slope holds, mm of snow; infinite up to the angle of repose. `facing_up`: cosine of the slope.
pub fn held_mm(facing_up: f64) -> f64 {
    let cosine = facing_up.clamp(-1.0, 1.0);
    let pull = (1.0 - cosine * cosine).sqrt() - cosine * REPOSE;
    if pull <= 0.0 { f64::INFINITY } else { 1000.0 * COHESION_PA / (DENSITY * GRAVITY * pull) }
}

/// Slides what is due in this tick; returns how many tiles took a step.
pub(super) fn slide(
    water: &mut SurfaceWater,
    matter: &mut SurfaceMatter,
    now: &Now,
    scratch: &mut MatterScratch,
) -> u32 {
    if matter.tiles.sliding.is_empty() {
        return 0;
    }
    scratch.choose_due(&matter.tiles.sliding, now.tick, (now.hz / STEPS_PER_SECOND).max(1));
    let MatterScratch { tiles, slips, falls, .. } = scratch;
    if tiles.is_empty() {
        return 0;
    }
    for &tile in tiles.iter() {
        slips.clear();
        let before = falls.len();
        for local in 0..(TILE_SIZE * TILE_SIZE) as usize {
            let texel = texel_in(water.size, tile, local);
            if matter.texels[texel as usize].snow > 0 {
                look_at(water, matter, now, texel, slips, falls);
            }
        }
        // Clumps fall at the end of the step: all has been seen as it was before.
        for fall in &falls[before..] {
            matter.slide_off(fall.texel, u64::from(fall.units));
            wake_around(water, matter, now, fall.texel);
        }
        for slip in slips.iter() {
            matter.move_snow(slip.from, slip.to, u64::from(slip.units));
            let target = water.tile_of(slip.to);
            water.tiles.touch(target);
            matter.tiles.melt(target);
            matter.tiles.slide(target);
            wake_around(water, matter, now, slip.from);
        }
        if slips.is_empty() && falls.len() == before {
            matter.tiles.flags[tile as usize] &= !MatterTiles::SNOW_MOVES;
        } else {
            water.tiles.touch(tile);
        }
    }
    matter.tiles.prune();
    tiles.len() as u32
}

/// Snow above what has gone may slide after it.
fn wake_around(water: &SurfaceWater, matter: &mut SurfaceMatter, now: &Now, texel: u32) {
    for side in Side::ALL {
        if let Link::Texel(other) = now.geometry.link(texel, side) {
            let tile = water.tile_of(other);
            if matter.tiles.has(tile, MatterTiles::MELTS) {
                matter.tiles.slide(tile);
            }
        }
    }
}

/// Where the surface of a texel's snow falls most steeply.
enum Way {
    To(u32),
    Over(Side),
}

/// Writes down what of a texel's snow slides, and where to.
fn look_at(
    water: &SurfaceWater,
    matter: &SurfaceMatter,
    now: &Now,
    texel: u32,
    slips: &mut Vec<Slip>,
    falls: &mut Vec<SnowFall>,
) {
    let (geometry, heights) = (now.geometry, now.geometry.height());
    let snow_mm = |texel: u32| {
        let snow = f64::from(matter.texels[texel as usize].snow);
        snow * geometry.unit_mm(water.units, texel) / RELATIVE_DENSITY
    };
    let rise = |texel: u32, depth: f64| depth * f64::from(geometry.facing_up(texel).max(0.0));
    let units_of = |mm: f64| (mm * RELATIVE_DENSITY / geometry.unit_mm(water.units, texel)) as u64;
    let depth = snow_mm(texel);
    let held = held_mm(f64::from(geometry.facing_up(texel))) * varied(texel);
    // On level ground all of a pile may move; how much does is said by its slope.
    let free = if held.is_finite() { depth - held } else { depth };
    if free <= 0.0 {
        return;
    }
    if geometry.facing_up(texel) < OVERHANG {
        fall(water, texel, DripSite::Overhang, units_of(free), falls);
        return;
    }
    let (own, mut steepest, mut way) = (heights[texel as usize], 0.0, None);
    for side in Side::ALL {
        let distance = f64::from(geometry.distance(texel, side)).max(1e-6) * 1000.0;
        let (ground, snow, target) = match geometry.link(texel, side) {
            Link::Texel(other) => {
                let ground = f64::from(own - heights[other as usize]) * 1000.0;
                (ground, rise(texel, depth) - rise(other, snow_mm(other)), Way::To(other))
            }
            // Beyond the edge the surface would go on as it came.
            Link::Edge => match geometry.link(texel, side.opposite()) {
                Link::Texel(behind) => {
                    (f64::from(heights[behind as usize] - own) * 1000.0, 0.0, Way::Over(side))
                }
                Link::Edge => continue,
            },
        };
        let run = (distance * distance - ground * ground).max(0.0).sqrt();
        let too_high = ground + snow - run * REPOSE;
        if too_high > steepest {
            (steepest, way) = (too_high, Some(target));
        }
    }
    match way {
        Some(Way::To(to)) => {
            let mm = free.min(0.25 * steepest);
            let units = units_of(mm);
            if mm > LEAST_MM && units > 0 {
                slips.push(Slip { from: texel, to, units: u32::try_from(units).unwrap_or(u32::MAX) });
            }
        }
        Some(Way::Over(side)) => fall(water, texel, DripSite::Edge(side), units_of(free), falls),
        None => {}
    }
}

/// Lets a clump go if it is large enough; whole nanolitres, since a particle carries those.
fn fall(water: &SurfaceWater, texel: u32, site: DripSite, units: u64, falls: &mut Vec<SnowFall>) {
    if water.units.mm3(units) < CLUMP_MM3 {
        return;
    }
    let most = u64::from(u32::MAX >> water.units.shift);
    let units = water.units.from_nl(water.units.whole_nl(units).min(most));
    falls.push(SnowFall { texel, site, units: units as u32 });
}

/// A little more is held here, a little less there.
fn varied(texel: u32) -> f64 {
    let hash = texel.wrapping_mul(0x9e37_79b9) ^ 0x2545_f491;
    let hash = (hash ^ (hash >> 15)).wrapping_mul(0x85eb_ca6b);
    LEAST_HELD + (MOST_HELD - LEAST_HELD) * f64::from(hash >> 8) / f64::from(1u32 << 24)
}

#[cfg(test)]
mod tests {
    use super::super::test_world::{Ground, Place, assert_balanced};
    use super::super::texel::MatterKind;
    use super::*;

    fn snow_on(ground: &mut Ground, place: &Place, texel: u32, mm_of_water: f64) {
        let units = ground.film_mm(place, texel, mm_of_water);
        ground.matter.receive(texel, MatterKind::Snow, units);
        let tile = ground.water.tile_of(texel);
        ground.matter.tiles.melt(tile);
        ground.matter.tiles.slide(tile);
    }

    /// Deep frost, and so much snow everywhere, for so long.
    fn after(place: &Place, mm_of_water: f64, seconds: u32) -> Ground {
        let mut ground = Ground::new(place);
        for texel in 0..place.texels() {
            snow_on(&mut ground, place, texel, mm_of_water);
        }
        for tick in 1..=seconds * Place::HZ {
            ground.step(place, tick);
        }
        assert_balanced(&ground.matter);
        ground
    }

    fn frosty(place: Place) -> Place {
        place.with(|weather| weather.temperature_c = -10.0)
    }

    #[test]
    fn a_slope_holds_all_or_a_thin_layer() {
        let at = |degrees: f64| held_mm(degrees.to_radians().cos());
        assert_eq!([at(0.0), at(20.0), at(34.0)], [f64::INFINITY; 3]);
        assert!((9.0..11.0).contains(&at(60.0)), "{}", at(60.0));
        assert!((5.0..5.2).contains(&at(90.0)), "{}", at(90.0));
        assert!(at(36.0) > at(40.0) && at(40.0) > at(50.0) && at(50.0) > at(60.0));
    }

    #[test]
    fn snow_keeps_on_the_flat_and_slides_at_sixty_degrees() {
        for (degrees, stays) in [(0.0, true), (30.0, true), (60.0, false)] {
            let ground = after(&frosty(Place::slope(degrees, 32, 0.01)), 4.0, 120);
            let (left, came) = (ground.matter.stock().snow, ground.matter.ledger.received_snow);
            assert_eq!(left == came, stays, "{degrees}: {left} of {came}");
            if !stays {
                // About a centimetre of the four stays.
                let part = left as f64 / came as f64;
                assert!((0.15..0.4).contains(&part), "{part}");
                let fallen: u64 = ground.scratch.falls.iter().map(|fall| u64::from(fall.units)).sum();
                assert_eq!(fallen, ground.matter.ledger.slid_off);
                let whole = |units: u32| units.is_multiple_of(1 << ground.water.units.shift);
                assert!(ground.scratch.falls.iter().all(|fall| whole(fall.units)));
            }
            assert!(ground.matter.tiles.sliding.is_empty(), "{degrees}: at rest");
        }
    }

    #[test]
    fn a_column_slides_apart_to_a_cone_no_steeper_than_snow_can_lie() {
        let place = frosty(Place::flat(32, 0.01));
        let mut ground = Ground::new(&place);
        let middle = 16 * 32 + 16;
        snow_on(&mut ground, &place, middle, 40.0);
        for tick in 1..=60 * Place::HZ {
            ground.step(&place, tick);
        }
        assert!(ground.matter.tiles.sliding.is_empty());
        assert_eq!(ground.matter.stock().snow, ground.matter.ledger.received_snow);
        let snow = |texel: u32| {
            let unit_mm = place.geometry.unit_mm(ground.water.units, texel);
            f64::from(ground.matter.texels[texel as usize].snow) * unit_mm / RELATIVE_DENSITY
        };
        for y in 1..31 {
            for x in 1..31 {
                let texel = y * 32 + x;
                for other in [texel - 1, texel + 1, texel - 32, texel + 32] {
                    let steep = (snow(texel) - snow(other)) / 10.0;
                    assert!(steep < REPOSE + 0.02, "{x} {y}: {steep}");
                }
            }
        }
        assert!(snow(middle) > 15.0 && snow(middle - 1) > 0.0, "{}", snow(middle));
    }

    #[test]
    fn nothing_takes_a_step_where_snow_lies_at_rest() {
        let place = frosty(Place::flat(32, 0.01));
        let mut ground = after(&place, 2.0, 1);
        let steps = (1000..1000 + Place::HZ).map(|tick| ground.step(&place, tick)).sum::<u32>();
        assert_eq!(steps, 0);
    }
}
