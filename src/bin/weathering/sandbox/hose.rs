//! Tools in the hand, and the hose: while the left button is held, an emitter at the camera points at the cursor.

use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_egui::egui;
use bevy_weathering::collision::CollisionScene;
use bevy_weathering::effect::WeatherEffect;
use bevy_weathering::emitter::Emitter;
use bevy_weathering::particle::Forces;
use bevy_weathering::record::{ExtraEmitter, Recording};
use bevy_weathering::scenario::{EmitterKey, EmitterSpec};

use super::aim::Flight;
use super::camera::View;
use super::settings::{HoseSettings, Settings, Tool};
use super::shots::Sequence;
use super::split::Split;
use super::ui::{AddPanel, Place, UiCamera, UiInput};
use super::widgets::number;
use super::{effects, probe, shortcuts};

/// Number of its random stream: behind those of any scenario.
const STREAM: u32 = u32::MAX;

/// What it is called.
const NAME: &str = "hose in the hand";

/// The emitter in the hand. Spawned with the first press after it has gone, so that a scene without it is as it was loaded.
#[derive(Component)]
pub struct InHand;

/// The left button is held in the scene, and the ray below the cursor.
#[derive(Resource, Default)]
pub struct Pointed {
    /// It was pressed in the scene, and is held.
    pub held: bool,
    /// It was pressed in this frame.
    pub pressed: bool,
    /// From the eye.
    pub ray: Option<Ray3d>,
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Pointed>()
        // Once it is known whose the mouse is, and then the keys.
        .add_systems(PreUpdate, point.after(shortcuts::listen))
        .add_systems(Update, spray)
        .add_panel(Place::Bar, "tools", show_tools)
        .add_panel(Place::Side, "Hose", show);
}

fn point(
    buttons: Res<ButtonInput<MouseButton>>,
    input: Res<UiInput>,
    window: Query<&Window, With<PrimaryWindow>>,
    cameras: Query<(&Camera, &GlobalTransform), With<View>>,
    panels: Query<&Camera, (With<UiCamera>, Without<View>)>,
    (sequence, settings): (Res<Sequence>, Res<Settings>),
    mut pointed: ResMut<Pointed>,
) {
    pointed.pressed = buttons.just_pressed(MouseButton::Left) && !input.took_press;
    // A click within one slow frame is seen pressed and let go of, and counts for that frame.
    pointed.held = pointed.pressed || (pointed.held && buttons.pressed(MouseButton::Left));
    // A picture without panels was drawn in other parts than the window is: what is pointed at is where it was before.
    if panels.iter().any(|camera| !camera.is_active) && !sequence.fills(&settings) {
        return;
    }
    let cursor = window.single().ok().and_then(Window::cursor_position);
    pointed.ray = cursor.zip(cameras.iter().next()).and_then(|(cursor, (camera, transform))| {
        // The part of the window that is another camera's is not pointed at.
        if !camera.logical_viewport_rect().is_some_and(|rect| rect.contains(cursor)) {
            return None;
        }
        // The eye and not the near plane: what is close is hit, too.
        let ray = camera.viewport_to_world(transform, cursor).ok()?;
        Some(Ray3d { origin: transform.translation(), direction: ray.direction })
    });
}

/// Opens and closes the hose.
fn spray(
    pointed: Res<Pointed>,
    settings: Res<Settings>,
    recording: Option<Res<Recording>>,
    scene: Res<CollisionScene>,
    split: Option<Res<Split>>,
    known: (Res<Assets<WeatherEffect>>, Res<Forces>),
    mut commands: Commands,
    mut hoses: Query<(&mut Emitter, &mut Transform, &mut GlobalTransform), With<InHand>>,
    mut was_open: Local<bool>,
) {
    let is_open = pointed.held && settings.tool == Tool::Hose;
    let ray = pointed.ray.filter(|_| is_open);
    let is_let_go = std::mem::replace(&mut *was_open, is_open) && !is_open;
    // What was recorded is not interfered with while it runs again.
    if !is_open && !is_let_go && recording.is_some_and(|recording| !recording.is_at_end()) {
        return;
    }
    let Ok((mut emitter, mut transform, mut global)) = hoses.single_mut() else {
        if let Some(ray) = ray {
            commands.queue(move |world: &mut World| take(world, ray));
        }
        return;
    };
    if emitter.enabled != is_open {
        emitter.enabled = is_open;
    }
    if let Some(ray) = ray {
        let (effects, forces) = known;
        let flight = Flight::new(&emitter, effects.get(&emitter.effect), &forces);
        let aim = aimed_at(ray, &scene, split.as_deref(), flight);
        *transform = aim;
        // Ticks come before transforms are propagated.
        *global = GlobalTransform::from(aim);
    }
}

/// At the right hand, below the eye, pointing at what is on the ray some metres away.
pub fn aimed(ray: Ray3d) -> Transform {
    let eye = Transform::from_translation(ray.origin).looking_to(ray.direction, Vec3::Y);
    let hand = ray.origin + eye.right() * 0.12 - eye.up() * 0.1;
    eye.with_translation(hand).looking_at(ray.origin + ray.direction * 4.0, Vec3::Y)
}

/// The same, pointing so that what flies like this comes down at what the ray hits; straight ahead where it hits nothing.
fn aimed_at(ray: Ray3d, scene: &CollisionScene, split: Option<&Split>, flight: Flight) -> Transform {
    let straight = aimed(ray);
    match probe::hit(scene, split, ray) {
        Some(hit) => straight.looking_to(flight.aim(straight.translation, hit.point), Vec3::Y),
        None => straight,
    }
}

/// The hose as an emitter of a recorded scenario; off.
pub fn to_record(settings: &HoseSettings) -> Option<ExtraEmitter> {
    let mut emitter = Emitter { lifetime: 6.0, ..default() };
    set(&mut emitter, settings);
    let spec = EmitterSpec {
        name: NAME.into(),
        effect: String::new(),
        rate: emitter.rate,
        shape: emitter.shape,
        flow: emitter.flow,
        speed: Some(emitter.speed),
        spread_deg: settings.spread_deg,
        lifetime: emitter.lifetime,
        start: 0.0,
        stop: None,
        // Anywhere: it is moved to where it is opened.
        keys: vec![EmitterKey { t: 0.0, position: Vec3::Y, target: Vec3::ZERO }],
    };
    Some(ExtraEmitter { spec, effect: effects::text(&settings.effect)?.into(), is_on: false })
}

/// A hose as the settings have it.
fn take(world: &mut World, ray: Ray3d) {
    let settings = world.resource::<Settings>().hose.clone();
    let Some(effect) = effects::shipped(world, &settings.effect) else { return };
    let mut emitter = Emitter { stream: STREAM, lifetime: 6.0, ..default() };
    set(&mut emitter, &settings);
    emitter.effect = effect;
    let effect = world.resource::<Assets<WeatherEffect>>().get(&emitter.effect);
    let flight = Flight::new(&emitter, effect, world.resource::<Forces>());
    let aim = aimed_at(ray, world.resource::<CollisionScene>(), world.get_resource::<Split>(), flight);
    world.spawn((Name::new(NAME), InHand, emitter, aim, GlobalTransform::from(aim)));
}

/// Makes an emitter the hose of these settings, but for its effect.
fn set(emitter: &mut Emitter, settings: &HoseSettings) {
    let effect = emitter.effect.clone();
    let hose = Emitter::hose(effect, settings.litres_per_minute, settings.nozzle_mm * 1e-3);
    *emitter = Emitter {
        rate: settings.rate,
        spread: settings.spread_deg.to_radians(),
        stream: emitter.stream,
        lifetime: emitter.lifetime,
        enabled: emitter.enabled,
        ..hose
    };
}

fn show_tools(ui: &mut egui::Ui, world: &mut World) {
    let mut settings = world.resource_mut::<Settings>();
    ui.selectable_value(&mut settings.tool, Tool::Hose, "Hose").on_hover_text("Left button: spray (H)");
    ui.selectable_value(&mut settings.tool, Tool::Probe, "Probe")
        .on_hover_text("Left button: how wet it is (I)");
    let is_brush = settings.tool.brush().is_some();
    let about = "Left button: paint; wet, dry, dirty or clean (1 to 4)";
    if ui.selectable_label(is_brush, "Brush").on_hover_text(about).clicked() {
        if !is_brush {
            settings.tool = Tool::Wet;
        }
        // Which of them, how large and how strong.
        settings.panel = "Brushes".into();
    }
    ui.separator();
    for (flies, name, about) in [
        (false, "Orbit", "Right button: turn around what is looked at (C)"),
        (true, "Fly", "Right button: look around; W A S D Q E fly (C)"),
    ] {
        ui.selectable_value(&mut settings.flies, flies, name).on_hover_text(about);
    }
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    let before = world.resource::<Settings>().hose.clone();
    let mut hose = before.clone();
    ui.label("Hold the left button in the scene.");
    let is_recording = world.contains_resource::<Recording>();
    // A recorded emitter keeps its effect.
    ui.add_enabled_ui(!is_recording, |ui| {
        egui::ComboBox::from_label("sprays").selected_text(hose.effect.as_str()).show_ui(ui, |ui| {
            for name in effects::names() {
                ui.selectable_value(&mut hose.effect, name.to_owned(), name);
            }
        });
    });
    let [flow, nozzle, spread, rate] = HoseSettings::RANGES;
    number(ui, "flow, l/min", &mut hose.litres_per_minute, flow, "A garden hose has 15");
    number(ui, "nozzle, mm", &mut hose.nozzle_mm, nozzle, "Its diameter");
    number(ui, "spread, degrees", &mut hose.spread_deg, spread, "Half-angle at the rim");
    number(ui, "particles/s", &mut hose.rate, rate, "Each a slug of water; the fewer, the larger");
    let speed = bevy_weathering::emitter::nozzle_speed(hose.litres_per_minute, hose.nozzle_mm * 0.5e-3);
    ui.label(format!("leaves the nozzle at {speed:.1} m/s"));
    if hose == before {
        return;
    }
    let effect = effects::shipped(world, &hose.effect);
    let mut hoses = world.query_filtered::<&mut Emitter, With<InHand>>();
    for mut emitter in hoses.iter_mut(world) {
        set(&mut emitter, &hose);
        if let (Some(effect), false) = (&effect, is_recording) {
            emitter.effect = effect.clone();
        }
    }
    world.resource_mut::<Settings>().hose = hose;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hose_points_at_what_is_below_the_cursor() {
        for direction in [Vec3::new(0.3, -0.2, -1.0), Vec3::NEG_Y, Vec3::Y] {
            let ray = Ray3d { origin: Vec3::new(1.0, 2.0, 3.0), direction: Dir3::new(direction).unwrap() };
            let aim = aimed(ray);
            assert!(aim.is_finite() && (aim.translation - ray.origin).length() < 0.2, "{direction}");
            let target = ray.origin + ray.direction * 4.0;
            let along = (target - aim.translation).normalize();
            assert!(aim.forward().dot(along) > 0.9999, "{direction}");
        }
    }

    #[test]
    fn a_press_counts_however_long_the_frame_is_in_which_it_ends() {
        let mut world = World::new();
        world.init_resource::<Pointed>();
        world.init_resource::<UiInput>();
        world.init_resource::<ButtonInput<MouseButton>>();
        world.init_resource::<Sequence>();
        world.init_resource::<Settings>();
        let mut schedule = Schedule::default();
        schedule.add_systems(point);
        // Of a frame: whether the pointer is over a panel, and what the button does.
        let mut is_held = |over_panel: bool, edit: fn(&mut ButtonInput<MouseButton>)| {
            world.resource_mut::<UiInput>().took_press = over_panel;
            let mut buttons = world.resource_mut::<ButtonInput<MouseButton>>();
            buttons.clear();
            edit(&mut buttons);
            schedule.run(&mut world);
            world.resource::<Pointed>().held
        };
        let click = |buttons: &mut ButtonInput<MouseButton>| {
            buttons.press(MouseButton::Left);
            buttons.release(MouseButton::Left);
        };
        assert!(is_held(false, click));
        assert!(!is_held(false, |_| {}));
        assert!(is_held(false, |buttons| buttons.press(MouseButton::Left)));
        // What begins in the scene goes on over a panel, and not the other way round.
        assert!(is_held(true, |_| {}));
        assert!(!is_held(true, |buttons| buttons.release(MouseButton::Left)));
        assert!(is_held(false, click));
        assert!(!is_held(true, click));
        assert!(!is_held(true, |buttons| buttons.press(MouseButton::Left)));
        assert!(!is_held(false, |_| {}));
    }

    #[test]
    fn settings_change_the_hose_and_not_whose_it_is() {
        let mut emitter = Emitter { stream: 7, enabled: false, lifetime: 6.0, ..default() };
        let settings = HoseSettings { litres_per_minute: 15.0, nozzle_mm: 6.0, rate: 50.0, ..default() };
        set(&mut emitter, &settings);
        assert_eq!((emitter.stream, emitter.enabled, emitter.lifetime, emitter.rate), (7, false, 6.0, 50.0));
        assert!((emitter.speed - 8.84).abs() < 0.01, "{}", emitter.speed);
    }
}
