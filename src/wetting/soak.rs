//! Water that comes: drops are shared out among the texels under their stamps.
//!
//! All drops of a tick are gathered first ([`Arrivals`]), and each texel then gets what came to it at once, with the speed of
//! the fastest drop. So a texel under a hundred stamps is visited once.
//!
//! A stamp is columns and rows of the image. Where these leave its island, the water does not: it goes over the mesh, and not to
//! what happens to lie beside ([`TexelGeometry::landing`](super::TexelGeometry)), and is shared out evenly there. Few stamps reach so
//! far; they are gathered island by island.

use super::arrivals::{Arrivals, Grid, Parcel};
use super::flow::LEAST_RETAINED;
use super::landings::Landing;
use super::now::Now;
use super::surface::SurfaceWater;
use super::tiles::Tiles;
use crate::emitter::Source;
use crate::matter::SurfaceMatter;
use crate::matter::jet::sweep;
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
    /// Speed at which it came, mm/s, less what its drops need to move a grain at all
    /// ([`loosening_speed`](crate::matter::wash::loosening_speed)): what it loosens.
    pub speed_mm: u32,
    /// If it is of a jet: how far that carries forwards what it sweeps along, 1/256 texel along u and v.
    pub jet: Option<[i32; 2]>,
    /// Where it came from; unknown unless [sources are tracked](crate::emitter::TrackSources).
    pub source: Source,
}

/// Buffers that keep their memory from tick to tick.
#[derive(Debug, Default)]
pub(crate) struct SoakScratch {
    columns: Vec<(u32, [u32; 2])>,
    arrivals: Arrivals,
    /// Islands, and which drops of the tick on each of them reach beyond it and wait for their turn.
    beyond: Vec<(u32, u32)>,
    /// Where sources are kept: texels that were hit, and whose the drop was.
    hits: Vec<(u32, Source)>,
    /// The same: texels that got water, and the texel that was hit for it.
    wetted: Vec<(u32, u32)>,
}

/// Puts the drops of a tick on the surface: to each texel its share of their stamps. What would fall beside the island that was
/// hit goes to the texels that continue it there, across the seam, or to its border.
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
    let SoakScratch { columns, arrivals, beyond, hits, wetted } = scratch;
    let size = water.size;
    let lay_on = |island: Option<u32>| {
        move |texels: &mut Grid, cell: [u32; 2], parcel: Parcel| {
            let over = cell[1] * size + cell[0];
            let mut lay =
                |texel: u32, nl: u64| texels.add([texel % size, texel / size], Parcel { nl, ..parcel });
            match now.geometry.landing(island, over, parcel.home) {
                // Mostly it is the one that it falls over: no division.
                Some(Landing::One(texel)) if texel == over => texels.add(cell, parcel),
                Some(landing) => landing.share(parcel.nl, lay),
                None => lay(parcel.home, parcel.nl),
            }
        }
    };
    arrivals.begin(size);
    for (number, drop) in (0u32..).zip(drops) {
        let stamp = Stamp::new(drop, size);
        let [columns_of, rows_of] = stamp.texels();
        match now.geometry.island_to_keep_to(texel_under(drop.center, size), columns_of, rows_of) {
            None => gather(water, now, drop, &stamp, columns, arrivals, lay_on(None)),
            // In texels nothing is mixed with what others bring.
            Some(island) if stamp.level == 0 => {
                gather(water, now, drop, &stamp, columns, arrivals, lay_on(Some(island)));
            }
            Some(island) => beyond.push((island, number)),
        }
        water.ledger.received += water.units.from_nl(u64::from(drop.water_nl));
        if water.origins.is_kept() {
            hits.push((hit_texel(now, drop, size), drop.source));
        }
    }
    arrivals.share_out(size, water.wrap, lay_on(None));
    beyond.sort_unstable();
    for of_island in beyond.chunk_by(|one, other| one.0 == other.0) {
        let lay = lay_on(Some(of_island[0].0));
        for &(_, number) in of_island {
            let drop = &drops[number as usize];
            gather(water, now, drop, &Stamp::new(drop, size), columns, arrivals, lay);
        }
        arrivals.share_out(size, water.wrap, lay);
    }
    beyond.clear();
    arrivals.drain(|[x, y], parcel| {
        let texel = y * size + x;
        if water.origins.is_kept() {
            wetted.push((texel, parcel.home));
        }
        put(water, now, texel, parcel, matter.as_deref_mut(), weather);
    });
    if let Some(matter) = matter {
        drops.iter().for_each(|drop| sweep(water, matter, now, drop));
    }
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

/// The stamp of a drop on the grid that it is gathered on.
struct Stamp {
    level: u32,
    /// In cells of that grid.
    splat: Splat,
}

impl Stamp {
    /// On a surface with so many texels along each side.
    fn new(drop: &Drop, size: u32) -> Self {
        let level = Arrivals::level(drop.radius, size);
        let splat = Splat {
            center: drop.center.map(|middle| middle >> level),
            radius: drop.radius.map(|radius| Arrivals::gathered_radius(radius, level)),
            ..bytemuck::Zeroable::zeroed()
        };
        Self { level, splat }
    }

    /// First and last column and row of texels that may get something of it.
    fn texels(&self) -> [(i32, i32); 2] {
        [0, 1].map(|axis| match (self.level, self.splat.span(axis)) {
            (0, span) => span,
            // In the end a cell reaches over those beside it.
            (level, (first, last)) => ((first - 1) << level, ((last + 2) << level) - 1),
        })
    }
}

/// Adds a drop to what has come in this tick.
fn gather(
    water: &SurfaceWater,
    now: &Now,
    drop: &Drop,
    stamp: &Stamp,
    columns: &mut Vec<(u32, [u32; 2])>,
    arrivals: &mut Arrivals,
    lay: impl Fn(&mut Grid, [u32; 2], Parcel),
) {
    let (level, stamp) = (stamp.level, &stamp.splat);
    let (size, wrap) = (water.size >> level, water.wrap);
    let axes = [stamp.axis(0, size, wrap), stamp.axis(1, size, wrap)];
    let home = hit_texel(now, drop, water.size);
    // Six hundred metres a second are more than anything falls at.
    let speed_cm = u16::try_from(drop.speed_mm / 10).unwrap_or(u16::MAX);
    let is_jet = drop.jet.is_some();
    columns.clear();
    columns.extend(stamp.texels(0, size, wrap).map(|x| (x, axis_coverage(axes[0], x as i32))));
    for y in stamp.texels(1, size, wrap) {
        let in_row = share(drop.water_nl, axis_coverage(axes[1], y as i32));
        for &(x, column) in &*columns {
            let nl = u64::from(share(in_row, column));
            if nl > 0 {
                let (cell, parcel) = ([x, y], Parcel { nl, home, speed_cm, is_jet });
                let grid = arrivals.grid(level);
                if level == 0 { lay(grid, cell, parcel) } else { grid.add(cell, parcel) }
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
        let speed = f64::from(parcel.speed_cm) * 0.01;
        splash(water, matter, now, texel, units, speed, parcel.is_jet);
        rain_on_snow(water, matter, now, weather, texel, units);
    }
}

/// The texel over which the middle of a stamp lies, whoever owns it. In 1/256 texel.
pub(crate) fn texel_under(center: [i32; 2], size: u32) -> u32 {
    let [x, y] = center.map(|middle| (middle >> 8).clamp(0, size as i32 - 1) as u32);
    y * size + x
}

/// The texel that was hit or, if the middle of the stamp is not on the surface, the one beside it that is.
fn hit_texel(now: &Now, drop: &Drop, size: u32) -> u32 {
    let under = texel_under(drop.center, size);
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

#[cfg(test)]
mod tests {
    use super::super::TexelGeometry;
    use super::super::points::surface_points;
    use super::super::test_meshes::{Cube, floor, joined, sheet, turned_neighbours};
    use super::*;
    use crate::collision::MeshTriangles;
    use crate::material::PorousMaterial;
    use crate::overlay::Wrap;
    use crate::weather::DryingClock;
    use bevy::math::{Affine3A, Vec2, Vec3};

    const CLAMP: [Wrap; 2] = [Wrap::Clamp; 2];

    fn geometry(mesh: &MeshTriangles, size: u32) -> TexelGeometry {
        TexelGeometry::new(mesh, &Affine3A::IDENTITY, Vec3::Y, size, CLAMP)
    }

    /// Water so many texels from its middle to its rim, as a drop at a point of the map in 1/256 texel.
    fn drop_at(center: [i32; 2], radius: i32, water_nl: u32) -> Drop {
        Drop { center, radius: [radius * 256; 2], water_nl, speed_mm: 0, jet: None, source: Source::UNKNOWN }
    }

    /// What a dry surface that takes up nothing holds after one tick.
    fn soaked(geometry: &TexelGeometry, drops: &[Drop]) -> SurfaceWater {
        let glazed = PorousMaterial { capacity_mm: 0.0, ..PorousMaterial::default() };
        let drying = DryingClock::default();
        let now = Now::new(1, 60, &drying, geometry, None, &glazed);
        let mut water = SurfaceWater::of_size(geometry.size(), CLAMP, geometry.mean_mm2());
        water.wake(false);
        let mut scratch = SoakScratch::default();
        soak(&mut water, &now, drops, &mut scratch, None, &Weather::default());
        assert!(scratch.beyond.is_empty());
        water
    }

    /// Nanolitres on the triangles from one to another.
    fn held_nl(water: &SurfaceWater, geometry: &TexelGeometry, triangles: std::ops::Range<u32>) -> u64 {
        let on_them = (0u32..)
            .zip(water.texels())
            .filter(|&(texel, _)| geometry.owner(texel).is_some_and(|owner| triangles.contains(&owner)));
        water.units().whole_nl(on_them.map(|(_, texel)| texel.total()).sum())
    }

    #[test]
    fn not_a_nanolitre_goes_to_an_island_that_is_beside_in_the_image_alone() {
        // Two columns apart in the image, 50 m in space.
        let part = |column: f32, away: f32| {
            let on_map = move |point: Vec2| (Vec2::new(column, 8.0) + point * Vec2::new(55.0, 112.0)) / 128.0;
            sheet(3, move |point| floor(point) + Vec3::X * away, on_map)
        };
        let geometry = geometry(&joined([part(8.0, 0.0), part(65.0, 50.0)]), 128);
        let (left, right) = (62 * 256 + 200, 65 * 256 + 90);
        for radius in [1, 3, 10, 20, 50] {
            for row in [64 * 256, 9 * 256, 119 * 256 + 77] {
                let water = soaked(&geometry, &[drop_at([left, row], radius, 1_000_003)]);
                assert_eq!(held_nl(&water, &geometry, 18..36), 0, "{radius} {row}");
                assert_eq!(held_nl(&water, &geometry, 0..18), 1_000_003, "{radius} {row}");
                let water = soaked(&geometry, &[drop_at([right, row], radius, 500_009)]);
                assert_eq!(held_nl(&water, &geometry, 0..18), 0, "{radius} {row}");
                assert_eq!(held_nl(&water, &geometry, 18..36), 500_009, "{radius} {row}");
            }
        }
        // Of one tick, and of all sizes: nothing is mixed on the way.
        let drops: Vec<Drop> = [1, 10, 3, 20, 50, 12, 33]
            .into_iter()
            .flat_map(|radius| {
                [drop_at([left, 9000], radius, 70_001), drop_at([right, 9100], radius, 30_011)]
            })
            .collect();
        let water = soaked(&geometry, &drops);
        assert_eq!(held_nl(&water, &geometry, 0..18), 7 * 70_001);
        assert_eq!(held_nl(&water, &geometry, 18..36), 7 * 30_011);
        assert_eq!(water.ledger().received, water.units().from_nl(7 * 100_012));
    }

    #[test]
    fn both_sides_of_a_seam_get_the_same_however_their_islands_lie() {
        for turned in [false, true] {
            let cube = Cube { cells: 2, size: 128, island: 20.0, first: 10.0, pitch: 22.0, turned };
            let mesh = cube.mesh();
            let geometry = geometry(&mesh, cube.size);
            let points = surface_points(&mesh, &Affine3A::IDENTITY, cube.size, CLAMP);
            // Over the right border of the first face, at half its height.
            let Some(beyond) = geometry.stand_in(20 * 128 + 30).and_then(|texel| geometry.owner(texel))
            else {
                panic!("the cube has no edge");
            };
            let (normal, next) = (Cube::FACES[0][0], Cube::FACES[cube.face(beyond)][0]);
            for radius in [3, 5, 10] {
                let water = soaked(&geometry, &[drop_at([30 * 256 - 1, 20 * 256], radius, 50_000_000)]);
                let at = |texel: u32| water.texels()[texel as usize].total() as f64;
                let most = (0..128 * 128).map(at).fold(0.0, f64::max);
                let mut wet = 0;
                for column in 22..30 {
                    for row in 13..27 {
                        let texel = row * 128 + column;
                        let here = points.iter().find(|point| point.texel == texel).unwrap().position;
                        // The same place, folded over the edge.
                        let depth = 0.5 - here.dot(next);
                        let over = here + (next - normal) * depth;
                        let there = points.iter().find(|point| point.position.distance(over) < 1e-3).unwrap();
                        let [here, there] = [texel, there.texel].map(at);
                        assert!(
                            (here - there).abs() < 0.02 * most,
                            "{radius} {column} {row}: {here} {there}"
                        );
                        wet += u32::from(here > 0.1 * most);
                    }
                }
                assert!(wet > 6, "{wet}");
                let on_both = held_nl(&water, &geometry, 0..48);
                assert_eq!(on_both, 50_000_000);
            }
        }
    }

    #[test]
    fn a_drop_on_a_seam_is_as_smooth_on_a_neighbour_that_is_turned_and_scaled() {
        let mesh = turned_neighbours();
        let geometry = geometry(&mesh, 128);
        let center = [40 * 256 - 1, 28 * 256];
        let water = soaked(&geometry, &[drop_at(center, 6, 50_000_007)]);
        assert_eq!(held_nl(&water, &geometry, 0..64), 50_000_007);
        let all: u64 = water.texels().iter().map(|texel| texel.total()).sum();
        // The quadratic B-spline over 12 texels: what a texel so far from its middle gets.
        let bump = |away: f32| match away.abs() / 4.0 {
            near if near < 0.5 => (0.75 - near * near) / 4.0,
            far if far < 1.5 => (1.5 - far).powi(2) / 8.0,
            _ => 0.0,
        };
        let mut wet = 0;
        for point in surface_points(&mesh, &Affine3A::IDENTITY, 128, CLAMP) {
            if point.triangle < 32 {
                continue;
            }
            // Where it would lie if the first island went on.
            let away = [4.3 + 36.0 * point.position.x - 40.0, 10.0 + 36.0 * point.position.z - 28.0];
            let expected = bump(away[0]) * bump(away[1]) / (1.3 * 1.3);
            let got = water.texels()[point.texel as usize].total() as f32 / all as f32;
            let most = (0.75f32 / 4.0).powi(2) / (1.3 * 1.3);
            assert!((got - expected).abs() < 0.2 * most, "{away:?}: {got} {expected}");
            wet += u32::from(got > 0.2 * most);
        }
        assert!(wet > 25, "{wet}");
    }
}
