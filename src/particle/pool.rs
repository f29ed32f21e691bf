//! All particles in flight, as a structure of arrays.

use bevy::prelude::*;
use bevy::tasks::ComputeTaskPool;
use serde::{Deserialize, Serialize};

use super::{Lifespan, Sequence};
use crate::effect::EffectIndex;
use crate::effect::drops::SIZE_CLASSES;

/// A particle, with all that is known of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    /// Where it is at the end of the tick; metres, world space.
    pub position: Vec3,
    /// Velocity during the tick; m/s.
    pub velocity: Vec3,
    /// How long it has left.
    pub lifespan: Lifespan,
    /// What it carries; nanolitres, so that sums are exact.
    pub volume_nl: u32,
    /// Its number.
    pub sequence: Sequence,
    /// What it is.
    pub effect: EffectIndex,
    /// Size class of its drops, 0..16; see [`DropSizes`](crate::effect::DropSizes).
    pub class: u8,
}

/// Particles that are asked together whether one of them is dead.
const FEW: usize = 64;

/// The particles in flight: a column for each property. Their order means nothing; what must have one is ordered by
/// [`Sequence`].
#[derive(Resource, Debug, Default)]
pub struct Particles {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) velocities: Vec<Vec3>,
    pub(crate) lifespans: Vec<Lifespan>,
    pub(crate) volumes_nl: Vec<u32>,
    pub(crate) sequences: Vec<Sequence>,
    pub(crate) effects: Vec<EffectIndex>,
    pub(crate) classes: Vec<u8>,
    /// Those from here on were born in this tick.
    newborn: usize,
}

impl Particles {
    /// Bytes of a particle in flight.
    pub const BYTES: usize = 2 * size_of::<Vec3>()
        + size_of::<Lifespan>()
        + size_of::<u32>()
        + size_of::<Sequence>()
        + size_of::<EffectIndex>()
        + size_of::<u8>();

    /// How many there are.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Where they are at the end of the tick; metres, world space.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// The same, to be moved. What is moved far did not fly there, and hits nothing on the way.
    pub fn positions_mut(&mut self) -> &mut [Vec3] {
        &mut self.positions
    }

    /// Velocities during the tick; m/s.
    pub fn velocities(&self) -> &[Vec3] {
        &self.velocities
    }

    /// The same, to be changed: forces of your own, between `Emit` and `Integrate`.
    pub fn velocities_mut(&mut self) -> &mut [Vec3] {
        &mut self.velocities
    }

    /// How long each has left.
    pub fn lifespans(&self) -> &[Lifespan] {
        &self.lifespans
    }

    /// What each carries, nanolitres.
    pub fn volumes_nl(&self) -> &[u32] {
        &self.volumes_nl
    }

    /// The number of each.
    pub fn sequences(&self) -> &[Sequence] {
        &self.sequences
    }

    /// Size class of the drops of each.
    pub fn classes(&self) -> &[u8] {
        &self.classes
    }

    /// What each is.
    pub fn effects(&self) -> &[EffectIndex] {
        &self.effects
    }

    /// All of one. `None` if there are not so many.
    pub fn get(&self, index: usize) -> Option<Particle> {
        (index < self.len()).then(|| self.row(index))
    }

    fn row(&self, index: usize) -> Particle {
        Particle {
            position: self.positions[index],
            velocity: self.velocities[index],
            lifespan: self.lifespans[index],
            volume_nl: self.volumes_nl[index],
            sequence: self.sequences[index],
            effect: self.effects[index],
            class: self.classes[index],
        }
    }

    /// All of each.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Particle> + '_ {
        (0..self.len()).map(|index| self.row(index))
    }

    /// Those born in this tick, from `Emit` until the dead are retired.
    pub fn newborn(&self) -> impl ExactSizeIterator<Item = Particle> + '_ {
        (self.newborn..self.len()).map(|index| self.row(index))
    }

    /// The index of the first that was born in this tick.
    pub(crate) fn newborn_from(&self) -> usize {
        self.newborn
    }

    /// Adds what is born in this tick. Those that are pushed into [`NewParticles`](crate::emitter::NewParticles) instead get numbers
    /// that nobody else has. [`ParticleCounts`](super::ParticleCounts) follow when the dead are retired;
    /// [`WaterCounts`](super::WaterCounts) know nothing of it.
    pub fn spawn(&mut self, born: impl ExactSizeIterator<Item = Particle>) {
        let count = born.len();
        self.positions.reserve(count);
        self.velocities.reserve(count);
        self.lifespans.reserve(count);
        self.volumes_nl.reserve(count);
        self.sequences.reserve(count);
        self.effects.reserve(count);
        self.classes.reserve(count);
        for particle in born {
            self.positions.push(particle.position);
            self.velocities.push(particle.velocity);
            self.lifespans.push(particle.lifespan);
            self.volumes_nl.push(particle.volume_nl);
            self.sequences.push(particle.sequence);
            self.effects.push(particle.effect);
            self.classes.push(particle.class);
        }
    }

    /// Takes out those whose life is over, telling of each before it goes; the first tick of the newborn ends.
    pub(crate) fn retire(&mut self, mut tell: impl FnMut(Particle)) {
        self.lifespans[self.newborn..].iter_mut().for_each(|lifespan| lifespan.born_at = 0);
        // From the end, so that what takes a place is alive.
        let mut end = self.len();
        while end > 0 {
            let begin = (end - 1) / FEW * FEW;
            // In most there is none that is dead; seen without a branch for each.
            if self.lifespans[begin..end].iter().fold(false, |any, lifespan| any | lifespan.is_over()) {
                for index in (begin..end).rev() {
                    if self.lifespans[index].is_over() {
                        let dead = self.take_out(index);
                        tell(dead);
                    }
                }
            }
            end = begin;
        }
        self.newborn = self.len();
    }

    fn take_out(&mut self, index: usize) -> Particle {
        Particle {
            position: self.positions.swap_remove(index),
            velocity: self.velocities.swap_remove(index),
            lifespan: self.lifespans.swap_remove(index),
            volume_nl: self.volumes_nl.swap_remove(index),
            sequence: self.sequences.swap_remove(index),
            effect: self.effects.swap_remove(index),
            class: self.classes.swap_remove(index),
        }
    }

    /// Takes out all. They count as expired in [`ParticleCounts`](super::ParticleCounts) as soon as the dead of a tick are retired;
    /// [`WaterCounts`](super::WaterCounts) know nothing of it.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}

/// A particle in a file. Floats as their bits, so that nothing depends on how they are written.
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SavedParticle {
    position: [u32; 3],
    velocity: [u32; 3],
    ticks_left: u16,
    born_at: u16,
    volume_nl: u32,
    pub(crate) sequence: u32,
    pub(crate) effect: u16,
    class: u8,
}

impl From<Particle> for SavedParticle {
    fn from(particle: Particle) -> Self {
        let bits = |vector: Vec3| vector.to_array().map(f32::to_bits);
        Self {
            position: bits(particle.position),
            velocity: bits(particle.velocity),
            ticks_left: particle.lifespan.ticks_left,
            born_at: particle.lifespan.born_at,
            volume_nl: particle.volume_nl,
            sequence: particle.sequence.0,
            effect: particle.effect.0,
            class: particle.class,
        }
    }
}

impl SavedParticle {
    /// Whether it is somewhere, and its drops of a size that there is.
    pub(crate) fn is_sound(&self) -> bool {
        let finite = |bits: [u32; 3]| bits.into_iter().all(|bits| f32::from_bits(bits).is_finite());
        finite(self.position) && finite(self.velocity) && usize::from(self.class) < SIZE_CLASSES
    }
}

impl From<SavedParticle> for Particle {
    fn from(saved: SavedParticle) -> Self {
        let vector = |bits: [u32; 3]| Vec3::from_array(bits.map(f32::from_bits));
        Self {
            position: vector(saved.position),
            velocity: vector(saved.velocity),
            lifespan: Lifespan { ticks_left: saved.ticks_left, born_at: saved.born_at },
            volume_nl: saved.volume_nl,
            sequence: Sequence(saved.sequence),
            effect: EffectIndex(saved.effect),
            class: saved.class,
        }
    }
}

/// How many particles a thread takes at a time: all of them, if there are fewer than `min`, and else so many that
/// threads which are done early find more to do.
pub(crate) fn chunk_len(particles: usize, min: usize) -> usize {
    if particles <= min {
        return particles.max(1);
    }
    let threads = ComputeTaskPool::get().thread_num();
    particles.div_ceil(4 * threads).max(min)
}

/// Does `work` on every chunk, with the chunk's number; a single one on this thread.
pub(crate) fn for_each_chunk<C: Send>(
    chunks: impl ExactSizeIterator<Item = C>,
    work: impl Fn(C) + Send + Sync + Copy,
) {
    if chunks.len() < 2 {
        chunks.for_each(work);
        return;
    }
    ComputeTaskPool::get().scope(|scope| {
        chunks.for_each(|chunk| scope.spawn(async move { work(chunk) }));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn particle(number: u32, ticks_left: u16) -> Particle {
        Particle {
            position: Vec3::splat(number as f32),
            velocity: Vec3::X * number as f32,
            lifespan: Lifespan { ticks_left, born_at: 77 },
            volume_nl: 10 * number,
            sequence: Sequence(number),
            effect: EffectIndex(number as u16 % 3),
            class: number as u8 % 16,
        }
    }

    #[test]
    fn columns_stay_together_whoever_goes() {
        let mut particles = Particles::default();
        let mut next = 0;
        let mut alive: Vec<u32> = Vec::new();
        for round in 0..50u32 {
            let born = (round * 7) % 13;
            let lives = |number: u32| !(number.wrapping_mul(2_654_435_761) >> 28).is_multiple_of(3);
            let new: Vec<Particle> =
                (next..next + born).map(|n| particle(n, if lives(n) { 9 } else { 0 })).collect();
            particles.spawn(new.into_iter());
            alive.extend((next..next + born).filter(|&n| lives(n)));
            next += born;
            // Some that were alive hit something.
            for lifespan in particles.lifespans.iter_mut().step_by(5) {
                lifespan.mark_hit();
            }
            let hit: Vec<u32> = particles.sequences.iter().step_by(5).map(|number| number.0).collect();
            alive.retain(|number| !hit.contains(number));
            particles.retire(|dead| assert_eq!(dead.volume_nl, 10 * dead.sequence.0));
            let mut left: Vec<u32> = particles.sequences().iter().map(|number| number.0).collect();
            left.sort_unstable();
            assert_eq!(left, alive);
            for found in particles.iter() {
                let expected = particle(found.sequence.0, 9);
                assert_eq!(found, Particle { lifespan: Lifespan { ticks_left: 9, born_at: 0 }, ..expected });
            }
        }
    }

    #[test]
    fn chunks_are_neither_too_small_nor_too_few() {
        ComputeTaskPool::get_or_init(default);
        assert_eq!(chunk_len(0, 100), 1);
        assert_eq!(chunk_len(99, 100), 99);
        let threads = ComputeTaskPool::get().thread_num();
        assert!(chunk_len(1_000_000, 100) * threads * 4 >= 1_000_000);
        assert!(chunk_len(101, 100) >= 100);
    }

    #[test]
    fn a_particle_in_a_file_is_the_same_to_the_bit() {
        let odd = Particle { position: Vec3::new(f32::MIN_POSITIVE / 2.0, -0.0, 1.0e30), ..particle(5, 4) };
        let back = Particle::from(SavedParticle::from(odd));
        assert_eq!(back.position.to_array().map(f32::to_bits), odd.position.to_array().map(f32::to_bits));
        assert_eq!((back.sequence, back.effect, back.lifespan), (odd.sequence, odd.effect, odd.lifespan));
        let sound = |particle: Particle| SavedParticle::from(particle).is_sound();
        assert!(sound(odd));
        assert!(!sound(Particle { class: 16, ..odd }) && !sound(Particle { velocity: Vec3::NAN, ..odd }));
        assert!(!sound(Particle { position: Vec3::INFINITY, ..odd }));
    }
}
