//! Snow: arrives, lies, melts.
//!
//! **Arrival.** Flakes stay where the air is about at freezing (Jennings et al. 2018: half of what falls is snow at 1.0 °C,
//! from -0.4 to 2.4 by region) and where snow lies already. On warmer, bare ground a part melts at once, more of it where a
//! film conducts the heat.
//!
//! **Melt.** By degree-days and radiation, `M = f max(T, 0) + a sun` (Hock 2003; Pellicciotti et al. 2005), in steps of half a
//! second, only while it is warmer than 0 °C, on the tiles on which snow lies. Units of snow are units of water: what melts
//! is in the film, to the unit. [`Weather::drying_speed`] speeds it up as it does drying: one lapse of time for both.
//!
//! **Rain** melts by its heat: `c_w T / L`, an eightieth of its amount for each degree.
//!
//! How snow slides is told in `slide`.
//!
//! Not here: meltwater that the snow holds, and that freezes again; snow that settles, grows old and gets dirty; frost.
//!
//! - Hock 2003, *Temperature index melt modelling in mountain areas*.
//! - Pellicciotti et al. 2005, *An enhanced temperature-index glacier melt model*.
//! - Jennings, Winchell, Livneh, Molotch 2018, *Spatial variation of the rain-snow temperature threshold*.

use super::texel::MatterKind;
use super::wash::bind_dried;
use super::{MatterScratch, MatterTiles, SurfaceMatter};
use crate::overlay::TILE_SIZE;
use crate::weather::Weather;
use crate::wetting::{Now, SurfaceWater, jitter, note_arrival, texel_in};

/// Density of fresh snow over that of water: 1 mm of water is 10 mm of snow.
pub const RELATIVE_DENSITY: f64 = 0.1;

/// Steps of melting a second.
pub const STEPS_PER_SECOND: u32 = 2;

/// Warmest air, °C, in which all flakes stay on bare ground.
pub const STAYS_BELOW_C: f64 = 1.5;

/// Air, °C, in which no flake stays on wet bare ground.
pub const MELTS_ABOVE_C: f64 = 5.0;

/// Part of what melts at once on wet ground that does on dry.
const DRY_CONTACT: f64 = 0.5;

/// Snow, in mm of water, that keeps all but 1/e of new flakes from the warm ground.
const SHIELD_MM: f64 = 0.2;

/// f: what a day one degree above freezing melts, mm. Hock's table for snow: 2.5 to 6.
pub const DEGREE_DAY_MM: f64 = 4.5;

/// Heat of fusion, J/kg.
pub const FUSION_J_PER_KG: f64 = 3.34e5;

/// Heat capacity of water, J/(kg K).
pub const WATER_J_PER_KG_K: f64 = 4190.0;

/// Part of the sun's power that snow takes in.
const ABSORBED: f64 = 0.2;

const DAY_SECONDS: f64 = 86_400.0;

/// Part of arriving snow that melts at once, 0..=1. `lying_mm` of snow there, as water; `is_wet`: the ground.
pub fn melted_at_once(air_c: f64, lying_mm: f64, is_wet: bool) -> f64 {
    let warmth = (air_c - STAYS_BELOW_C) / (MELTS_ABOVE_C - STAYS_BELOW_C);
    if warmth.is_nan() || warmth <= 0.0 {
        return 0.0;
    }
    let contact = if is_wet { 1.0 } else { DRY_CONTACT };
    warmth.min(1.0) * contact * (-lying_mm.max(0.0) / SHIELD_MM).exp()
}

/// Water that snow melts to in a day, mm. `sun`: power on it, W/m². 0 at and below 0 °C.
pub fn melt_mm_per_day(air_c: f64, sun: f64) -> f64 {
    if air_c.is_nan() || air_c <= 0.0 {
        return 0.0;
    }
    DEGREE_DAY_MM * air_c.min(60.0) + ABSORBED * sun.clamp(0.0, 1400.0) * DAY_SECONDS / FUSION_J_PER_KG
}

/// Snow that rain of this temperature melts, per volume of rain: `c_w T / L`.
pub fn melted_by_rain(rain_c: f64) -> f64 {
    if rain_c.is_nan() { 0.0 } else { WATER_J_PER_KG_K / FUSION_J_PER_KG * rain_c.clamp(0.0, 100.0) }
}

/// Snow of an impact comes to a texel.
pub(super) fn arrive(
    water: &mut SurfaceWater,
    matter: &mut SurfaceMatter,
    now: &Now,
    weather: &Weather,
    texel: u32,
    units: u64,
    is_wet: bool,
) {
    let unit_mm = now.scale(water.units, texel).unit_mm;
    let lying = f64::from(matter.texels[texel as usize].snow) * unit_mm;
    let part = melted_at_once(f64::from(weather.temperature_c), lying, is_wet);
    matter.receive(texel, MatterKind::Snow, units);
    let melted = matter.melt(texel, (units as f64 * part) as u64);
    drench(water, matter, now, texel, melted);
    if matter.texels[texel as usize].snow > 0 {
        let tile = water.tile_of(texel);
        matter.tiles.melt(tile);
        matter.tiles.slide(tile);
        water.tiles.touch(tile);
    }
}

/// Rain has come to a texel, and melts some of the snow there. `units`: of rain.
pub(crate) fn rain_on_snow(
    water: &mut SurfaceWater,
    matter: &mut SurfaceMatter,
    now: &Now,
    weather: &Weather,
    texel: u32,
    units: u64,
) {
    if matter.texels[texel as usize].snow > 0 {
        let melted = units as f64 * melted_by_rain(f64::from(weather.temperature_c));
        let melted = matter.melt(texel, melted as u64);
        drench(water, matter, now, texel, melted);
    }
}

/// Melts what is due in this tick; returns how many tiles were visited.
pub(super) fn melt(
    water: &mut SurfaceWater,
    matter: &mut SurfaceMatter,
    now: &Now,
    weather: &Weather,
    scratch: &mut MatterScratch,
) -> u32 {
    let air = f64::from(weather.temperature_c);
    if matter.tiles.melting.is_empty() || melt_mm_per_day(air, 0.0) <= 0.0 {
        return 0;
    }
    let stride = (now.hz / STEPS_PER_SECOND).max(1);
    scratch.choose_due(&matter.tiles.melting, now.tick, stride);
    if scratch.tiles.is_empty() {
        return 0;
    }
    let days = f64::from(stride) / f64::from(now.hz) / DAY_SECONDS;
    let days = days * f64::from(weather.drying_speed.clamp(0.0, 1.0e6));
    let tiles = std::mem::take(&mut scratch.tiles);
    for &tile in &tiles {
        let mut is_bare = true;
        for local in 0..(TILE_SIZE * TILE_SIZE) as usize {
            let texel = texel_in(water.size, tile, local);
            if matter.texels[texel as usize].snow == 0 {
                continue;
            }
            let lit = now.exposure.map_or(0.0, |exposure| exposure.at(texel).1);
            let mm = days * melt_mm_per_day(air, lit * f64::from(weather.sun_w_per_m2));
            // What is less than a unit melts every now and then.
            let units = mm / now.scale(water.units, texel).unit_mm + jitter(texel, now.tick);
            let melted = matter.melt(texel, units as u64);
            drench(water, matter, now, texel, melted);
            is_bare &= matter.texels[texel as usize].snow == 0;
        }
        if is_bare {
            matter.tiles.flags[tile as usize] &= !MatterTiles::MELTS;
        }
    }
    matter.tiles.prune();
    scratch.tiles = tiles;
    scratch.tiles.len() as u32
}

/// Puts meltwater on a texel, as the rain that it was on its way.
fn drench(water: &mut SurfaceWater, matter: &mut SurfaceMatter, now: &Now, texel: u32, units: u32) {
    if units == 0 {
        return;
    }
    let tile = water.add(now, texel, u64::from(units));
    bind_dried(water, matter);
    note_arrival(water, now, texel, tile);
    water.ledger.received += u64::from(units);
    water.rained_at = now.tick;
}

#[cfg(test)]
mod tests {
    use super::super::test_world::{Ground, Place, assert_balanced};
    use super::*;

    fn snowed_in(place: &Place, mm: f64) -> Ground {
        let mut ground = Ground::new(place);
        for texel in 0..place.texels() {
            let units = ground.film_mm(place, texel, mm);
            ground.matter.receive(texel, MatterKind::Snow, units);
            let tile = ground.water.tile_of(texel);
            ground.matter.tiles.melt(tile);
        }
        ground
    }

    #[test]
    fn flakes_stay_in_the_cold_and_on_snow_and_go_on_warm_wet_ground() {
        assert_eq!(melted_at_once(1.5, 0.0, true), 0.0);
        assert_eq!(melted_at_once(9.0, 0.0, true), 1.0);
        let (wet, dry) = (melted_at_once(3.0, 0.0, true), melted_at_once(3.0, 0.0, false));
        assert!(wet > dry && dry > 0.0 && wet < 1.0);
        assert!(melted_at_once(3.0, 1.0, true) < 0.01);
        assert_eq!(melted_at_once(f64::NAN, 0.0, true), 0.0);
    }

    #[test]
    fn a_warm_day_melts_centimetres_of_snow_and_the_sun_as_much_again() {
        let shade = melt_mm_per_day(5.0, 0.0);
        assert!((20.0..25.0).contains(&shade), "{shade}");
        // 600 W/m² that never set.
        assert!((melt_mm_per_day(5.0, 600.0) - shade - 31.0).abs() < 0.2);
        assert_eq!([melt_mm_per_day(0.0, 900.0), melt_mm_per_day(-5.0, 900.0)], [0.0; 2]);
        // 10 mm of rain at 8 °C have the heat for one of snow.
        assert!((10.0 * melted_by_rain(8.0) - 1.0).abs() < 0.01);
        assert_eq!(melted_by_rain(-3.0), 0.0);
    }

    #[test]
    fn snow_melts_into_exactly_as_much_water() {
        let place = Place::flat(32, 0.01).with(|weather| {
            weather.temperature_c = 6.0;
            weather.humidity = 1.0;
            weather.drying_speed = 360.0;
        });
        let mut ground = snowed_in(&place, 0.5);
        let snow = ground.matter.stock().snow;
        // Six minutes a second: it takes four of them.
        let ticks = 30 * Place::HZ;
        for tick in 1..=ticks {
            ground.step(&place, tick);
            if tick == Place::HZ {
                assert!(ground.matter.stock().snow > snow / 2);
            }
            assert_eq!(ground.water.ledger.received, ground.matter.ledger.melted);
        }
        assert_eq!((ground.matter.stock().snow, ground.matter.ledger.melted), (0, snow));
        assert!(ground.matter.tiles.melting.is_empty());
        assert_balanced(&ground.matter);
        ground.assert_water_balanced(&place, ticks);
    }

    #[test]
    fn melting_is_as_fast_as_the_formula_says_however_fine_the_units() {
        // In the last case less than three units a step.
        for (metres, speed) in [(0.001, 60.0), (0.05, 60.0), (0.05, 0.01)] {
            let place = Place::flat(16, metres).with(|weather| {
                weather.temperature_c = 4.0;
                weather.drying_speed = speed;
            });
            let mut ground = snowed_in(&place, 1.0);
            let before = ground.matter.stock().snow as f64;
            for tick in 1..=20 * Place::HZ {
                ground.step(&place, tick);
            }
            let gone = 1.0 - ground.matter.stock().snow as f64 / before;
            let expected = melt_mm_per_day(4.0, 0.0) * 20.0 * f64::from(speed) / DAY_SECONDS;
            assert!((gone / expected - 1.0).abs() < 0.03, "{metres} {speed}: {gone} {expected}");
        }
    }

    #[test]
    fn nothing_melts_in_the_frost() {
        let place = Place::flat(16, 0.01).with(|weather| {
            weather.temperature_c = -0.5;
            weather.sun_w_per_m2 = 900.0;
            weather.drying_speed = 3600.0;
        });
        let mut ground = snowed_in(&place, 0.1);
        let snow = ground.matter.stock().snow;
        for tick in 1..=10 * Place::HZ {
            ground.step(&place, tick);
            rain_on_snow(&mut ground.water, &mut ground.matter, &place.now(tick), &place.weather, 7, 1000);
        }
        assert_eq!((ground.matter.stock().snow, ground.matter.ledger.melted), (snow, 0));
        assert!(ground.water.texels.iter().all(|texel| texel.is_dry()));
    }

    #[test]
    fn warm_rain_melts_by_its_heat() {
        let place = Place::flat(16, 0.01).with(|weather| weather.temperature_c = 10.0);
        let mut ground = snowed_in(&place, 1.0);
        let before = ground.matter.texels[9].snow;
        rain_on_snow(&mut ground.water, &mut ground.matter, &place.now(1), &place.weather, 9, 100_000);
        let melted = before - ground.matter.texels[9].snow;
        assert!(melted.abs_diff(12_545) <= 1, "{melted}");
        assert_eq!(ground.water.texels[9].film, melted);
        assert_balanced(&ground.matter);
    }
}
