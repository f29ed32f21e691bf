//! Which triangle each texel of a texture lies on.

use bevy::math::Vec2;

use crate::overlay::Footprint;

/// For each texel a triangle, and for those that lie on none a neighbour to take after.
#[derive(Debug, Clone)]
pub(super) struct Raster {
    size: u32,
    /// Moves the uvs into the unit square.
    tile: Vec2,
    /// [`NOBODY`] where no triangle lies.
    owners: Vec<u32>,
    /// The texel itself or, where no triangle lies, one nearby on which one does.
    sources: Vec<u32>,
}

const NOBODY: u32 = u32::MAX;

impl Raster {
    /// Of triangles that share no texel and lie in one unit square, over `size` x `size` texels.
    pub(super) fn new(uvs: &[Vec2], corners: &[[u32; 3]], size: u32) -> Self {
        // Vertices that no triangle has may lie anywhere.
        let used = corners.as_flattened().iter().map(|&corner| uvs[corner as usize]);
        let finite = used.filter(|uv| uv.is_finite());
        let (low, high) =
            finite.fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), uv| (low.min(uv), high.max(uv)));
        let tile =
            if low.is_finite() && high.is_finite() { ((low + high) / 2.0).floor() } else { Vec2::ZERO };
        let mut owners = vec![NOBODY; (size * size) as usize];
        let last = size as f32 - 1.0;
        for (number, corners) in corners.iter().enumerate() {
            let texels = corners.map(|corner| (uvs[corner as usize] - tile) * size as f32);
            if !texels.iter().all(|texel| texel.is_finite()) {
                continue;
            }
            let footprint = Footprint::new(texels);
            let (low, high) = footprint.bounds();
            let range = |low: f32, high: f32| {
                low.floor().clamp(0.0, last) as u32..=high.floor().clamp(0.0, last) as u32
            };
            for y in range(low.y, high.y) {
                for x in range(low.x, high.x) {
                    let owner = &mut owners[(y * size + x) as usize];
                    if *owner == NOBODY && footprint.covers(Vec2::new(x as f32 + 0.5, y as f32 + 0.5)) {
                        *owner = number as u32;
                    }
                }
            }
        }
        let sources = nearest(&owners, size);
        Self { size, tile, owners, sources }
    }

    /// The triangle of a texel.
    pub(super) fn owner(&self, texel: usize) -> Option<usize> {
        Some(self.owners[texel]).filter(|&owner| owner != NOBODY).map(|owner| owner as usize)
    }

    /// The texel that it looks like.
    pub(super) fn source(&self, texel: usize) -> usize {
        self.sources[texel] as usize
    }

    /// The middle of a texel, in the uvs of the triangles.
    pub(super) fn middle(&self, texel: usize) -> Vec2 {
        let texel = texel as u32;
        let at = Vec2::new((texel % self.size) as f32, (texel / self.size) as f32);
        (at + 0.5) / self.size as f32 + self.tile
    }
}

/// For each texel the one with an owner from which a flood reaches it first; itself, if nobody owns any.
fn nearest(owners: &[u32], size: u32) -> Vec<u32> {
    let mut sources: Vec<u32> = vec![NOBODY; owners.len()];
    let mut reached: Vec<u32> = Vec::with_capacity(owners.len());
    for (texel, _) in owners.iter().enumerate().filter(|(_, owner)| **owner != NOBODY) {
        sources[texel] = texel as u32;
        reached.push(texel as u32);
    }
    if reached.is_empty() {
        return (0..owners.len() as u32).collect();
    }
    let mut next = 0;
    while let Some(&texel) = reached.get(next) {
        next += 1;
        let (x, y) = (texel % size, texel / size);
        let around = [
            (x > 0).then(|| texel - 1),
            (x + 1 < size).then(|| texel + 1),
            (y > 0).then(|| texel - size),
            (y + 1 < size).then(|| texel + size),
        ];
        for neighbour in around.into_iter().flatten() {
            if sources[neighbour as usize] == NOBODY {
                sources[neighbour as usize] = sources[texel as usize];
                reached.push(neighbour);
            }
        }
    }
    sources
}

/// How much of each corner is in a point of the plane of a triangle; they sum to 1.
pub(super) fn weights([a, b, c]: [Vec2; 3], point: Vec2) -> [f32; 3] {
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let (of_b, of_c) = ((point - a).perp_dot(c - a) / area, (b - a).perp_dot(point - a) / area);
    [1.0 - of_b - of_c, of_b, of_c]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_texel_has_a_triangle_or_a_neighbour_that_has() {
        // The lower left half of a square that lies in the second tile.
        let uvs = [Vec2::X, Vec2::X * 2.0, Vec2::ONE];
        let raster = Raster::new(&uvs, &[[0, 1, 2]], 16);
        let owned = (0..256).filter(|&texel| raster.owner(texel).is_some()).count();
        assert!((120..=136).contains(&owned), "{owned}");
        for texel in 0..256 {
            let source = raster.source(texel);
            assert!(raster.owner(source).is_some());
            assert!(raster.owner(texel).is_none() || source == texel);
        }
        let weights = weights(uvs, raster.middle(0));
        assert!(weights.iter().all(|weight| (0.0..=1.0).contains(weight)), "{weights:?}");
        assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn vertices_of_no_triangle_move_nothing() {
        let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::splat(4.0)];
        let raster = Raster::new(&uvs, &[[0, 1, 2]], 16);
        let owned = (0..256).filter(|&texel| raster.owner(texel).is_some()).count();
        assert!((120..=136).contains(&owned), "{owned}");
    }

    #[test]
    fn nothing_is_as_it_is() {
        let raster = Raster::new(&[Vec2::NAN; 3], &[[0, 1, 2]], 4);
        assert!((0..16).all(|texel| raster.owner(texel).is_none() && raster.source(texel) == texel));
    }
}
