//! Other scenes while the window is open: by their path, and dropped on the window.

use super::drop::drop_file;
use super::keys::{SCENARIO, floor_part};
use super::screen::{Sandbox, Scenery, Screen, wait_for};

/// Column of the screen in which fields of the panel are found, behind what is written in them.
const COLUMN: u32 = 210;
/// Column in which they are clicked: the mouse is drawn, too.
const MOUSE: u32 = 260;

/// Whether the title names the file, and what it does.
fn shows(sandbox: &Sandbox, file: &str, state: &str) -> bool {
    let title = sandbox.title();
    title.contains(&format!("/{file}")) && title.ends_with(&format!("({state})"))
}

/// First row of the field for a path, the second of those that are dark: the first one has the folder.
fn field(screen: &Screen) -> Option<u32> {
    let picture = screen.picture();
    let is_dark = |y: u32| picture.get_pixel(COLUMN, y).0 == [17, 19, 22];
    (20..400).filter(|&y| is_dark(y) && !is_dark(y - 1)).nth(1)
}

/// Types a path into the field, in which nothing is yet.
fn enter(screen: &Screen, sandbox: &Sandbox, path: &str) {
    let top = wait_for("the field", || field(screen));
    // What comes in the same slow frame as the click is not for the scene, either.
    let [x, y] = [MOUSE, top + 10].map(|along| along.to_string());
    sandbox.xdotool(&["mousemove", &x, &y, "click", "1", "key", "m", "p", "c", "v"]);
    // A field that is being edited has a light frame.
    wait_for("the field to be edited", || {
        let picture = screen.picture();
        let is_light = |y: u32| picture.get_pixel(COLUMN, y).0.iter().all(|&byte| byte > 120);
        (top - 3..top + 2).any(is_light).then_some(())
    });
    // The field may have some of it.
    sandbox.xdotool(&["key", "End", "BackSpace", "BackSpace", "BackSpace", "BackSpace"]);
    sandbox.xdotool(&["type", "--delay", "20", path]);
    sandbox.key("Return");
}

#[test]
fn scenes_are_opened_by_a_path_and_dropped_on_the_window() {
    let Some(screen) = Screen::start() else { return };
    let scenery = Scenery::new(SCENARIO);
    // Letters that do something where they are not typed into a text.
    let model = scenery.copy("models/bunny_1000.glb", "pumpcv.glb");
    // While it stands still nothing in the bar comes or goes, so that panels stay where they are.
    let mut sandbox = Sandbox::start_paused(&screen, &scenery);
    wait_for("the floor", || (floor_part(&screen.scene()) > 0.4).then_some(()));

    // What is no scene is told, and the scene stays.
    let (window, effect) = (sandbox.window(), scenery.effect());
    sandbox.answer("hose.effect.ron", |_| drop_file(screen.display(), window, &effect));
    assert!(shows(&sandbox, "scene.ron", "paused"), "{}", sandbox.title());

    let path = model.to_str().unwrap();
    let told = sandbox.answer("opened ", |sandbox| enter(&screen, sandbox, path));
    assert_eq!(told, format!("opened {path}"));
    wait_for("the model", || shows(&sandbox, "pumpcv.glb", "running").then_some(()));
    wait_for("its picture", || (floor_part(&screen.scene()) < 0.1).then_some(()));

    let scenario = scenery.scenario();
    let told = sandbox.answer("opened ", |_| drop_file(screen.display(), window, &scenario));
    assert_eq!(told, format!("opened {}", scenario.display()));
    wait_for("the scene", || shows(&sandbox, "scene.ron", "running").then_some(()));
    wait_for("its picture", || (floor_part(&screen.scene()) > 0.4).then_some(()));

    // Settings are written when one of them has changed, and when the program ends at the latest.
    sandbox.key("Next");
    sandbox.key("Escape");
    let status = sandbox.end();
    assert!(status.success(), "{status}");
    // What was typed did nothing else.
    let remembered = scenery.remembered();
    for kept in [
        "panel: \"Hose\"",
        "panels: true",
        "maps: false",
        "plots: false",
        "tool: Hose",
        "flies: false",
        "shade: Off",
    ] {
        assert!(remembered.contains(kept), "not {kept}: {remembered}");
    }
}
