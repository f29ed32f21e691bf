//! One stamp, ready to paint.

use bevy::prelude::*;
use bytemuck::{Pod, Zeroable};

use super::Wrap;
use super::kernel::{Axis, SUBTEXELS};

/// A stamp on the maps of one surface. The GPU reads it as seven texels of four words: `splat_at` in `shaders/splat.wgsl` takes
/// them apart in the same order.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct Splat {
    /// Middle of the stamp, in 1/256 texel of the map.
    pub center: [i32; 2],
    /// Half its width and height, in 1/256 texel.
    pub radius: [i32; 2],
    /// Colour (red in the lowest byte) and in the highest byte the opacity.
    pub diffuse: u32,
    /// Reflectance, smoothness, unused, opacity; lowest byte first.
    pub specular: u32,
    /// Slope of the dome at its rim, -127..=127.
    pub bump: i32,
    /// Opacity of the bump, 0..=255.
    pub bump_opacity: u32,
    /// Its shape: 0 is a round dome, others are stamps of the atlas, from 1.
    pub stamp: u32,
    /// 0: it lies on the map, by `center` and `radius`. 1: in the space of the mesh, by what follows; then it crosses from one
    /// island of the map to another.
    pub in_space: u32,
    /// Water it leaves; nanolitres.
    pub water_nl: u32,
    /// Tick of the impact, 1 or more.
    pub tick: u32,
    /// From the way from its middle to the first axis of the stamp. On the map two numbers, 1/1024, from an offset in radii; in
    /// space three, see [`framed`](super::kernel::framed).
    pub row_s: [i32; 3],
    /// In space: twice its radius, in steps.
    pub reach: i32,
    /// To the second axis.
    pub row_t: [i32; 3],
    /// In space: the axes, three signed bytes each, 127 for 1.
    pub axis_s: u32,
    /// In space: to the axis out of the surface.
    pub row_n: [i32; 3],
    /// The second.
    pub axis_t: u32,
    /// In space: its middle, in steps of the [`SurfaceFrames`](super::SurfaceFrames).
    pub origin: [i32; 3],
    /// The third, out of the front of the surface.
    pub axis_n: u32,
}

impl Splat {
    /// Half a texel, the smallest radius: below it a stamp could fall between texels' middles and leave no colour.
    pub const MIN_RADIUS: i32 = SUBTEXELS / 2;

    /// Middle of a stamp in 1/256 texel, from a uv: brought into the map by the edge behaviour of the axis.
    pub fn center_from_uv(uv: Vec2, size: u32, wrap: [Wrap; 2]) -> [i32; 2] {
        let axis = |coordinate: f32, wrap| {
            let inside = match wrap {
                // `rem_euclid` may round up to 1.
                Wrap::Repeat => coordinate.rem_euclid(1.0),
                Wrap::Clamp => coordinate,
            };
            let end = size as i32 * SUBTEXELS;
            ((inside * end as f32).floor() as i32).clamp(0, end - 1)
        };
        [axis(uv.x, wrap[0]), axis(uv.y, wrap[1])]
    }

    /// Whether it leaves colour, gloss or relief. What does not is a drop whose place is remembered for the ring around it.
    pub fn paints(&self) -> bool {
        self.diffuse >> 24 > 0 || self.specular >> 24 > 0 || self.bump_opacity > 0
    }

    /// Itself on a map of another size, where it is as large and at the same place. `from`, `to`: texels along each side.
    pub(crate) fn resized(self, from: u32, to: u32) -> Self {
        let (center, radius) = resized_stamp(self.center, self.radius, from, to);
        Self { center, radius, ..self }
    }

    /// A radius in 1/256 texel, from one in uv; kept so small that a stamp never overlaps itself.
    pub fn radius_from_uv(uv: Vec2, size: u32) -> [i32; 2] {
        let largest = (size as i32 - 1) * SUBTEXELS / 2;
        let axis = |radius: f32| {
            ((radius * size as f32 * SUBTEXELS as f32).round() as i32).clamp(Self::MIN_RADIUS, largest)
        };
        [axis(uv.x), axis(uv.y)]
    }

    /// The stamp along u (0) or v (1) on a map of this size.
    pub fn axis(&self, index: usize, size: u32, wrap: [Wrap; 2]) -> Axis {
        Axis {
            center: self.center[index],
            radius: self.radius[index],
            size: size as i32,
            clamped: wrap[index] == Wrap::Clamp,
        }
    }

    /// The texels the stamp touches along an axis, each once, brought into the map.
    pub fn texels(&self, index: usize, size: u32, wrap: [Wrap; 2]) -> impl Iterator<Item = u32> + use<> {
        let (first, last) = self.span(index);
        wrap[index].cells(first, last, size)
    }

    /// First and last texel the stamp touches along an axis, before wrapping or clamping.
    pub fn span(&self, index: usize) -> (i32, i32) {
        let (center, radius) = (self.center[index], self.radius[index]);
        ((center - radius) >> 8, (center + radius - 1) >> 8)
    }
}

/// Four values of 0..=1 as bytes, the first in the lowest.
pub(crate) fn pack_unorm(values: [f32; 4]) -> u32 {
    u32::from_le_bytes(values.map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8))
}

impl Wrap {
    /// The columns or rows of a map with so many along that axis, texels or tiles, from `first` to `last`; those beyond an edge
    /// are brought into the map. None comes twice: what goes all the way round ends before where it began.
    pub(crate) fn cells(self, first: i32, last: i32, count: u32) -> impl Iterator<Item = u32> + Clone {
        let count = count as i32;
        let (first, last) = match self {
            Self::Repeat => (first, last.min(first.saturating_add(count - 1))),
            Self::Clamp => (first.clamp(0, count - 1), last.clamp(0, count - 1)),
        };
        (first..=last).map(move |cell| cell.rem_euclid(count) as u32)
    }
}

/// Middle and radius of a stamp, 1/256 texel, on a map of another size. `from`, `to`: texels along each side.
pub(crate) fn resized_stamp(center: [i32; 2], radius: [i32; 2], from: u32, to: u32) -> ([i32; 2], [i32; 2]) {
    let end = to as i32 * SUBTEXELS;
    let largest = (to as i32 - 1) * SUBTEXELS / 2;
    (
        center.map(|along| resized_length(along, from, to).clamp(0, end - 1)),
        radius.map(|along| resized_length(along, from, to).clamp(Splat::MIN_RADIUS, largest)),
    )
}

/// A length in texels, or parts of one, on a map of another size.
pub(crate) fn resized_length(length: i32, from: u32, to: u32) -> i32 {
    let length = i64::from(length) * i64::from(to) / i64::from(from.max(1));
    length.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_keeps_its_place_and_size_on_another_map_and_its_least_radius() {
        let (center, radius) = resized_stamp([300, 64 * 256 - 1], [512, 200], 64, 32);
        assert_eq!((center, radius), ([150, 32 * 256 - 1], [256, Splat::MIN_RADIUS]));
        assert_eq!(resized_stamp(center, radius, 32, 64), ([300, 64 * 256 - 2], [512, 256]));
        // No stamp overlaps itself.
        assert_eq!(resized_stamp([0; 2], [63 * 128; 2], 64, 32).1, [31 * 128; 2]);
    }

    #[test]
    fn every_texel_holds_what_the_shader_reads_from_it() {
        use std::mem::offset_of;
        let texels = [
            offset_of!(Splat, center),
            offset_of!(Splat, diffuse),
            offset_of!(Splat, stamp),
            offset_of!(Splat, row_s),
            offset_of!(Splat, row_t),
            offset_of!(Splat, row_n),
            offset_of!(Splat, origin),
        ];
        assert_eq!(texels, [0, 1, 2, 3, 4, 5, 6].map(|texel| texel * 16));
        assert_eq!(size_of::<Splat>(), 7 * 16);
    }

    #[test]
    fn uvs_in_any_tile_are_brought_into_the_map() {
        let repeat = [Wrap::Repeat; 2];
        let clamp = [Wrap::Clamp; 2];
        let center = |u, wrap| Splat::center_from_uv(Vec2::new(u, 0.5), 64, wrap)[0];
        assert_eq!(center(0.25, repeat), 16 * 256);
        assert_eq!(center(3.25, repeat), 16 * 256);
        assert_eq!(center(-0.75, repeat), 16 * 256);
        assert_eq!(center(-1.0e-9, repeat), 64 * 256 - 1);
        assert_eq!(center(1.5, clamp), 64 * 256 - 1);
        assert_eq!(center(-7.0, clamp), 0);
        assert_eq!(center(1.0e30, clamp), 64 * 256 - 1);
    }

    #[test]
    fn radii_stay_between_half_a_texel_and_half_the_map() {
        assert_eq!(Splat::radius_from_uv(Vec2::new(0.0, 100.0), 64), [128, 63 * 128]);
        assert_eq!(Splat::radius_from_uv(Vec2::splat(0.125), 64), [8 * 256; 2]);
    }
}
