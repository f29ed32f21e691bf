//! How ticks are spread over frames must not matter: no impact lost, none counted twice.

use std::fs;
use std::path::Path;

use bevy::math::UVec2;
use bevy_weathering::overlay::SplatBudget;
use bevy_weathering::replay::{ReplayOptions, replay};
use bevy_weathering::scenario::{LoadedScenario, Scenario};

use super::harness;

/// The scene, without its looks: these do not matter here, and take time to load.
fn bare(name: &str) -> LoadedScenario {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios").join(name);
    let mut scenario = Scenario::load(&file).unwrap();
    scenario.scenario.environment = None;
    scenario.scenario.materials.values_mut().for_each(|material| material.texture = Default::default());
    scenario
}

#[test]
fn a_budget_paints_the_same_in_more_frames() {
    if harness::gpu().is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scenario = bare("mud.ron");
    let run = |name: &str, splat_budget| {
        let out = folder.path().join(name);
        let (size, seconds) = (UVec2::new(16, 16), Some(1.0));
        let options = ReplayOptions {
            fps: 10,
            seconds,
            size,
            out: Some(out.clone()),
            splat_budget,
            ..ReplayOptions::new(scenario.clone())
        };
        let report = replay(&options, |_| {}).unwrap();
        let mut maps: Vec<_> =
            fs::read_dir(out.join("maps")).unwrap().map(|file| file.unwrap().path()).collect();
        maps.sort();
        (report, maps.into_iter().map(|file| fs::read(file).unwrap()).collect::<Vec<_>>())
    };
    let (whole, at_once) = run("whole", SplatBudget::UNLIMITED);
    let (parts, in_parts) = run("parts", SplatBudget { splats: 2 });
    assert_eq!(whole.work.splats_carried, 0);
    assert!(parts.work.splats_carried > 20, "{:?}", parts.work);
    assert!(!at_once.is_empty() && at_once == in_parts);
    assert_eq!(parts.digest, whole.digest);
}

#[test]
fn frames_of_no_one_and_five_ticks_give_the_same_maps() {
    if harness::gpu().is_none() {
        return;
    }
    let scenario = bare("vase.ron");
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
