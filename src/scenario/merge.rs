//! Laying the parts of a scenario over each other, and remembering which came from where.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::schema::replace;
use super::{EmitterSpec, ScenarioPart, SceneSpec, SurfaceSpec};

/// Where a value was written: the file, and its field there.
#[derive(Debug, Clone, PartialEq)]
struct Origin {
    file: PathBuf,
    field: String,
    /// Where it was changed since: what holds the changed field, by the field's name.
    changed: BTreeMap<&'static str, Origin>,
}

impl Origin {
    /// The file and the field there of something in it; `rest` is behind its own field, and begins with `.` if it is not empty.
    fn find(&self, rest: &str) -> (PathBuf, String) {
        let name = rest.trim_start_matches('.').split(['.', '[']).next();
        let Self { file, field, .. } = name.and_then(|name| self.changed.get(name)).unwrap_or(self);
        (file.clone(), format!("{field}{rest}"))
    }
}

/// Where what of a scenario was written that can come from several files.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Origins {
    materials: BTreeMap<String, Origin>,
    surfaces: Vec<Origin>,
    scenes: Vec<Origin>,
    emitters: Vec<Origin>,
    events: Vec<Origin>,
}

impl Origins {
    /// The file and the field there of a field of the whole scenario; `None` if it is not of a list, or not known.
    pub(super) fn find(&self, field: &str) -> Option<(PathBuf, String)> {
        let (origin, rest) = if let Some(rest) = field.strip_prefix("materials.") {
            // Names may hold anything: the longest one that fits.
            let fits =
                |name: &str| rest.strip_prefix(name).is_some_and(|t| t.is_empty() || t.starts_with('.'));
            let name = self.materials.keys().filter(|name| fits(name)).max_by_key(|name| name.len())?;
            (&self.materials[name], &rest[name.len()..])
        } else {
            let (list, rest) = field.split_once('[')?;
            let (index, rest) = rest.split_once(']')?;
            let list = match list {
                "surfaces" => &self.surfaces,
                "scenes" => &self.scenes,
                "emitters" => &self.emitters,
                "events" => &self.events,
                _ => return None,
            };
            (list.get(index.parse::<usize>().ok()?)?, rest)
        };
        Some(origin.find(rest))
    }
}

/// What is laid over what so far.
#[derive(Debug, Default)]
pub(super) struct Merged {
    pub(super) part: ScenarioPart,
    pub(super) origins: Origins,
}

/// Replaces those of the same name, adds the others.
fn lay_list<T>(
    (list, origins): (&mut Vec<T>, &mut Vec<Origin>),
    over: Vec<T>,
    name: impl Fn(&T) -> &str,
    origin: impl Fn(usize) -> Origin,
) {
    // Only what was there before is replaced: twice the same name in one file is a mistake, and is told later.
    let before = list.len();
    for (index, item) in over.into_iter().enumerate() {
        let old = list[..before].iter().position(|old| name(old) == name(&item));
        match old {
            Some(old) => (list[old], origins[old]) = (item, origin(index)),
            None => {
                list.push(item);
                origins.push(origin(index));
            }
        }
    }
}

impl Merged {
    /// Lays a part over what is there. `prefix` is that of its fields in the file. An error is the name of an emitter that
    /// is to be changed but is not there.
    pub(super) fn lay(&mut self, over: ScenarioPart, file: &Path, prefix: &str) -> Result<(), String> {
        let origin = |field: String| Origin {
            file: file.into(),
            field: format!("{prefix}{field}"),
            changed: BTreeMap::new(),
        };
        let Self { part, origins } = self;
        replace(&mut part.seed, over.seed);
        replace(&mut part.tick_hz, over.tick_hz);
        replace(&mut part.seconds, over.seconds);
        replace(&mut part.gravity, over.gravity);
        replace(&mut part.wind, over.wind);
        part.weather.lay(over.weather);
        replace(&mut part.max_particles, over.max_particles);
        replace(&mut part.camera, over.camera);
        replace(&mut part.sun, over.sun);
        replace(&mut part.environment, over.environment);
        replace(&mut part.map_budget, over.map_budget);
        part.variants.extend(over.variants);
        for (name, material) in over.materials {
            origins.materials.insert(name.clone(), origin(format!("materials.{name}")));
            part.materials.insert(name, material);
        }
        lay_list(
            (&mut part.surfaces, &mut origins.surfaces),
            over.surfaces,
            |surface: &SurfaceSpec| surface.name.as_str(),
            |index| origin(format!("surfaces[{index}]")),
        );
        lay_list(
            (&mut part.scenes, &mut origins.scenes),
            over.scenes,
            |scene: &SceneSpec| scene.name.as_str(),
            |index| origin(format!("scenes[{index}]")),
        );
        lay_list(
            (&mut part.emitters, &mut origins.emitters),
            over.emitters,
            |emitter: &EmitterSpec| emitter.name.as_str(),
            |index| origin(format!("emitters[{index}]")),
        );
        for (index, event) in over.events.into_iter().enumerate() {
            part.events.push(event);
            origins.events.push(origin(format!("events[{index}]")));
        }
        part.flaws.extend(over.flaws);
        for (name, change) in over.emitter_changes {
            let Some(index) = part.emitters.iter().position(|emitter| emitter.name == name) else {
                return Err(name);
            };
            let from = origin(format!("emitter_changes.{name}"));
            let changed = change.fields().map(|field| (field, from.clone()));
            origins.emitters[index].changed.extend(changed);
            change.make(&mut part.emitters[index]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::load::ron_options;
    use super::*;

    fn part(text: &str) -> ScenarioPart {
        ron_options().from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
    }

    fn emitter(name: &str, rate: f32) -> String {
        format!(
            r#"(name: "{name}", effect: "e", rate: {rate:?}, keys: [(position: (0.0, 1.0, 0.0), target: (0.0, 0.0, 0.0))])"#
        )
    }

    #[test]
    fn later_values_replace_earlier_ones_and_lists_grow_by_name() {
        let (low, high) = (Path::new("low.ron"), Path::new("high.ron"));
        let mut merged = Merged::default();
        let base = format!(
            r#"(seed: 1, seconds: 5.0, weather: (humidity: 0.3, temperature_c: 10.0), materials: {{"a": (), "a.b": ()}},
                emitters: [{}, {}], events: [(at: 1.0, what: Stop("rain"))])"#,
            emitter("rain", 10.0),
            emitter("hose", 20.0),
        );
        merged.lay(part(&base), low, "").unwrap();
        let over = format!(
            r#"(seed: 2, weather: (humidity: 0.9), materials: {{"a": (roughness: 0.1)}}, emitters: [{}, {}],
                emitter_changes: {{"rain": (rate: 30.0, stop: 4.0)}}, events: [(at: 0.5, what: Start("rain"))])"#,
            emitter("hose", 25.0),
            emitter("new", 5.0),
        );
        merged.lay(part(&over), high, "variants.x.").unwrap();
        let Merged { part, origins } = &merged;
        assert_eq!((part.seed, part.seconds), (Some(2), Some(5.0)));
        assert_eq!((part.weather.humidity, part.weather.temperature_c), (Some(0.9), Some(10.0)));
        assert_eq!(part.materials["a"].roughness, 0.1);
        let rates: Vec<_> = part.emitters.iter().map(|e| (e.name.as_str(), e.rate, e.stop)).collect();
        assert_eq!(rates, [("rain", 30.0, Some(4.0)), ("hose", 25.0, None), ("new", 5.0, None)]);
        assert_eq!(part.events.len(), 2);

        let found =
            |field: &str| origins.find(field).map(|(file, field)| (file.display().to_string(), field));
        let expected = |file: &str, field: &str| Some((file.to_owned(), field.to_owned()));
        assert_eq!(found("events[0].at"), expected("low.ron", "events[0].at"));
        assert_eq!(found("events[1].at"), expected("high.ron", "variants.x.events[0].at"));
        assert_eq!(found("emitters[1].rate"), expected("high.ron", "variants.x.emitters[0].rate"));
        assert_eq!(found("emitters[0].rate"), expected("high.ron", "variants.x.emitter_changes.rain.rate"));
        // What it does not change is where it was.
        assert_eq!(found("emitters[0].stop"), expected("high.ron", "variants.x.emitter_changes.rain.stop"));
        assert_eq!(found("emitters[0].lifetime"), expected("low.ron", "emitters[0].lifetime"));
        assert_eq!(found("emitters[0].keys[0].t"), expected("low.ron", "emitters[0].keys[0].t"));
        assert_eq!(found("emitters[0]"), expected("low.ron", "emitters[0]"));
        assert_eq!(found("materials.a.roughness"), expected("high.ron", "variants.x.materials.a.roughness"));
        assert_eq!(found("materials.a.b"), expected("low.ron", "materials.a.b"));
        assert_eq!(found("seconds"), None);
        assert_eq!(found("events[9].at"), None);
    }

    #[test]
    fn changes_are_of_the_emitter_that_they_were_made_to() {
        let mut merged = Merged::default();
        merged.lay(part(&format!("(emitters: [{}])", emitter("rain", 1.0))), Path::new("a"), "").unwrap();
        for (file, text) in [
            ("b", r#"(emitter_changes: {"rain": (rate: 2.0, flow: LitresPerMinute(3.0))})"#),
            ("c", r#"(emitter_changes: {"rain": (rate: 4.0)})"#),
        ] {
            merged.lay(part(text), Path::new(file), "").unwrap();
        }
        let found = |merged: &Merged, field: &str| {
            let (file, field) = merged.origins.find(&format!("emitters[0].{field}")).unwrap();
            format!("{}: {field}", file.display())
        };
        assert_eq!(found(&merged, "rate"), "c: emitter_changes.rain.rate");
        assert_eq!(found(&merged, "flow"), "b: emitter_changes.rain.flow");
        assert_eq!(found(&merged, "speed"), "a: emitters[0].speed");
        // As a whole it is another one.
        merged.lay(part(&format!("(emitters: [{}])", emitter("rain", 5.0))), Path::new("d"), "").unwrap();
        assert_eq!(found(&merged, "rate"), "d: emitters[0].rate");
    }

    #[test]
    fn an_emitter_that_is_not_there_cannot_be_changed() {
        let change = part(r#"(emitter_changes: {"rain": (rate: 1.0)})"#);
        assert_eq!(Merged::default().lay(change, Path::new("a"), ""), Err("rain".to_owned()));
    }

    #[test]
    fn the_same_name_twice_in_a_file_stays_twice() {
        let twice = format!("(emitters: [{}, {}])", emitter("rain", 1.0), emitter("rain", 2.0));
        let mut merged = Merged::default();
        merged.lay(part(&twice), Path::new("a"), "").unwrap();
        assert_eq!(merged.part.emitters.len(), 2);
    }
}
