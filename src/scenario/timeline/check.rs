//! Checking events: what they name is there, and every number makes sense.

use std::collections::BTreeSet;

use super::steps::WeatherStep;
use super::{
    Action, BrushEvent, EmitterAdjustment, EmitterMove, EventSpec, Expectation, MaterialChange, Quantity,
    in_order, tick_from,
};
use crate::material::PorousMaterial;
use crate::scenario::validate::{FAR, check_weather};
use crate::scenario::{LoadedScenario, Scenario, ScenarioError};

impl LoadedScenario {
    /// Checks all events.
    ///
    /// # Errors
    /// [`ScenarioError`] for the first thing wrong.
    pub(in crate::scenario) fn validate_events(&self) -> Result<(), ScenarioError> {
        let scenario = &self.scenario;
        if scenario.events.len() > Scenario::MAX_EVENTS {
            let expected = format!("at most {} (MAX_EVENTS)", Scenario::MAX_EVENTS);
            return Err(self.value("events", scenario.events.len(), expected));
        }
        let mut made = BTreeSet::new();
        for (index, event) in scenario.events.iter().enumerate() {
            let field = format!("events[{index}]");
            self.validate_event(&field, event)?;
            if let Action::Capture(name) | Action::Export(name) = &event.what
                && !made.insert((event.what.kind(), name))
            {
                return Err(self.value(format!("{field}.what.{}", event.what.kind()), name, "unique"));
            }
        }
        let named = in_order(scenario).into_iter().map(|(index, event)| (format!("events[{index}]"), event));
        self.validate_adjustments(named)?;
        self.validate_weather_changes()
    }

    /// Checks an event that is to be added; what of the weather depends on the changes before it is not looked at.
    ///
    /// # Errors
    /// [`ScenarioError`].
    pub(crate) fn validate_new_event(&self, field: &str, event: &EventSpec) -> Result<(), ScenarioError> {
        self.validate_event(field, event)?;
        let Action::Adjust(new) = &event.what else { return Ok(()) };
        let is_before = |other: &EventSpec| {
            other.at <= event.at && matches!(&other.what, Action::Adjust(old) if old.emitter == new.emitter)
        };
        let events = self.scenario.events.iter().enumerate();
        let mut before: Vec<_> = events.filter(|&(_, other)| is_before(other)).collect();
        before.sort_by(|(_, a), (_, b)| a.at.total_cmp(&b.at));
        let named = before.into_iter().map(|(index, other)| (format!("events[{index}]"), other));
        self.validate_adjustments(named.chain([(field.to_owned(), event)]))
    }

    /// Checks an event by itself; what depends on those before it is not looked at.
    fn validate_event(&self, field: &str, event: &EventSpec) -> Result<(), ScenarioError> {
        let last = self.scenario.seconds;
        // Compared as coarsely as lengths are written down: 2.3 is no later than 2.3. NaN is not in time.
        let is_in_time = event.at >= 0.0 && event.at as f32 <= last;
        if !is_in_time {
            return Err(self.value(format!("{field}.at"), event.at, format!("0 to {last}")));
        }
        let field = format!("{field}.what.{}", event.what.kind());
        match &event.what {
            Action::Start(name) | Action::Stop(name) => self.validate_switch(&field, name),
            Action::Move(step) => self.validate_move(&field, step),
            Action::Adjust(adjustment) => self.validate_adjustment(&field, adjustment),
            // One after the other, together.
            Action::Weather(_) => Ok(()),
            Action::Camera(step) => self.look(&field, "eye", step.eye, step.target),
            Action::Brush(brush) => self.validate_brush(&field, brush),
            Action::Material(change) => self.validate_material_change(&field, change),
            Action::Capture(name) | Action::Export(name) => self.file_name(&field, name),
            Action::Expect(expectation) => self.validate_expectation(&field, expectation),
        }
    }

    /// It becomes part of the names of files and folders, and so leads nowhere else.
    pub(in crate::scenario) fn file_name(&self, field: &str, name: &str) -> Result<(), ScenarioError> {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if name.is_empty() || name.len() > 64 || !name.chars().all(plain) {
            return Err(self.value(field, name, "1 to 64 letters, digits, `_` or `-`"));
        }
        Ok(())
    }

    fn one_emitter(&self, field: &str, name: &str) -> Result<usize, ScenarioError> {
        let mut named = self.scenario.emitters.iter().enumerate().filter(|(_, emitter)| emitter.name == name);
        match (named.next(), named.next()) {
            (Some((index, _)), None) => Ok(index),
            (None, _) => Err(self.value(field, name, "the name of an emitter")),
            (Some(_), Some(_)) => Err(self.value(field, name, "the name of only one emitter")),
        }
    }

    fn one_surface(&self, field: &str, name: &str) -> Result<(), ScenarioError> {
        // That names are unique has been checked.
        if self.scenario.surface_number(name).is_some() {
            Ok(())
        } else {
            Err(self.value(field, name, "the name of a surface"))
        }
    }

    fn validate_switch(&self, field: &str, name: &str) -> Result<(), ScenarioError> {
        let index = self.one_emitter(field, name)?;
        let emitter = &self.scenario.emitters[index];
        let expected = "left out: events start and stop this emitter";
        if emitter.start != 0.0 {
            return Err(self.value(format!("emitters[{index}].start"), emitter.start, expected));
        }
        match emitter.stop {
            Some(stop) => Err(self.value(format!("emitters[{index}].stop"), stop, expected)),
            None => Ok(()),
        }
    }

    fn validate_move(&self, field: &str, step: &EmitterMove) -> Result<(), ScenarioError> {
        self.one_emitter(&format!("{field}.emitter"), &step.emitter)?;
        self.look(field, "position", step.position, step.target)?;
        self.not_negative(&format!("{field}.over"), step.over, Scenario::MAX_SECONDS)
    }

    fn validate_adjustment(&self, field: &str, adjustment: &EmitterAdjustment) -> Result<(), ScenarioError> {
        self.one_emitter(&format!("{field}.emitter"), &adjustment.emitter)?;
        if adjustment.is_empty() {
            return Err(self.value(format!("{field}.rate"), "not given", "given, or another number"));
        }
        Ok(())
    }

    /// One after the other, in order of time, with their fields: what an emitter may become depends on what it is by then.
    fn validate_adjustments<'a>(
        &self,
        events: impl Iterator<Item = (String, &'a EventSpec)>,
    ) -> Result<(), ScenarioError> {
        let mut emitters = self.scenario.emitters.clone();
        for (field, event) in events {
            let Action::Adjust(adjustment) = &event.what else { continue };
            // That it is there has been checked.
            let Some(emitter) = emitters.iter_mut().find(|emitter| emitter.name == adjustment.emitter) else {
                continue;
            };
            adjustment.make(emitter);
            self.validate_emitter(&format!("{field}.what.Adjust"), emitter)?;
        }
        Ok(())
    }

    fn validate_brush(&self, field: &str, event: &BrushEvent) -> Result<(), ScenarioError> {
        if let Some(name) = &event.surface {
            self.one_surface(&format!("{field}.surface"), name)?;
        }
        self.vector(&format!("{field}.point"), event.point, FAR)?;
        event.brush().validate().map_err(|wrong| self.out_of_range(field, wrong))
    }

    fn validate_material_change(&self, field: &str, change: &MaterialChange) -> Result<(), ScenarioError> {
        self.one_surface(&format!("{field}.surface"), &change.surface)?;
        let MaterialChange { material, porous, model, water, .. } = change;
        if material.is_none() && porous.is_none() && model.is_none() && water.is_none() {
            let expected = "given, or `porous`, `model` or `water`";
            return Err(self.value(format!("{field}.material"), "not given", expected));
        }
        if let Some(name) = &change.material
            && !self.scenario.materials.contains_key(name)
        {
            return Err(self.value(format!("{field}.material"), name, "the name of a material"));
        }
        if let Some(porous) = porous {
            porous.validate().map_err(|wrong| self.out_of_range(&format!("{field}.porous"), wrong))?;
        }
        if let Some(water) = water {
            water.validate().map_err(|wrong| self.out_of_range(&format!("{field}.water"), wrong))?;
        }
        let wears = PorousMaterial { model: model.unwrap_or_default(), ..Default::default() };
        wears.validate().map_err(|wrong| self.out_of_range(field, wrong))
    }

    fn validate_expectation(&self, field: &str, expectation: &Expectation) -> Result<(), ScenarioError> {
        let surface = format!("{field}.surface");
        match (&expectation.surface, expectation.quantity) {
            (None, Quantity::Particles) => {}
            (Some(name), Quantity::Particles) => {
                return Err(self.value(surface, name, "left out: particles are of no surface"));
            }
            (Some(name), _) => self.one_surface(&surface, name)?,
            (None, _) => return Err(self.value(surface, "not given", "the name of a surface")),
        }
        let Expectation { above, below, .. } = *expectation;
        for (name, bound) in [("above", above), ("below", below)] {
            if let Some(bound) = bound {
                self.range(&format!("{field}.{name}"), bound, -1.0e30, 1.0e30)?;
            }
        }
        match (above, below) {
            (None, None) => Err(self.value(format!("{field}.above"), "not given", "given, or `below`")),
            (Some(above), Some(below)) if above >= below => {
                Err(self.value(format!("{field}.below"), below, format!("more than `above`, {above}")))
            }
            _ => Ok(()),
        }
    }

    /// One after the other: what it changes from depends on the one before.
    fn validate_weather_changes(&self) -> Result<(), ScenarioError> {
        let (scenario, hz) = (&self.scenario, self.scenario.tick_hz);
        let mut weather = scenario.weather();
        let mut before: Option<WeatherStep> = None;
        for (index, event) in in_order(scenario) {
            let Action::Weather(change) = &event.what else { continue };
            let field = format!("events[{index}].what.Weather");
            self.not_negative(&format!("{field}.over"), change.over, Scenario::MAX_SECONDS)?;
            let step = WeatherStep::new(change, weather, tick_from(event.at, hz), hz);
            check_weather(&step.to).map_err(|wrong| self.out_of_range(&field, wrong))?;
            if (step.to.sun_w_per_m2 > 0.0) != (scenario.weather.sun_w_per_m2 > 0.0) {
                // Shadows are looked for in the background, which would make runs differ.
                let expected =
                    "above 0 if it is so in `weather`, and 0 if not: shadows are looked for before the start";
                return Err(self.value(format!("{field}.sun_w_per_m2"), step.to.sun_w_per_m2, expected));
            }
            let overlaps = |before: WeatherStep| before.last > before.first && step.first <= before.last;
            if before.is_some_and(overlaps) {
                let expected = "after the change of the weather before it is over";
                return Err(self.value(format!("events[{index}].at"), event.at, expected));
            }
            (weather, before) = (step.to, Some(step));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Why a scenario with these events is refused.
    fn refusal(events: &str) -> Option<String> {
        refusal_within("10.0", events)
    }

    /// The same of a scenario that is so long.
    fn refusal_within(seconds: &str, events: &str) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("e.effect.ron"), "()").unwrap();
        let text = format!(
            r#"(
                seconds: {seconds},
                camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
                materials: {{"clay": ()}},
                surfaces: [(name: "a", mesh: Ground(size: (1.0, 1.0), cells: (1, 1)), material: "clay")],
                emitters: [
                    (name: "rain", effect: "e.effect.ron", rate: 1.0, speed: 1.0,
                     keys: [(position: (0.0, 2.0, 0.0), target: (0.0, 0.0, 0.0))]),
                    (name: "hose", effect: "e.effect.ron", rate: 1.0, speed: 1.0, stop: 2.0,
                     keys: [(position: (0.0, 2.0, 0.0), target: (0.0, 0.0, 0.0))]),
                ],
                events: [{events}],
            )"#
        );
        let file = folder.path().join("scene.ron");
        std::fs::write(&file, text).unwrap();
        Scenario::load(&file).err().map(|error| error.to_string())
    }

    #[test]
    fn events_that_make_sense_pass() {
        let all = r#"
            (at: 0.0, what: Start("rain")),
            (at: 10.0, what: Stop("rain")),
            (at: 1.0, what: Move(emitter: "hose", position: (1.0, 1.0, 0.0), target: (0.0, 0.0, 0.0), over: 1.0)),
            (at: 4.0, what: Weather(humidity: 0.1)),
            (at: 1.0, what: Weather(wind: (1.0, 0.0, 0.0), over: 2.0)),
            (at: 4.0, what: Weather(temperature_c: 5.0)),
            (at: 2.0, what: Camera(eye: (0.0, 1.0, 1.0), target: (0.0, 0.0, 0.0))),
            (at: 2.0, what: Brush(kind: Wet, point: (0.0, 0.0, 0.0), radius: 0.1, strength: 0.5)),
            (at: 3.0, what: Material(surface: "a", model: Twomey())),
            (at: 3.0, what: Material(surface: "a", porous: (capacity_mm: 0.3), water: (rain_mm_per_h: 2.0))),
            (at: 3.0, what: Adjust(emitter: "hose", rate: 20.0, spread_deg: 4.0)),
            (at: 6.0, what: Adjust(emitter: "hose", flow: MmPerHour(2.0))),
            (at: 5.0, what: Adjust(emitter: "hose", shape: Sky(half_size: (1.0, 1.0)))),
            (at: 5.0, what: Capture("five")),
            (at: 5.0, what: Export("five")),
            (at: 6.0, what: Export("six")),
            (at: 5.0, what: Expect(quantity: WetFraction, surface: "a", above: 0.0, below: 0.5)),
            (at: 5.0, what: Expect(quantity: Particles, below: 100.0)),
        "#;
        assert_eq!(refusal(all), None);
    }

    #[test]
    fn the_very_end_is_in_time_whatever_its_digits() {
        for seconds in ["2.3", "0.1", "10.04", "86399.99"] {
            assert_eq!(refusal_within(seconds, &format!("(at: {seconds}, what: Start(\"rain\"))")), None);
        }
        for at in ["2.301", "-0.001", "NaN"] {
            let event = format!("(at: {at}, what: Start(\"rain\"))");
            let error = refusal_within("2.3", &event).unwrap_or_default();
            assert!(error.contains("`events[0].at`") && error.ends_with("0 to 2.3"), "{at}: {error}");
        }
    }

    #[test]
    fn what_makes_no_sense_is_named() {
        for (event, field) in [
            (r#"(at: 11.0, what: Start("rain"))"#, "events[0].at"),
            (r#"(at: -1.0, what: Start("rain"))"#, "events[0].at"),
            (r#"(at: 1.0, what: Start("snow"))"#, "events[0].what.Start"),
            (r#"(at: 1.0, what: Stop("hose"))"#, "emitters[1].stop"),
            (
                r#"(at: 1.0, what: Move(emitter: "rain", position: (1.0, 1.0, 1.0), target: (1.0, 1.0, 1.0)))"#,
                "events[0].what.Move.target",
            ),
            ("(at: 1.0, what: Weather(humidity: 2.0))", "events[0].what.Weather.humidity"),
            ("(at: 1.0, what: Weather(sun_w_per_m2: 200.0))", "events[0].what.Weather.sun_w_per_m2"),
            (
                "(at: 2.0, what: Weather(humidity: 0.2)), (at: 1.0, what: Weather(humidity: 0.1, over: 3.0))",
                "events[0].at",
            ),
            (
                "(at: 1.0, what: Camera(eye: (0.0, 0.0, 0.0), target: (0.0, 0.0, 0.0)))",
                "events[0].what.Camera.target",
            ),
            (
                "(at: 1.0, what: Brush(kind: Dry, point: (0.0, 0.0, 0.0), radius: 0.1, strength: 1.5))",
                "events[0].what.Brush.strength",
            ),
            (
                r#"(at: 1.0, what: Brush(kind: Dry, point: (0.0, 0.0, 0.0), radius: 0.1, strength: 1.0, surface: "b"))"#,
                "events[0].what.Brush.surface",
            ),
            (r#"(at: 1.0, what: Material(surface: "a"))"#, "events[0].what.Material.material"),
            (
                r#"(at: 1.0, what: Material(surface: "a", material: "gold"))"#,
                "events[0].what.Material.material",
            ),
            (
                r#"(at: 1.0, what: Material(surface: "a", model: Lagarde(porosity: 2.0)))"#,
                "events[0].what.Material.model.porosity",
            ),
            (
                r#"(at: 1.0, what: Material(surface: "a", porous: (capacity_mm: -1.0)))"#,
                "events[0].what.Material.porous.capacity_mm",
            ),
            (r#"(at: 1.0, what: Adjust(emitter: "snow", rate: 1.0))"#, "events[0].what.Adjust.emitter"),
            (r#"(at: 1.0, what: Adjust(emitter: "rain"))"#, "events[0].what.Adjust.rate"),
            (r#"(at: 1.0, what: Adjust(emitter: "rain", rate: -1.0))"#, "events[0].what.Adjust.rate"),
            (
                r#"(at: 1.0, what: Adjust(emitter: "rain", flow: MmPerHour(2.0)))"#,
                "events[0].what.Adjust.flow",
            ),
            // By itself each makes sense; the second comes first.
            (
                r#"(at: 2.0, what: Adjust(emitter: "rain", shape: Point)),
                   (at: 1.0, what: Adjust(emitter: "rain", shape: Sky(half_size: (1.0, 1.0)), flow: MmPerHour(2.0)))"#,
                "events[0].what.Adjust.flow",
            ),
            (r#"(at: 1.0, what: Capture("../a"))"#, "events[0].what.Capture"),
            (r#"(at: 1.0, what: Capture("a")), (at: 2.0, what: Capture("a"))"#, "events[1].what.Capture"),
            (r#"(at: 1.0, what: Export("../a"))"#, "events[0].what.Export"),
            (r#"(at: 1.0, what: Export("/tmp/a"))"#, "events[0].what.Export"),
            (r#"(at: 1.0, what: Export(".."))"#, "events[0].what.Export"),
            (r#"(at: 1.0, what: Export(""))"#, "events[0].what.Export"),
            (r#"(at: 11.0, what: Export("a"))"#, "events[0].at"),
            (r#"(at: 1.0, what: Export("a")), (at: 2.0, what: Export("a"))"#, "events[1].what.Export"),
            ("(at: 1.0, what: Expect(quantity: FilmMm, above: 0.0))", "events[0].what.Expect.surface"),
            (r#"(at: 1.0, what: Expect(quantity: FilmMm, surface: "a"))"#, "events[0].what.Expect.above"),
            (
                r#"(at: 1.0, what: Expect(quantity: FilmMm, surface: "a", above: 1.0, below: 0.5))"#,
                "events[0].what.Expect.below",
            ),
            (
                r#"(at: 1.0, what: Expect(quantity: Particles, surface: "a", above: 1.0))"#,
                "events[0].what.Expect.surface",
            ),
        ] {
            let error = refusal(event).unwrap_or_default();
            assert!(error.contains(&format!("`{field}`")), "{event}: {error}");
        }
    }
}
