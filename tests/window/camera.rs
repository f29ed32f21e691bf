//! From where the scene is seen, and two scenes beside each other.

use super::keys::{SCENARIO, floor_part};
use super::screen::{Sandbox, Scenery, Screen, wait_for};

/// The middle of what panel, bar and maps leave of the window.
pub const MIDDLE: [u32; 2] = [509, 300];
/// A place in the scene from which the mouse may be dragged.
const SCENE: [u32; 2] = [560, 200];
/// The mouse, which is drawn, too, in a part of the scene that is not looked at, and not on the divider.
const ASIDE: [&str; 3] = ["mousemove", "540", "440"];
/// How far a dragged divider may be from the mouse, pixels.
const NEAR: u32 = 8;

/// What is in the middle of the picture, metres.
fn middle(sandbox: &mut Sandbox) -> [f64; 3] {
    let found = sandbox.answer("probe: surface ", |sandbox| sandbox.click(MIDDLE));
    let place = found.split("; ").find_map(|row| row.strip_prefix("place, m ")).unwrap();
    let numbers: Vec<f64> = place.split_whitespace().map(|number| number.parse().unwrap()).collect();
    numbers.try_into().unwrap()
}

/// Distance from the middle of the floor, which is where all coordinates begin.
fn off(place: [f64; 3]) -> f64 {
    place.iter().map(|along| along * along).sum::<f64>().sqrt()
}

/// Does something until the scene is another one, which is returned when it stands still.
fn until_changed(screen: &Screen, sandbox: &Sandbox, what: &str, act: impl Fn()) -> image::RgbImage {
    sandbox.xdotool(&ASIDE);
    let before = screen.still_scene();
    wait_for(what, || {
        act();
        sandbox.xdotool(&ASIDE);
        Some(screen.still_scene()).filter(|scene| *scene != before)
    })
}

/// F shows all of the scene, and that is always the same picture.
fn come_back(screen: &Screen, sandbox: &Sandbox, all: &image::RgbImage) {
    sandbox.key("f");
    wait_for("all of the scene", || (screen.scene() == *all).then_some(()));
}

#[test]
fn the_camera_turns_flies_and_comes_back_and_two_settings_are_seen_beside_each_other() {
    let Some(screen) = Screen::start() else { return };
    // A hose that is shut: all that changes is where it is seen from.
    let scenery = Scenery::new(&SCENARIO.replace("rate: 500.0", "rate: 0.0"));
    scenery.remember("(panel: \"Compare\", tool: Probe, maps: true)");
    let mut sandbox = Sandbox::start_paused(&screen, &scenery);

    // In orbit what it looks at stays in the middle, in flight it does not.
    assert!(off(middle(&mut sandbox)) < 0.05);
    until_changed(&screen, &sandbox, "an orbit", || sandbox.drag("3", SCENE, [-48, 18]));
    assert!(off(middle(&mut sandbox)) < 0.05);
    sandbox.key("c");
    until_changed(&screen, &sandbox, "a look around", || sandbox.drag("3", SCENE, [48, 18]));
    assert!(off(middle(&mut sandbox)) > 0.1);

    // Wherever it goes, F brings it back.
    let all = until_changed(&screen, &sandbox, "all of the scene", || sandbox.key("f"));
    for key in ["w", "a", "e"] {
        let before = screen.scene();
        sandbox.xdotool(&["keydown", key]);
        wait_for(key, || (screen.scene() != before).then_some(()));
        sandbox.xdotool(&["keyup", key]);
        come_back(&screen, &sandbox, &all);
    }
    until_changed(&screen, &sandbox, "a move to the side", || sandbox.drag("2", SCENE, [60, 30]));
    come_back(&screen, &sandbox, &all);
    for (button, what) in [("4", "a closer look"), ("5", "a look from afar")] {
        let scene = until_changed(&screen, &sandbox, what, || sandbox.xdotool(&["click", button]));
        let [seen, before] = [&scene, &all].map(floor_part);
        assert!((button == "4") == (seen > before) && seen != before, "{what}: {seen} after {before}");
        come_back(&screen, &sandbox, &all);
    }

    compare(&screen, &mut sandbox, &all);
    sandbox.key("Escape");
    let status = sandbox.end();
    assert!(status.success(), "{status}");
    assert!(scenery.remembered().contains("flies: true"), "{}", scenery.remembered());
}

/// The button of the panel, which begins and ends the comparison: only buttons are grey over so many rows.
fn button(screen: &Screen) -> [u32; 2] {
    wait_for("a button", || {
        let picture = screen.picture();
        let is_grey = |y: u32| picture.get_pixel(12, y).0 == [60; 3];
        let mut rows = (60..400).filter(|&y| (y..y + 10).all(is_grey));
        rows.next().map(|top| [22, top + 8])
    })
}

/// Column of the line between two scenes.
fn divider(screen: &Screen) -> Option<u32> {
    let picture = screen.picture();
    (100..900).find(|&x| (150..400).all(|y| picture.get_pixel(x, y).0 == [160; 3]))
}

/// Part of the left half of a picture that is much the same so many columns farther right in another one.
fn likeness(one: &image::RgbImage, other: &image::RgbImage, columns: u32) -> f64 {
    let is_like = |x: u32, y: u32| {
        let [one, other] = [one.get_pixel(x, y).0, other.get_pixel(x + columns, y).0];
        one.iter().zip(other).all(|(&one, other)| one.abs_diff(other) < 8)
    };
    let count: usize = (70..420).map(|y| (0..480).filter(|&x| is_like(x, y)).count()).sum();
    count as f64 / (350.0 * 480.0)
}

/// Puts a copy beside the scene, moves the line between the two, and takes the copy away.
fn compare(screen: &Screen, sandbox: &mut Sandbox, alone: &image::RgbImage) {
    sandbox.click(button(screen));
    sandbox.seen();
    sandbox.xdotool(&ASIDE);
    // In the middle of what is left by the panel and by the maps: columns 340 to 678.
    let at = wait_for("a divider", || divider(screen));
    assert!(at.abs_diff(509) <= NEAR, "the divider is at {at}");
    // Without panels, of the window: one camera sees the scene as the other one sees the copy.
    sandbox.key("u");
    let at = wait_for("a divider in the middle", || divider(screen).filter(|at| at.abs_diff(480) <= NEAR));
    let halves = wait_for("two scenes", || {
        let picture = screen.picture();
        (likeness(&picture, &picture, 480) > 0.99).then_some(picture)
    });
    // It is taken before it is dragged: what happens within one slow frame would be no drag.
    sandbox.xdotool(&["mousemove", &(at + 1).to_string(), "300"]);
    sandbox.seen();
    sandbox.xdotool(&["mousedown", "1"]);
    sandbox.seen();
    sandbox.xdotool(&["mousemove", "600", "300"]);
    sandbox.seen();
    sandbox.xdotool(&["mouseup", "1"]);
    sandbox.seen();
    sandbox.xdotool(&ASIDE);
    wait_for("another divider", || divider(screen).filter(|now| now.abs_diff(600) <= NEAR));
    // The middle of the left part is 60 columns farther right.
    wait_for("a part of another size", || {
        let picture = screen.picture();
        let [there, moved] = [0, 60].map(|columns| likeness(&halves, &picture, columns));
        (there < 0.98 && moved > there).then_some(())
    });
    sandbox.key("u");
    sandbox.click(button(screen));
    sandbox.seen();
    sandbox.xdotool(&ASIDE);
    come_back(screen, sandbox, alone);
    assert_eq!(divider(screen), None);
}
