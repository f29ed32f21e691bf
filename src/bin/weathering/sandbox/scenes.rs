//! The list of scenes: all scenarios and models of a folder, with a picture where there is one.

use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use bevy_egui::egui;
use bevy_weathering::picture::read_picture;
use image::ImageFormat;

use super::model::is_model;
use super::open::{Opened, open};
use super::ui::{AddPanel, Place};

/// Width and height of a thumbnail, pixels.
const THUMBNAIL: [u32; 2] = [112, 63];
/// The largest picture that is made small, pixels a side.
const LARGEST: u32 = 4096;
/// The most scenes of a folder.
const MOST: usize = 500;

/// A scene that can be opened.
struct Entry {
    file: PathBuf,
    picture: Picture,
}

/// A picture of a scene, on its way.
enum Picture {
    None,
    Coming(Task<Option<egui::ColorImage>>),
    There(egui::TextureHandle),
}

/// The folder, and what is in it.
#[derive(Resource, Default)]
struct Scenes {
    /// As it is typed.
    folder: String,
    /// As it was read.
    read: Option<String>,
    entries: Vec<Entry>,
    /// A path that is being typed.
    path: String,
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Scenes>().add_panel(Place::Side, "Scenes", show);
}

/// Scenarios and models of a folder, by name. Those of a folder that cannot be read are none.
fn list(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| is_model(path) || is_scenario(path))
        .collect();
    files.sort_unstable();
    files.truncate(MOST);
    files
}

fn is_scenario(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    name.ends_with(".ron") && !name.ends_with(".effect.ron")
}

/// A picture beside the scene, or in `docs/pictures` above its folder, whose name begins as the scene's does.
fn picture_of(file: &Path) -> Option<PathBuf> {
    let stem = file.file_stem()?.to_str()?;
    let folder = file.parent()?;
    let docs = folder.ancestors().skip(1).take(2).map(|above| above.join("docs/pictures"));
    std::iter::once(folder.to_owned()).chain(docs).find_map(|folder| {
        let whole = folder.join(format!("{stem}.png"));
        // The wet one tells more than the dry one.
        let kinds = ["_wet", "_rain", "_half", "_puddles", "_dry"];
        let kinds = kinds.iter().map(|kind| folder.join(format!("{stem}{kind}.png")));
        std::iter::once(whole).chain(kinds).find(|picture| picture.is_file())
    })
}

/// Reads a picture and makes it small.
fn thumbnail(file: &Path) -> Option<egui::ColorImage> {
    let picture = read_picture(file, ImageFormat::Png, LARGEST);
    let picture = picture.map_err(|error| warn!("{error}")).ok()?;
    let small = picture.thumbnail(THUMBNAIL[0], THUMBNAIL[1]).to_rgba8();
    let size = [small.width() as usize, small.height() as usize];
    Some(egui::ColorImage::from_rgba_unmultiplied(size, small.as_raw()))
}

fn entry(file: PathBuf) -> Entry {
    let picture = match picture_of(&file) {
        Some(picture) => {
            Picture::Coming(AsyncComputeTaskPool::get().spawn(async move { thumbnail(&picture) }))
        }
        None => Picture::None,
    };
    Entry { file, picture }
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    let opened = world.resource::<Opened>().loaded.file.clone();
    // A name alone has no folder.
    let opened = std::path::absolute(&opened).unwrap_or(opened);
    let mut chosen = None;
    world.resource_scope(|_, mut scenes: Mut<Scenes>| {
        let scenes = &mut *scenes;
        if scenes.read.is_none() && scenes.folder.is_empty() {
            let folder = opened.parent().unwrap_or(Path::new("."));
            scenes.folder = folder.to_string_lossy().into_owned();
        }
        ui.horizontal(|ui| {
            ui.label("folder").on_hover_text("Its scenarios and models are listed below");
            ui.add(egui::TextEdit::singleline(&mut scenes.folder).desired_width(f32::INFINITY));
        });
        if scenes.read.as_ref() != Some(&scenes.folder) {
            scenes.entries = list(Path::new(&scenes.folder)).into_iter().map(entry).collect();
            scenes.read = Some(scenes.folder.clone());
        }
        ui.horizontal(|ui| {
            ui.label("path").on_hover_text("Of a scenario or a model to open");
            // The button has to have room behind it.
            let width = (ui.available_width() - 60.0).max(60.0);
            let text = egui::TextEdit::singleline(&mut scenes.path).desired_width(width);
            let text = ui.add(text.hint_text(".ron, .glb or .gltf"));
            let text = text.on_hover_text(".ron, .glb or .gltf; or drop a file on the window");
            let is_entered = text.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
            if (ui.button("Open").clicked() || is_entered) && !scenes.path.trim().is_empty() {
                chosen = Some(PathBuf::from(scenes.path.trim()));
            }
        });
        ui.separator();
        if scenes.entries.is_empty() {
            ui.label("There is no scene in this folder.");
        }
        for entry in &mut scenes.entries {
            let is_open = entry.file == opened;
            if show_entry(ui, entry, is_open) {
                chosen = Some(entry.file.clone());
            }
        }
    });
    if let Some(file) = chosen {
        open(world, &file);
    }
}

/// Whether it was clicked.
fn show_entry(ui: &mut egui::Ui, entry: &mut Entry, is_open: bool) -> bool {
    if let Picture::Coming(task) = &mut entry.picture
        && let Some(image) = check_ready(task)
    {
        entry.picture = image.map_or(Picture::None, |image| {
            let name = entry.file.to_string_lossy();
            Picture::There(ui.ctx().load_texture(name, image, egui::TextureOptions::LINEAR))
        });
    }
    let name = entry.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let button = match &entry.picture {
        Picture::There(texture) => egui::Button::image_and_text(egui::Image::from_texture(texture), name),
        _ => egui::Button::new(name),
    };
    let size = egui::vec2(ui.available_width(), 0.0);
    ui.add(button.selected(is_open).min_size(size).image_tint_follows_text_color(false)).clicked()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenarios_and_models_are_listed_and_effects_are_not() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.ron", "a.GLB", "rain.effect.ron", "notes.txt"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let names: Vec<_> =
            list(folder.path()).iter().map(|path| path.file_name().unwrap().to_owned()).collect();
        assert_eq!(names, ["a.GLB", "b.ron"]);
        assert!(list(&folder.path().join("none")).is_empty());
    }

    #[test]
    fn shipped_scenes_have_pictures() {
        let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios");
        for name in ["hose", "bricks", "drying"] {
            let picture = picture_of(&scenarios.join(name).with_extension("ron")).expect(name);
            let image = thumbnail(&picture).expect(name);
            let [width, height] = image.size;
            assert!(width <= THUMBNAIL[0] as usize && height <= THUMBNAIL[1] as usize && width > 50);
        }
        assert_eq!(picture_of(&scenarios.join("no_such_scene.ron")), None);
    }
}
