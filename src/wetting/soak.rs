//! Water that comes: drops are shared out among the texels under their stamps.

use super::run_off::LEAST_RETAINED;
use super::surface::{Now, SurfaceWater, Tiles};
use crate::matter::SurfaceMatter;
use crate::matter::snow::rain_on_snow;
use crate::matter::wash::splash;
use crate::overlay::Splat;
use crate::overlay::kernel::{axis_coverage, share};
use crate::weather::Weather;

/// Water of an impact, not yet on its surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Drop {
    /// Middle of the stamp, 1/256 texel.
    pub center: [i32; 2],
    /// Half its width and height, 1/256 texel.
    pub radius: [i32; 2],
    /// Nanolitres.
    pub water_nl: u32,
    /// Speed at which it came, mm/s: what it loosens.
    pub speed_mm: u32,
}

/// Buffers that keep their memory from tick to tick.
#[derive(Debug, Default)]
pub(crate) struct SoakScratch {
    columns: Vec<(u32, [u32; 2])>,
}

/// Puts a drop on the surface: to each texel its share of the stamp. What would fall beside the surface's islands goes to
/// the texel that continues it there, across the seam, or to the one that was hit.
pub(crate) fn soak(
    water: &mut SurfaceWater,
    now: &Now,
    drop: &Drop,
    scratch: &mut SoakScratch,
    mut matter: Option<&mut SurfaceMatter>,
    weather: &Weather,
) {
    let speed = f64::from(drop.speed_mm) * 1.0e-3;
    let stamp = Splat { center: drop.center, radius: drop.radius, ..bytemuck::Zeroable::zeroed() };
    let (size, wrap) = (water.size, water.wrap);
    let axes = [stamp.axis(0, size, wrap), stamp.axis(1, size, wrap)];
    scratch.columns.clear();
    scratch.columns.extend(stamp.texels(0, size, wrap).map(|x| (x, axis_coverage(axes[0], x as i32))));
    let (home, mut beside) = (hit_texel(now, drop, size), 0);
    for y in stamp.texels(1, size, wrap) {
        let in_row = share(drop.water_nl, axis_coverage(axes[1], y as i32));
        for &(x, column) in &scratch.columns {
            let nl = share(in_row, column);
            if nl == 0 {
                continue;
            }
            match now.geometry.stand_in(y * size + x) {
                Some(texel) => put(water, now, texel, nl, speed, matter.as_deref_mut(), weather),
                None => beside += nl,
            }
        }
    }
    if beside > 0 {
        put(water, now, home, beside, speed, matter, weather);
    }
    water.ledger.received += water.units.from_nl(u64::from(drop.water_nl));
    water.rained_at = now.tick;
}

fn put(
    water: &mut SurfaceWater,
    now: &Now,
    texel: u32,
    nl: u32,
    speed: f64,
    matter: Option<&mut SurfaceMatter>,
    weather: &Weather,
) {
    let units = water.units.from_nl(u64::from(nl));
    let tile = water.add(now, texel, units);
    note_arrival(water, now, texel, tile);
    if let Some(matter) = matter {
        splash(water, matter, now, texel, units, speed);
        rain_on_snow(water, matter, now, weather, texel, units);
    }
}

/// The texel that was hit or, if the middle of the stamp is not on the surface, the one beside it that is.
fn hit_texel(now: &Now, drop: &Drop, size: u32) -> u32 {
    let [x, y] = drop.center.map(|middle| (middle >> 8).clamp(0, size as i32 - 1) as u32);
    let under = y * size + x;
    now.geometry.stand_in(under).unwrap_or(under)
}

/// What has got water may run and spread. `tile`: of the texel.
pub(crate) fn note_arrival(water: &mut SurfaceWater, now: &Now, texel: u32, tile: u32) {
    water.tiles.renew(tile);
    if !water.tiles.has(tile, Tiles::RUNNING) {
        let film_mm = f64::from(water.texels[texel as usize].film) * now.scale(water.units, texel).unit_mm;
        if film_mm > f64::from(now.material.retained_mm) * LEAST_RETAINED {
            water.tiles.run(tile);
        }
    }
    if now.matter.capacity_mm > 0.0 && !water.tiles.has(tile, Tiles::SPREADING) {
        water.tiles.spread(tile);
    }
}
