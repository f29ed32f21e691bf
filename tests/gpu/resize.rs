//! Maps that change their size keep what has been painted, to the bit as in main memory.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::export::ColorReadback;
use bevy_weathering::overlay::{
    CpuMaps, MapBudget, MapNeed, MapSize, OverlayUv, Overlays, Splat, SplatStats, StampAtlas, StampSpace,
    SurfaceTotals, Weatherable, Wrap, mip_chain,
};
use bevy_weathering::wetting::SurfaceWater;

use super::app::{app, update, update_until};
use super::splat::{SIZE, maps_of, painted, push, random_splats};

/// Enough for whatever may fall on a map of half the side, and for nothing on a whole one.
fn half_a_budget() -> MapBudget {
    let need = MapNeed { colors: true, rings: true, water: true, matter: true, frames: true };
    MapBudget { bytes: need.bytes(SIZE / 2), texel: None }
}

fn surface(map_size: u32) -> Weatherable {
    Weatherable {
        map_size,
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Repeat,
        stamps: StampSpace::Map,
        uv: OverlayUv::Mesh,
    }
}

fn until_size(app: &mut App, entity: Entity, size: u32) {
    update_until(app, "maps of another size", |world| {
        world.get::<MapSize>(entity).is_some_and(|found| found.texels() == size)
    });
    update(app);
    update_until(app, "what was painted", |world| world.resource::<SplatStats>().moving() == 0);
    assert_eq!(app.world().get::<Overlays>(entity).unwrap().size, size);
}

/// The next level of all maps.
fn halved(maps: &CpuMaps) -> CpuMaps {
    let half = |map: &[[u8; 4]]| mip_chain(map, maps.size, None)[0].clone();
    CpuMaps {
        diffuse: half(&maps.diffuse),
        specular: half(&maps.specular),
        normal: half(&maps.normal),
        ..CpuMaps::new(&surface(maps.size / 2))
    }
}

/// Each texel of all maps four times.
fn doubled(maps: &CpuMaps) -> CpuMaps {
    let (side, twice) = (maps.size, maps.size * 2);
    let double = |map: &[[u8; 4]]| {
        let above = |texel: u32| map[(texel / twice / 2 * side + texel % twice / 2) as usize];
        (0..twice * twice).map(above).collect()
    };
    CpuMaps {
        diffuse: double(&maps.diffuse),
        specular: double(&maps.specular),
        normal: double(&maps.normal),
        ..CpuMaps::new(&surface(twice))
    }
}

fn assert_same(app: &mut App, entity: Entity, expected: &CpuMaps) {
    let maps = maps_of(app, entity, &surface(expected.size));
    assert!(expected.diffuse.iter().filter(|texel| texel[3] > 0).count() > 500);
    assert!(maps == *expected, "of {} texels", expected.size);
}

#[test]
fn paint_moves_to_smaller_maps_and_to_larger_ones_and_is_painted_over() {
    let Some(mut app) = app() else { return };
    let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::splat(0.5)));
    let mesh = Mesh3d(app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh));
    let entity = app.world_mut().spawn((surface(SIZE), mesh, Transform::default())).id();
    update_until(&mut app, "the texels", |world| world.get::<SurfaceWater>(entity).is_some());
    let splats = random_splats(300, 42);
    push(&mut app, entity, &splats);
    painted(&mut app, 300);
    let mut expected = CpuMaps::new(&surface(SIZE));
    expected.paint(&splats, &StampAtlas::default(), None);
    assert_same(&mut app, entity, &expected);

    app.insert_resource(half_a_budget());
    update(&mut app);
    // Its new texels are being measured, and what is read back now may not fit them.
    assert!(!ColorReadback::is_painted(app.world_mut()));
    until_size(&mut app, entity, SIZE / 2);
    assert!(ColorReadback::is_painted(app.world_mut()));
    let mut expected = halved(&expected);
    assert_same(&mut app, entity, &expected);
    // More on top.
    let smaller = |splat: Splat| Splat {
        center: splat.center.map(|along| along / 2),
        radius: splat.radius.map(|along| (along / 2).clamp(128, (SIZE as i32 / 2 - 1) * 128)),
        ..splat
    };
    let splats: Vec<Splat> = random_splats(100, 7).into_iter().map(smaller).collect();
    push(&mut app, entity, &splats);
    painted(&mut app, 400);
    expected.paint(&splats, &StampAtlas::default(), None);
    assert_same(&mut app, entity, &expected);

    // Room again, and it is hit.
    app.insert_resource(MapBudget::default());
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(10));
    update_until(&mut app, "a second", |world| world.resource::<WeatheringClock>().tick() > 70);
    let tick = app.world().resource::<WeatheringClock>().tick();
    app.world_mut().get_mut::<SurfaceTotals>(entity).unwrap().last_tick = tick;
    update_until(&mut app, "larger maps", |world| {
        world.get::<MapSize>(entity).is_some_and(|found| found.texels() == SIZE)
    });
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    until_size(&mut app, entity, SIZE);
    let mut expected = doubled(&expected);
    assert_same(&mut app, entity, &expected);
    let splats = random_splats(100, 8);
    push(&mut app, entity, &splats);
    painted(&mut app, 500);
    expected.paint(&splats, &StampAtlas::default(), None);
    assert_same(&mut app, entity, &expected);
}
