//! Events act.

use bevy::prelude::*;

use super::steps::{MaterialStep, Timeline};
use super::{Expectations, due, emitter_motion, expect};
use crate::brush::{BrushQueue, Stroke, paint_strokes};
use crate::clock::WeatheringClock;
use crate::emitter::Emitter;
use crate::material::WettingTextures;
use crate::scenario::motion::{ByHand, EmitterMotion, move_emitters};
use crate::scenario::scene_spawn::FileLook;
use crate::scenario::{Digest, EmitterSpec, Scenario, ScenarioSurface, digest};
use crate::schedule::{WeatheringSystems, WeatheringTick};
use crate::weather::Weather;
use crate::wetting::{ExchangeMatter, put_matter};

/// The materials of the scenario, in the order of their names. Empty without a renderer.
#[derive(Resource, Debug, Default)]
pub(in crate::scenario) struct MaterialHandles(
    pub(in crate::scenario) Vec<(Handle<StandardMaterial>, WettingTextures)>,
);

/// What happens in a scenario that begins.
pub(in crate::scenario) fn insert_events(world: &mut World, scenario: &Scenario) {
    world.insert_resource(Timeline::new(scenario));
    world.insert_resource(Expectations::new(scenario));
}

/// Lets other events happen from the next tick on, in the scenario that runs. What has acted so far must be the same in
/// both. Expectations stay what they were.
pub(crate) fn exchange_events(world: &mut World, scenario: &Scenario) {
    world.insert_resource(Timeline::new(scenario));
    let mut emitters = world.query::<(&Emitter, &mut EmitterMotion)>();
    for (emitter, mut motion) in emitters.iter_mut(world) {
        if let Some(spec) = scenario.emitters.get(emitter.stream as usize) {
            *motion = emitter_motion(scenario, spec);
        }
    }
}

/// Lets happen what [`insert_events`] says.
pub(in crate::scenario) fn apply_events_plugin(app: &mut App) {
    app.init_resource::<MaterialHandles>()
        .add_systems(
            WeatheringTick,
            (
                // Emitters stand where they should before they emit.
                move_emitters,
                adjust_emitters,
                change_weather,
                exchange_materials,
                queue_strokes,
                digest_events,
            )
                .chain()
                .in_set(WeatheringSystems::First)
                // Strokes are painted in the tick that they belong to, on what surfaces are made of by then.
                .before(paint_strokes),
        )
        .add_systems(
            WeatheringTick,
            (digest::digest_impacts, expect::look).chain().in_set(WeatheringSystems::Last),
        );
}

/// Makes an emitter what it should be, but for its effect.
fn adjust(emitter: &mut Emitter, spec: &EmitterSpec) {
    emitter.rate = spec.rate;
    emitter.shape = spec.shape;
    emitter.flow = spec.flow;
    emitter.speed = spec.initial_speed();
    emitter.spread = spec.spread_deg.to_radians();
    emitter.lifetime = spec.lifetime;
}

fn adjust_emitters(
    timeline: Res<Timeline>,
    clock: Res<WeatheringClock>,
    mut emitters: Query<&mut Emitter, (With<EmitterMotion>, Without<ByHand>)>,
) {
    for step in due(&timeline.emitters, clock.tick(), |step| step.tick) {
        if let Some(mut emitter) = emitters.iter_mut().find(|emitter| emitter.stream == step.emitter) {
            adjust(&mut emitter, &step.spec);
        }
    }
}

/// Whatever else changes the weather between events may do so.
fn change_weather(timeline: Res<Timeline>, clock: Res<WeatheringClock>, mut weather: ResMut<Weather>) {
    let tick = clock.tick();
    // No two overlap, so they are in order of their last ticks, too.
    let first = timeline.changes.partition_point(|step| step.last < tick);
    for step in timeline.changes[first..].iter().take_while(|step| step.first <= tick) {
        // What events leave alone stays what it is.
        let Weather { wind, temperature_c, humidity, sun_w_per_m2, drying_speed, .. } = step.at(tick);
        *weather = Weather {
            wind: if step.from.wind == step.to.wind { weather.wind } else { wind },
            temperature_c: kept(
                step.from.temperature_c,
                step.to.temperature_c,
                weather.temperature_c,
                temperature_c,
            ),
            humidity: kept(step.from.humidity, step.to.humidity, weather.humidity, humidity),
            sun_w_per_m2: kept(
                step.from.sun_w_per_m2,
                step.to.sun_w_per_m2,
                weather.sun_w_per_m2,
                sun_w_per_m2,
            ),
            drying_speed: kept(
                step.from.drying_speed,
                step.to.drying_speed,
                weather.drying_speed,
                drying_speed,
            ),
            ..*weather
        };
    }
}

/// The new value, or the current one if the step does not change it.
fn kept(from: f32, to: f32, current: f32, new: f32) -> f32 {
    if from == to { current } else { new }
}

fn exchange_materials(
    timeline: Res<Timeline>,
    clock: Res<WeatheringClock>,
    handles: Res<MaterialHandles>,
    surfaces: Query<(Entity, &ScenarioSurface)>,
    mut matter: ExchangeMatter,
    mut commands: Commands,
) {
    for step in due(&timeline.materials, clock.tick(), |step| step.tick) {
        let Some((entity, _)) = surfaces.iter().find(|(_, surface)| surface.index == step.surface) else {
            continue;
        };
        matter.exchange(entity, step.porous);
        let look = step.material.and_then(|index| handles.0.get(index));
        let mut entity = commands.entity(entity);
        entity.insert(step.water);
        if let Some((material, textures)) = look {
            // Is exchanged for its weathered form before it is drawn.
            entity.insert((MeshMaterial3d(material.clone()), textures.clone()));
        }
    }
}

fn queue_strokes(
    timeline: Res<Timeline>,
    clock: Res<WeatheringClock>,
    surfaces: Query<(Entity, &ScenarioSurface)>,
    mut queue: ResMut<BrushQueue>,
) {
    for step in due(&timeline.strokes, clock.tick(), |step| step.tick) {
        let entity_of = |index: u32| {
            surfaces.iter().find(|(_, surface)| surface.index == index).map(|(entity, _)| entity)
        };
        let surface = step.surface.and_then(entity_of);
        if surface.is_some() == step.surface.is_some() {
            queue.0.push(Stroke { brush: step.brush, surface });
        }
    }
}

/// Adds what acts in this tick.
fn digest_events(timeline: Res<Timeline>, clock: Res<WeatheringClock>, mut digest: ResMut<Digest>) {
    let acts = due(&timeline.acts, clock.tick(), |(tick, _)| *tick);
    if acts.is_empty() {
        return;
    }
    let mut hasher = blake3::Hasher::new();
    hasher.update(&digest.0).update(&clock.tick().to_le_bytes());
    for (_, hash) in acts {
        hasher.update(hash);
    }
    digest.0 = *hasher.finalize().as_bytes();
}

/// Makes surfaces and emitters what they are at a tick that is gone to, and the weather that of the start if it is 0. For runs
/// that are started over or gone on with; their water and their weather are somebody else's to put back.
pub(crate) fn rewind(world: &mut World, tick: u32) {
    let Some(timeline) = world.get_resource::<Timeline>().cloned() else { return };
    if tick == 0 && !timeline.changes.is_empty() {
        world.insert_resource(timeline.weather);
    }
    if let Some(mut queue) = world.get_resource_mut::<BrushQueue>() {
        queue.0.clear();
    }
    if let Some(mut expectations) = world.get_resource_mut::<Expectations>() {
        expectations.forget();
    }
    let mut emitters = world.query_filtered::<&mut Emitter, (With<EmitterMotion>, Without<ByHand>)>();
    for mut emitter in emitters.iter_mut(world) {
        let stream = emitter.stream;
        let mut past = timeline.emitters.iter().rev().filter(|step| step.tick <= tick);
        if let Some(step) = past.find(|step| step.emitter == stream) {
            adjust(&mut emitter, &step.spec);
        }
    }
    let mut surfaces = world.query::<(Entity, &ScenarioSurface)>();
    let surfaces: Vec<_> = surfaces.iter(world).map(|(entity, surface)| (entity, surface.index)).collect();
    for (entity, index) in surfaces {
        let past = || {
            let past = timeline.materials.iter().rev();
            past.filter(|step| step.surface == index && step.tick <= tick)
        };
        let Some(MaterialStep { porous, water, .. }) = past().next() else { continue };
        put_matter(world, entity, *porous);
        world.entity_mut(entity).insert(*water);
        let handles = world.resource::<MaterialHandles>();
        let look = past().find_map(|step| step.material).and_then(|index| handles.0.get(index)).cloned();
        // Of a scene's surface, which began with the material of its file.
        let own = || Some((world.get::<FileLook>(entity)?.0.clone(), WettingTextures::default()));
        let look = look.or_else(own);
        if let Some((material, textures)) = look {
            world.entity_mut(entity).insert((MeshMaterial3d(material), textures));
        }
    }
}
