//! Sending fewer particles than are asked for.
//!
//! Where a [cap](crate::particle::ParticleConfig) or a [level of detail](EmissionDetail) leaves less room than emitters want,
//! each is cut by the same part. Emitters with a [`Flow`](super::Flow) still send all their water: each of their particles then
//! stands for more of it. What others are cut by is missing, and counted.

use bevy::prelude::*;

/// Level of detail of emission: how many of the particles that emitters ask for are sent. 1 unless something steers it, as
/// [`LiveBudgetPlugin`](crate::overload::LiveBudgetPlugin) does; then nothing is changed in what is emitted.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource, Default)]
pub struct EmissionDetail {
    factor: f32,
    /// Part of a particle that may be sent on top, 0..1.
    credit: f64,
    /// The factor stays 1, whoever steers it.
    is_fixed: bool,
}

impl Default for EmissionDetail {
    fn default() -> Self {
        Self { factor: 1.0, credit: 0.0, is_fixed: false }
    }
}

impl EmissionDetail {
    /// The lowest factor.
    pub const LEAST: f32 = 1.0 / 4096.0;

    /// The part of particles that is sent, [`Self::LEAST`]..=1.
    pub fn factor(&self) -> f32 {
        self.factor
    }

    /// Sets the part; clamped to [`Self::LEAST`]..=1, and 1 if it is no number. While the detail is [fixed](Self::fix), nothing
    /// happens.
    pub fn set_factor(&mut self, factor: f32) {
        let factor = if factor.is_nan() { 1.0 } else { factor.clamp(Self::LEAST, 1.0) };
        self.factor = if self.is_fixed { 1.0 } else { factor };
    }

    /// Full detail from now on, whoever steers it, or free again: what must come out the same elsewhere cannot depend on how
    /// fast a machine is.
    pub fn fix(&mut self, is_fixed: bool) {
        *self = Self { is_fixed, ..Self::default() };
    }

    /// Of so many particles, how many may be sent in this tick; what is below a whole one goes to the next tick.
    pub(super) fn allow(&mut self, asked: u64) -> u64 {
        if self.factor >= 1.0 {
            self.credit = 0.0;
            return asked;
        }
        self.credit += asked as f64 * f64::from(self.factor);
        let whole = self.credit.floor();
        self.credit -= whole;
        (whole as u64).min(asked)
    }
}

/// Deals out the particles that may be sent in a tick among emitters, in proportion to what each asks for.
pub(super) struct Deal {
    asked: u64,
    allowed: u64,
    /// Where rounding begins; elsewhere in each tick, so that nobody is always left out.
    phase: u64,
    /// What those have asked for who had their turn.
    so_far: u64,
}

impl Deal {
    pub(super) fn new(asked: u64, allowed: u64, tick: u32) -> Self {
        let phase = u64::from(tick).wrapping_mul(0x9e37_79b9_7f4a_7c15) % asked.max(1);
        Self { asked, allowed, phase, so_far: 0 }
    }

    /// What the next one may send of `due`, which is its part of what was asked for.
    pub(super) fn take(&mut self, due: u32) -> u32 {
        if self.allowed >= self.asked {
            return due;
        }
        let before = self.dealt();
        self.so_far += u64::from(due);
        (self.dealt() - before).min(u64::from(due)) as u32
    }

    fn dealt(&self) -> u64 {
        let exact = u128::from(self.so_far) * u128::from(self.allowed) + u128::from(self.phase);
        (exact / u128::from(self.asked.max(1))) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_that_is_allowed_is_dealt_out_and_nobody_gets_more_than_is_due() {
        for (dues, allowed) in [
            (vec![100, 100], 7),
            (vec![1, 1, 1, 1], 1),
            (vec![0, 5, 0, 999_999], 1000),
            (vec![3, 3], 0),
            (vec![3, 3], 6),
            (vec![4_000_000_000, 4_000_000_000, 17], 10_000_000),
        ] {
            for tick in 0..50 {
                let mut deal = Deal::new(dues.iter().map(|&due| u64::from(due)).sum(), allowed, tick);
                let got: Vec<u32> = dues.iter().map(|&due| deal.take(due)).collect();
                assert_eq!(got.iter().map(|&got| u64::from(got)).sum::<u64>(), allowed, "{dues:?} {got:?}");
                assert!(got.iter().zip(&dues).all(|(got, due)| got <= due), "{dues:?} {got:?}");
            }
        }
    }

    #[test]
    fn where_there_is_room_for_one_all_get_it_in_turn() {
        let mut got = [0; 5];
        for tick in 0..1000 {
            let mut deal = Deal::new(5, 1, tick);
            got.iter_mut().for_each(|got| *got += deal.take(1));
        }
        assert!(got.iter().all(|got| (150..250).contains(got)), "{got:?}");
    }

    #[test]
    fn a_part_of_a_particle_is_not_forgotten() {
        let mut detail = EmissionDetail::default();
        assert_eq!(detail.allow(12_345), 12_345);
        detail.set_factor(0.01);
        let sent: u64 = (0..1000).map(|_| detail.allow(3)).sum();
        assert!((29..=30).contains(&sent), "{sent}");
        detail.set_factor(-1.0);
        assert_eq!(detail.factor(), EmissionDetail::LEAST);
        detail.set_factor(f32::NAN);
        assert_eq!(detail.factor(), 1.0);
    }

    #[test]
    fn fixed_detail_is_full_until_it_is_free() {
        let mut detail = EmissionDetail::default();
        detail.set_factor(0.1);
        detail.allow(3);
        detail.fix(true);
        detail.set_factor(0.1);
        assert_eq!((detail.factor(), detail.allow(3)), (1.0, 3));
        detail.fix(false);
        detail.set_factor(0.5);
        assert_eq!(detail.factor(), 0.5);
    }
}
