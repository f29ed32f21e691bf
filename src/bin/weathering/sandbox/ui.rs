//! Where panels are: a bar above, one of many at the left, the maps at the right, plots below. The scene has the rest.
//!
//! A panel is a function that is given the world; its file registers it ([`AddPanel`]). The panels have a camera of their own
//! that draws over the scene's, so that scenes come and go without them, and pictures can be taken without them.

use std::path::Path;
use std::time::{Duration, Instant};

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{CameraOutputMode, ClearColorConfig};
use bevy::prelude::*;
use bevy::render::render_resource::BlendState;
use bevy_egui::{
    EguiContext, EguiGlobalSettings, EguiPlugin, EguiPrimaryContextPass, PrimaryEguiContext, egui,
};
use bevy_weathering::scenario::ScenarioStatus;

use super::open::{Opened, Opening};
use super::settings::Settings;
use super::{keys, pace, shades, split, theme};

/// Draws a panel.
pub type Show = fn(&mut egui::Ui, &mut World);

/// Where a panel is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// A piece of the bar.
    Bar,
    /// One of those at the left, of which one is open.
    Side,
    /// At the right.
    Maps,
    /// Below.
    Plots,
}

/// All panels, in the order in which they were added.
#[derive(Resource, Default, Clone)]
struct Panels(Vec<(Place, &'static str, Show)>);

/// Adds panels to an app.
pub trait AddPanel {
    /// Adds one behind the others of its place.
    fn add_panel(&mut self, place: Place, title: &'static str, show: Show) -> &mut Self;
}

impl AddPanel for App {
    fn add_panel(&mut self, place: Place, title: &'static str, show: Show) -> &mut Self {
        self.init_resource::<Panels>();
        self.world_mut().resource_mut::<Panels>().0.push((place, title, show));
        self
    }
}

/// What the panels use of mouse and keyboard, as of the last frame.
#[derive(Resource, Default)]
pub struct UiInput {
    /// The pointer is over a panel, or drags something of it.
    pub pointer: bool,
    /// What panels leave of the window, physical pixels, if that is known. The pointer may have come out of it since.
    pub free: Option<Rect>,
    /// A text is being edited.
    pub keyboard: bool,
    /// A list or the like is open in front, which Escape closes.
    pub popup: bool,
}

/// The help is open.
#[derive(Resource, Default)]
pub struct Help(pub bool);

/// The camera of the panels.
#[derive(Component)]
pub struct UiCamera;

/// What was done last, or went wrong, to be read for some seconds.
#[derive(Resource, Default)]
pub struct Note(Option<(String, bool, Instant)>);

impl Note {
    /// Something was done.
    pub fn tell(&mut self, text: impl Into<String>) {
        let text = text.into();
        info!("{text}");
        self.0 = Some((text, false, Instant::now()));
    }

    /// Something went wrong.
    pub fn complain(&mut self, text: impl Into<String>) {
        let text = text.into();
        error!("{text}");
        self.0 = Some((text, true, Instant::now()));
    }

    /// What there is to read.
    fn shown(&self) -> Option<(&str, bool)> {
        let (text, is_wrong, since) = self.0.as_ref()?;
        let seconds = if *is_wrong { 15 } else { 5 };
        (since.elapsed() < Duration::from_secs(seconds)).then_some((text.as_str(), *is_wrong))
    }
}

/// A run condition: the keyboard is not in use by a panel.
pub fn keyboard_is_free(input: Res<UiInput>) -> bool {
    !input.keyboard
}

pub fn plugin(app: &mut App) {
    app.add_plugins(EguiPlugin::default())
        .init_resource::<Panels>()
        .init_resource::<UiInput>()
        .init_resource::<Help>()
        .init_resource::<Note>()
        .add_systems(Startup, spawn_camera)
        .add_systems(Update, turn_over.run_if(keyboard_is_free))
        .add_systems(EguiPrimaryContextPass, draw);
    // The scene's camera would be taken, which goes with the scene.
    app.world_mut().resource_mut::<EguiGlobalSettings>().auto_create_primary_context = false;
}

fn spawn_camera(mut commands: Commands) {
    commands.spawn((
        Name::new("panels"),
        UiCamera,
        PrimaryEguiContext,
        Camera2d,
        Msaa::Off,
        // Nothing of the scene, its gizmos included.
        RenderLayers::none(),
        Camera {
            order: 10,
            // What egui draws is premultiplied.
            output_mode: CameraOutputMode::Write {
                blend_state: Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                clear_color: ClearColorConfig::None,
            },
            clear_color: ClearColorConfig::Custom(Color::NONE),
            ..default()
        },
    ));
}

fn draw(world: &mut World, mut is_dressed: Local<bool>) {
    let mut contexts = world.query_filtered::<&mut EguiContext, With<PrimaryEguiContext>>();
    let Ok(mut context) = contexts.single_mut(world) else { return };
    let context = context.get_mut().clone();
    let Settings { zoom, panels, maps, plots, .. } = *world.resource::<Settings>();
    let is_first = !std::mem::replace(&mut *is_dressed, true);
    if is_first {
        theme::apply(&context);
    }
    if (context.zoom_factor() - zoom).abs() > 1e-3 {
        context.set_zoom_factor(zoom);
        // From the next frame on. Panels would keep the width that they get now.
        if is_first {
            return;
        }
    }
    let whole =
        egui::UiBuilder::new().layer_id(egui::LayerId::background()).max_rect(context.viewport_rect());
    let mut root = egui::Ui::new(context.clone(), "sandbox".into(), whole);
    if panels {
        let all = world.resource::<Panels>().clone();
        let of = |place: Place| all.0.iter().filter(move |(other, ..)| *other == place).copied();
        egui::Panel::top("bar").show(&mut root, |ui| {
            ui.horizontal_wrapped(|ui| {
                for (_, title, show) in of(Place::Bar) {
                    ui.push_id(title, |ui| show(ui, world));
                    ui.separator();
                }
                layout_buttons(ui, world);
                pace::show_load(ui, world);
            });
        });
        let side: Vec<_> = of(Place::Side).collect();
        // Half of the window, where that is narrow, is the scene's.
        let width = (0.45 * context.viewport_rect().width()).clamp(230.0, 340.0);
        let left = egui::Panel::left("side").resizable(true).default_size(width).size_range(230.0..=520.0);
        left.show(&mut root, |ui| show_side(ui, world, &side));
        if maps {
            let right = egui::Panel::right("maps").resizable(true).default_size(280.0);
            right.size_range(200.0..=520.0).show(&mut root, |ui| {
                egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    of(Place::Maps).for_each(|(_, _, show)| show(ui, world));
                });
            });
        }
        if plots {
            let below = egui::Panel::bottom("plots").resizable(true).default_size(190.0);
            below.size_range(100.0..=420.0).show(&mut root, |ui| {
                of(Place::Plots).for_each(|(_, _, show)| show(ui, world));
            });
        }
    }
    let free = root.available_rect_before_wrap();
    split::show_divider(&context, free, world);
    show_note(&context, free, world.resource::<Note>());
    shades::show_key(&context, free, world);
    let is_loading = matches!(*world.resource::<ScenarioStatus>(), ScenarioStatus::Loading);
    if let Some(file) = world.resource::<Opening>().file() {
        show_opening(&context, free, "opening", file);
    } else if is_loading {
        show_opening(&context, free, "loading", &world.resource::<Opened>().loaded.file);
    }
    let mut help = world.resource::<Help>().0;
    if help {
        keys::show_help(&context, &mut help);
        world.resource_mut::<Help>().0 = help;
    }
    let outside = context.pointer_latest_pos().is_some_and(|at| !free.contains(at));
    let corner = |at: egui::Pos2| Vec2::new(at.x, at.y) * context.pixels_per_point();
    let mut input = world.resource_mut::<UiInput>();
    input.free = Some(Rect::from_corners(corner(free.min), corner(free.max)));
    input.popup = context.any_popup_open();
    input.pointer =
        outside || context.egui_is_using_pointer() || input.popup || context.is_pointer_over_egui();
    input.keyboard = context.text_edit_focused();
}

/// The panel before the open one, or the one after it.
fn turn_over(keys: Res<ButtonInput<KeyCode>>, panels: Res<Panels>, mut settings: ResMut<Settings>) {
    let pressed = |key| isize::from(keys.just_pressed(key));
    let steps = pressed(KeyCode::PageDown) - pressed(KeyCode::PageUp);
    if steps != 0 {
        let sides = panels.0.iter().filter(|(place, ..)| *place == Place::Side);
        let titles: Vec<&str> = sides.map(|(_, title, _)| *title).collect();
        settings.panel = beside(&titles, &settings.panel, steps).to_owned();
    }
}

/// The title so many steps behind another; before the first comes the last.
fn beside<'a>(titles: &[&'a str], open: &str, steps: isize) -> &'a str {
    let now = titles.iter().position(|title| *title == open).unwrap_or(0) as isize;
    let next = (now + steps).checked_rem_euclid(titles.len() as isize).unwrap_or(0);
    titles.get(next as usize).copied().unwrap_or_default()
}

/// The tabs at the left, and the open one.
fn show_side(ui: &mut egui::Ui, world: &mut World, side: &[(Place, &'static str, Show)]) {
    let mut open = world.resource::<Settings>().panel.clone();
    if !side.iter().any(|(_, title, _)| *title == open) {
        open = side.first().map(|(_, title, _)| (*title).to_owned()).unwrap_or_default();
    }
    ui.horizontal_wrapped(|ui| {
        for (_, title, _) in side {
            ui.selectable_value(&mut open, (*title).to_owned(), *title);
        }
    });
    ui.separator();
    if let Some((_, title, show)) = side.iter().find(|(_, title, _)| *title == open) {
        let area = egui::ScrollArea::vertical().id_salt(*title).auto_shrink(false);
        area.show(ui, |ui| show(ui, world));
    }
    if world.resource::<Settings>().panel != open {
        world.resource_mut::<Settings>().panel = open;
    }
}

/// What of the panels is shown, and how large.
fn layout_buttons(ui: &mut egui::Ui, world: &mut World) {
    let mut settings = world.resource_mut::<Settings>();
    ui.toggle_value(&mut settings.maps, "Maps").on_hover_text("The maps of the selected surface (M)");
    ui.toggle_value(&mut settings.plots, "Plots").on_hover_text("What happens, over time (P)");
    let (least, most) = theme::ZOOM;
    if ui.small_button("A-").on_hover_text("Smaller text and panels").clicked() {
        settings.zoom = (settings.zoom - 0.1).max(least);
    }
    if ui.small_button("A+").on_hover_text("Larger text and panels").clicked() {
        settings.zoom = (settings.zoom + 0.1).min(most);
    }
    let mut help = world.resource_mut::<Help>();
    ui.toggle_value(&mut help.0, "?").on_hover_text("All keys (? or F1)");
}

/// That a scene is on its way, in the middle of the one before, or that there is more of it to come.
fn show_opening(context: &egui::Context, free: egui::Rect, what: &str, file: &Path) {
    let area = egui::Area::new("opening".into()).interactable(false).order(egui::Order::Foreground);
    let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    area.fixed_pos(free.center()).pivot(egui::Align2::CENTER_CENTER).show(context, |ui| {
        egui::Frame::popup(ui.style()).show(ui, |ui| {
            ui.horizontal(|ui| {
                ui.spinner();
                ui.label(format!("{what} {name}"));
            });
        });
    });
}

/// What was done last, below in the scene.
fn show_note(context: &egui::Context, free: egui::Rect, note: &Note) {
    let Some((text, is_wrong)) = note.shown() else { return };
    let area = egui::Area::new("note".into()).interactable(false).order(egui::Order::Foreground);
    let place = free.left_bottom() + egui::vec2(12.0, -12.0);
    area.fixed_pos(place).pivot(egui::Align2::LEFT_BOTTOM).show(context, |ui| {
        egui::Frame::popup(ui.style()).show(ui, |ui| {
            ui.set_max_width((free.width() - 40.0).max(120.0));
            if is_wrong {
                ui.colored_label(theme::WARNING, text);
            } else {
                ui.label(text);
            }
        });
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_are_turned_over_in_a_ring() {
        let titles = ["Scenes", "Hose", "Files"];
        assert_eq!(
            ["Scenes", "Hose", "Files"].map(|open| beside(&titles, open, 1)),
            ["Hose", "Files", "Scenes"]
        );
        assert_eq!(
            ["Scenes", "Hose", "Files"].map(|open| beside(&titles, open, -1)),
            ["Files", "Scenes", "Hose"]
        );
        // One of another version, and none at all.
        assert_eq!((beside(&titles, "Gone", 1), beside(&[], "Scenes", 1)), ("Hose", ""));
    }
}
