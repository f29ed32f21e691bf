//! Wet ground under every model, standing water, ripples, and light through wet cloth.

use bevy::light::EnvironmentMapLight;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::material::{
    Coated, DryMaterial, Flood, Grains, Pores, PorousMaterial, StandingWater, Tweaked, WetLook, WettingModel,
};
use bevy_weathering::overlay::{Overlays, Splat, SplatQueue, Weatherable};
use bevy_weathering::scenes::meshes;
use image::RgbImage;

use super::app::{add_target, app, camera, cover, picture, still, update, update_until};
use super::images::{difference, mean};

const SIZE: UVec2 = UVec2::new(96, 96);

struct Scene {
    app: App,
    target: Handle<Image>,
    surface: Entity,
}

impl Scene {
    /// A mesh, seen from `eye`, under a sky that is bright above and dark below.
    fn new(mesh: Mesh, eye: Vec3, sun: Vec3, sky: f32, material: StandardMaterial) -> Option<Self> {
        let mut app = app()?;
        let target = add_target(&mut app, SIZE);
        let eye = camera(&target, eye, Vec3::ZERO);
        let world = app.world_mut();
        let mut images = world.resource_mut::<Assets<Image>>();
        let sky = EnvironmentMapLight {
            intensity: sky,
            ..EnvironmentMapLight::hemispherical_gradient(
                &mut images,
                Color::linear_rgb(1.0, 1.0, 1.0),
                Color::linear_rgb(0.2, 0.2, 0.2),
                Color::BLACK,
            )
        };
        world.spawn((eye, sky));
        world.spawn((
            DirectionalLight { illuminance: 2500.0, ..default() },
            Transform::default().looking_to(sun, Vec3::Y),
        ));
        let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
        let maps = Weatherable { map_size: 64, ..default() };
        let surface = world.spawn((Mesh3d(mesh), MeshMaterial3d(material), maps)).id();
        update_until(&mut app, "the maps and materials", |world| {
            world.get::<Overlays>(surface).is_some() && world.get::<DryMaterial>(surface).is_some()
        });
        app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
        update(&mut app);
        Some(Self { app, target, surface })
    }

    fn set(&mut self, component: impl Bundle) {
        self.app.world_mut().entity_mut(self.surface).insert(component);
    }

    fn run(&mut self, ticks: u32) {
        (0..ticks).for_each(|_| update(&mut self.app));
    }

    /// The picture after some ticks; asking for it takes none.
    fn after(&mut self, ticks: u32) -> RgbImage {
        self.run(ticks);
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
        let picture = picture(&mut self.app, &self.target);
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
        picture
    }
}

fn ground() -> Mesh {
    meshes::ground(Vec2::splat(2.0), UVec2::splat(8)).unwrap()
}

/// Nearly black ground under a bright sky: what is seen is what the water mirrors.
fn above(mesh: Mesh) -> Option<Scene> {
    let material = StandardMaterial { base_color: Color::linear_rgb(0.01, 0.01, 0.01), ..default() };
    Scene::new(mesh, Vec3::new(0.0, 1.6, 1.6), Vec3::new(-0.3, -1.0, -0.4), 12_000.0, material)
}

const DEEP: Flood = Flood::Level { level_mm: 20.0, basin_mm: 0.0, relief_mm: 0.0 };

#[test]
fn rain_ripples_water_that_stands_and_only_while_it_falls() {
    let Some(mut scene) = above(ground()) else { return };
    let rain = |flood, rain_mm_per_h| StandingWater { flood, rain_mm_per_h, ..default() };
    for (water, moves) in [
        (rain(DEEP, 20.0), true),
        (rain(DEEP, 0.0), false),
        (rain(Flood::Accumulation { cracks: 0.0, puddles: 0.0 }, 20.0), false),
    ] {
        scene.set(water);
        scene.run(3);
        let (before, after) = (scene.after(1), scene.after(9));
        let (average, _) = difference(&before, &after);
        assert_eq!(average > 0.05, moves, "{water:?}: {average}");
    }
}

#[test]
fn more_rain_is_more_ripples() {
    let Some(mut scene) = above(ground()) else { return };
    scene.set(StandingWater { flood: DEEP, ..default() });
    let still = scene.after(5);
    let roughness = [3.0, 10.0, 25.0].map(|rain_mm_per_h| {
        scene.set(StandingWater { flood: DEEP, rain_mm_per_h, ..default() });
        // The mean of some moments.
        (0..4).map(|_| difference(&scene.after(7), &still).0).sum::<f64>()
    });
    assert!(roughness.windows(2).all(|pair| pair[1] > 1.2 * pair[0]), "{roughness:?}");
}

#[test]
fn rain_does_not_ripple_the_film_on_a_wall() {
    let material = StandardMaterial { base_color: Color::linear_rgb(0.01, 0.01, 0.01), ..default() };
    let (eye, sun) = (Vec3::new(0.0, -1.0, 1.6), Vec3::new(-0.3, -0.4, -1.0));
    for (turn, moves) in [(0.0, false), (-std::f32::consts::FRAC_PI_2, true)] {
        // A wall and, for comparison, the same sheet on the ground, seen as steeply.
        let turn = Quat::from_rotation_x(turn);
        let sheet = Mesh::from(Rectangle::new(2.0, 2.0)).rotated_by(turn);
        let Some(mut scene) = Scene::new(sheet, turn * eye, turn * sun, 12_000.0, material.clone()) else {
            return;
        };
        let flood = Flood::Accumulation { cracks: 0.0, puddles: 0.0 };
        scene.set((still(0.0), StandingWater { flood, rain_mm_per_h: 25.0, ..default() }));
        cover(&mut scene.app, scene.surface, 2.0, 0.0);
        scene.run(3);
        let (before, after) = (scene.after(1), scene.after(9));
        let (average, _) = difference(&before, &after);
        assert_eq!(average > 0.05, moves, "{average}");
    }
}

#[test]
fn a_drop_that_really_falls_sends_out_a_ring_that_dies() {
    let Some(mut scene) = above(ground()) else { return };
    scene.set(StandingWater { flood: DEEP, ..default() });
    // So that the next water changes nothing but the ring.
    cover(&mut scene.app, scene.surface, 0.1, 0.05);
    let still = scene.after(60);
    let tick = scene.app.world().resource::<bevy_weathering::clock::WeatheringClock>().tick();
    let center = [32 * 256; 2];
    let drop = Splat { center, radius: [512; 2], water_nl: 50_000, tick, ..bytemuck::Zeroable::zeroed() };
    scene.app.world_mut().get_mut::<SplatQueue>(scene.surface).unwrap().push(drop);
    let young = scene.after(8);
    let old = scene.after(40);
    assert!(difference(&young, &still).1 > 6, "{:?}", difference(&young, &still));
    assert!(difference(&old, &still).1 <= 2, "{:?}", difference(&old, &still));
    // The ring is around the middle of the map, which is the middle of the picture.
    for (x, y, pixel) in young.enumerate_pixels() {
        let from_middle = Vec2::new(x as f32 + 0.5, y as f32 + 0.5).distance(SIZE.as_vec2() / 2.0);
        let changed = pixel.0.iter().zip(still[(x, y)].0).any(|(a, b)| a.abs_diff(b) > 4);
        assert!(!changed || from_middle < 24.0, "{x} {y}");
    }
}

#[test]
fn water_stands_where_the_ground_is_low() {
    // Paint falls from 1 on the left to 0 on the right.
    let mesh = ground();
    let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).unwrap().as_float3().unwrap();
    let paint: Vec<[f32; 4]> = positions.iter().map(|p| [1.0, 0.5 - 0.5 * p[0], 1.0, 1.0]).collect();
    let mesh = mesh.with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, paint);
    let Some(mut scene) = above(mesh) else { return };
    let changed = |picture: &RgbImage, dry: &RgbImage| {
        let column = |from: u32| {
            let mut part = 0.0;
            for x in from..from + 8 {
                for y in 44..52 {
                    part += f64::from(u8::from(picture[(x, y)] != dry[(x, y)])) / 64.0;
                }
            }
            part
        };
        [20, 44, 68].map(column)
    };
    let flood = |level_mm| StandingWater {
        flood: Flood::Level { level_mm, basin_mm: 10.0, relief_mm: 0.0 },
        ..default()
    };
    scene.set(flood(0.0));
    let dry = scene.after(4);
    for (level_mm, expected) in
        [(0.0, [0.0, 0.0, 0.0]), (4.0, [0.0, 0.0, 1.0]), (6.5, [0.0, 1.0, 1.0]), (12.0, [1.0; 3])]
    {
        scene.set(flood(level_mm));
        assert_eq!(changed(&scene.after(4), &dry), expected, "{level_mm} mm");
    }
    // The painter's law says much the same.
    for (puddles, expected) in [(0.0, [0.0; 3]), (0.4, [0.0, 0.0, 1.0]), (1.4, [1.0; 3])] {
        let flood = Flood::Accumulation { cracks: 0.0, puddles };
        scene.set(StandingWater { flood, ..default() });
        assert_eq!(changed(&scene.after(4), &dry), expected, "{puddles}");
    }
}

#[test]
fn light_comes_through_wet_cloth() {
    let material = StandardMaterial {
        base_color: Color::linear_rgb(0.6, 0.6, 0.5),
        diffuse_transmission: 0.1,
        double_sided: true,
        cull_mode: None,
        ..default()
    };
    let cloth = Mesh::from(Rectangle::new(2.0, 2.0));
    let Some(mut scene) = Scene::new(cloth, Vec3::Z * 2.5, Vec3::new(0.1, -0.2, 1.0), 600.0, material) else {
        return;
    };
    scene.set(PorousMaterial { wet_translucency: 0.7, ..still(0.5) });
    let dry = mean(&scene.after(4));
    cover(&mut scene.app, scene.surface, 0.0, 0.5);
    let wet = mean(&scene.after(6));
    assert!(wet > 1.3 * dry, "dry {dry}, wet {wet}");
}

/// The picture of bright ground under one model, dry and with a quarter more of what it takes up each time.
fn ever_wetter(model: WettingModel, metallic: f32) -> Option<Vec<RgbImage>> {
    let material = StandardMaterial {
        base_color: Color::linear_rgb(0.5, 0.4, 0.3),
        metallic,
        perceptual_roughness: 0.9,
        ..default()
    };
    let eye = Vec3::new(0.0, 1.6, 1.6);
    let mut scene = Scene::new(ground(), eye, Vec3::new(0.0, -1.0, 0.4), 100.0, material)?;
    scene.set(PorousMaterial { model, ..still(1.0) });
    let mut pictures = vec![scene.after(3)];
    for _ in 0..3 {
        cover(&mut scene.app, scene.surface, 0.0, 0.25);
        pictures.push(scene.after(3));
    }
    Some(pictures)
}

#[test]
fn every_model_darkens_with_wetness_but_neither_glaze_nor_metal() {
    let (pores, coated) = (Pores::default(), Coated::default());
    let sealed = Pores { alpha_poro: 0.0, ..pores };
    let bare = Coated { porosity: 0.0, ..coated };
    // Porous, and the same without pores.
    for (model, glazed) in [
        (WettingModel::Hnat(pores), WettingModel::Hnat(sealed)),
        (WettingModel::HnatLeknerDorf(pores, coated), WettingModel::HnatLeknerDorf(sealed, coated)),
        (WettingModel::Lagarde(default()), WettingModel::Lagarde(Tweaked { porosity: 0.0, ..default() })),
        (WettingModel::LeknerDorf(coated), WettingModel::LeknerDorf(bare)),
        (WettingModel::Twomey(default()), WettingModel::Twomey(Grains { porosity: 0.0, ..default() })),
        (
            WettingModel::Authored(default()),
            WettingModel::Authored(WetLook { color: [1.0; 3], roughness: 0.9, reflectance: 0.5 }),
        ),
    ] {
        let Some(wetter) = ever_wetter(model, 0.0) else { return };
        let brightness: Vec<f64> = wetter.iter().map(mean).collect();
        assert!(brightness.windows(2).all(|pair| pair[1] < pair[0] - 0.3), "{model:?}: {brightness:?}");
        for (model, metallic) in [(glazed, 0.0), (model, 1.0)] {
            let wetter = ever_wetter(model, metallic).unwrap();
            let (average, _) = difference(&wetter[0], &wetter[2]);
            assert!(average < 0.3, "{model:?}, metallic {metallic}: {average}");
        }
    }
}
