//! Four vectors as they lie in memory: three registers of four numbers, so that one instruction works on several particles.
//!
//! Each number goes through the same operations in the same order as it would alone, so results are the same to the bit.

use bevy::math::{Vec3, Vec4};

/// So many particles are worked on together.
pub(crate) const ROW: usize = 4;

/// Four vectors: `x0 y0 z0 x1`, `y1 z1 x2 y2`, `z2 x3 y3 z3`.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Rows([Vec4; 3]);

impl Rows {
    /// Four of them.
    #[inline]
    pub(crate) fn of([a, b, c, d]: &[Vec3; ROW]) -> Self {
        Self([Vec4::new(a.x, a.y, a.z, b.x), Vec4::new(b.y, b.z, c.x, c.y), Vec4::new(c.z, d.x, d.y, d.z)])
    }

    /// The same one four times.
    pub(crate) fn splat(vector: Vec3) -> Self {
        Self::of(&[vector; ROW])
    }

    /// A number of each vector, for all of its coordinates.
    #[inline]
    fn spread(n: Vec4) -> Self {
        Self([Vec4::new(n.x, n.x, n.x, n.y), Vec4::new(n.y, n.y, n.z, n.z), Vec4::new(n.z, n.w, n.w, n.w)])
    }

    /// Takes them apart again.
    #[inline]
    pub(crate) fn store(self, into: &mut [Vec3; ROW]) {
        let Self([a, b, c]) = self;
        *into = [
            Vec3::new(a.x, a.y, a.z),
            Vec3::new(a.w, b.x, b.y),
            Vec3::new(b.z, b.w, c.x),
            Vec3::new(c.y, c.z, c.w),
        ];
    }

    #[inline]
    fn zip(self, other: Self, with: impl Fn(Vec4, Vec4) -> Vec4) -> Self {
        Self([with(self.0[0], other.0[0]), with(self.0[1], other.0[1]), with(self.0[2], other.0[2])])
    }

    #[inline]
    fn lengths(self) -> Vec4 {
        let Self([a, b, c]) = self.zip(self, |a, b| a * b);
        let squared =
            Vec4::new(a.x, a.w, b.z, c.y) + Vec4::new(a.y, b.x, b.w, c.z) + Vec4::new(a.z, b.y, c.x, c.w);
        Vec4::from_array(squared.to_array().map(f32::sqrt))
    }
}

/// What accelerates four particles; see `Motion` for one.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MotionRows {
    /// Acceleration, m/s².
    pub(super) gravity: Rows,
    /// Velocity of the air around each, m/s.
    pub(super) air: Rows,
    /// Quadratic drag over mass, 1/m.
    pub(super) drag: Vec4,
}

impl MotionRows {
    /// Accelerates four particles for `dt` seconds and moves them by it.
    #[inline]
    pub(super) fn advance(&self, positions: &mut [Vec3; ROW], velocities: &mut [Vec3; ROW], dt: f32) {
        let before = Rows::of(velocities);
        let braking = self.drag * before.zip(self.air, |velocity, air| velocity - air).lengths() * dt;
        let braking = Rows::spread(braking);
        let carried = self.air.zip(braking, |air, braking| air * braking);
        let velocity = before
            .zip(self.gravity, |velocity, gravity| velocity + gravity * dt)
            .zip(carried, |velocity, carried| velocity + carried)
            .zip(braking, |velocity, braking| velocity / (Vec4::ONE + braking));
        velocity.store(velocities);
        Rows::of(positions).zip(velocity, |position, velocity| position + velocity * dt).store(positions);
    }
}

/// The boxes around the ways of four particles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WayRows {
    low: Rows,
    high: Rows,
}

impl WayRows {
    /// From where they are and how they have come there for so many seconds.
    #[inline]
    pub(crate) fn new(ends: &[Vec3; ROW], velocities: &[Vec3; ROW], seconds: f32) -> Self {
        let ends = Rows::of(ends);
        let starts = ends.zip(Rows::of(velocities), |end, velocity| end - velocity * seconds);
        Self { low: starts.zip(ends, Vec4::min), high: starts.zip(ends, Vec4::max) }
    }
}

/// A box that many ways are held against.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BoxRows {
    low: Rows,
    high: Rows,
}

impl BoxRows {
    /// From its smallest and largest corner.
    pub(crate) fn new((low, high): (Vec3, Vec3)) -> Self {
        Self { low: Rows::splat(low), high: Rows::splat(high) }
    }

    /// Those of the four whose way may touch the box: bits 0, 3, 6 and 9. It never leaves one out whose way does.
    #[inline]
    pub(crate) fn touched(&self, ways: &WayRows) -> u32 {
        let mut inside = 0;
        for row in 0..3 {
            let touches = ways.low.0[row].cmple(self.high.0[row]) & ways.high.0[row].cmpge(self.low.0[row]);
            inside |= touches.bitmask() << (4 * row);
        }
        inside & inside >> 1 & inside >> 2 & 0b001_001_001_001
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_come_out_as_they_went_in() {
        let vectors = [1.0, 4.0, 7.0, 10.0].map(|x| Vec3::new(x, x + 1.0, x + 2.0));
        let mut out = [Vec3::ZERO; ROW];
        Rows::of(&vectors).store(&mut out);
        assert_eq!(out, vectors);
        assert_eq!(Rows::of(&vectors).lengths().to_array(), vectors.map(Vec3::length));
    }

    #[test]
    fn those_are_found_whose_way_touches_the_box() {
        let room = BoxRows::new((Vec3::ZERO, Vec3::ONE));
        // From above into it; past it at the side; through all of it; still outside.
        let ends = [Vec3::splat(0.5), Vec3::new(1.2, 0.5, 0.5), Vec3::new(0.5, -1.0, 0.5), Vec3::splat(3.0)];
        let velocities = [Vec3::NEG_Y, Vec3::NEG_Y, Vec3::NEG_Y * 3.0, Vec3::ZERO];
        let ways = WayRows::new(&ends, &velocities, 1.0);
        assert_eq!(room.touched(&ways), 0b000_001_000_001);
        let nowhere = BoxRows::new((Vec3::INFINITY, Vec3::NEG_INFINITY));
        assert_eq!(nowhere.touched(&ways), 0);
    }
}
