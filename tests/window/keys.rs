//! Keys and mouse: what they do is seen in the pictures that the program takes.

use std::time::Duration;

use super::screen::{Sandbox, Scenery, Screen, wait_for};

/// A little scene that a software driver draws fast: a floor that a hose wets from the first moment.
pub const SCENARIO: &str = r#"(
    seconds: 600.0,
    camera: (keys: [(eye: (0.0, 1.5, 3.0), target: (0.0, 0.0, 0.0))]),
    materials: {"clay": (color: (0.5, 0.23, 0.13), porous: (t_fill: 0.0))},
    surfaces: [(name: "floor", mesh: Ground(size: (4.0, 4.0), cells: (2, 2)), material: "clay",
        maps: (map_size: 128, wrap_u: Clamp, wrap_v: Clamp))],
    emitters: [(name: "hose", effect: "hose.effect.ron", rate: 500.0, shape: Cone(radius: 0.01), speed: 8.0,
        spread_deg: 12.0, keys: [(position: (0.0, 1.2, 1.5), target: (0.0, 0.0, 0.0))])],
)"#;

fn sum(pixel: &image::Rgb<u8>) -> u32 {
    pixel.0.iter().map(|&byte| u32::from(byte)).sum()
}

/// Part of the pixels that show the floor, which is redder than the sky.
pub fn floor_part(picture: &image::RgbImage) -> f64 {
    let floor = picture.pixels().filter(|pixel| pixel.0[0] > pixel.0[2] + 15).count();
    floor as f64 / picture.pixels().len() as f64
}

/// Part of the pixels that are at least a tenth darker than before.
pub fn darker_part(picture: &image::RgbImage, before: &image::RgbImage) -> f64 {
    let darker = picture.pixels().zip(before.pixels()).filter(|(now, then)| 10 * sum(now) < 9 * sum(then));
    darker.count() as f64 / picture.pixels().len() as f64
}

#[test]
fn keys_pause_start_over_take_pictures_and_leave() {
    let Some(screen) = Screen::start() else { return };
    let scenery = Scenery::new(SCENARIO);
    let mut sandbox = Sandbox::start(&screen, &scenery);
    // Time runs: no two pictures of the jet are the same.
    wait_for("the water to run", || {
        let first = sandbox.picture();
        (first.as_raw() != sandbox.picture().as_raw()).then_some(())
    });
    // Paused and started over: dry, and nothing moves.
    sandbox.pause();
    sandbox.key("r");
    let dry = wait_for("a picture that stands still", || {
        let picture = sandbox.picture();
        (floor_part(&picture) > 0.4 && picture.as_raw() == sandbox.picture().as_raw()).then_some(picture)
    });
    // Running: the floor gets dark.
    sandbox.key("space");
    sandbox.state("running");
    wait_for("the floor to get wet", || (darker_part(&sandbox.picture(), &dry) > 0.01).then_some(()));
    // Started over once more: the same picture as before, to the pixel.
    sandbox.pause();
    sandbox.key("r");
    wait_for("the dry floor", || (sandbox.picture().as_raw() == dry.as_raw()).then_some(()));
    // Dragging with the right button turns the camera.
    sandbox.xdotool(&["mousemove", "600", "250", "mousedown", "3"]);
    for _ in 0..8 {
        sandbox.xdotool(&["mousemove_relative", "12", "4"]);
        std::thread::sleep(Duration::from_millis(60));
    }
    sandbox.xdotool(&["mouseup", "3"]);
    wait_for("the camera to turn", || (sandbox.picture().as_raw() != dry.as_raw()).then_some(()));
    // Over a panel it does not.
    let turned = sandbox.picture();
    sandbox.xdotool(&[
        "mousemove",
        "100",
        "250",
        "mousedown",
        "3",
        "mousemove_relative",
        "60",
        "20",
        "mouseup",
        "3",
    ]);
    assert!(sandbox.picture().as_raw() == turned.as_raw(), "the camera turned over a panel");
    // Exported as it is; the report comes last.
    sandbox.key("x");
    let exported = scenery.out().join("export_000");
    wait_for("the export", || exported.join("report.json").exists().then_some(()));
    let files = crate::replay::files_below(&exported);
    assert!(files.iter().any(|name| name.ends_with("_weathered.glb")), "{files:?}");
    assert!(exported.join("maps/floor_film.png").is_file());
    sandbox.key("Escape");
    let status = sandbox.end();
    assert!(status.success(), "{status}");
}

#[test]
fn a_brush_wets_what_is_under_the_mouse_and_a_stroke_is_taken_back() {
    let Some(screen) = Screen::start() else { return };
    // A hose that is shut: nothing is wet but by hand.
    assert_eq!(SCENARIO.matches("rate: 500.0").count(), 1);
    let scenery = Scenery::new(&SCENARIO.replace("rate: 500.0", "rate: 0.0"));
    let mut sandbox = Sandbox::start(&screen, &scenery);
    // Water of before the first tick would be of no time.
    let dry = wait_for("a picture that stands still", || {
        let picture = sandbox.picture();
        (floor_part(&picture) > 0.4 && picture.as_raw() == sandbox.picture().as_raw()).then_some(picture)
    });
    sandbox.pause();
    sandbox.key("1");
    // A frame may take longer than a short stroke: it is painted until it is seen.
    let darkest = wait_for("the stroke to be seen", || {
        sandbox.xdotool(&["mousemove", "560", "330", "mousedown", "1"]);
        for _ in 0..6 {
            std::thread::sleep(Duration::from_millis(250));
            sandbox.xdotool(&["mousemove_relative", "12", "4"]);
        }
        sandbox.xdotool(&["mouseup", "1"]);
        let part = darker_part(&sandbox.picture(), &dry);
        (part > 0.0005).then_some(part)
    });
    // It may have taken several.
    wait_for("the strokes to be gone", || {
        sandbox.xdotool(&["key", "ctrl+z"]);
        (darker_part(&sandbox.picture(), &dry) < 0.1 * darkest).then_some(())
    });
    // What was painted is not saved: that is told first.
    sandbox.answer("Escape once more leaves", |sandbox| sandbox.key("Escape"));
    sandbox.key("Escape");
    let status = sandbox.end();
    assert!(status.success(), "{status}");
}
