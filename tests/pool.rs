//! One budget for the maps of all surfaces.

use bevy::asset::uuid::Uuid;
use bevy::prelude::*;
use bevy_weathering::overlay::{
    CpuMaps, MapBudget, MapLoss, MapNeed, MapPool, MapSize, OverlayUv, SplatQueue, StampSpace,
    SurfaceEvicted, SurfaceResized, SurfaceTotals, Unmapped,
};
use bevy_weathering::prelude::*;
use bevy_weathering::scenes::meshes::ground;
use bevy_weathering::wetting::{DropQueue, SurfaceWater, TexelWater};

use crate::wetting::scene::Scene;

const HZ: u32 = 60;

/// What a surface is charged with where nothing but water falls, and stamps lie on the map.
const NEED: MapNeed = MapNeed { colors: true, rings: true, water: true, matter: false, frames: false };
/// What clear water makes of that.
const WET: MapNeed = MapNeed { colors: false, ..NEED };

fn get<C: Component + Clone>(scene: &Scene, surface: Entity) -> C {
    scene.0.world().get::<C>(surface).cloned().expect("it has one")
}

fn has<C: Component>(scene: &Scene, surface: Entity) -> bool {
    scene.0.world().get::<C>(surface).is_some()
}

fn pool(scene: &Scene) -> MapPool {
    *scene.0.world().resource::<MapPool>()
}

fn add(scene: &mut Scene, side: f32) -> Mesh3d {
    let mesh = ground(Vec2::splat(side), UVec2::ONE).unwrap();
    Mesh3d(scene.0.world_mut().resource_mut::<Assets<Mesh>>().add(mesh))
}

fn spawn(scene: &mut Scene, mesh: Mesh3d, map_size: u32, at: Vec3) -> Entity {
    let maps = Weatherable {
        map_size,
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Clamp,
        stamps: StampSpace::Map,
        uv: OverlayUv::Mesh,
    };
    let transform = Transform::from_translation(at);
    scene.0.world_mut().spawn((maps, mesh, transform, GlobalTransform::from(transform))).id()
}

/// Half a second of drizzle, and the time until it has landed. Films so thin do not run.
fn drizzle(scene: &mut Scene, rate: f32, half_size: Vec2, at: Vec3) {
    let shape = EmitterShape::Sky { half_size };
    let emitter = Emitter { rate, shape, speed: 6.0, lifetime: 2.0, ..default() };
    let sky = scene.emit(emitter, 0.5, 0.03, at + Vec3::Y);
    // It has a place in the world and an effect from the next frame on.
    scene.run(1);
    scene.run(HZ / 2);
    scene.0.world_mut().entity_mut(sky).despawn();
    scene.run(HZ / 2);
}

/// What fell on a surface is on it, has left it, or is entered as lost.
fn assert_balanced(scene: &Scene, surface: Entity) {
    let loss: MapLoss = get(scene, surface);
    assert_eq!(loss.received + loss.melted, loss.water + loss.evaporated + loss.dripped + loss.spilled);
    let totals: SurfaceTotals = get(scene, surface);
    let kept = scene.0.world().get::<SurfaceWater>(surface).map_or(0, |water| {
        let (ledger, held) = (water.ledger(), water.texels().iter().map(|texel| texel.total()).sum::<u64>());
        assert_eq!(ledger.received, held + ledger.evaporated + ledger.dripped + ledger.spilled);
        assert_eq!(water.units().from_nl(water.units().whole_nl(ledger.received)), ledger.received);
        water.units().whole_nl(ledger.received)
    });
    assert_eq!(MapLoss::UNITS.whole_nl(loss.received) + kept, totals.water_nl);
}

/// Five hundred plates in a field of 25 m by 20 m, on which nothing is decided yet.
fn field() -> (Scene, Vec<(Entity, f32)>) {
    let mut scene = Scene::new(HZ);
    let sides = [0.4, 0.5, 0.62, 0.75, 0.9];
    let meshes = sides.map(|side| add(&mut scene, side));
    let plates = (0..500usize)
        .map(|number| {
            let kind = number * 7 % 5;
            let at = Vec3::new((number % 25) as f32 - 12.0, 0.0, (number / 25) as f32 - 9.5);
            (spawn(&mut scene, meshes[kind].clone(), 512, at), sides[kind])
        })
        .collect();
    (scene, plates)
}

fn sizes(scene: &mut Scene, plates: &[(Entity, f32)]) -> Vec<u32> {
    plates.iter().for_each(|&(plate, _)| scene.wait_for::<MapSize>(plate));
    plates.iter().map(|&(plate, _)| get::<MapSize>(scene, plate).texels()).collect()
}

#[test]
fn five_hundred_surfaces_share_a_budget_and_each_is_rained_on() {
    let (mut scene, plates) = field();
    let sides = sizes(&mut scene, &plates);
    // Something that is never there: so no rays are cast, which would take longer than all the rest.
    let never = Handle::Uuid(Uuid::from_u128(500), std::marker::PhantomData);
    let absent = spawn(&mut scene, Mesh3d(never), 16, Vec3::Y * 50.0);

    let bytes: u64 = sides.iter().map(|&side| NEED.bytes(side)).sum();
    let budget = MapBudget::default().bytes;
    assert_eq!(budget, 256 << 20);
    assert!(bytes <= budget && bytes > budget / 2, "{bytes}");
    // None of those that could be finer or coarser is more than twice as fine as another.
    let widths = || plates.iter().zip(&sides).map(|(&(_, side), &texels)| (texels, side / texels as f32));
    let coarsest = widths().filter(|(texels, _)| *texels < 512).map(|(_, width)| width).fold(0.0, f32::max);
    let finest = widths().filter(|(texels, _)| *texels > 64).map(|(_, width)| width).fold(1.0, f32::min);
    assert!(coarsest <= finest * 2.001, "{coarsest} {finest}");

    plates.iter().for_each(|&(plate, _)| scene.wait_for::<SurfaceWater>(plate));
    drizzle(&mut scene, 80_000.0, Vec2::new(12.5, 10.0), Vec3::ZERO);
    for (&(plate, _), side) in plates.iter().zip(sides.iter().copied()) {
        let totals: SurfaceTotals = get(&scene, plate);
        assert!(totals.impacts > 0, "one was missed");
        let maps = scene.0.world().get::<CpuMaps>(plate).unwrap();
        let water = scene.water(plate);
        assert_eq!([maps.size, water.size()], [side; 2]);
        assert_eq!(water.units().whole_nl(water.ledger().received), totals.water_nl);
        assert!(scene.0.world().get::<SplatQueue>(plate).unwrap().is_empty());
        assert_eq!(get::<MapLoss>(&scene, plate), MapLoss::default());
    }
    let pool = pool(&scene);
    assert_eq!((pool.unmapped, pool.evictions, pool.refusals), (0, 0, 0));
    // All of them are wet, and clear water paints nothing: all else that is reserved for them is used.
    assert_eq!(pool.used, sides.iter().map(|&side| WET.bytes(side)).sum::<u64>());
    assert!(pool.reserved >= bytes && pool.reserved <= budget, "{pool:?}");
    scene.0.world_mut().entity_mut(absent).despawn();
}

#[test]
fn sizes_are_the_same_each_time() {
    let once = || {
        let (mut scene, plates) = field();
        sizes(&mut scene, &plates)
    };
    assert_eq!(once(), once());
}

#[test]
fn texels_are_as_wide_as_wished_up_to_the_largest_map() {
    let mut scene = Scene::new(HZ);
    scene.0.insert_resource(MapBudget { texel: Some(0.01), ..default() });
    let plates: Vec<(Entity, f32)> = [0.1, 1.0, 3.0, 30.0]
        .into_iter()
        .map(|side| {
            let mesh = add(&mut scene, side);
            (spawn(&mut scene, mesh, 512, Vec3::X * side * 2.0), side)
        })
        .collect();
    assert_eq!(sizes(&mut scene, &plates), [64, 112, 304, 512]);
}

#[test]
fn who_was_hit_longest_ago_makes_room_and_nothing_is_lost_in_silence() {
    let mut scene = Scene::new(HZ);
    let bytes = NEED.bytes(64);
    scene.0.insert_resource(MapBudget { bytes: bytes * 5 / 2, texel: None });
    let mesh = add(&mut scene, 1.0);
    let [first, second] = [0.0, 2.0].map(|x| spawn(&mut scene, mesh.clone(), 64, Vec3::X * x));
    scene.wait_for::<SurfaceWater>(first);
    scene.wait_for::<SurfaceWater>(second);
    drizzle(&mut scene, 600.0, Vec2::splat(0.3), Vec3::ZERO);
    drizzle(&mut scene, 600.0, Vec2::splat(0.3), Vec3::X * 2.0);
    assert_eq!((pool(&scene).mapped, pool(&scene).used), (2, 2 * WET.bytes(64)));
    let fell = get::<SurfaceTotals>(&scene, first);
    assert!(fell.water_nl > 0 && get::<SurfaceTotals>(&scene, second).last_tick > fell.last_tick);

    let third = spawn(&mut scene, mesh, 64, Vec3::X * 4.0);
    let mut messages = Vec::new();
    scene.wait_until("a third surface", |scene| {
        messages.extend(scene.0.world_mut().resource_mut::<Messages<SurfaceEvicted>>().drain());
        has::<SurfaceWater>(scene, third)
    });
    let loss: MapLoss = get(&scene, first);
    assert_eq!(messages, [SurfaceEvicted { surface: first, lost: loss }]);
    assert!(loss.is_lost());
    assert_eq!(MapLoss::UNITS.whole_nl(loss.received), fell.water_nl);
    assert_balanced(&scene, first);
    assert_eq!(scene.0.world().get::<Unmapped>(first), Some(&Unmapped::Evicted));
    assert!(!has::<MapSize>(&scene, first) && !has::<CpuMaps>(&scene, first));
    assert!(!has::<SurfaceWater>(&scene, first) && has::<SurfaceWater>(&scene, second));
    let now = pool(&scene);
    assert_eq!((now.mapped, now.unmapped, now.evictions, now.refusals), (2, 1, 1, 0));
    assert!(now.reserved <= bytes * 5 / 2);

    // What falls on it now is counted as lost.
    drizzle(&mut scene, 600.0, Vec2::splat(0.3), Vec3::ZERO);
    assert!(get::<SurfaceTotals>(&scene, first).water_nl > fell.water_nl);
    assert!(get::<MapLoss>(&scene, first).unpainted > 0);
    assert!(scene.0.world().get::<DropQueue>(first).unwrap().0.is_empty());
    assert_balanced(&scene, first);

    // Room for it again: it goes on, and its accounts with it.
    scene.0.world_mut().entity_mut(second).despawn();
    scene.wait_for::<SurfaceWater>(first);
    assert!(!has::<Unmapped>(&scene, first));
    drizzle(&mut scene, 600.0, Vec2::splat(0.3), Vec3::ZERO);
    assert!(scene.water(first).ledger().received > 0);
    assert_balanced(&scene, first);
    let now = pool(&scene);
    assert_eq!((now.mapped, now.unmapped, now.evictions), (2, 0, 1));
}

#[test]
fn where_there_is_no_room_at_all_a_surface_is_refused_until_there_is() {
    let mut scene = Scene::new(HZ);
    scene.0.insert_resource(MapBudget { bytes: 1, texel: None });
    let mesh = add(&mut scene, 1.0);
    let plate = spawn(&mut scene, mesh, 512, Vec3::ZERO);
    scene.wait_for::<Unmapped>(plate);
    assert_eq!(scene.0.world().get::<Unmapped>(plate), Some(&Unmapped::Refused));
    drizzle(&mut scene, 600.0, Vec2::splat(0.3), Vec3::ZERO);
    let now = pool(&scene);
    assert_eq!((now.mapped, now.unmapped, now.refusals, now.used), (0, 1, 1, 0));
    assert!(get::<MapLoss>(&scene, plate).is_lost());
    assert_balanced(&scene, plate);
    scene.0.insert_resource(MapBudget::default());
    scene.wait_for::<SurfaceWater>(plate);
    assert_eq!(get::<MapSize>(&scene, plate).texels(), 512);
}

#[test]
fn a_surface_that_is_given_other_maps_keeps_its_accounts() {
    let mut scene = Scene::new(HZ);
    let mesh = add(&mut scene, 1.0);
    let plate = spawn(&mut scene, mesh, 64, Vec3::ZERO);
    scene.wait_for::<SurfaceWater>(plate);
    drizzle(&mut scene, 600.0, Vec2::splat(0.3), Vec3::ZERO);
    scene.0.world_mut().get_mut::<Weatherable>(plate).unwrap().map_size = 128;
    scene.0.update();
    scene.wait_for::<SurfaceWater>(plate);
    assert_eq!((get::<MapSize>(&scene, plate).texels(), scene.water(plate).size()), (128, 128));
    assert!(get::<MapLoss>(&scene, plate).is_lost());
    assert_balanced(&scene, plate);
    // By its own settings, not by the budget.
    assert_eq!(pool(&scene).evictions, 0);
}

/// What lies on a surface and what has left it, in units of its own.
fn held(scene: &Scene, surface: Entity) -> [u64; 2] {
    let (water, ledger) = (scene.water(surface), scene.water(surface).ledger());
    let here: u64 = water.texels().iter().map(TexelWater::total).sum();
    [here + ledger.evaporated, ledger.dripped + ledger.spilled]
}

/// A row of plates of half a metre, a metre apart, that all have texels; and whose maps got another size meanwhile.
fn row(scene: &mut Scene, mesh: &Mesh3d, count: u32, z: f32) -> (Vec<Entity>, Vec<SurfaceResized>) {
    let mut plates = Vec::new();
    for number in 0..count {
        plates.push(spawn(scene, mesh.clone(), 128, Vec3::new(number as f32, 0.0, z)));
    }
    let budget = scene.0.world().resource::<MapBudget>().bytes;
    let mut told = Vec::new();
    scene.wait_until("the texels of a row", |scene| {
        assert!(pool(scene).reserved <= budget, "{:?}", pool(scene));
        told.extend(resizes(scene));
        plates.iter().all(|&plate| has::<SurfaceWater>(scene, plate))
    });
    (plates, told)
}

fn sides(scene: &Scene, plates: &[Entity]) -> Vec<u32> {
    plates.iter().map(|&plate| get::<MapSize>(scene, plate).texels()).collect()
}

fn resizes(scene: &mut Scene) -> Vec<SurfaceResized> {
    scene.0.world_mut().resource_mut::<Messages<SurfaceResized>>().drain().collect()
}

type State = (Vec<(u32, Vec<TexelWater>)>, MapPool);

/// Twelve plates that fill their budget, of which the last four were hit last, then twenty more, then none of these any more.
fn crowd() -> State {
    let mut scene = Scene::new(HZ);
    let bytes = 12 * NEED.bytes(128) + NEED.bytes(16);
    scene.0.insert_resource(MapBudget { bytes, texel: None });
    // So that no rays are cast, as above.
    let never = Handle::Uuid(Uuid::from_u128(500), std::marker::PhantomData);
    spawn(&mut scene, Mesh3d(never), 16, Vec3::Y * 50.0);
    let mesh = add(&mut scene, 0.5);
    let (plates, _) = row(&mut scene, &mesh, 12, 0.0);
    assert_eq!(sides(&scene, &plates), [128; 12]);
    drizzle(&mut scene, 20_000.0, Vec2::new(6.0, 0.3), Vec3::X * 5.5);
    drizzle(&mut scene, 8000.0, Vec2::new(1.9, 0.3), Vec3::X * 9.5);
    let before: Vec<[u64; 2]> = plates.iter().map(|&plate| held(&scene, plate)).collect();
    assert!(before.iter().all(|held| held[0] > 0));

    // A quarter of a map each: what seven plates give by becoming as small.
    let (more, told) = row(&mut scene, &mesh, 20, 5.0);
    assert_eq!(sides(&scene, &more), [64; 20]);
    let now = sides(&scene, &plates);
    assert_eq!(now[8..], [128; 4], "those that were hit keep their maps");
    assert_eq!(now.iter().filter(|&&side| side == 64).count(), 7, "{now:?}");
    let counts = pool(&scene);
    assert_eq!((counts.shrinks, counts.evictions, counts.refusals, counts.unmapped), (7, 0, 0, 0));
    // They have half of what they wish for, and so do those that came.
    assert_eq!((counts.growths, counts.reduced), (0, 27));
    assert_eq!(told.len(), 7);
    assert!(
        told.iter().all(|resize| (resize.from, resize.to) == (128, 64) && plates.contains(&resize.surface))
    );
    for (&plate, side) in plates.iter().zip(&now) {
        assert_eq!([scene.water(plate).size(), get::<CpuMaps>(&scene, plate).size], [*side; 2]);
        assert_balanced(&scene, plate);
    }
    let after: Vec<[u64; 2]> = plates.iter().map(|&plate| held(&scene, plate)).collect();
    assert_eq!(after, before, "not a unit is lost");

    // Room again: those that were hit not long ago grow back.
    for plate in more {
        scene.0.world_mut().entity_mut(plate).despawn();
    }
    scene.run(HZ);
    let before: Vec<u64> = plates.iter().map(|&plate| held(&scene, plate).iter().sum()).collect();
    scene.wait_until("maps as they were", |scene| sides(scene, &plates) == [128; 12]);
    scene.0.update();
    let counts = pool(&scene);
    assert_eq!((counts.shrinks, counts.growths, counts.reduced, counts.evictions), (7, 7, 0, 0));
    let after: Vec<u64> = plates.iter().map(|&plate| held(&scene, plate).iter().sum()).collect();
    assert_eq!(after, before, "not a unit is lost");
    // Rain goes on on what they have now.
    drizzle(&mut scene, 20_000.0, Vec2::new(6.0, 0.3), Vec3::X * 5.5);
    for (&plate, before) in plates.iter().zip(before) {
        assert!(held(&scene, plate).iter().sum::<u64>() > before);
        assert_balanced(&scene, plate);
    }
    let texels = |plate: &Entity| (scene.water(*plate).size(), scene.water(*plate).texels().to_vec());
    (plates.iter().map(texels).collect(), counts)
}

#[test]
fn those_that_are_hit_keep_their_maps_and_idle_ones_are_halved_before_any_is_evicted() {
    let once = crowd();
    assert!(once == crowd(), "the same each time");
}

#[test]
fn only_where_halving_is_not_enough_maps_are_lost() {
    let mut scene = Scene::new(HZ);
    scene.0.insert_resource(MapBudget { bytes: 4 * NEED.bytes(256), texel: None });
    let mesh = add(&mut scene, 0.5);
    let plates: Vec<Entity> =
        [0.0, 1.0, 2.0, 3.0].map(|x| spawn(&mut scene, mesh.clone(), 256, Vec3::X * x)).to_vec();
    scene.wait_until("the texels", |scene| plates.iter().all(|&plate| has::<SurfaceWater>(scene, plate)));
    for x in [1.0, 0.0, 2.0, 3.0] {
        drizzle(&mut scene, 600.0, Vec2::splat(0.2), Vec3::X * x);
    }
    let before: Vec<[u64; 2]> = plates.iter().map(|&plate| held(&scene, plate)).collect();
    // All of it comes from the one that was hit longest ago, in one step.
    scene.0.world_mut().resource_mut::<MapBudget>().bytes = 3 * NEED.bytes(256) + NEED.bytes(64);
    scene.wait_until("one small plate", |scene| sides(scene, &plates) == [256, 64, 256, 256]);
    // From all of them.
    scene.0.world_mut().resource_mut::<MapBudget>().bytes = 4 * NEED.bytes(64);
    scene.wait_until("small plates", |scene| sides(scene, &plates) == [64; 4]);
    let after: Vec<[u64; 2]> = plates.iter().map(|&plate| held(&scene, plate)).collect();
    assert_eq!((after, pool(&scene).evictions, pool(&scene).shrinks), (before, 0, 4));
    // Nothing is left to be halved.
    scene.0.world_mut().resource_mut::<MapBudget>().bytes = 3 * NEED.bytes(64);
    scene.wait_until("an eviction", |scene| !has::<MapSize>(scene, plates[1]));
    assert_eq!((pool(&scene).evictions, pool(&scene).shrinks), (1, 4));
    assert!(get::<MapLoss>(&scene, plates[1]).is_lost());
    for &plate in &plates {
        assert_balanced(&scene, plate);
    }
}
