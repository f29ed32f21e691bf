//! Marks and water go on over the borders of uv islands: along all seams of the bunny, both sides show the same.

use std::collections::BTreeMap;

use bevy::asset::RenderAssetUsages;
use bevy::math::Affine3A;
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use bevy_weathering::collision::MeshTriangles;
use bevy_weathering::effect::{Paint, StampSource};
use bevy_weathering::overlay::{CpuMaps, StampSpace, SurfaceFrames};
use bevy_weathering::prelude::*;
use bevy_weathering::scenes::gltf_mesh::read_first_primitive;
use bevy_weathering::stamps::StampKind;
use bevy_weathering::wetting::{WetGeometry, surface_points};

use crate::wetting::scene::Scene;

/// Texels along each side of the bunny's maps.
pub const SIZE: u32 = 512;

/// The middle of the bunny.
pub const MIDDLE: Vec3 = Vec3::new(0.0, 0.45, 0.0);

/// Where what is thrown at it comes from.
const SIDES: [Vec3; 5] = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::Z, Vec3::NEG_Z];

/// The bunny of 5,648 triangles.
pub fn bunny() -> MeshTriangles {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/bunny.glb");
    read_first_primitive(&file).unwrap()
}

/// Its positions and texture coordinates, three vertices for each triangle.
pub fn mesh_of(triangles: &MeshTriangles) -> Mesh {
    let positions: Vec<[f32; 3]> = triangles.positions.iter().flatten().map(|at| at.to_array()).collect();
    let uvs: Vec<[f32; 2]> = triangles.uvs.iter().flatten().map(|uv| uv.to_array()).collect();
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs)
}

/// The bunny's diffuse map after mud has been thrown at it from all sides.
fn muddy(stamps: StampSpace, kind: StampSource) -> CpuMaps {
    let mut scene = Scene::new(60);
    let world = scene.0.world_mut();
    let effect = WeatherEffect {
        stamps: kind,
        stamp_radius: Some(0.05),
        gravity_scale: 0.0,
        terminal_speed: Some(0.0),
        diffuse: Paint { color: [0.2, 0.5, 0.9], opacity: 1.0 },
        ..default()
    };
    let effect = world.resource_mut::<Assets<WeatherEffect>>().add(effect.with_stamps().unwrap());
    throw(world, &SIDES, MIDDLE, &effect, 60.0);
    let surface = scene.surface(mesh_of(&bunny()), SIZE, PorousMaterial::default(), Transform::default());
    scene.0.world_mut().get_mut::<Weatherable>(surface).unwrap().stamps = stamps;
    // The effect is asked for in the first tick; then the frames are measured.
    scene.run(1);
    if stamps == StampSpace::Surface {
        scene.wait_for::<SurfaceFrames>(surface);
    }
    scene.run(240);
    scene.0.world().get::<CpuMaps>(surface).unwrap().clone()
}

/// So many particles a second from each of these sides, at what stands around this place.
pub fn throw(world: &mut World, sides: &[Vec3], at: Vec3, effect: &Handle<WeatherEffect>, rate: f32) {
    for (stream, &from) in sides.iter().enumerate() {
        let place = Transform::from_translation(at + from * 2.0);
        let up = if from.y == 0.0 { Vec3::Y } else { Vec3::X };
        let emitter = Emitter {
            effect: effect.clone(),
            rate,
            shape: EmitterShape::Disc { radius: 0.5 },
            speed: 10.0,
            stream: stream as u32,
            ..default()
        };
        world.spawn((emitter, place.looking_at(at, up)));
    }
}

/// Coverage at a uv, between texels; 0..=255.
fn coverage(maps: &CpuMaps, uv: Vec2) -> f32 {
    let at = uv * SIZE as f32 - 0.5;
    let (corner, part) = (at.floor().as_ivec2(), at - at.floor());
    let texel = |x: i32, y: i32| {
        let inside = |along: i32| along.clamp(0, SIZE as i32 - 1) as usize;
        f32::from(maps.diffuse[inside(corner.y + y) * SIZE as usize + inside(corner.x + x)][3])
    };
    let row = |y: i32| texel(0, y) + (texel(1, y) - texel(0, y)) * part.x;
    row(0) + (row(1) - row(0)) * part.y
}

/// An edge of a triangle.
pub struct Border {
    /// The triangle.
    pub triangle: usize,
    /// Its ends.
    on_map: [Vec2; 2],
    /// The same in space.
    pub in_space: [Vec3; 2],
    /// The triangle's other corner on the map.
    third: Vec2,
}

/// Edges that two triangles share in space, as each of both has them: from the same end to the same end.
pub fn edges(triangles: &MeshTriangles) -> Vec<[Border; 2]> {
    let mut edges: BTreeMap<[[u32; 3]; 2], Vec<Border>> = BTreeMap::new();
    for (triangle, (corners, uvs)) in triangles.positions.iter().zip(&triangles.uvs).enumerate() {
        for (from, to, third) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
            let bits = |corner: usize| (corners[corner] + Vec3::ZERO).to_array().map(f32::to_bits);
            let (from, to) = if bits(from) > bits(to) { (to, from) } else { (from, to) };
            let ends = [bits(from), bits(to)];
            let (on_map, in_space) = ([uvs[from], uvs[to]], [corners[from], corners[to]]);
            edges.entry(ends).or_default().push(Border { triangle, on_map, in_space, third: uvs[third] });
        }
    }
    edges.into_values().filter_map(|sides| <[_; 2]>::try_from(sides).ok()).collect()
}

/// Whether its two triangles do not share it on the map.
pub fn is_seam([a, b]: &[Border; 2]) -> bool {
    a.on_map != b.on_map
}

fn seams(triangles: &MeshTriangles) -> Vec<[Border; 2]> {
    edges(triangles).into_iter().filter(is_seam).collect()
}

/// Mean difference of coverage over all seams, and the part of their points with a difference that can be seen.
fn across_seams(maps: &CpuMaps) -> (f32, f32, usize) {
    let triangles = bunny();
    let (mut sum, mut seen, mut count, mut covered) = (0.0, 0, 0, 0);
    for sides in seams(&triangles) {
        for step in 0..8 {
            let part = (step as f32 + 0.5) / 8.0;
            let [a, b] = [0, 1].map(|side: usize| {
                let [from, to] = sides[side].on_map;
                coverage(maps, from.lerp(to, part))
            });
            sum += (a - b).abs();
            seen += usize::from((a - b).abs() > 64.0);
            covered += usize::from(a.max(b) > 32.0);
            count += 1;
        }
    }
    (sum / count as f32, seen as f32 / count as f32, covered)
}

#[test]
fn the_bunny_shows_no_seam() {
    // Fingers of a splat are as wide as the texels, of 3 mm, and have sharp rims.
    for (kind, most, most_seen) in
        [(StampSource::Dome, 5.0, 0.02), (StampSource::Kind(StampKind::Splat), 14.0, 0.04)]
    {
        let (mean, seen, covered) = across_seams(&muddy(StampSpace::Surface, kind.clone()));
        println!("{kind:?} in space: mean {mean}, seen {seen}, {covered} points covered");
        assert!(covered > 500, "{covered}");
        assert!(mean < most && seen < most_seen, "{kind:?}: mean {mean}, seen {seen}");
        // On the map a stamp ends at every border.
        let (mean_on_map, seen_on_map, _) = across_seams(&muddy(StampSpace::Map, kind.clone()));
        println!("{kind:?} on the map: mean {mean_on_map}, seen {seen_on_map}");
        assert!(mean_on_map > 4.0 * mean && seen_on_map > 0.1, "{mean_on_map} {seen_on_map}");
    }
}

#[test]
fn the_bunny_is_as_wet_on_one_side_of_a_seam_as_on_the_other() {
    let mut scene = Scene::new(60);
    let effect = WeatherEffect {
        volume_mm3: 50.0,
        stamp_radius: Some(0.05),
        gravity_scale: 0.0,
        terminal_speed: Some(0.0),
        ..default()
    };
    let world = scene.0.world_mut();
    let effect = world.resource_mut::<Assets<WeatherEffect>>().add(effect);
    throw(world, &SIDES, MIDDLE, &effect, 200.0);
    // Takes up nothing, and lets nothing run.
    let glazed = PorousMaterial { capacity_mm: 0.0, retained_mm: 1000.0, ..default() };
    let surface = scene.surface(mesh_of(&bunny()), SIZE, glazed, Transform::default());
    scene.run(240);
    let (water, geometry) = (scene.water(surface), scene.0.world().get::<WetGeometry>(surface).unwrap());
    let held: u64 = water.texels().iter().map(|texel| texel.total()).sum();
    let ledger = water.ledger();
    assert_eq!(ledger.received, held + ledger.dripped + ledger.spilled);
    let triangles = bunny();
    let mut places = vec![None; (SIZE * SIZE) as usize];
    for point in surface_points(&triangles, &Affine3A::IDENTITY, SIZE, [Wrap::Clamp; 2]) {
        places[point.texel as usize] = Some(point.position);
    }
    // Mean depth around a place of the map, mm, of texels that lie near a point in space, too: none are of another island.
    let depth_mm = |uv: Vec2, near: Vec3| {
        let middle = (uv * SIZE as f32).floor().as_ivec2();
        let (mut units, mut area_mm2) = (0, 0.0);
        for row in middle.y - 2..=middle.y + 2 {
            for column in middle.x - 2..=middle.x + 2 {
                if !(0..SIZE as i32).contains(&row) || !(0..SIZE as i32).contains(&column) {
                    continue;
                }
                let texel = (row * SIZE as i32 + column) as usize;
                if places[texel].is_some_and(|place: Vec3| place.distance(near) < 0.012) {
                    units += water.texels()[texel].total();
                    area_mm2 += f64::from(geometry.0.area_mm2()[texel]);
                }
            }
        }
        (area_mm2 > 0.0).then(|| water.units().mm3(units) / area_mm2)
    };
    let (mut differences, mut depths) = (Vec::new(), 0.0);
    for sides in seams(&triangles) {
        for step in 0..8 {
            let part = (step as f32 + 0.5) / 8.0;
            let depths_of = [0, 1].map(|side: usize| {
                let Border { on_map: [from, to], in_space: [start, end], third, .. } = sides[side];
                let at = from.lerp(to, part);
                // A texel and a half inside.
                let inside = at + (third - at).clamp_length_max(1.5 / SIZE as f32);
                depth_mm(inside, start.lerp(end, part))
            });
            if let [Some(a), Some(b)] = depths_of {
                differences.push((a - b).abs());
                depths += a + b;
            }
        }
    }
    let count = differences.len() as f64;
    let depth = depths / (2.0 * count);
    let mean = differences.iter().sum::<f64>() / count / depth;
    let seen = differences.iter().filter(|&&difference| difference > 0.6 * depth).count() as f64 / count;
    println!("{count} points, {depth} mm: mean difference {mean}, seen {seen}");
    assert!(count > 1000.0 && depth > 0.0, "{count} {depth}");
    // Even stamps laid in space differ by 0.17: the places compared are two texels inside on either side. Stamps that end at every
    // border differ by 1.1.
    assert!(mean < 0.35 && seen < 0.15, "mean {mean}, seen {seen}");
}
