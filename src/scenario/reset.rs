//! Starting over without loading anything again.

use bevy::prelude::*;

use super::Digest;
use super::timeline::rewind;
use crate::clock::WeatheringClock;
use crate::emitter::{Emitter, EmitterState, NewParticles};
use crate::matter::{FallingSnow, MatterQueue, SurfaceMatter};
use crate::overlay::{
    CpuMaps, MapLoss, MapSize, Overlays, SplatQueue, SurfaceTotals, SurfaceTraces, Weatherable,
    put_first_size,
};
use crate::particle::{ParticleCounts, Particles, Splashes, WaterCounts};
use crate::weather::DryingClock;
use crate::wetting::{DropQueue, ExposureProgress, SurfaceWater, forget_poses};

/// Takes a scenario back to tick 0: dry surfaces, no particles, the same random streams, slopes of the mesh at rest. What
/// follows is what followed the first time, if a frame without a tick comes first. Whoever moves surfaces puts them back.
pub fn reset_scenario(world: &mut World) {
    world.resource_mut::<Particles>().clear();
    let mut emitters = world.query_filtered::<&mut EmitterState, With<Emitter>>();
    for mut state in emitters.iter_mut(world) {
        *state = EmitterState::default();
    }
    let mut surfaces = world.query::<(
        &mut Weatherable,
        &mut SplatQueue,
        &mut SurfaceTotals,
        &mut SurfaceTraces,
        (Option<&mut CpuMaps>, &mut MapLoss),
        Option<&mut SurfaceWater>,
        Option<&mut DropQueue>,
        Option<(&mut SurfaceMatter, &mut MatterQueue, &mut FallingSnow)>,
    )>();
    for (mut surface, mut queue, mut totals, mut traces, (maps, mut loss), water, drops, matter) in
        surfaces.iter_mut(world)
    {
        if let Some((mut matter, mut deposits, mut falling)) = matter {
            matter.reset();
            deposits.0.clear();
            falling.0.clear();
        }
        if let Some(mut water) = water {
            water.reset();
        }
        if let Some(mut drops) = drops {
            drops.0.clear();
        }
        // A changed surface that has no maps on the GPU gets empty ones; those it has go below.
        surface.set_changed();
        queue.clear();
        queue.restore_traces(SurfaceTraces::default());
        *traces = SurfaceTraces::default();
        *totals = SurfaceTotals::default();
        *loss = MapLoss::default();
        if let Some(mut maps) = maps {
            *maps = CpuMaps::of_size(maps.size, maps.wrap);
        }
    }
    let mut mapped = world.query_filtered::<Entity, With<Overlays>>();
    for surface in mapped.iter(world).collect::<Vec<_>>() {
        world.entity_mut(surface).remove::<Overlays>();
    }
    // Where the budget is short, sizes have followed what was hit.
    let mut sized = world.query_filtered::<Entity, With<MapSize>>();
    for surface in sized.iter(world).collect::<Vec<_>>() {
        put_first_size(world, surface);
    }
    world.resource_mut::<NewParticles>().restart();
    world.resource_mut::<WeatheringClock>().reset();
    world.insert_resource(ParticleCounts::default());
    world.insert_resource(WaterCounts::default());
    world.insert_resource(DryingClock::default());
    world.insert_resource(Digest::default());
    rewind(world, 0);
    forget_poses(world);
    // By the sun of the end.
    if let Some(mut exposure) = world.get_resource_mut::<ExposureProgress>() {
        exposure.start_over();
    }
    if let Some(mut splashes) = world.get_resource_mut::<Splashes>() {
        *splashes = Splashes::default();
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::test_app::{app, run_ticks, wait};
    use super::*;
    use crate::overlay::put_size;
    use crate::scenario::{Scenario, scene_digest};
    use crate::wetting::MeasureTiming;

    const TAP: &str = r#"(
        seconds: 3.0,
        tick_hz: 20,
        camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
        materials: {"plain": ()},
        surfaces: [(
            name: "ground",
            mesh: Ground(size: (1.0, 1.0), cells: (2, 2)),
            material: "plain",
            maps: (map_size: 32),
        )],
        emitters: [(
            name: "tap",
            effect: "tap.effect.ron",
            rate: 50.0,
            speed: 1.0,
            spread_deg: 20.0,
            keys: [(position: (0.0, 0.5, 0.0), target: (0.0, 0.0, 0.0))],
        )],
    )"#;

    /// The scenario, when it is ready.
    fn tap(folder: &Path) -> App {
        let paint = "(stamp_radius: 0.05, diffuse: (color: (0.4, 0.3, 0.2), opacity: 0.8))";
        std::fs::write(folder.join("tap.effect.ron"), paint).unwrap();
        let file = folder.join("tap.ron");
        std::fs::write(&file, TAP).unwrap();
        let mut app = app(Scenario::load(&file).unwrap());
        wait(&mut app);
        app
    }

    /// Two seconds, and what came of them.
    fn run(app: &mut App) -> (String, ParticleCounts, SurfaceTraces) {
        run_ticks(app, 40);
        let traces = traces(app);
        let world = app.world_mut();
        (scene_digest(world), *world.resource::<ParticleCounts>(), traces)
    }

    fn traces(app: &mut App) -> SurfaceTraces {
        let world = app.world_mut();
        let mut traces = world.query::<&SurfaceTraces>();
        *traces.single(world).unwrap()
    }

    #[test]
    fn what_follows_is_what_followed_the_first_time() {
        let folder = tempfile::tempdir().unwrap();
        let mut app = tap(folder.path());
        let first = run(&mut app);
        assert!(
            first.1.hit > 20 && first.2 == SurfaceTraces { water: true, paint: true, matter: false },
            "{first:?}"
        );
        reset_scenario(app.world_mut());
        // A frame without a tick, in which everybody sees that it is clean again.
        app.update();
        assert_eq!(traces(&mut app), SurfaceTraces::default());
        assert_eq!(run(&mut app), first);
    }

    #[test]
    fn surfaces_get_the_maps_back_that_they_began_with() {
        let folder = tempfile::tempdir().unwrap();
        let mut app = tap(folder.path());
        // Its exposure is there before the first tick, however long that takes.
        app.insert_resource(MeasureTiming::AfterTicks(5));
        let first = run(&mut app);
        let size = |app: &mut App| {
            let world = app.world_mut();
            let mut surfaces = world.query::<(Entity, &MapSize, &SurfaceWater)>();
            let (surface, map, water) = surfaces.single(world).unwrap();
            (surface, map.texels(), water.size())
        };
        reset_scenario(app.world_mut());
        let (surface, ..) = size(&mut app);
        // As a saved scene in which it has given way.
        put_size(app.world_mut(), surface, 16);
        assert_eq!(size(&mut app), (surface, 16, 16));
        app.update();
        assert_ne!(run(&mut app).0, first.0);
        reset_scenario(app.world_mut());
        assert_eq!(size(&mut app), (surface, 32, 32));
        app.update();
        assert_eq!(run(&mut app), first);
    }
}
