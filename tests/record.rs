//! Sessions that are recorded, gone back in and replayed, in whole apps without a renderer and by the program.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bevy::asset::AssetPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::WeatheringPlugins;
use bevy_weathering::brush::{Brush, BrushKind, BrushQueue, Stroke};
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::emitter::{EmissionDetail, Emitter};
use bevy_weathering::material::PorousMaterial;
use bevy_weathering::matter::SurfaceMatter;
use bevy_weathering::overlay::{CpuOverlayPlugin, GpuOverlayPlugin};
use bevy_weathering::record::{
    Beginning, ExtraEmitter, RecordError, RecordPlugin, Recording, begin, colors_at_hand, go_to, keep_moment,
    prepare, put_back, save, take_back_stroke,
};
use bevy_weathering::scenario::{
    ByHand, Digest, EmitterKey, EmitterSpec, LoadedScenario, Scenario, ScenarioPlugin, ScenarioStatus,
    ScenarioSurface, amounts_digest,
};
use bevy_weathering::schedule::run_tick;
use bevy_weathering::weather::Weather;
use bevy_weathering::wetting::SurfaceWater;
use tempfile::TempDir;

use super::replay::{replay, run};

/// A tap over one of two floors; its story of its own ends it after two seconds, and the air gets drier.
const SCENE: &str = r#"(
    seconds: 2.0,
    tick_hz: 20,
    camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
    materials: {"brick": (porous: (capacity_mm: 2.0, sorptivity: 2.0))},
    surfaces: [
        (name: "left", mesh: Ground(size: (1.0, 1.0), cells: (2, 2)), material: "brick",
         position: (-1.0, 0.0, 0.0), maps: (map_size: 64, wrap_u: Clamp, wrap_v: Clamp)),
        (name: "right", mesh: Ground(size: (1.0, 1.0), cells: (2, 2)), material: "brick",
         position: (1.0, 0.0, 0.0), maps: (map_size: 64, wrap_u: Clamp, wrap_v: Clamp)),
    ],
    emitters: [(name: "tap", effect: "tap.effect.ron", rate: 100.0, speed: 2.0, spread_deg: 15.0,
                keys: [(position: (-1.0, 0.5, 0.0), target: (-1.0, 0.0, 0.0)),
                       (t: 2.0, position: (-0.8, 0.6, 0.1), target: (-1.0, 0.0, 0.0))])],
    events: [(at: 1.0, what: Weather(humidity: 0.2, drying_speed: 40.0, over: 0.5))],
)"#;

const TAP: &str = "(volume_mm3: 50.0, stamp_radius: 0.05, diffuse: (color: (0.3, 0.2, 0.1), opacity: 0.5))";

/// A session in a folder of its own.
struct Session {
    folder: TempDir,
    app: App,
}

impl Session {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("tap.effect.ron"), TAP).unwrap();
        fs::write(folder.path().join("scene.ron"), SCENE).unwrap();
        let loaded = Scenario::load(&folder.path().join("scene.ron")).unwrap();
        let base = prepare(&loaded, Beginning::default(), &folder.path().join("recorded")).unwrap();
        let mut app = app(base.clone());
        app.add_plugins(RecordPlugin);
        begin(app.world_mut(), base);
        wait(&mut app);
        Self { folder, app }
    }

    fn world(&mut self) -> &mut World {
        self.app.world_mut()
    }

    /// So many ticks, a frame each, with a moment kept wherever one is wanted.
    fn run(&mut self, ticks: u32) {
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
        for _ in 0..ticks {
            self.app.update();
            if self.world().resource::<Recording>().wants_moment() {
                self.keep();
            }
        }
        self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    }

    fn keep(&mut self) {
        let colors = colors_at_hand(self.world()).unwrap();
        keep_moment(self.world(), colors).unwrap();
    }

    /// Goes on until a second that is gone to is reached.
    fn arrive(&mut self) {
        self.app.update();
        put_back(self.world()).unwrap();
        for _ in 0..10_000 {
            if !self.world().resource::<Recording>().is_catching_up() {
                return;
            }
            run_tick(self.world());
        }
        panic!("never there");
    }

    fn go_to(&mut self, seconds: f64) {
        go_to(self.world(), seconds).unwrap();
        self.arrive();
        assert_eq!(self.world().resource::<WeatheringClock>().seconds(), seconds);
    }

    fn tap(&mut self) -> Mut<'_, Emitter> {
        let world = self.world();
        let tap = world.query_filtered::<Entity, With<Emitter>>().single(world).unwrap();
        world.get_mut::<Emitter>(tap).unwrap()
    }

    /// Adds an emitter over the right floor, in a tick.
    fn add_spray(&mut self) -> Entity {
        self.world().resource_mut::<Recording>().add_emitter(spray());
        self.run(1);
        self.emitter("spray")
    }

    fn emitter(&mut self, name: &str) -> Entity {
        let world = self.world();
        let mut emitters = world.query_filtered::<(Entity, &Name), With<Emitter>>();
        emitters.iter(world).find(|(_, other)| other.as_str() == name).unwrap().0
    }

    fn has(&mut self, emitter: Entity) -> bool {
        self.world().resource::<Recording>().has_emitter(emitter)
    }

    fn floor(&mut self, name: &str) -> Entity {
        let world = self.world();
        let mut surfaces = world.query::<(Entity, &ScenarioSurface)>();
        surfaces.iter(world).find(|(_, surface)| surface.name == name).unwrap().0
    }

    fn paint(&mut self, kind: BrushKind, x: f32, strength: f32) {
        let surface = Some(self.floor(if x < 0.0 { "left" } else { "right" }));
        let brush = Brush { kind, point: Vec3::new(x, 0.0, 0.1), radius: 0.3, strength };
        self.world().resource_mut::<BrushQueue>().0.push(Stroke { brush, surface });
    }

    /// Some of everything that can be done, in seven seconds.
    fn play(&mut self) {
        self.run(13);
        self.world().resource_mut::<Recording>().begin_stroke();
        self.paint(BrushKind::Wet, 1.0, 0.4);
        self.run(3);
        self.paint(BrushKind::Dirty, 0.9, 0.02);
        self.run(10);
        // In the hand, and back and forth.
        let world = self.world();
        let tap = world.query_filtered::<Entity, With<Emitter>>().single(world).unwrap();
        world.entity_mut(tap).insert(ByHand);
        for step in 0..30 {
            let at = Vec3::new((step as f32 * 0.3).sin(), 0.7, 0.0);
            let aim = Transform::from_translation(at).looking_at(at * Vec3::X, Vec3::Z);
            *self.world().get_mut::<Transform>(tap).unwrap() = aim;
            self.run(1);
        }
        self.tap().rate = 60.0;
        self.run(10);
        self.tap().enabled = false;
        self.world().resource_mut::<Weather>().wind = Vec3::new(0.3, 0.0, -0.2);
        self.run(10);
        self.tap().enabled = true;
        let floor = self.floor("left");
        self.world().get_mut::<PorousMaterial>(floor).unwrap().sorptivity = 0.4;
        self.run(20);
        self.world().resource_mut::<Recording>().begin_stroke();
        self.paint(BrushKind::Dry, -1.0, 0.8);
        self.run(44);
    }

    fn digest(&mut self) -> String {
        digest(self.world())
    }

    fn save(&mut self) -> PathBuf {
        save(self.world()).unwrap()
    }
}

/// An emitter that no scenario has.
fn spray() -> ExtraEmitter {
    let spec = EmitterSpec {
        name: "spray".into(),
        effect: String::new(),
        rate: 80.0,
        shape: default(),
        flow: default(),
        speed: Some(2.0),
        spread_deg: 10.0,
        lifetime: 3.0,
        start: 0.0,
        stop: None,
        keys: vec![EmitterKey { t: 0.0, position: Vec3::new(1.0, 0.6, 0.0), target: Vec3::X }],
    };
    ExtraEmitter { spec, effect: "(volume_mm3: 30.0, stamp_radius: 0.04)".into(), is_on: true }
}

fn app(loaded: LoadedScenario) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin))
        .add_plugins(WeatheringPlugins.build().disable::<GpuOverlayPlugin>())
        .add_plugins((CpuOverlayPlugin, ScenarioPlugin::new(loaded, false).unwrap()))
        .insert_resource(TimeUpdateStrategy::FixedTimesteps(0));
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::from_secs(3600));
    app
}

/// Until the scene is there.
fn wait(app: &mut App) {
    app.finish();
    app.cleanup();
    for _ in 0..10_000 {
        app.update();
        match app.world().resource::<ScenarioStatus>() {
            ScenarioStatus::Ready => {
                // What loads sees that it is live.
                app.update();
                return;
            }
            ScenarioStatus::Loading => std::thread::sleep(Duration::from_millis(1)),
            ScenarioStatus::Failed(error) => panic!("{error}"),
        }
    }
    panic!("never ready");
}

fn digest(world: &mut World) -> String {
    let impacts = *world.resource::<Digest>();
    let mut surfaces = world.query::<(&ScenarioSurface, &SurfaceWater, &SurfaceMatter)>();
    let mut order: Vec<_> = surfaces.iter(world).collect();
    order.sort_by_key(|(surface, ..)| surface.index);
    amounts_digest(&impacts, order.into_iter().map(|(_, water, matter)| (water, matter)))
}

/// What the program makes of a recording.
fn replayed(file: &Path) -> String {
    let report = run(&mut replay(file, "--no-render")).report();
    report["digest"].as_str().unwrap().to_owned()
}

#[test]
fn a_session_replays_to_the_same_digest() {
    let mut session = Session::new();
    session.play();
    let digest = session.digest();
    let file = session.save();
    let recording = session.world().resource::<Recording>();
    assert_eq!(recording.flaws().count(), 0);
    assert!(recording.len() > 15 && (recording.seconds() - 7.0).abs() < 1e-9, "{}", recording.len());
    assert_eq!(replayed(&file), digest);
    let text = fs::read_to_string(&file).unwrap();
    assert!(text.contains(&format!("// Digest after 140 ticks: {digest}")), "{text}");
    for kind in ["Move(", "Start(", "Stop(", "Adjust(", "Weather(", "Material(", "Brush("] {
        assert!(text.contains(kind), "{kind}: {text}");
    }
    // It is checked by the program, too, and tells nothing of flaws.
    assert!(!text.contains("flaws"), "{text}");
    // What is not done comes out otherwise.
    let mut quiet = Session::new();
    quiet.run(140);
    assert_ne!(quiet.digest(), digest);
}

#[test]
fn a_session_that_was_gone_back_in_goes_on_as_if_it_had_not_been() {
    let mut session = Session::new();
    session.play();
    let digest = session.digest();
    assert_eq!(session.world().resource::<Recording>().moments().0, 1);
    // From a moment, from the start, from before the hand took over, and back to the end.
    for seconds in [6.0, 1.5, 5.0, 0.0, 7.0] {
        session.go_to(seconds);
        let left = ((7.0 - seconds) * 20.0).round() as u32;
        session.run(left);
        assert_eq!(session.digest(), digest, "from second {seconds}");
    }
    let file = session.save();
    assert_eq!(replayed(&file), digest);
    let error = go_to(session.world(), 7.5).unwrap_err();
    assert!(matches!(error, RecordError::NotRecorded { .. }), "{error}");
    assert!(go_to(session.world(), f64::NAN).is_err());
}

#[test]
fn a_branch_is_another_session_and_the_old_one_is_kept() {
    let mut session = Session::new();
    session.play();
    let old = session.digest();
    session.go_to(3.0);
    session.run(10);
    session.paint(BrushKind::Wet, 0.9, 1.0);
    session.run(30);
    let new = session.digest();
    assert_eq!(session.world().resource::<Recording>().seconds(), 5.0);
    let notes = session.world().resource_mut::<Recording>().take_notes();
    assert!(notes.iter().any(|note| note.contains("scene_recorded_1.ron")), "{notes:?}");
    let file = session.save();
    assert_eq!(replayed(&file), new);
    assert_eq!(replayed(&file.with_file_name("scene_recorded_1.ron")), old);
    assert_ne!(old, new);
}

#[test]
fn a_stroke_that_is_taken_back_has_never_been() {
    let mut session = Session::new();
    session.run(10);
    session.world().resource_mut::<Recording>().begin_stroke();
    session.paint(BrushKind::Dirty, 1.0, 0.05);
    session.run(100);
    session.world().resource_mut::<Recording>().begin_stroke();
    session.paint(BrushKind::Wet, -1.0, 0.5);
    session.run(20);
    let (before, strokes) = (session.digest(), session.world().resource::<Recording>().strokes());
    assert_eq!(strokes, 2);
    for left in [1, 0] {
        assert!(take_back_stroke(session.world()).unwrap());
        session.arrive();
        assert_eq!(session.world().resource::<Recording>().strokes(), left);
    }
    assert!(!take_back_stroke(session.world()).unwrap());
    assert_eq!(session.world().resource::<WeatheringClock>().tick(), 130);
    let mut clean = Session::new();
    clean.run(130);
    let after = session.digest();
    assert_eq!(after, clean.digest());
    assert_ne!(after, before);
    let file = session.save();
    assert_eq!(replayed(&file), after);
}

#[test]
fn emitters_that_come_and_go_replay_to_the_same_digest() {
    let mut session = Session::new();
    // A moment is kept before it is there, and one after.
    session.run(110);
    let spray = session.add_spray();
    assert!(session.has(spray));
    session.run(20);
    session.world().get_mut::<Emitter>(spray).unwrap().rate = 160.0;
    session.run(40);
    session.world().resource_mut::<Recording>().remove_emitter(spray);
    session.run(1);
    assert!(!session.has(spray) && !session.world().get::<Emitter>(spray).unwrap().enabled);
    let tap = session.emitter("tap");
    session.world().resource_mut::<Recording>().remove_emitter(tap);
    session.run(48);
    let digest = session.digest();
    let file = session.save();
    assert_eq!(replayed(&file), digest);
    let text = fs::read_to_string(&file).unwrap();
    let done = ["Start(\"spray\")", "Adjust(emitter:\"spray\"", "Stop(\"spray\")", "Stop(\"tap\")"];
    let plain: String = text.split_whitespace().collect();
    assert!(done.iter().all(|event| plain.contains(event)), "{text}");
    assert!(file.with_file_name("recorded_spray.effect.ron").is_file());
    // It is there in its own time alone, wherever one comes from.
    for (seconds, is_there) in [(5.25, false), (7.0, true), (0.0, false), (9.0, false), (6.0, true)] {
        session.go_to(seconds);
        assert_eq!((session.has(spray), session.has(tap)), (is_there, seconds < 9.0), "second {seconds}");
        let left = 220 - (seconds * 20.0).round() as u32;
        session.run(left);
        assert_eq!(session.digest(), digest, "from second {seconds}");
    }
    let recording = session.world().resource::<Recording>();
    assert_eq!((recording.flaws().count(), recording.seconds()), (0, 11.0));
    let mut quiet = Session::new();
    quiet.run(220);
    assert_ne!(quiet.digest(), digest);
}

#[test]
fn a_branch_from_before_an_emitter_knows_nothing_of_it() {
    let mut session = Session::new();
    session.run(110);
    let first = session.add_spray();
    session.run(39);
    let (old, events) = (session.digest(), session.world().resource::<Recording>().len());
    session.go_to(5.25);
    // What is done to it before its time is put back, and no branch.
    session.world().get_mut::<Emitter>(first).unwrap().rate = 7.0;
    session.world().get_mut::<Emitter>(first).unwrap().enabled = true;
    session.run(1);
    let emitter = session.world().get::<Emitter>(first).unwrap();
    assert_eq!((emitter.rate, emitter.enabled), (80.0, false));
    assert_eq!(session.world().resource::<Recording>().len(), events);
    // Another one of the same name.
    let second = session.add_spray();
    assert!(session.has(second) && session.world().get_entity(first).is_err());
    session.run(33);
    let new = session.digest();
    let file = session.save();
    assert_eq!(replayed(&file), new);
    assert_eq!(replayed(&file.with_file_name("scene_recorded_1.ron")), old);
    assert!(file.with_file_name("recorded_spray_2.effect.ron").is_file());
    // And none at all: what is left of it is a file.
    session.go_to(5.0);
    session.paint(BrushKind::Wet, 1.0, 0.2);
    session.run(20);
    let digest = session.digest();
    let file = session.save();
    assert_eq!(replayed(&file), digest);
    assert_eq!(Scenario::load(&file).unwrap().scenario.emitters.len(), 1);
    assert!(session.world().get_entity(second).is_err());
}

#[test]
fn emitters_that_cannot_be_recorded_are_refused() {
    let mut session = Session::new();
    session.run(3);
    let mut wrong = [spray(), spray(), spray(), spray()];
    wrong[0].spec.rate = -3.0;
    wrong[1].effect = "(stamps: Images(diffuse: \"spots.png\", variants: 2))".into();
    wrong[2].effect = "(volume_mm3: NaN)".into();
    wrong[3].spec.keys.clear();
    for emitter in wrong {
        session.world().resource_mut::<Recording>().add_emitter(emitter);
    }
    session.run(3);
    let notes = session.world().resource_mut::<Recording>().take_notes();
    for named in ["rate", "pictures", "volume_mm3", "keys"] {
        assert!(notes.iter().any(|note| note.contains(named)), "{named}: {notes:?}");
    }
    let recorded = session.folder.path().join("recorded");
    let mut files: Vec<_> = fs::read_dir(recorded)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    assert_eq!(files, ["scene_recorded.ron", "tap.effect.ron"]);
    // One that is off at first, twice.
    for _ in 0..2 {
        let off = ExtraEmitter { is_on: false, ..spray() };
        session.world().resource_mut::<Recording>().add_emitter(off);
    }
    session.run(5);
    let again = session.emitter("spray 2");
    assert!(!session.world().get::<Emitter>(again).unwrap().enabled);
    session.world().get_mut::<Emitter>(again).unwrap().enabled = true;
    session.run(30);
    let digest = session.digest();
    let file = session.save();
    assert_eq!(replayed(&file), digest);
}

#[test]
fn what_cannot_be_recorded_is_refused_or_told() {
    let mut session = Session::new();
    session.run(5);
    session.world().resource_mut::<Weather>().sun_w_per_m2 = 700.0;
    session.world().resource_mut::<EmissionDetail>().set_factor(0.1);
    session.tap().rate = -5.0;
    session.run(5);
    let world = session.world();
    assert_eq!(
        (world.resource::<Weather>().sun_w_per_m2, world.resource::<EmissionDetail>().factor()),
        (0.0, 1.0)
    );
    let notes = world.resource_mut::<Recording>().take_notes();
    assert!(notes.iter().any(|note| note.contains("sun")), "{notes:?}");
    assert!(notes.iter().any(|note| note.contains("rate") && note.contains("-5")), "{notes:?}");
    assert_eq!(session.tap().rate, 100.0);
    // The scenario is just changing it.
    session.run(12);
    session.world().resource_mut::<Weather>().humidity = 0.9;
    session.run(2);
    let notes = session.world().resource_mut::<Recording>().take_notes();
    assert!(notes.iter().any(|note| note.contains("weather")), "{notes:?}");
    let (file, digest) = (session.save(), session.digest());
    assert_eq!(replayed(&file), digest, "what was refused has not happened");
    // An emitter that is nobody's.
    session.world().spawn(Emitter::default());
    session.run(5);
    let file = session.save();
    let outcome = run(&mut replay(&file, "--no-render"));
    outcome.assert_success();
    assert!(outcome.stderr.contains("an emitter that is not the scenario's"), "{}", outcome.stderr);
    assert!(fs::read_to_string(&file).unwrap().contains("flaws: ["));
}

#[test]
fn a_place_that_cannot_be_written_is_an_error_and_the_recording_goes_on() {
    let mut session = Session::new();
    session.run(5);
    let folder = session.folder.path().join("recorded");
    fs::remove_dir_all(&folder).unwrap();
    fs::write(&folder, "in the way").unwrap();
    let error = save(session.world()).unwrap_err().to_string();
    assert!(error.contains("scene_recorded.ron"), "{error}");
    assert_eq!(fs::read_to_string(&folder).unwrap(), "in the way");
    fs::remove_file(&folder).unwrap();
    session.run(5);
    let file = session.save();
    assert!(Scenario::load(&file).is_err(), "its effect is gone");
    fs::write(folder.join("tap.effect.ron"), TAP).unwrap();
    let digest = session.digest();
    assert_eq!(replayed(&file), digest);
}
