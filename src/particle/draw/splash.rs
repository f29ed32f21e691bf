//! Splashes: what is seen for a moment where something hit.
//!
//! A splash is nothing but a picture. It takes no part in the simulation and is kept in no file.

use std::collections::VecDeque;

use bevy::prelude::*;

use super::sprites::random;
use crate::clock::WeatheringClock;
use crate::collision::{Impact, Impacts};
use crate::effect::{EffectIndex, EffectRow, EffectTable};
use crate::particle::Sequence;

/// How many splashes are shown, and how long.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource, Default)]
pub struct SplashConfig {
    /// The most at a time, at most [`Self::MOST`]: new ones take the place of the oldest. 0 for none.
    pub max: u32,
    /// Life of a splash in seconds.
    pub seconds: f32,
}

impl SplashConfig {
    /// The most splashes there can be.
    pub const MOST: u32 = 4096;

    /// Life of a splash, at least one tick.
    fn ticks(&self, clock: &WeatheringClock) -> u32 {
        (self.seconds * clock.hz() as f32).round().max(1.0) as u32
    }
}

impl Default for SplashConfig {
    fn default() -> Self {
        Self { max: Self::MOST, seconds: 0.15 }
    }
}

/// Where something hit a moment ago.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Splash {
    /// World space, metres.
    pub point: Vec3,
    /// Unit normal of what was hit.
    pub normal: Vec3,
    /// Side of its picture, metres.
    pub size: f32,
    /// What hit.
    pub effect: EffectIndex,
    /// Number of the particle.
    pub sequence: Sequence,
    /// When.
    pub tick: u32,
}

impl Splash {
    /// The slower it hits, the less it throws up. `None` if the effect has no splashes.
    fn new(impact: &Impact, row: &EffectRow, tick: u32) -> Option<Self> {
        let effect = row.effect.as_ref()?;
        if effect.look.splash <= 0.0 {
            return None;
        }
        let speed = -impact.velocity.dot(impact.normal);
        let fastest = row.terminal_speed(usize::from(impact.class));
        let part = if fastest > 0.0 { speed / fastest } else { 1.0 };
        let jitter = 0.75 + 0.5 * random(impact.sequence.0, 1);
        Some(Self {
            point: impact.point,
            normal: impact.normal,
            size: effect.look.splash * jitter * part.clamp(0.1, 1.0).sqrt(),
            effect: impact.effect,
            sequence: impact.sequence,
            tick,
        })
    }
}

/// The splashes that are shown, from the oldest to the youngest.
#[derive(Resource, Debug, Default)]
pub struct Splashes {
    ring: VecDeque<Splash>,
}

impl Splashes {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.ring.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ring.is_empty()
    }

    /// From the oldest to the youngest.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Splash> {
        self.ring.iter()
    }

    /// Adds one, in place of the oldest if there are `max`.
    pub fn push(&mut self, splash: Splash, max: u32) {
        let max = max.min(SplashConfig::MOST) as usize;
        while !self.ring.is_empty() && self.ring.len() >= max {
            self.ring.pop_front();
        }
        if max > 0 {
            self.ring.push_back(splash);
        }
    }

    /// Takes out those that are `life` ticks old.
    pub fn expire(&mut self, tick: u32, life: u32) {
        if self.ring.back().is_some_and(|youngest| youngest.tick > tick) {
            // The clock went back: they are of another run.
            self.ring.clear();
        }
        while self.ring.front().is_some_and(|oldest| oldest.tick.saturating_add(life) <= tick) {
            self.ring.pop_front();
        }
    }

    /// Those that are seen now, with their age: 0 is the impact, 65,535 the end.
    pub(super) fn shown(
        &self,
        config: &SplashConfig,
        clock: &WeatheringClock,
    ) -> impl Iterator<Item = (&Splash, u16)> {
        let (now, life) = (clock.tick(), config.ticks(clock));
        self.ring.iter().filter_map(move |splash| {
            let age = now.checked_sub(splash.tick).filter(|age| *age < life)?;
            Some((splash, (u64::from(age) * 65_535 / u64::from(life)) as u16))
        })
    }
}

/// Adds the splashes of this tick's impacts, and takes out those whose time is over.
pub(super) fn add_splashes(
    impacts: Res<Impacts>,
    effects: Res<EffectTable>,
    clock: Res<WeatheringClock>,
    config: Res<SplashConfig>,
    mut splashes: ResMut<Splashes>,
) {
    let splashes = splashes.bypass_change_detection();
    splashes.expire(clock.tick(), config.ticks(&clock));
    for impact in &impacts.0 {
        let row = effects.row(impact.effect);
        if let Some(splash) = row.and_then(|row| Splash::new(impact, row, clock.tick())) {
            splashes.push(splash, config.max);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::ParticleLook;
    use crate::effect::WeatherEffect;

    fn splash(number: u32, tick: u32) -> Splash {
        Splash {
            point: Vec3::ZERO,
            normal: Vec3::Y,
            size: 0.02,
            effect: EffectIndex(0),
            sequence: Sequence(number),
            tick,
        }
    }

    fn numbers(splashes: &Splashes) -> Vec<u32> {
        splashes.iter().map(|splash| splash.sequence.0).collect()
    }

    fn impact(number: u32, effect: EffectIndex, velocity: Vec3) -> Impact {
        Impact {
            sequence: Sequence(number),
            surface: Entity::PLACEHOLDER,
            triangle: 0,
            point: Vec3::X,
            normal: Vec3::Y,
            uv: Vec2::ZERO,
            uv_per_metre: Vec2::ONE,
            along: [Vec3::X, Vec3::Z],
            back: false,
            class: 0,
            velocity,
            effect,
            volume_nl: 4190,
        }
    }

    #[test]
    fn new_ones_take_the_place_of_the_oldest() {
        let mut splashes = Splashes::default();
        (0..5).for_each(|number| splashes.push(splash(number, 7), 3));
        assert_eq!(numbers(&splashes), [2, 3, 4]);
        // A limit that was lowered holds at once.
        splashes.push(splash(5, 8), 1);
        assert_eq!(numbers(&splashes), [5]);
        splashes.push(splash(6, 9), 0);
        assert!(splashes.is_empty());
        (0..5000).for_each(|number| splashes.push(splash(number, 9), u32::MAX));
        assert_eq!(splashes.len(), SplashConfig::MOST as usize);
    }

    #[test]
    fn they_age_and_end() {
        let config = SplashConfig { seconds: 0.2, ..default() };
        let mut clock = WeatheringClock::new(20);
        let mut splashes = Splashes::default();
        splashes.push(splash(0, 0), 9);
        clock.advance();
        splashes.push(splash(1, 1), 9);
        let ages = |splashes: &Splashes, clock: &WeatheringClock| -> Vec<u16> {
            splashes.shown(&config, clock).map(|(_, age)| age).collect()
        };
        assert_eq!(ages(&splashes, &clock), [16_383, 0]);
        (0..3).for_each(|_| clock.advance());
        // The older one's four ticks are over, whether it has been taken out or not.
        assert_eq!(ages(&splashes, &clock), [49_151]);
        splashes.expire(clock.tick(), config.ticks(&clock));
        assert_eq!(numbers(&splashes), [1]);
        splashes.expire(0, 4);
        assert!(splashes.is_empty(), "the clock was set back");
    }

    #[test]
    fn only_effects_that_want_it_splash_and_slow_ones_less() {
        let mut world = World::new();
        let mut effects = EffectTable::default();
        let handle =
            |number| Handle::Uuid(bevy::asset::uuid::Uuid::from_u128(number), std::marker::PhantomData);
        let look = |splash| ParticleLook { splash, ..default() };
        let wet = WeatherEffect { look: look(0.03), terminal_speed: Some(8.0), ..default() };
        let wet = effects.insert(handle(1), wet).unwrap();
        let dry = effects.insert(handle(2), WeatherEffect { look: look(0.0), ..default() }).unwrap();
        let fast = Vec3::NEG_Y * 8.0;
        let impacts = [
            impact(0, wet, fast),
            impact(1, dry, fast),
            impact(0, wet, fast * 0.25),
            impact(2, EffectIndex(9), fast),
        ];
        world.insert_resource(Impacts(impacts.to_vec()));
        world.insert_resource(effects);
        let mut clock = WeatheringClock::new(60);
        clock.advance();
        world.insert_resource(clock);
        world.init_resource::<SplashConfig>();
        world.init_resource::<Splashes>();
        let mut schedule = Schedule::default();
        schedule.add_systems(add_splashes);
        schedule.run(&mut world);

        let splashes: Vec<Splash> = world.resource::<Splashes>().iter().copied().collect();
        assert_eq!(splashes.len(), 2);
        assert_eq!((splashes[0].point, splashes[0].normal, splashes[0].tick), (Vec3::X, Vec3::Y, 1));
        assert!((0.02..0.04).contains(&splashes[0].size), "{}", splashes[0].size);
        assert!((splashes[1].size / splashes[0].size - 0.5).abs() < 1e-5);
    }
}
