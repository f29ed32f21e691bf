//! Particles and splashes as rows that the shader pulls.
//!
//! One pass over the columns writes 32 bytes for each particle, into memory that is used again. What all particles of an
//! effect share is packed once, before; what depends on where the eye is, is left to the shader.

use bevy::prelude::*;
use bevy::render::storage::ShaderBuffer;
use bytemuck::{Pod, Zeroable};
use half::f16;

use super::splash::{SplashConfig, Splashes};
use super::sprites::Sprite;
use crate::clock::WeatheringClock;
use crate::effect::{EffectIndex, EffectTable, WeatherEffect};
use crate::particle::{Particles, Sequence};

/// A particle, or a splash, as the shader reads it: `Particle` in `shaders/particles.wgsl` has the same fields.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct GpuParticle {
    /// World space, metres.
    pub position: [f32; 3],
    /// From the lowest bit: effect (16), sprite (4), a random number (12).
    pub kind: u32,
    /// m/s; of a splash the normal it stands on.
    pub velocity: [f32; 3],
    /// Size in metres as an `f16` (low); ticks that are left, or of a splash its age, 65,535 being the end (high).
    pub size_age: u32,
}

/// How an effect looks: `Look` in `shaders/particles.wgsl` has the same fields.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct GpuLook {
    /// Linear RGBA.
    pub color: [f32; 4],
    /// Seconds that the shutter is open.
    pub exposure: f32,
    /// The fastest it turns round itself, rad/s.
    pub spin: f32,
    /// Nothing.
    pub pad: [u32; 2],
}

/// What is the same for all particles; the looks follow it. `Frame` in `shaders/particles.wgsl` begins with the same
/// fields.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct GpuFrame {
    /// Rows.
    pub count: u32,
    /// Length of a tick in seconds.
    pub tick_secs: f32,
    /// Nothing.
    pub pad: [u32; 2],
}

impl GpuLook {
    fn new(effect: &WeatherEffect) -> Self {
        let look = &effect.look;
        let spin = match Sprite::from(look.sprite) {
            Sprite::Flake => 1.6,
            Sprite::Clod => 5.0,
            Sprite::Grain => 14.0,
            Sprite::Streak | Sprite::Drop | Sprite::Splash => 0.0,
        };
        Self { color: look.color, exposure: look.exposure, spin, pad: [0; 2] }
    }
}

/// What particles of an effect share. The default, of effects that are not there yet, is not drawn.
#[derive(Debug, Clone, Copy, Default)]
struct Shared {
    /// [`GpuParticle::kind`] without the random number.
    kind: u32,
    /// [`GpuParticle::size_age`] of a particle with `volume_nl`.
    size: u32,
    width: f32,
    /// What a particle carries as a rule.
    volume_nl: u32,
}

impl Shared {
    fn new(index: usize, effect: &WeatherEffect) -> Self {
        let look = &effect.look;
        Self {
            kind: pack_kind(index as u16, Sprite::from(look.sprite)),
            size: pack_size(look.width),
            width: look.width,
            volume_nl: (effect.volume_mm3 * 1000.0).round() as u32,
        }
    }

    /// A drop of eight times the volume is twice as wide. Emitters deal in whole nanolitres: by as little as 1 part in 64,
    /// nothing is worked out.
    fn size_of(&self, volume_nl: u32) -> u32 {
        if volume_nl.abs_diff(self.volume_nl) <= 1 + self.volume_nl / 64 || self.volume_nl == 0 {
            return self.size;
        }
        let ratio = volume_nl as f32 / self.volume_nl as f32;
        pack_size(self.width * ratio.cbrt().clamp(0.25, 4.0))
    }
}

fn pack_kind(effect: u16, sprite: Sprite) -> u32 {
    u32::from(effect) | (sprite as u32) << 16
}

fn pack_size(metres: f32) -> u32 {
    u32::from(f16::from_f32(metres).to_bits())
}

/// The upper bits of [`GpuParticle::kind`]. Neighbours in number are far apart.
fn pack_random(sequence: Sequence) -> u32 {
    (sequence.0.wrapping_mul(0x9e37_79b9) >> 20) << 20
}

/// All that is drawn in a frame. One of the main and one of the render world change places in every frame.
#[derive(Resource, Default)]
pub(super) struct ParticleRows {
    pub(super) frame: GpuFrame,
    pub(super) looks: Vec<GpuLook>,
    pub(super) rows: Vec<GpuParticle>,
    /// Where the rows, and the frame with the looks, are to be written.
    pub(super) buffers: Option<[AssetId<ShaderBuffer>; 2]>,
    shared: Vec<Shared>,
}

impl ParticleRows {
    /// The most rows: as many as base WebGPU lets a storage buffer hold.
    pub(super) const MOST: usize = (128 << 20) / size_of::<GpuParticle>();

    /// Writes everything anew.
    pub(super) fn write(
        &mut self,
        particles: &Particles,
        splashes: impl Iterator<Item = (GpuParticle, EffectIndex)>,
        effects: &EffectTable,
        clock: &WeatheringClock,
    ) {
        let Self { frame, looks, rows, shared, .. } = self;
        looks.clear();
        shared.clear();
        for (index, row) in effects.rows().iter().enumerate() {
            let effect = row.effect.as_ref();
            looks.push(effect.map_or(GpuLook::default(), GpuLook::new));
            shared.push(effect.map_or(Shared::default(), |effect| Shared::new(index, effect)));
        }
        let columns = particles.positions().iter().zip(particles.velocities());
        let columns = columns.zip(particles.lifespans()).zip(particles.volumes_nl());
        let columns = columns.zip(particles.sequences()).zip(particles.effects());
        rows.clear();
        rows.extend(columns.map(|(((((position, velocity), lifespan), volume_nl), sequence), effect)| {
            let shared = shared.get(usize::from(effect.0)).copied().unwrap_or_default();
            GpuParticle {
                position: position.to_array(),
                kind: shared.kind | pack_random(*sequence),
                velocity: velocity.to_array(),
                size_age: shared.size_of(*volume_nl) | u32::from(lifespan.ticks_left) << 16,
            }
        }));
        rows.extend(splashes.filter(|(_, effect)| usize::from(effect.0) < looks.len()).map(|(row, _)| row));
        rows.truncate(Self::MOST);
        *frame = GpuFrame { count: rows.len() as u32, tick_secs: clock.delta_secs(), pad: [0; 2] };
    }
}

/// Splashes as rows.
pub(super) fn splash_rows(
    splashes: &Splashes,
    config: &SplashConfig,
    clock: &WeatheringClock,
) -> impl Iterator<Item = (GpuParticle, EffectIndex)> {
    splashes.shown(config, clock).map(|(splash, age)| {
        let row = GpuParticle {
            position: splash.point.to_array(),
            kind: pack_kind(splash.effect.0, Sprite::Splash) | pack_random(splash.sequence),
            velocity: splash.normal.to_array(),
            size_age: pack_size(splash.size) | u32::from(age) << 16,
        };
        (row, splash.effect)
    })
}

#[cfg(test)]
mod tests {
    use super::super::splash::Splash;
    use super::*;
    use crate::effect::ParticleLook;
    use crate::particle::{Lifespan, Particle};

    fn particle(number: u32, effect: EffectIndex, volume_nl: u32) -> Particle {
        Particle {
            position: Vec3::new(1.0, 2.0, 3.0) * number as f32,
            velocity: Vec3::NEG_Y * number as f32,
            lifespan: Lifespan { ticks_left: 300 + number as u16, born_at: 0 },
            volume_nl,
            sequence: Sequence(number),
            effect,
            class: 0,
        }
    }

    fn table(looks: &[ParticleLook]) -> EffectTable {
        let mut effects = EffectTable::default();
        for (number, look) in looks.iter().enumerate() {
            let id = bevy::asset::uuid::Uuid::from_u128(number as u128 + 1);
            let effect = WeatherEffect { volume_mm3: 8.0, look: *look, ..default() };
            effects.insert(Handle::Uuid(id, std::marker::PhantomData), effect).unwrap();
        }
        effects
    }

    fn written(particles: &[Particle], effects: &EffectTable) -> ParticleRows {
        let mut all = Particles::default();
        all.spawn(particles.iter().copied());
        let mut rows = ParticleRows::default();
        rows.write(&all, std::iter::empty(), effects, &WeatheringClock::new(50));
        rows
    }

    fn size(row: &GpuParticle) -> f32 {
        f16::from_bits(row.size_age as u16).to_f32()
    }

    #[test]
    fn a_row_holds_what_the_particle_is() {
        let flake = ParticleLook { sprite: crate::effect::Sprite::Flake, width: 0.03, ..default() };
        let effects = table(&[ParticleLook::default(), flake]);
        let rows = written(&[particle(1, EffectIndex(0), 8000), particle(2, EffectIndex(1), 8000)], &effects);
        assert_eq!((rows.frame.count, rows.frame.tick_secs), (2, 0.02));
        let row = &rows.rows[1];
        assert_eq!((row.position, row.velocity), ([2.0, 4.0, 6.0], [0.0, -2.0, 0.0]));
        assert_eq!(row.kind & 0xffff, 1);
        assert_eq!(row.kind >> 16 & 15, Sprite::Flake as u32);
        assert!((size(row) - 0.03).abs() < 1e-4, "{}", size(row));
        assert_eq!(row.size_age >> 16, 302);
        assert_ne!(rows.rows[0].kind >> 20, row.kind >> 20, "their numbers differ");
        assert_eq!(rows.looks[1].color, flake.color);
        assert!(rows.looks[1].spin > 0.0 && rows.looks[0].spin == 0.0);
    }

    #[test]
    fn larger_drops_are_wider() {
        let effects = table(&[ParticleLook { width: 0.004, ..default() }]);
        let of = |volume_nl| size(&written(&[particle(0, EffectIndex(0), volume_nl)], &effects).rows[0]);
        let plain = of(8000);
        assert_eq!(of(7999), plain);
        assert!((of(64_000) / plain - 2.0).abs() < 2e-3, "{}", of(64_000));
        assert!((of(1000) / plain - 0.5).abs() < 2e-3, "{}", of(1000));
        assert!(of(0) > 0.0 && of(u32::MAX) < 0.02);
    }

    #[test]
    fn what_has_no_effect_yet_has_no_size() {
        let rows = written(&[particle(1, EffectIndex(3), 8000)], &table(&[ParticleLook::default()]));
        assert_eq!(size(&rows.rows[0]), 0.0);
    }

    #[test]
    fn random_numbers_are_spread_over_all_there_are() {
        let mut counts = [0; 16];
        (0..1600).for_each(|number| counts[(pack_random(Sequence(number)) >> 28) as usize] += 1);
        assert!(counts.iter().all(|count| (90..=110).contains(count)), "{counts:?}");
        assert!((0..100).all(|number| pack_random(Sequence(number)) & 0xf_ffff == 0));
    }

    #[test]
    fn splashes_follow_the_particles() {
        let effects = table(&[ParticleLook::default()]);
        let clock = WeatheringClock::new(50);
        let mut splashes = Splashes::default();
        for effect in [EffectIndex(0), EffectIndex(7)] {
            let splash = Splash {
                point: Vec3::X,
                normal: Vec3::Z,
                size: 0.25,
                effect,
                sequence: Sequence(3),
                tick: 0,
            };
            splashes.push(splash, 10);
        }
        let mut all = Particles::default();
        all.spawn([particle(1, EffectIndex(0), 8000)].into_iter());
        let mut rows = ParticleRows::default();
        let config = SplashConfig::default();
        for _ in 0..2 {
            rows.write(&all, splash_rows(&splashes, &config, &clock), &effects, &clock);
        }
        // One is of an effect that there is not.
        assert_eq!((rows.rows.len(), rows.frame.count), (2, 2));
        let row = &rows.rows[1];
        assert_eq!((row.position, row.velocity), ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]));
        assert_eq!(row.kind >> 16 & 15, Sprite::Splash as u32);
        assert_eq!((size(row), row.size_age >> 16), (0.25, 0));
    }
}
