//! Sessions that are recorded, gone back in and replayed, in whole apps without a renderer and by the program.

mod emitters;

use std::fs;
use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_weathering::brush::{Brush, BrushKind, BrushQueue, Stroke};
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::emitter::{EmissionDetail, Emitter};
use bevy_weathering::material::PorousMaterial;
use bevy_weathering::record::{
    Beginning, RecordError, Recording, begin, colors_at_hand, go_to, keep_moment, prepare, put_back, save,
    take_back_stroke,
};
use bevy_weathering::scenario::{Action, ByHand, CameraMove, LoadedScenario, Scenario, scene_digest};
use bevy_weathering::schedule::run_tick;
use bevy_weathering::weather::Weather;
use tempfile::TempDir;

use super::common::{scenario_app, scenario_surface, wait_until_ready};
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
        let mut app = scenario_app(base.clone());
        begin(app.world_mut(), base);
        wait_until_ready(&mut app);
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

    fn floor(&mut self, name: &str) -> Entity {
        scenario_surface(self.world(), name)
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
        scene_digest(self.world())
    }

    fn save(&mut self) -> PathBuf {
        save(self.world()).unwrap()
    }
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
fn what_waits_when_somebody_goes_back_is_no_branch() {
    let mut session = Session::new();
    session.play();
    let digest = session.digest();
    // In a pause the camera is moved and the floor painted; no tick has seen it yet.
    let view = Action::Camera(CameraMove { eye: Vec3::X, target: Vec3::ZERO });
    session.world().resource_mut::<Recording>().add(view);
    session.paint(BrushKind::Wet, 1.0, 0.5);
    session.go_to(3.0);
    session.run(80);
    assert_eq!(session.digest(), digest);
    assert_eq!(session.world().resource::<Recording>().seconds(), 7.0);
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
fn strokes_of_a_pause_are_taken_back_one_by_one() {
    let paint = |session: &mut Session, kind, x| {
        session.world().resource_mut::<Recording>().begin_stroke();
        session.paint(kind, x, 0.05);
        // A frame without a tick.
        session.app.update();
    };
    let strokes = |session: &mut Session| session.world().resource::<Recording>().strokes();
    let mut session = Session::new();
    session.run(10);
    paint(&mut session, BrushKind::Dirty, 1.0);
    session.run(10);
    let before = session.digest();
    paint(&mut session, BrushKind::Wet, -1.0);
    paint(&mut session, BrushKind::Dirty, -1.0);
    assert_eq!(strokes(&mut session), 3);
    // They have not been painted, and nobody has to go back.
    for left in [2, 1] {
        assert!(take_back_stroke(session.world()).unwrap());
        assert!(session.world().resource::<Recording>().is_live());
        assert_eq!(strokes(&mut session), left);
        assert_eq!(session.world().resource::<BrushQueue>().0.len(), left - 1);
    }
    assert_eq!(session.digest(), before);
    // Painted in one tick, they still are two.
    paint(&mut session, BrushKind::Wet, -1.0);
    paint(&mut session, BrushKind::Dirty, -1.0);
    session.run(20);
    assert_eq!(strokes(&mut session), 3);
    assert!(take_back_stroke(session.world()).unwrap());
    session.arrive();
    assert_eq!(strokes(&mut session), 2);
    let mut clean = Session::new();
    clean.run(10);
    paint(&mut clean, BrushKind::Dirty, 1.0);
    clean.run(10);
    paint(&mut clean, BrushKind::Wet, -1.0);
    clean.run(20);
    let after = session.digest();
    assert_eq!(after, clean.digest());
    let file = session.save();
    assert_eq!(replayed(&file), after);
    // Where one has gone back to before all strokes, there is none to take back.
    session.go_to(0.25);
    assert_eq!(strokes(&mut session), 0);
    assert!(!take_back_stroke(session.world()).unwrap());
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
    // Whoever goes back takes it along.
    session.go_to(0.5);
    session.run(1);
    let flaws: Vec<_> = session.world().resource::<Recording>().flaws().collect();
    assert_eq!(flaws, [(0.5, "an emitter that is not the scenario's was on")]);
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

/// A scenario that nobody records, without a renderer, when it is there.
pub fn ready(loaded: LoadedScenario) -> App {
    let mut app = scenario_app(loaded);
    wait_until_ready(&mut app);
    app
}
