//! Small Bevy apps that render without a window.

use std::time::{Duration, Instant};

use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_resource::PollType;
use bevy::render::renderer::RenderDevice;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::material::PorousMaterial;
use bevy_weathering::offscreen;
use bevy_weathering::wetting::{SurfaceWater, WetGeometry};

use super::harness;

/// An app with everything, driven by hand; `None` where the GPU is skipped.
pub fn app() -> Option<App> {
    let mut app = unfinished_app()?;
    app.finish();
    app.cleanup();
    Some(app)
}

/// The same while plugins can still be added.
pub fn unfinished_app() -> Option<App> {
    let mut app = bare_app()?;
    app.add_plugins(WeatheringPlugins).insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    Some(app)
}

/// The same with pipelines that are compiled in the background, as games have it.
pub fn app_that_compiles_in_the_background() -> Option<App> {
    let mut app = bare(false)?;
    app.add_plugins(WeatheringPlugins).insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    app.finish();
    app.cleanup();
    Some(app)
}

/// Bevy alone.
pub fn bare_app() -> Option<App> {
    bare(true)
}

fn bare(synchronous_pipeline_compilation: bool) -> Option<App> {
    harness::gpu()?;
    let mut app = App::new();
    app.add_plugins(offscreen::plugins().set(RenderPlugin { synchronous_pipeline_compilation, ..default() }));
    Some(app)
}

/// One frame, until the GPU is done with it.
pub fn update(app: &mut App) {
    app.update();
    let device = app.world().resource::<RenderDevice>().wgpu_device();
    device.poll(PollType::Wait { submission_index: None, timeout: None }).unwrap();
}

/// Updates until `done` says so.
pub fn update_until(app: &mut App, what: &str, mut done: impl FnMut(&mut World) -> bool) {
    let begun = Instant::now();
    while !done(app.world_mut()) {
        assert!(begun.elapsed() < Duration::from_secs(120), "waited in vain for {what}");
        update(app);
    }
}

#[derive(Resource, Default)]
struct Answers(Vec<(usize, Vec<u8>)>);

/// Reads textures and buffers back, in the order asked for. Rows keep their padding.
pub fn read_back(app: &mut App, requests: Vec<Readback>) -> Vec<Vec<u8>> {
    let count = requests.len();
    app.insert_resource(Answers::default());
    for (number, request) in requests.into_iter().enumerate() {
        app.world_mut().spawn(request).observe(
            move |data: On<ReadbackComplete>, mut answers: ResMut<Answers>, mut commands: Commands| {
                commands.entity(data.entity).despawn();
                if answers.0.iter().all(|(other, _)| *other != number) {
                    answers.0.push((number, data.data.clone()));
                }
            },
        );
    }
    update_until(app, "the read-back", |world| world.resource::<Answers>().0.len() == count);
    let mut answers = std::mem::take(&mut app.world_mut().resource_mut::<Answers>().0);
    answers.sort_by_key(|(number, _)| *number);
    answers.into_iter().map(|(_, bytes)| bytes).collect()
}

/// An image that cameras can draw into.
pub fn add_target(app: &mut App, size: UVec2) -> Handle<Image> {
    offscreen::target(&mut app.world_mut().resource_mut::<Assets<Image>>(), size)
}

/// A camera that draws into a target.
pub fn camera(target: &Handle<Image>, eye: Vec3, at: Vec3) -> impl Bundle {
    (
        Camera3d::default(),
        Msaa::Off,
        RenderTarget::from(target.clone()),
        Transform::from_translation(eye).looking_at(at, Vec3::Y),
    )
}

#[derive(Resource, Default)]
struct Picture(Option<Image>);

/// What the target shows, as RGB bytes.
pub fn picture(app: &mut App, target: &Handle<Image>) -> image::RgbImage {
    app.insert_resource(Picture::default());
    app.world_mut().spawn(Screenshot::image(target.clone())).observe(
        |captured: On<ScreenshotCaptured>, mut picture: ResMut<Picture>| {
            picture.0 = Some(captured.image.clone());
        },
    );
    update_until(app, "the picture", |world| world.resource::<Picture>().0.is_some());
    let image = app.world_mut().resource_mut::<Picture>().0.take().unwrap();
    image.try_into_dynamic().unwrap().to_rgb8()
}

/// Covers a surface with water, film and absorbed, in mm, as soon as its texels are measured.
pub fn cover(app: &mut App, surface: Entity, film_mm: f32, absorbed_mm: f32) {
    update_until(app, "the texels to be measured", |world| world.get::<WetGeometry>(surface).is_some());
    let tick = app.world().resource::<WeatheringClock>().tick();
    let geometry = app.world().get::<WetGeometry>(surface).unwrap().0.clone();
    let mut water = app.world_mut().get_mut::<SurfaceWater>(surface).unwrap();
    water.cover(&geometry, film_mm, absorbed_mm, tick);
}

/// Matter that shows at once what it holds, and on which nothing runs.
pub fn still(capacity_mm: f32) -> PorousMaterial {
    PorousMaterial { t_fill: 0.0, capacity_mm, visible_mm: capacity_mm, retained_mm: 1000.0, ..default() }
}
