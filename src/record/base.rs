//! What a recording begins with: the scenario that was open, as it was set, and the tools of the hand as emitters of it.
//!
//! It is written into a folder of its own, with every file that it names, and read again from there. So the session is a run of
//! the very file that will be replayed, and the folder can be given to somebody else.

use std::collections::BTreeSet;
use std::io;
use std::path::Path;

use bevy::prelude::*;

use super::RecordError;
use super::emitters::{free_file, free_name};
use super::file::{text_of, write};
use crate::input::read_file;
use crate::material::{PorousMaterial, StandingWater};
use crate::scenario::{
    Action, CameraKey, EmitterSpec, EventSpec, LoadedScenario, MaterialChange, Scenario, ScenarioSurface,
    WeatherSpec,
};
use crate::weather::Weather;

/// The largest file that is taken along.
const MAX_BYTES: u64 = 1 << 30;

/// An emitter that a session has beside those of its scenario: a hose in the hand, rain that is switched on and off.
#[derive(Debug, Clone)]
pub struct ExtraEmitter {
    /// What it is. Where its name is taken, it gets a number, too. The file of its effect is named by the recording.
    pub spec: EmitterSpec,
    /// Text of an effect file that names no others.
    pub effect: String,
    /// It is on at the start.
    pub is_on: bool,
}

/// How a session begins, where that differs from what its scenario says.
#[derive(Debug, Clone, Default)]
pub struct Beginning {
    /// In place of the scenario's.
    pub weather: Option<Weather>,
    /// What surfaces are made of, by their names.
    pub surfaces: Vec<(String, PorousMaterial, StandingWater)>,
    /// Where it is seen from, in place of the scenario's camera keys.
    pub view: Option<CameraKey>,
    /// Emitters beside the scenario's; they come behind those, in this order.
    pub emitters: Vec<ExtraEmitter>,
}

impl Beginning {
    /// With the weather and the materials of a scenario that runs.
    pub fn of(world: &mut World) -> Self {
        let mut surfaces = world.query::<(&ScenarioSurface, &PorousMaterial, &StandingWater)>();
        let mut order: Vec<_> = surfaces
            .iter(world)
            .map(|(surface, porous, water)| (surface.index, (surface.name.clone(), *porous, *water)))
            .collect();
        order.sort_by_key(|(index, _)| *index);
        Self {
            weather: world.get_resource::<Weather>().copied(),
            surfaces: order.into_iter().map(|(_, surface)| surface).collect(),
            ..default()
        }
    }
}

/// Writes what a session begins with into a folder, and reads it from there: a scenario to switch to, and then to
/// [`begin`](super::begin) with. Needs no world: it can be done on another thread.
///
/// Of the scenario, working hours of emitters become events, so that hands can take over from them; expectations, captures and
/// exports are left out, since they are about another run. It goes on for as long as a scenario may.
///
/// # Errors
/// [`RecordError`]; also if the folder holds a recording of this scenario already. Files that were copied before stay.
pub fn prepare(
    loaded: &LoadedScenario,
    beginning: Beginning,
    folder: &Path,
) -> Result<LoadedScenario, RecordError> {
    let refused = |path: &Path, reason: &str| RecordError::write(path, io::Error::other(reason));
    if folder.ends_with("scenarios") {
        return Err(refused(folder, "a folder of this name shares files with the one above; take another"));
    }
    let name = loaded.file.file_stem().unwrap_or_default().to_string_lossy();
    let file = folder.join(format!("{name}_recorded.ron"));
    if file.exists() {
        return Err(refused(&file, "it is there already"));
    }
    let mut scenario = loaded.scenario.clone();
    let length = scenario.seconds;
    for path in loaded.named_files()? {
        let bytes = read_file(&path, MAX_BYTES).map_err(|source| RecordError::write(&path, source))?;
        let place = folder.join(path.strip_prefix(&loaded.tree).unwrap_or(&path));
        write(&place, &bytes)?;
    }
    let is_of_a_run =
        |what: &Action| matches!(what, Action::Expect(_) | Action::Capture(_) | Action::Export(_));
    scenario.events.retain(|event| !is_of_a_run(&event.what));
    scenario.seconds = Scenario::MAX_SECONDS;
    if let Some(weather) = beginning.weather {
        let Weather { temperature_c, humidity, wind, sun_direction, sun_w_per_m2, drying_speed } = weather;
        scenario.wind = wind;
        scenario.sun.direction = sun_direction;
        scenario.weather = WeatherSpec { temperature_c, humidity, sun_w_per_m2, drying_speed };
    }
    if let Some(view) = beginning.view {
        scenario.camera.keys = vec![CameraKey { t: 0.0, ..view }];
        scenario.events.retain(|event| !matches!(event.what, Action::Camera(_)));
    }
    let mut first = Vec::new();
    switch_by_events(&mut scenario, length, &mut first);
    add_emitters(&mut scenario, beginning.emitters, folder, &mut first)?;
    make_surfaces(&scenario, beginning.surfaces, &mut first);
    // Before what else happens at the start.
    first.append(&mut scenario.events);
    scenario.events = first;
    write(&file, text_of(&scenario, &file, "")?.as_bytes())?;
    Ok(Scenario::load(&file)?)
}

/// Gives every emitter a name of its own, and events in place of working hours. `length`: of the scenario, seconds.
fn switch_by_events(scenario: &mut Scenario, length: f32, events: &mut Vec<EventSpec>) {
    let mut names = BTreeSet::new();
    for spec in &mut scenario.emitters {
        spec.name = free_name(&spec.name, |name| names.contains(name));
        names.insert(spec.name.clone());
        let is_switched = scenario.events.iter().any(
            |event| matches!(&event.what, Action::Start(name) | Action::Stop(name) if *name == spec.name),
        );
        if is_switched {
            continue;
        }
        let (start, stop) = (spec.start, spec.stop.unwrap_or(length));
        let mut add = |at: f32, what: Action| events.push(EventSpec { at: f64::from(at), what });
        // One that stops before it starts never works; by events of both it would start for good.
        let works = start < stop;
        if start > 0.0 || !works {
            add(0.0, Action::Stop(spec.name.clone()));
        }
        if works {
            if start > 0.0 {
                add(start, Action::Start(spec.name.clone()));
            }
            add(stop, Action::Stop(spec.name.clone()));
        }
        (spec.start, spec.stop) = (0.0, None);
    }
}

fn add_emitters(
    scenario: &mut Scenario,
    emitters: Vec<ExtraEmitter>,
    folder: &Path,
    events: &mut Vec<EventSpec>,
) -> Result<(), RecordError> {
    for ExtraEmitter { mut spec, effect, is_on } in emitters {
        // The scenario may be a recording, with tools of its own.
        spec.name = free_name(&spec.name, |name| scenario.emitters.iter().any(|other| other.name == name));
        spec.effect = free_file(folder, &spec.name);
        write(&folder.join(&spec.effect), effect.as_bytes())?;
        (spec.start, spec.stop) = (0.0, None);
        if !is_on {
            events.push(EventSpec { at: 0.0, what: Action::Stop(spec.name.clone()) });
        }
        scenario.emitters.push(spec);
    }
    Ok(())
}

/// Materials that were set become events of the start.
fn make_surfaces(
    scenario: &Scenario,
    surfaces: Vec<(String, PorousMaterial, StandingWater)>,
    events: &mut Vec<EventSpec>,
) {
    for (name, porous, water) in surfaces {
        let Some(first) = scenario.surface_number(&name).and_then(|surface| scenario.made_of(surface)) else {
            continue;
        };
        let porous = (porous != first.porous).then_some(porous);
        let water = (water != first.water).then_some(water);
        if porous.is_some() || water.is_some() {
            let change = MaterialChange { surface: name, material: None, porous, model: None, water };
            events.push(EventSpec { at: 0.0, what: Action::Material(change) });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = r#"(
        seconds: 3.0,
        camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
        materials: {"clay": ()},
        surfaces: [(name: "a", mesh: Ground(size: (1.0, 1.0), cells: (1, 1)), material: "clay")],
        emitters: [
            (name: "tap", effect: "effects/tap.effect.ron", rate: 1.0, speed: 1.0, start: 1.0, stop: 2.0,
             keys: [(position: (0.0, 2.0, 0.0), target: (0.0, 0.0, 0.0))]),
            (name: "tap", effect: "effects/tap.effect.ron", rate: 1.0, speed: 1.0,
             keys: [(position: (0.0, 2.0, 0.0), target: (0.0, 0.0, 0.0))]),
        ],
        events: [(at: 2.0, what: Expect(quantity: Particles, above: 1.0)), (at: 2.0, what: Capture("x")),
            (at: 2.0, what: Export("x"))],
    )"#;

    fn scene(folder: &Path) -> LoadedScenario {
        std::fs::create_dir_all(folder.join("effects")).unwrap();
        std::fs::write(folder.join("effects/tap.effect.ron"), "()").unwrap();
        std::fs::write(folder.join("scene.ron"), SCENE).unwrap();
        Scenario::load(&folder.join("scene.ron")).unwrap()
    }

    fn hose() -> ExtraEmitter {
        let key = crate::scenario::EmitterKey { t: 0.0, position: Vec3::Y, target: Vec3::ZERO };
        let spec = EmitterSpec {
            name: "hose in the hand".into(),
            effect: String::new(),
            rate: 10.0,
            shape: default(),
            flow: default(),
            speed: Some(2.0),
            spread_deg: 0.0,
            lifetime: 1.0,
            start: 0.0,
            stop: None,
            keys: vec![key],
        };
        ExtraEmitter { spec, effect: "(volume_mm3: 3.0)".into(), is_on: false }
    }

    #[test]
    fn what_is_written_is_whole_and_begins_as_it_was_set() {
        let (from, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let loaded = scene(from.path());
        let porous = PorousMaterial { sorptivity: 0.25, ..default() };
        let beginning = Beginning {
            weather: Some(Weather { humidity: 0.9, sun_w_per_m2: 300.0, ..default() }),
            surfaces: vec![("a".into(), porous, StandingWater::default())],
            view: Some(CameraKey { t: 5.0, eye: Vec3::X, target: Vec3::ZERO }),
            emitters: vec![hose()],
        };
        let folder = to.path().join("new");
        let base = prepare(&loaded, beginning.clone(), &folder).unwrap();
        let scenario = &base.scenario;
        assert!(base.file.starts_with(&folder) && base.check_content().is_ok());
        assert_eq!((scenario.weather.humidity, scenario.weather.sun_w_per_m2), (0.9, 300.0));
        assert_eq!((scenario.camera.keys[0].t, scenario.camera.keys[0].eye), (0.0, Vec3::X));
        assert_eq!(scenario.seconds, Scenario::MAX_SECONDS);
        let names: Vec<_> = scenario.emitters.iter().map(|emitter| emitter.name.as_str()).collect();
        assert_eq!(names, ["tap", "tap 2", "hose in the hand"]);
        let events: Vec<_> = scenario.events.iter().map(|event| (event.at, event.what.kind())).collect();
        let expected = [
            (0.0, "Stop"),
            (1.0, "Start"),
            (2.0, "Stop"),
            // Of the second one, at the end of the scenario.
            (3.0, "Stop"),
            (0.0, "Stop"),
            (0.0, "Material"),
        ];
        assert_eq!(events, expected);
        // It is not written over, and what is recorded can be recorded again.
        assert!(prepare(&loaded, beginning.clone(), &folder).is_err());
        let again = prepare(&base, beginning, &to.path().join("again")).unwrap();
        let names: Vec<_> = again.scenario.emitters.iter().map(|emitter| emitter.name.as_str()).collect();
        assert_eq!(names, ["tap", "tap 2", "hose in the hand", "hose in the hand 2"]);
        // What was done with the first hose is not done with the second.
        let switches = |scenario: &Scenario, of: &str| {
            let is_of_it =
                |what: &Action| matches!(what, Action::Start(name) | Action::Stop(name) if name == of);
            scenario.events.iter().filter(|event| is_of_it(&event.what)).cloned().collect::<Vec<_>>()
        };
        let first = switches(scenario, "hose in the hand");
        assert_eq!(switches(&again.scenario, "hose in the hand"), first);
        let stop = EventSpec { at: 0.0, what: Action::Stop("hose in the hand 2".into()) };
        assert_eq!(switches(&again.scenario, "hose in the hand 2"), [stop]);
    }

    #[test]
    fn hours_become_events_and_who_never_works_never_does() {
        let folder = tempfile::tempdir().unwrap();
        let base = scene(folder.path()).scenario;
        let switched = |start: f32, stop: Option<f32>| -> Vec<_> {
            let mut scenario = base.clone();
            scenario.emitters.truncate(1);
            (scenario.emitters[0].start, scenario.emitters[0].stop) = (start, stop);
            let mut events = Vec::new();
            switch_by_events(&mut scenario, 3.0, &mut events);
            let hours = (scenario.emitters[0].start, scenario.emitters[0].stop);
            assert_eq!(hours, (0.0, None));
            events.iter().map(|event| (event.at, event.what.kind())).collect()
        };
        assert_eq!(switched(0.0, None), [(3.0, "Stop")]);
        assert_eq!(switched(0.5, Some(1.0)), [(0.0, "Stop"), (0.5, "Start"), (1.0, "Stop")]);
        for (start, stop) in [(2.0, Some(1.0)), (1.0, Some(1.0)), (0.0, Some(0.0)), (4.0, None)] {
            assert_eq!(switched(start, stop), [(0.0, "Stop")], "{start} {stop:?}");
        }
    }

    #[test]
    fn emitters_of_like_names_keep_effects_of_their_own() {
        let (from, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let loaded = scene(from.path());
        let ExtraEmitter { spec, .. } = hose();
        let spec = EmitterSpec { name: "hose_in_the_hand".into(), ..spec };
        let like = ExtraEmitter { spec, effect: "(volume_mm3: 5.0)".into(), is_on: true };
        let beginning = Beginning { emitters: vec![hose(), like], ..default() };
        let base = prepare(&loaded, beginning, &to.path().join("new")).unwrap();
        let text = |name: &str| {
            let spec = base.scenario.emitters.iter().find(|emitter| emitter.name == name).unwrap();
            std::fs::read_to_string(base.tree.join(&spec.effect)).unwrap()
        };
        assert_eq!(text("hose in the hand"), "(volume_mm3: 3.0)");
        assert_eq!(text("hose_in_the_hand"), "(volume_mm3: 5.0)");
    }

    #[test]
    fn folders_that_cannot_be_written_are_named() {
        let from = tempfile::tempdir().unwrap();
        let loaded = scene(from.path());
        let blocked = from.path().join("blocked");
        std::fs::write(&blocked, "a file").unwrap();
        for folder in [blocked.join("inside"), from.path().join("scenarios")] {
            let error = prepare(&loaded, Beginning::default(), &folder).unwrap_err().to_string();
            assert!(error.contains(&*folder.to_string_lossy()), "{error}");
        }
    }
}
