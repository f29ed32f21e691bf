//! Time: tick by tick, faster and slower, and pictures of all that goes by.

use super::keys::SCENARIO;
use super::screen::{Sandbox, Scenery, Screen, wait_for};
use crate::replay::files_below;

/// One tick more: which one it is.
fn step(sandbox: &mut Sandbox) -> u32 {
    let told = sandbox.answer(" tick ", |sandbox| sandbox.key("n"));
    let (tick, seconds) = told.trim().strip_prefix("tick ").and_then(|told| told.split_once(", ")).unwrap();
    let tick: u32 = tick.parse().unwrap();
    // There are 60 in a second.
    assert_eq!(seconds, format!("{:.3} s", f64::from(tick) / 60.0));
    tick
}

#[test]
fn time_goes_tick_by_tick_and_faster_and_slower_and_sequences_are_of_all_of_it() {
    let Some(screen) = Screen::start() else { return };
    let scenery = Scenery::new(SCENARIO);
    let mut sandbox = Sandbox::start_paused(&screen, &scenery);
    let first = step(&mut sandbox);
    assert_eq!([first + 1, first + 2], [step(&mut sandbox), step(&mut sandbox)]);

    for (key, speed) in
        [("period", "2.00"), ("period", "4.00"), ("comma", "2.00"), ("comma", "1.00"), ("comma", "0.50")]
    {
        sandbox.answer(&format!(" {speed} times as fast as in the world"), |sandbox| sandbox.key(key));
    }

    // While time stands still there is nothing new to see.
    let folder = scenery.out().join("sequence_000");
    let told = sandbox.answer("taking pictures into ", |sandbox| sandbox.key("F11"));
    assert!(told.ends_with("sequence_000"), "{told}");
    let before = step(&mut sandbox);
    assert_eq!([before + 1, before + 2], [step(&mut sandbox), step(&mut sandbox)]);
    let told = sandbox.answer("3 pictures in ", |sandbox| sandbox.key("F11"));
    assert!(told.ends_with("sequence_000"), "{told}");
    let names = ["frame_00000.png", "frame_00001.png", "frame_00002.png"];
    wait_for("the pictures", || names.iter().all(|name| folder.join(name).exists()).then_some(()));
    assert_eq!(files_below(&folder).into_iter().collect::<Vec<_>>(), names);
    let pictures = names.map(|name| image::open(folder.join(name)).unwrap().to_rgb8());
    assert_eq!(pictures[0].dimensions(), sandbox.picture().dimensions());
    assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2], "nothing moved from tick to tick");

    // Running, it goes by itself.
    wait_for("time to go on", || {
        sandbox.key("space");
        sandbox.state("running");
        (step(&mut sandbox) > before + 10).then_some(())
    });
    sandbox.key("Escape");
    let status = sandbox.end();
    assert!(status.success(), "{status}");
}
