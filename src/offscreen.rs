//! Drawing without a window: for pictures that go to files, for tests and for benches.
//!
//! [`plugins`] in place of `DefaultPlugins`, then [`App::finish`], [`App::cleanup`] and an [`App::update`] for every frame.
//! Cameras draw into a [`target`]; a [`Stage`] has one, and daylight.

use bevy::app::{PanicHandlerPlugin, PluginGroupBuilder, TerminalCtrlCHandlerPlugin};
use bevy::asset::RenderAssetUsages;
use bevy::camera::RenderTarget;
use bevy::light::EnvironmentMapLight;
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;

/// All that Bevy draws with, without a window. A frame runs on the thread that asks for it, is sent to the GPU within the call,
/// and waits for its pipelines. How to log, to panic and to be interrupted is left to the program.
pub fn plugins() -> PluginGroupBuilder {
    let no_window =
        WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
    DefaultPlugins
        .set(no_window)
        .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
        .disable::<WinitPlugin>()
        .disable::<PipelinedRenderingPlugin>()
        .disable::<LogPlugin>()
        .disable::<PanicHandlerPlugin>()
        .disable::<TerminalCtrlCHandlerPlugin>()
}

/// An image of so many pixels, 8-bit sRGB, that cameras can draw into.
pub fn target(images: &mut Assets<Image>, size: UVec2) -> Handle<Image> {
    let mut image = Image::new_uninit(
        Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
        TextureDimension::D2,
        TextureFormat::Rgba8UnormSrgb,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.texture_descriptor.usage |= TextureUsages::RENDER_ATTACHMENT;
    images.add(image)
}

/// A plain day: one sun, a sky of three colours, and a picture to draw into.
#[derive(Clone)]
pub struct Stage {
    /// What its cameras draw into.
    pub target: Handle<Image>,
    /// Light blue above, nearly white at the horizon, brown below; 400 cd/m² where it is 1.
    pub sky: EnvironmentMapLight,
    /// The sun's entity.
    pub sun: Entity,
}

impl Stage {
    /// Spawns a sun that shines in this direction, and makes a picture of so many pixels. Cameras are spawned with
    /// [`Self::camera`].
    pub fn new(world: &mut World, size: UVec2, sun: DirectionalLight, direction: Vec3) -> Self {
        let mut images = world.resource_mut::<Assets<Image>>();
        let target = target(&mut images, size);
        let sky = EnvironmentMapLight {
            intensity: 400.0,
            ..EnvironmentMapLight::hemispherical_gradient(
                &mut images,
                Color::linear_rgb(0.5, 0.7, 1.0),
                Color::linear_rgb(0.8, 0.8, 0.8),
                Color::linear_rgb(0.25, 0.2, 0.15),
            )
        };
        let sun = world.spawn((sun, Transform::default().looking_to(direction, Vec3::Y))).id();
        Self { target, sky, sun }
    }

    /// A camera under this sky that draws into the picture, one sample a pixel.
    pub fn camera(&self, place: Transform) -> impl Bundle {
        (Camera3d::default(), Msaa::Off, RenderTarget::from(self.target.clone()), self.sky.clone(), place)
    }
}
