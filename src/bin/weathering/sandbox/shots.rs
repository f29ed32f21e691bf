//! Pictures of the scene: one (F12), or one of every frame in which time has gone on (F11); without panels, unless they are wanted
//! in it.

use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy_egui::egui;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::replay::write_png;

use super::settings::Settings;
use super::shortcuts::Shortcuts;
use super::ui::{AddPanel, Note, Place, UiCamera};

/// Where pictures and saved scenes go.
#[derive(Resource)]
pub struct OutFolder(pub PathBuf);

/// A sequence that is being taken.
#[derive(Resource, Default)]
pub struct Sequence {
    folder: Option<PathBuf>,
    frames: u32,
    /// Tick of the last picture.
    tick: u32,
}

impl Sequence {
    /// One that is being taken.
    #[cfg(test)]
    pub fn into_folder(folder: &str) -> Self {
        Self { folder: Some(folder.into()), ..default() }
    }

    /// Whether pictures without panels are being taken, one after the other.
    pub fn fills(&self, settings: &Settings) -> bool {
        self.folder.is_some() && !settings.panels_in_pictures
    }
}

/// What the next frame is to be.
#[derive(Resource, Debug, Default, Clone, PartialEq, Eq)]
enum Wanted {
    #[default]
    Nothing,
    /// A picture by itself. It gets a name when it is there, some frames later: until then others may be taken.
    Alone,
    /// One of a sequence, in this file.
    Frame(PathBuf),
}

/// Takes pictures: panels go from the frame that becomes one.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub struct TakeSystems;

pub fn plugin(app: &mut App) {
    app.init_resource::<Sequence>()
        .init_resource::<Wanted>()
        .add_systems(Update, keys)
        .add_systems(PostUpdate, (follow_sequence, take).chain().in_set(TakeSystems))
        .add_panel(Place::Side, "Files", show);
}

/// The first of `name_000.png`, `name_001.png`, ... (or folders of that name) that is not there yet.
pub fn free_name(folder: &Path, name: &str, extension: &str) -> PathBuf {
    let mut number = 0;
    loop {
        let path = folder.join(format!("{name}_{number:03}{extension}"));
        if !path.exists() {
            return path;
        }
        number += 1;
    }
}

fn keys(keys: Res<Shortcuts>, mut commands: Commands) {
    if keys.pressed(KeyCode::F12) {
        commands.queue(want_picture);
    }
    if keys.pressed(KeyCode::F11) {
        commands.queue(toggle_sequence);
    }
}

fn want_picture(world: &mut World) {
    *world.resource_mut::<Wanted>() = Wanted::Alone;
}

fn toggle_sequence(world: &mut World) {
    let fresh = free_name(&world.resource::<OutFolder>().0, "sequence", "");
    let tick = world.resource::<WeatheringClock>().tick();
    let mut sequence = world.resource_mut::<Sequence>();
    let told = match sequence.folder.take() {
        Some(folder) => format!("{} pictures in {}", sequence.frames, folder.display()),
        None => {
            let told = format!("taking pictures into {}", fresh.display());
            *sequence = Sequence { folder: Some(fresh), frames: 0, tick };
            told
        }
    };
    world.resource_mut::<Note>().tell(told);
}

/// A picture of every frame in which time has gone on.
fn follow_sequence(clock: Res<WeatheringClock>, mut sequence: ResMut<Sequence>, mut wanted: ResMut<Wanted>) {
    let Some(folder) = &sequence.folder else { return };
    if clock.tick() == sequence.tick || *wanted != Wanted::Nothing {
        return;
    }
    *wanted = Wanted::Frame(folder.join(format!("frame_{:05}.png", sequence.frames)));
    sequence.frames += 1;
    sequence.tick = clock.tick();
}

/// Takes the frame that is about to be drawn, without panels or with them.
fn take(
    settings: Res<Settings>,
    sequence: Res<Sequence>,
    mut wanted: ResMut<Wanted>,
    mut commands: Commands,
    mut panels: Query<&mut Camera, With<UiCamera>>,
) {
    let wanted = std::mem::take(&mut *wanted);
    for mut camera in &mut panels {
        let is_shown = wanted == Wanted::Nothing || settings.panels_in_pictures;
        if camera.is_active != is_shown {
            camera.is_active = is_shown;
        }
    }
    let frame = match wanted {
        Wanted::Nothing => return,
        Wanted::Alone => None,
        Wanted::Frame(path) => Some(path),
    };
    // Of a sequence it would be read in the pictures.
    let is_alone = sequence.folder.is_none();
    commands.spawn(Screenshot::primary_window()).observe(
        move |captured: On<ScreenshotCaptured>, out: Res<OutFolder>, mut note: ResMut<Note>| {
            let path = frame.clone().unwrap_or_else(|| free_name(&out.0, "screenshot", ".png"));
            match write_png(&path, captured.image.clone()) {
                Ok(()) if is_alone => note.tell(format!("saved {}", path.display())),
                Ok(()) => {}
                Err(error) => note.complain(error.to_string()),
            }
        },
    );
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    ui.heading("Pictures");
    ui.horizontal(|ui| {
        if ui.button("Take one").on_hover_text("Of the scene as it is (F12)").clicked() {
            want_picture(world);
        }
        let is_running = world.resource::<Sequence>().folder.is_some();
        let label = if is_running { "End the sequence" } else { "Begin a sequence" };
        let about = "Of every frame in which time goes on; F11 ends it";
        if ui.button(label).on_hover_text(about).clicked() {
            toggle_sequence(world);
        }
    });
    let mut settings = world.resource_mut::<Settings>();
    let mut with_panels = settings.panels_in_pictures;
    let about = "Else they are hidden while pictures are taken";
    if ui.checkbox(&mut with_panels, "with panels").on_hover_text(about).changed() {
        settings.panels_in_pictures = with_panels;
    }
    ui.small(format!("into {}", world.resource::<OutFolder>().0.display()));
    ui.separator();
    super::saving::show(ui, world);
    ui.separator();
    super::export::show(ui, world);
    ui.separator();
    super::record::show(ui, world);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let first = free_name(folder.path(), "shot", ".png");
        assert_eq!(first, folder.path().join("shot_000.png"));
        std::fs::write(&first, "x").unwrap();
        assert_eq!(free_name(folder.path(), "shot", ".png"), folder.path().join("shot_001.png"));
        assert_eq!(free_name(&folder.path().join("none"), "shot", ""), folder.path().join("none/shot_000"));
    }

    #[test]
    fn pictures_that_are_taken_before_the_first_is_written_are_files_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        let mut world = World::new();
        world.insert_resource(OutFolder(folder.path().into()));
        world.init_resource::<Settings>();
        world.init_resource::<Sequence>();
        world.init_resource::<Wanted>();
        world.init_resource::<Note>();
        for _ in 0..2 {
            want_picture(&mut world);
            world.run_system_cached(take).unwrap();
            assert_eq!(*world.resource::<Wanted>(), Wanted::Nothing);
        }
        // They come later.
        let mut waiting = world.query_filtered::<Entity, With<Screenshot>>();
        for entity in waiting.iter(&world).collect::<Vec<_>>() {
            world.trigger(ScreenshotCaptured { entity, image: Image::default() });
        }
        let written = ["screenshot_000.png", "screenshot_001.png"].map(|name| folder.path().join(name));
        assert!(written.iter().all(|path| path.is_file()));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn a_sequence_without_panels_fills_the_window_until_it_ends() {
        let mut sequence = Sequence::default();
        let mut settings = Settings::default();
        assert!(!sequence.fills(&settings));
        sequence = Sequence::into_folder("pictures");
        assert!(sequence.fills(&settings));
        settings.panels_in_pictures = true;
        assert!(!sequence.fills(&settings));
    }
}
