//! The textures that a scene has.
//!
//! A texture is read where a texel of the baked one lies, over as much of it as that covers: what tiles ten times over a wall
//! comes down to one map without a moiré.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::PathBuf;
use std::sync::Arc;

use bevy::math::{Affine2, Vec2};
use image::{ImageFormat, ImageReader, Limits};
use serde_json::Value;

use super::ExportError;
use super::document::{Document, number};
use super::scene::vector;
use crate::picture::PictureError;
use crate::scenes::mips::linear_from_srgb;

/// The widest and highest texture that is read.
const MAX_SIDE: u32 = 16_384;
/// The most memory that a decoder may take.
const MAX_BYTES: u64 = 2 << 30;
/// Points along each side of a texel at which a texture is read, at most.
const MAX_TAPS: u32 = 16;

/// Decoded pictures, by the number of their image.
#[derive(Default)]
pub(super) struct Pictures(BTreeMap<usize, Arc<Picture>>);

/// A picture, row by row.
pub(super) struct Picture {
    pub(super) width: u32,
    pub(super) height: u32,
    texels: Vec<[u8; 4]>,
}

/// What happens at an edge of a texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Edge {
    Clamp,
    Mirror,
    Repeat,
}

/// A texture as a material uses it.
#[derive(Clone)]
pub(super) struct Texture {
    pub(super) picture: Arc<Picture>,
    edges: [Edge; 2],
    /// Which uvs it lies in.
    pub(super) set: usize,
    pub(super) texture_from_uv: Affine2,
}

/// What each byte of a channel stands for.
pub(super) type Decoding = [f32; 256];

/// As it is, 0 to 1.
pub(super) fn plain() -> Decoding {
    std::array::from_fn(|byte| byte as f32 / 255.0)
}

/// Light from sRGB.
pub(super) fn srgb() -> Decoding {
    plain().map(linear_from_srgb)
}

impl Pictures {
    /// The texture that a `textureInfo` names; `None` if it is none.
    pub(super) fn texture(
        &mut self,
        document: &Document,
        info: &Value,
    ) -> Result<Option<Texture>, ExportError> {
        let Some(index) = number(&info["index"]) else { return Ok(None) };
        let texture = document.entry("textures", index)?;
        let Some(image) = number(&texture["source"]) else {
            return Err(document.content(format!("textures[{index}]"), "has no `source` that is PNG or JPEG"));
        };
        let picture = match self.0.get(&image) {
            Some(picture) => picture.clone(),
            None => {
                let picture = Arc::new(decode(document, image)?);
                self.0.insert(image, picture.clone());
                picture
            }
        };
        let sampler = match number(&texture["sampler"]) {
            Some(sampler) => document.entry("samplers", sampler)?,
            None => &Value::Null,
        };
        let edges = ["wrapS", "wrapT"].map(|axis| match sampler[axis].as_u64() {
            Some(33_071) => Edge::Clamp,
            Some(33_648) => Edge::Mirror,
            _ => Edge::Repeat,
        });
        let transform = &info["extensions"]["KHR_texture_transform"];
        let set = number(&transform["texCoord"]).or_else(|| number(&info["texCoord"])).unwrap_or(0);
        let texture_from_uv = Affine2::from_scale_angle_translation(
            Vec2::from_array(vector(&transform["scale"]).unwrap_or([1.0; 2])),
            // The extension turns the other way, since v grows downwards.
            -transform["rotation"].as_f64().unwrap_or(0.0) as f32,
            Vec2::from_array(vector(&transform["offset"]).unwrap_or([0.0; 2])),
        );
        Ok(Some(Texture { picture, edges, set, texture_from_uv }))
    }
}

/// A PNG or JPEG of the file.
fn decode(document: &Document, index: usize) -> Result<Picture, ExportError> {
    let image = document.entry("images", index)?;
    let field = format!("images[{index}]");
    let view = number(&image["bufferView"]).and_then(|view| document.list("bufferViews").get(view));
    let bytes = view.and_then(|view| document.view_bytes(view));
    let bytes = bytes.ok_or_else(|| document.content(&*field, "has no bytes"))?;
    let format = match image["mimeType"].as_str() {
        Some("image/png") => ImageFormat::Png,
        Some("image/jpeg") => ImageFormat::Jpeg,
        kind => {
            let kind = kind.unwrap_or("of no `mimeType`");
            return Err(document.content(field, format!("is {kind}; PNG and JPEG are read")));
        }
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let path = || PathBuf::from(format!("{}, {field}", document.path.display()));
    let decoded = reader.decode().map_err(|source| PictureError::Image { path: path(), source })?.to_rgba8();
    let (width, height) = decoded.dimensions();
    Ok(Picture { width, height, texels: decoded.pixels().map(|pixel| pixel.0).collect() })
}

impl Texture {
    /// Its mean over the parallelogram around a uv with these sides. Colours by `decoding`, alpha as it is.
    pub(super) fn over(&self, uv: Vec2, sides: [Vec2; 2], decoding: &Decoding) -> [f32; 4] {
        let size = Vec2::new(self.picture.width as f32, self.picture.height as f32);
        let middle = self.texture_from_uv.transform_point2(uv) * size;
        let sides = sides.map(|side| self.texture_from_uv.transform_vector2(side) * size);
        // One that is not finite is read at one point.
        let taps = sides.map(|side| (side.length().ceil() as u32).clamp(1, MAX_TAPS));
        let mut sum = [0.0; 4];
        for i in 0..taps[0] {
            for j in 0..taps[1] {
                let part = |number: u32, taps: u32| (number as f32 + 0.5) / taps as f32 - 0.5;
                let at = middle + sides[0] * part(i, taps[0]) + sides[1] * part(j, taps[1]);
                let here = self.at(at, decoding);
                sum = std::array::from_fn(|channel| sum[channel] + here[channel]);
            }
        }
        sum.map(|sum| sum / (taps[0] * taps[1]) as f32)
    }

    /// Between four texels.
    fn at(&self, texel: Vec2, decoding: &Decoding) -> [f32; 4] {
        let corner = (texel - 0.5).floor();
        let part = (texel - 0.5 - corner).clamp(Vec2::ZERO, Vec2::ONE);
        let mut sum = [0.0; 4];
        for (right, down) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let weight = [(part.x, right), (part.y, down)]
                .map(|(part, high)| if high == 1 { part } else { 1.0 - part })
                .into_iter()
                .product::<f32>();
            // The conversion saturates, too.
            let x = self.edges[0].inside((corner.x as i64).saturating_add(right), self.picture.width);
            let y = self.edges[1].inside((corner.y as i64).saturating_add(down), self.picture.height);
            let texel = self.picture.texels[y as usize * self.picture.width as usize + x as usize];
            let [red, green, blue, alpha] = texel.map(usize::from);
            let values = [decoding[red], decoding[green], decoding[blue], alpha as f32 / 255.0];
            sum = std::array::from_fn(|channel| sum[channel] + weight * values[channel]);
        }
        sum
    }
}

impl Edge {
    fn inside(self, at: i64, size: u32) -> u32 {
        let size = i64::from(size);
        let inside = match self {
            Self::Clamp => at.clamp(0, size - 1),
            Self::Repeat => at.rem_euclid(size),
            Self::Mirror => {
                let at = at.rem_euclid(2 * size);
                at.min(2 * size - 1 - at)
            }
        };
        inside as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(edge: Edge, texture_from_uv: Affine2) -> Texture {
        let texels = vec![[0, 0, 0, 255], [255, 0, 0, 255], [0, 255, 0, 255], [255, 255, 0, 55]];
        let picture = Arc::new(Picture { width: 2, height: 2, texels });
        Texture { picture, edges: [edge; 2], set: 0, texture_from_uv }
    }

    #[test]
    fn middles_of_texels_are_texels_and_edges_do_what_they_say() {
        let at =
            |edge, u, v| texture(edge, Affine2::IDENTITY).over(Vec2::new(u, v), [Vec2::ZERO; 2], &plain());
        assert_eq!(at(Edge::Clamp, 0.75, 0.25), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(Edge::Repeat, 1.75, -0.75), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(Edge::Clamp, 1.75, 0.25), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(Edge::Mirror, 1.25, 0.25), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(Edge::Clamp, 0.5, 0.25), [0.5, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn over_all_of_it_is_its_mean_and_a_transform_moves_it() {
        let sides = [Vec2::X * 8.0, Vec2::Y * 8.0];
        let mean = texture(Edge::Repeat, Affine2::IDENTITY).over(Vec2::splat(0.3), sides, &plain());
        assert!((mean[0] - 0.5).abs() < 1e-5 && (mean[1] - 0.5).abs() < 1e-5, "{mean:?}");
        let moved = texture(Edge::Repeat, Affine2::from_translation(Vec2::new(0.5, 0.0)));
        assert_eq!(moved.over(Vec2::splat(0.25), [Vec2::ZERO; 2], &plain())[0], 1.0);
    }

    #[test]
    fn uvs_too_large_for_whole_numbers_are_read_somewhere() {
        for edge in [Edge::Clamp, Edge::Mirror, Edge::Repeat] {
            for uv in [Vec2::splat(1e25), Vec2::splat(-1e25), Vec2::splat(f32::INFINITY)] {
                let read = texture(edge, Affine2::IDENTITY).over(uv, [Vec2::X; 2], &plain());
                assert!(read.iter().all(|value| (0.0..=1.0).contains(value)), "{edge:?} {uv}: {read:?}");
            }
        }
    }

    #[test]
    fn light_is_decoded() {
        let table = srgb();
        assert!(table[0] == 0.0 && (table[255] - 1.0).abs() < 1e-6 && (0.2..0.23).contains(&table[128]));
    }
}
