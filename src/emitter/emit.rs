//! What each emitter owes in this tick, and paying it in one batch.

use bevy::prelude::*;
use rand_pcg::Pcg32;

use super::detail::Deal;
use super::shape::unit;
use super::sources::Births;
use super::{EmissionDetail, EmissionSeed, Emitter, EmitterState, Source, TrackSources};
use crate::clock::WeatheringClock;
use crate::effect::drops::SIZE_CLASSES;
use crate::effect::{DropSizes, EffectIndex, EffectTable};
use crate::particle::{Lifespan, Particle, ParticleConfig, ParticleCounts, Particles, Sequence, WaterCounts};

/// Particles that are spawned at the end of a tick's emission; a buffer that keeps its capacity. Between ticks, drips wait
/// in it.
#[derive(Resource, Debug, Default)]
pub struct NewParticles {
    particles: Vec<Particle>,
    next_sequence: u32,
    births: Births,
}

impl NewParticles {
    /// Starts numbering again from 0, for a new run in a world without particles.
    pub fn restart(&mut self) {
        self.particles.clear();
        self.next_sequence = 0;
        self.births = Births::default();
    }

    /// The number of the next particle.
    pub(crate) fn next_sequence(&self) -> u32 {
        self.next_sequence
    }

    /// Those that wait to be spawned.
    pub(crate) fn waiting(&self) -> &[Particle] {
        &self.particles
    }

    /// As they were when the run was saved.
    pub(crate) fn restore(&mut self, waiting: Vec<Particle>, next_sequence: u32) {
        self.particles = waiting;
        self.next_sequence = next_sequence;
        self.births = Births::default();
    }

    /// Whose everything is that is added from now on.
    pub(crate) fn attribute_to(&mut self, source: Source) {
        self.births.attribute_to(source);
    }

    /// Whose a particle is that is in flight, or was until this tick; unknown unless sources are tracked.
    pub(crate) fn source_of(&self, sequence: Sequence) -> Source {
        self.births.source_of(sequence.0, self.next_sequence)
    }

    /// Adds one more particle, which gets the next number.
    pub fn push(&mut self, particle: impl FnOnce(Sequence) -> Particle) {
        let particle = particle(Sequence(self.next_sequence));
        self.births.note(self.next_sequence, particle.lifespan.ticks_left);
        self.particles.push(particle);
        self.next_sequence = self.next_sequence.wrapping_add(1);
    }
}

/// An emitter's turn in a tick.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn {
    emitter: Entity,
    number: u32,
    /// Emitters with the same number that came before.
    twins: u32,
    effect: EffectIndex,
    due: u32,
    /// When within the tick the first is born, and the time between two; ticks.
    first: f64,
    interval: f64,
}

/// Lets every enabled emitter, in the order of their streams, write the particles it owes, or, where there is not room for all,
/// its part of them.
pub(super) fn emit_particles(
    clock: Res<WeatheringClock>,
    seed: Res<EmissionSeed>,
    config: Res<ParticleConfig>,
    mut detail: ResMut<EmissionDetail>,
    mut effects: ResMut<EffectTable>,
    mut counts: ResMut<ParticleCounts>,
    mut water: ResMut<WaterCounts>,
    mut new: ResMut<NewParticles>,
    mut track: Option<ResMut<TrackSources>>,
    mut order: Local<Vec<(u32, Entity)>>,
    mut turns: Local<Vec<Turn>>,
    mut emitters: Query<(&Emitter, &mut EmitterState, &GlobalTransform)>,
    streams: Query<(&Emitter, Entity)>,
) {
    new.births.begin_tick(track.is_some(), clock.tick());
    order.clear();
    order.extend(streams.iter().map(|(emitter, id)| (emitter.stream, id)));
    order.sort_unstable();

    // What all owe comes first: where there is less room, all are cut alike.
    turns.clear();
    let (mut stream, mut twins) = (None, 0u32);
    for &(number, entity) in order.iter() {
        twins = if stream.replace(number) == Some(number) { twins + 1 } else { 0 };
        let Ok((emitter, mut state, transform)) = emitters.get_mut(entity) else { continue };
        // What is no number would stay in what is owed for ever, or be where nothing is.
        let is_sound = emitter.is_finite() && transform.affine().is_finite();
        if !emitter.enabled || emitter.rate <= 0.0 || !is_sound {
            continue;
        }
        let Some(effect) = effects.index_of(&emitter.effect) else { continue };
        if effects.row(effect).is_none() {
            continue;
        }
        let (due, first, interval) = state.due(emitter.rate, clock.hz());
        turns.push(Turn { emitter: entity, number, twins, effect, due, first, interval });
    }
    let asked: u64 = turns.iter().map(|turn| u64::from(turn.due)).sum();
    let room = u64::from(config.max_alive).saturating_sub(counts.alive + new.particles.len() as u64);
    let mut deal = Deal::new(asked, detail.bypass_change_detection().allow(asked).min(room), clock.tick());

    for turn in turns.iter() {
        let &Turn { number, twins, effect: index, due, first, interval, .. } = turn;
        let Ok((emitter, mut state, transform)) = emitters.get_mut(turn.emitter) else { continue };
        let Some(row) = effects.row(index) else { continue };
        let Some(effect) = &row.effect else { continue };
        let state = &mut *state;
        // Emitters that share a number do not send the same particles.
        let own_stream = || Pcg32::new(seed.0, u64::from(number) | u64::from(twins) << 32);
        let mut rng = state.rng.take().unwrap_or_else(own_stream);
        let count = deal.take(due);
        let each_nl = f64::from(emitter.particle_mm3(effect)) * 1000.0;
        let share_nl = if emitter.has_flow() {
            counts.merged += u64::from(due - count);
            state.share_nl(due, count, each_nl)
        } else {
            counts.refused += u64::from(due - count);
            each_nl
        };
        state.emitted += u64::from(count);
        if let Some(track) = &mut track {
            state.source = track.bypass_change_detection().number(turn.emitter, state.source);
            new.attribute_to(state.source);
        }

        let world_from_emitter = transform.affine();
        let ticks_left = (emitter.lifetime * clock.hz() as f32).ceil().max(1.0);
        let ticks_left = ticks_left.min(f32::from(Lifespan::MAX_TICKS)) as u16;
        for i in 0..count {
            let class = match effect.drops {
                DropSizes::Same(_) => 0,
                DropSizes::MarshallPalmer(_) => (unit(&mut rng) * SIZE_CLASSES as f32) as u8,
            };
            let fall_speed = row.terminal_speed(usize::from(class));
            let (position, velocity) = emitter.sample(&world_from_emitter, &mut rng, fall_speed);
            // Those that are sent are spread evenly over those that are due.
            let place = u64::from(i) * u64::from(due) / u64::from(count);
            let born_at = ((first + place as f64 * interval) * 65_536.0).clamp(0.0, 65_535.0) as u16;
            let volume_nl = state.water_nl(share_nl);
            water.emitted_nl += u64::from(row.water_nl(volume_nl));
            let lifespan = Lifespan { ticks_left, born_at };
            new.push(|sequence| Particle {
                position,
                velocity,
                lifespan,
                volume_nl,
                sequence,
                effect: index,
                class,
            });
        }
        state.rng = Some(rng);
    }
    // What others add is not an emitter's.
    new.attribute_to(Source::UNKNOWN);
}

/// Spawns what [`emit_particles`] wrote, and what others put beside it since the last tick, in one batch.
pub(crate) fn spawn_particles(
    mut new: ResMut<NewParticles>,
    mut particles: ResMut<Particles>,
    mut counts: ResMut<ParticleCounts>,
) {
    let count = new.particles.len() as u64;
    particles.spawn(new.particles.drain(..));
    counts.emitted += count;
    counts.alive += count;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::WeatherEffect;
    use crate::emitter::{EmitterShape, Flow};

    fn world(hz: u32, effect: WeatherEffect) -> World {
        let mut world = World::new();
        world.insert_resource(WeatheringClock::new(hz));
        world.insert_resource(EmissionSeed(7));
        world.init_resource::<ParticleConfig>();
        world.init_resource::<EmissionDetail>();
        world.init_resource::<ParticleCounts>();
        world.init_resource::<WaterCounts>();
        world.init_resource::<NewParticles>();
        world.init_resource::<Particles>();
        let mut table = EffectTable::default();
        table.insert(Handle::default(), effect);
        world.insert_resource(table);
        world
    }

    fn run(world: &mut World, ticks: u32) {
        let mut schedule = Schedule::default();
        schedule.add_systems((emit_particles, spawn_particles).chain());
        for _ in 0..ticks {
            schedule.run(world);
        }
    }

    fn emitted(world: &World) -> u64 {
        world.resource::<ParticleCounts>().emitted
    }

    #[test]
    fn rates_are_exact_at_any_tick_rate() {
        for hz in [1, 3, 7, 24, 50, 60, 64, 144, 1000] {
            for (rate, seconds, expected) in
                [(1000.0, 10, 10_000), (0.1, 30, 3), (333.25, 4, 1333), (1.0, 7, 7), (12_345.5, 2, 24_691)]
            {
                let mut world = world(hz, WeatherEffect::default());
                world.spawn(Emitter { rate, lifetime: 1000.0, ..default() });
                run(&mut world, hz * seconds);
                assert_eq!(emitted(&world), expected, "{rate}/s at {hz} Hz for {seconds} s");
                let spawned = world.resource::<Particles>().len() as u64;
                assert_eq!(spawned, expected);
            }
        }
    }

    #[test]
    fn births_are_spread_evenly_over_the_tick() {
        let mut world = world(10, WeatherEffect::default());
        world.spawn(Emitter { rate: 40.0, ..default() });
        run(&mut world, 1);
        let mut parts: Vec<f32> =
            world.resource::<Particles>().lifespans().iter().map(|life| life.moving_part()).collect();
        parts.sort_by(f32::total_cmp);
        for (part, expected) in parts.iter().zip([0.0, 0.25, 0.5, 0.75]) {
            assert!((part - expected).abs() < 1e-3, "{parts:?}");
        }
    }

    #[test]
    fn water_adds_up_to_the_flow() {
        let mut world = world(60, WeatherEffect { volume_mm3: 4.1887903, ..default() });
        world.spawn(Emitter { rate: 1000.0, ..default() });
        run(&mut world, 600);
        let total: u64 = world.resource::<Particles>().volumes_nl().iter().copied().map(u64::from).sum();
        let expected = f64::from(4.1887903_f32) * 1000.0 * 10_000.0;
        assert!((total as f64 - expected).abs() <= 1.0, "{total} vs {expected}");
    }

    #[test]
    fn the_cap_holds_and_what_it_refused_is_counted() {
        let mut world = world(60, WeatherEffect::default());
        world.insert_resource(ParticleConfig { max_alive: 100 });
        world.spawn(Emitter { rate: 6000.0, ..default() });
        world.spawn(Emitter { rate: 6000.0, stream: 1, ..default() });
        run(&mut world, 3);
        let counts = world.resource::<ParticleCounts>();
        assert_eq!((counts.emitted, counts.alive, counts.refused), (100, 100, 500));
    }

    /// A hose of 6 l/min, 100 ml/s, by a rate.
    fn hose(rate: f32, stream: u32) -> Emitter {
        Emitter { rate, stream, flow: Flow::LitresPerMinute(6.0), ..default() }
    }

    fn sent_nl(world: &World) -> u64 {
        world.resource::<Particles>().volumes_nl().iter().copied().map(u64::from).sum()
    }

    #[test]
    fn fewer_particles_of_a_flow_carry_all_its_water() {
        let all = |factor: f32| {
            let mut world = world(60, WeatherEffect::default());
            world.resource_mut::<EmissionDetail>().set_factor(factor);
            let emitter = world.spawn(hose(6000.0, 0)).id();
            run(&mut world, 600);
            let held = world.get::<EmitterState>(emitter).unwrap().held_mm3();
            (sent_nl(&world) as f64 + held * 1000.0, *world.resource::<ParticleCounts>())
        };
        for factor in [1.0, 0.7, 0.05, 0.001] {
            let (nl, counts) = all(factor);
            // A litre in ten seconds.
            assert!((nl / 1.0e9 - 1.0).abs() < 1e-6, "{factor}: {nl}");
            assert_eq!((counts.emitted + counts.merged, counts.refused), (60_000, 0));
            let sent = 60_000.0 * f64::from(factor);
            assert!((counts.emitted as f64 - sent).abs() <= 1.0, "{factor}: {counts:?}");
        }
    }

    #[test]
    fn the_cap_cuts_all_alike_holds_water_and_lets_it_go_when_there_is_room() {
        let mut world = world(60, WeatherEffect::default());
        world.insert_resource(ParticleConfig { max_alive: 100 });
        let hoses = [0, 1].map(|stream| world.spawn(hose(6000.0, stream)).id());
        world.spawn(Emitter { rate: 6000.0, stream: 2, ..default() });
        run(&mut world, 2);
        let counts = *world.resource::<ParticleCounts>();
        assert_eq!((counts.emitted, counts.merged + counts.refused), (100, 500));
        assert!((160..=168).contains(&counts.refused), "{counts:?}");
        let of = |world: &World| hoses.map(|hose| world.get::<EmitterState>(hose).unwrap().clone());
        assert!(of(&world).iter().all(|state| (30..=37).contains(&state.emitted)), "{:?}", of(&world));
        // The second tick had no room: its water waits.
        let held: f64 = of(&world).iter().map(EmitterState::held_mm3).sum();
        assert!((held - 2.0 * 100_000.0 / 60.0).abs() < 1.0, "{held}");
        world.resource_mut::<ParticleConfig>().max_alive = 1000;
        run(&mut world, 1);
        assert!(of(&world).iter().all(|state| state.held_mm3() == 0.0));
        let plain_nl =
            world.resource::<Particles>().volumes_nl().iter().filter(|&&nl| nl == 4190 || nl == 4189);
        assert!(plain_nl.count() > 100);
    }

    #[test]
    fn a_particle_takes_no_more_than_it_may_carry() {
        let mut state = EmitterState::default();
        assert_eq!(state.share_nl(3, 3, 4.0), 4.0);
        assert_eq!(state.share_nl(1000, 0, 4.0e6), 0.0);
        assert_eq!((state.share_nl(0, 2, 4.0e6), state.held_mm3()), (1.0e9, 2.0e6));
        assert_eq!((state.share_nl(0, 4, 4.0e6), state.held_mm3()), (5.0e8, 0.0));
    }

    #[test]
    fn streams_are_independent_and_repeat() {
        let run_with = |streams: &[u32]| {
            let mut world = world(60, WeatherEffect::default());
            for &stream in streams {
                let shape = EmitterShape::Box { half_size: Vec3::ONE };
                world.spawn(Emitter { rate: 60.0, stream, shape, ..default() });
            }
            run(&mut world, 5);
            let particles = world.resource::<Particles>();
            particles.positions().iter().map(|position| position.to_array()).collect::<Vec<_>>()
        };
        let alone = run_with(&[0]);
        let both = run_with(&[1, 0]);
        assert_eq!(alone, run_with(&[0]));
        assert_eq!(alone, both.iter().copied().step_by(2).collect::<Vec<_>>(), "stream 0 goes first");
        assert_ne!(alone, run_with(&[1]));
    }

    #[test]
    fn numbers_that_are_none_emit_nothing_and_are_forgotten() {
        let mut world = world(60, WeatherEffect { volume_mm3: 4.0, ..default() });
        let emitter = world.spawn(Emitter { rate: 600.0, ..default() }).id();
        let set = |world: &mut World, rate: f32, flow: Flow| {
            let mut emitter = world.get_mut::<Emitter>(emitter).unwrap();
            (emitter.rate, emitter.flow) = (rate, flow);
        };
        for rate in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0] {
            set(&mut world, rate, Flow::Effect);
            run(&mut world, 3);
            assert_eq!(emitted(&world), 0, "{rate}");
        }
        let sound = Emitter { rate: 600.0, ..default() };
        let half_size = Vec2::new(1.0, f32::NAN);
        for wrong in [
            Emitter { speed: f32::NAN, ..sound.clone() },
            Emitter { spread: f32::INFINITY, ..sound.clone() },
            Emitter { shape: EmitterShape::Cone { radius: f32::NAN }, ..sound.clone() },
            Emitter { shape: EmitterShape::Sky { half_size }, ..sound.clone() },
        ] {
            *world.get_mut::<Emitter>(emitter).unwrap() = wrong;
            run(&mut world, 3);
        }
        world.entity_mut(emitter).insert((sound, GlobalTransform::from_xyz(0.0, f32::NAN, 0.0)));
        run(&mut world, 3);
        assert_eq!(emitted(&world), 0);
        world.entity_mut(emitter).insert(GlobalTransform::IDENTITY);
        for litres in [f32::NAN, f32::INFINITY, -3.0] {
            set(&mut world, 600.0, Flow::LitresPerMinute(litres));
            let (before, water) = (emitted(&world), sent_nl(&world));
            run(&mut world, 6);
            assert_eq!((emitted(&world), sent_nl(&world)), (before + 60, water), "{litres}");
        }
        set(&mut world, 600.0, Flow::Effect);
        let (before, water) = (emitted(&world), sent_nl(&world));
        run(&mut world, 6);
        assert_eq!((emitted(&world), sent_nl(&world)), (before + 60, water + 60 * 4000));
        assert!(world.get::<EmitterState>(emitter).unwrap().is_sound(60));
    }

    #[test]
    fn an_emitter_without_its_effect_owes_nothing() {
        let mut world = world(60, WeatherEffect::default());
        *world.resource_mut::<EffectTable>() = EffectTable::default();
        let emitter = world.spawn(Emitter::default()).id();
        run(&mut world, 60);
        assert_eq!(emitted(&world), 0);
        assert_eq!(world.get::<EmitterState>(emitter).unwrap().owed, 0.0);
    }
}
