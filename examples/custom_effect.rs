//! Red paint that is thrown at a wall: an effect of your own, with its mark, colour, gloss and relief. Each
//! splat is turned at random, and stretched by the way it came.
//!
//! `cargo run --release --example custom_effect`

use bevy::prelude::*;
use bevy_weathering::effect::{Paint, ParticleLook, Sprite, StampSource};
use bevy_weathering::prelude::*;
use bevy_weathering::stamps::StampKind;

fn main() {
    App::new().add_plugins((DefaultPlugins, WeatheringPlugins)).add_systems(Startup, setup).run();
}

/// In a file it would be the same: see `assets/effects/mud.effect.ron`.
fn thrown_paint() -> WeatherEffect {
    let red = [0.6, 0.02, 0.03];
    WeatherEffect {
        // Brings no water: all it leaves is a mark.
        volume_mm3: 0.0,
        terminal_speed: Some(15.0),
        stamps: StampSource::Kind(StampKind::Splat),
        stamp_radius: Some(0.06),
        stamp_radius_jitter: 0.6,
        // What comes aslant is up to three times as long as wide.
        stamp_stretch: 2.0,
        diffuse: Paint { color: red, opacity: 1.0 },
        // Reflectance and smoothness.
        specular: Paint { color: [0.5, 0.85, 0.0], opacity: 1.0 },
        bump: 1.0,
        look: ParticleLook {
            color: [red[0], red[1], red[2], 1.0],
            width: 0.03,
            exposure: 0.0,
            sprite: Sprite::Drop,
            splash: 0.0,
        },
        ..default()
    }
}

fn setup(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut effects: ResMut<Assets<WeatherEffect>>,
) -> Result {
    let effect = thrown_paint();
    // A file is checked when it is loaded; what is made in code has to ask for it.
    effect.validate()?;
    let effect = effects.add(effect);

    commands.spawn((
        Weatherable { map_size: 1024, ..default() },
        Mesh3d(meshes.add(Plane3d::new(Vec3::Z, Vec2::new(2.0, 1.5)))),
        MeshMaterial3d(materials.add(Color::linear_rgb(0.7, 0.7, 0.68))),
    ));
    commands.spawn((
        Emitter { effect, rate: 8.0, speed: 9.0, spread: 0.35, ..default() },
        Transform::from_xyz(-1.5, 0.2, 2.5).looking_at(Vec3::new(0.0, 0.3, 0.0), Vec3::Y),
    ));

    commands.spawn((
        DirectionalLight::default(),
        Transform::default().looking_to(Vec3::new(-1.0, -0.7, -0.6), Vec3::Y),
    ));
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 0.0, 4.0).looking_at(Vec3::ZERO, Vec3::Y)));
    Ok(())
}
