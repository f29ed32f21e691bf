//! The weather: temperature, humidity, wind and sun; and rain over the whole scene, whatever the scenario has.
//!
//! While a session is recorded the rain is an emitter of its scenario, and the sliders follow that one: time may go back.

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::collision::CollisionScene;
use bevy_weathering::emitter::{Emitter, EmitterShape, Flow};
use bevy_weathering::record::{ExtraEmitter, Recording};
use bevy_weathering::scenario::{EmitterKey, EmitterSpec};
use bevy_weathering::weather::{DryingClock, Weather};

use super::effects;
use super::split::{self, CopyOf, Split};
use super::ui::{AddPanel, Place};
use super::widgets::number;

/// Rain or snow that the user has switched on.
#[derive(Component)]
pub struct OwnRain;

/// What it is called.
const NAME: &str = "rain over the scene";

/// Number of its random stream.
const STREAM: u32 = u32::MAX - 1;

/// Where the wind was set to go to, degrees, for as long as there is none along the ground: a wind of 0 has no direction.
#[derive(Resource, Default)]
struct Vane(f32);

impl Vane {
    fn heading_deg(&self, wind: Vec3) -> f32 {
        if wind.x == 0.0 && wind.z == 0.0 { self.0 } else { wind.x.atan2(-wind.z).to_degrees() }
    }
}

/// How much falls, and what.
#[derive(Resource, Debug, Clone, PartialEq)]
struct Rain {
    mm_per_h: f32,
    effect: String,
    rate: f32,
}

impl Default for Rain {
    fn default() -> Self {
        Self { mm_per_h: 0.0, effect: "rain".into(), rate: 2000.0 }
    }
}

impl Rain {
    /// How much falls, mm/h, and particles a second.
    fn amount(&self) -> [f32; 2] {
        [self.mm_per_h, self.rate]
    }
}

/// The rain of a recording, as it was when the sliders were last set to it.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
struct Followed {
    /// At the start, before the events of the first tick.
    first: Option<[f32; 2]>,
    seen: Option<[f32; 2]>,
}

impl Followed {
    /// What the sliders are to be set to, if events have made another rain since. `shown`: by the sliders now; `tick`: the last one
    /// that has run.
    fn look(&mut self, shown: [f32; 2], tick: u32, cloud: &Emitter) -> Option<[f32; 2]> {
        let first = *self.first.get_or_insert(shown);
        let now = match cloud.flow {
            _ if tick == 0 => first,
            _ if !cloud.enabled => [0.0, cloud.rate],
            Flow::MmPerHour(mm_per_h) => [mm_per_h, cloud.rate],
            _ => [shown[0], cloud.rate],
        };
        (self.seen.replace(now) != Some(now)).then_some(now)
    }
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Rain>()
        .init_resource::<Vane>()
        .add_systems(Update, (follow_scene, follow_recording))
        .add_panel(Place::Side, "Weather", show);
}

fn show(ui: &mut egui::Ui, world: &mut World) {
    show_rain(ui, world);
    let before = *world.resource::<Weather>();
    let mut weather = before;
    ui.heading("Air");
    number(ui, "temperature, °C", &mut weather.temperature_c, (-40.0, 60.0), "T; below 0 nothing dries");
    number(ui, "humidity", &mut weather.humidity, (0.0, 1.0), "RH, relative humidity; at 1 nothing dries");
    let mut speed = Vec2::new(weather.wind.x, weather.wind.z).length();
    let mut heading_deg = world.resource::<Vane>().heading_deg(weather.wind);
    let mut up = weather.wind.y;
    let (speed_before, heading_before, up_before) = (speed, heading_deg, up);
    number(ui, "wind, m/s", &mut speed, (0.0, 40.0), "Moves particles and carries vapour away");
    number(ui, "towards, degrees", &mut heading_deg, (-180.0, 180.0), "0 is -z, 90 is +x");
    number(ui, "upwards, m/s", &mut up, (-20.0, 20.0), "");
    if (speed, heading_deg, up) != (speed_before, heading_before, up_before) {
        weather.wind = wind(speed, heading_deg, up);
        world.resource_mut::<Vane>().0 = heading_deg;
    }
    ui.heading("Sun");
    number(
        ui,
        "power, W/m²",
        &mut weather.sun_w_per_m2,
        (0.0, 1400.0),
        "On what faces it; dries, and does not light",
    );
    let towards = (-weather.sun_direction).normalize_or(Vec3::Y);
    let mut height_deg = towards.y.clamp(-1.0, 1.0).asin().to_degrees();
    let mut around_deg = towards.x.atan2(-towards.z).to_degrees();
    let angles = (height_deg, around_deg);
    // A recording keeps the sun where it is.
    ui.add_enabled_ui(!world.contains_resource::<Recording>(), |ui| {
        number(ui, "height, degrees", &mut height_deg, (1.0, 89.0), "Above the horizon");
        number(ui, "direction, degrees", &mut around_deg, (-180.0, 180.0), "0 is -z, 90 is +x");
    });
    let moved = (height_deg, around_deg) != angles;
    if moved {
        weather.sun_direction = -towards_sun(height_deg, around_deg);
    }
    show_light(ui, world, moved.then_some(weather.sun_direction));
    ui.heading("Drying");
    number(ui, "times as fast", &mut weather.drying_speed, (0.0, 100_000.0), "It takes hours in the world");
    let demand = weather.demand_mm_per_h();
    ui.label(format!("a wet surface loses {:.2} mm/h, {:.2} more in the sun", demand.air_mm, demand.sun_mm));
    // The first is the weather at the start.
    match world.resource::<DryingClock>().points().len().saturating_sub(1) {
        0 => {}
        1 => {
            ui.small("the weather has changed once so far");
        }
        changes => {
            ui.small(format!("the weather has changed {changes} times so far"));
        }
    }
    if weather != before {
        *world.resource_mut::<Weather>() = weather;
    }
}

/// From speed along the ground, m/s, where it goes to, degrees, and speed upwards, m/s.
fn wind(speed: f32, heading_deg: f32, up: f32) -> Vec3 {
    let (sin, cos) = heading_deg.to_radians().sin_cos();
    Vec3::new(sin * speed, up, -cos * speed)
}

/// From height above the horizon and direction, degrees.
fn towards_sun(height_deg: f32, around_deg: f32) -> Vec3 {
    let (sin, cos) = height_deg.to_radians().sin_cos();
    let (east, north) = around_deg.to_radians().sin_cos();
    Vec3::new(east * cos, sin, -north * cos)
}

/// The light of the sun, which follows where it shines to.
fn show_light(ui: &mut egui::Ui, world: &mut World, direction: Option<Vec3>) {
    let mut lights = world.query::<(&mut DirectionalLight, &mut Transform)>();
    let Some((mut light, mut transform)) = lights.iter_mut(world).next() else { return };
    let mut lux = light.illuminance;
    number(ui, "light, lux", &mut lux, (0.0, 130_000.0), "How bright it shows the scene; does not dry");
    if lux != light.illuminance {
        light.illuminance = lux;
    }
    if let Some(direction) = direction {
        *transform = transform.looking_to(direction, Vec3::Y);
    }
}

fn show_rain(ui: &mut egui::Ui, world: &mut World) {
    let before = world.resource::<Rain>().clone();
    let mut rain = before.clone();
    ui.heading("Rain over the scene");
    number(ui, "rain, mm/h", &mut rain.mm_per_h, (0.0, 200.0), "0 is none; 10 is strong, 50 a cloudburst");
    let is_recording = world.contains_resource::<Recording>();
    ui.add_enabled_ui(!is_recording, |ui| {
        egui::ComboBox::from_label("falls").selected_text(rain.effect.as_str()).show_ui(ui, |ui| {
            for name in ["rain", "drizzle", "snow", "dust"] {
                ui.selectable_value(&mut rain.effect, name.to_owned(), name);
            }
        });
    });
    number(ui, "particles/s", &mut rain.rate, (10.0, 50_000.0), "Each stands for the drops of a patch");
    if rain == before {
        return;
    }
    *world.resource_mut::<Rain>() = rain.clone();
    let mut emitters = world.query_filtered::<Entity, (With<OwnRain>, Without<CopyOf>)>();
    let clouds: Vec<Entity> = emitters.iter(world).collect();
    if is_recording {
        // It is the scenario's, and stays there when it is off.
        if let Some(mut cloud) = clouds.first().and_then(|&cloud| world.get_mut::<Emitter>(cloud)) {
            cloud.enabled = rain.mm_per_h > 0.0;
            cloud.rate = rain.rate;
            if cloud.enabled {
                cloud.flow = Flow::MmPerHour(rain.mm_per_h);
            }
        }
        return;
    }
    if rain.mm_per_h <= 0.0 {
        clouds.into_iter().for_each(|cloud| {
            world.despawn(cloud);
        });
        return;
    }
    let scene = world.resource::<CollisionScene>();
    let (low, high) = split::bounds(world.get_resource::<Split>(), scene);
    let Some((half_size, place)) = above(low, high) else { return };
    let Some(effect) = effects::shipped(world, &rain.effect) else { return };
    let emitter = Emitter {
        effect,
        rate: rain.rate,
        shape: EmitterShape::Sky { half_size },
        flow: Flow::MmPerHour(rain.mm_per_h),
        speed: 0.0,
        lifetime: 60.0,
        stream: STREAM,
        ..default()
    };
    if let Some(&cloud) = clouds.first() {
        if let Some(mut there) = world.get_mut::<Emitter>(cloud) {
            *there = emitter;
        }
        return;
    }
    let transform = Transform::from_translation(place);
    world.spawn((Name::new(NAME), OwnRain, emitter, transform));
}

/// The rain as an emitter of a recorded scenario; `None` over a scene without a size.
pub fn to_record(world: &World) -> Option<ExtraEmitter> {
    let rain = world.resource::<Rain>();
    let (low, high) = world.resource::<CollisionScene>().bounds();
    let (half_size, position) = above(low, high)?;
    let is_on = rain.mm_per_h > 0.0;
    let spec = EmitterSpec {
        name: NAME.into(),
        effect: String::new(),
        rate: rain.rate,
        shape: EmitterShape::Sky { half_size },
        flow: Flow::MmPerHour(if is_on { rain.mm_per_h } else { 10.0 }),
        speed: Some(0.0),
        spread_deg: 0.0,
        lifetime: 60.0,
        start: 0.0,
        stop: None,
        keys: vec![EmitterKey { t: 0.0, position, target: position - Vec3::Y }],
    };
    Some(ExtraEmitter { spec, effect: effects::text(&rain.effect)?.into(), is_on })
}

/// Sets the sliders to what a recording has made of the rain: time has gone back, or what was recorded runs again.
fn follow_recording(
    recording: Option<Res<Recording>>,
    clock: Res<WeatheringClock>,
    clouds: Query<&Emitter, (With<OwnRain>, Without<CopyOf>)>,
    mut rain: ResMut<Rain>,
    mut followed: Local<Followed>,
) {
    if recording.is_none() {
        *followed = Followed::default();
        return;
    }
    let Some(cloud) = clouds.iter().next() else { return };
    if let Some([mm_per_h, rate]) = followed.look(rain.amount(), clock.tick(), cloud) {
        (rain.mm_per_h, rain.rate) = (mm_per_h, rate);
    }
}

/// The rain of a recording that has ended is an emitter of the scene like others: the sliders are about none.
pub fn let_go(world: &mut World) {
    world.resource_mut::<Rain>().mm_per_h = 0.0;
}

/// The rain falls on all of the scene, also when another is opened, or when it grows.
fn follow_scene(
    scene: Res<CollisionScene>,
    split: Option<Res<Split>>,
    recording: Option<Res<Recording>>,
    mut clouds: Query<(&mut Emitter, &mut Transform), (With<OwnRain>, Without<CopyOf>)>,
) {
    // In a recording it would be somebody's doing, and in what has been recorded already a branch.
    if !scene.is_changed() || scene.is_empty() || recording.is_some() {
        return;
    }
    let (low, high) = split::bounds(split.as_deref(), &scene);
    let Some((half_size, place)) = above(low, high) else { return };
    for (mut emitter, mut transform) in &mut clouds {
        let EmitterShape::Sky { half_size: now } = emitter.shape else { continue };
        if is_elsewhere((now, transform.translation), (half_size, place)) {
            emitter.shape = EmitterShape::Sky { half_size };
            transform.translation = place;
        }
    }
}

/// Whether a rectangle is another by more than one sees.
fn is_elsewhere((size, place): (Vec2, Vec3), (other_size, other): (Vec2, Vec3)) -> bool {
    let least = 0.02 * size.max_element();
    (size - other_size).abs().max_element() > least || place.distance(other) > least
}

/// Half the size of a rectangle over a box, with some to spare, and where it is.
fn above(low: Vec3, high: Vec3) -> Option<(Vec2, Vec3)> {
    let size = high - low;
    let spare = 0.1 * size.max_element();
    let half_size = Vec2::new(size.x, size.z) * 0.5 + spare;
    let middle = (low + high) * 0.5;
    let is_there = size.is_finite() && size.min_element() >= 0.0;
    is_there.then(|| (half_size, middle.with_y(high.y + 1.0 + spare)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_directions_belong_together() {
        for (height, around) in [(10.0, -170.0), (45.0, 0.0), (80.0, 90.0)] {
            let towards = towards_sun(height, around);
            assert!((towards.length() - 1.0).abs() < 1e-5);
            assert!((towards.y.asin().to_degrees() - height).abs() < 1e-3);
            assert!((towards.x.atan2(-towards.z).to_degrees() - around).abs() < 1e-3);
        }
        assert!((wind(3.0, 90.0, 1.0) - Vec3::new(3.0, 1.0, 0.0)).length() < 1e-5);
        assert!((wind(2.0, 0.0, 0.0) - Vec3::new(0.0, 0.0, -2.0)).length() < 1e-5);
        // A direction can be set before there is a wind.
        let vane = Vane(75.0);
        assert_eq!((vane.heading_deg(Vec3::ZERO), vane.heading_deg(wind(0.0, 10.0, 3.0))), (75.0, 75.0));
        assert!((vane.heading_deg(wind(3.0, -20.0, 1.0)) + 20.0).abs() < 1e-3);
        assert_eq!(Vane::default().heading_deg(Weather::default().wind), 0.0);
    }

    #[test]
    fn sliders_follow_a_recording_and_stay_where_somebody_drags_them() {
        let mut cloud = Emitter { flow: Flow::MmPerHour(10.0), rate: 2000.0, ..default() };
        let mut followed = Followed::default();
        let start = [0.0, 2000.0];
        // Before its first tick the emitter is on, whatever the events of that tick will say.
        assert_eq!(followed.look(start, 0, &cloud), Some(start));
        cloud.enabled = false;
        assert_eq!(followed.look(start, 1, &cloud), None);
        // Dragged, which acts in the next tick.
        assert_eq!(followed.look([30.0, 2000.0], 1, &cloud), None);
        (cloud.enabled, cloud.flow) = (true, Flow::MmPerHour(30.0));
        assert_eq!(followed.look([30.0, 2000.0], 2, &cloud), Some([30.0, 2000.0]));
        assert_eq!(followed.look([30.0, 2000.0], 50, &cloud), None);
        // Back, and to the start.
        (cloud.enabled, cloud.rate) = (false, 500.0);
        assert_eq!(followed.look([30.0, 2000.0], 20, &cloud), Some([0.0, 500.0]));
        assert_eq!(followed.look([0.0, 500.0], 0, &cloud), Some(start));
    }

    #[test]
    fn rain_covers_the_scene_and_none_falls_on_nothing() {
        let (half_size, place) = above(Vec3::new(-1.0, 0.0, 2.0), Vec3::new(3.0, 2.0, 4.0)).unwrap();
        assert!(half_size.x > 2.0 && half_size.y > 1.0 && place.y > 2.0, "{half_size} {place}");
        assert_eq!((place.x, place.z), (1.0, 3.0));
        assert_eq!(above(Vec3::INFINITY, Vec3::NEG_INFINITY), None);
        let here = (half_size, place);
        assert!(!is_elsewhere(here, (half_size * 1.01, place + 0.01)));
        assert!(is_elsewhere(here, (half_size * 2.0, place)) && is_elsewhere(here, (half_size, place + 1.0)));
    }
}
