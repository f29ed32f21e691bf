//! Emitters that come and go while a session is recorded.

use std::fs;

use bevy::prelude::*;
use bevy_weathering::brush::BrushKind;
use bevy_weathering::emitter::Emitter;
use bevy_weathering::record::{ExtraEmitter, Recording};
use bevy_weathering::scenario::{EmitterKey, EmitterSpec, Scenario};

use super::{Session, replayed};

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

impl Session {
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
    let recording = session.world().resource::<Recording>();
    let ticks = [spray, tap].map(|emitter| recording.ticks_of(emitter));
    assert_eq!(ticks, [Some(111..172), Some(0..173)]);
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
