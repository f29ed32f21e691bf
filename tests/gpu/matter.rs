//! What lies on a surface, as it is drawn: dust, mud and snow, the thickness of snow, painted relief and painted gloss.

use bevy::camera::ScalingMode;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::material::DryMaterial;
use bevy_weathering::matter::{Deposit, MatterKind, MatterQueue, SurfaceMatter};
use bevy_weathering::overlay::{Overlays, Splat, Weatherable, Wrap};
use bevy_weathering::scenes::meshes::ground;
use bevy_weathering::weather::Weather;
use bevy_weathering::wetting::WetGeometry;
use image::RgbImage;

use super::app::{add_target, app, camera, picture, still, update, update_until};
use super::images::keep;
use super::splat::{painted, push};

/// Texels and pixels along each side.
const SIDE: u32 = 64;
const MIDDLE: u32 = SIDE / 2;

/// A metre of ground in the frost, seen from straight above: u to the right, v downwards, a texel a pixel.
struct Scene {
    app: App,
    target: Handle<Image>,
    surface: Entity,
    sun: Entity,
}

impl Scene {
    fn new(color: Color) -> Option<Self> {
        let mut app = app()?;
        {
            let mut weather = app.world_mut().resource_mut::<Weather>();
            (weather.drying_speed, weather.temperature_c) = (0.0, -5.0);
        }
        let target = add_target(&mut app, UVec2::splat(SIDE));
        let eye = (
            camera(&target, Vec3::Y * 2.0, Vec3::ZERO),
            Tonemapping::None,
            Projection::from(OrthographicProjection {
                scaling_mode: ScalingMode::Fixed { width: 1.0, height: 1.0 },
                ..OrthographicProjection::default_3d()
            }),
        );
        let world = app.world_mut();
        let eye = world.spawn(eye).id();
        // Above it is -z.
        *world.get_mut::<Transform>(eye).unwrap() =
            Transform::from_xyz(0.0, 2.0, 0.0).looking_to(Vec3::NEG_Y, Vec3::NEG_Z);
        let sun = DirectionalLight { illuminance: 2500.0, ..default() };
        let sun = world.spawn((sun, Transform::default().looking_to(Vec3::NEG_Y, Vec3::X))).id();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(ground(Vec2::ONE, UVec2::splat(2)).unwrap());
        let material = StandardMaterial { base_color: color, perceptual_roughness: 0.95, ..default() };
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
        let maps = Weatherable { map_size: SIDE, wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, ..default() };
        let surface = world.spawn((Mesh3d(mesh), MeshMaterial3d(material), maps, still(0.05))).id();
        update_until(&mut app, "the maps and materials", |world| {
            world.get::<Overlays>(surface).is_some()
                && world.get::<DryMaterial>(surface).is_some()
                && world.get::<WetGeometry>(surface).is_some()
        });
        Some(Self { app, target, surface, sun })
    }

    /// Puts matter in the middle, so many litres under a stamp of so many texels.
    fn deposit(&mut self, kind: MatterKind, litres: f64, radius: i32) {
        let (center, radius) = ([MIDDLE as i32 * 256; 2], [radius * 256; 2]);
        let volume_nl = (litres * 1e9) as u32;
        let mut queue = self.app.world_mut().get_mut::<MatterQueue>(self.surface).unwrap();
        queue.0.push(Deposit { center, radius, kind, volume_nl, stamp: None });
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(2));
        update(&mut self.app);
        update(&mut self.app);
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
        let matter = self.app.world().get::<SurfaceMatter>(self.surface).unwrap();
        assert!(!matter.is_empty(), "{kind:?} did not come");
    }

    /// Paints a dome over all of it.
    fn paint(&mut self, splat: Splat) {
        let (center, radius) = ([MIDDLE as i32 * 256; 2], [(SIDE as i32 - 1) * 128; 2]);
        push(&mut self.app, self.surface, &[Splat { center, radius, tick: 1, ..splat }]);
        painted(&mut self.app, 1);
    }

    /// The picture, with light that falls in this direction.
    fn lit(&mut self, direction: Vec3) -> RgbImage {
        let mut sun = self.app.world_mut().get_mut::<Transform>(self.sun).unwrap();
        *sun = Transform::default().looking_to(direction, Vec3::new(0.3, 0.2, 0.9));
        (0..3).for_each(|_| update(&mut self.app));
        picture(&mut self.app, &self.target)
    }
}

/// Mean colour around a pixel, 0..=255.
fn around(picture: &RgbImage, [x, y]: [u32; 2]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (y, x) in (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| (y, x))) {
        for (sum, byte) in sum.iter_mut().zip(picture[(x, y)].0) {
            *sum += f64::from(byte) / 9.0;
        }
    }
    sum
}

fn brightness(picture: &RgbImage, place: [u32; 2]) -> f64 {
    around(picture, place).iter().sum::<f64>() / 3.0
}

#[test]
fn dust_mud_and_snow_are_seen_and_told_apart() {
    let seen = |kind: Option<MatterKind>| -> Option<[f64; 3]> {
        let mut scene = Scene::new(Color::linear_rgb(0.02, 0.03, 0.2))?;
        if let Some(kind) = kind {
            // Some millimetres of soil in the middle, or some centimetres of snow.
            scene.deposit(kind, 0.5, 31);
        }
        Some(around(&scene.lit(Vec3::new(0.2, -1.0, 0.1)), [MIDDLE; 2]))
    };
    let Some(bare) = seen(None) else { return };
    let [dust, mud, snow] =
        [MatterKind::Dust, MatterKind::Mud, MatterKind::Snow].map(|kind| seen(Some(kind)).unwrap());
    assert!(bare[2] > bare[0] + 30.0, "the ground is blue: {bare:?}");
    for (name, soil) in [("dust", dust), ("mud", mud)] {
        assert!(soil[0] > bare[0] + 30.0 && soil[0] > soil[2] + 10.0, "{name} is brown: {soil:?}");
    }
    assert!(mud[0] < dust[0] - 3.0, "a crust is darker than dust: {mud:?} {dust:?}");
    assert!(snow.iter().all(|&channel| channel > dust[0] + 20.0), "snow is white: {snow:?} {dust:?}");
    assert!((snow[0] - snow[2]).abs() < 30.0, "{snow:?}");
}

/// What is brighter than what by so much, of the picture of something that is raised: the sides that the light comes to.
fn assert_raised(name: &str, scene: &mut Scene, away: u32, least: f64) {
    let [before, after] = [MIDDLE - away, MIDDLE + away];
    for (along, [near, far]) in [
        (Vec3::X, [[before, MIDDLE], [after, MIDDLE]]),
        (Vec3::NEG_X, [[after, MIDDLE], [before, MIDDLE]]),
        // v grows along +z, down the picture.
        (Vec3::Z, [[MIDDLE, before], [MIDDLE, after]]),
        (Vec3::NEG_Z, [[MIDDLE, after], [MIDDLE, before]]),
    ] {
        let picture = scene.lit(along + Vec3::NEG_Y);
        let [near, far] = [near, far].map(|place| brightness(&picture, place));
        if near < far + least {
            keep(name, &[("lit", &picture)]);
            panic!("{name}, light along {along}: {near} on the side that it comes to, {far} on the other");
        }
    }
}

#[test]
fn a_heap_of_snow_has_flanks() {
    let Some(mut scene) = Scene::new(Color::linear_rgb(0.2, 0.2, 0.2)) else { return };
    // 8 cm high and 75 cm wide; at a third of its radius it is steepest, as 0.43 to 1, which snow can hold.
    scene.deposit(MatterKind::Snow, 0.89, 24);
    assert_raised("snow", &mut scene, 8, 15.0);
}

#[test]
fn a_painted_dome_is_raised_and_a_dent_is_not() {
    let Some(mut scene) = Scene::new(Color::linear_rgb(0.5, 0.5, 0.5)) else { return };
    let dome = Splat { bump: 110, bump_opacity: 255, ..bytemuck::Zeroable::zeroed() };
    scene.paint(dome);
    assert_raised("dome", &mut scene, 14, 8.0);
    let mut scene = Scene::new(Color::linear_rgb(0.5, 0.5, 0.5)).unwrap();
    scene.paint(Splat { bump: -110, ..dome });
    let picture = scene.lit(Vec3::X + Vec3::NEG_Y);
    let [near, far] = [MIDDLE - 14, MIDDLE + 14].map(|x| brightness(&picture, [x, MIDDLE]));
    assert!(far > near + 8.0, "{near} {far}");
}

#[test]
fn painted_gloss_mirrors_the_sun() {
    let Some(mut scene) = Scene::new(Color::linear_rgb(0.03, 0.03, 0.03)) else { return };
    let straight = Vec3::NEG_Y;
    let dull = brightness(&scene.lit(straight), [MIDDLE; 2]);
    // Reflectance and smoothness of a half.
    scene.paint(Splat { specular: 0xff00_8080, ..bytemuck::Zeroable::zeroed() });
    let picture = scene.lit(straight);
    let glossy = brightness(&picture, [MIDDLE; 2]);
    assert!(glossy > dull + 15.0, "{glossy} with gloss, {dull} without");
    // From the side it goes past the eye.
    let aslant = brightness(&scene.lit(Vec3::new(1.5, -1.0, 0.0)), [MIDDLE; 2]);
    assert!(aslant < dull + 15.0, "{aslant} aslant, {dull} without");
}
