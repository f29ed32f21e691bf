//! Water on a mesh whose faces share their texture coordinates, as it is drawn: where it lies, and on textures that stay.

use bevy::light::EnvironmentMapLight;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::collision::{MeshTriangles, UvSet};
use bevy_weathering::material::{DryMaterial, Pores, PorousMaterial, WettingModel};
use bevy_weathering::overlay::{OverlayUv, Overlays, Weatherable};
use bevy_weathering::weather::Weather;
use bevy_weathering::wetting::{Drop, DropQueue, WetGeometry};
use image::RgbImage;

use super::app::{add_target, app, camera, picture, still, update, update_until};
use super::images::{difference, keep};

const SIDE: u32 = 64;
const SIZE: u32 = 128;

/// A cube of a metre, with a texture, seen from above or from the front: the middle of the face.
struct Scene {
    app: App,
    target: Handle<Image>,
    camera: Entity,
    cube: Entity,
}

impl Scene {
    fn new() -> Option<Self> {
        let mut app = app()?;
        app.world_mut().resource_mut::<Weather>().drying_speed = 0.0;
        let target = add_target(&mut app, UVec2::splat(SIDE));
        let eye = (
            camera(&target, Vec3::Z * 2.0, Vec3::ZERO),
            Projection::from(OrthographicProjection {
                scaling_mode: bevy::camera::ScalingMode::Fixed { width: 0.1, height: 0.1 },
                ..OrthographicProjection::default_3d()
            }),
        );
        let world = app.world_mut();
        let camera = world.spawn(eye).id();
        let mut images = world.resource_mut::<Assets<Image>>();
        let sky = EnvironmentMapLight {
            intensity: 1000.0,
            ..EnvironmentMapLight::hemispherical_gradient(
                &mut images,
                Color::WHITE,
                Color::WHITE,
                Color::WHITE,
            )
        };
        let size = Extent3d { width: 64, height: 1, depth_or_array_layers: 1 };
        let stripes = (0..64u8).flat_map(|x| [120 + x % 8 * 8, 110, 100 + x, 255]).collect();
        let format = TextureFormat::Rgba8UnormSrgb;
        let texture = images.add(Image::new(size, TextureDimension::D2, stripes, format, default()));
        world.entity_mut(camera).insert(sky);
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::new(1.0, 1.0, 1.0));
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
            base_color_texture: Some(texture),
            perceptual_roughness: 0.9,
            ..default()
        });
        let cube = world.spawn((Mesh3d(mesh), MeshMaterial3d(material))).id();
        Some(Self { app, target, camera, cube })
    }

    fn weather(&mut self, uv: OverlayUv) {
        let model = WettingModel::Hnat(Pores { alpha_poro: 0.6, s_p: 0.02, ..default() });
        let maps = Weatherable { map_size: SIZE, uv, ..default() };
        let cube = self.cube;
        self.app.world_mut().entity_mut(cube).insert((maps, PorousMaterial { model, ..still(0.05) }));
        update_until(&mut self.app, "the maps and materials", |world| {
            world.get::<Overlays>(cube).is_some()
                && world.get::<DryMaterial>(cube).is_some()
                && world.get::<WetGeometry>(cube).is_some()
        });
    }

    /// Pours water on the middle of the upper face.
    fn pour(&mut self) {
        let world = self.app.world_mut();
        let set = world.get::<UvSet>(self.cube).copied().unwrap_or_default();
        let mesh = world.resource::<Assets<Mesh>>().get(world.get::<Mesh3d>(self.cube).unwrap()).unwrap();
        let triangles = MeshTriangles::with_uvs(mesh, set).unwrap();
        let on_top = triangles
            .positions
            .iter()
            .zip(&triangles.uvs)
            .filter(|(at, _)| at.iter().all(|corner| corner.y > 0.49));
        let corners: Vec<Vec2> = on_top.flat_map(|(_, uvs)| *uvs).collect();
        let (low, high) =
            corners.iter().fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(l, h), &uv| (l.min(uv), h.max(uv)));
        let center = ((low + high) / 2.0 * SIZE as f32 * 256.0).as_ivec2().to_array();
        let (water_nl, speed_mm, source) = (12_000_000, 0, default());
        let drop = Drop { center, radius: [10 * 256; 2], water_nl, speed_mm, jet: None, source };
        world.get_mut::<DropQueue>(self.cube).unwrap().0.push(drop);
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(10));
        (0..4).for_each(|_| update(&mut self.app));
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    }

    /// The upper face and the front.
    fn faces(&mut self) -> [RgbImage; 2] {
        [(Vec3::Y, Vec3::NEG_Z), (Vec3::Z, Vec3::Y)].map(|(from, up)| {
            *self.app.world_mut().get_mut::<Transform>(self.camera).unwrap() =
                Transform::from_translation(from * 2.0).looking_at(Vec3::ZERO, up);
            update(&mut self.app);
            update(&mut self.app);
            picture(&mut self.app, &self.target)
        })
    }
}

#[test]
fn water_shows_on_the_face_it_fell_on_and_the_texture_stays() {
    for (uv, on_front) in [(OverlayUv::Auto, false), (OverlayUv::Mesh, true)] {
        let Some(mut scene) = Scene::new() else { return };
        let plain = scene.faces();
        scene.weather(uv);
        let dry = scene.faces();
        for (name, plain, dry) in [("top", &plain[0], &dry[0]), ("front", &plain[1], &dry[1])] {
            let (average, _) = difference(plain, dry);
            if average > 0.1 {
                keep(name, &[("plain", plain), ("dry", dry)]);
            }
            assert!(average <= 0.1, "{uv:?}: the {name} looks another: {average}");
        }
        scene.pour();
        let wet = scene.faces();
        let changed = [0, 1].map(|face: usize| difference(&dry[face], &wet[face]).0);
        assert!(changed[0] > 2.0, "{uv:?}: nothing to be seen on top: {changed:?}");
        assert!(if on_front { changed[1] > 2.0 } else { changed[1] < 0.1 }, "{uv:?}: {changed:?}");
    }
}
