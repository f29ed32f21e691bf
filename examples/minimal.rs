//! The five lines that make a Bevy scene wet: a clay ball in a shower, which gets dark and shiny from above.
//!
//! `cargo run --release --example minimal`

use bevy::prelude::*;
use bevy_weathering::prelude::*;

fn main() {
    App::new().add_plugins((DefaultPlugins, WeatheringPlugins)).add_systems(Startup, setup).run();
}

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    // A scene as any other. What is `Weatherable` gets wet where it is hit.
    let clay = materials.add(Color::linear_rgb(0.5, 0.23, 0.13));
    commands.spawn((Weatherable::default(), Mesh3d(meshes.add(Sphere::new(1.0))), MeshMaterial3d(clay)));

    // A shower of 60 mm/h, on 3 m by 3 m. Its drops are a `WeatherEffect` that is built in; yours may be a file, or made in code.
    let rain = Emitter::rain(assets.load(WeatherEffect::RAIN), 60.0, Vec2::splat(1.5));
    commands.spawn((rain, Transform::from_xyz(0.0, 4.0, 0.0)));

    commands.spawn((
        DirectionalLight::default(),
        Transform::default().looking_to(Vec3::new(-1.0, -1.5, -1.0), Vec3::Y),
    ));
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.0, 4.5).looking_at(Vec3::ZERO, Vec3::Y)));
}
