//! Far more particles than any machine can do.

use std::time::Duration;

use super::keys::SCENARIO;
use super::screen::{Sandbox, Scenery, Screen};

/// The slowest that a key may take effect. It is tenths of a second where nothing else runs.
const LIMIT: Duration = Duration::from_secs(15);

/// What a title says of the part of the particles that is sent, 0..=1.
fn sent(title: &str) -> f64 {
    let percent = title.split(", ").find_map(|part| {
        let (number, rest) = part.split_once(' ')?;
        rest.starts_with("% of the particles").then(|| number.parse::<f64>().ok())?
    });
    percent.unwrap_or(100.0) / 100.0
}

#[test]
fn a_window_answers_under_a_hundred_times_what_the_machine_can_do() {
    let Some(screen) = Screen::start() else { return };
    assert_eq!(SCENARIO.matches("rate: 500.0").count(), 1);
    // Two cores hold some 50,000 a second beside a software driver.
    let scenery = Scenery::new(&SCENARIO.replace("rate: 500.0", "rate: 5000000.0"));
    let mut sandbox = Sandbox::start(&screen, &scenery);
    let mut slowest = Duration::ZERO;
    let mut least = 1.0_f64;
    for _ in 0..5 {
        std::thread::sleep(Duration::from_secs(2));
        least = least.min(sent(&sandbox.title()));
        for (key, state) in [("space", "paused"), ("space", "running")] {
            sandbox.key(key);
            slowest = slowest.max(sandbox.state(state));
        }
    }
    eprintln!("{:.1} % of the particles, and the slowest key took {slowest:.1?}", least * 100.0);
    assert!(slowest < LIMIT, "a key took {slowest:.1?}");
    assert!(least < 0.2, "{:.1} % of the particles were sent: this was no overload", least * 100.0);
    sandbox.key("Escape");
    let status = sandbox.end();
    assert!(status.success(), "{status}");
}

#[test]
fn the_part_that_is_sent_is_read_from_the_title() {
    let title = "weathering - scene.ron, time at 33 %, 0.8 % of the particles, 12 000 splats wait (running)";
    assert!((sent(title) - 0.008).abs() < 1e-9);
    assert_eq!(sent("weathering - scene.ron, time at 33 % (running)"), 1.0);
}
