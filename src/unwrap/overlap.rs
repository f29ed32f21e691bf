//! Whether texture coordinates tile, lie on each other, or cover next to nothing of the map.

use bevy::prelude::*;

use crate::collision::MeshTriangles;
use crate::overlay::Footprint;

/// How far texture coordinates are from giving each point of a mesh a texel of its own.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct UvOverlap {
    /// They reach out of their unit square by more than a texel. That may be any one: [1, 2] x [0, 1] is as good as
    /// [0, 1] x [0, 1].
    pub outside: bool,
    /// Part of the covered texels that two triangles or more own; 0 to 1.
    pub overlapping: f32,
}

impl UvOverlap {
    /// Part of the covered texels that may be owned twice: islands that touch by a rounding error are no reason to
    /// unwrap a mesh.
    pub const TOLERANCE: f32 = 0.005;

    /// Whether what falls on one place of the mesh would show at another.
    pub fn needs_unwrap(&self) -> bool {
        self.outside || self.overlapping > Self::TOLERANCE
    }
}

/// Rasterizes the triangles into a map of `size` x `size` texels that tiles, and counts who owns each: a triangle owns
/// those whose middle it covers. One that reaches over more than the map counts as lying on itself, everywhere.
///
/// Triangles that share an edge share no texel, whatever the rounding; islands thinner than a texel may be missed.
pub fn measure_overlap(triangles: &MeshTriangles, size: u32) -> UvOverlap {
    measure_until(triangles, size, f32::INFINITY)
}

/// [`UvOverlap::needs_unwrap`] of the same, without looking further than it takes: of many triangles that all lie over the
/// whole map, a few are enough. Also whether part of the surface has no texels to speak of, as where each face is a point of
/// a palette.
pub fn shares_texels(triangles: &MeshTriangles, size: u32) -> bool {
    is_collapsed(triangles) || measure_until(triangles, size, UvOverlap::TOLERANCE).needs_unwrap()
}

/// Whether all of a surface lies on next to nothing of the map, or part of it does beside the rest. Such triangles own no
/// texel, so none of them is seen to lie on another.
fn is_collapsed(triangles: &MeshTriangles) -> bool {
    /// Of the map, for a whole surface: 16 x 16 texels of 512 x 512.
    const SMALLEST: f64 = 1.0 / 1024.0;
    /// Of a triangle's share of what is used of the map, by its area.
    const THINNEST: f64 = 1e-4;
    let sizes = || {
        triangles.positions.iter().zip(&triangles.uvs).map(|(&[a, b, c], &[u, v, w])| {
            let (area, on_map) = ((b - a).cross(c - a).length(), (v - u).perp_dot(w - u).abs());
            (f64::from(area) / 2.0, f64::from(on_map) / 2.0)
        })
    };
    let (area, on_map) = sizes().fold((0.0, 0.0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    let thin = sizes().filter(|one| one.1 * area < THINNEST * one.0 * on_map).map(|one| one.0);
    area > 0.0 && (on_map < SMALLEST || thin.sum::<f64>() > f64::from(UvOverlap::TOLERANCE) * area)
}

/// Measures until so large a part of the whole map is owned twice.
fn measure_until(triangles: &MeshTriangles, size: u32, enough: f32) -> UvOverlap {
    if triangles.uvs.is_empty() {
        return UvOverlap::default();
    }
    let size = size.max(1);
    let all = triangles.uvs.iter().flatten();
    let (low, high) =
        all.fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), &uv| (low.min(uv), high.max(uv)));
    let tile = ((low + high) / 2.0).floor();
    let texel = 1.0 / size as f32;
    let outside = (low - tile).min_element() < -texel || (high - tile).max_element() > 1.0 + texel;
    if outside && enough.is_finite() {
        return UvOverlap { outside, overlapping: 0.0 };
    }

    let side = size as i32;
    let mut owners = vec![0u8; size as usize * size as usize];
    let (mut covered, mut twice) = (0u32, 0u32);
    for uvs in &triangles.uvs {
        // Far from zero an f32 has no digits left for parts of a texel.
        let texels = Footprint::new(uvs.map(|uv| (uv - tile) * size as f32));
        let (low, high) = texels.bounds();
        if (high - low).max_element() > size as f32 + 1.0 {
            return UvOverlap { outside, overlapping: 1.0 };
        }
        for y in low.y.floor() as i32..=high.y.floor() as i32 {
            for x in low.x.floor() as i32..=high.x.floor() as i32 {
                if texels.covers(Vec2::new(x as f32 + 0.5, y as f32 + 0.5)) {
                    let index = y.rem_euclid(side) as usize * size as usize + x.rem_euclid(side) as usize;
                    covered += u32::from(owners[index] == 0);
                    twice += u32::from(owners[index] == 1);
                    owners[index] = owners[index].saturating_add(1);
                }
            }
        }
        // No more than the whole map can be covered, so this is too much however it goes on.
        if twice as f32 > enough * owners.len() as f32 {
            break;
        }
    }
    UvOverlap { outside, overlapping: twice as f32 / covered.max(1) as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: u32 = 512;

    /// Rectangles of two triangles each, from their lower to their upper corners on the map.
    fn rectangles(all: &[(Vec2, Vec2)]) -> MeshTriangles {
        let uvs = all.iter().flat_map(|&(low, high)| {
            let (right, top) = (Vec2::new(high.x, low.y), Vec2::new(low.x, high.y));
            [[low, right, high], [low, high, top]]
        });
        let uvs: Vec<_> = uvs.collect();
        MeshTriangles {
            positions: uvs.iter().map(|uvs| uvs.map(|uv| uv.extend(0.0))).collect(),
            source: (0..uvs.len() as u32).collect(),
            uvs,
            report: default(),
        }
    }

    fn measure(all: &[(Vec2, Vec2)]) -> UvOverlap {
        measure_overlap(&rectangles(all), SIZE)
    }

    const ALL: (Vec2, Vec2) = (Vec2::ZERO, Vec2::ONE);

    fn shifted((low, high): (Vec2, Vec2), by: Vec2) -> (Vec2, Vec2) {
        (low + by, high + by)
    }

    #[test]
    fn a_square_does_not_lie_on_itself() {
        assert_eq!(measure(&[ALL]), UvOverlap { outside: false, overlapping: 0.0 });
        assert!(!measure(&[ALL]).needs_unwrap());
    }

    #[test]
    fn what_lies_twice_is_counted_by_its_texels() {
        let left = (Vec2::ZERO, Vec2::new(0.5, 1.0));
        let right = shifted(left, Vec2::X * 0.5);
        assert_eq!(measure(&[left, right]).overlapping, 0.0);
        assert_eq!(measure(&[left, left]).overlapping, 1.0);
        assert_eq!(measure(&[ALL, left]).overlapping, 0.5);
        // Three times is no more than twice.
        assert_eq!(measure(&[ALL, left, left]).overlapping, 0.5);
        assert!(measure(&[ALL, left]).needs_unwrap());
    }

    #[test]
    fn a_mirrored_half_lies_on_the_other() {
        let left = (Vec2::ZERO, Vec2::new(0.5, 1.0));
        let mut halves = rectangles(&[left, left]);
        halves.uvs[2..].iter_mut().flatten().for_each(|uv| uv.x = 0.5 - uv.x);
        assert!(measure_overlap(&halves, SIZE).overlapping > 0.99);
    }

    #[test]
    fn a_seam_is_forgiven_and_a_strip_is_not() {
        let overlapping_by = |texels: f32| {
            let from = 0.5 - texels / SIZE as f32;
            measure(&[(Vec2::ZERO, Vec2::new(0.5, 1.0)), (Vec2::new(from, 0.0), Vec2::ONE)])
        };
        assert!(overlapping_by(1.0).overlapping > 0.0 && !overlapping_by(1.0).needs_unwrap());
        assert!(overlapping_by(4.0).needs_unwrap());
    }

    #[test]
    fn another_unit_square_is_as_good_as_the_first() {
        for by in [Vec2::X, -Vec2::Y, Vec2::new(-7.0, 1000.0)] {
            assert_eq!(measure(&[shifted(ALL, by)]), UvOverlap::default(), "{by}");
        }
        assert!(measure(&[shifted(ALL, Vec2::X * 0.5)]).outside);
        let by_a_texel = |texels: f32| measure(&[(Vec2::ZERO, Vec2::new(1.0 + texels / SIZE as f32, 1.0))]);
        assert!(!by_a_texel(0.5).outside && by_a_texel(2.0).outside);
    }

    #[test]
    fn squares_of_different_tiles_lie_on_each_other_in_the_map() {
        let two = measure(&[ALL, shifted(ALL, Vec2::X)]);
        assert_eq!(two, UvOverlap { outside: true, overlapping: 1.0 });
        let quarter = (Vec2::ZERO, Vec2::splat(0.25));
        let beside = measure(&[quarter, shifted(quarter, Vec2::new(1.5, 0.0))]);
        assert_eq!(beside, UvOverlap { outside: true, overlapping: 0.0 });
    }

    #[test]
    fn tiled_uvs_cost_no_more_than_the_map() {
        let tiled = measure(&[(Vec2::ZERO, Vec2::splat(1.0e6))]);
        assert_eq!(tiled, UvOverlap { outside: true, overlapping: 1.0 });
    }

    #[test]
    fn what_is_seen_early_is_what_is_seen_in_the_end() {
        let half = (Vec2::ZERO, Vec2::new(0.5, 1.0));
        let sliver = (Vec2::ZERO, Vec2::new(0.004, 1.0));
        for all in [
            vec![ALL],
            vec![ALL, sliver],
            vec![half, shifted(half, Vec2::X * 0.5)],
            vec![ALL; 50],
            vec![half, half],
            vec![shifted(ALL, Vec2::X * 0.5)],
        ] {
            let triangles = rectangles(&all);
            let whole = measure_overlap(&triangles, SIZE).needs_unwrap();
            assert_eq!(shares_texels(&triangles, SIZE), whole, "{all:?}");
        }
    }

    #[test]
    fn faces_that_are_points_of_the_map_share_it() {
        let with = |uvs: [[Vec2; 3]; 2]| MeshTriangles { uvs: uvs.to_vec(), ..rectangles(&[ALL]) };
        let [low, high] = [0.1, 0.3].map(Vec2::splat);
        for uvs in
            [[[Vec2::ZERO; 3]; 2], [[low; 3], [high; 3]], [[Vec2::ZERO, Vec2::X, Vec2::ONE], [high; 3]]]
        {
            assert_eq!(measure_overlap(&with(uvs), SIZE).overlapping, 0.0, "{uvs:?}");
            assert!(shares_texels(&with(uvs), SIZE), "{uvs:?}");
        }
        assert!(shares_texels(&rectangles(&[(Vec2::ZERO, Vec2::splat(0.01))]), SIZE));
        // An island of an atlas is as good as the whole of it.
        assert!(!shares_texels(&rectangles(&[(low, high)]), SIZE));
    }

    #[test]
    fn a_small_face_without_texels_is_forgiven() {
        let mut speck = rectangles(&[ALL]);
        speck.positions.push([Vec3::ZERO, Vec3::X * 0.05, Vec3::Y * 0.05]);
        speck.uvs.push([Vec2::splat(0.5); 3]);
        assert!(!shares_texels(&speck, SIZE));
        speck.positions[2] = [Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 0.5];
        assert!(shares_texels(&speck, SIZE));
    }

    #[test]
    fn nothing_needs_nothing() {
        assert_eq!(measure(&[]), UvOverlap::default());
        assert!(!shares_texels(&rectangles(&[]), SIZE));
        assert!(!measure(&[(Vec2::ONE, Vec2::ONE)]).needs_unwrap());
    }
}
