//! Sessions that are recorded, and recorded once more.

use std::path::{Path, PathBuf};

use bevy_weathering::scenario::{Action, EventSpec, LoadedScenario, Scenario};

use super::keys::SCENARIO;
use super::screen::{Sandbox, Scenery, Screen, wait_for};

/// Begins to record; the file that is recorded into.
fn begin(sandbox: &mut Sandbox) -> PathBuf {
    let told = sandbox.answer("recording into ", |sandbox| sandbox.key("F9"));
    sandbox.seen();
    sandbox.state("running");
    told.strip_prefix("recording into ").unwrap().into()
}

/// Writes it and ends; what was recorded.
fn end(sandbox: &mut Sandbox, file: &Path) -> LoadedScenario {
    let told = sandbox.answer("recorded ", |sandbox| sandbox.key("F9"));
    assert_eq!(told, format!("recorded {}", file.display()));
    Scenario::load(file).unwrap()
}

/// When an emitter is switched on and off.
fn switches(recorded: &LoadedScenario, emitter: &str) -> Vec<EventSpec> {
    let is_of_it =
        |what: &Action| matches!(what, Action::Start(name) | Action::Stop(name) if name == emitter);
    recorded.scenario.events.iter().filter(|event| is_of_it(&event.what)).cloned().collect()
}

#[test]
fn a_hose_that_was_recorded_sprays_again_while_that_is_recorded() {
    let Some(screen) = Screen::start() else { return };
    let scenery = Scenery::new(SCENARIO);
    let mut sandbox = Sandbox::start(&screen, &scenery);
    let file = begin(&mut sandbox);
    for done in [["mousemove", "480", "270"].as_slice(), &["mousedown", "1"], &["mouseup", "1"]] {
        sandbox.xdotool(done);
        sandbox.seen();
    }
    let first = end(&mut sandbox, &file);
    let sprayed = switches(&first, "hose in the hand");
    let [.., start, stop] = &sprayed[..] else { panic!("{sprayed:?}") };
    assert_eq!((start.what.kind(), stop.what.kind()), ("Start", "Stop"));

    // Nothing is done until that is over; what is recorded is written every five seconds.
    let file = begin(&mut sandbox);
    wait_for("all that was sprayed", || {
        let seconds = f64::from(Scenario::load(&file).ok()?.scenario.seconds);
        (seconds > stop.at && seconds < f64::from(Scenario::MAX_SECONDS)).then_some(())
    });
    let second = end(&mut sandbox, &file);
    assert_eq!(switches(&second, "hose in the hand"), sprayed);
    // That of the second session stays closed.
    let closed = switches(&second, "hose in the hand 2");
    assert!(matches!(&closed[..], [only] if only.at == 0.0 && only.what.kind() == "Stop"), "{closed:?}");
    sandbox.key("Escape");
    let status = sandbox.end();
    assert!(status.success(), "{status}");
}
