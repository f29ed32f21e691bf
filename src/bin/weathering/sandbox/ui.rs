//! Where panels are: a bar above, one of many at the left, the maps at the right, plots below. The scene has the rest.
//!
//! A panel is a function that is given the world; its file registers it ([`AddPanel`]). The panels have a camera of their own
//! that draws over the scene's, so that scenes come and go without them, and pictures can be taken without them.

use std::path::Path;
use std::time::{Duration, Instant};

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{CameraOutputMode, ClearColorConfig};
use bevy::input::InputSystems;
use bevy::prelude::*;
use bevy::render::render_resource::BlendState;
use bevy::window::PrimaryWindow;
use bevy_egui::{
    EguiContext, EguiGlobalSettings, EguiPlugin, EguiPrimaryContextPass, PrimaryEguiContext,
    egui::{self, output::OutputEvent},
};
use bevy_weathering::scenario::ScenarioStatus;

use super::open::{Opened, Opening};
use super::settings::Settings;
use super::shortcuts::Shortcuts;
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

/// What the panels use of mouse and keyboard: but for `pointer`, as of the last frame.
#[derive(Resource, Default)]
pub struct UiInput {
    /// The mouse is over a panel where it is now, or drags something of it: what it does is not done to the scene.
    pub pointer: bool,
    /// Something of the panels is held by the mouse.
    pub drags: bool,
    /// What panels leave of the window, physical pixels, if that is known.
    pub free: Option<Rect>,
    /// How far into that the edges of panels are grabbed, physical pixels.
    pub grab: f32,
    /// The left button was last pressed where panels take it.
    pub took_press: bool,
    /// What lies in front of that, physical pixels: windows, and the line between two scenes.
    pub fronts: Vec<Rect>,
    /// A text is being edited.
    pub keyboard: bool,
    /// A field was entered, and maybe left again.
    pub edited: bool,
    /// A list or the like is open in front, which Escape closes.
    pub popup: bool,
}

impl UiInput {
    /// Whether panels, or what lies in front of the scene, take what the mouse does at a place, physical pixels.
    pub fn takes(&self, at: Vec2) -> bool {
        // A list is closed by a click anywhere.
        self.popup
            || self.free.is_some_and(|free| !free.inflate(-self.grab).contains(at))
            || self.fronts.iter().any(|front| front.contains(at))
    }
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

    /// What there is to read, and whether it went wrong.
    pub fn shown(&self) -> Option<(&str, bool)> {
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
        .add_systems(PreUpdate, judge_pointer.after(InputSystems))
        .add_systems(Update, turn_over)
        .add_systems(EguiPrimaryContextPass, draw);
    // The scene's camera would be taken, which goes with the scene.
    app.world_mut().resource_mut::<EguiGlobalSettings>().auto_create_primary_context = false;
}

/// Whose the mouse is, where it is now: it may have moved since the panels were drawn.
pub fn judge_pointer(
    buttons: Res<ButtonInput<MouseButton>>,
    window: Query<&Window, With<PrimaryWindow>>,
    mut input: ResMut<UiInput>,
) {
    let at = window.single().ok().and_then(Window::physical_cursor_position);
    // What is pressed anew has let go of what it dragged.
    let drags = input.drags && !buttons.just_pressed(MouseButton::Left);
    input.pointer = drags || at.map_or(input.popup, |at| input.takes(at));
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
    let corner = |at: egui::Pos2| Vec2::new(at.x, at.y) * context.pixels_per_point();
    let physical = |rect: egui::Rect| Rect::from_corners(corner(rect.min), corner(rect.max));
    let grab = context.global_style().interaction.resize_grab_radius_side * context.pixels_per_point();
    let mut input = world.resource_mut::<UiInput>();
    input.grab = grab;
    input.free = Some(physical(free));
    input.fronts.clear();
    input.fronts.extend(fronts(&context).map(physical));
    input.popup = context.any_popup_open();
    input.drags = context.egui_is_using_pointer();
    input.edited |= context.output(|output| output.events.iter().any(enters));
    // A number that is clicked becomes a text in the next frame.
    input.keyboard = context.text_edit_focused() || (input.edited && context.egui_wants_keyboard_input());
}

/// What lies in front of the panels and of the scene and takes clicks, points.
fn fronts(context: &egui::Context) -> impl Iterator<Item = egui::Rect> {
    let layers = context.memory(|memory| memory.areas().visible_layer_ids());
    let layers = layers.into_iter().filter(|layer| layer.order != egui::Order::Background);
    let areas = layers.filter_map(move |layer| egui::AreaState::load(context, layer.id));
    areas.filter(|area| area.interactable).map(|area| area.rect())
}

/// Whether a text, or a number, begins to be edited.
fn enters(event: &OutputEvent) -> bool {
    let begins = !matches!(event, OutputEvent::TextSelectionChanged(_) | OutputEvent::ValueChanged(_));
    begins && matches!(event.widget_info().typ, egui::WidgetType::TextEdit | egui::WidgetType::DragValue)
}

/// The panel before the open one, or the one after it.
fn turn_over(keys: Res<Shortcuts>, panels: Res<Panels>, mut settings: ResMut<Settings>) {
    let pressed = |key| isize::from(keys.pressed(key));
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

    /// A window of which panels leave the right part, and in that part something in front.
    fn window() -> World {
        let mut world = World::new();
        world.init_resource::<ButtonInput<MouseButton>>();
        world.insert_resource(UiInput {
            free: Some(Rect::new(300.0, 40.0, 960.0, 540.0)),
            fronts: vec![Rect::new(600.0, 40.0, 610.0, 540.0)],
            ..default()
        });
        let mut window = Window::default();
        window.resolution.set_physical_resolution(960, 540);
        world.spawn((window, PrimaryWindow));
        world
    }

    /// Whose the mouse is where it has come to, before panels are drawn.
    fn is_taken(world: &mut World, x: f64) -> bool {
        let mut windows = world.query::<&mut Window>();
        let at = Some(bevy::math::DVec2::new(x, 100.0));
        windows.single_mut(world).unwrap().set_physical_cursor_position(at);
        world.run_system_cached(judge_pointer).unwrap();
        world.resource::<UiInput>().pointer
    }

    #[test]
    fn the_mouse_is_the_scenes_where_it_is_now() {
        let mut world = window();
        let taken = [400.0, 200.0, 400.0, 605.0, 700.0].map(|x| is_taken(&mut world, x));
        assert_eq!(taken, [false, true, false, true, false]);
        // A list in front is closed by a click anywhere.
        world.resource_mut::<UiInput>().popup = true;
        assert!(is_taken(&mut world, 400.0));
    }

    #[test]
    fn what_is_dragged_from_a_panel_is_dragged_until_the_button_is_pressed_anew() {
        let mut world = window();
        world.resource_mut::<UiInput>().drags = true;
        assert!(is_taken(&mut world, 400.0));
        world.resource_mut::<ButtonInput<MouseButton>>().press(MouseButton::Right);
        assert!(is_taken(&mut world, 400.0));
        world.resource_mut::<ButtonInput<MouseButton>>().press(MouseButton::Left);
        assert!(!is_taken(&mut world, 400.0));
    }

    /// What egui tells of a frame of one field, or number, at the top left, with what is done in it.
    fn told(context: &egui::Context, shows: fn(&mut egui::Ui), events: Vec<egui::Event>) -> [bool; 2] {
        let size = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(400.0, 300.0));
        let input = egui::RawInput { screen_rect: Some(size), events, ..Default::default() };
        let mut told = [false; 2];
        let output = context.run_ui(input, |ui| {
            shows(ui);
            let edited = ui.ctx().output(|output| output.events.iter().any(enters));
            told = [edited, ui.ctx().egui_wants_keyboard_input()];
        });
        output.drop_without_applying_deltas();
        told
    }

    #[test]
    fn texts_and_numbers_that_are_clicked_are_entered_and_buttons_are_not() {
        let click = |pressed| egui::Event::PointerButton {
            pos: egui::pos2(10.0, 9.0),
            button: egui::PointerButton::Primary,
            pressed,
            modifiers: egui::Modifiers::NONE,
        };
        let shows: [(fn(&mut egui::Ui), bool); 3] = [
            (|ui| drop(ui.add(egui::TextEdit::singleline(&mut String::new()))), true),
            (|ui| drop(ui.add(egui::DragValue::new(&mut 1.0))), true),
            (|ui| drop(ui.add(egui::Button::new("button"))), false),
        ];
        for (index, (show, is_entered)) in shows.into_iter().enumerate() {
            let context = egui::Context::default();
            let moved = egui::Event::PointerMoved(egui::pos2(10.0, 9.0));
            assert_eq!(told(&context, show, vec![]), [false; 2], "{index}");
            assert_eq!(told(&context, show, vec![moved]), [false; 2], "{index}");
            // Within one frame.
            assert_eq!(told(&context, show, vec![click(true), click(false)]), [is_entered; 2], "{index}");
        }
    }

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
