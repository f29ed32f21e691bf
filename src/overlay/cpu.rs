//! Painting splats on the CPU: the reference, and the painter of runs without a renderer.

use bevy::prelude::*;

use super::kernel::{axis_offset, blend_over, falloff, slope_color, stamp_alpha};
use super::{Splat, SplatQueue, Weatherable, Wrap};
use crate::schedule::{WeatheringSystems, WeatheringTick};

/// The maps of a surface in main memory. Rows from v = 0 on, `size` texels each.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct CpuMaps {
    /// Texels along each side.
    pub size: u32,
    /// Edge behaviour along u and v.
    pub wrap: [Wrap; 2],
    /// Colour over the surface's; premultiplied RGBA.
    pub diffuse: Vec<[u8; 4]>,
    /// Reflectance, smoothness, unused, coverage; premultiplied.
    pub specular: Vec<[u8; 4]>,
    /// Slope along u and v (128 is flat), unused, coverage; premultiplied.
    pub normal: Vec<[u8; 4]>,
}

impl CpuMaps {
    /// Empty maps for a surface.
    pub fn new(surface: &Weatherable) -> Self {
        let size = surface.texels();
        let texels = (size * size) as usize;
        Self {
            size,
            wrap: surface.wrap(),
            diffuse: vec![[0; 4]; texels],
            specular: vec![[0; 4]; texels],
            normal: vec![[0; 4]; texels],
        }
    }

    /// Paints splats, one after the other.
    pub fn paint(&mut self, splats: &[Splat]) {
        for splat in splats {
            self.paint_one(splat);
        }
    }

    fn paint_one(&mut self, splat: &Splat) {
        let axes = [splat.axis(0, self.size, self.wrap), splat.axis(1, self.size, self.wrap)];
        for y in splat.texels(1, self.size, self.wrap) {
            let row_offset = axis_offset(axes[1], y as i32);
            for x in splat.texels(0, self.size, self.wrap) {
                let offset = [axis_offset(axes[0], x as i32), row_offset];
                self.color_texel((y * self.size + x) as usize, splat, offset);
            }
        }
    }

    fn color_texel(&mut self, texel: usize, splat: &Splat, offset: [i32; 2]) {
        let dome = falloff(offset);
        let over = |under: &mut [u8; 4], color: [u32; 3], opacity: u32| {
            let alpha = stamp_alpha(opacity, dome);
            for (channel, source) in under.iter_mut().zip([color[0], color[1], color[2], 255]) {
                *channel = blend_over(source, alpha, u32::from(*channel)) as u8;
            }
        };
        let unpack = |paint: u32| {
            let [r, g, b, opacity] = paint.to_le_bytes().map(u32::from);
            ([r, g, b], opacity)
        };
        let (color, opacity) = unpack(splat.diffuse);
        over(&mut self.diffuse[texel], color, opacity);
        let (color, opacity) = unpack(splat.specular);
        over(&mut self.specular[texel], color, opacity);
        let slopes = [slope_color(splat.bump, offset[0]), slope_color(splat.bump, offset[1]), 255];
        over(&mut self.normal[texel], slopes, splat.bump_opacity);
    }
}

/// Paints splats on the CPU, in the tick of their impact. Use it in place of
/// [`GpuOverlayPlugin`](super::GpuOverlayPlugin), not beside it: whoever paints empties the queue.
pub struct CpuOverlayPlugin;

impl Plugin for CpuOverlayPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(
            WeatheringTick,
            (
                add_cpu_maps.before(super::deposit_splats),
                paint_on_cpu.after(super::deposit_splats).after(add_cpu_maps),
            )
                .in_set(WeatheringSystems::Deposit),
        );
    }
}

/// Gives new surfaces their maps, and new ones when their size or edges change.
fn add_cpu_maps(
    mut commands: Commands,
    mut changed: Query<(Entity, &Weatherable, Option<&CpuMaps>, &mut SplatQueue), Changed<Weatherable>>,
) {
    for (entity, surface, maps, mut queue) in &mut changed {
        if maps.is_none_or(|maps| (maps.size, maps.wrap) != (surface.texels(), surface.wrap())) {
            if maps.is_some() {
                queue.clear();
            }
            commands.entity(entity).insert(CpuMaps::new(surface));
        }
    }
}

/// Empties every queue into its surface's maps. Surfaces do not share texels, so they are painted in parallel.
pub fn paint_on_cpu(mut surfaces: Query<(&mut CpuMaps, &mut SplatQueue)>) {
    surfaces.par_iter_mut().for_each(|(mut maps, mut queue)| {
        if !queue.is_empty() {
            maps.paint(queue.splats());
            queue.clear();
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::overlay::splat::pack_unorm;

    fn maps(wrap: Wrap) -> CpuMaps {
        CpuMaps::new(&Weatherable { map_size: 64, wrap_u: wrap, wrap_v: wrap })
    }

    fn splat(center: [i32; 2]) -> Splat {
        Splat {
            center,
            radius: [5 * 256, 3 * 256],
            water_nl: 41_887,
            tick: 7,
            diffuse: pack_unorm([0.4, 0.3, 0.2, 0.8]),
            specular: pack_unorm([0.5, 0.9, 0.0, 1.0]),
            bump: 60,
            bump_opacity: 255,
            pad: [0; 2],
        }
    }

    #[test]
    fn a_stamp_in_the_corner_is_the_stamp_in_the_middle() {
        let (mut corner, mut middle) = (maps(Wrap::Repeat), maps(Wrap::Repeat));
        corner.paint(&[splat([100, 30])]);
        middle.paint(&[splat([32 * 256 + 100, 32 * 256 + 30])]);
        for y in 0..64 {
            for x in 0..64 {
                let here = y * 64 + x;
                let there = (y + 32) % 64 * 64 + (x + 32) % 64;
                assert_eq!(corner.diffuse[here], middle.diffuse[there]);
                assert_eq!(corner.specular[here], middle.specular[there]);
                assert_eq!(corner.normal[here], middle.normal[there]);
            }
        }
    }

    #[test]
    fn texels_out_of_reach_stay_zero() {
        for (wrap, center) in [(Wrap::Clamp, [0, 64 * 256 - 1]), (Wrap::Repeat, [4000, 9000])] {
            let mut maps = maps(wrap);
            maps.paint(&[splat(center)]);
            for texel in 0..64 * 64 {
                let (x, y) = (texel % 64, texel / 64);
                let reach =
                    |at: i32, center: i32, radius: i32| (at * 256 + 128 - center).abs() <= radius + 128;
                if !reach(x, center[0], 5 * 256) || !reach(y, center[1], 3 * 256) {
                    let texel = texel as usize;
                    assert_eq!([maps.diffuse[texel], maps.specular[texel], maps.normal[texel]], [[0; 4]; 3]);
                }
            }
        }
    }

    #[test]
    fn splitting_a_batch_changes_nothing() {
        let splats: Vec<Splat> = (0..40).map(|i| splat([i * 311 % 16_384, i * 977 % 16_384])).collect();
        let (mut at_once, mut split) = (maps(Wrap::Repeat), maps(Wrap::Repeat));
        at_once.paint(&splats);
        for part in splats.chunks(7) {
            split.paint(part);
        }
        assert_eq!(at_once, split);
    }
}
