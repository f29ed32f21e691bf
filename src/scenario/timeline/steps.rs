//! What happens, as lists in order of ticks.

use bevy::prelude::*;

use super::{Action, EmitterAdjustment, EventSpec, MaterialChange, WeatherChange, in_order, tick_from};
use crate::brush::Brush;
use crate::material::{PorousMaterial, StandingWater};
use crate::scenario::{EmitterSpec, MadeOf, Scenario};
use crate::weather::Weather;

/// Weather that changes from one tick to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WeatherStep {
    /// The first tick with any of it.
    pub(super) first: u32,
    /// The first tick with all of it.
    pub(super) last: u32,
    /// Before.
    pub(super) from: Weather,
    /// After.
    pub(super) to: Weather,
}

/// What a surface is made of from a tick on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MaterialStep {
    pub(super) tick: u32,
    /// Its number.
    pub(super) surface: u32,
    /// Number of its material, in the order of their names, if that changes.
    pub(super) material: Option<usize>,
    pub(super) porous: PorousMaterial,
    pub(super) water: StandingWater,
}

/// What an emitter sends out from a tick on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct EmitterStep {
    pub(super) tick: u32,
    /// Its number.
    pub(super) emitter: u32,
    pub(super) spec: EmitterSpec,
}

/// A touch of a brush.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BrushStep {
    pub(super) tick: u32,
    pub(super) brush: Brush,
    pub(super) surface: Option<u32>,
}

/// What happens, each list in order of its ticks.
#[derive(Resource, Debug, Clone, Default, PartialEq)]
pub(super) struct Timeline {
    /// At tick 0.
    pub(super) weather: Weather,
    /// No two at a time, but for those of a single tick.
    pub(super) changes: Vec<WeatherStep>,
    /// Of surfaces that change at all, what they are made of at first comes with tick 0.
    pub(super) materials: Vec<MaterialStep>,
    /// Of emitters that are adjusted at all, what they are at first comes with tick 0.
    pub(super) emitters: Vec<EmitterStep>,
    pub(super) strokes: Vec<BrushStep>,
    /// Hashes of all that acts.
    pub(super) acts: Vec<(u32, [u8; 32])>,
}

impl WeatherStep {
    /// The change of `from` that begins with tick `first`.
    pub(super) fn new(change: &WeatherChange, from: Weather, first: u32, hz: u32) -> Self {
        let ticks = (change.over.max(0.0) * hz as f32).round() as u32;
        let to = Weather {
            wind: change.wind.unwrap_or(from.wind),
            temperature_c: change.temperature_c.unwrap_or(from.temperature_c),
            humidity: change.humidity.unwrap_or(from.humidity),
            sun_w_per_m2: change.sun_w_per_m2.unwrap_or(from.sun_w_per_m2),
            drying_speed: change.drying_speed.unwrap_or(from.drying_speed),
            ..from
        };
        Self { first, last: first.saturating_add(ticks.saturating_sub(1)), from, to }
    }

    /// The weather of a tick from its first to its last.
    pub(super) fn at(&self, tick: u32) -> Weather {
        if tick >= self.last {
            return self.to;
        }
        let (Self { from, to, .. }, done) = (self, tick.saturating_sub(self.first) as f32 + 1.0);
        let part = done / ((self.last - self.first) as f32 + 1.0);
        let mix = |from: f32, to: f32| from + (to - from) * part;
        Weather {
            wind: from.wind.lerp(to.wind, part),
            temperature_c: mix(from.temperature_c, to.temperature_c),
            humidity: mix(from.humidity, to.humidity),
            sun_w_per_m2: mix(from.sun_w_per_m2, to.sun_w_per_m2),
            drying_speed: mix(from.drying_speed, to.drying_speed),
            ..*to
        }
    }
}

impl Timeline {
    /// What happens in a scenario that has been checked.
    pub(super) fn new(scenario: &Scenario) -> Self {
        let mut timeline = Self { weather: scenario.weather(), ..default() };
        for (_, event) in in_order(scenario) {
            timeline.add(scenario, event);
        }
        timeline.sort();
        timeline
    }

    /// Adds an event behind all others that change what it changes. Then the lists have to be sorted.
    pub(super) fn add(&mut self, scenario: &Scenario, EventSpec { at, what }: &EventSpec) {
        let hz = scenario.tick_hz;
        let tick = tick_from(*at, hz);
        if what.acts() {
            self.acts.push((tick, hash(what)));
        }
        match what {
            Action::Weather(change) => {
                let weather = self.changes.last().map_or(self.weather, |step| step.to);
                self.changes.push(WeatherStep::new(change, weather, tick, hz));
            }
            Action::Brush(event) => {
                let surface = event.surface.as_deref().and_then(|name| scenario.surface_number(name));
                self.strokes.push(BrushStep { tick, brush: event.brush(), surface });
            }
            Action::Material(change) => self.add_material(scenario, change, tick),
            Action::Adjust(adjustment) => self.add_adjustment(scenario, adjustment, tick),
            _ => {}
        }
    }

    /// Puts the lists in order of ticks; what is of the same one stays as it came. Weather is in order always.
    pub(super) fn sort(&mut self) {
        // What surfaces and emitters are at first was put in when they first changed.
        self.materials.sort_by_key(|step| step.tick);
        self.emitters.sort_by_key(|step| step.tick);
        self.strokes.sort_by_key(|step| step.tick);
        self.acts.sort_by_key(|(tick, _)| *tick);
    }

    fn add_material(&mut self, scenario: &Scenario, change: &MaterialChange, tick: u32) {
        let Some(surface) = scenario.surface_number(&change.surface) else { return };
        let made_of = |name: &String| {
            let index = scenario.materials.keys().position(|other| other == name)?;
            Some((index, scenario.materials.get(name)?))
        };
        let current = self.materials.iter().rev().find(|step| step.surface == surface).cloned();
        let current = current.or_else(|| {
            let MadeOf { material, porous, water } = scenario.made_of(surface)?;
            let first = MaterialStep { tick: 0, surface, material, porous, water };
            self.materials.push(first.clone());
            Some(first)
        });
        let Some(current) = current else { return };
        let mut step = MaterialStep { tick, material: None, ..current };
        if let Some((index, spec)) = change.material.as_ref().and_then(made_of) {
            step = MaterialStep { material: Some(index), porous: spec.porous, water: spec.water, ..step };
        }
        if let Some(porous) = change.porous {
            step.porous = porous;
        }
        if let Some(model) = change.model {
            step.porous.model = model;
        }
        if let Some(water) = change.water {
            step.water = water;
        }
        self.materials.push(step);
    }

    fn add_adjustment(&mut self, scenario: &Scenario, adjustment: &EmitterAdjustment, tick: u32) {
        let Some(index) = scenario.emitters.iter().position(|spec| spec.name == adjustment.emitter) else {
            return;
        };
        let emitter = index as u32;
        let current = self.emitters.iter().rev().find(|step| step.emitter == emitter);
        let mut spec = current.map(|step| step.spec.clone()).unwrap_or_else(|| {
            let first = scenario.emitters[index].clone();
            self.emitters.push(EmitterStep { tick: 0, emitter, spec: first.clone() });
            first
        });
        adjustment.make(&mut spec);
        self.emitters.push(EmitterStep { tick, emitter, spec });
    }
}

/// What stands for an event in the digest.
fn hash(what: &Action) -> [u8; 32] {
    // Numbers are written so that they are read as the same bits; what acts has no number that cannot be.
    let text = serde_json::to_vec(what).unwrap_or_default();
    *blake3::hash(&text).as_bytes()
}

#[cfg(test)]
mod tests {
    use super::super::tests::scenario;
    use super::*;

    #[test]
    fn weather_changes_step_by_step_and_stays() {
        let timeline = Timeline::new(&scenario(
            "[(at: 3.0, what: Weather(humidity: 0.9)),
              (at: 1.0, what: Weather(wind: (1.0, 0.0, 4.0), temperature_c: 0.0, over: 0.4))]",
        ));
        let [first, second] = timeline.changes[..] else { panic!("{timeline:?}") };
        assert_eq!((first.first, first.last, second.first, second.last), (11, 14, 31, 31));
        let winds = [11, 12, 13, 14].map(|tick| first.at(tick).wind.z);
        assert_eq!(winds, [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(first.at(12).wind.x, 1.0);
        assert_eq!(
            (second.at(31).humidity, second.at(31).wind.z, second.at(31).temperature_c),
            (0.9, 4.0, 0.0)
        );
        assert_eq!(timeline.weather.wind.z, 0.0);
        assert_eq!(timeline.acts.iter().map(|(tick, _)| *tick).collect::<Vec<_>>(), [11, 31]);
    }

    #[test]
    fn surfaces_remember_what_they_were_made_of() {
        let timeline = Timeline::new(&scenario(
            r#"[(at: 2.0, what: Material(surface: "a", material: "sand")),
                (at: 1.0, what: Material(surface: "a", model: Lagarde(porosity: 0.5))),
                (at: 4.0, what: Material(surface: "b", material: "clay"))]"#,
        ));
        let steps: Vec<_> = timeline
            .materials
            .iter()
            .map(|step| (step.tick, step.surface, step.material, step.porous.capacity_mm))
            .collect();
        let expected = [
            (0, 0, Some(0), 0.1),
            (0, 1, Some(1), 0.5),
            (11, 0, None, 0.1),
            (21, 0, Some(1), 0.5),
            (41, 1, Some(0), 0.1),
        ];
        assert_eq!(steps, expected);
        assert_ne!(timeline.materials[2].porous.model, timeline.materials[0].porous.model);
        assert_eq!(timeline.materials[3].porous.model, timeline.materials[1].porous.model);
    }

    #[test]
    fn emitters_remember_what_they_were() {
        let timeline = Timeline::new(&scenario(
            r#"[(at: 2.0, what: Adjust(emitter: "rain", rate: 7.0)),
                (at: 1.0, what: Adjust(emitter: "rain", spread_deg: 10.0, flow: LitresPerMinute(2.0)))]"#,
        ));
        let steps: Vec<_> =
            timeline.emitters.iter().map(|step| (step.tick, step.spec.rate, step.spec.spread_deg)).collect();
        assert_eq!(steps, [(0, 1.0, 0.0), (11, 1.0, 10.0), (21, 7.0, 10.0)]);
        assert_eq!(timeline.emitters[2].spec.initial_speed(), 1.0);
    }
}
