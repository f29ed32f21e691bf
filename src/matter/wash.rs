//! Water moves matter: drops loosen it, films carry it, drips take it away, and what dries in place is bound.
//!
//! **Splash.** A drop that arrives breaks grains out of bound soil by its kinetic energy: per area `k KE exp(-b h)`, with the
//! detachability k of the soil, and a film of depth h for a cushion (Morgan et al. 1998, EUROSEM, after Poesen and Torri).
//! Depth and speed of the water are all it depends on, so rain and a hose follow one law: by its numbers 0.1 mm of mud is
//! gone after some 40 minutes of heavy rain (10 mm/h), or in a second or two under a hose at 8.8 m/s. What lies loose takes
//! less, [`LOOSE_G_PER_J`]: it shelters the soil below, until all of it floats. A drop with less energy than [`LEAST_DROP_J`]
//! moves no grain, so drizzle cleans nothing ([`loosening_speed`]); a jet pushes its cushion aside (`jet`).
//!
//! **Transport.** What drops and jets have lifted floats as long as the film is there, and goes where its water goes, on the
//! gentlest slope, up to [`MOST_LOAD`]. Of the grains that lie a film takes along what its unit stream power, speed times
//! slope, can carry (Govers 1990): what runs down a wall much, what creeps over a floor nothing. Either in proportion to the
//! water that leaves.
//!
//! **Crust.** When a film has dried up, the grains in it are bound. The water notes where that happened, whoever settled
//! the texel, and `bind_dried` is called before anything else becomes of one.
//!
//! Not here: grains that splash fly over; films that loosen bound soil by their shear; grains that sink again in standing
//! water; sizes of grain, of which the fine ones go farther.
//!
//! - Salles, Poesen and Govers 2000, *Statistical and physical analysis of soil detachment by raindrop impact*.
//! - Hairsine and Rose 1991, *Rainfall detachment and deposition*: loose grains shelter what lies below.
//! - Morgan, Quinton, Smith, Govers et al. 1998, *The European Soil Erosion Model (EUROSEM)*.
//! - Govers 1990, *Empirical relationships for the transport capacity of overland flow*.

use super::SurfaceMatter;
use super::jet::cleared_mm;
use crate::wetting::{Now, SurfaceWater};

/// k: what a joule of falling water detaches, g. Clay 1.7 to 2.4, loam and sand up to 3 (EUROSEM's guide).
pub const DETACHABILITY_G_PER_J: f64 = 2.0;

/// The same of grains that lie loose, g: the upper end of what is measured, 1 to 4, that of fine sand without cohesion.
pub const LOOSE_G_PER_J: f64 = 4.0;

/// E0: energy of a drop that moves no grain yet, J. 5 µJ for fine sand, 12 for silt loam (Salles et al. 2000): a drop of 1 mm at
/// the end of its fall.
pub const LEAST_DROP_J: f64 = 5.0e-6;

/// b: how much a film weakens a splash, 1/mm. 0.9 to 3.1; EUROSEM recommends 2.
pub const CUSHION_PER_MM: f64 = 2.0;

/// Density of grains, kg/m³: quartz.
pub const GRAIN_DENSITY: f64 = 2650.0;

/// Median size of the grains that films carry, µm: silt.
const GRAIN_UM: f32 = 50.0;

/// Unit stream power below which a film carries nothing, cm/s.
const CRITICAL_POWER: f32 = 0.4;

/// The most grains that water can hold and still run, by volume.
pub const MOST_LOAD: f32 = 0.2;

/// The same in 1/65,536, of what floats.
const AFLOAT_LOAD: u16 = (MOST_LOAD * 65_536.0) as u16;

/// Parts of water to one of grains in what drips as mud.
pub(crate) const MUDDY_WATER: u32 = 3;

/// Snow, in mm of water, under which splashes do not get at the soil.
const SHELTER_MM: f64 = 0.1;

/// Volume of bound soil that a splash loosens, per volume of its water: `k v² / 2 exp(-b h) / rho`. `speed` of the drop, m/s;
/// `film_mm` of the water that lay there before.
pub fn splash_part(speed: f64, film_mm: f64) -> f64 {
    // J per m² and mm, that is, per kg.
    let joules = 0.5 * speed * speed;
    DETACHABILITY_G_PER_J * joules * (-CUSHION_PER_MM * film_mm.max(0.0)).exp() / GRAIN_DENSITY
}

/// Speed at which water would have the energy that its drops have beyond [`LEAST_DROP_J`], m/s: detachment is `k (E - E0)`, so
/// `v sqrt(1 - E0 / E)`, and 0 below. `speed` of the drops, m/s; `drop_mm3` of water in each.
pub fn loosening_speed(speed: f64, drop_mm3: f64) -> f64 {
    // A cubic millimetre of water is a milligram.
    let energy = 0.5e-6 * drop_mm3 * speed * speed;
    if energy > LEAST_DROP_J { speed * (1.0 - LEAST_DROP_J / energy).sqrt() } else { 0.0 }
}

/// Concentration by volume that a film can carry, 0..=[`MOST_LOAD`]: `c (omega - 0.4)^n` with the unit stream power `omega`
/// in cm/s, `c = ((d50 + 5) / 0.32)^-0.6`, `n = ((d50 + 5) / 300)^0.25`. `speed` of the film, m/s; `sine` of its slope.
pub fn transport_capacity(speed: f32, sine: f32) -> f32 {
    let power = 100.0 * speed * sine - CRITICAL_POWER;
    if power.is_nan() || power <= 0.0 {
        return 0.0;
    }
    let factor = ((GRAIN_UM + 5.0) / 0.32).powf(-0.6);
    let exponent = ((GRAIN_UM + 5.0) / 300.0).powf(0.25);
    (factor * power.powf(exponent)).min(MOST_LOAD)
}

/// The same in 1/65,536.
pub(crate) fn load(speed: f32, sine: f32) -> u16 {
    (transport_capacity(speed, sine) * 65_536.0) as u16
}

/// Water that goes from one texel to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Moved {
    pub(crate) from: u32,
    pub(crate) to: u32,
    /// Of water.
    pub(crate) units: u32,
    /// Film of `from` as it is now, before they left, units.
    pub(crate) film: u32,
    /// What it can carry, by [`load`].
    pub(crate) load: u16,
}

/// Takes loose grains along with water: those that float, and those that it is fast enough for. In proportion to the film that
/// leaves, rounded down: what is rounded off stays.
pub(crate) fn carry_dust(water: &mut SurfaceWater, matter: &mut SurfaceMatter, moved: Moved) {
    bind_dried(water, matter);
    let dust = matter.texels[moved.from as usize].dust;
    let stirred = matter.stirred_on(moved.from);
    if dust == 0 || (moved.load == 0 && stirred == 0) {
        return;
    }
    let part = |grains: u32, load: u16| {
        let most = (u64::from(moved.units) * u64::from(load)) >> 16;
        dissolved(grains, moved.units, moved.film).min(most)
    };
    let afloat = part(stirred, AFLOAT_LOAD);
    matter.move_dust(moved.from, moved.to, part(dust, moved.load).max(afloat), afloat);
}

/// Takes loose grains off the surface with a drop that falls: whole nanolitres of them, which it returns, no more than fit into
/// [muddy drips](crate::wetting::muddy_drip_effect). `water_nl` of the drop; `film`: of the texel before it left, units.
pub(crate) fn wash_off(
    water: &mut SurfaceWater,
    matter: &mut SurfaceMatter,
    texel: u32,
    water_nl: u32,
    film: u32,
) -> u32 {
    bind_dried(water, matter);
    let dust = matter.texels[texel as usize].dust;
    let units = u32::try_from(water.units.from_nl(u64::from(water_nl))).unwrap_or(u32::MAX);
    let soil_nl = water.units.whole_nl(dissolved(dust, units, film));
    // With their water they are a particle, whose volume is a u32.
    let most_nl = (water_nl / MUDDY_WATER).min(u32::MAX / (MUDDY_WATER + 1));
    let soil_nl = u32::try_from(soil_nl).unwrap_or(u32::MAX).min(most_nl);
    matter.wash_off(texel, water.units.from_nl(u64::from(soil_nl)));
    soil_nl
}

/// Grains in `units` of a film that holds `dust`, evenly.
fn dissolved(dust: u32, units: u32, film: u32) -> u64 {
    u64::from(dust) * u64::from(units.min(film)) / u64::from(film.max(1))
}

/// Water of drops or, if `is_jet`, of a jet has come to a texel. Lifts what lies loose there by its energy, and loosens what is
/// bound by the rest. `units`: how much water, already in the film; `speed`: m/s.
pub(crate) fn splash(
    water: &mut SurfaceWater,
    matter: &mut SurfaceMatter,
    now: &Now,
    texel: u32,
    units: u64,
    speed: f64,
    is_jet: bool,
) {
    bind_dried(water, matter);
    let here = matter.texels[texel as usize];
    if here.soil() == 0 {
        return;
    }
    let unit_mm = now.scale(water.units, texel).unit_mm;
    if f64::from(here.snow) * unit_mm > SHELTER_MM {
        return;
    }
    let film = u64::from(water.texels[texel as usize].film).saturating_sub(units);
    let came_mm = units as f64 * unit_mm;
    let aside_mm = if is_jet { cleared_mm(came_mm * f64::from(now.hz), speed) } else { 0.0 };
    let loosens = units as f64 * splash_part(speed, film as f64 * unit_mm - aside_mm);
    let lifts = loosens * LOOSE_G_PER_J / DETACHABILITY_G_PER_J;
    let lifted = matter.stir(texel, lifts as u64);
    let left = if lifted > 0 { 1.0 - f64::from(lifted) / lifts } else { 1.0 };
    matter.loosen(texel, (loosens * left) as u64);
}

/// Where a film has dried up since this was called last, the grains in it are bound.
pub(crate) fn bind_dried(water: &mut SurfaceWater, matter: &mut SurfaceMatter) {
    while let Some(texel) = water.dried.pop() {
        if matter.bind(texel, u64::MAX) > 0 {
            let tile = water.tile_of(texel);
            water.tiles.touch(tile);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_world::{Ground, Place, assert_balanced};
    use super::super::texel::MatterKind;
    use super::*;
    use crate::material::PorousMaterial;

    /// Seconds until so much mud is loose, under so much water a second on every mm².
    fn seconds_to_clean(mud_mm: f64, mm_per_s: f64, speed: f64, film_mm: f64) -> f64 {
        mud_mm / (mm_per_s * splash_part(speed, film_mm))
    }

    #[test]
    fn a_hose_cleans_in_a_second_or_two_and_rain_in_tens_of_minutes() {
        // 15 l/min on a spot 20 cm wide, which stands in half a millimetre of its own water.
        let hose = seconds_to_clean(0.1, 0.25e6 / 31_416.0, 8.8, 0.5);
        assert!((0.5..2.5).contains(&hose), "{hose} s");
        let rain = seconds_to_clean(0.1, 10.0 / 3600.0, 6.5, 0.05) / 60.0;
        assert!((15.0..60.0).contains(&rain), "{rain} min");
        // Water that merely trickles loosens nothing worth mention, and a pool shelters its ground.
        assert!(splash_part(0.1, 0.0) < 1e-5);
        assert!(splash_part(8.0, 3.0) < 0.01 * splash_part(8.0, 0.0));
    }

    #[test]
    fn what_runs_down_a_wall_carries_much_and_what_creeps_nothing() {
        // A film of .1 mm on a wall, of .2 mm on a slope of one in a hundred, and of half a millimetre on a wall.
        assert!((0.05..0.15).contains(&transport_capacity(0.0327, 1.0)));
        assert_eq!(transport_capacity(0.0013, 0.01), 0.0);
        assert_eq!(transport_capacity(0.8, 1.0), MOST_LOAD);
        assert_eq!(transport_capacity(f32::NAN, 1.0), 0.0);
        assert_eq!(load(0.8, 1.0), 13_107);
    }

    #[test]
    fn water_takes_its_part_of_the_grains_but_no_more_than_it_can_carry() {
        let place = Place::flat(16, 0.01);
        let mut ground = Ground::new(&place);
        ground.matter.receive(5, MatterKind::Dust, 1000);
        let moved = Moved { from: 5, to: 6, units: 400, film: 1600, load: u16::MAX };
        carry_dust(&mut ground.water, &mut ground.matter, moved);
        assert_eq!((ground.matter.texels[5].dust, ground.matter.texels[6].dust), (750, 250));
        carry_dust(&mut ground.water, &mut ground.matter, Moved { load: 6554, ..moved });
        assert_eq!((ground.matter.texels[5].dust, ground.matter.texels[6].dust), (710, 290));
        // A drop takes whole nanolitres, and of very muddy water a third of its own.
        let units = |nl: u64| ground.water.units.from_nl(nl);
        let (whole, third) = (290 / units(1), units(33));
        assert_eq!(wash_off(&mut ground.water, &mut ground.matter, 6, 1000, 100), whole as u32);
        let washed_off = ground.matter.ledger.washed_off;
        assert_eq!(washed_off, whole * ground.water.units.from_nl(1));
        assert_eq!(u64::from(ground.matter.texels[6].dust), 290 - washed_off);
        ground.matter.receive(6, MatterKind::Dust, 1_000_000);
        assert_eq!(wash_off(&mut ground.water, &mut ground.matter, 6, 100, 100), 33);
        assert_eq!(ground.matter.ledger.washed_off, washed_off + third);
        assert_balanced(&ground.matter);
    }

    #[test]
    fn drops_loosen_mud_by_their_energy_and_snow_shelters_it() {
        let place = Place::flat(16, 0.01);
        let mut ground = Ground::new(&place);
        let loosened = |ground: &mut Ground, texel, speed| {
            ground.matter.receive(texel, MatterKind::Mud, 1_000_000);
            ground.water.texels[texel as usize].film = 10_000;
            splash(&mut ground.water, &mut ground.matter, &place.now(1), texel, 10_000, speed, false);
            ground.matter.texels[texel as usize].dust
        };
        let (slow, fast) = (loosened(&mut ground, 1, 3.0), loosened(&mut ground, 2, 9.0));
        assert!(slow > 20 && fast.abs_diff(9 * slow) <= 9, "{slow} {fast}");
        ground.matter.receive(3, MatterKind::Snow, 1_000_000);
        assert_eq!(loosened(&mut ground, 3, 9.0), 0);
        assert_balanced(&ground.matter);
    }

    #[test]
    fn loose_grains_are_lifted_first_and_what_energy_is_left_loosens_soil() {
        let place = Place::flat(16, 0.01);
        let mut ground = Ground::new(&place);
        let mut strike = |texel: u32, dust: u64, mud: u64| {
            ground.matter.receive(texel, MatterKind::Dust, dust);
            ground.matter.receive(texel, MatterKind::Mud, mud);
            ground.water.texels[texel as usize].film = 10_000;
            splash(&mut ground.water, &mut ground.matter, &place.now(1), texel, 10_000, 3.0, false);
            assert_balanced(&ground.matter);
            (ground.matter.stirred_on(texel), ground.matter.texels[texel as usize].mud)
        };
        // 4 g/J of 4.5 J/kg are 0.0068 of the water by volume, half as much of bound soil.
        assert_eq!(strike(1, 100_000, 500), (67, 500));
        assert_eq!(strike(2, 0, 500), (33, 467));
        // No more than there is; 50 of 67.9 leave 26 % of the energy.
        assert_eq!(strike(3, 50, 500), (58, 492));
        assert_eq!(strike(4, 0, 0), (0, 0));
    }

    #[test]
    fn heavy_rain_cleans_a_roof_within_the_hour_and_drizzle_does_not() {
        use crate::effect::drops::{DropSizes, drop_mm3, fall_speed};
        // g/m² and hour of loose grains, of drops that are no faster than this.
        let lifts = |rate: f32, fastest: f64| {
            let diameters = DropSizes::MarshallPalmer(rate).diameters_mm();
            let joules = diameters.iter().map(|&mm| {
                let speed = fall_speed(f64::from(mm)).min(fastest);
                0.5 * loosening_speed(speed, f64::from(drop_mm3(mm))).powi(2)
            });
            f64::from(rate) * joules.sum::<f64>() / diameters.len() as f64 * LOOSE_G_PER_J
        };
        let (rain, drizzle) = (lifts(10.0, f64::MAX), lifts(0.5, 2.0));
        // A thick cover of dust is 100 g/m². Some 200 J/m² fall in the hour.
        assert!((500.0..1000.0).contains(&rain), "{rain}");
        assert!(drizzle < 1.0, "{drizzle}");
        // A drop of 2 mm has 90 µJ, one of half a millimetre 0.2.
        assert!((loosening_speed(6.55, 4.189) - 6.365).abs() < 0.002);
        assert_eq!([loosening_speed(2.0, 0.065), loosening_speed(f64::NAN, 1.0)], [0.0, 0.0]);
    }

    #[test]
    fn what_floats_goes_with_water_that_creeps_and_is_bound_when_it_dries() {
        let place = Place::flat(16, 0.01).with(|weather| weather.drying_speed = 3600.0);
        let mut ground = Ground::new(&place);
        ground.matter.receive(5, MatterKind::Dust, 1000);
        let moved = Moved { from: 5, to: 6, units: 400, film: 1600, load: 0 };
        carry_dust(&mut ground.water, &mut ground.matter, moved);
        assert_eq!(ground.matter.texels[6].dust, 0);
        ground.matter.stir(5, 200);
        carry_dust(&mut ground.water, &mut ground.matter, moved);
        assert_eq!((ground.matter.texels[6].dust, ground.matter.stirred_on(6)), (50, 50));
        // A fifth of the water at most.
        ground.matter.stir(5, 800);
        carry_dust(&mut ground.water, &mut ground.matter, moved);
        assert_eq!((ground.matter.texels[6].dust, ground.matter.stirred_on(5)), (129, 871));
        ground.water.dried.push(6);
        bind_dried(&mut ground.water, &mut ground.matter);
        assert_eq!((ground.matter.texels[6].mud, ground.matter.stirred_on(6)), (129, 0));
        assert_balanced(&ground.matter);
    }

    #[test]
    fn a_film_that_dries_up_binds_the_grains_in_it() {
        let place = Place::flat(16, 0.01).with(|weather| weather.drying_speed = 3600.0);
        let mut ground = Ground::new(&place);
        ground.matter.receive(20, MatterKind::Dust, 5000);
        ground.matter.receive(21, MatterKind::Dust, 5000);
        let wet = ground.film_mm(&place, 20, 0.02);
        ground.water.add(&place.now(1), 20, wet);
        ground.water.ledger.received += wet;
        // Still wet after a moment, dry after a minute that is an hour and more.
        ground.water.settle(&place.now(2), 20);
        bind_dried(&mut ground.water, &mut ground.matter);
        assert_eq!(ground.matter.texels[20].dust, 5000);
        let late = place.now(60 * Place::HZ);
        ground.water.settle(&late, 20);
        ground.water.settle(&late, 21);
        bind_dried(&mut ground.water, &mut ground.matter);
        assert_eq!((ground.matter.texels[20].dust, ground.matter.texels[20].mud), (0, 5000));
        assert_eq!((ground.matter.texels[21].dust, ground.matter.texels[21].mud), (5000, 0));
        assert_balanced(&ground.matter);
    }

    #[test]
    fn what_has_been_absorbed_carries_no_grains_whether_it_was_looked_at_or_not() {
        let mut place = Place::slope(30.0, 32, 0.01);
        place.material = PorousMaterial { sorptivity: 2.0, capacity_mm: 3.0, ..place.material };
        let tick = Place::HZ;
        let dust_after = |settles: bool| {
            let mut ground = Ground::new(&place);
            for texel in 0..place.texels() {
                let units = ground.film_mm(&place, texel, 0.02);
                ground.matter.receive(texel, MatterKind::Dust, units);
            }
            // A quarter of a millimetre of it is in the pores a second later.
            ground.water.cover(&place.geometry, 0.8, 0.0, 1);
            if settles {
                ground.settle_all(&place, tick);
            }
            ground.step(&place, tick);
            ground.matter.texels().iter().map(|texel| texel.dust).collect::<Vec<_>>()
        };
        let (settled, unsettled) = (dust_after(true), dust_after(false));
        assert!(settled.iter().any(|&dust| dust != settled[40]), "nothing was carried");
        for (texel, (one, other)) in settled.iter().zip(&unsettled).enumerate() {
            assert!(one.abs_diff(*other) <= 20 + one / 500, "{texel}: {one} {other}");
        }
    }

    #[test]
    fn rain_washes_a_dusty_slope_down() {
        let place = Place::slope(45.0, 32, 0.01);
        let mut ground = Ground::new(&place);
        for texel in 0..32 * 32 {
            let units = ground.film_mm(&place, texel, 0.02);
            ground.matter.receive(texel, MatterKind::Dust, units);
        }
        let soil = |ground: &Ground, rows: std::ops::Range<u32>| {
            let texels = rows.start * 32..rows.end * 32;
            texels.map(|texel| ground.matter.texels[texel as usize].soil()).sum::<u64>()
        };
        let (upper, lowest) = (soil(&ground, 0..16), soil(&ground, 31..32));
        let mut most = 0;
        for tick in 1..=20 * Place::HZ {
            ground.rain(&place, tick, 60);
            ground.step(&place, tick);
            most = most.max(soil(&ground, 31..32));
        }
        assert!(soil(&ground, 0..16) < upper / 2, "{} of {upper}", soil(&ground, 0..16));
        let washed_off = ground.matter.ledger.washed_off;
        assert!(10 * most > 11 * lowest && washed_off > 0, "{most} {lowest} {washed_off}");
        assert_eq!(soil(&ground, 0..32) + washed_off, ground.matter.ledger.received_dust);
        ground.assert_water_balanced(&place, 20 * Place::HZ);
    }
}
