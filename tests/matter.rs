//! Dust, mud and snow on surfaces, in a whole app without a renderer.

use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy_weathering::collision::{MeshTriangles, UvSet};
use bevy_weathering::effect::{Carries, ShippedEffect};
use bevy_weathering::matter::{MatterStock, SurfaceMatter};
use bevy_weathering::prelude::*;
use bevy_weathering::scenes::meshes::{car, ground};
use bevy_weathering::weather::Weather;
use bevy_weathering::wetting::surface_points;

use crate::wetting::scene::Scene;

const HZ: u32 = 60;

/// A slab of a square metre, tilted about x.
fn slab(scene: &mut Scene, degrees: f32) -> Entity {
    let mesh = ground(Vec2::ONE, UVec2::splat(4)).unwrap();
    let glazed = PorousMaterial { capacity_mm: 0.0, retained_mm: 0.05, ..default() };
    let tilted = Transform::from_rotation(Quat::from_rotation_x(degrees.to_radians()));
    scene.surface(mesh, 64, glazed, tilted)
}

/// Lets something fall on the slab for so long, mm/h, and returns its emitter.
fn fall(scene: &mut Scene, carries: Carries, mm_per_h: f32, seconds: u32) -> Entity {
    let effect = WeatherEffect { carries, stamp_radius: Some(0.03), terminal_speed: Some(6.5), ..default() };
    let effect = scene.0.world_mut().resource_mut::<Assets<WeatherEffect>>().add(effect);
    let emitter = Emitter {
        effect,
        rate: 600.0,
        flow: Flow::MmPerHour(mm_per_h),
        shape: EmitterShape::Sky { half_size: Vec2::splat(0.4) },
        speed: 6.0,
        ..default()
    };
    let sky = scene.0.world_mut().spawn((emitter, Transform::from_xyz(0.0, 1.5, 0.0))).id();
    scene.run(HZ * seconds);
    scene.0.world_mut().entity_mut(sky).despawn();
    // What is in flight lands.
    scene.run(HZ);
    sky
}

fn matter(scene: &Scene, surface: Entity) -> &SurfaceMatter {
    scene.0.world().get::<SurfaceMatter>(surface).unwrap()
}

/// Litres, from units of the surface.
fn litres(scene: &Scene, surface: Entity, of: impl Fn(MatterStock) -> u64) -> f64 {
    scene.water(surface).units().mm3(of(matter(scene, surface).stock())) * 1e-6
}

/// What came is there, or the ledger says where it went.
fn assert_accounted(scene: &Scene, surface: Entity) {
    let (stock, ledger) = (matter(scene, surface).stock(), matter(scene, surface).ledger());
    assert_eq!(ledger.received_dust + ledger.received_mud, stock.dust + stock.mud + ledger.washed_off);
    assert_eq!(ledger.received_snow, stock.snow + ledger.melted + ledger.slid_off);
}

#[test]
fn rain_washes_dust_down_a_slope_and_off_it() {
    let mut scene = Scene::new(HZ);
    let slope = slab(&mut scene, 30.0);
    // What drips off its lower edge comes down here.
    let glazed = PorousMaterial { capacity_mm: 0.0, retained_mm: 0.05, ..default() };
    let sheet = ground(Vec2::ONE, UVec2::splat(4)).unwrap();
    let below = scene.surface(sheet, 64, glazed, Transform::from_xyz(0.0, -0.6, 0.0));
    fall(&mut scene, Carries::Dust, 400.0, 3);
    let fallen = litres(&scene, slope, |stock| stock.dust);
    // A third of a millimetre on two thirds of a square metre.
    assert!((0.15..0.25).contains(&fallen), "{fallen}");
    assert_eq!(matter(&scene, slope).stock().mud, 0);
    fall(&mut scene, Carries::Water, 500.0, 20);
    let ledger = matter(&scene, slope).ledger();
    let washed = scene.water(slope).units().mm3(ledger.washed_off) * 1e-6;
    assert!(washed > 0.05 * fallen, "{washed} of {fallen}");
    let caught = scene.water(below).units().mm3(matter(&scene, below).ledger().received_mud) * 1e-6;
    assert!(caught > 0.2 * washed && caught <= washed, "{caught} of {washed}");
    assert_accounted(&scene, slope);
    assert_accounted(&scene, below);
}

/// An effect that comes with the library, in the scene.
fn shipped(scene: &mut Scene, name: &str) -> Handle<WeatherEffect> {
    let effect = ShippedEffect::named(name).unwrap().read().unwrap();
    scene.0.world_mut().resource_mut::<Assets<WeatherEffect>>().add(effect)
}

#[test]
fn a_hose_washes_a_car_clean_where_its_jet_passed() {
    const SIZE: u32 = 256;
    let mut scene = Scene::new(HZ);
    let mesh = car(1.6, 16).unwrap();
    let triangles = MeshTriangles::with_uvs(&mesh, UvSet::default()).unwrap();
    let points = surface_points(&triangles, &Affine3A::IDENTITY, SIZE, [Wrap::Clamp; 2]);
    let paint = PorousMaterial { capacity_mm: 0.0, retained_mm: 0.03, ..default() };
    let body = scene.surface(mesh, SIZE, paint, Transform::IDENTITY);
    fall(&mut scene, Carries::Dust, 60.0, 3);
    // On the roof, which is nearly level.
    let aim = Vec3::new(-0.3, 0.55, 0.0);
    let soil = |scene: &Scene| {
        let texels = matter(scene, body).texels();
        let near = points.iter().filter(|point| point.position.distance(aim) < 0.06);
        near.map(|point| texels[point.texel as usize].soil()).sum::<u64>()
    };
    let before = soil(&scene);
    assert!(before > 0);
    let effect = shipped(&mut scene, "hose");
    let hose = Emitter { rate: 900.0, spread: 5.0f32.to_radians(), ..Emitter::hose(effect, 15.0, 0.006) };
    // From so near that the jet hardly sinks on its way.
    let held = Transform::from_xyz(-0.1, 1.3, 0.25).looking_at(aim, Vec3::Y);
    let hose = scene.0.world_mut().spawn((hose, held)).id();
    scene.run(9 * HZ);
    scene.0.world_mut().entity_mut(hose).despawn();
    scene.run(HZ);
    let after = soil(&scene);
    assert!(after < before / 2, "{after} of {before}");
    // Some of it has left the car, and what has not is somewhere on it.
    assert!(matter(&scene, body).ledger().washed_off > 0);
    assert_accounted(&scene, body);
}

#[test]
fn drizzle_leaves_nearly_all_dust_where_it_lies() {
    let mut scene = Scene::new(HZ);
    let slope = slab(&mut scene, 20.0);
    fall(&mut scene, Carries::Dust, 60.0, 3);
    let lies = |scene: &Scene| {
        let texels = matter(scene, slope).texels();
        texels.iter().map(|texel| texel.soil()).collect::<Vec<_>>()
    };
    let before = lies(&scene);
    let effect = shipped(&mut scene, "drizzle");
    let drizzle = Emitter { rate: 300.0, ..Emitter::rain(effect, 0.5, Vec2::splat(0.4)) };
    let sky = scene.0.world_mut().spawn((drizzle, Transform::from_xyz(0.0, 1.5, 0.0))).id();
    scene.run(60 * HZ);
    scene.0.world_mut().entity_mut(sky).despawn();
    scene.run(HZ);
    assert!(scene.water(slope).ledger().received > 0);
    let moved: u64 = before.iter().zip(lies(&scene)).map(|(before, after)| before.abs_diff(after)).sum();
    let all: u64 = before.iter().sum();
    assert!(moved < all / 100, "{moved} of {all}");
    assert_accounted(&scene, slope);
}

#[test]
fn dust_on_wet_ground_is_mud_and_thrown_mud_brings_its_water() {
    let mut scene = Scene::new(HZ);
    let floor = slab(&mut scene, 0.0);
    fall(&mut scene, Carries::Water, 200.0, 3);
    fall(&mut scene, Carries::Dust, 100.0, 2);
    let stock = matter(&scene, floor).stock();
    assert!(stock.mud > 4 * stock.dust && stock.mud > 0, "{stock:?}");
    let (mud, water) = (stock.mud, scene.water(floor).ledger().received);
    fall(&mut scene, Carries::Mud(0.5), 100.0, 2);
    let solids = matter(&scene, floor).stock().mud - mud;
    let brought = scene.water(floor).ledger().received - water;
    assert!((solids as f64 / brought as f64 - 1.0).abs() < 0.05, "{solids} {brought}");
    assert_accounted(&scene, floor);
}

#[test]
fn snow_lies_on_the_flat_slides_off_the_steep_and_melts_into_as_much_water() {
    let mut scene = Scene::new(HZ);
    scene.0.world_mut().resource_mut::<Weather>().temperature_c = -5.0;
    let floor = slab(&mut scene, 0.0);
    fall(&mut scene, Carries::Snow, 1000.0, 5);
    let snow = matter(&scene, floor).stock().snow;
    assert!(snow > 0 && !scene.water(floor).texels().iter().any(|texel| texel.film > 0));
    scene.run(20 * HZ);
    assert_eq!(matter(&scene, floor).stock().snow, snow, "in the frost it stays");
    {
        let mut weather = scene.0.world_mut().resource_mut::<Weather>();
        (weather.temperature_c, weather.drying_speed) = (8.0, 20_000.0);
    }
    scene.run(60 * HZ);
    let (stock, ledger) = (matter(&scene, floor).stock(), matter(&scene, floor).ledger());
    assert!(stock.snow < snow / 2, "{stock:?}");
    assert_eq!(ledger.melted, snow - stock.snow - (ledger.slid_off));
    assert_accounted(&scene, floor);

    let mut scene = Scene::new(HZ);
    scene.0.world_mut().resource_mut::<Weather>().temperature_c = -5.0;
    let steep = slab(&mut scene, 70.0);
    fall(&mut scene, Carries::Snow, 4000.0, 8);
    scene.run(20 * HZ);
    let ledger = matter(&scene, steep).ledger();
    assert!(ledger.slid_off > ledger.received_snow / 4, "{ledger:?}");
    assert_accounted(&scene, steep);
}
