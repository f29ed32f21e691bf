//! Files of effects, and of their stamps, that are edited while an app watches them, as the sandbox does.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use bevy::asset::{AssetPlugin, LoadState};
use bevy::prelude::*;
use bevy_weathering::overlay::CpuMaps;
use bevy_weathering::particle::Particles;
use bevy_weathering::prelude::*;
use bevy_weathering::scenes::meshes::ground;

use crate::wetting::scene::Scene;

/// An effect whose particles carry so many mm³.
fn write_effect(folder: &Path, volume_mm3: &str) {
    let effect = format!(
        r#"(volume_mm3: {volume_mm3}, stamp_radius: 0.2, diffuse: (color: (1.0, 1.0, 1.0), opacity: 1.0),
            stamps: Images(diffuse: "spot.png", variants: 1))"#
    );
    fs::write(folder.join("spot.effect.ron"), effect).unwrap();
}

/// A stamp of one colour.
fn write_stamp(folder: &Path, [red, green, blue]: [u8; 3]) {
    let stamp = image::RgbaImage::from_pixel(64, 64, image::Rgba([red, green, blue, 255]));
    stamp.save(folder.join("spot.png")).unwrap();
}

/// Ticks go by until something is so.
fn until(scene: &mut Scene, what: &str, mut is_so: impl FnMut(&World) -> bool) {
    let begun = Instant::now();
    while !is_so(scene.0.world()) {
        assert!(begun.elapsed() < Duration::from_secs(60), "waited in vain for {what}");
        scene.run(1);
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Whether there are particles in flight, all with so many mm³.
fn all_carry(world: &World, volume_mm3: u32) -> bool {
    let volumes = world.resource::<Particles>().volumes_nl();
    !volumes.is_empty() && volumes.iter().all(|&volume| volume == volume_mm3 * 1000)
}

/// Whether there is a texel of such a colour in the diffuse map.
fn has_color(world: &World, surface: Entity, is_so: impl Fn([u8; 4]) -> bool) -> bool {
    world.get::<CpuMaps>(surface).is_some_and(|maps| maps.diffuse.iter().any(|&texel| is_so(texel)))
}

#[test]
fn effects_and_stamps_follow_their_files_and_survive_mistakes() {
    let folder = tempfile::tempdir().unwrap();
    write_stamp(folder.path(), [0, 255, 0]);
    write_effect(folder.path(), "60.0");
    let assets = AssetPlugin {
        file_path: folder.path().to_string_lossy().into_owned(),
        watch_for_changes_override: Some(true),
        ..default()
    };
    let mut scene = Scene::with_assets(60, assets);
    let mesh = ground(Vec2::splat(1.0), UVec2::splat(2)).unwrap();
    // Nothing runs and drips: all particles are the emitter's.
    let material = PorousMaterial { retained_mm: 1000.0, ..default() };
    let floor = scene.surface(mesh, 64, material, Transform::default());
    let effect: Handle<WeatherEffect> = scene.0.world().resource::<AssetServer>().load("spot.effect.ron");
    let emitter = Emitter { effect: effect.clone(), rate: 60.0, speed: 2.0, ..default() };
    let down = Transform::from_xyz(0.0, 0.5, 0.0).looking_to(Vec3::NEG_Y, Vec3::X);
    scene.0.world_mut().spawn((emitter, down));

    let green = |[red, green, ..]: [u8; 4]| green > 100 && red < 50;
    let red = |[red, green, ..]: [u8; 4]| red > 100 && green < 50;
    until(&mut scene, "the effect", |world| all_carry(world, 60));
    until(&mut scene, "green marks", |world| has_color(world, floor, green));
    assert!(!has_color(scene.0.world(), floor, red));

    write_effect(folder.path(), "20.0");
    until(&mut scene, "less water", |world| all_carry(world, 20));
    write_stamp(folder.path(), [255, 0, 0]);
    until(&mut scene, "red marks", |world| has_color(world, floor, red));
    assert!(all_carry(scene.0.world(), 20));

    // What makes no sense is refused, and what was there stays.
    write_effect(folder.path(), "a lot");
    until(&mut scene, "the refusal", |world| {
        matches!(world.resource::<AssetServer>().load_state(&effect), LoadState::Failed(_))
    });
    scene.run(60);
    assert!(all_carry(scene.0.world(), 20));
    write_effect(folder.path(), "30.0");
    until(&mut scene, "more water", |world| all_carry(world, 30));
}
