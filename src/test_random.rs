//! Random numbers for unit tests, the same on every machine.

use bevy::math::Vec3;

/// The generator of Knuth's MMIX, its upper bits.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// 24 bits: no more than single precision holds.
    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as u32
    }

    /// A whole number below `end`, which is far below 2^24.
    pub(crate) fn below(&mut self, end: u32) -> u32 {
        self.bits() % end
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f32 {
        self.bits() as f32 / (1_u32 << 24) as f32
    }

    /// In [-1, 1).
    pub(crate) fn signed(&mut self) -> f32 {
        self.bits() as f32 / (1_u32 << 23) as f32 - 1.0
    }

    /// In a cube of twice this size around the origin.
    pub(crate) fn in_cube(&mut self, half_size: f32) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed()) * half_size
    }
}
