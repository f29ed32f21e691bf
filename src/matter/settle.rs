//! Dust, mud and snow that come: shared out among the texels under their stamps.
//!
//! The shares (`shares.rs`) add up to a particle's nanolitres to the last, across seams and beside islands, too; nothing of it
//! comes to an island that lies beside in the image alone. Dust that falls on what is wet is bound there and then;
//! what falls on dry ground, or on snow, stays loose. Snow is `snow`'s to say.

use super::shares::share_out;
use super::snow::arrive;
use super::texel::MatterKind;
use super::wash::bind_dried;
use super::{MatterScratch, SurfaceMatter};
use crate::overlay::{Splat, StampAtlas};
use crate::weather::Weather;
use crate::wetting::{Now, SurfaceWater, texel_under};

/// Film, mm, from which on dust is wetted through.
pub const WET_FILM_MM: f64 = 0.005;

/// Absorbed water, in parts of what looks fully wet, from which on dust is.
pub const WET_PART: f64 = 0.3;

/// Snow, mm of water, on which dust stays dry.
const DRY_ON_SNOW_MM: f64 = 0.1;

/// Matter of an impact, not yet on its surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Deposit {
    /// Middle of its patch of the map, 1/256 texel.
    pub center: [i32; 2],
    /// Half the width and height of the patch, 1/256 texel.
    pub radius: [i32; 2],
    /// What it is.
    pub kind: MatterKind,
    /// Nanolitres: of solids without pores, of snow as water.
    pub volume_nl: u32,
    /// What it is shared out by. None: a round bump as wide as the patch.
    pub stamp: Option<DepositStamp>,
}

/// How a stamp lies over a deposit: as a [`Splat`] that is painted on the map has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DepositStamp {
    /// Its number in the [`StampAtlas`]. If there is none of that number, or it covers nothing, a bump takes its place.
    pub number: u32,
    /// Half the width and height of the box it may be turned in, 1/256 texel: at least those of the patch.
    pub radius: [i32; 2],
    /// From an offset in these radii to the two axes of the stamp, 1/1024.
    pub rows: [[i32; 2]; 2],
}

/// Puts matter on a surface, and makes room for the first. `stamps`: those that deposits name.
pub(crate) fn deposit(
    water: &mut SurfaceWater,
    matter: &mut SurfaceMatter,
    now: &Now,
    weather: &Weather,
    deposit: &Deposit,
    stamps: Option<&StampAtlas>,
    scratch: &mut MatterScratch,
) {
    wake(water, matter, now);
    let patch = Splat { center: deposit.center, radius: deposit.radius, ..bytemuck::Zeroable::zeroed() };
    let (size, wrap) = (water.size, water.wrap);
    let under = texel_under(deposit.center, size);
    // The texel that was hit.
    let home = now.geometry.stand_in(under).unwrap_or(under);
    let island = now.geometry.island_to_keep_to(under, patch.span(0), patch.span(1));
    let mut beside = 0;
    share_out(deposit, stamps, (size, wrap), &mut scratch.shares, |over, nl| {
        match now.geometry.landing(island, over, home) {
            Some(landing) => landing.share(u64::from(nl), |texel, nl| {
                put(water, matter, now, weather, deposit.kind, texel, nl as u32);
            }),
            None => beside += nl,
        }
    });
    if beside > 0 {
        put(water, matter, now, weather, deposit.kind, home, beside);
    }
}

/// Makes room for the first matter, and for the water that it shares tiles with.
pub(crate) fn wake(water: &mut SurfaceWater, matter: &mut SurfaceMatter, now: &Now) {
    water.wake(now.material.leaves_marks());
    water.notes_dried = true;
    matter.wake(water.size);
}

/// Puts matter, in nanolitres, on one texel that has room for it.
pub(crate) fn put(
    water: &mut SurfaceWater,
    matter: &mut SurfaceMatter,
    now: &Now,
    weather: &Weather,
    kind: MatterKind,
    texel: u32,
    nl: u32,
) {
    let units = water.units.from_nl(u64::from(nl));
    let is_wet = is_wet(water, now, texel);
    // What came before lay in the film that has dried up since.
    bind_dried(water, matter);
    match kind {
        MatterKind::Snow => arrive(water, matter, now, weather, texel, units, is_wet),
        MatterKind::Mud => matter.receive(texel, kind, units),
        MatterKind::Dust => {
            matter.receive(texel, kind, units);
            let snow = f64::from(matter.texels[texel as usize].snow);
            if is_wet && snow * now.scale(water.units, texel).unit_mm < DRY_ON_SNOW_MM {
                matter.bind(texel, units);
            }
        }
    }
    let tile = water.tile_of(texel);
    water.tiles.touch(tile);
}

/// Whether what falls on a texel gets wet; brings its water to the present.
fn is_wet(water: &mut SurfaceWater, now: &Now, texel: u32) -> bool {
    if water.texels[texel as usize].is_dry() {
        return false;
    }
    let amounts = water.settle(now, texel);
    amounts.film_mm > WET_FILM_MM || amounts.pores_mm > WET_PART * now.material.seen_mm()
}

#[cfg(test)]
mod tests {
    use super::super::TexelMatter;
    use super::super::test_world::{Ground, Place, assert_balanced, bump};
    use super::*;
    use crate::collision::MeshTriangles;
    use crate::material::PorousMaterial;
    use crate::overlay::Wrap;
    use crate::wetting::TexelGeometry;
    use bevy::math::{Affine3A, Vec2, Vec3};
    use std::sync::Arc;

    fn stamp(kind: MatterKind, volume_nl: u32) -> Deposit {
        bump(kind, volume_nl, [8 * 256; 2], [3 * 256, 2 * 256])
    }

    #[test]
    fn the_first_of_it_makes_room_and_no_nanolitre_is_lost_over_an_edge() {
        let place = Place::slope(20.0, 16, 0.003);
        let mut ground = Ground::dry(&place);
        assert!(ground.matter.is_empty() && !ground.water.is_wet());
        for (number, kind) in [MatterKind::Dust, MatterKind::Mud, MatterKind::Snow].into_iter().enumerate() {
            for center in [[0, 0], [8 * 256 + 77, 15 * 256 + 255], [4095, 13]] {
                ground.put(&place, 1, Deposit { center, ..stamp(kind, 10_007 + number as u32) });
            }
        }
        let received = ground.matter.ledger;
        let units = |nl: u64| ground.water.units.from_nl(nl);
        assert_eq!(received.received_dust, units(3 * 10_007));
        assert_eq!(received.received_mud, units(3 * 10_008));
        // It is 20 °C, and dry: half of the snow has melted at once, and shows as water.
        assert_eq!(received.received_snow, units(3 * 10_009));
        assert!(received.melted > 0 && ground.water.ledger.received == received.melted);
        assert!(!ground.water.tiles.dirty.is_empty());
        assert_balanced(&ground.matter);
    }

    #[test]
    fn dust_on_wet_ground_becomes_mud_and_on_dry_ground_stays_loose() {
        let porous = PorousMaterial { capacity_mm: 1.0, visible_mm: 0.1, ..PorousMaterial::default() };
        for (film_mm, pores_mm, wet) in
            [(0.0, 0.0, false), (0.001, 0.0, false), (0.02, 0.0, true), (0.0, 0.02, false), (0.0, 0.05, true)]
        {
            let mut place = Place::flat(16, 0.01);
            if pores_mm > 0.0 {
                place.material = porous;
            }
            let mut ground = Ground::new(&place);
            ground.water.cover(&place.geometry, film_mm, pores_mm, 1);
            ground.put(&place, 1, stamp(MatterKind::Dust, 4000));
            let stock = ground.matter.stock();
            let all = ground.water.units.from_nl(4000);
            let expected = if wet { (0, all) } else { (all, 0) };
            assert_eq!((stock.dust, stock.mud), expected, "{film_mm} {pores_mm}");
        }
    }

    #[test]
    fn dust_that_fell_before_is_not_bound_by_what_falls_after_it_on_dry_ground() {
        let place = Place::flat(16, 0.01).with(|weather| weather.drying_speed = 3600.0);
        let mut ground = Ground::new(&place);
        ground.put(&place, 1, stamp(MatterKind::Dust, 4000));
        ground.water.cover(&place.geometry, 0.02, 0.0, 1);
        // The film has dried up, and nobody has looked yet.
        let wider = Deposit { radius: [4 * 256; 2], ..stamp(MatterKind::Dust, 4_000_000) };
        ground.put(&place, 30 * Place::HZ, wider);
        let stock = ground.matter.stock();
        let units = |nl: u64| ground.water.units.from_nl(nl);
        assert_eq!((stock.dust, stock.mud), (units(4_000_000), units(4000)));
    }

    #[test]
    fn dust_on_snow_stays_loose_and_flakes_stay_in_the_frost() {
        let place = Place::flat(16, 0.01).with(|weather| weather.temperature_c = -4.0);
        let mut ground = Ground::new(&place);
        ground.water.cover(&place.geometry, 0.05, 0.0, 1);
        ground.put(&place, 1, Deposit { radius: [15 * 128; 2], ..stamp(MatterKind::Snow, 50_000_000) });
        ground.put(&place, 1, Deposit { radius: [256; 2], ..stamp(MatterKind::Dust, 2000) });
        let stock = ground.matter.stock();
        let units = |nl: u64| ground.water.units.from_nl(nl);
        assert_eq!((stock.snow, stock.dust, stock.mud), (units(50_000_000), units(2000), 0));
    }

    #[test]
    fn matter_of_one_island_does_not_come_to_what_lies_beside_it_in_the_image_alone() {
        // Two floors, two columns apart on the map and 10 m in space.
        let mut place = Place::flat(64, 0.01);
        let mut triangles = MeshTriangles::default();
        for (from, away) in [(0.0, 0.0), (33.0, 10.0)] {
            for corners in [[Vec2::ZERO, Vec2::ONE, Vec2::X], [Vec2::ZERO, Vec2::Y, Vec2::ONE]] {
                let in_space = |at: Vec2| Vec3::new(away + at.x * 0.31, 0.0, at.y * 0.64);
                triangles.source.push(triangles.source.len() as u32);
                triangles.positions.push(corners.map(in_space));
                let on_map = |at: Vec2| Vec2::new((from + at.x * 31.0) / 64.0, at.y);
                triangles.uvs.push(corners.map(on_map));
            }
        }
        place.geometry =
            Arc::new(TexelGeometry::new(&triangles, &Affine3A::IDENTITY, Vec3::Y, 64, [Wrap::Clamp; 2]));
        let on_right = |texel: u32| place.geometry.owner(texel).is_some_and(|owner| owner >= 2);
        for kind in [MatterKind::Dust, MatterKind::Mud, MatterKind::Snow] {
            for (column, is_right) in [(30, false), (33, true)] {
                for radius in [1, 3, 10, 25] {
                    let freezing = place.clone().with(|weather| weather.temperature_c = -4.0);
                    let mut ground = Ground::dry(&freezing);
                    let center = [column * 256 + 130, 20 * 256];
                    let radius = [radius * 256; 2];
                    ground.put(&freezing, 1, bump(kind, 10_007, center, radius));
                    let lies = |texel: &TexelMatter| texel.soil() + u64::from(texel.snow);
                    let texels = (0u32..).zip(&ground.matter.texels);
                    let here: u64 = texels
                        .filter(|&(texel, _)| on_right(texel) == is_right)
                        .map(|(_, matter)| lies(matter))
                        .sum();
                    assert_eq!(here, ground.water.units.from_nl(10_007), "{kind:?} {column} {radius:?}");
                }
            }
        }
    }
}
