//! Texels that the filter of a sampler reaches from a triangle, though nobody owns them.
//!
//! Between the middles of four texels a sampler mixes all four. So from a triangle it reads every texel whose middle lies less than a
//! texel, along u and along v, from one of its points. Rings around owned texels do not find all of them: the tip of a thin
//! triangle covers no middle, however far it reaches, and beside it another island may be nearer.
//!
//! Not here: triangles larger than the map, and what lies beyond a clamped edge.

use bevy::math::{DVec2, Vec2};

use super::adjacency::{is_collapsed, weld_distance};
use super::finder::Finder;
use super::ownership::{NOBODY, Outline};
use super::walk::Place;

/// Squares of distances, in texels, that may differ by rounding alone.
const ALIKE: f64 = 1e-4;

/// A texel that is reached, and from where.
pub(super) struct Touched {
    pub(super) texel: u32,
    /// The point closest to its middle on the map, of all triangles that reach it.
    pub(super) place: Place,
    /// The way from there to the middle, in texels.
    pub(super) away: DVec2,
}

/// All texels that nobody owns and some triangle reaches, ascending. `is_beside`: whether a triangle is of the island next to which a
/// texel is known to lie; of several that are as close that is preferred, and then the first one.
pub(super) fn touched(finder: &Finder, is_beside: impl Fn(u32, u32) -> bool) -> Vec<Touched> {
    let (grid, surface) = (finder.grid, finder.surface);
    let weld_distance = weld_distance(&surface.space);
    let mut numbers = vec![NOBODY; grid.texels()];
    let mut found: Vec<Touched> = Vec::new();
    for (triangle, (corners, space)) in (0u32..).zip(surface.map.iter().zip(&surface.space)) {
        let outline = Outline::of(*corners);
        if outline.is_larger_than(grid.size) || is_collapsed(space, weld_distance) {
            continue;
        }
        let (low, high) = (outline.low - 1.5, outline.high + 0.5);
        for row in low.y.floor() as i32..=high.y.ceil() as i32 {
            for column in low.x.floor() as i32..=high.x.ceil() as i32 {
                if !grid.holds(column, row) {
                    continue;
                }
                let texel = grid.texel(column, row);
                let middle = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                if finder.owners.of(texel).is_some() || !outline.reaches(middle) {
                    continue;
                }
                let [second, third] = outline.closest_weights(middle).map(f64::from);
                let place = Place { triangle, weights: [1.0 - second - third, second, third] };
                let touched = Touched { texel, place, away: middle.as_dvec2() - surface.on_map(&place) };
                let number = &mut numbers[texel as usize];
                if *number == NOBODY {
                    *number = found.len() as u32;
                    found.push(touched);
                } else if is_better(&touched, &found[*number as usize], &is_beside) {
                    found[*number as usize] = touched;
                }
            }
        }
    }
    found.sort_unstable_by_key(|touched| touched.texel);
    found
}

/// Whether a triangle is to stand for a texel rather than another one.
fn is_better(touched: &Touched, before: &Touched, is_beside: impl Fn(u32, u32) -> bool) -> bool {
    let further = touched.away.length_squared() - before.away.length_squared();
    let is_beside = |of: &Touched| is_beside(of.texel, of.place.triangle);
    further < -ALIKE || (further < ALIKE && !is_beside(before) && is_beside(touched))
}

#[cfg(test)]
mod tests {
    use super::super::geometry::TexelGeometry;
    use super::super::test_meshes::{floor, joined, sheet};
    use crate::collision::MeshTriangles;
    use crate::overlay::{SurfaceFrames, Wrap};
    use bevy::math::{Affine3A, IVec3, Vec2, Vec3};

    const SIZE: u32 = 64;
    const WRAP: [Wrap; 2] = [Wrap::Clamp; 2];

    /// A triangle with these corners on the map, in texels; it lies on the floor as it lies there, a texel wide to the
    /// centimetre.
    fn island(corners: [[f32; 2]; 3]) -> MeshTriangles {
        let corners = corners.map(Vec2::from_array);
        MeshTriangles {
            positions: vec![corners.map(|at| floor(at) * 0.01)],
            uvs: vec![corners.map(|at| at / SIZE as f32)],
            source: vec![0],
            ..MeshTriangles::default()
        }
    }

    /// That all which is mixed into the first triangles of a mesh, so many, belongs to them, and lies where it does. Returns how many
    /// texels that nobody owns have a part in them.
    fn check(mesh: &MeshTriangles, count: u32) -> usize {
        let geometry = TexelGeometry::new(mesh, &Affine3A::IDENTITY, Vec3::Y, SIZE, WRAP);
        let frames = SurfaceFrames::new(mesh, SIZE, WRAP);
        let all = || mesh.positions.iter().flatten();
        let low = all().fold(Vec3::INFINITY, |low, &at| low.min(at));
        let extent = (all().fold(Vec3::NEG_INFINITY, |high, &at| high.max(at)) - low).max_element();
        let mut beside = Vec::new();
        let steps = 200;
        for (triangle, second, third) in (0..count as usize).flat_map(|triangle| {
            let parts =
                (0..=steps).flat_map(move |second| (0..=steps - second).map(move |third| (second, third)));
            parts.map(move |(second, third)| (triangle, second, third))
        }) {
            let [to_b, to_c] = [second, third].map(|part| part as f32 / steps as f32);
            let [a, b, c] = mesh.uvs[triangle].map(|uv| uv * SIZE as f32);
            let at = a + (b - a) * to_b + (c - a) * to_c;
            let first = (at - 0.5).floor();
            for (columns, rows) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                let cell = first + Vec2::new(columns, rows);
                let away = (cell + 0.5 - at).abs();
                if away.max_element() > 0.999 {
                    continue;
                }
                let texel = cell.y as u32 * SIZE + cell.x as u32;
                let [a, b, c] = mesh.positions[triangle];
                let here = a + (b - a) * to_b + (c - a) * to_c;
                let place = frames.texels()[texel as usize].place().expect("what is mixed in is painted");
                let place = low + IVec3::from_array(place).as_vec3() * (extent / 65_535.0);
                assert!(place.distance(here) < 0.02, "{texel}: {place} {here}");
                if geometry.owner(texel).is_none() {
                    let shown = geometry.gutter_source(texel).and_then(|source| geometry.owner(source));
                    let hit = geometry.stand_in(texel).and_then(|other| geometry.owner(other));
                    let is_own = |owner: Option<u32>| owner.is_some_and(|owner| owner < count);
                    assert!(is_own(shown) && is_own(hit), "{texel}: {shown:?} {hit:?}");
                    beside.push(texel);
                }
            }
        }
        beside.sort_unstable();
        beside.dedup();
        beside.len()
    }

    #[test]
    fn all_that_is_mixed_into_a_thin_tip_is_the_tips() {
        // It covers middles up to column 33, in one row, and ends in column 49.
        let thin = || island([[10.0, 20.6], [50.0, 20.9], [10.0, 22.4]]);
        assert!(check(&thin(), 1) > 40);
        // It covers none at all.
        let needle = || island([[10.1, 40.6], [30.1, 40.8], [20.0, 40.9]]);
        assert!(check(&needle(), 1) > 35);
        // Two rows beside the tip of the one, and all of the other, begins an island that lies elsewhere in space.
        for (one, corner) in [(thin(), Vec2::new(36.0, 23.0)), (needle(), Vec2::new(8.0, 43.0))] {
            let on_map = move |point: Vec2| (corner + point * Vec2::new(24.0, 15.0)) / SIZE as f32;
            let other = sheet(2, |point| floor(point) * 0.2 + Vec3::X * 2.0, on_map);
            assert!(check(&joined([one, other]), 1) > 35);
        }
    }

    #[test]
    fn a_needle_has_the_texel_in_the_middle_of_its_box_wherever_its_own_middle_is() {
        // That is four columns off, and neither covers the middle of a texel.
        assert!(check(&island([[10.1, 40.6], [30.1, 40.8], [10.6, 40.75]]), 1) > 35);
        // The second triangle has none, since it has the same box as the first.
        let on_map = |point: Vec2| Vec2::new(10.1 + 20.0 * point.x, 50.6 + 0.1 * point.x + 0.2 * point.y);
        let strip = sheet(1, |point| floor(on_map(point)) * 0.01, |point| on_map(point) / SIZE as f32);
        assert!(check(&strip, 2) > 35);
    }
}
