//! How much is painted in a frame.

use bevy::prelude::*;

use super::Splat;

/// What a frame may paint on the GPU, all surfaces together. What is more waits, in order, for the next frames: nothing is
/// dropped, and maps end up the same to the bit. Where too much waits, ticks are held
/// ([`TickHold`](crate::schedule::TickHold)) until there is room.
///
/// [`CpuOverlayPlugin`](super::CpuOverlayPlugin) paints in the tick and has no use for it.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct SplatBudget {
    /// Splats; 1 or more, and at most that of [`Self::LARGEST`].
    pub per_frame: u32,
    /// Bytes that are uploaded: splats, tiles, and which splats lie in which tiles. So it also limits how many texels the pass
    /// visits. The last splat may go beyond it; at most that of [`Self::LARGEST`].
    pub upload_bytes: u32,
    /// Splats that may wait, 1 or more, before ticks are held. Each takes 112 bytes. What the tick adds that reaches it may go
    /// beyond it.
    pub most_waiting: u32,
}

impl Default for SplatBudget {
    fn default() -> Self {
        Self { per_frame: 100_000, upload_bytes: 24 << 20, most_waiting: 2_000_000 }
    }
}

impl SplatBudget {
    /// As much as a storage buffer holds on every machine: 128 MiB is WebGPU's least limit.
    pub const LARGEST: Self = Self {
        per_frame: (96 << 20) / size_of::<Splat>() as u32,
        upload_bytes: 96 << 20,
        most_waiting: 2_000_000,
    };

    /// Splats and bytes of a frame, within their ranges.
    pub(super) fn of_a_frame(&self) -> (usize, usize) {
        let splats = self.per_frame.clamp(1, Self::LARGEST.per_frame);
        let bytes = self.upload_bytes.clamp(1, Self::LARGEST.upload_bytes);
        (splats as usize, bytes as usize)
    }

    /// Whether so many waiting splats are too many.
    pub(super) fn is_exceeded_by(&self, waiting: u64) -> bool {
        waiting >= u64::from(self.most_waiting.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_budget_paints_something_and_fits_a_buffer() {
        let none = SplatBudget { per_frame: 0, upload_bytes: 0, most_waiting: 0 };
        let all = SplatBudget { per_frame: u32::MAX, upload_bytes: u32::MAX, most_waiting: u32::MAX };
        assert_eq!(none.of_a_frame(), (1, 1));
        assert!(!none.is_exceeded_by(0) && none.is_exceeded_by(1));
        let (splats, bytes) = all.of_a_frame();
        assert!(splats * size_of::<Splat>() <= 128 << 20 && bytes < 128 << 20);
        assert_eq!(size_of::<Splat>(), 112, "as the docs say");
    }
}
