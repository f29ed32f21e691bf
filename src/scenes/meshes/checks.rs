//! What holds for every mesh, and what the tests of single meshes share.

use bevy::math::UVec2;
use bevy::mesh::VertexAttributeValues;

use super::*;
use crate::collision::MeshTriangles;
use crate::unwrap::{measure_overlap, shares_texels};

/// A mesh as lists.
pub(super) struct Parts {
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) triangles: Vec<[usize; 3]>,
}

pub(super) fn parts(mesh: &Mesh) -> Parts {
    let vec3 = |attribute| match mesh.attribute(attribute) {
        Some(VertexAttributeValues::Float32x3(values)) => values.iter().map(|&v| v.into()).collect(),
        other => panic!("{other:?}"),
    };
    let Some(VertexAttributeValues::Float32x2(uvs)) = mesh.attribute(Mesh::ATTRIBUTE_UV_0) else {
        panic!("no uvs")
    };
    let indices: Vec<usize> = mesh.indices().expect("indexed").iter().collect();
    Parts {
        positions: vec3(Mesh::ATTRIBUTE_POSITION),
        normals: vec3(Mesh::ATTRIBUTE_NORMAL),
        uvs: uvs.iter().map(|&v| v.into()).collect(),
        triangles: indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    }
}

/// Open sheets: name, mesh, triangles.
fn sheets() -> [(&'static str, Mesh, usize); 3] {
    [
        ("ground", ground(Vec2::new(3.0, 4.0), UVec2::new(24, 33)).expect("valid"), 1584),
        ("road", road(Vec2::new(6.0, 4.0), UVec2::new(48, 40), 1).expect("valid"), 3840),
        ("cloth", cloth(Vec2::new(1.2, 1.6), UVec2::new(64, 40)).expect("valid"), 5120),
    ]
}

/// Surfaces that close around the y axis: name, mesh, triangles.
fn rounds() -> [(&'static str, Mesh, usize); 4] {
    [
        ("sphere", uv_sphere(0.4, 26, 19).expect("valid"), 936),
        ("rock", rock(0.4, 32, 24, 1).expect("valid"), 1472),
        ("vase", vase(1.0, 64, 86).expect("valid"), 11_008),
        ("flowerpot", flowerpot(0.3, 64, 86).expect("valid"), 11_008),
    ]
}

/// Bodies of several faces: name, mesh, triangles.
fn bodies() -> [(&'static str, Mesh, usize); 3] {
    let relief = bas_relief(Vec2::new(0.9, 1.2), 0.05, UVec2::new(96, 128), 1);
    [
        ("bas-relief", relief.expect("valid"), 29_952),
        ("stair", stair(1.8, 5, 0.16, 0.32, 0.009, UVec2::new(96, 24), 1).expect("valid"), 43_678),
        ("roof", roof(Vec2::new(2.4, 1.2), 30.0, UVec2::new(12, 4), 10).expect("valid"), 23_248),
    ]
}

fn presets() -> impl Iterator<Item = (&'static str, Mesh, usize)> {
    sheets().into_iter().chain(rounds()).chain(bodies())
}

#[test]
fn every_mesh_has_its_triangles_and_all_of_them_face_outwards() {
    for (name, mesh, triangles) in presets() {
        let parts = parts(&mesh);
        assert_eq!(parts.triangles.len(), triangles, "{name}");
        for triangle in &parts.triangles {
            let [a, b, c] = triangle.map(|i| parts.positions[i]);
            let cross = (b - a).cross(c - a);
            assert!(cross.length() / 2.0 > 1e-12, "{name} {triangle:?} is degenerate");
            for &i in triangle {
                assert!(cross.normalize().dot(parts.normals[i]) > 0.5, "{name} {triangle:?}");
            }
        }
    }
}

#[test]
fn sheets_face_up_or_forwards_and_the_rest_away_from_the_middle() {
    for ((name, mesh, _), front) in sheets().into_iter().zip([Vec3::Y, Vec3::Y, Vec3::Z]) {
        assert!(parts(&mesh).normals.iter().all(|normal| normal.dot(front) > 0.7), "{name}");
    }
    for (name, mesh, _) in rounds() {
        // The volume inside is positive if the triangles face away from it.
        let parts = parts(&mesh);
        let corners = parts.triangles.iter().map(|triangle| triangle.map(|i| parts.positions[i]));
        let volume: f32 = corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
        assert!(volume > 1e-3, "{name}: {volume}");
    }
}

#[test]
fn attributes_are_complete_and_in_range() {
    for (name, mesh, _) in presets() {
        let parts = parts(&mesh);
        let Some(VertexAttributeValues::Float32x4(tangents)) = mesh.attribute(Mesh::ATTRIBUTE_TANGENT) else {
            panic!("{name}: no tangents")
        };
        assert_eq!(tangents.len(), parts.positions.len(), "{name}");
        for (i, normal) in parts.normals.iter().enumerate() {
            assert!((normal.length() - 1.0).abs() < 1e-5, "{name} {i}: {normal}");
            let [x, y, z, sign] = tangents[i];
            let tangent = Vec3::new(x, y, z);
            assert!((tangent.length() - 1.0).abs() < 1e-4, "{name} {i}: {tangent}");
            assert!(tangent.dot(*normal).abs() < 1e-3 && sign.abs() == 1.0, "{name} {i}");
            let uv = parts.uvs[i];
            assert!(uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all(), "{name} {i}: {uv}");
        }
    }
}

#[test]
fn textures_are_not_mirrored() {
    for (name, mesh, _) in presets() {
        let parts = parts(&mesh);
        for triangle in &parts.triangles {
            let [a, b, c] = triangle.map(|i| parts.uvs[i]);
            // Counter-clockwise outside is clockwise in an image whose rows go down.
            assert!((b - a).perp_dot(c - a) < 0.0, "{name} {triangle:?}");
        }
    }
}

#[test]
fn maps_lie_over_the_uvs_that_they_have() {
    let car = ("car", car(3.0, 24).expect("valid"), 0);
    for (name, mesh, _) in presets().chain([car]) {
        let triangles = MeshTriangles::from_mesh(&mesh).expect("they can be hit");
        assert!(!shares_texels(&triangles, 512), "{name}: {:?}", measure_overlap(&triangles, 512));
    }
}

#[test]
fn the_seam_is_closed() {
    for (name, mesh, _) in rounds() {
        let parts = parts(&mesh);
        let column = |u: f32| -> Vec<(Vec3, Vec3)> {
            let vertices = parts.positions.iter().zip(&parts.normals).zip(&parts.uvs);
            vertices.filter(|(_, uv)| uv.x == u).map(|((at, normal), _)| (*at, *normal)).collect()
        };
        assert!(column(0.0).len() >= 18, "{name}");
        assert_eq!(column(0.0), column(1.0), "{name}");
    }
}

#[test]
fn the_smallest_shapes_have_area() {
    let smallest = [
        (ground(Vec2::ONE, UVec2::ONE), 2),
        (road(Vec2::ONE, UVec2::ONE, 0), 2),
        (cloth(Vec2::ONE, UVec2::ONE), 2),
        (uv_sphere(1.0, 3, 2), 6),
        (rock(1.0, 3, 2, 0), 6),
        (vase(0.01, 3, 24), 144),
        (flowerpot(0.01, 3, 40), 240),
    ];
    for (mesh, triangles) in smallest {
        let parts = parts(&mesh.expect("valid"));
        assert_eq!(parts.triangles.len(), triangles);
        for triangle in &parts.triangles {
            let [a, b, c] = triangle.map(|i| parts.positions[i]);
            assert!((b - a).cross(c - a).length() / 2.0 > 1e-12, "{triangle:?}");
        }
    }
}

#[test]
fn bad_arguments_are_errors() {
    let not_positive = |result| matches!(result, Err(MeshError::NotPositive { .. }));
    assert!(not_positive(ground(Vec2::new(1.0, f32::NAN), UVec2::ONE)));
    assert!(not_positive(road(Vec2::new(-1.0, 1.0), UVec2::ONE, 0)));
    assert!(not_positive(cloth(Vec2::new(1.0, 0.0), UVec2::ONE)));
    assert!(not_positive(uv_sphere(-1.0, 26, 19)));
    assert!(not_positive(rock(f32::NAN, 26, 19, 0)));
    assert!(not_positive(vase(f32::INFINITY, 64, 86)));
    assert!(not_positive(flowerpot(0.0, 64, 86)));
    let too_few = |result| matches!(result, Err(MeshError::TooFew { .. }));
    assert!(too_few(ground(Vec2::ONE, UVec2::new(0, 1))));
    assert!(too_few(road(Vec2::ONE, UVec2::new(1, 0), 0)));
    assert!(too_few(cloth(Vec2::ONE, UVec2::ZERO)));
    assert!(too_few(rock(1.0, 2, 19, 0)));
    assert!(too_few(vase(1.0, 64, 4)));
    assert!(too_few(flowerpot(1.0, 64, 39)));
    let too_many = |result| matches!(result, Err(MeshError::TooMany { .. }));
    assert!(too_many(ground(Vec2::ONE, UVec2::MAX)));
    assert!(too_many(road(Vec2::ONE, UVec2::MAX, 0)));
    assert!(too_many(cloth(Vec2::ONE, UVec2::MAX)));
    assert!(too_many(rock(1.0, u32::MAX, u32::MAX, 0)));
    assert!(too_many(flowerpot(1.0, u32::MAX, u32::MAX)));
}
