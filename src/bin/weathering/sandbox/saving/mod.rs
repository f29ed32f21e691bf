//! Saving the scene into a folder and going on from one, with `src/save`.
//!
//! Colour maps live on the GPU: time is paused, they are read back, and then all is written on another thread. What has been
//! saved here is a scenario's state, with emitters as they are set and those that were added, and goes on in
//! `weathering replay --resume`, too; so nothing else of the sandbox's own may be in it.

mod panel;
mod steps;

use std::path::PathBuf;

use bevy::prelude::*;
use bevy::tasks::{Task, block_on};
use bevy_weathering::export::ColorReadback;
use bevy_weathering::save::{SaveError, SavedScene};

use super::ui::Note;

pub use panel::show;
pub use steps::{give_up_moment, keep_moment};

/// Frames between pausing and reading, in which the last splats are painted.
const SETTLE: u32 = 4;

/// What the state that is taken is for.
enum Purpose {
    /// A folder.
    Folder(PathBuf),
    /// A moment of a session that is recorded; time goes on then, if it did before.
    Moment { goes_on: bool },
}

/// A scene that is being saved, or gone on with.
#[derive(Resource, Default)]
pub struct Saving(Option<Step>);

enum Step {
    /// So many frames until the maps are read.
    Settling {
        purpose: Purpose,
        frames: u32,
    },
    Reading {
        purpose: Purpose,
        colors: ColorReadback,
    },
    /// So many frames until surfaces that were reset have their new, empty maps.
    Clearing {
        folder: PathBuf,
        scene: Box<SavedScene>,
        frames: u32,
    },
    /// On another thread.
    Writing {
        folder: PathBuf,
        task: Task<Result<(), SaveError>>,
    },
}

pub fn plugin(app: &mut App) {
    app.init_resource::<panel::Folder>()
        .init_resource::<Saving>()
        .add_systems(Update, (panel::press, steps::advance).chain());
}

impl Saving {
    /// A scene is on its way to the disk.
    pub fn is_saving(&self) -> bool {
        matches!(self.0, Some(Step::Settling { .. } | Step::Reading { .. } | Step::Writing { .. }))
    }

    /// What is done now is still in what is being saved.
    pub fn will_take(&self) -> bool {
        matches!(self.0, Some(Step::Settling { .. } | Step::Reading { .. }))
    }

    /// As it is right after the key.
    #[cfg(test)]
    pub fn settling() -> Self {
        Self(Some(Step::Settling { purpose: Purpose::Folder("saved".into()), frames: SETTLE }))
    }

    /// Waits for what is being written; what is not that far yet is given up.
    pub fn finish(&mut self) {
        if let Some(Step::Writing { folder, task }) = self.0.take() {
            match block_on(task) {
                Ok(()) => info!("saved {}", folder.display()),
                Err(error) => error!("{error}"),
            }
        }
    }
}

/// Whether a scene is being saved, or gone on with.
pub fn is_busy(world: &World) -> bool {
    world.resource::<Saving>().0.is_some()
}

/// Whether the scene has to stay as it is, or is being put back: what is on its way to the disk already may be left behind.
pub fn is_taking(world: &World) -> bool {
    let step = &world.resource::<Saving>().0;
    matches!(step, Some(Step::Settling { .. } | Step::Reading { .. } | Step::Clearing { .. }))
}

/// Whether time stands still only until a moment is kept.
pub fn goes_on_later(world: &World) -> bool {
    matches!(
        world.resource::<Saving>().0,
        Some(
            Step::Settling { purpose: Purpose::Moment { goes_on: true }, .. }
                | Step::Reading { purpose: Purpose::Moment { goes_on: true }, .. }
        )
    )
}

/// If time stands still for a moment that is kept: whether it goes on then is the other way round from now on.
pub fn toggle_later(world: &mut World) -> bool {
    let mut saving = world.resource_mut::<Saving>();
    let (Some(Step::Settling { purpose, .. }) | Some(Step::Reading { purpose, .. })) = &mut saving.0 else {
        return false;
    };
    let Purpose::Moment { goes_on } = purpose else { return false };
    *goes_on = !*goes_on;
    true
}

/// Another scene takes the place of this one: what is not taken of it yet never will be.
pub fn give_up(world: &mut World) {
    give_up_moment(world);
    if is_taking(world) {
        world.resource_mut::<Saving>().0 = None;
        world.resource_mut::<Note>().complain("not saved, or gone on with: another scene was opened");
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use bevy::tasks::AsyncComputeTaskPool;
    use bevy::window::WindowCloseRequested;
    use bevy_weathering::clock::WeatheringClock;
    use bevy_weathering::emitter::{EmissionSeed, NewParticles};
    use bevy_weathering::particle::{ParticleCounts, Particles, WaterCounts};
    use bevy_weathering::scenario::{Digest, Scenario};
    use bevy_weathering::weather::{DryingClock, Weather};

    use super::super::export::Exporting;
    use super::super::leave;
    use super::super::open::Opened;
    use super::super::shortcuts::Shortcuts;
    use super::super::ui::{Help, UiInput};
    use super::*;

    fn app() -> App {
        let mut app = App::new();
        app.add_message::<WindowCloseRequested>()
            .init_resource::<Shortcuts>()
            .init_resource::<UiInput>()
            .init_resource::<Help>()
            .init_resource::<Note>()
            .init_resource::<Saving>()
            .init_resource::<Exporting>();
        leave::plugin(&mut app);
        app
    }

    fn close(app: &mut App) {
        app.world_mut().write_message(WindowCloseRequested { window: Entity::PLACEHOLDER });
        app.update();
    }

    #[test]
    fn a_window_that_is_closed_while_a_scene_is_saved_or_exported_stays_until_it_is() {
        let cases = [(Saving::settling(), Exporting::default()), (Saving(None), Exporting::settling())];
        for (saving, exporting) in cases {
            let mut app = app();
            app.insert_resource(saving).insert_resource(exporting);
            close(&mut app);
            for _ in 0..3 {
                assert_eq!(app.should_exit(), None);
                app.update();
            }
            app.insert_resource(Saving(None)).insert_resource(Exporting::default());
            app.update();
            assert_eq!(app.should_exit(), Some(AppExit::Success));
        }
    }

    #[test]
    fn who_insists_leaves_at_once_and_without_anything_to_save_so_does_everyone() {
        for (saving, times) in [(Saving::settling(), 2), (Saving(None), 1)] {
            let mut app = app();
            app.insert_resource(saving);
            for _ in 0..times {
                assert_eq!(app.should_exit(), None);
                close(&mut app);
            }
            assert_eq!(app.should_exit(), Some(AppExit::Success));
        }
    }

    #[test]
    fn escape_closes_a_list_that_is_in_front_before_it_leaves() {
        let mut app = app();
        app.insert_resource(UiInput { popup: true, ..default() });
        app.insert_resource(Shortcuts::of(KeyCode::Escape));
        app.update();
        assert_eq!(app.should_exit(), None);
        app.insert_resource(UiInput::default());
        app.update();
        assert_eq!(app.should_exit(), Some(AppExit::Success));
    }

    #[test]
    fn escape_asks_before_it_leaves_what_is_not_saved() {
        let mut app = app();
        app.world_mut().resource_mut::<leave::Unsaved>().0 = true;
        app.insert_resource(Shortcuts::of(KeyCode::Escape));
        let is_leaving = |app: &App| app.world().resource::<leave::Leaving>().0;
        app.update();
        assert!(app.should_exit().is_none() && !is_leaving(&app));
        app.update();
        assert_eq!(app.should_exit(), Some(AppExit::Success));
        // What is being saved is not lost.
        let mut app = self::app();
        app.world_mut().resource_mut::<leave::Unsaved>().0 = true;
        app.insert_resource(Saving::settling());
        app.insert_resource(Shortcuts::of(KeyCode::Escape));
        app.update();
        assert!(app.should_exit().is_none() && is_leaving(&app));
    }

    #[test]
    fn a_pause_while_a_moment_is_kept_comes_after_it() {
        let mut world = World::new();
        let purpose = Purpose::Moment { goes_on: true };
        world.insert_resource(Saving(Some(Step::Settling { purpose, frames: SETTLE })));
        assert!(is_taking(&world) && goes_on_later(&world));
        assert!(toggle_later(&mut world) && !goes_on_later(&world));
        assert!(toggle_later(&mut world) && goes_on_later(&world));
        // What is saved into a folder stays paused then.
        world.insert_resource(Saving::settling());
        assert!(is_taking(&world) && !toggle_later(&mut world) && !goes_on_later(&world));
    }

    #[test]
    fn of_a_scene_that_another_has_replaced_nothing_is_saved() {
        let mut world = World::new();
        world.init_resource::<Note>();
        world.insert_resource(Saving::settling());
        give_up(&mut world);
        assert!(!is_busy(&world));
    }

    #[test]
    fn what_another_scenario_has_saved_leaves_the_scene_as_it_is() {
        let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios");
        let [open, other] =
            ["hose.ron", "rain.ron"].map(|name| Scenario::load(&scenarios.join(name)).unwrap());
        // All that a scene of nothing has.
        let mut app = App::new();
        app.init_resource::<Saving>()
            .init_resource::<WeatheringClock>()
            .init_resource::<EmissionSeed>()
            .init_resource::<NewParticles>()
            .init_resource::<Particles>()
            .init_resource::<ParticleCounts>()
            .init_resource::<WaterCounts>()
            .init_resource::<Digest>()
            .init_resource::<Weather>()
            .init_resource::<DryingClock>()
            .insert_resource(Opened { loaded: open });
        let world = app.world_mut();
        let folder = tempfile::tempdir().unwrap();
        let kept = folder.path().join("kept");
        SavedScene::capture(world, &other, Vec::new()).write(&kept).unwrap();
        world.resource_mut::<WeatheringClock>().advance();
        let refused = steps::begin_restoring(world, &kept).unwrap_err();
        assert!(refused.contains("saved from another"), "{refused}");
        assert!(world.resource::<WeatheringClock>().tick() == 1 && !is_busy(world));
    }

    #[test]
    fn the_program_does_not_end_before_files_that_are_being_written() {
        let folder = tempfile::tempdir().unwrap();
        let [file, scene] = ["late", "late.glb"].map(|name| folder.path().join(name));
        let write_late = |to: &Path| {
            std::thread::sleep(std::time::Duration::from_millis(200));
            std::fs::write(to, "whole")
        };
        let pool = AsyncComputeTaskPool::get_or_init(Default::default);
        let to = file.clone();
        let saved = pool.spawn(async move {
            write_late(&to).map_err(|source| SaveError::Write { path: "late".into(), source })
        });
        let to = scene.clone();
        let exported = pool.spawn(async move {
            write_late(&to).unwrap();
            Ok(to)
        });
        let mut app = app();
        app.insert_resource(Saving(Some(Step::Writing { folder: folder.path().into(), task: saved })));
        app.insert_resource(Exporting::writing(exported));
        // In the way of a signal or a lost device, which wait for nothing.
        app.world_mut().write_message(AppExit::error());
        app.update();
        for file in [file, scene] {
            assert_eq!(std::fs::read_to_string(file).unwrap(), "whole");
        }
    }
}
