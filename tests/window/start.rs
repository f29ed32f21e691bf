//! From the start of the program to the first picture, and files that change while it is open.

use std::fs;
use std::time::{Duration, Instant};

use super::keys::SCENARIO;
use super::screen::{Sandbox, Scenery, Screen, wait_for};

#[test]
fn the_window_appears_with_its_first_picture_and_effects_follow_their_files() {
    let Some(screen) = Screen::start() else { return };
    let scenery = Scenery::new(SCENARIO);
    assert!(screen.shares().white > 0.999, "{:?}", screen.shares());
    let begun = Instant::now();
    let (mut sandbox, seen) = screen.watch(|| {
        let sandbox = Sandbox::start(&screen, &scenery);
        wait_for("the first picture", || (screen.shares().white < 0.8).then_some(()));
        std::thread::sleep(Duration::from_secs(1));
        sandbox
    });
    // A window of half the screen or more.
    let shown = seen.iter().find(|(_, shares)| shares.white < 0.8);
    let (shown, _) = shown.unwrap_or_else(|| panic!("only white was seen: {:?}", seen.last()));
    // How long it takes is told, and judged by `scripts/smoke.sh`: here other tests run at the same time.
    eprintln!("the first picture came after {:.1} s", shown.duration_since(begun).as_secs_f32());
    for (at, shares) in &seen {
        let after = at.duration_since(begun).as_secs_f32();
        assert!(
            shares.black < 0.1,
            "{:.0} % of the screen was black after {after:.1} s",
            shares.black * 100.0
        );
    }

    let effect = fs::read_to_string(scenery.effect()).unwrap();
    assert_eq!(effect.matches("volume_mm3: 90.0").count(), 1);
    fs::write(scenery.effect(), effect.replace("volume_mm3: 90.0", "volume_mm3: 45.0")).unwrap();
    sandbox.says("read again: hose.effect.ron");
    // What makes no sense is told, and nothing ends.
    fs::write(scenery.effect(), effect.replace("volume_mm3: 90.0", "volume_mm3: -1.0")).unwrap();
    sandbox.says("field `volume_mm3` is -1");
    sandbox.pause();
    sandbox.key("Escape");
    let status = sandbox.end();
    assert!(status.success(), "{status}");
}
