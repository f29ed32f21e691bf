//! White furnace: white matter under a white sky sends back at most what it gets, however rough, wet and flooded.

use bevy::camera::{Exposure, ScalingMode};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::EnvironmentMapLight;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::material::{
    Coated, DryMaterial, Flood, Pores, PorousMaterial, StandingWater, Tweaked, WettingModel,
};
use bevy_weathering::overlay::{Overlays, Weatherable};
use image::RgbImage;

use super::app::{add_target, app, camera, cover, picture, still, update, update_until};
use super::images::keep;

const ROUGHNESSES: [f32; 5] = [0.1, 0.325, 0.55, 0.775, 1.0];

/// Film in mm, and water in the pores, of all they take up.
const WATERS: [(f32, f32); 7] =
    [(0.0, 0.0), (0.0, 0.3), (0.0, 0.9), (0.02, 0.0), (0.1, 0.5), (0.5, 0.0), (2.0, 0.0)];

/// Pixels of a cell of the grid.
const CELL: u32 = 20;

/// What white matter that loses nothing shows: half of all that can be shown, as an sRGB byte.
const WHITE: u8 = 188;

struct Furnace {
    app: App,
    target: Handle<Image>,
    balls: Vec<Entity>,
}

/// A ball for each roughness (rows) and each water (columns).
fn furnace(metallic: f32) -> Option<Furnace> {
    let mut app = app()?;
    let size = UVec2::new(WATERS.len() as u32, ROUGHNESSES.len() as u32);
    let target = add_target(&mut app, size * CELL);
    let middle = size.as_vec2() / 2.0;
    let eye = camera(&target, middle.extend(5.0), middle.extend(0.0));
    let world = app.world_mut();
    world.insert_resource(ClearColor(Color::BLACK));
    world.insert_resource(GlobalAmbientLight::NONE);
    let sky = EnvironmentMapLight {
        intensity: 0.5 / Exposure::default().exposure(),
        ..EnvironmentMapLight::solid_color(&mut world.resource_mut::<Assets<Image>>(), Color::WHITE)
    };
    world.spawn((eye, sky)).insert((
        Tonemapping::None,
        Projection::from(OrthographicProjection {
            scaling_mode: ScalingMode::Fixed { width: size.x as f32, height: size.y as f32 },
            ..OrthographicProjection::default_3d()
        }),
    ));
    let ball = world.resource_mut::<Assets<Mesh>>().add(Sphere::new(0.45).mesh().uv(32, 24));
    let mut balls = Vec::new();
    for (row, roughness) in ROUGHNESSES.into_iter().enumerate() {
        for (column, (film_mm, _)) in WATERS.into_iter().enumerate() {
            let material = StandardMaterial {
                base_color: Color::WHITE,
                perceptual_roughness: roughness,
                metallic,
                ..default()
            };
            let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
            let flood = Flood::Level { level_mm: film_mm, basin_mm: 0.0, relief_mm: 0.0 };
            let place = Transform::from_xyz(column as f32 + 0.5, row as f32 + 0.5, 0.0);
            balls.push(
                world
                    .spawn((
                        Mesh3d(ball.clone()),
                        MeshMaterial3d(material),
                        place,
                        Weatherable { map_size: 64, ..default() },
                        StandingWater { flood, ..default() },
                        still(5.0),
                    ))
                    .id(),
            );
        }
    }
    update_until(&mut app, "the maps and materials", |world| {
        balls
            .iter()
            .all(|&ball| world.get::<Overlays>(ball).is_some() && world.get::<DryMaterial>(ball).is_some())
    });
    for (i, &ball) in balls.iter().enumerate() {
        let part = WATERS[i % WATERS.len()].1;
        if part > 0.0 {
            cover(&mut app, ball, (part - 1.0).max(0.0) * 5.0, part.min(1.0) * 5.0);
        }
    }
    // Understood in the tick after.
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    for _ in 0..3 {
        update(&mut app);
    }
    Some(Furnace { app, target, balls })
}

impl Furnace {
    /// The picture under another model, exchanged while it runs.
    fn picture(&mut self, model: WettingModel) -> RgbImage {
        for &ball in &self.balls {
            self.app.world_mut().get_mut::<PorousMaterial>(ball).unwrap().model = model;
        }
        for _ in 0..3 {
            update(&mut self.app);
        }
        picture(&mut self.app, &self.target)
    }
}

fn models() -> [(&'static str, WettingModel); 5] {
    let pores = Pores { alpha_poro: 0.5, k_w: 1.0, ..default() };
    [
        ("hnat", WettingModel::Hnat(pores)),
        ("hnat_lekner_dorf", WettingModel::HnatLeknerDorf(pores, Coated::default())),
        ("solid", WettingModel::Lagarde(Tweaked { porosity: 0.0, ..default() })),
        ("lekner_dorf", WettingModel::LeknerDorf(Coated::default())),
        ("twomey", WettingModel::Twomey(default())),
    ]
}

/// The least and the most of the pixels well inside each ball, by column.
fn extremes(picture: &RgbImage) -> [(u8, u8); WATERS.len()] {
    let mut extremes = [(255, 0); WATERS.len()];
    for (x, y, pixel) in picture.enumerate_pixels() {
        let from_middle = Vec2::new((x % CELL) as f32 + 0.5, (y % CELL) as f32 + 0.5) - CELL as f32 / 2.0;
        let (least, most) = &mut extremes[(x / CELL) as usize];
        for value in pixel.0 {
            *most = (*most).max(value);
            if from_middle.length() < 0.38 * CELL as f32 {
                *least = (*least).min(value);
            }
        }
    }
    extremes
}

#[test]
fn nothing_gets_brighter_than_what_shines_on_it() {
    for metallic in [0.0, 1.0] {
        let Some(mut furnace) = furnace(metallic) else { return };
        for (name, model) in models() {
            let picture = furnace.picture(model);
            for ((least, most), water) in extremes(&picture).into_iter().zip(WATERS) {
                let place =
                    format!("{name}, metallic {metallic}, film and water {water:?}: {least}..={most}");
                if most > WHITE + 1 {
                    keep("furnace", &[(name, &picture)]);
                    panic!("{place}");
                }
                // Dry white matter loses nothing, and neither does it under clear water if it has no pores.
                let loses = water != (0.0, 0.0) && !["solid", "lekner_dorf", "twomey"].contains(&name);
                if !loses && least < WHITE - 8 {
                    keep("furnace", &[(name, &picture)]);
                    panic!("{place}");
                }
            }
        }
    }
}
