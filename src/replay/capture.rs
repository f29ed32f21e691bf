//! Pictures of the running scene.

use std::path::Path;
use std::time::Instant;

use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use image::{ImageError, ImageFormat};

use super::{ReplayError, Run, give_up_after};
use crate::offscreen;
use crate::picture::{PictureError, write_picture};

/// Pictures that have come back from the GPU.
#[derive(Resource, Default)]
struct Pictures {
    expected: usize,
    /// With the names of their files.
    done: Vec<(String, Image)>,
}

/// Makes every camera draw into an image instead of a window.
pub(super) fn add_target(world: &mut World, size: UVec2) -> Handle<Image> {
    let target = offscreen::target(&mut world.resource_mut::<Assets<Image>>(), size);
    let mut cameras = world.query_filtered::<Entity, With<Camera>>();
    for camera in cameras.iter(world).collect::<Vec<_>>() {
        world.entity_mut(camera).insert(RenderTarget::from(target.clone()));
    }
    world.init_resource::<Pictures>();
    target
}

impl Run<'_> {
    /// Asks for a picture of the next frame, for a file of this name.
    pub(super) fn capture(&mut self, file: String) -> Result<(), ReplayError> {
        let (Some(target), Some(_)) = (&self.target, &self.options.out) else { return Ok(()) };
        let screenshot = Screenshot::image(target.clone());
        let world = self.app.world_mut();
        world.resource_mut::<Pictures>().expected += 1;
        world.spawn(screenshot).observe(
            move |captured: On<ScreenshotCaptured>, mut pictures: ResMut<Pictures>| {
                pictures.done.push((file.clone(), captured.image.clone()));
            },
        );
        Ok(())
    }

    /// Writes the pictures that have come.
    pub(super) fn write_captures(&mut self) -> Result<(), ReplayError> {
        let Some(out) = &self.options.out else { return Ok(()) };
        let Some(mut pictures) = self.app.world_mut().get_resource_mut::<Pictures>() else { return Ok(()) };
        let done = std::mem::take(&mut pictures.done);
        pictures.expected -= done.len();
        for (file, image) in done {
            write_png(&out.join(file), image)?;
        }
        Ok(())
    }

    /// Waits for the pictures still under way.
    pub(super) fn finish_captures(&mut self) -> Result<(), ReplayError> {
        let begun = Instant::now();
        while self.app.world().get_resource::<Pictures>().is_some_and(|pictures| pictures.expected > 0) {
            self.step(0)?;
            give_up_after(begun, "the last pictures")?;
        }
        Ok(())
    }
}

/// Writes a picture, without its alpha channel.
///
/// # Errors
/// [`ReplayError::Picture`] with the path.
pub fn write_png(path: &Path, image: Image) -> Result<(), ReplayError> {
    let picture = image.try_into_dynamic().map_err(|error| {
        let source = ImageError::IoError(std::io::Error::other(error.to_string()));
        PictureError::Image { path: path.into(), source }
    })?;
    // The alpha channel of a finished picture means nothing.
    Ok(write_picture(path, &picture.to_rgb8().into(), ImageFormat::Png)?)
}
