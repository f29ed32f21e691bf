//! Five balls in one shower, from the left: terracotta, sandstone, asphalt, sand, and a glazed one. Each takes up water, and
//! looks with it, in its own way.
//!
//! `cargo run --release --example own_material`

use bevy::prelude::*;
use bevy_weathering::prelude::*;

fn main() {
    App::new().add_plugins((DefaultPlugins, WeatheringPlugins)).add_systems(Startup, setup).run();
}

/// Colour when dry, and what water does. `PorousMaterial::PRESETS` has more of them.
fn kinds() -> [(Color, PorousMaterial); 5] {
    // A preset is a place to begin: this stone is saltier than others.
    let salty = PorousMaterial { efflorescence: 0.8, ..PorousMaterial::SANDSTONE };
    [
        (Color::linear_rgb(0.5, 0.23, 0.13), PorousMaterial::TERRACOTTA),
        (Color::linear_rgb(0.45, 0.36, 0.25), salty),
        (Color::linear_rgb(0.12, 0.12, 0.12), PorousMaterial::ASPHALT),
        (Color::linear_rgb(0.5, 0.42, 0.3), PorousMaterial::SAND),
        (Color::linear_rgb(0.1, 0.25, 0.3), PorousMaterial::GLAZED),
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
    let rain = Emitter::rain(assets.load(WeatherEffect::RAIN), 60.0, Vec2::new(2.5, 0.5));
    commands.spawn((rain, Transform::from_xyz(0.0, 2.5, 0.0)));

    commands.spawn((
        DirectionalLight::default(),
        Transform::default().looking_to(Vec3::new(-0.7, -1.2, -1.0), Vec3::Y),
    ));
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.2, 5.0).looking_at(Vec3::ZERO, Vec3::Y)));
}
