//! Painting splats on the CPU: the reference, and the painter of runs without a renderer.

use bevy::prelude::*;

use super::frames::{Frames, SurfaceFrames, TexelFrame};
use super::kernel::{
    axes_part, axis_offset, blend_over, depth_part, dot_axes, facing_part, falloff, framed, lay_stamp,
    slope_color, slope_of, stamp_alpha, stamp_slope, turned, unpack_axis,
};
use super::resample::is_reached;
use super::{MapSize, Splat, SplatQueue, StampAtlas, TILE_SIZE, Weatherable, Wrap};
use crate::schedule::{WeatheringSystems, WeatheringTick};
use crate::stamps::StampTexel;
use crate::stamps::sample::{mix4, on_stamp, stamp_corners};

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
    /// Empty maps for a surface, as large as it allows.
    pub fn new(surface: &Weatherable) -> Self {
        Self::of_size(surface.texels(), surface.wrap())
    }

    /// Empty maps with so many texels along each side, and these edges.
    pub fn of_size(size: u32, wrap: [Wrap; 2]) -> Self {
        let texels = (size * size) as usize;
        Self {
            size,
            wrap,
            diffuse: vec![[0; 4]; texels],
            specular: vec![[0; 4]; texels],
            normal: vec![[0; 4]; texels],
        }
    }

    /// Paints splats, one after the other. `frames`: where the texels lie; without them, splats in space are left out.
    pub fn paint(&mut self, splats: &[Splat], stamps: &StampAtlas, frames: Option<&SurfaceFrames>) {
        for splat in splats.iter().filter(|splat| splat.paints()) {
            if splat.in_space == 0 {
                self.paint_on_map(splat, stamps);
            } else if let Some(frames) = frames {
                self.paint_in_space(splat, stamps, &frames.0);
            }
        }
    }

    fn paint_on_map(&mut self, splat: &Splat, stamps: &StampAtlas) {
        let axes = [splat.axis(0, self.size, self.wrap), splat.axis(1, self.size, self.wrap)];
        let stamp = stamps.stamp(splat.stamp);
        for y in splat.texels(1, self.size, self.wrap) {
            let row_offset = axis_offset(axes[1], y as i32);
            for x in splat.texels(0, self.size, self.wrap) {
                let offset = [axis_offset(axes[0], x as i32), row_offset];
                self.paint_texel((y * self.size + x) as usize, splat, stamp, Place::on_map(splat, offset));
            }
        }
    }

    fn paint_in_space(&mut self, splat: &Splat, stamps: &StampAtlas, frames: &Frames) {
        let stamp = stamps.stamp(splat.stamp);
        let across = self.size / TILE_SIZE;
        frames.tiles_near(splat.origin, splat.reach / 2, |tile| {
            for local in 0..TILE_SIZE * TILE_SIZE {
                let (x, y) = (tile % across * TILE_SIZE, tile / across * TILE_SIZE);
                let texel = ((y + local / TILE_SIZE) * self.size + x + local % TILE_SIZE) as usize;
                if let Some(place) = Place::in_space(splat, &frames.texels[texel]) {
                    self.paint_texel(texel, splat, stamp, place);
                }
            }
        });
    }

    fn paint_texel(&mut self, texel: usize, splat: &Splat, stamp: &[StampTexel], place: Place) {
        let unpack = |packed: u32| packed.to_le_bytes().map(u32::from);
        let (paint, gloss) = (unpack(splat.diffuse), unpack(splat.specular));
        let part = |opacity: u32| (opacity * place.part) >> 8;
        let (diffuse, specular, normal) =
            (&mut self.diffuse[texel], &mut self.specular[texel], &mut self.normal[texel]);
        if splat.stamp == 0 {
            let dome = falloff(place.offset);
            let over = |under: &mut [u8; 4], [r, g, b, opacity]: [u32; 4]| {
                let alpha = stamp_alpha(part(opacity), dome);
                for (channel, source) in under.iter_mut().zip([r, g, b, 255]) {
                    *channel = blend_over(source, alpha, u32::from(*channel)) as u8;
                }
            };
            over(diffuse, paint);
            over(specular, gloss);
            let slopes = place.along.map(|row| slope_color(splat.bump, turned(row, place.offset)));
            over(normal, [slopes[0], slopes[1], 255, splat.bump_opacity]);
            return;
        }
        if stamp.is_empty() || !on_stamp(place.offset) {
            return;
        }
        let corners = stamp_corners(place.offset);
        let [a, b, c, d] = corners.texels.map(|corner| stamp[corner as usize]);
        let [wx, wy] = corners.weights;
        let over = |under: &mut [u8; 4], channels: [u32; 4], tint: [u32; 3], opacity: u32| {
            let weight = channels[3] * opacity;
            for ((under, channel), tint) in
                under.iter_mut().zip(channels).zip([tint[0], tint[1], tint[2], 255])
            {
                *under = lay_stamp(channel, tint, opacity, weight, u32::from(*under)) as u8;
            }
        };
        let tint = |[r, g, b, _]: [u32; 4]| [r, g, b];
        let color = unpack(mix4(a.diffuse, b.diffuse, c.diffuse, d.diffuse, wx, wy));
        over(diffuse, color, tint(paint), part(paint[3]));
        let color = unpack(mix4(a.specular, b.specular, c.specular, d.specular, wx, wy));
        over(specular, color, tint(gloss), part(gloss[3]));
        let [r, g, _, coverage] = unpack(mix4(a.normal, b.normal, c.normal, d.normal, wx, wy));
        let slopes = [slope_of(r, coverage), slope_of(g, coverage)];
        let [u, v] = place.along.map(|row| stamp_slope(slopes, row, splat.bump, coverage));
        over(normal, [u, v, coverage, coverage], [255; 3], part(splat.bump_opacity));
    }
}

/// Where a texel lies on a stamp.
struct Place {
    /// Along the stamp's own axes, 1/256 radius.
    offset: [i32; 2],
    /// For u and v: their parts along the stamp's axes, 1024 for 1.
    along: [[i32; 2]; 2],
    /// How much of the stamp reaches it, 0..=256.
    part: u32,
}

impl Place {
    fn on_map(splat: &Splat, offset: [i32; 2]) -> Self {
        if splat.stamp == 0 {
            return Self { offset, along: [[1024, 0], [0, 1024]], part: 256 };
        }
        let [[ss, st, _], [ts, tt, _]] = [splat.row_s, splat.row_t];
        // A corner of a turned stamp that hangs out of its box is cut off.
        let part = if on_stamp(offset) { 256 } else { 0 };
        let offset = [turned([ss, st], offset), turned([ts, tt], offset)];
        Self { offset, along: [[ss, ts], [st, tt]], part }
    }

    fn in_space(splat: &Splat, frame: &TexelFrame) -> Option<Self> {
        let [x, y, z] = frame.place()?;
        let [from_x, from_y, from_z] = splat.origin;
        let away = [x - from_x, y - from_y, z - from_z];
        let [s, t, n] = [splat.row_s, splat.row_t, splat.row_n].map(|row| framed(row, away, splat.reach));
        let facing = facing_part(dot_axes(unpack_axis(frame.normal), unpack_axis(splat.axis_n)));
        let part = (depth_part(n) * facing) >> 8;
        let axes = [splat.axis_s, splat.axis_t].map(unpack_axis);
        let along = frame.along().map(|along| axes.map(|axis| axes_part(dot_axes(along, axis))));
        (part > 0 && on_stamp([s, t])).then_some(Self { offset: [s, t], along, part })
    }
}

/// Paints splats on the CPU, in the tick of their impact. Use it in place of
/// [`GpuOverlayPlugin`](super::GpuOverlayPlugin), not beside it: whoever paints empties the queue.
pub struct CpuOverlayPlugin;

impl Plugin for CpuOverlayPlugin {
    fn build(&self, app: &mut App) {
        app.add_observer(release_maps).add_systems(
            WeatheringTick,
            (
                add_cpu_maps.before(super::deposit::deposit_splats),
                paint_on_cpu.after(super::deposit::deposit_splats).after(add_cpu_maps),
            )
                .in_set(WeatheringSystems::Deposit),
        );
    }
}

/// Gives new surfaces their maps, and new ones when their edges change. Where only the size does, what has been painted stays.
fn add_cpu_maps(
    mut commands: Commands,
    mut changed: Query<
        (Entity, &Weatherable, &MapSize, Option<&CpuMaps>, &mut SplatQueue),
        Or<(Changed<Weatherable>, Changed<MapSize>)>,
    >,
) {
    for (entity, surface, size, maps, mut queue) in &mut changed {
        let (size, wrap) = (size.texels(), surface.wrap());
        let new = match maps {
            Some(maps) if (maps.size, maps.wrap) == (size, wrap) => continue,
            // Before its texels were measured; else that is done with all that is on it.
            Some(maps) if maps.wrap == wrap && is_reached(maps.size, size) => maps.resized(size, None),
            Some(_) => {
                queue.clear();
                CpuMaps::of_size(size, wrap)
            }
            None => CpuMaps::of_size(size, wrap),
        };
        commands.entity(entity).insert(new);
    }
}

/// Drops the maps of a surface that has lost its size.
fn release_maps(removed: On<Remove, MapSize>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<CpuMaps>();
}

/// Empties every queue into its surface's maps. Surfaces do not share texels, so they are painted in parallel.
pub fn paint_on_cpu(
    stamps: Res<StampAtlas>,
    mut surfaces: Query<(&mut CpuMaps, &mut SplatQueue, Option<&SurfaceFrames>)>,
) {
    surfaces.par_iter_mut().for_each(|(mut maps, mut queue, frames)| {
        if !queue.is_empty() {
            maps.paint(queue.splats(), &stamps, frames);
            queue.clear();
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::overlay::splat::pack_unorm;

    fn maps(wrap: Wrap) -> CpuMaps {
        CpuMaps::new(&Weatherable { map_size: 64, wrap_u: wrap, wrap_v: wrap, ..default() })
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
            ..bytemuck::Zeroable::zeroed()
        }
    }

    #[test]
    fn a_stamp_in_the_corner_is_the_stamp_in_the_middle() {
        let (mut corner, mut middle) = (maps(Wrap::Repeat), maps(Wrap::Repeat));
        corner.paint(&[splat([100, 30])], &StampAtlas::default(), None);
        middle.paint(&[splat([32 * 256 + 100, 32 * 256 + 30])], &StampAtlas::default(), None);
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
            maps.paint(&[splat(center)], &StampAtlas::default(), None);
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
        at_once.paint(&splats, &StampAtlas::default(), None);
        for part in splats.chunks(7) {
            split.paint(part, &StampAtlas::default(), None);
        }
        assert_eq!(at_once, split);
    }
}
