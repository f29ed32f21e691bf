//! Every panel, as large as it is and twice as large.

use std::path::PathBuf;

use super::keys::SCENARIO;
use super::screen::{Sandbox, Scenery, Screen, wait_for};

/// Panels at the left.
const PANELS: [&str; 11] = [
    "scenes",
    "hose",
    "brushes",
    "weather",
    "emitters",
    "effects",
    "materials",
    "views",
    "files",
    "compare",
    "scenes_again",
];

/// Part of the pixels of the left side that are as light as text.
fn text_part(side: &image::RgbImage) -> f64 {
    let light = side.pixels().filter(|pixel| pixel.0.iter().all(|&byte| byte > 150)).count();
    light as f64 / side.pixels().len() as f64
}

/// What the panel has for itself at any size, without the frame around it.
fn side(screen: &Screen) -> image::RgbImage {
    image::imageops::crop_imm(&screen.picture(), 4, 90, 210, 400).to_image()
}

/// The folder that `WEATHERING_SCREENS` names gets a picture of each, to be looked at.
#[test]
fn every_panel_is_there_at_both_sizes_and_leaves_room_for_the_scene() {
    let Some(screen) = Screen::start() else { return };
    let folder = std::env::var_os("WEATHERING_SCREENS").map(PathBuf::from);
    for zoom in ["1.0", "2.0"] {
        let scenery = Scenery::new(SCENARIO);
        scenery.remember(&format!("(zoom: {zoom}, panel: \"Scenes\")"));
        let sandbox = Sandbox::start_paused(&screen, &scenery);
        for name in PANELS {
            let shown = wait_for(name, || {
                let shown = side(&screen);
                (text_part(&shown) > 0.002).then_some(shown)
            });
            let whole = screen.picture();
            if let Some(folder) = &folder {
                std::fs::create_dir_all(folder).unwrap();
                whole.save(folder.join(format!("{name}_{zoom}.png"))).unwrap();
            }
            // The floor, which is redder than any panel, is seen beside it.
            let floor = whole.pixels().filter(|pixel| pixel.0[0] > pixel.0[2].saturating_add(15)).count();
            let part = floor as f64 / whole.pixels().len() as f64;
            assert!(part > 0.02, "{name} at {zoom}: {:.1} % of the screen is of the scene", part * 100.0);
            sandbox.key("Next");
            wait_for("another panel", || (side(&screen) != shown).then_some(()));
        }
        sandbox.key("Escape");
        let status = sandbox.end();
        assert!(status.success(), "{status}");
    }
}
