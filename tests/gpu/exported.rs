//! A surface as an app draws it, and its export as Bevy alone reads and draws it.

use bevy::gltf::GltfAssetLabel;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::export::{ColorReadback, Snapshot};
use bevy_weathering::material::DryMaterial;
use bevy_weathering::overlay::{Overlays, Weatherable};
use image::RgbImage;

use super::app::{add_target, app, bare_app_with_files, camera, cover, picture, still, update, update_until};
use super::images::{difference, keep};

const SIZE: UVec2 = UVec2::new(64, 64);
/// Water that the pores can just take up, mm.
const PORES_MM: f32 = 0.05;

/// A camera above the middle of the floor, and a light whose mirror image it does not see. What it draws into.
fn stage(app: &mut App) -> Handle<Image> {
    let target = add_target(app, SIZE);
    let eye = camera(&target, Vec3::new(0.0, 1.2, 0.3), Vec3::ZERO);
    app.world_mut().spawn(eye);
    app.world_mut().spawn((
        DirectionalLight { illuminance: 2500.0, ..default() },
        Transform::default().looking_to(Vec3::new(-0.5, -1.0, -0.6), Vec3::Y),
    ));
    target
}

/// A floor with so much absorbed water as the app draws it, and as it is exported.
fn in_app(absorbed_mm: f32) -> Option<(RgbImage, Vec<u8>)> {
    let mut app = app()?;
    let target = stage(&mut app);
    let material = StandardMaterial {
        base_color: Color::linear_rgb(0.5, 0.3, 0.2),
        perceptual_roughness: 0.9,
        ..default()
    };
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(material);
    let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::splat(2.0)));
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh);
    let maps = Weatherable { map_size: 64, ..default() };
    let floor = (Name::new("floor"), Mesh3d(mesh), MeshMaterial3d(material), Transform::default());
    let floor = app.world_mut().spawn((floor, maps, still(PORES_MM))).id();
    update_until(&mut app, "the maps and the material", |world| {
        world.get::<Overlays>(floor).is_some() && world.get::<DryMaterial>(floor).is_some()
    });
    if absorbed_mm > 0.0 {
        cover(&mut app, floor, 0.0, absorbed_mm);
    }
    // The water came in tick 1: let it be later than that.
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    for _ in 0..3 {
        update(&mut app);
    }
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    let drawn = picture(&mut app, &target);
    assert!(ColorReadback::is_painted(app.world_mut()));
    let readback = ColorReadback::begin(app.world_mut());
    update_until(&mut app, "the colour maps", |_| readback.is_done());
    let snapshot = Snapshot::take(app.world_mut(), "floor", &readback.finish()).unwrap();
    Some((drawn, snapshot.bake(Some(64)).unwrap().glb))
}

/// A scene as Bevy draws it.
fn elsewhere(glb: &[u8]) -> Option<RgbImage> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("floor.glb"), glb).unwrap();
    let mut app = bare_app_with_files(folder.path())?;
    app.finish();
    app.cleanup();
    let target = stage(&mut app);
    let scene = app.world().resource::<AssetServer>().load(GltfAssetLabel::Scene(0).from_asset("floor.glb"));
    app.world_mut().spawn(WorldAssetRoot(scene.clone()));
    update_until(&mut app, "the scene", |world| {
        let mut meshes = world.query::<(&Mesh3d, &MeshMaterial3d<StandardMaterial>)>();
        let is_spawned = meshes.iter(world).next().is_some();
        is_spawned && world.resource::<AssetServer>().is_loaded_with_dependencies(&scene)
    });
    for _ in 0..3 {
        update(&mut app);
    }
    Some(picture(&mut app, &target))
}

/// The mean of each channel.
fn means(picture: &RgbImage) -> [f64; 3] {
    [0, 1, 2].map(|channel: usize| {
        let sum: f64 = picture.pixels().map(|pixel| f64::from(pixel[channel])).sum();
        sum / f64::from(picture.width() * picture.height())
    })
}

#[test]
fn bevy_reads_an_export_and_draws_it_as_the_app_did() {
    let Some((dry, dry_glb)) = in_app(0.0) else { return };
    let Some(dry_elsewhere) = elsewhere(&dry_glb) else { return };
    // Its colour comes from a texture of 8 bits.
    let (average, largest) = difference(&dry_elsewhere, &dry);
    if average > 1.0 || largest > 3 {
        keep("export_dry", &[("export", &dry_elsewhere), ("app", &dry)]);
        panic!("dry: differs by {average:.3} on average, {largest} at most (of 255)");
    }

    let Some((wet, wet_glb)) = in_app(PORES_MM) else { return };
    let Some(wet_elsewhere) = elsewhere(&wet_glb) else { return };
    let [dry, wet, wet_elsewhere] = [&dry, &wet, &wet_elsewhere].map(means);
    for ((dry, wet), elsewhere) in dry.into_iter().zip(wet).zip(wet_elsewhere) {
        assert!(wet < 0.95 * dry, "the app: {wet} wet, {dry} dry");
        // Pores hide more of a slanted light than a texture can tell.
        let part = elsewhere / wet;
        assert!((0.88..1.12).contains(&part), "{elsewhere} in the export, {wet} in the app");
    }
}
