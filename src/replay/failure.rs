//! What becomes of a run whose graphics driver fails: a GPU that hangs or is unplugged, a driver that crashes.
//!
//! Bevy stops rendering then and asks its [`RenderErrorHandler`] what to do. A replay remembers why, and ends with that after the
//! frame in which it was told: pictures and read-backs would be waited for in vain.

use std::panic::{AssertUnwindSafe, catch_unwind};

use bevy::prelude::*;
use bevy::render::error_handler::{ErrorType, RenderError, RenderErrorHandler, RenderErrorPolicy};
use bevy::render::render_resource::PollType;
use bevy::render::renderer::RenderDevice;

use super::ReplayError;
use crate::overlay::SplatStats;

/// Why nothing is drawn any more.
#[derive(Resource, Debug, Clone, PartialEq, Eq)]
struct RenderFailure(String);

pub(super) fn plugin(app: &mut App) {
    app.insert_resource(RenderErrorHandler(remember));
}

fn remember(error: &RenderError, main_world: &mut World, _render_world: &mut World) -> RenderErrorPolicy {
    main_world.insert_resource(RenderFailure(describe_render_error(error)));
    RenderErrorPolicy::StopRendering
}

/// What the renderer failed of, in a line for users.
pub fn describe_render_error(error: &RenderError) -> String {
    let what = match error.ty {
        ErrorType::DeviceLost => "the graphics device was lost",
        ErrorType::OutOfMemory => "the graphics device has no memory left",
        ErrorType::Validation | ErrorType::Internal => "the graphics driver refused what it was given",
    };
    // What wgpu says goes over several lines, and may be nothing.
    let says: Vec<_> = error.description.split_whitespace().collect();
    if says.is_empty() { what.into() } else { format!("{what} ({})", says.join(" ")) }
}

/// # Errors
/// [`ReplayError::Renderer`] once the renderer has failed, or could not paint something.
pub(super) fn check(world: &World) -> Result<(), ReplayError> {
    if world.get_resource::<SplatStats>().is_some_and(|stats| stats.lost() > 0) {
        let why = "a shader that paints splats did not compile, as the log tells";
        return Err(ReplayError::Renderer(why.into()));
    }
    match world.get_resource::<RenderFailure>() {
        Some(failure) => Err(ReplayError::Renderer(failure.0.clone())),
        None => Ok(()),
    }
}

/// Blocks until the GPU has done all it was given.
///
/// # Errors
/// [`ReplayError::Renderer`] if the device was lost meanwhile.
pub(super) fn wait_for_gpu(world: &World) -> Result<(), ReplayError> {
    let Some(device) = world.get_resource::<RenderDevice>() else { return Ok(()) };
    let wait = || device.wgpu_device().poll(PollType::Wait { submission_index: None, timeout: None });
    // wgpu has no error for a device that is lost while it is waited for: it panics.
    match catch_unwind(AssertUnwindSafe(wait)) {
        Ok(Ok(_)) => Ok(()),
        Ok(Err(error)) => {
            error!("the graphics device does not answer: {error}");
            Ok(())
        }
        Err(_) => Err(ReplayError::Renderer("the graphics device was lost".into())),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{ReplayOptions, Run};
    use super::*;
    use crate::scenario::Scenario;

    fn error(ty: ErrorType, description: &str) -> RenderError {
        RenderError { ty, description: description.into(), source: None }
    }

    #[test]
    fn failures_are_told_in_a_line() {
        let lost = describe_render_error(&error(ErrorType::DeviceLost, ""));
        assert_eq!(lost, "the graphics device was lost");
        let refused = describe_render_error(&error(ErrorType::Validation, "In a pass\n  no buffer\n"));
        assert_eq!(refused, "the graphics driver refused what it was given (In a pass no buffer)");
    }

    #[test]
    fn a_run_that_cannot_paint_ends_with_an_error() {
        let mut world = World::new();
        assert!(check(&world).is_ok());
        world.init_resource::<SplatStats>();
        assert!(check(&world).is_ok());
        world.resource::<SplatStats>().lose(1);
        assert!(matches!(check(&world), Err(ReplayError::Renderer(_))));
    }

    #[test]
    fn a_run_whose_device_is_lost_ends_with_an_error_and_whole_files() {
        if std::env::var("WEATHERING_SKIP_GPU").is_ok_and(|value| value == "1") {
            eprintln!("skipped: needs a GPU, and WEATHERING_SKIP_GPU=1");
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios/hose.ron");
        let mut scenario = Scenario::load(&file).unwrap();
        // Looks take time to load, and do not matter here.
        scenario.scenario.environment = None;
        scenario.scenario.materials.values_mut().for_each(|material| material.texture = Default::default());
        let options = ReplayOptions {
            out: Some(folder.path().to_owned()),
            size: UVec2::new(32, 32),
            ..ReplayOptions::new(scenario)
        };
        let mut run = Run::load(&options).unwrap();
        run.picture("before.png".into(), 3).unwrap();
        run.finish_captures().unwrap();

        let device = run.app.world().resource::<RenderDevice>().wgpu_device().clone();
        device.destroy();
        // It is lost when it has nothing to do any more.
        device.poll(PollType::Wait { submission_index: None, timeout: None }).unwrap();
        let errors = [run.picture("after.png".into(), 3).unwrap_err(), run.finish_captures().unwrap_err()];
        for error in errors {
            assert!(matches!(error, ReplayError::Renderer(_)), "{error}");
            assert!(error.to_string().contains("the graphics device was lost"), "{error}");
        }
        let files: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|file| file.unwrap().path()).collect();
        assert_eq!(files, [folder.path().join("before.png")]);
        assert_eq!(image::open(&files[0]).unwrap().into_rgb8().dimensions(), (32, 32));
    }
}
