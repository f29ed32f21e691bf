//! Scenes that are started over, and what is measured in the background at fixed ticks.

use std::time::Duration;

use bevy::prelude::*;
use bevy_weathering::collision::SurfaceCollider;
use bevy_weathering::prelude::*;
use bevy_weathering::scenario::reset_scenario;
use bevy_weathering::scenes::meshes::ground;
use bevy_weathering::weather::Weather;
use bevy_weathering::wetting::{Exposure, MeasureTiming, WetGeometry};

use crate::posed::{fall, glazed, hanging, plank, skin};
use crate::wetting::scene::Scene;

/// Texels along each side, as of planks.
const SIZE: u32 = 256;

/// A scene with one surface that is ready, and fixed ticks.
fn scene_with(mesh: Mesh, size: u32) -> (Scene, Entity) {
    let mut scene = Scene::new(60);
    scene.0.insert_resource(MeasureTiming::AfterTicks(10));
    let surface = scene.surface(mesh, size, glazed(), Transform::default());
    scene.wait_for::<Exposure>(surface);
    (scene, surface)
}

fn start_over(scene: &mut Scene) {
    reset_scenario(scene.0.world_mut());
    // A frame without a tick, in which everybody sees it.
    scene.0.update();
}

#[test]
fn after_a_reset_water_runs_by_the_slopes_of_the_start_and_then_by_those_of_the_pose() {
    let (mut scene, surface) = scene_with(plank(), SIZE);
    skin(&mut scene, surface, hanging(Vec3::ZERO));
    // The pose follows.
    (0..3).for_each(|_| scene.0.update());
    let [first, second] = [(); 2].map(|()| {
        start_over(&mut scene);
        scene.pour(surface, Vec2::new(0.9, 0.5), 6, 2_000_000);
        let falls: Vec<f32> = (0..60)
            .map(|_| {
                scene.run(1);
                fall(scene.0.world(), surface)
            })
            .collect();
        let water = scene.water(surface);
        let films: Vec<u32> = water.texels().iter().map(|texel| texel.film).collect();
        (falls, films, water.ledger())
    });
    assert!(first.0[0].abs() < 0.01 && first.0[59] > 0.5, "{:?}", first.0);
    assert_eq!((first.0, first.2), (second.0, second.2));
    assert!(first.1 == second.1, "the water lies elsewhere");
}

#[test]
fn a_reset_while_shadows_are_looked_for_leaves_those_of_the_start() {
    let (mut scene, surface) = scene_with(ground(Vec2::ONE, UVec2::splat(2)).unwrap(), 64);
    let exposure = |scene: &Scene| scene.0.world().get::<Exposure>(surface).unwrap().clone();
    scene.run(1);
    let (before, dark) = (exposure(&scene), *scene.0.world().resource::<Weather>());
    scene.0.insert_resource(Weather { sun_w_per_m2: 800.0, ..dark });
    (0..3).for_each(|_| scene.run(1));
    assert!(exposure(&scene) == before, "its time has not come");
    scene.0.insert_resource(dark);
    start_over(&mut scene);
    assert!(exposure(&scene) == before, "by a sun that is gone");
    (0..30).for_each(|_| scene.run(1));
    assert!(exposure(&scene) == before);
    // And it was not for want of looking.
    scene.0.insert_resource(Weather { sun_w_per_m2: 800.0, ..dark });
    (0..30).for_each(|_| scene.run(1));
    assert!(exposure(&scene) != before);
}

#[test]
fn at_fixed_ticks_a_surface_that_comes_later_is_ready_in_the_same_tick_however_long_it_takes() {
    let ready = |pause: Duration| {
        let (mut scene, _) = scene_with(plank(), SIZE);
        scene.run(1);
        let world = scene.0.world_mut();
        let mesh =
            Mesh3d(world.resource_mut::<Assets<Mesh>>().add(ground(Vec2::ONE, UVec2::splat(20)).unwrap()));
        let later = world.spawn((Weatherable::default(), mesh, glazed(), Transform::default())).id();
        let mut came = [0; 3];
        for tick in 1..=100 {
            scene.run(1);
            let surface = scene.0.world().entity(later);
            let there = [
                surface.contains::<SurfaceCollider>(),
                surface.contains::<WetGeometry>(),
                surface.contains::<Exposure>(),
            ];
            for (came, is_there) in came.iter_mut().zip(there) {
                if is_there && *came == 0 {
                    *came = tick;
                }
            }
            std::thread::sleep(pause);
        }
        came
    };
    // In the first run each step is done long before its time, in the second perhaps not.
    let [slow, fast] = [Duration::from_millis(20), Duration::ZERO].map(ready);
    assert!(slow[0] > 10 && slow[1] > slow[0] + 9 && slow[2] > slow[1] + 9, "{slow:?}");
    assert_eq!(slow, fast);
}
