//! Painting a place, looking at its maps, asking what it holds, and taking a stroke back.

use super::camera::MIDDLE;
use super::keys::{SCENARIO, darker_part};
use super::screen::{Sandbox, Scenery, Screen, wait_for};

/// Left, top, width and height of what is shown of a map, before anything has been asked.
const MAP: [u32; 4] = [700, 300, 240, 200];
/// Maps, by their buttons.
const ABSORBED: [u32; 2] = [845, 196];
const SOURCE: [u32; 2] = [856, 223];
const SNOW: [u32; 2] = [758, 250];

/// What a click with the probe finds in the middle of the floor, where the jet comes down.
fn probe(sandbox: &mut Sandbox) -> String {
    sandbox.answer("probe: surface ", |sandbox| sandbox.click(MIDDLE))
}

/// A number of what was found.
fn number(found: &str, label: &str) -> f64 {
    let rest = found.split("; ").find_map(|row| row.strip_prefix(label));
    let number = rest.and_then(|rest| rest.split_whitespace().next()).and_then(|text| text.parse().ok());
    number.unwrap_or_else(|| panic!("no {label} in {found}"))
}

/// Millimetres of water, in all.
fn water(found: &str) -> f64 {
    number(found, "film ") + number(found, "absorbed ")
}

/// Parts of a map that are not black, and that are white.
fn lit(screen: &Screen) -> [f64; 2] {
    let [x, y, width, height] = MAP;
    let map = image::imageops::crop_imm(&screen.picture(), x, y, width, height).to_image();
    let part = |is: fn(&[u8; 3]) -> bool| {
        map.pixels().filter(|pixel| is(&pixel.0)).count() as f64 / map.pixels().len() as f64
    };
    [part(|pixel| pixel.iter().any(|&byte| byte > 30)), part(|pixel| pixel.iter().all(|&byte| byte > 225))]
}

#[test]
fn maps_and_the_probe_tell_of_a_stroke_and_of_a_jet_and_the_stroke_is_taken_back() {
    let Some(screen) = Screen::start() else { return };
    let scenery = Scenery::new(SCENARIO);
    let mut sandbox = Sandbox::start_paused(&screen, &scenery);
    // From the start, and a tick later: nothing is wet, and water is of a time that is known.
    sandbox.answer("started over", |sandbox| sandbox.key("r"));
    // The mouse, which is drawn, too, where nothing is looked at.
    sandbox.xdotool(&["mousemove", "480", "440"]);
    sandbox.key("m");
    sandbox.answer(" tick 1, ", |sandbox| sandbox.key("n"));
    wait_for("a map of what is dry", || (lit(&screen)[0] == 0.0).then_some(()));
    let dry = screen.still_scene();

    // One stroke, that has hit: the button is held until a frame has seen it.
    let [x, y] = MIDDLE.map(|along| along.to_string());
    sandbox.key("1");
    sandbox.xdotool(&["mousemove", &x, &y, "mousedown", "1"]);
    sandbox.seen();
    sandbox.xdotool(&["mouseup", "1"]);
    sandbox.seen();
    sandbox.xdotool(&["mousemove", "480", "440"]);
    wait_for("the stroke to be seen", || (darker_part(&screen.scene(), &dry) > 0.0005).then_some(()));
    wait_for("a map of what looks wet", || (lit(&screen)[0] > 0.0005).then_some(()));
    sandbox.click(SNOW);
    wait_for("a map of no snow", || (lit(&screen)[0] == 0.0).then_some(()));
    sandbox.click(ABSORBED);
    wait_for("a map of what is absorbed", || (lit(&screen)[0] > 0.0005).then_some(()));
    // What a brush has brought is white.
    sandbox.click(SOURCE);
    wait_for("a map of where it came from", || {
        let [any, white] = lit(&screen);
        (white > 0.0005 && white > 0.9 * any).then_some(())
    });

    // The mouse is in the scene before it is clicked there.
    sandbox.xdotool(&["mousemove", &x, &y]);
    sandbox.seen();
    sandbox.key("i");
    let painted = probe(&mut sandbox);
    assert!(painted.starts_with("probe: surface floor; texel "), "{painted}");
    assert!(painted.contains("wet since 0.0 s ago; water from a brush"), "{painted}");
    assert!(water(&painted) > 0.05, "{painted}");

    // One step back is all that there is.
    sandbox.answer("took a stroke back", |sandbox| sandbox.key("ctrl+z"));
    let taken_back = probe(&mut sandbox);
    assert!(
        taken_back.contains("never wet") && !taken_back.contains("water from"),
        "{painted}\n{taken_back}\n{}",
        scenery.log()
    );
    assert_eq!(water(&taken_back), 0.0, "{taken_back}");
    // And forth, and back again.
    sandbox.answer("brought a stroke back", |sandbox| sandbox.key("ctrl+shift+z"));
    let again = probe(&mut sandbox);
    assert_eq!(water(&again), water(&painted), "{painted}\n{again}");
    sandbox.answer("nothing to do again", |sandbox| sandbox.key("ctrl+shift+z"));
    sandbox.answer("took a stroke back", |sandbox| sandbox.key("ctrl+z"));
    sandbox.answer("nothing to take back", |sandbox| sandbox.key("ctrl+z"));

    // Where the jet comes down.
    sandbox.key("space");
    sandbox.state("running");
    let wet = wait_for("water of the hose", || {
        let found = probe(&mut sandbox);
        found.contains("water from hose").then_some(found)
    });
    assert!(water(&wet) > 0.0 && number(&wet, "wet since ") < 600.0, "{wet}");
    // What was painted is not saved: that is told first.
    sandbox.answer("Escape once more leaves", |sandbox| sandbox.key("Escape"));
    sandbox.key("Escape");
    let status = sandbox.end();
    assert!(status.success(), "{status}");
    assert!(scenery.remembered().contains("maps: true"), "{}", scenery.remembered());
}
