//! Putting a saved scene into a world in which its scenario has been loaded.

use std::path::Path;

use bevy::asset::RenderAssetUsages;
use bevy::prelude::*;

use super::maps::{STATE, value};
use super::{AddedEmitter, SaveError, SavedScene, effects, emitters_in_order, surfaces_in_order};
use crate::clock::WeatheringClock;
use crate::effect::EffectTable;
use crate::emitter::{EmissionSeed, EmitterState, NewParticles};
use crate::matter::SurfaceMatter;
use crate::overlay::{
    CpuMaps, Lying, MapLoss, MapPool, MapSize, Overlays, SurfaceFrames, SurfaceTotals, SurfaceTraces,
    Weatherable, can_put_size, can_resume_resizing, mip_chain, put_size, resume_resizing,
};
use crate::particle::{Particle, ParticleCounts, Particles, SavedParticle};
use crate::scenario::{Digest, LoadedScenario, check_weather, rewind};
use crate::weather::DryingClock;
use crate::wetting::{SurfaceWater, put_matter};

impl SavedScene {
    /// That it was saved from this scenario: better before a scene is cleared for it than after. `folder` is for messages.
    ///
    /// # Errors
    /// [`SaveError::Value`] if it was saved from another `.ron` file.
    pub fn check_scenario(&self, scenario: &LoadedScenario, folder: &Path) -> Result<(), SaveError> {
        if self.state.scenario == scenario.hash {
            return Ok(());
        }
        let expected =
            format!("{}, the hash of this scenario's .ron file: it was saved from another", scenario.hash);
        Err(value(&folder.join(STATE), "scenario", &self.state.scenario, expected))
    }

    /// Puts the state into a world whose scenario is ready and has run no tick. `folder` is for messages. If it
    /// [says](Self::has_emitters) what emitters are, those that have been [added](AddedEmitter) to the world make room for its own.
    ///
    /// # Errors
    /// [`SaveError::Value`] if it was saved from another `.ron` file, or makes no sense; then the world is as it was.
    pub fn restore(
        &self,
        world: &mut World,
        scenario: &LoadedScenario,
        folder: &Path,
    ) -> Result<(), SaveError> {
        self.check_scenario(scenario, folder)?;
        let (state, path) = (&self.state, folder.join(STATE));
        let mut there = emitters_in_order(world);
        let mut settings = None;
        if let Some(kept) = &state.settings {
            there.retain(|emitter| world.get::<AddedEmitter>(*emitter).is_none());
            settings = Some((kept, kept.check(world, (there.len(), state.emitters.len()), &path)?));
        } else if there.len() != state.emitters.len() {
            return Err(value(&path, "emitters", state.emitters.len(), format!("{} of them", there.len())));
        }
        let surfaces = surfaces_in_order(world);
        let names: Vec<&str> = surfaces.iter().map(|(_, name)| name.as_str()).collect();
        let saved: Vec<&str> = state.surfaces.iter().map(|surface| surface.name.as_str()).collect();
        if names != saved {
            return Err(value(&path, "surfaces", format!("{saved:?}"), format!("{names:?}")));
        }
        for ((entity, name), surface) in surfaces.iter().zip(&state.surfaces) {
            let size = world.get::<SurfaceWater>(*entity).map_or(0, SurfaceWater::size);
            // Where the budget is short, sizes follow what is hit.
            if size != surface.size && !can_put_size(world, *entity, surface.size) {
                return Err(value(&path, &format!("size of {name}"), surface.size, size.to_string()));
            }
            if let Some((to, since)) = surface.resizing
                && (since > state.tick || !can_resume_resizing(world, *entity, surface.size, to))
            {
                let expected = "twice its size, a half, a quarter and so on, and a tick of the past".into();
                return Err(value(
                    &path,
                    &format!("resizing of {name}"),
                    format!("({to}, {since})"),
                    expected,
                ));
            }
        }
        let clock = world.resource::<WeatheringClock>();
        if clock.hz() != state.hz {
            return Err(value(&path, "hz", state.hz, clock.hz().to_string()));
        }
        if state.counts.alive != state.particles.len() as u64 {
            let expected = format!("{}, as many as `particles`", state.particles.len());
            return Err(value(&path, "counts.alive", state.counts.alive, expected));
        }
        let ParticleCounts { emitted, alive, hit, expired, .. } = state.counts;
        let sum = alive.checked_add(hit).and_then(|sum| sum.checked_add(expired));
        if sum != Some(emitted) {
            let expected = "the sum of `alive`, `hit` and `expired`".into();
            return Err(value(&path, "counts.emitted", emitted, expected));
        }
        if let Some(index) = state.emitters.iter().position(|emitter| !emitter.is_sound(state.hz)) {
            let expected = "less than a particle and a nanolitre".into();
            return Err(value(&path, &format!("emitters[{index}]"), "owing more", expected));
        }
        if let Err(wrong) = check_weather(&state.weather) {
            let expected = format!("{} to {}", wrong.least, wrong.most);
            return Err(value(&path, &format!("weather.{}", wrong.field), wrong.value, expected));
        }
        let drying = DryingClock::from_points(state.drying.clone());
        let Some(drying) =
            drying.filter(|drying| drying.points().iter().all(|point| point.tick <= state.tick))
        else {
            let expected = "in order of ticks, none in the future, and finite".into();
            return Err(value(&path, "drying", "out of order", expected));
        };
        let rows = world.resource::<EffectTable>().rows().len();
        let effects = settings.as_ref().map_or(rows, |(_, effects)| effects.numbers);
        let saved = state.particles.iter().chain(&state.waiting);
        if let Some(effect) =
            saved.map(|particle| usize::from(particle.effect)).find(|&effect| effect >= effects)
        {
            return Err(value(&path, "effect of a particle", effect, format!("below {effects}")));
        }
        if let Some(particle) =
            state.particles.iter().chain(&state.waiting).find(|particle| !particle.is_sound())
        {
            let expected = "at a place, with a speed, and of one of the size classes".into();
            return Err(value(&path, "a particle", format!("number {}", particle.sequence), expected));
        }

        for surface in &state.surfaces {
            let Some((porous, water)) = &surface.materials else { continue };
            if let Err(wrong) = porous.validate().and_then(|()| water.validate()) {
                let field = format!("materials of {}: {}", surface.name, wrong.field);
                return Err(value(&path, &field, wrong.value, format!("{} to {}", wrong.least, wrong.most)));
            }
        }

        for ((entity, _), surface) in surfaces.iter().zip(&state.surfaces) {
            put_size(world, *entity, surface.size);
            if let Some((to, since)) = surface.resizing {
                resume_resizing(world, *entity, to, since);
            }
        }
        if let Some(mut pool) = world.get_resource_mut::<MapPool>() {
            pool.resume_at(state.tick, state.hz);
        }
        rewind(world, state.tick);
        world.insert_resource(drying);
        world.insert_resource(state.weather);
        world.insert_resource(state.counts);
        world.insert_resource(state.water.clone());
        world.insert_resource(Digest(state.digest));
        world.insert_resource(EmissionSeed(state.seed));
        world.resource_mut::<WeatheringClock>().go_to(state.tick);
        let rows = settings.map(|(kept, effects)| kept.restore(world, effects));
        for (entity, emitter) in emitters_in_order(world).into_iter().zip(&state.emitters) {
            if let Some(mut state) = world.get_mut::<EmitterState>(entity) {
                *state = emitter.clone();
            }
        }
        let mut particles = world.resource_mut::<Particles>();
        particles.clear();
        let in_world = |&saved: &SavedParticle| Particle::from(effects::with_row(saved, rows.as_deref()));
        particles.spawn(state.particles.iter().map(in_world));
        let waiting = state.waiting.iter().map(in_world).collect();
        world.resource_mut::<NewParticles>().restore(waiting, state.next_sequence);
        for (index, (entity, _)) in surfaces.into_iter().enumerate() {
            if let Some((porous, water)) = state.surfaces[index].materials {
                // What it holds is of this matter, and not yet to be settled as of another.
                put_matter(world, entity, porous);
                world.entity_mut(entity).insert(water);
            }
            self.restore_surface(world, index, entity);
        }
        Ok(())
    }

    fn restore_surface(&self, world: &mut World, index: usize, entity: Entity) {
        let (state, saved) = (&self.state.surfaces[index], &self.surfaces[index]);
        if let Some(mut totals) = world.get_mut::<SurfaceTotals>(entity) {
            *totals = state.totals;
        }
        if let Some(mut queue) = world.get_mut::<crate::overlay::SplatQueue>(entity) {
            queue.restore_traces(state.traces);
        }
        if let Some(mut traces) = world.get_mut::<SurfaceTraces>(entity) {
            *traces = state.traces;
        }
        if let Some(mut loss) = world.get_mut::<MapLoss>(entity) {
            *loss = state.loss;
        }
        if let Some(mut water) = world.get_mut::<SurfaceWater>(entity) {
            *water = SurfaceWater { wrap: water.wrap, notes_dried: state.matter, ..saved.water.clone() };
        }
        if let Some(mut matter) = world.get_mut::<SurfaceMatter>(entity) {
            *matter = saved.matter.clone();
        }
        if let Some(mut overlays) = world.get::<Overlays>(entity).cloned() {
            let colors = &saved.colors;
            let is_empty = |bytes: &[u8]| bytes.iter().all(|&byte| byte == 0);
            if is_empty(&colors.diffuse) && is_empty(&colors.specular) && is_empty(&colors.normal) {
                // The first splat that paints will make room.
                return;
            }
            let lying = world.get::<SurfaceFrames>(entity).map(Lying::new);
            let mut images = world.resource_mut::<Assets<Image>>();
            overlays.open_colors(&mut images);
            for (handle, bytes) in [
                (&mut overlays.diffuse, &saved.colors.diffuse),
                (&mut overlays.specular, &saved.colors.specular),
                (&mut overlays.normal, &saved.colors.normal),
            ] {
                let Some(mut image) = images.get(&*handle).cloned() else { continue };
                // A texture with data needs that of its mip maps, too.
                let levels = mip_chain(bytes.as_chunks::<4>().0, overlays.size, lying.as_ref());
                image.data = Some([bytes.as_slice(), levels.concat().as_flattened()].concat());
                image.asset_usage = RenderAssetUsages::RENDER_WORLD;
                *handle = images.add(image);
            }
            world.entity_mut(entity).insert(overlays);
        } else if let (Some(surface), Some(size)) =
            (world.get::<Weatherable>(entity), world.get::<MapSize>(entity))
        {
            // Without a renderer there are none before the first tick.
            let texels = |bytes: &[u8]| bytes.as_chunks::<4>().0.to_vec();
            let maps = CpuMaps {
                diffuse: texels(&saved.colors.diffuse),
                specular: texels(&saved.colors.specular),
                normal: texels(&saved.colors.normal),
                ..CpuMaps::of_size(size.texels(), surface.wrap())
            };
            world.entity_mut(entity).insert(maps);
        }
    }
}
