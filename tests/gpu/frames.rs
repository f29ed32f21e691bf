//! How ticks are spread over frames must not matter: no impact lost, none counted twice.

use std::path::Path;

use bevy::math::UVec2;
use bevy_weathering::replay::{ReplayOptions, replay};
use bevy_weathering::scenario::Scenario;

use super::harness;

#[test]
fn frames_of_no_one_and_five_ticks_give_the_same_maps() {
    if harness::gpu().is_none() {
        return;
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios/vase.ron");
    let mut scenario = Scenario::load(&file).unwrap();
    // Its looks do not matter here, and take time to load.
    scenario.scenario.environment = None;
    scenario.scenario.materials.values_mut().for_each(|material| material.texture = Default::default());
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
