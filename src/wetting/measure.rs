//! Measures a mesh for water: at rest, and in another pose.

use std::sync::Arc;

use bevy::math::{Affine3A, DVec2, Vec2, Vec3};

use super::finder::Finder;
use super::geometry::{STAND_IN, TexelGeometry, TexelLayout};
use super::grid::Grid;
use super::gutters::Gutters;
use super::islands::{Islands, number_triangles};
use super::links::Links;
use super::ownership::Ownership;
use super::points::front_normals;
use super::slopes::Slopes;
use super::walk::Surface;
use crate::collision::MeshTriangles;
use crate::overlay::{TexelAreas, Wrap};

impl TexelGeometry {
    /// Measures a mesh that stands in the world by `world_from_mesh`, for a map of `size` x `size` texels.
    /// `up` is where water comes from, of any length above 0.
    pub fn new(
        triangles: &MeshTriangles,
        world_from_mesh: &Affine3A,
        up: Vec3,
        size: u32,
        wrap: [Wrap; 2],
    ) -> Self {
        let up = up.normalize_or(Vec3::Y);
        let grid = Grid { size, wrap };
        let areas = TexelAreas::new(triangles, world_from_mesh, size, wrap);
        let surface = Surface::new(triangles, world_from_mesh, grid);
        let owners = Ownership::new(triangles, grid);
        let finder = Finder::new(grid, &surface, &owners);
        let (of_triangle, count) = number_triangles(&finder);
        let (links, mut gutters) = (Links::new(&finder), Gutters::new(&finder, &of_triangle));
        let stand_ins = gutters.take_stand_ins();
        let islands = Islands::new(&finder, of_triangle, count, &stand_ins);
        let above_origin =
            |texel: u32| finder.place(texel).map(|place| surface.in_space(&place).dot(up.as_dvec3()) as f32);
        let heights = (0..grid.texels() as u32).map(above_origin);
        let normals = front_normals(triangles, world_from_mesh);
        let mean_length = positive_or(areas.mean_mm2.sqrt() * 1e-3, 1e-3);
        let lengths = (0..surface.map.len() as u32).map(|triangle| {
            [DVec2::X, DVec2::Y].map(|step| {
                let length = surface.step_in_space(triangle, step).map_or(0.0, |step| step.length() as f32);
                positive_or(length, mean_length)
            })
        });
        let facing = normals.iter().map(|normal| normal.dot(up));
        let slopes = Slopes::new(heights, &owners.triangle, facing, lengths.collect());
        let mut owner = owners.triangle;
        for (number, stand_in) in (0u32..).zip(&stand_ins) {
            owner[stand_in.texel as usize] = STAND_IN | number;
        }
        let stand_ins =
            stand_ins.iter().map(|stand_in| [stand_in.other, islands.of(stand_in.triangle)]).collect();
        let layout = TexelLayout {
            size,
            area_mm2: areas.mm2,
            mean_mm2: areas.mean_mm2,
            gutter_tiles: gutters.tiles(size),
            links,
            gutters,
            mean_length,
            owner,
            stand_ins,
            islands,
        };
        Self { layout: Arc::new(layout), slopes }
    }

    /// The same surface in another pose: heights, slopes and distances are those of `corners`, the triangles of the same
    /// mesh in world space, in the same order; `mirrored` if a mirror has brought them there. Areas, links and owners stay
    /// what they are at rest.
    pub fn posed(&self, uvs: &[[Vec2; 3]], corners: &[[Vec3; 3]], mirrored: bool, up: Vec3) -> Self {
        let (layout, up) = (self.layout.clone(), up.normalize_or(Vec3::Y));
        let front = if mirrored { -up } else { up };
        // Far from the origin of the world, few digits would be left for a texel.
        let origin = corners.first().map_or(Vec3::ZERO, |corners| corners[0]);
        let heights = (0..layout.owner.len() as u32).map(|texel| {
            let owner = self.owner(texel)? as usize;
            let ([a, b, c], [to_b, to_c]) = (*corners.get(owner)?, self.weights(texel, uvs.get(owner)?));
            Some(up.dot((a - origin) + (b - a) * to_b + (c - a) * to_c))
        });
        let facing = corners.iter().map(|[a, b, c]| (b - a).cross(c - a).normalize_or_zero().dot(front));
        let lengths = corners.iter().zip(uvs).map(|(&corners, &uvs)| {
            texel_lengths(corners, uvs, layout.size).map(|length| positive_or(length, layout.mean_length))
        });
        let slopes = Slopes::new(heights, &layout.owner, facing, lengths.collect());
        Self { layout, slopes }
    }
}

/// Length of a texel along u and v on a triangle, metres; 0 or not a number if it has none.
fn texel_lengths([a, b, c]: [Vec3; 3], [uv_a, uv_b, uv_c]: [Vec2; 3], size: u32) -> [f32; 2] {
    let (uv_ab, uv_ac) = ((uv_b - uv_a) * size as f32, (uv_c - uv_a) * size as f32);
    let area = uv_ab.perp_dot(uv_ac);
    let length = |along_b: f32, along_c: f32| ((b - a) * along_b - (c - a) * along_c).length() / area.abs();
    [length(uv_ac.y, uv_ab.y), length(uv_ac.x, uv_ab.x)]
}

/// A length if it is one, else `other`.
fn positive_or(length: f32, other: f32) -> f32 {
    if length.is_finite() && length > 0.0 { length } else { other }
}
