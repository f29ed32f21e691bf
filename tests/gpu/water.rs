//! Water as it is drawn: wet maps that are played, time that is scrubbed, surfaces at rest, marks, and a map that is found
//! again in two pictures.

use bevy::light::EnvironmentMapLight;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::clock::{ShownTime, WeatheringClock};
use bevy_weathering::material::{DryMaterial, PlayedWetMap, Playing, Pores, PorousMaterial, WettingModel};
use bevy_weathering::overlay::{Overlays, SplatStats, Weatherable, Wrap};
use bevy_weathering::scenes::meshes::ground;
use bevy_weathering::weather::Weather;
use bevy_weathering::wetmap::{PhotoOptions, wet_mask};
use bevy_weathering::wetting::gpu::UploadStats;
use bevy_weathering::wetting::{Drop, DropQueue, SurfaceWater, WetGeometry, WettingStats};
use image::{Rgb32FImage, RgbImage};

use super::app::{add_target, app, camera, picture, still, update, update_until};
use super::images::{difference, keep};

const SIDE: u32 = 128;

/// A metre of ground seen from straight above: u to the right, v downwards, a texel a pixel.
struct Scene {
    app: App,
    target: Handle<Image>,
    surface: Entity,
}

impl Scene {
    fn new(porous: PorousMaterial) -> Option<Self> {
        let mut app = app()?;
        app.world_mut().resource_mut::<Weather>().drying_speed = 0.0;
        let target = add_target(&mut app, UVec2::splat(SIDE));
        let eye = (
            camera(&target, Vec3::Y * 2.0, Vec3::ZERO),
            Projection::from(OrthographicProjection {
                scaling_mode: bevy::camera::ScalingMode::Fixed { width: 1.0, height: 1.0 },
                ..OrthographicProjection::default_3d()
            }),
        );
        let world = app.world_mut();
        let camera = world.spawn(eye).id();
        // Above it is -z.
        *world.get_mut::<Transform>(camera).unwrap() =
            Transform::from_xyz(0.0, 2.0, 0.0).looking_to(Vec3::NEG_Y, Vec3::NEG_Z);
        let mut images = world.resource_mut::<Assets<Image>>();
        let sky = EnvironmentMapLight {
            intensity: 400.0,
            ..EnvironmentMapLight::hemispherical_gradient(
                &mut images,
                Color::WHITE,
                Color::WHITE,
                Color::BLACK,
            )
        };
        world.entity_mut(camera).insert(sky);
        world.spawn((
            DirectionalLight { illuminance: 2500.0, ..default() },
            Transform::default().looking_to(Vec3::new(0.5, -1.0, 0.2), Vec3::Y),
        ));
        let mesh = world.resource_mut::<Assets<Mesh>>().add(ground(Vec2::ONE, UVec2::splat(2)).unwrap());
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
            base_color: Color::linear_rgb(0.45, 0.33, 0.24),
            perceptual_roughness: 0.9,
            ..default()
        });
        let maps = Weatherable { map_size: SIDE, wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, ..default() };
        let surface = world.spawn((Mesh3d(mesh), MeshMaterial3d(material), maps, porous)).id();
        update_until(&mut app, "the maps and materials", |world| {
            world.get::<Overlays>(surface).is_some()
                && world.get::<DryMaterial>(surface).is_some()
                && world.get::<WetGeometry>(surface).is_some()
        });
        Some(Self { app, target, surface })
    }

    fn run(&mut self, ticks: u32) {
        // A frame may not be longer than a quarter of a second.
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(10));
        (0..ticks.div_ceil(10)).for_each(|_| update(&mut self.app));
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    }

    fn picture(&mut self) -> RgbImage {
        update(&mut self.app);
        update(&mut self.app);
        picture(&mut self.app, &self.target)
    }

    /// The picture that is shown of a time.
    fn shown(&mut self, seconds: f64) -> RgbImage {
        self.app.insert_resource(ShownTime::At(seconds));
        self.picture()
    }

    fn pour(&mut self, texel: [i32; 2], radius: i32, water_nl: u32) {
        let mut drops = self.app.world_mut().get_mut::<DropQueue>(self.surface).unwrap();
        drops.0.push(Drop {
            center: texel.map(|at| at * 256 + 128),
            radius: [radius * 256; 2],
            water_nl,
            speed_mm: 0,
            jet: None,
            source: default(),
        });
    }

    fn seconds(&self) -> f64 {
        self.app.world().resource::<WeatheringClock>().seconds()
    }
}

fn porous() -> PorousMaterial {
    let model = WettingModel::Hnat(Pores { alpha_poro: 0.6, s_p: 0.02, ..default() });
    PorousMaterial { model, ..still(0.05) }
}

/// A grey map that rises from 0 on the left to 1 on the right.
fn ramp(app: &mut App) -> Handle<Image> {
    let bytes: Vec<u8> = (0..SIDE * SIDE).map(|texel| (texel % SIDE * 255 / (SIDE - 1)) as u8).collect();
    let size = Extent3d { width: SIDE, height: SIDE, depth_or_array_layers: 1 };
    let image = Image::new(size, TextureDimension::D2, bytes, TextureFormat::R8Unorm, default());
    app.world_mut().resource_mut::<Assets<Image>>().add(image)
}

/// Mean brightness of each eighth of a picture, from the left.
fn columns(picture: &RgbImage) -> [f64; 8] {
    let mut sums = [0.0; 8];
    for (x, y, pixel) in picture.enumerate_pixels() {
        if y > 8 && y < SIDE - 8 {
            sums[(x * 8 / SIDE) as usize] += pixel.0.iter().map(|&byte| f64::from(byte)).sum::<f64>();
        }
    }
    sums.map(|sum| sum / f64::from(SIDE / 8 * (SIDE - 17) * 3))
}

#[test]
fn a_wet_map_alone_wets_and_dries_with_hard_and_with_soft_edges() {
    let Some(mut scene) = Scene::new(porous()) else { return };
    let map = ramp(&mut scene.app);
    let mut at = |playing, t_fill, seconds: f64| {
        let played = PlayedWetMap { map: map.clone(), seconds: 10.0, t_fill, from_tick: 0, playing };
        scene.app.world_mut().entity_mut(scene.surface).insert(played);
        columns(&scene.shown(seconds))
    };
    let dry = at(Playing::Wetting, 0.0, 0.0)[0];
    let wet = at(Playing::Wetting, 0.0, 9.9)[7];
    assert!(wet < 0.85 * dry, "{dry} {wet}");
    let is_wet = |columns: [f64; 8]| columns.map(|column| column < (dry + wet) / 2.0);
    // g wets at 1 - g: half time, right half.
    let [half, late] = [5.0, 7.6].map(|seconds| is_wet(at(Playing::Wetting, 0.0, seconds)));
    assert_eq!(half, [false, false, false, false, true, true, true, true]);
    assert_eq!(late, [false, false, true, true, true, true, true, true]);
    // Drying is that backwards: what wets first dries last.
    assert_eq!(is_wet(at(Playing::Drying, 0.0, 5.0)), half);
    assert_eq!(is_wet(at(Playing::Drying, 0.0, 2.4)), late);
    // A soft edge: columns in between, neither dry nor wet.
    let between = |columns: [f64; 8]| {
        columns
            .iter()
            .filter(|&&column| column < dry - 0.15 * (dry - wet) && column > wet + 0.15 * (dry - wet))
            .count()
    };
    assert_eq!(between(at(Playing::Wetting, 0.0, 5.0)), 0);
    assert!(between(at(Playing::Wetting, 0.5, 5.0)) >= 3);
    let full = at(Playing::Wetting, 0.5, 10.0);
    assert!(full[1..].iter().all(|column| (column - full[7]).abs() < 3.0), "all full at the end: {full:?}");
}

#[test]
fn a_surface_at_rest_sends_nothing_and_shows_any_time_again() {
    let Some(mut scene) = Scene::new(PorousMaterial { t_fill: 0.5, rim_delay: 1.0, ..porous() }) else {
        return;
    };
    scene.pour([40, 64], 14, 1_500_000);
    scene.run(60);
    scene.pour([90, 64], 14, 1_500_000);
    scene.run(150);
    for _ in 0..100 {
        if scene.app.world().get::<SurfaceWater>(scene.surface).unwrap().is_at_rest() {
            break;
        }
        scene.run(30);
    }
    assert!(scene.app.world().get::<SurfaceWater>(scene.surface).unwrap().is_at_rest());
    scene.app.world_mut().resource_mut::<Weather>().drying_speed = 20.0;
    scene.run(10);
    let live = scene.picture();
    let now = scene.seconds();
    let counters = |scene: &Scene| {
        let world = scene.app.world();
        let (water, upload) = (world.resource::<WettingStats>(), world.resource::<UploadStats>());
        let splats = world.resource::<SplatStats>();
        [
            water.drops(),
            water.tiles_run(),
            water.tiles_spread(),
            water.rims(),
            upload.tiles(),
            upload.writes(),
            splats.dispatches(),
        ]
    };
    let before = counters(&scene);
    assert!(before[0] == 2 && before[4] > 0, "{before:?}");
    let times = [now, now + 20.0, now + 60.0, now + 200.0];
    let first = times.map(|seconds| scene.shown(seconds));
    assert_eq!(difference(&live, &first[0]), (0.0, 0), "now is now");
    for (index, (a, b)) in [(0, 1), (1, 2), (2, 3)].into_iter().enumerate() {
        assert!(difference(&first[a], &first[b]).0 > 0.02, "it dries: {index}");
    }
    // Back and forth.
    for index in [2, 0, 3, 1, 0, 2] {
        let again = scene.shown(times[index]);
        assert_eq!(difference(&again, &first[index]), (0.0, 0), "{index}");
    }
    // Before the first drop it was dry.
    let dry = columns(&scene.shown(0.0));
    let wet = columns(&first[0]);
    assert!(wet[2] < dry[2] - 4.0 && (wet[0] - dry[0]).abs() < 0.5, "{dry:?} {wet:?}");
    // Time goes on, too, and still costs nothing.
    scene.app.insert_resource(ShownTime::Now);
    scene.run(60);
    assert_eq!(counters(&scene), before);
}

#[test]
fn what_dries_leaves_marks_if_the_material_says_so() {
    let marked = PorousMaterial { efflorescence: 0.9, tide_mark: 0.9, capacity_mm: 2.0, ..porous() };
    let mut pictures = vec![];
    for material in [PorousMaterial { capacity_mm: 2.0, ..porous() }, marked] {
        let Some(mut scene) = Scene::new(PorousMaterial { rim_delay: 1.0, sorptivity: 1000.0, ..material })
        else {
            return;
        };
        let dry = scene.picture();
        scene.pour([64, 64], 30, 300_000_000);
        scene.run(120);
        scene.app.world_mut().resource_mut::<Weather>().drying_speed = 100_000.0;
        scene.run(300);
        let after = scene.picture();
        pictures.push((dry, after));
    }
    let (plain, marked) = (&pictures[0], &pictures[1]);
    let (average, _) = difference(&plain.0, &plain.1);
    assert!(average < 0.3, "without marks it looks as before: {average}");
    let (average, largest) = difference(&marked.0, &marked.1);
    if average < 1.0 || largest < 20 {
        keep("marks", &[("before", &marked.0), ("after", &marked.1)]);
        panic!("no marks: {average} {largest}");
    }
    // White in the middle, darker on the rim.
    let brightness = |x: u32, y: u32| {
        let sum = |picture: &RgbImage| picture[(x, y)].0.iter().map(|&byte| i32::from(byte)).sum::<i32>();
        sum(&marked.1) - sum(&marked.0)
    };
    assert!(brightness(64, 64) > 20, "{}", brightness(64, 64));
    let darkest = (20..64).map(|x| brightness(x, 64)).min().unwrap();
    assert!(darkest < -10, "{darkest}");
}

#[test]
fn the_splats_of_a_rendered_pair_are_found_again() {
    let Some(mut scene) = Scene::new(porous()) else { return };
    let linear = |picture: &RgbImage| {
        let to_linear = |byte: u8| Color::srgb_u8(byte, 0, 0).to_linear().red;
        Rgb32FImage::from_fn(SIDE, SIDE, |x, y| image::Rgb(picture[(x, y)].0.map(to_linear)))
    };
    let dry = linear(&scene.picture());
    for (texel, radius) in [([30, 36], 15), ([84, 30], 11), ([60, 84], 19), ([104, 100], 13), ([24, 104], 9)]
    {
        scene.pour(texel, radius, (radius * radius) as u32 * 25_000);
    }
    scene.run(60);
    let wet_picture = scene.picture();
    let found = wet_mask(&dry, &linear(&wet_picture), &PhotoOptions::default()).unwrap();
    // What is known: texels that look at least half wet.
    let surface = scene.surface;
    let query = move |query: bevy_weathering::wetting::WetnessQuery| {
        let wet = |texel: u32| {
            let uv = Vec2::new((texel % SIDE) as f32 + 0.5, (texel / SIDE) as f32 + 0.5) / SIDE as f32;
            query.at_uv(surface, uv).unwrap().wetness > 0.5
        };
        (0..SIDE * SIDE).map(wet).collect::<Vec<bool>>()
    };
    use bevy::ecs::system::RunSystemOnce;
    let known = scene.app.world_mut().run_system_once(query).unwrap();
    let (mut both, mut either) = (0, 0);
    for (texel, &known) in known.iter().enumerate() {
        let found = found.wet[texel];
        both += u32::from(found && known);
        either += u32::from(found || known);
    }
    let iou = f64::from(both) / f64::from(either);
    println!("IoU {iou:.3}");
    if iou < 0.95 || found.spots().len() != 5 {
        keep("pair", &[("wet", &wet_picture)]);
        panic!("IoU {iou}, {} spots", found.spots().len());
    }
}
