//! How ticks are spread over frames must not matter: no impact lost, none counted twice.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use bevy::math::UVec2;
use bevy_weathering::overlay::SplatBudget;
use bevy_weathering::replay::{ReplayOptions, replay};
use bevy_weathering::scenario::{LoadedScenario, Scenario};

use super::harness;

/// A vase that is hosed down, without its looks: they do not matter here, and take time to load.
fn vase() -> LoadedScenario {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios/vase.ron");
    let mut scenario = Scenario::load(&file).unwrap();
    scenario.scenario.environment = None;
    scenario.scenario.materials.values_mut().for_each(|material| material.texture = Default::default());
    scenario
}

#[test]
fn frames_of_no_one_and_five_ticks_give_the_same_maps() {
    if harness::gpu().is_none() {
        return;
    }
    let scenario = vase();
    let run = |fps, render| {
        let seconds = Some(0.8);
        let size = UVec2::new(16, 16);
        let options = ReplayOptions { fps, render, seconds, size, ..ReplayOptions::new(scenario.clone()) };
        replay(&options, |_| {}).unwrap()
    };
    let reference = run(60, false);
    assert!(reference.particles.hit > 100, "{:?}", reference.particles);
    // 60 ticks a second: five in a frame, one, or one in every second frame.
    for fps in [12, 60, 120] {
        let report = run(fps, true);
        assert_eq!(report.digest, reference.digest, "{fps} frames a second");
        assert_eq!(report.surfaces, reference.surfaces);
        assert_eq!(report.particles, reference.particles);
    }
}

/// Maps of a run, by name.
fn maps(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = fs::read_dir(out.join("maps")).unwrap().map(|entry| entry.unwrap().path());
    files
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(&path).unwrap()))
        .collect()
}

#[test]
fn splats_beyond_the_budget_of_a_frame_are_painted_later_to_the_same_maps() {
    if harness::gpu().is_none() {
        return;
    }
    let scenario = vase();
    let run = |splats: SplatBudget| {
        let out = tempfile::tempdir().unwrap();
        let options = ReplayOptions {
            out: Some(out.path().to_owned()),
            fps: 6,
            seconds: Some(0.8),
            size: UVec2::new(16, 16),
            splats,
            ..ReplayOptions::new(scenario.clone())
        };
        let report = replay(&options, |_| {}).unwrap();
        (report, maps(out.path()))
    };
    let (whole, reference) = run(SplatBudget::LARGEST);
    assert_eq!((whole.timing.carried_splats, whole.timing.held_ticks), (0, 0));
    assert!(whole.particles.hit > 50 && reference.len() >= 7, "{:?}", whole.particles);
    // A few a frame; and so few may wait that ticks have to.
    let few = SplatBudget { per_frame: 7, ..SplatBudget::LARGEST };
    for (splats, holds) in [(few, false), (SplatBudget { most_waiting: 5, ..few }, true)] {
        let (report, files) = run(splats);
        assert_eq!(report.digest, whole.digest);
        assert_eq!((report.ticks, &report.surfaces), (whole.ticks, &whole.surfaces));
        assert!(
            report.timing.carried_splats > 0 && (report.timing.held_ticks > 0) == holds,
            "{:?}",
            report.timing
        );
        assert_eq!(files.keys().collect::<Vec<_>>(), reference.keys().collect::<Vec<_>>());
        for (name, bytes) in &files {
            assert!(*bytes == reference[name], "{name} with {splats:?}");
        }
    }
}
