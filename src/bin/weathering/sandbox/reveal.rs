//! The window appears with its first picture. Before that, while the scene loads and pipelines are compiled, there would be
//! nothing in it but black, and then a scene that comes piece by piece.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Instant;

use bevy::prelude::*;
use bevy::render::render_resource::PipelineCache;
use bevy::render::{Render, RenderApp, RenderSystems};
use bevy::window::PrimaryWindow;
use bevy_weathering::scenario::ScenarioStatus;

/// Whole frames in a row that make a picture: one may still be of before the scene was there, and one goes to a window that has
/// just got another size.
const FRAMES: u32 = 3;

/// Seconds since the program began after which the window appears, whatever is in it.
const PATIENCE: f32 = 15.0;

/// When the program began.
#[derive(Resource)]
pub struct Begun(pub Instant);

/// Frames in a row that had every pipeline they wanted. The renderer counts, on a thread of its own.
#[derive(Resource, Clone, Default)]
struct WholeFrames(Arc<AtomicU32>);

pub fn plugin(app: &mut App) {
    let frames = WholeFrames::default();
    app.insert_resource(frames.clone()).add_systems(PostUpdate, reveal);
    if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
        // What has been drawn has been handed to the window by then.
        render_app.insert_resource(frames).add_systems(Render, count.in_set(RenderSystems::Cleanup));
    }
}

fn count(pipelines: Res<PipelineCache>, frames: Res<WholeFrames>) {
    if pipelines.waiting_pipelines().next().is_some() {
        frames.0.store(0, Ordering::Relaxed);
    } else {
        frames.0.fetch_add(1, Ordering::Relaxed);
    }
}

fn reveal(
    begun: Res<Begun>,
    frames: Res<WholeFrames>,
    status: Res<ScenarioStatus>,
    mut window: Single<&mut Window, With<PrimaryWindow>>,
    mut was_ready: Local<bool>,
) {
    if window.visible {
        return;
    }
    let is_ready = matches!(*status, ScenarioStatus::Ready);
    if is_ready && !*was_ready {
        // Frames without the scene say nothing of it.
        frames.0.store(0, Ordering::Relaxed);
    }
    *was_ready = is_ready;
    let seconds = begun.0.elapsed().as_secs_f32();
    if (is_ready && frames.0.load(Ordering::Relaxed) >= FRAMES) || seconds > PATIENCE {
        window.visible = true;
        info!("shown after {seconds:.1} s");
    }
}
