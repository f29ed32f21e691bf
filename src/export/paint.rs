//! Textures with the weathering in them.
//!
//! Each texel asks which point of the surface it is, what the material's own textures say there, wherever they lie, and what
//! lies on that point; the look of both together is written down. Texels beside the islands take after the nearest on one, so
//! that neither filtering nor mip maps find a rim.

use std::ops::{Add, Mul};

use bevy::math::{DVec3, Vec2, Vec3};

use super::look::{Dry, Held, WetModel};
use super::raster::{Raster, weights};
use super::shape::Shape;
use super::texture::{Decoding, Texture, plain, srgb};
use crate::scenes::mips::srgb_from_linear;
use crate::wetmap::parallel;

/// A material of the scene, dry.
#[derive(Clone)]
pub(super) struct Source {
    /// Linear, with alpha.
    pub(super) color: [f32; 4],
    pub(super) color_map: Option<Texture>,
    pub(super) roughness: f32,
    pub(super) metallic: f32,
    /// Green: roughness, blue: metallic.
    pub(super) surface_map: Option<Texture>,
    pub(super) normal_map: Option<Texture>,
    pub(super) normal_scale: f32,
}

/// Baked textures, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Baked {
    pub(super) size: u32,
    /// sRGB with alpha.
    pub(super) color: Vec<u8>,
    /// Roughness in green, metallic in blue.
    pub(super) surface: Vec<u8>,
    /// Of the tangents of the maps' uvs; `None` if nothing leans anywhere.
    pub(super) normal: Option<Vec<u8>>,
}

#[derive(Clone, Copy, Default)]
struct Texel {
    color: [u8; 4],
    surface: [u8; 3],
    normal: [u8; 3],
}

/// A normal that leans nowhere.
const FLAT: [u8; 3] = [128, 128, 255];

/// What a texel is baked from.
struct Baker<'a> {
    shape: &'a Shape,
    source: &'a Source,
    model: &'a WetModel,
    held: &'a [Held],
    held_size: u32,
    raster: Raster,
    size: u32,
    srgb: Decoding,
    plain: Decoding,
}

/// Bakes `size` x `size` texels from a material, and what lies on `held_size` x `held_size` texels of the surface.
pub(super) fn bake(
    shape: &Shape,
    source: &Source,
    model: &WetModel,
    held: &[Held],
    held_size: u32,
    size: u32,
) -> Baked {
    let raster = Raster::new(shape.map_uvs(), &shape.corners, size);
    let baker = Baker { shape, source, model, held, held_size, raster, size, srgb: srgb(), plain: plain() };
    let mut texels = vec![Texel::default(); (size * size) as usize];
    parallel::fill(&mut texels, size as usize, |first, row| {
        for (texel, baked) in row.iter_mut().enumerate() {
            if let Some(triangle) = baker.raster.owner(first + texel) {
                *baked = baker.texel(first + texel, triangle);
            }
        }
    });
    let known = texels.clone();
    for (texel, baked) in texels.iter_mut().enumerate() {
        *baked = known[baker.raster.source(texel)];
    }
    let leans = texels.iter().any(|texel| texel.normal != FLAT);
    Baked {
        size,
        color: texels.iter().flat_map(|texel| texel.color).collect(),
        surface: texels.iter().flat_map(|texel| texel.surface).collect(),
        normal: leans.then(|| texels.iter().flat_map(|texel| texel.normal).collect()),
    }
}

impl Baker<'_> {
    fn texel(&self, texel: usize, triangle: usize) -> Texel {
        let corners = self.shape.corners[triangle];
        let point = Point::new(self.shape, corners, self.raster.middle(texel), 1.0 / self.size as f32);
        let source = self.source;
        let read = |map: &Option<Texture>, decoding| map.as_ref().map(|map| point.texture(map, decoding));
        let color = read(&source.color_map, &self.srgb).unwrap_or([1.0; 4]);
        let color: [f32; 4] = std::array::from_fn(|i| color[i] * source.color[i]);
        let surface = read(&source.surface_map, &self.plain).unwrap_or([1.0; 4]);
        let dry = Dry {
            color: std::array::from_fn(|i| f64::from(color[i].clamp(0.0, 1.0))),
            roughness: f64::from((surface[1] * source.roughness).clamp(0.0, 1.0)),
            metallic: f64::from((surface[2] * source.metallic).clamp(0.0, 1.0)),
            normal: self.normal(&point),
        };
        let wet = self.model.weathered(&dry, &self.held(point.uv));
        let byte = |value: f64| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
        let [red, green, blue] =
            wet.color.map(|value| byte(srgb_from_linear(value.clamp(0.0, 1.0) as f32).into()));
        // 128 is 0, as it is in textures of 8 bits.
        let axis = |value: f64| (value * 127.0 + 128.0).round().clamp(1.0, 255.0) as u8;
        Texel {
            color: [red, green, blue, byte(color[3].into())],
            surface: [255, byte(wet.roughness), byte(wet.metallic)],
            normal: wet.normal.to_array().map(axis),
        }
    }

    /// The normal of the material, in the tangent frame of the maps' uvs.
    fn normal(&self, point: &Point) -> DVec3 {
        let Some(map) = &self.source.normal_map else { return DVec3::Z };
        let [x, y, z, _] = point.texture(map, &self.plain).map(|channel| (channel * 255.0 - 128.0) / 127.0);
        let scaled = Vec3::new(x * self.source.normal_scale, y * self.source.normal_scale, z.max(0.0));
        let normal = scaled.normalize_or(Vec3::Z);
        if map.set == self.shape.map_set() {
            return normal.as_dvec3();
        }
        let (Some(own), Some(new)) = (point.frame(map.set, true), point.frame(self.shape.map_set(), false))
        else {
            return normal.as_dvec3();
        };
        let on_mesh = own[0] * normal.x + own[1] * normal.y + own[2] * normal.z;
        Vec3::from_array(new.map(|axis| axis.dot(on_mesh))).normalize_or(Vec3::Z).as_dvec3()
    }

    /// What lies at a uv, between four texels.
    fn held(&self, uv: Vec2) -> Held {
        let size = self.held_size as i32;
        let at = uv * self.held_size as f32 - 0.5;
        let (corner, part) = (at.floor(), at - at.floor());
        let texel = |right: i32, down: i32| {
            let x = (corner.x as i32).wrapping_add(right).rem_euclid(size);
            let y = (corner.y as i32).wrapping_add(down).rem_euclid(size);
            &self.held[(y * size + x) as usize]
        };
        let upper = texel(0, 0).mixed(texel(1, 0), part.x);
        upper.mixed(&texel(0, 1).mixed(texel(1, 1), part.x), part.y)
    }
}

/// A point of a triangle.
struct Point<'a> {
    shape: &'a Shape,
    corners: [u32; 3],
    /// On the maps.
    uv: Vec2,
    /// How much of each corner is here, and one texel of the baked texture to the right and down.
    here: [f32; 3],
    right: [f32; 3],
    down: [f32; 3],
}

impl<'a> Point<'a> {
    fn new(shape: &'a Shape, corners: [u32; 3], uv: Vec2, texel: f32) -> Self {
        let places = corners.map(|corner| shape.map_uvs()[corner as usize]);
        let at = |point| weights(places, point);
        let (right, down) = (at(uv + Vec2::X * texel), at(uv + Vec2::Y * texel));
        Self { shape, corners, uv, here: at(uv), right, down }
    }

    /// Between the values of the corners.
    fn mixed<T: Copy + Add<Output = T> + Mul<f32, Output = T>>(&self, values: &[T], parts: [f32; 3]) -> T {
        let [a, b, c] = self.corners.map(|corner| values[corner as usize]);
        a * parts[0] + b * parts[1] + c * parts[2]
    }

    /// A texture over this texel.
    fn texture(&self, texture: &Texture, decoding: &Decoding) -> [f32; 4] {
        // Uvs that are not there are 0.
        let Some(uvs) = self.uvs(texture.set) else {
            return texture.over(Vec2::ZERO, [Vec2::ZERO; 2], decoding);
        };
        let uv = self.mixed(uvs, self.here);
        let sides = [self.right, self.down].map(|parts| self.mixed(uvs, parts) - uv);
        texture.over(uv, sides, decoding)
    }

    fn uvs(&self, set: usize) -> Option<&'a [Vec2]> {
        if set == self.shape.map_set() {
            return Some(self.shape.map_uvs());
        }
        self.shape.uvs.get(set).map(Vec::as_slice)
    }

    /// Tangent, bitangent and normal for a set of uvs, on the mesh; by the tangents of the file, if these may be meant.
    fn frame(&self, set: usize, by_file: bool) -> Option<[Vec3; 3]> {
        let [a, b, c] = self.corners.map(|corner| self.shape.positions[corner as usize]);
        let flat = (b - a).cross(c - a);
        let normal = self.shape.normals.as_ref().map_or(flat, |normals| self.mixed(normals, self.here));
        let normal = normal.try_normalize()?;
        if by_file
            && self.shape.normals.is_some()
            && let Some(tangents) = &self.shape.tangents
        {
            let tangent = self.mixed(tangents, self.here);
            let along = tangent.truncate();
            let along = (along - normal * normal.dot(along)).try_normalize()?;
            return Some([along, normal.cross(along) * tangent.w.signum(), normal]);
        }
        let uvs = self.uvs(set)?;
        let [uv_a, uv_b, uv_c] = self.corners.map(|corner| uvs[corner as usize]);
        let (first, second) = (uv_b - uv_a, uv_c - uv_a);
        let mirrored = first.perp_dot(second).signum();
        // Which way u grows, and v.
        let along_u = ((b - a) * second.y - (c - a) * first.y) * mirrored;
        let along_v = ((c - a) * first.x - (b - a) * second.x) * mirrored;
        let along = (along_u - normal * normal.dot(along_u)).try_normalize()?;
        let across = normal.cross(along);
        // The second axis of a tangent frame goes up the image, v goes down.
        let up = if across.dot(along_v) > 0.0 { -across } else { across };
        Some([along, up, normal])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::shape::tests::square;
    use crate::material::PorousMaterial;
    use crate::matter::MatterLook;

    fn clay() -> Source {
        Source {
            color: [0.5, 0.25, 0.125, 0.75],
            color_map: None,
            roughness: 0.75,
            metallic: 0.0,
            surface_map: None,
            normal_map: None,
            normal_scale: 1.0,
        }
    }

    fn baked(held: &[Held]) -> Baked {
        let model = WetModel::new(&PorousMaterial::default(), MatterLook::default());
        bake(&square(1.0), &clay(), &model, held, 16, 32)
    }

    #[test]
    fn a_dry_square_is_its_material() {
        let dry = baked(&[Held::default(); 256]);
        assert!(dry.normal.is_none());
        let encode = |value: f32| (srgb_from_linear(value) * 255.0).round() as u8;
        let color = [encode(0.5), encode(0.25), encode(0.125), 191];
        assert!(dry.color.chunks(4).all(|texel| texel == color), "{:?}", &dry.color[..4]);
        assert!(dry.surface.chunks(3).all(|texel| texel == [255, 191, 0]));
    }

    #[test]
    fn the_wet_half_is_darker_and_smoother() {
        let half: Vec<_> = (0..256)
            .map(|texel| {
                if texel % 16 < 8 {
                    Held::default()
                } else {
                    Held { wetness: 1.0, gloss: 1.0, ..Held::default() }
                }
            })
            .collect();
        let wet = baked(&half);
        let (left, right) = (16 * 32 + 4, 16 * 32 + 27);
        assert!(wet.color[right * 4] < wet.color[left * 4]);
        assert!(wet.surface[right * 3 + 1] < wet.surface[left * 3 + 1]);
        assert_eq!(wet.color[right * 4 + 3], 191);
    }

    #[test]
    fn frames_go_along_u_and_up_the_image() {
        let shape = square(1.0);
        let point = Point::new(&shape, shape.corners[0], Vec2::new(0.5, 0.25), 0.01);
        // u grows with x and v with y, and the square looks along z.
        assert_eq!(point.frame(0, true), Some([Vec3::X, Vec3::NEG_Y, Vec3::Z]));
        assert_eq!(point.mixed(&shape.positions, point.here).truncate(), point.uv);
    }
}
