//! Water that comes: drops are shared out among the texels under their stamps.
//!
//! All drops of a tick are gathered first ([`Arrivals`]), and each texel then gets what came to it at once, with the speed of
//! the fastest drop. So a texel under a hundred stamps is visited once.

use super::arrivals::{Arrivals, Parcel};
use super::flow::LEAST_RETAINED;
use super::surface::{Now, SurfaceWater, Tiles};
use crate::emitter::Source;
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
    /// Where it came from; unknown unless [sources are tracked](crate::emitter::TrackSources).
    pub source: Source,
}

/// Buffers that keep their memory from tick to tick.
#[derive(Debug, Default)]
pub(crate) struct SoakScratch {
    columns: Vec<(u32, [u32; 2])>,
    arrivals: Arrivals,
    /// Where sources are kept: texels that were hit, and whose the drop was.
    hits: Vec<(u32, Source)>,
    /// The same: texels that got water, and the texel that was hit for it.
    wetted: Vec<(u32, u32)>,
}

/// Puts the drops of a tick on the surface: to each texel its share of their stamps. What would fall beside the surface's
/// islands goes to the texel that continues it there, across the seam, or to the one that was hit.
pub(crate) fn soak(
    water: &mut SurfaceWater,
    now: &Now,
    drops: &[Drop],
    scratch: &mut SoakScratch,
    mut matter: Option<&mut SurfaceMatter>,
    weather: &Weather,
) {
    if drops.is_empty() {
        return;
    }
    let SoakScratch { columns, arrivals, hits, wetted } = scratch;
    let size = water.size;
    let to_texel = |[x, y]: [u32; 2], parcel: Parcel| {
        let under = y * size + x;
        match now.geometry.stand_in(under).unwrap_or(parcel.home) {
            texel if texel == under => [x, y],
            other => [other % size, other / size],
        }
    };
    arrivals.begin(size);
    for drop in drops {
        gather(water, now, drop, columns, arrivals, to_texel);
        water.ledger.received += water.units.from_nl(u64::from(drop.water_nl));
        if water.origins.is_kept() {
            hits.push((hit_texel(now, drop, size), drop.source));
        }
    }
    arrivals.share_out(size, water.wrap, to_texel);
    arrivals.drain(|[x, y], parcel| {
        let texel = y * size + x;
        if water.origins.is_kept() {
            wetted.push((texel, parcel.home));
        }
        put(water, now, texel, parcel, matter.as_deref_mut(), weather);
    });
    name_sources(water, hits, wetted);
    water.rained_at = now.tick;
}

/// Texels that got water are of the source of the last drop that hit where their water came from.
fn name_sources(water: &mut SurfaceWater, hits: &mut Vec<(u32, Source)>, wetted: &mut Vec<(u32, u32)>) {
    // Stable, so that the last drop is the last of its texel.
    hits.sort_by_key(|&(home, _)| home);
    for (texel, home) in wetted.drain(..) {
        let behind = hits.partition_point(|&(other, _)| other <= home);
        if let Some(&(other, source)) = behind.checked_sub(1).and_then(|last| hits.get(last))
            && other == home
        {
            water.origins.take_over(texel, source);
        }
    }
    hits.clear();
}

/// Adds a drop to what has come in this tick.
fn gather(
    water: &SurfaceWater,
    now: &Now,
    drop: &Drop,
    columns: &mut Vec<(u32, [u32; 2])>,
    arrivals: &mut Arrivals,
    to_texel: impl Fn([u32; 2], Parcel) -> [u32; 2],
) {
    let level = Arrivals::level(drop.radius, water.size);
    let stamp = Splat {
        center: drop.center.map(|middle| middle >> level),
        radius: drop.radius.map(|radius| Arrivals::gathered_radius(radius, level)),
        ..bytemuck::Zeroable::zeroed()
    };
    let (size, wrap) = (water.size >> level, water.wrap);
    let axes = [stamp.axis(0, size, wrap), stamp.axis(1, size, wrap)];
    let home = hit_texel(now, drop, water.size);
    columns.clear();
    columns.extend(stamp.texels(0, size, wrap).map(|x| (x, axis_coverage(axes[0], x as i32))));
    for y in stamp.texels(1, size, wrap) {
        let in_row = share(drop.water_nl, axis_coverage(axes[1], y as i32));
        for &(x, column) in &*columns {
            let nl = u64::from(share(in_row, column));
            if nl > 0 {
                let (cell, parcel) = ([x, y], Parcel { nl, speed_mm: drop.speed_mm, home });
                arrivals.add(level, if level == 0 { to_texel(cell, parcel) } else { cell }, parcel);
            }
        }
    }
}

fn put(
    water: &mut SurfaceWater,
    now: &Now,
    texel: u32,
    parcel: Parcel,
    matter: Option<&mut SurfaceMatter>,
    weather: &Weather,
) {
    let units = water.units.from_nl(parcel.nl);
    let tile = water.add(now, texel, units);
    note_arrival(water, now, texel, tile);
    if let Some(matter) = matter {
        splash(water, matter, now, texel, units, f64::from(parcel.speed_mm) * 1.0e-3);
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
