//! What a file says: a scenario, or a part of one that is laid over others.

use std::collections::BTreeMap;

use bevy::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    CameraSpec, EmitterSpec, EnvironmentSpec, MapBudgetSpec, MaterialSpec, Scenario, SceneSpec, SunSpec,
    SurfaceSpec,
};
use crate::emitter::Flow;
use crate::scenario::EventSpec;

/// A scenario file. What it leaves out is what the files it includes say, or a default; `seconds` and `camera` have none.
///
/// Parts are laid over each other: the included files in their order, then the file itself, then one of its variants. A
/// later `seed`, `tick_hz`, `seconds`, `gravity`, `wind`, `max_particles`, `map_budget`, `camera`, `sun` or `environment` replaces an
/// earlier one, `weather` field by field; materials, variants, surfaces, scenes and emitters replace those of the same name and
/// else come behind the others; `emitter_changes` are made to what is there by then; events and flaws are added. Nothing can be taken
/// away.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq, Default)]
#[serde(deny_unknown_fields, default)]
pub struct ScenarioPart {
    /// Files whose parts lie below this one; paths like all others. Each file counts once.
    pub include: Vec<String>,
    /// Parts by name, one of which can be laid over this one. They include nothing and have no variants.
    pub variants: BTreeMap<String, ScenarioPart>,
    /// Seeds everything random.
    pub seed: Option<u64>,
    /// Ticks per second, 1..=1000.
    pub tick_hz: Option<u32>,
    /// Length, s, above 0 to a day; rounded to ticks, of which there is at least one.
    pub seconds: Option<f32>,
    /// m/s².
    #[schemars(with = "Option<[f32; 3]>")]
    pub gravity: Option<Vec3>,
    /// m/s.
    #[schemars(with = "Option<[f32; 3]>")]
    pub wind: Option<Vec3>,
    /// What dries.
    pub weather: WeatherPart,
    /// The most particles in flight, 1..=10,000,000.
    pub max_particles: Option<u32>,
    /// What the maps of all surfaces may take.
    pub map_budget: Option<MapBudgetSpec>,
    /// Where it is seen from.
    pub camera: Option<CameraSpec>,
    /// The one light with shadows.
    pub sun: Option<SunSpec>,
    /// What is all around.
    pub environment: Option<EnvironmentSpec>,
    /// Materials by name.
    pub materials: BTreeMap<String, MaterialSpec>,
    /// What can get wet.
    pub surfaces: Vec<SurfaceSpec>,
    /// Whole glTFs that can get wet.
    pub scenes: Vec<SceneSpec>,
    /// What makes it wet.
    pub emitters: Vec<EmitterSpec>,
    /// Changes to emitters, by their names.
    pub emitter_changes: BTreeMap<String, EmitterChange>,
    /// What happens when. In any order; of those at the same time the first comes first.
    pub events: Vec<EventSpec>,
    /// Of a recorded session: what was done in it that events cannot say, so that a replay comes out differently. Replays and
    /// checks tell it.
    pub flaws: Vec<String>,
}

/// What of the weather a part says.
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Default)]
#[serde(deny_unknown_fields, default)]
pub struct WeatherPart {
    /// °C, -40..=60.
    pub temperature_c: Option<f32>,
    /// Relative, 0..=1.
    pub humidity: Option<f32>,
    /// W/m², 0..=1400.
    pub sun_w_per_m2: Option<f32>,
    /// How many times faster things dry than in the world, 0..=100,000.
    pub drying_speed: Option<f32>,
}

/// What of an emitter is other than it was said before; the fields are those of [`EmitterSpec`].
#[derive(Serialize, Deserialize, JsonSchema, Debug, Clone, PartialEq, Default)]
#[serde(deny_unknown_fields, default)]
pub struct EmitterChange {
    /// `.effect.ron`.
    pub effect: Option<String>,
    /// Particles per second.
    pub rate: Option<f32>,
    /// How much it sends out.
    pub flow: Option<Flow>,
    /// m/s.
    pub speed: Option<f32>,
    /// Half-angle of the cone of directions, degrees, 0..=180.
    pub spread_deg: Option<f32>,
    /// Seconds until a particle that hits nothing is removed.
    pub lifetime: Option<f32>,
    /// Seconds at which it starts.
    pub start: Option<f32>,
    /// Seconds at which it stops.
    pub stop: Option<f32>,
}

/// A later value, if there is one, in place of an earlier.
pub(in crate::scenario) fn replace<T>(earlier: &mut Option<T>, later: Option<T>) {
    if later.is_some() {
        *earlier = later;
    }
}

impl WeatherPart {
    /// Lays a later part over this one.
    pub(in crate::scenario) fn lay(&mut self, over: Self) {
        replace(&mut self.temperature_c, over.temperature_c);
        replace(&mut self.humidity, over.humidity);
        replace(&mut self.sun_w_per_m2, over.sun_w_per_m2);
        replace(&mut self.drying_speed, over.drying_speed);
    }
}

impl EmitterChange {
    /// The names of the fields that it changes.
    pub(in crate::scenario) fn fields(&self) -> impl Iterator<Item = &'static str> {
        let Self { effect, rate, flow, speed, spread_deg, lifetime, start, stop } = self;
        let fields = [
            ("effect", effect.is_some()),
            ("rate", rate.is_some()),
            ("flow", flow.is_some()),
            ("speed", speed.is_some()),
            ("spread_deg", spread_deg.is_some()),
            ("lifetime", lifetime.is_some()),
            ("start", start.is_some()),
            ("stop", stop.is_some()),
        ];
        fields.into_iter().filter_map(|(field, is_changed)| is_changed.then_some(field))
    }

    /// Makes the change.
    pub(in crate::scenario) fn make(self, emitter: &mut EmitterSpec) {
        let Self { effect, rate, flow, speed, spread_deg, lifetime, start, stop } = self;
        let set = |field: &mut f32, value: Option<f32>| *field = value.unwrap_or(*field);
        emitter.effect = effect.unwrap_or(std::mem::take(&mut emitter.effect));
        emitter.flow = flow.unwrap_or(emitter.flow);
        set(&mut emitter.rate, rate);
        set(&mut emitter.spread_deg, spread_deg);
        set(&mut emitter.lifetime, lifetime);
        set(&mut emitter.start, start);
        replace(&mut emitter.speed, speed);
        replace(&mut emitter.stop, stop);
    }
}

impl ScenarioPart {
    /// The scenario that this makes, or the name of the field that is missing.
    pub(in crate::scenario) fn complete(self) -> Result<Scenario, &'static str> {
        let base = super::WeatherSpec::default();
        let weather = super::WeatherSpec {
            temperature_c: self.weather.temperature_c.unwrap_or(base.temperature_c),
            humidity: self.weather.humidity.unwrap_or(base.humidity),
            sun_w_per_m2: self.weather.sun_w_per_m2.unwrap_or(base.sun_w_per_m2),
            drying_speed: self.weather.drying_speed.unwrap_or(base.drying_speed),
        };
        Ok(Scenario {
            seed: self.seed.unwrap_or_default(),
            tick_hz: self.tick_hz.unwrap_or_else(super::default_hz),
            seconds: self.seconds.ok_or("seconds")?,
            gravity: self.gravity.unwrap_or_else(super::default_gravity),
            wind: self.wind.unwrap_or_default(),
            weather,
            max_particles: self.max_particles.unwrap_or_else(super::default_max_particles),
            map_budget: self.map_budget,
            camera: self.camera.ok_or("camera")?,
            sun: self.sun.unwrap_or_default(),
            environment: self.environment,
            materials: self.materials,
            surfaces: self.surfaces,
            scenes: self.scenes,
            emitters: self.emitters,
            events: self.events,
            flaws: self.flaws,
        })
    }
}
