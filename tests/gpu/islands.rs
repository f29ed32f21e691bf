//! Water on an island of its map that is seen from so far away that pixels reach beyond it.

use bevy::camera::ScalingMode;
use bevy::light::EnvironmentMapLight;
use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::material::{DryMaterial, Pores, PorousMaterial, WettingModel};
use bevy_weathering::overlay::{OverlayUv, Overlays, Weatherable};

use super::app::{add_target, app, camera, cover, picture, still, update, update_until};
use super::images::keep;

/// Pixels along each side of the picture, one to a metre.
const SIDE: u32 = 16;

/// A square, 7.2 pixels wide, so that the middles of its outermost pixels lie a tenth of a pixel from its edge: 6 texels.
fn square() -> Mesh {
    let mut mesh = Mesh::from(Rectangle::new(7.2, 7.2));
    // It takes 461 of 512 texels along each side, 64 a pixel.
    if let Some(VertexAttributeValues::Float32x2(uvs)) = mesh.attribute_mut(Mesh::ATTRIBUTE_UV_0) {
        uvs.iter_mut().flatten().for_each(|coordinate| *coordinate = 0.05 + 0.9 * *coordinate);
    }
    mesh
}

#[test]
fn wet_islands_are_as_dark_along_their_borders_as_in_the_middle_from_afar() {
    let Some(mut app) = app() else { return };
    let target = add_target(&mut app, UVec2::splat(SIDE));
    let eye = camera(&target, Vec3::Z * 5.0, Vec3::ZERO);
    let world = app.world_mut();
    world.insert_resource(ClearColor(Color::BLACK));
    let sky = EnvironmentMapLight {
        intensity: 1000.0,
        ..EnvironmentMapLight::solid_color(&mut world.resource_mut::<Assets<Image>>(), Color::WHITE)
    };
    let side = SIDE as f32;
    world.spawn((eye, sky)).insert(Projection::from(OrthographicProjection {
        scaling_mode: ScalingMode::Fixed { width: side, height: side },
        ..OrthographicProjection::default_3d()
    }));
    let mesh = world.resource_mut::<Assets<Mesh>>().add(square());
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
        base_color: Color::linear_rgb(0.5, 0.4, 0.3),
        perceptual_roughness: 1.0,
        ..default()
    });
    let model = WettingModel::Hnat(Pores { alpha_poro: 0.6, ..default() });
    let maps = Weatherable { map_size: 512, uv: OverlayUv::Mesh, ..default() };
    let porous = PorousMaterial { model, ..still(1.0) };
    let surface = world.spawn((Mesh3d(mesh), MeshMaterial3d(material), maps, porous)).id();
    update_until(&mut app, "the maps and materials", |world| {
        world.get::<Overlays>(surface).is_some() && world.get::<DryMaterial>(surface).is_some()
    });
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    (0..3).for_each(|_| update(&mut app));
    let dry = picture(&mut app, &target);
    cover(&mut app, surface, 0.0, 1.0);
    (0..4).for_each(|_| update(&mut app));
    let wet = picture(&mut app, &target);

    let middle = SIDE / 2;
    let darker = |x: u32, y: u32| i32::from(dry[(x, y)].0[0]) - i32::from(wet[(x, y)].0[0]);
    assert!(darker(middle, middle) > 8, "nothing to be seen in the middle: {}", darker(middle, middle));
    for along in 4..12 {
        for (x, y) in [(4, along), (11, along), (along, 4), (along, 11)] {
            if (darker(x, y) - darker(middle, middle)).abs() > 2 {
                keep("islands", &[("dry", &dry), ("wet", &wet)]);
                panic!("{x}, {y}: {} darker, not {}", darker(x, y), darker(middle, middle));
            }
        }
    }
}
