//! Pictures: what must look the same, and what must not.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::material::{BaseBrdf, DryMaterial, Pores, PorousMaterial, TextureMeaning, WettingModel};
use bevy_weathering::offscreen::Stage;
use bevy_weathering::overlay::{OverlayUv, Overlays, Splat, Weatherable, Wrap};
use image::RgbImage;

use super::app::{add_target, app, camera, cover, picture, still, update, update_until};
use super::splat::{painted, push};

const SIZE: UVec2 = UVec2::new(96, 72);

/// Daylight with shadows, and a camera that looks down at what stands in the middle.
pub fn stage(world: &mut World, size: UVec2) -> (Stage, Entity) {
    let sun = DirectionalLight { illuminance: 2500.0, shadow_maps_enabled: true, ..default() };
    let stage = Stage::new(world, size, sun, Vec3::new(-1.0, -1.5, -0.6));
    let eye = Transform::from_xyz(0.6, 1.2, 2.6).looking_at(Vec3::new(0.0, 0.4, 0.0), Vec3::Y);
    let camera = world.spawn(stage.camera(eye)).id();
    (stage, camera)
}

/// A ball on a floor under one light of each kind and an environment map, drawn once.
fn draw(surface: Option<PorousMaterial>, metallic: f32, water_mm: f32) -> Option<RgbImage> {
    let mut app = app()?;
    let (stage, _) = stage(app.world_mut(), SIZE);
    let material = StandardMaterial {
        base_color: Color::linear_rgb(0.5, 0.3, 0.2),
        perceptual_roughness: 0.6,
        metallic,
        ..default()
    };
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(material);
    let meshes = [Mesh::from(Sphere::new(0.5)), Mesh::from(Plane3d::new(Vec3::Y, Vec2::splat(2.0)))]
        .map(|mesh| app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh));
    let mut surfaces = vec![];
    for (mesh, height) in meshes.into_iter().zip([0.5, 0.0]) {
        let place = Transform::from_xyz(0.0, height, 0.0);
        let mut entity = app.world_mut().spawn((Mesh3d(mesh), MeshMaterial3d(material.clone()), place));
        if let Some(porous) = surface {
            // Bevy's ball has a seam with overlapping uvs; both pictures are to show the same vertices.
            let maps = Weatherable {
                map_size: 64,
                wrap_u: Wrap::Repeat,
                wrap_v: Wrap::Clamp,
                uv: OverlayUv::Mesh,
                ..default()
            };
            surfaces.push(entity.insert((maps, porous)).id());
        }
    }
    app.world_mut().spawn((
        PointLight { intensity: 60_000.0, shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(-1.2, 1.0, 0.8),
    ));
    app.world_mut().spawn((
        SpotLight { intensity: 300_000.0, shadow_maps_enabled: true, outer_angle: 0.4, ..default() },
        Transform::from_xyz(1.0, 2.0, 1.0).looking_at(Vec3::new(0.3, 0.0, 0.3), Vec3::Y),
    ));
    update_until(&mut app, "the maps and materials", |world| {
        surfaces.iter().all(|&entity| {
            world.get::<Overlays>(entity).is_some() && world.get::<DryMaterial>(entity).is_some()
        })
    });
    if water_mm > 0.0 {
        // What the pores take up is in them; the rest lies on top.
        let capacity = surface.map_or(0.0, |porous| porous.capacity_mm);
        for &entity in &surfaces {
            cover(&mut app, entity, (water_mm - capacity).max(0.0), water_mm.min(capacity));
        }
    }
    // The water came in tick 1: let it be later than that.
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    for _ in 0..3 {
        update(&mut app);
    }
    assert!(app.world().resource::<WeatheringClock>().tick() > 1);
    Some(picture(&mut app, &stage.target))
}

/// Water, in mm, that the ball and the floor can just take up.
const NO_FILM: f32 = 0.05;

/// Mean and largest difference of two pictures, in 1/255.
pub fn difference(a: &RgbImage, b: &RgbImage) -> (f64, u8) {
    assert_eq!(a.dimensions(), b.dimensions());
    let differences = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| a.abs_diff(*b));
    let sum: f64 = differences.clone().map(f64::from).sum();
    (sum / a.as_raw().len() as f64, differences.max().unwrap_or(0))
}

/// Mean brightness, of 255.
pub fn mean(picture: &RgbImage) -> f64 {
    picture.as_raw().iter().map(|&byte| f64::from(byte)).sum::<f64>() / picture.as_raw().len() as f64
}

/// Keeps the pictures of a failed comparison where a person can look at them.
pub fn keep(name: &str, pictures: &[(&str, &RgbImage)]) {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/images/actual");
    std::fs::create_dir_all(&folder).unwrap();
    for (which, picture) in pictures {
        picture.save(folder.join(format!("{name}_{which}.png"))).unwrap();
    }
}

pub fn assert_same(name: &str, ours: &RgbImage, standard: &RgbImage) {
    let (average, largest) = difference(ours, standard);
    if average > 0.05 || largest > 2 {
        keep(name, &[("ours", ours), ("standard", standard)]);
        panic!("{name}: differs by {average:.3} on average, {largest} at most (of 255)");
    }
}

fn instant() -> PorousMaterial {
    still(NO_FILM)
}

#[test]
fn without_pores_or_without_water_it_is_the_standard_material() {
    let Some(standard) = draw(None, 0.0, 0.0) else { return };
    let (average, _) = difference(&standard, &RgbImage::new(SIZE.x, SIZE.y));
    assert!(average > 20.0, "the scene is lit: {average}");

    let glazed =
        PorousMaterial { model: WettingModel::Hnat(Pores { alpha_poro: 0.0, ..default() }), ..instant() };
    assert_same("glazed_dry", &draw(Some(glazed), 0.0, 0.0).unwrap(), &standard);
    let solid = PorousMaterial { texture: TextureMeaning::Solid, ..glazed };
    assert_same("glazed_solid", &draw(Some(solid), 0.0, 0.0).unwrap(), &standard);
    assert_same("porous_dry", &draw(Some(instant()), 0.0, 0.0).unwrap(), &standard);
    // Water that would fill pores does nothing where there are none.
    assert_same("glazed_wet", &draw(Some(glazed), 0.0, NO_FILM).unwrap(), &standard);
}

#[test]
fn wet_pores_are_darker_and_metal_is_not() {
    let Some(dry) = draw(Some(instant()), 0.0, 0.0) else { return };
    let wet = draw(Some(instant()), 0.0, 1.0).unwrap();
    let (dry_mean, wet_mean) = (mean(&dry), mean(&wet));
    if wet_mean > dry_mean * 0.9 {
        keep("wet", &[("dry", &dry), ("wet", &wet)]);
        panic!("wet {wet_mean:.1} is not darker than dry {dry_mean:.1}");
    }
    let metal_dry = draw(Some(instant()), 1.0, 0.0).unwrap();
    let metal_wet = draw(Some(instant()), 1.0, NO_FILM).unwrap();
    assert_same("metal", &metal_wet, &metal_dry);
}

#[test]
fn blinn_phong_is_another_picture_of_the_same_brightness() {
    let Some(ggx) = draw(Some(instant()), 0.0, 0.0) else { return };
    let phong = PorousMaterial { brdf: BaseBrdf::BlinnPhong, ..instant() };
    let phong = draw(Some(phong), 0.0, 0.0).unwrap();
    let (average, _) = difference(&ggx, &phong);
    assert!(average > 0.1, "the switch does something: {average}");
    assert!((mean(&ggx) - mean(&phong)).abs() < 8.0, "{} and {}", mean(&ggx), mean(&phong));
}

#[test]
fn what_is_painted_on_metal_is_no_metal() {
    // A sheet, lit aslant, so that metal mirrors nothing to the eye; in its middle the paint covers all.
    let draw = |metallic: f32, is_painted: bool| -> Option<RgbImage> {
        let mut app = app()?;
        let target = add_target(&mut app, SIZE);
        let world = app.world_mut();
        world.spawn(camera(&target, Vec3::Z * 2.0, Vec3::ZERO));
        world.spawn((
            DirectionalLight { illuminance: 6000.0, ..default() },
            Transform::default().looking_to(Vec3::new(-1.0, 0.0, -0.4), Vec3::Y),
        ));
        let material = StandardMaterial { metallic, perceptual_roughness: 0.3, ..Color::WHITE.into() };
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::new(3.0, 3.0));
        let maps = Weatherable { map_size: 64, uv: OverlayUv::Mesh, ..default() };
        let sheet = world.spawn((Mesh3d(mesh), MeshMaterial3d(material), maps, instant())).id();
        update_until(&mut app, "the maps and materials", |world| {
            world.get::<Overlays>(sheet).is_some() && world.get::<DryMaterial>(sheet).is_some()
        });
        if is_painted {
            let splat = Splat {
                center: [32 * 256; 2],
                radius: [63 * 128; 2],
                tick: 1,
                diffuse: 0xff40_8080,
                ..bytemuck::Zeroable::zeroed()
            };
            push(&mut app, sheet, &[splat]);
            painted(&mut app, 1);
        }
        update(&mut app);
        Some(picture(&mut app, &target))
    };
    let Some(bare) = draw(1.0, false) else { return };
    let [metal, stone] = [1.0, 0.0].map(|metallic| draw(metallic, true).unwrap());
    let middle = |picture: &RgbImage| picture[(SIZE.x / 2, SIZE.y / 2)].0;
    let (bare_red, metal_red, stone_red) = (middle(&bare)[0], middle(&metal)[0], middle(&stone)[0]);
    if metal_red < bare_red.saturating_add(20) || metal_red.abs_diff(stone_red) > 4 {
        keep("paint_on_metal", &[("bare", &bare), ("metal", &metal), ("stone", &stone)]);
        panic!("red is {bare_red} on bare metal, {metal_red} painted, {stone_red} painted on stone");
    }
}
