//! Cube maps: which way their texels look, what they hold, and how they become images.

use bevy::asset::RenderAssetUsages;
use bevy::image::ImageSampler;
use bevy::math::{Vec2, Vec3};
use bevy::prelude::Image;
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use half::f16;

/// Largest finite half float.
pub(super) const MAX_HALF: f32 = 65504.0;

/// The world direction, not normalised, of a place on a layer of a cube image; `uv` beyond `0..=1` goes on
/// in the plane of the face. Layers and their axes as in every graphics interface, seen through Bevy's
/// negated z.
pub(super) fn cube_direction(layer: usize, uv: Vec2) -> Vec3 {
    let Vec2 { x: u, y: v } = uv * 2.0 - 1.0;
    let cube = match layer {
        0 => Vec3::new(1.0, -v, -u),
        1 => Vec3::new(-1.0, -v, u),
        2 => Vec3::new(u, 1.0, v),
        3 => Vec3::new(u, -1.0, -v),
        4 => Vec3::new(u, -v, 1.0),
        _ => Vec3::new(-u, -v, -1.0),
    };
    Vec3::new(cube.x, cube.y, -cube.z)
}

/// The layer and the place on it that a world direction hits; [`cube_direction`] the other way.
fn cube_uv(direction: Vec3) -> (usize, Vec2) {
    let d = Vec3::new(direction.x, direction.y, -direction.z);
    let a = d.abs();
    let (layer, u, v, major) = if a.x >= a.y && a.x >= a.z {
        if d.x > 0.0 { (0, -d.z, -d.y, a.x) } else { (1, d.z, -d.y, a.x) }
    } else if a.y >= a.z {
        if d.y > 0.0 { (2, d.x, d.z, a.y) } else { (3, d.x, -d.z, a.y) }
    } else if d.z > 0.0 {
        (4, d.x, -d.y, a.z)
    } else {
        (5, -d.x, -d.y, a.z)
    };
    (layer, Vec2::new(u, v) / major * 0.5 + 0.5)
}

/// One level of a cube image: six layers of `face * face` texels.
pub(super) struct Cube {
    face: u32,
    layers: [Vec<Vec3>; 6],
}

impl Cube {
    /// Asks `radiance` for the unit direction of every texel, or of `samples * samples` places in each.
    pub(super) fn new(face: u32, samples: u32, radiance: impl Fn(Vec3) -> Vec3) -> Self {
        let texel = |layer: usize, x: u32, y: u32| {
            let places = (0..samples).flat_map(|j| (0..samples).map(move |i| (i, j)));
            let sum: Vec3 = places
                .map(|(i, j)| {
                    let inside = (Vec2::new(i as f32, j as f32) + 0.5) / samples as f32;
                    let uv = (Vec2::new(x as f32, y as f32) + inside) / face as f32;
                    radiance(cube_direction(layer, uv).normalize())
                })
                .sum();
            sum / (samples * samples) as f32
        };
        let layer =
            |layer| (0..face).flat_map(|y| (0..face).map(move |x| (x, y))).map(move |(x, y)| (layer, x, y));
        Self {
            face,
            layers: [0, 1, 2, 3, 4, 5].map(|i| layer(i).map(|(layer, x, y)| texel(layer, x, y)).collect()),
        }
    }

    /// The next level, each texel the mean of four by the solid angles they cover. A plain mean would give
    /// the corners of a face, which are far away, up to five times their due.
    fn halved(&self) -> Self {
        let (from, to) = (self.face as usize, self.face as usize / 2);
        let layer = |layer: usize| {
            let weighted = |x: usize, y: usize| {
                let uv = (Vec2::new(x as f32, y as f32) + 0.5) / from as f32;
                let solid_angle = cube_direction(layer, uv).length().powi(-3);
                (self.layers[layer][y * from + x] * solid_angle).extend(solid_angle)
            };
            let pair = |x: usize, y: usize| weighted(x, y) + weighted(x + 1, y);
            let mean = |x: usize, y: usize| {
                let sum = pair(2 * x, 2 * y) + pair(2 * x, 2 * y + 1);
                sum.truncate() / sum.w
            };
            (0..to * to).map(|i| mean(i % to, i / to)).collect()
        };
        Self { face: to as u32, layers: [0, 1, 2, 3, 4, 5].map(layer) }
    }

    /// Each layer with a border of one texel taken from its neighbours, for [`Padded::sample`].
    fn padded(&self) -> Padded {
        let face = self.face as f32;
        let texel = |layer: usize, x: f32, y: f32| {
            let uv = (Vec2::new(x, y) + 0.5) / face;
            let (layer, uv) = if uv.min_element() < 0.0 || uv.max_element() > 1.0 {
                cube_uv(cube_direction(layer, uv))
            } else {
                (layer, uv)
            };
            let at = (uv * face).floor().clamp(Vec2::ZERO, Vec2::splat(face - 1.0));
            self.layers[layer][(at.y * face + at.x) as usize]
        };
        let stride = self.face as usize + 2;
        let texels = (0..6 * stride * stride)
            .map(|i| {
                texel(i / (stride * stride), (i % stride) as f32 - 1.0, (i / stride % stride) as f32 - 1.0)
            })
            .collect();
        Padded { face: self.face, texels }
    }
}

/// A [`Cube`] that can be read with linear filtering across the edges of its faces.
struct Padded {
    face: u32,
    texels: Vec<Vec3>,
}

impl Padded {
    fn sample(&self, direction: Vec3) -> Vec3 {
        let stride = self.face as usize + 2;
        let (layer, uv) = cube_uv(direction);
        let at = (uv * self.face as f32 + 0.5).clamp(Vec2::ZERO, Vec2::splat(self.face as f32 + 0.999));
        let (x, y) = (at.x as usize, at.y as usize);
        let part = at - Vec2::new(x as f32, y as f32);
        let first = (layer * stride + y) * stride + x;
        let row = |first: usize| self.texels[first].lerp(self.texels[first + 1], part.x);
        row(first).lerp(row(first + stride), part.y)
    }
}

/// The unblurred environment and its mip maps, down to one texel a face.
pub(super) struct Source {
    levels: Vec<Padded>,
}

impl Source {
    pub(super) fn new(mut cube: Cube) -> Self {
        let mut levels = vec![cube.padded()];
        while cube.face > 1 {
            cube = cube.halved();
            levels.push(cube.padded());
        }
        Self { levels }
    }

    pub(super) fn sample(&self, direction: Vec3, level: f32) -> Vec3 {
        let level = level.clamp(0.0, self.levels.len() as f32 - 1.0);
        let (fine, part) = (level as usize, level.fract());
        let sharp = self.levels[fine].sample(direction);
        match self.levels.get(fine + 1) {
            Some(coarse) if part > 0.0 => sharp.lerp(coarse.sample(direction), part),
            _ => sharp,
        }
    }
}

/// A cube image of these levels, layer by layer with the levels of a layer together, as Bevy's default
/// data order has it.
pub(super) fn cube_image(label: &'static str, levels: &[Cube]) -> Image {
    let face = levels.first().map_or(1, |cube| cube.face);
    let mut data = Vec::new();
    for layer in 0..6 {
        for texel in levels.iter().flat_map(|level| &level.layers[layer]) {
            let rgba = [texel.x, texel.y, texel.z, 1.0];
            data.extend(rgba.into_iter().flat_map(|value| f16::from_f32(value.min(MAX_HALF)).to_le_bytes()));
        }
    }
    let mut image = Image::new_uninit(
        Extent3d { width: face, height: face, depth_or_array_layers: 6 },
        TextureDimension::D2,
        TextureFormat::Rgba16Float,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.data = Some(data);
    image.texture_descriptor.label = Some(label);
    image.texture_descriptor.mip_level_count = levels.len() as u32;
    image.texture_view_descriptor =
        Some(TextureViewDescriptor { dimension: Some(TextureViewDimension::Cube), ..Default::default() });
    image.sampler = ImageSampler::linear();
    image
}

#[cfg(test)]
mod tests {
    use super::super::equirect::{equirect_direction, equirect_uv};
    use super::*;

    #[test]
    fn directions_survive_the_way_there_and_back() {
        for layer in 0..6 {
            for i in 0..64 {
                let uv = (Vec2::new((i % 8) as f32, (i / 8) as f32) + 0.5) / 8.0;
                let direction = cube_direction(layer, uv).normalize();
                let back = equirect_direction(equirect_uv(direction));
                assert!(back.abs_diff_eq(direction, 1e-5), "{layer} {uv}: {direction} {back}");
                let (same, again) = cube_uv(back);
                assert!(same == layer && again.abs_diff_eq(uv, 1e-5), "{layer} {uv}: {same} {again}");
            }
        }
    }
}
