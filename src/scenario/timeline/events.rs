//! What can happen in a scenario, as the file says it.
//!
//! Every event is a time and plain data, and names what it acts on: so a session can be written down as events, too.

use bevy::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::brush::{Brush, BrushKind};
use crate::emitter::{EmitterShape, Flow};
use crate::material::{PorousMaterial, StandingWater, WettingModel};
use crate::scenario::EmitterSpec;

/// Something that happens at a time.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct EventSpec {
    /// Seconds, 0 to the length of the scenario. What acts does so in the first tick that begins then or later; what looks
    /// sees the end of the first tick that ends then or later, or of the last one.
    pub at: f64,
    /// What happens.
    pub what: Action,
}

/// What happens.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
pub enum Action {
    /// The emitter of this name begins to send out.
    Start(String),
    /// The emitter of this name stops.
    Stop(String),
    /// An emitter goes somewhere else.
    Move(EmitterMove),
    /// An emitter sends out more or less, or in another way.
    Adjust(EmitterAdjustment),
    /// The weather changes.
    Weather(WeatherChange),
    /// The camera is here then.
    Camera(CameraMove),
    /// A brush touches what lies under it.
    Brush(BrushEvent),
    /// A surface becomes other matter, or looks wet another way.
    Material(MaterialChange),
    /// A picture of this name is taken. Acts on nothing.
    Capture(String),
    /// The scene is exported for other engines, under this name. Acts on nothing.
    Export(String),
    /// Something has to be true. Acts on nothing.
    Expect(Expectation),
}

impl Action {
    /// Its name in the file.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Start(_) => "Start",
            Self::Stop(_) => "Stop",
            Self::Move(_) => "Move",
            Self::Adjust(_) => "Adjust",
            Self::Weather(_) => "Weather",
            Self::Camera(_) => "Camera",
            Self::Brush(_) => "Brush",
            Self::Material(_) => "Material",
            Self::Capture(_) => "Capture",
            Self::Export(_) => "Export",
            Self::Expect(_) => "Expect",
        }
    }

    /// Whether what happens after it depends on it; if not, it only looks.
    pub fn acts(&self) -> bool {
        !matches!(self, Self::Camera(_) | Self::Capture(_) | Self::Export(_) | Self::Expect(_))
    }
}

/// An emitter goes somewhere else, and stays there.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct EmitterMove {
    /// Its name.
    pub emitter: String,
    /// Where to, metres.
    #[schemars(with = "[f32; 3]")]
    pub position: Vec3,
    /// What it aims at from there, metres.
    #[schemars(with = "[f32; 3]")]
    pub target: Vec3,
    /// Seconds that it takes; 0 is at once.
    #[serde(default)]
    pub over: f32,
}

/// An emitter sends out more or less, or in another way. What is left out stays as it is; the fields are those of
/// [`EmitterSpec`].
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq, Default)]
#[serde(deny_unknown_fields)]
pub struct EmitterAdjustment {
    /// Its name.
    pub emitter: String,
    /// Particles per second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<f32>,
    /// How much it sends out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow: Option<Flow>,
    /// Where on it they start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<EmitterShape>,
    /// m/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed: Option<f32>,
    /// Half-angle of the cone of directions, degrees, 0..=180.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread_deg: Option<f32>,
    /// Seconds until a particle that hits nothing is removed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lifetime: Option<f32>,
}

impl EmitterAdjustment {
    /// Whether it changes nothing.
    pub fn is_empty(&self) -> bool {
        let Self { emitter: _, rate, flow, shape, speed, spread_deg, lifetime } = self;
        let numbers = [rate, speed, spread_deg, lifetime];
        numbers.iter().all(|number| number.is_none()) && flow.is_none() && shape.is_none()
    }

    /// What the emitter is afterwards. A speed that followed from its flow stays what it was.
    pub(in crate::scenario) fn make(&self, emitter: &mut EmitterSpec) {
        let speed = emitter.initial_speed();
        emitter.rate = self.rate.unwrap_or(emitter.rate);
        emitter.flow = self.flow.unwrap_or(emitter.flow);
        emitter.shape = self.shape.unwrap_or(emitter.shape);
        emitter.speed = Some(self.speed.unwrap_or(speed));
        emitter.spread_deg = self.spread_deg.unwrap_or(emitter.spread_deg);
        emitter.lifetime = self.lifetime.unwrap_or(emitter.lifetime);
    }
}

/// The weather changes. What is left out stays as it is.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Default)]
#[serde(deny_unknown_fields, default)]
pub struct WeatherChange {
    /// m/s.
    #[schemars(with = "Option<[f32; 3]>")]
    pub wind: Option<Vec3>,
    /// °C, -40..=60.
    pub temperature_c: Option<f32>,
    /// Relative, 0..=1.
    pub humidity: Option<f32>,
    /// W/m², 0..=1400.
    pub sun_w_per_m2: Option<f32>,
    /// How many times faster things dry than in the world, 0..=100,000.
    pub drying_speed: Option<f32>,
    /// Seconds that it takes, evenly; 0 is at once.
    pub over: f32,
}

/// The camera is somewhere at the time of the event: a key more, between which it moves smoothly.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct CameraMove {
    /// Position of the eye, metres.
    #[schemars(with = "[f32; 3]")]
    pub eye: Vec3,
    /// What it looks at, metres.
    #[schemars(with = "[f32; 3]")]
    pub target: Vec3,
}

/// A brush touches what lies under it; see [`Brush`].
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct BrushEvent {
    /// What it does.
    pub kind: BrushKind,
    /// Its middle; world space, metres.
    #[schemars(with = "[f32; 3]")]
    pub point: Vec3,
    /// Its radius, metres.
    pub radius: f32,
    /// How much it does in its middle: mm for `Wet` and `Dirty`, a part of what is there for `Dry` and `Clean`.
    pub strength: f32,
    /// The only surface it touches; all within reach if left out.
    #[serde(default)]
    pub surface: Option<String>,
}

impl BrushEvent {
    /// The brush.
    pub fn brush(&self) -> Brush {
        Brush { kind: self.kind, point: self.point, radius: self.radius, strength: self.strength }
    }
}

/// A surface becomes other matter, or looks wet another way. One of them at least is given; a later field is laid over what
/// those before it say.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct MaterialChange {
    /// Its name.
    pub surface: String,
    /// The name of another material.
    #[serde(default)]
    pub material: Option<String>,
    /// How it gets wet, in place of its material's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub porous: Option<PorousMaterial>,
    /// What water does to its look, in place of its material's own.
    #[serde(default)]
    pub model: Option<WettingModel>,
    /// Water that stands on it, in place of its material's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub water: Option<StandingWater>,
}

/// Something that can be measured.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Part of a surface that looks wetter than a half, 0..=1.
    WetFraction,
    /// Film on a surface, mean depth, mm.
    FilmMm,
    /// Water in the pores of a surface, mean depth, mm.
    AbsorbedMm,
    /// All water on and in a surface, ml.
    WaterMl,
    /// Loose dust on a surface, g.
    DustG,
    /// Bound soil on a surface, g.
    MudG,
    /// Snow on a surface, mean depth of the water it melts to, mm.
    SnowMm,
    /// Snow on a surface, g.
    SnowG,
    /// Particles in flight. Of no surface.
    Particles,
}

/// Something has to be true. Of `above` and `below` one at least is given.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Expectation {
    /// What is measured.
    pub quantity: Quantity,
    /// The name of the surface; left out for `Particles`.
    #[serde(default)]
    pub surface: Option<String>,
    /// It is more than this, in the unit of the quantity.
    #[serde(default)]
    pub above: Option<f64>,
    /// It is less than this, in the unit of the quantity.
    #[serde(default)]
    pub below: Option<f64>,
}

impl Expectation {
    /// Whether a value is as expected.
    pub fn holds(&self, value: f64) -> bool {
        self.above.is_none_or(|least| value > least) && self.below.is_none_or(|most| value < most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::load::ron_options;

    #[test]
    fn events_that_are_written_down_are_read_as_they_were() {
        let events = [
            Action::Start("rain".into()),
            Action::Move(EmitterMove {
                emitter: "rain".into(),
                position: Vec3::new(1.0, 2.5, -3.0),
                target: Vec3::ZERO,
                over: 0.5,
            }),
            Action::Weather(WeatherChange { wind: Some(Vec3::X), humidity: Some(0.25), ..default() }),
            Action::Camera(CameraMove { eye: Vec3::Y, target: Vec3::Z }),
            Action::Brush(BrushEvent {
                kind: BrushKind::Dirty,
                point: Vec3::ONE,
                radius: 0.1,
                strength: 0.2,
                surface: Some("ball".into()),
            }),
            Action::Adjust(EmitterAdjustment {
                emitter: "rain".into(),
                rate: Some(0.1),
                flow: Some(Flow::MmPerHour(3.3)),
                shape: Some(EmitterShape::Point),
                ..default()
            }),
            Action::Material(MaterialChange {
                surface: "ball".into(),
                material: None,
                porous: None,
                model: Some(WettingModel::default()),
                water: None,
            }),
            Action::Material(MaterialChange {
                surface: "ball".into(),
                material: None,
                porous: Some(PorousMaterial { sorptivity: 0.7, ..default() }),
                model: None,
                water: Some(StandingWater::default()),
            }),
            Action::Capture("end".into()),
            Action::Export("end".into()),
            Action::Expect(Expectation {
                quantity: Quantity::WetFraction,
                surface: Some("ball".into()),
                above: Some(0.2),
                below: None,
            }),
        ];
        let events: Vec<EventSpec> =
            (0..).zip(events).map(|(tick, what)| EventSpec { at: f64::from(tick) / 60.0, what }).collect();
        let text = ron_options().to_string(&events).unwrap();
        let again: Vec<EventSpec> = ron_options().from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
        assert_eq!(again, events, "{text}");
    }

    #[test]
    fn they_are_short_to_write() {
        let text = r#"[
            (at: 1.0, what: Stop("rain")),
            (at: 2.5, what: Weather(wind: (2.0, 0.0, 0.0), over: 1.5)),
            (at: 3.0, what: Material(surface: "ball", model: Lagarde(porosity: 0.5))),
            (at: 3.5, what: Export("wet")),
            (at: 4.0, what: Expect(quantity: FilmMm, surface: "ball", below: 0.1)),
        ]"#;
        let events: Vec<EventSpec> = ron_options().from_str(text).unwrap();
        assert_eq!(
            events.iter().map(|event| event.what.kind()).collect::<Vec<_>>(),
            ["Stop", "Weather", "Material", "Export", "Expect"]
        );
        assert_eq!(events.iter().filter(|event| event.what.acts()).count(), 3);
        let Action::Weather(change) = &events[1].what else { panic!("{events:?}") };
        assert_eq!((change.wind, change.humidity, change.over), (Some(Vec3::X * 2.0), None, 1.5));
    }

    #[test]
    fn expectations_are_strict_and_nothing_is_no_number() {
        let between =
            Expectation { quantity: Quantity::Particles, surface: None, above: Some(1.0), below: Some(2.0) };
        assert_eq!(
            [0.5, 1.0, 1.5, 2.0, f64::NAN].map(|value| between.holds(value)),
            [false, false, true, false, false]
        );
    }
}
