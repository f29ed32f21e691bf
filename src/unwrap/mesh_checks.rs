//! What holds for every mesh that was unwrapped.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::morph::MorphAttributes;
use bevy::mesh::{Indices, MeshVertexAttribute, PrimitiveTopology, VertexAttributeValues, VertexFormat};

use super::*;
use crate::collision::MeshTriangles;
use crate::overlay::Footprint;

const SIZE: u32 = 128;
const LAYER: MeshVertexAttribute = MeshVertexAttribute::new("Layer", 774_102_533, VertexFormat::Uint8x2);

fn options(gutter: u32) -> UnwrapOptions {
    UnwrapOptions { map_size: SIZE, gutter, replace: true }
}

fn unwrap_it(mesh: &Mesh) -> Mesh {
    unwrapped(mesh, &options(2)).unwrap()
}

/// Every face over the whole map, as Bevy makes it.
fn cube() -> Mesh {
    Cuboid::new(1.0, 1.0, 1.0).into()
}

fn sphere() -> Mesh {
    Sphere::new(1.0).mesh().ico(5).unwrap()
}

/// Six faces that share eight vertices, with one of everything that a vertex can have.
fn rigged_cube() -> Mesh {
    let corner = |i: u32| [i & 1, i >> 1 & 1, i >> 2].map(|bit| bit as f32 - 0.5);
    let positions: Vec<[f32; 3]> = (0..8).map(corner).collect();
    let row = |i: u16, by: f32| [i as f32 * by, 1.0 - i as f32 * by, 0.25, 1.0];
    let four = |by: f32| (0..8).map(|i| row(i, by)).collect::<Vec<_>>();
    let normals: Vec<_> = positions.iter().map(|&p| Vec3::from_array(p).normalize().to_array()).collect();
    let joints = VertexAttributeValues::Uint16x4((0..8).map(|i| [i, i + 1, 7 - i, 300]).collect());
    let layers = VertexAttributeValues::Uint8x2((0..8).map(|i| [i, 255 - i]).collect());
    let faces: [[u16; 4]; 6] =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let indices = faces.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]).collect();
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, vec![[3.0f32, -2.0]; 8])
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_attribute(Mesh::ATTRIBUTE_TANGENT, four(0.1))
        .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, four(0.05))
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, four(0.02))
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_INDEX, joints)
        .with_inserted_attribute(LAYER, layers)
        .with_inserted_indices(Indices::U16(indices))
}

/// The values of an attribute for each corner of each triangle of a list.
fn by_corner(mesh: &Mesh, attribute: MeshVertexAttribute) -> VertexAttributeValues {
    mesh.clone().with_duplicated_vertices().attribute(attribute).unwrap().clone()
}

fn second_uvs(mesh: &Mesh) -> Vec<[Vec2; 3]> {
    let VertexAttributeValues::Float32x2(uvs) = by_corner(mesh, Mesh::ATTRIBUTE_UV_1) else {
        unreachable!("two floats");
    };
    uvs.chunks_exact(3).map(|uvs| [uvs[0], uvs[1], uvs[2]].map(Vec2::from_array)).collect()
}

/// A number for each triangle, the same for those that are joined by vertices.
fn islands(mesh: &Mesh) -> Vec<usize> {
    fn root(parents: &mut [usize], mut vertex: usize) -> usize {
        while parents[vertex] != vertex {
            parents[vertex] = parents[parents[vertex]];
            vertex = parents[vertex];
        }
        vertex
    }
    let corners: Vec<usize> = mesh.indices().unwrap().iter().collect();
    let mut parents: Vec<usize> = (0..mesh.count_vertices()).collect();
    for triangle in corners.chunks_exact(3) {
        let first = root(&mut parents, triangle[0]);
        for &other in &triangle[1..] {
            let other = root(&mut parents, other);
            parents[other] = first;
        }
    }
    corners.chunks_exact(3).map(|triangle| root(&mut parents, triangle[0])).collect()
}

/// Who covers the texels of a map with its second uvs.
fn owners(mesh: &Mesh, size: u32) -> Vec<Option<usize>> {
    let mut owners = vec![None; (size * size) as usize];
    for (uvs, island) in second_uvs(mesh).into_iter().zip(islands(mesh)) {
        let texels = Footprint::new(uvs.map(|uv| uv * size as f32));
        for index in 0..size * size {
            let (x, y) = (index % size, index / size);
            if texels.covers(Vec2::new(x as f32 + 0.5, y as f32 + 0.5)) {
                owners[index as usize] = Some(island);
            }
        }
    }
    owners
}

/// Whether texels of two islands have less than `gap` empty ones between them; the map tiles.
fn closer_than(gap: u32, owners: &[Option<usize>], size: u32) -> bool {
    let (side, reach) = (size as i32, gap as i32);
    (0..side * side).any(|index| {
        let Some(own) = owners[index as usize] else { return false };
        (-reach..=reach).any(|dy| {
            (-reach..=reach).any(|dx| {
                let (x, y) = ((index % side + dx).rem_euclid(side), (index / side + dy).rem_euclid(side));
                owners[(y * side + x) as usize].is_some_and(|other| other != own)
            })
        })
    })
}

/// Area on the map for an area of the mesh, for each triangle; negative where the map is a mirror image.
fn densities(mesh: &Mesh) -> Vec<f32> {
    let triangles = MeshTriangles::from_mesh(mesh).unwrap();
    assert_eq!(triangles.report.skipped(), 0);
    let areas = triangles.positions.iter().map(|[a, b, c]| (b - a).cross(c - a).length());
    second_uvs(mesh).iter().zip(areas).map(|([a, b, c], area)| (c - a).perp_dot(b - a) / area).collect()
}

#[test]
fn faces_that_lay_on_each_other_do_no_more() {
    assert!(measure_overlap(&MeshTriangles::from_mesh(&cube()).unwrap(), SIZE).needs_unwrap());
    for mesh in [cube(), sphere(), rigged_cube()] {
        let uvs = second_uvs(&unwrap_it(&mesh));
        assert!(uvs.iter().flatten().all(|uv| uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all()));
        let overlap = measure_overlap(&MeshTriangles { uvs, ..default() }, SIZE);
        assert!(!overlap.outside && overlap.overlapping < 0.001, "{overlap:?}");
    }
}

#[test]
fn every_corner_keeps_all_that_it_had() {
    use PrimitiveTopology::TriangleList;
    for mesh in [cube(), sphere(), rigged_cube()] {
        let cut = unwrap_it(&mesh);
        assert_eq!(cut.primitive_topology(), TriangleList);
        let mut compared = 0;
        for (attribute, _) in mesh.attributes() {
            assert!(by_corner(&mesh, *attribute) == by_corner(&cut, *attribute), "{}", attribute.name);
            compared += 1;
        }
        assert_eq!(cut.attributes().count(), compared + 1);
    }
    // Faces became charts of their own, so the eight vertices had to be split; no more than once for each face.
    let cut = unwrap_it(&rigged_cube());
    assert!((9..=24).contains(&cut.count_vertices()), "{}", cut.count_vertices());
    assert!(matches!(cut.indices(), Some(Indices::U16(indices)) if indices.len() == 36));
    assert!(cut.contains_attribute(LAYER) && cut.contains_attribute(Mesh::ATTRIBUTE_JOINT_INDEX));
}

#[test]
fn charts_keep_their_distance_on_the_map() {
    for mesh in [cube(), sphere()] {
        for gutter in [1, 2, 4] {
            let cut = unwrapped(&mesh, &options(gutter)).unwrap();
            let owners = owners(&cut, SIZE);
            let mut all = islands(&cut);
            all.sort_unstable();
            all.dedup();
            assert!(all.len() > 1, "{}", all.len());
            // All of them are seen, and on much of the map.
            assert!(all.iter().all(|island| owners.contains(&Some(*island))));
            assert!(owners.iter().flatten().count() > (SIZE * SIZE) as usize / 4);
            assert!(!closer_than(2 * gutter, &owners, SIZE), "gutter {gutter}");
            // The measure does see what is near.
            assert!(closer_than(SIZE / 4, &owners, SIZE));
        }
    }
}

#[test]
fn texels_stand_for_much_the_same_area_and_nothing_is_mirrored() {
    for (mesh, factor) in [(cube(), 1.01), (rigged_cube(), 1.01), (sphere(), 4.0)] {
        let all = densities(&unwrap_it(&mesh));
        let (least, most) = all.iter().fold((f32::MAX, f32::MIN), |(l, m), &d| (l.min(d), m.max(d)));
        assert!(least > 0.0 && most / least < factor, "{least} to {most}");
    }
}

#[test]
fn what_is_square_on_the_mesh_is_square_on_the_map() {
    let plank = unwrap_it(&Plane3d::new(Vec3::Y, Vec2::new(4.0, 1.0)).into());
    let all = second_uvs(&plank).concat();
    let (low, high) = all.iter().fold((Vec2::ONE, Vec2::ZERO), |(l, h), uv| (l.min(*uv), h.max(*uv)));
    let extent = high - low;
    let ratio = extent.max_element() / extent.min_element();
    assert!((ratio - 4.0).abs() < 0.02 && extent.max_element() > 0.9, "{extent}");
}

#[test]
fn the_same_mesh_gives_the_same_bytes() {
    for mesh in [cube(), sphere(), rigged_cube()] {
        let (one, two) = (unwrap_it(&mesh), unwrap_it(&mesh));
        assert_eq!(one.create_packed_vertex_buffer_data(), two.create_packed_vertex_buffer_data());
        assert_eq!(one.get_index_buffer_bytes(), two.get_index_buffer_bytes());
    }
}

#[test]
fn morph_targets_go_with_their_vertices() {
    let row = |i: usize| MorphAttributes::new(Vec3::splat(i as f32), Vec3::X * i as f32, Vec3::Y);
    let names = vec!["smile".to_owned(), "frown".to_owned()];
    let mut mesh = rigged_cube();
    mesh.set_morph_targets((0..16).map(row).collect());
    mesh.set_morph_target_names(names.clone());
    let cut = unwrap_it(&mesh);
    let (targets, vertices) = (cut.morph_targets().unwrap(), cut.count_vertices());
    assert_eq!((targets.len(), cut.morph_target_names()), (2 * vertices, Some(&names[..])));
    let (old, new) = (mesh.indices().unwrap().iter(), cut.indices().unwrap().iter());
    for (old, new) in old.zip(new) {
        assert_eq!((targets[new], targets[vertices + new]), (row(old), row(8 + old)));
    }
}

#[test]
fn strips_and_lists_without_indices_keep_their_triangles() {
    let step = |i: u16| [(i % 2) as f32, (i / 2) as f32, 0.1 * i as f32];
    let positions: Vec<[f32; 3]> = (0..8).map(step).collect();
    let uvs = vec![[0.5f32, 0.5]; 8];
    let mesh = |topology, indices: Option<Indices>| {
        let mesh = Mesh::new(topology, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions.clone())
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs.clone());
        match indices {
            Some(indices) => mesh.with_inserted_indices(indices),
            None => mesh,
        }
    };
    use PrimitiveTopology::{TriangleList, TriangleStrip};
    // Two vertices are left over.
    let list = mesh(TriangleList, None);
    for plain in [list, mesh(TriangleStrip, None), mesh(TriangleStrip, Some(Indices::U32((0..8).collect())))]
    {
        let cut = unwrap_it(&plain);
        let [old, new] = [&plain, &cut].map(|mesh| MeshTriangles::from_mesh(mesh).unwrap().positions);
        assert_eq!((cut.primitive_topology(), old), (TriangleList, new));
    }
    let two = mesh(TriangleStrip, Some(Indices::U16(vec![0, 1, 2, 3, u16::MAX, 4, 5, 6])));
    let normals: Vec<Vec3> = MeshTriangles::from_mesh(&unwrap_it(&two))
        .unwrap()
        .positions
        .iter()
        .map(|[a, b, c]| (b - a).cross(c - a))
        .collect();
    assert_eq!(normals.len(), 3);
    assert!(normals.iter().all(|normal| normal.z > 0.0), "{normals:?}");
}

#[test]
fn triangles_without_area_do_no_harm() {
    let mut mesh = rigged_cube();
    let Some(Indices::U16(indices)) = mesh.indices_mut() else { unreachable!("short") };
    indices.extend([0, 0, 1, 3, 3, 3]);
    let cut = unwrap_it(&mesh);
    assert!(by_corner(&mesh, Mesh::ATTRIBUTE_POSITION) == by_corner(&cut, Mesh::ATTRIBUTE_POSITION));
    let overlap = measure_overlap(&MeshTriangles { uvs: second_uvs(&cut), ..default() }, SIZE);
    assert!(!overlap.needs_unwrap(), "{overlap:?}");
}

#[test]
fn old_second_uvs_are_replaced_and_first_ones_not_needed() {
    let old = vec![[9.0f32, 9.0]; 8];
    let mesh = rigged_cube()
        .with_removed_attribute(Mesh::ATTRIBUTE_UV_0)
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_1, old);
    let cut = unwrap_it(&mesh);
    assert!(!cut.contains_attribute(Mesh::ATTRIBUTE_UV_0));
    assert_eq!(second_uvs(&cut), second_uvs(&unwrap_it(&rigged_cube())));
}

#[test]
fn what_cannot_be_unwrapped_says_why() {
    let error = |mesh: &Mesh| unwrapped(mesh, &options(2)).unwrap_err();
    let bare = |topology| Mesh::new(topology, RenderAssetUsages::default());
    let with = |mesh: Mesh, positions: Vec<[f32; 3]>| {
        mesh.with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
    };
    use PrimitiveTopology::{LineList, TriangleList};
    assert_eq!(error(&bare(TriangleList)), UnwrapError::NoPositions);
    assert_eq!(error(&with(bare(LineList), vec![[0.0; 3]; 2])), UnwrapError::Topology(LineList));
    assert_eq!(error(&with(bare(TriangleList), vec![])), UnwrapError::Empty);
    assert_eq!(error(&with(bare(TriangleList), vec![[1.0; 3]; 3])), UnwrapError::Empty);

    let nan = with(bare(TriangleList), vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, f32::NAN, 0.0]]);
    let beyond = rigged_cube().with_inserted_indices(Indices::U32(vec![0, 1, 99]));
    for bad in [nan, beyond] {
        assert!(matches!(error(&bad), UnwrapError::BadMesh(_)), "{}", error(&bad));
    }
    let short = rigged_cube().with_inserted_attribute(LAYER, VertexAttributeValues::Uint8x2(vec![[1, 2]; 7]));
    assert_eq!(error(&short), UnwrapError::AttributeLength { name: "Layer", found: 7, vertices: 8 });
    let morphs = rigged_cube().with_morph_targets(vec![MorphAttributes::default(); 9]);
    assert_eq!(error(&morphs), UnwrapError::MorphTargets { found: 9, vertices: 8 });
    let mut gone = cube();
    gone.take_gpu_data().unwrap();
    assert_eq!(error(&gone), UnwrapError::NotOnCpu);

    let on = |map_size, gutter| {
        unwrapped(&cube(), &UnwrapOptions { map_size, gutter, replace: true }).unwrap_err()
    };
    assert_eq!(on(16, 8), UnwrapError::MapTooSmall { map_size: 16, gutter: 8 });
    assert_eq!(on(16, 7), UnwrapError::DoesNotFit { charts: 6, map_size: 16 });
}
