//! Scenarios.

use std::fs;
use std::path::Path;

use bevy_weathering::scenario::{LoadedScenario, Scenario, ScenarioError};

use super::harness::fuzz;
use super::{assets, is_quick, is_small, mutate, run, texts, write};

/// Small, but with some of everything.
pub const SMALL: &str = r#"(
    include: ["parts/materials.ron"],
    seed: 3,
    tick_hz: 20,
    seconds: 2.0,
    gravity: (0.0, -9.81, 0.0),
    wind: (0.5, 0.0, 0.1),
    weather: (temperature_c: 20.0, humidity: 0.4, drying_speed: 2.0),
    max_particles: 500,
    camera: (fov_deg: 40.0, keys: [(t: 0.0, eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
    sun: (direction: (-0.5, -1.0, -0.4), illuminance: 9000.0),
    surfaces: [
        (
            name: "floor",
            mesh: Ground(size: (1.0, 1.0), cells: (2, 2)),
            material: "brick",
            rotation_deg: (10.0, 0.0, 0.0),
            scale: (1.0, 1.0, 1.0),
            maps: (map_size: 32, wrap_u: Clamp, wrap_v: Repeat),
        ),
        (name: "ball", mesh: Sphere(radius: 0.2, sectors: 8, stacks: 6), material: "glaze", maps: (map_size: 32)),
    ],
    emitters: [
        (
            name: "rain",
            effect: "effects/rain.effect.ron",
            rate: 60.0,
            shape: Sky(half_size: (0.5, 0.5)),
            flow: MmPerHour(20.0),
            lifetime: 2.0,
            keys: [(position: (0.0, 1.0, 0.0), target: (0.0, 0.0, 0.0))],
        ),
        (
            name: "tap",
            effect: "effects/mud.effect.ron",
            rate: 40.0,
            speed: 1.5,
            spread_deg: 4.0,
            keys: [(t: 0.0, position: (0.1, 0.4, 0.0), target: (0.1, 0.0, 0.0)),
                   (t: 1.0, position: (0.2, 0.4, 0.0), target: (0.2, 0.0, 0.0))],
        ),
    ],
    emitter_changes: {"tap": (lifetime: 1.5)},
    events: [
        (at: 0.05, what: Start("tap")),
        (at: 1.5, what: Stop("tap")),
        (at: 0.1, what: Move(emitter: "tap", position: (0.0, 0.5, 0.1), target: (0.0, 0.0, 0.1), over: 0.2)),
        (at: 0.1, what: Weather(humidity: 0.2, wind: (1.0, 0.0, 0.0), over: 0.1)),
        (at: 0.1, what: Brush(kind: Wet, point: (0.0, 0.0, 0.0), radius: 0.2, strength: 0.3, surface: "floor")),
        (at: 0.15, what: Brush(kind: Dirty, point: (0.2, 0.0, 0.0), radius: 0.2, strength: 0.1)),
        (at: 0.15, what: Material(surface: "ball", material: "brick", model: Twomey(porosity: 0.6))),
        (at: 0.2, what: Capture("half")),
        (at: 0.2, what: Export("half")),
        (at: 0.2, what: Expect(quantity: WetFraction, surface: "floor", above: 0.0, below: 1.0)),
        (at: 0.2, what: Camera(eye: (0.0, 1.0, 1.0), target: (0.0, 0.0, 0.0))),
    ],
    variants: {"dense": (max_particles: 900, emitter_changes: {"rain": (rate: 90.0)}), "dry": (wind: (2.0, 0.0, 0.0))},
)"#;

/// What it includes.
pub const MATERIALS: &str = r#"(materials: {
    "brick": (color: (0.6, 0.3, 0.2), roughness: 0.8, porous: (capacity_mm: 0.5, sorptivity: 1.0, efflorescence: 0.4)),
    "glaze": (metallic: 0.1, porous: (capacity_mm: 0.0)),
})"#;

/// A folder with all that scenarios name.
pub fn tree() -> tempfile::TempDir {
    let tree = tempfile::tempdir().expect("a temporary folder");
    for folder in ["effects", "models", "environment"] {
        for entry in fs::read_dir(assets().join(folder)).expect("the folder is in the repository") {
            let file = entry.expect("it can be read").path();
            let name = file.file_name().expect("it has a name");
            write(&tree.path().join(folder).join(name), fs::read(&file).expect("it can be read"));
        }
    }
    write(&tree.path().join("parts/materials.ron"), MATERIALS);
    tree
}

/// All that holds of a scenario that was accepted.
fn assert_within_limits(scenario: &Scenario) {
    assert!(scenario.seconds > 0.0 && scenario.seconds <= Scenario::MAX_SECONDS);
    assert!((1..=1000).contains(&scenario.tick_hz));
    assert!((1..=Scenario::MAX_PARTICLES).contains(&scenario.max_particles));
    assert!(scenario.surfaces.len() <= Scenario::MAX_SURFACES);
    for surface in &scenario.surfaces {
        assert!(surface.transform().to_matrix().is_finite(), "{}", surface.name);
    }
    for emitter in &scenario.emitters {
        assert!(
            emitter.rate <= Scenario::MAX_RATE && emitter.initial_speed().is_finite(),
            "{}",
            emitter.name
        );
    }
}

/// Loads the file, and each of its variants. A refusal names a file of the tree.
fn load(file: &Path) -> Result<LoadedScenario, String> {
    let refused = |error: ScenarioError| {
        let message = error.to_string();
        assert!(
            message.contains("spoilt") || message.contains("materials.ron"),
            "no file is named: {message}"
        );
        message
    };
    let loaded = Scenario::load(file).map_err(refused)?;
    assert_within_limits(&loaded.scenario);
    for variant in &loaded.variants {
        if let Ok(variant) = Scenario::load_variant(file, Some(variant)) {
            assert_within_limits(&variant.scenario);
        }
    }
    Ok(loaded)
}

#[test]
fn spoilt_scenarios_are_loaded_or_refused() {
    let tree = tree();
    let mut corpus = texts("scenarios");
    corpus.extend([SMALL.to_owned(), SMALL.to_owned()]);
    let file = tree.path().join("scenarios/spoilt.ron");
    let tally = fuzz("scenarios", 3900, move |_, random| {
        let whole = mutate::pick(random, &corpus);
        let text = mutate::text(random, whole, &corpus);
        write(&file, text);
        let loaded = load(&file)?;
        if random.below(40) == 0 && is_small(&loaded.scenario) {
            loaded.check_content().map_err(|error| error.to_string())?;
        }
        // Until here it is needed.
        let _ = &tree;
        Ok(())
    });
    assert!(tally.accepted > 100 && tally.refused > 1000, "{tally:?}");
}

#[test]
fn spoilt_scenarios_that_are_accepted_run() {
    let tree = tree();
    let file = tree.path().join("scenarios/spoilt.ron");
    let corpus = [SMALL.to_owned()];
    let tally = fuzz("small scenarios", 100, move |number, random| {
        let _ = &tree;
        // The first one is whole.
        let mut spoilt = SMALL.as_bytes().to_vec();
        let attempts = if number == 0 { 0 } else { 60 };
        for _ in 0..attempts {
            spoilt = mutate::text(random, SMALL, &corpus);
            write(&file, &spoilt);
            if Scenario::load(&file).is_ok_and(|loaded| is_quick(&loaded.scenario)) {
                break;
            }
        }
        write(&file, &spoilt);
        let loaded = load(&file)?;
        if !is_quick(&loaded.scenario) {
            return Err("it asks for more than a test can give".into());
        }
        run(loaded, 0.25, None)
    });
    assert!(tally.accepted > 50, "{tally:?}");
}
