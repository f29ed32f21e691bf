//! Leaving, and being killed, while a scene is on its way to the disk.

use std::fs;
use std::path::Path;

use bevy_weathering::save::SavedScene;

use super::keys::SCENARIO;
use super::screen::{Sandbox, Scenery, Screen, wait_for};
use crate::replay::{files_below, replay, run};

/// What is only there while something is written.
fn temporaries(folder: &Path) -> Vec<String> {
    let is_temporary = |name: &String| name.contains(".saving-") || name.contains(".weathering-");
    files_below(folder).into_iter().filter(is_temporary).collect()
}

#[test]
fn a_scene_that_is_being_saved_is_whole_whenever_the_program_ends() {
    let Some(screen) = Screen::start() else { return };
    // Large maps take seconds to be written.
    assert_eq!(SCENARIO.matches("map_size: 128").count(), 1);
    let scenery = Scenery::new(&SCENARIO.replace("map_size: 128", "map_size: 1024"));
    let saved = scenery.out().join("saved");

    let sandbox = Sandbox::start(&screen, &scenery);
    sandbox.key("ctrl+s");
    sandbox.key("Escape");
    let status = sandbox.end();
    assert!(status.success(), "{status}: {}", scenery.log());
    assert!(SavedScene::read(&saved).unwrap().tick() > 0);
    assert_eq!(temporaries(&scenery.out()), Vec::<String>::new());

    // The next start works. Killed as soon as anything of another scene is there, one of the two is there whole.
    let sandbox = Sandbox::start(&screen, &scenery);
    sandbox.key("ctrl+s");
    wait_for("the files", || {
        let mut entries = fs::read_dir(scenery.out()).unwrap();
        entries.any(|entry| entry.unwrap().file_name().to_string_lossy().starts_with(".saved.")).then_some(())
    });
    sandbox.kill();
    assert!(SavedScene::read(&saved).unwrap().tick() > 0);

    // So does the one after that, and nothing is left of what was half done.
    let mut sandbox = Sandbox::start(&screen, &scenery);
    sandbox.key("ctrl+s");
    sandbox.says(&format!("saved {}", saved.display()));
    // What is being exported is waited for, too.
    sandbox.key("x");
    sandbox.key("Escape");
    assert!(sandbox.end().success());
    // The report comes last.
    assert!(scenery.out().join("export_000/report.json").exists(), "{}", scenery.log());
    assert_eq!(temporaries(&scenery.out()), Vec::<String>::new());
    let last = SavedScene::read(&saved).unwrap();
    let mut on = replay(scenery.scenario(), "--no-render --resume");
    on.arg(&saved).arg("--seconds").arg((f64::from(last.tick() + 30) / 60.0).to_string());
    run(&mut on).assert_success();
}
