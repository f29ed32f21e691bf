//! Five kinds of matter in one shower: terracotta, sandstone, asphalt, sand, and a glazed pot.

use bevy::prelude::*;
use bevy_weathering::material::{Coated, Grains, Pores};
use bevy_weathering::prelude::*;

fn main() {
    App::new().add_plugins((DefaultPlugins, WeatheringPlugins)).add_systems(Startup, setup).run();
}

/// Colour when dry, and what water does.
fn kinds() -> [(Color, PorousMaterial); 5] {
    let terracotta = PorousMaterial::default();
    let sandstone = PorousMaterial {
        capacity_mm: 1.5,
        sorptivity: 0.8,
        pore_volume: 0.2,
        model: WettingModel::HnatLeknerDorf(Pores { s_p: 0.03, ..default() }, Coated::default()),
        ..terracotta
    };
    let asphalt = PorousMaterial {
        capacity_mm: 0.2,
        sorptivity: 0.02,
        pore_volume: 0.06,
        retained_mm: 0.2,
        model: WettingModel::LeknerDorf(Coated { porosity: 0.9, n_solid: 1.6 }),
        ..terracotta
    };
    let sand = PorousMaterial {
        capacity_mm: 5.0,
        sorptivity: 4.0,
        pore_volume: 0.4,
        model: WettingModel::Twomey(Grains::default()),
        ..terracotta
    };
    // Takes up nothing: drops run down and mirror.
    let glazed = PorousMaterial {
        capacity_mm: 0.0,
        sorptivity: 0.0,
        retained_mm: 0.03,
        model: WettingModel::LeknerDorf(Coated { porosity: 0.0, n_solid: 1.5 }),
        ..terracotta
    };
    [
        (Color::linear_rgb(0.5, 0.23, 0.13), terracotta),
        (Color::linear_rgb(0.45, 0.36, 0.25), sandstone),
        (Color::linear_rgb(0.12, 0.12, 0.12), asphalt),
        (Color::linear_rgb(0.5, 0.42, 0.3), sand),
        (Color::linear_rgb(0.1, 0.25, 0.3), glazed),
    ]
}

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let ball = meshes.add(Sphere::new(0.45).mesh().uv(48, 24));
    for (place, (base_color, porous)) in kinds().into_iter().enumerate() {
        let dry = StandardMaterial { base_color, perceptual_roughness: 0.9, ..default() };
        commands.spawn((
            Weatherable::default(),
            porous,
            Mesh3d(ball.clone()),
            MeshMaterial3d(materials.add(dry)),
            Transform::from_xyz(place as f32 - 2.0, 0.0, 0.0),
        ));
    }
    commands.spawn((
        Emitter {
            effect: assets.load("effects/rain.effect.ron"),
            rate: 2000.0,
            shape: EmitterShape::Sky { half_size: Vec2::new(2.5, 0.5) },
            flow: Flow::MmPerHour(60.0),
            // As fast as its drops fall.
            speed: 0.0,
            ..default()
        },
        Transform::from_xyz(0.0, 2.5, 0.0),
    ));

    commands.spawn((
        DirectionalLight::default(),
        Transform::default().looking_to(Vec3::new(-0.7, -1.2, -1.0), Vec3::Y),
    ));
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.2, 5.0).looking_at(Vec3::ZERO, Vec3::Y)));
}
