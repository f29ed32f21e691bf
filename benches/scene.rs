//! The two scenes of the benches, for the library and for the baseline, and dunes of any fineness.
//!
//! Scene 1, [`Scene::One`]: a hose on a ball and a bunny on paving.
//!
//! | surface | triangles | where |
//! |---|---|---|
//! | ground, 6 m by 6 m | 1,584 | the origin |
//! | sphere, 0.32 m | 936 | left of the bunny |
//! | bunny, 1 m | 1,000 | in the middle |
//!
//! Scene 2, [`Scene::Two`]: rain on all of a yard.
//!
//! | surface | triangles | where |
//! |---|---|---|
//! | ground, 6 m by 6 m | 1,584 | the origin |
//! | bunny, 1 m | 5,648 | in the middle |
//! | vase, 0.9 m | 11,008 | left of the bunny |
//! | wall, 4 m by 2 m | 1,152 | behind them |
//!
//! Of both, only the triangle counts of Hoff's table are his: ground, sphere, bunny of 1,000, vase. Who stands where, the
//! wall, the finer bunny and the emitters are a reconstruction.
//!
//! The library gets meshes and transforms, the baseline the same triangles in world space.

use std::f32::consts::FRAC_PI_2;

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_weathering::collision::MeshTriangles;
use bevy_weathering::effect::WeatherEffect;
use bevy_weathering::emitter::{Emitter, EmitterShape, Flow};
use bevy_weathering::overlay::{Weatherable, Wrap};
use bevy_weathering::scenes::meshes;

use crate::glb;
use crate::hoff::{HoffReject, HoffSystem};

/// Ticks per second; the library's default.
pub const HZ: u32 = 60;

/// m/s², the library's default.
pub const GRAVITY: Vec3 = Vec3::new(0.0, -9.81, 0.0);

/// Seconds until a particle that hit nothing is retired.
pub const LIFETIME: f32 = 3.0;

/// A mesh, where it stands, and the maps it gets.
pub type Placed = (Mesh, Vec3, Weatherable);

/// What is hit, and by what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scene {
    /// A hose on a ball and a bunny: 3,520 triangles.
    #[default]
    One,
    /// Rain on a bunny, a vase and a wall: 19,392 triangles.
    Two,
}

impl Scene {
    /// Its surfaces.
    pub fn surfaces(self) -> Vec<Placed> {
        let maps = |map_size, wrap_u| Weatherable { map_size, wrap_u, wrap_v: Wrap::Clamp, ..default() };
        let ground = meshes::ground(Vec2::splat(6.0), UVec2::new(24, 33)).expect("sizes are positive");
        let ground = (ground, Vec3::ZERO, maps(1024, Wrap::Clamp));
        match self {
            Self::One => {
                let sphere = meshes::uv_sphere(0.32, 26, 19).expect("sizes are positive");
                vec![
                    ground,
                    (sphere, Vec3::new(-0.95, 0.32, 0.15), maps(512, Wrap::Repeat)),
                    (glb::mesh(glb::BUNNY_1000), Vec3::new(0.2, 0.0, 0.0), maps(1024, Wrap::Clamp)),
                ]
            }
            Self::Two => {
                let vase = meshes::vase(0.9, 64, 86).expect("there are enough rings");
                let wall = meshes::ground(Vec2::new(4.0, 2.0), UVec2::splat(24)).expect("sizes are positive");
                // What faced up faces the others.
                let wall = wall.rotated_by(Quat::from_rotation_x(FRAC_PI_2));
                vec![
                    ground,
                    (glb::mesh(glb::BUNNY), Vec3::new(0.4, 0.0, 0.0), maps(512, Wrap::Clamp)),
                    (vase, Vec3::new(-0.9, 0.0, 0.1), maps(512, Wrap::Repeat)),
                    (wall, Vec3::new(0.0, 1.0, -1.2), maps(512, Wrap::Clamp)),
                ]
            }
        }
    }

    /// The surfaces for the baseline.
    pub fn hoff(self, reject: HoffReject) -> HoffSystem {
        let (objects, uvs): (Vec<_>, Vec<_>) = self
            .surfaces()
            .into_iter()
            .map(|(mesh, at, _)| {
                let mut triangles =
                    MeshTriangles::from_mesh(&mesh).expect("the meshes have triangles and uvs");
                triangles.positions.iter_mut().flatten().for_each(|corner| *corner += at);
                (triangles.positions, triangles.uvs)
            })
            .unzip();
        let mut system = HoffSystem::new(&objects, &uvs, reject);
        system.lifetime = LIFETIME;
        system
    }

    /// What falls or flies.
    pub fn effect(self) -> WeatherEffect {
        match self {
            Self::One => water(),
            Self::Two => {
                let rain = include_bytes!("../assets/effects/rain.effect.ron");
                WeatherEffect::from_ron(rain).expect("the effect is valid")
            }
        }
    }

    /// What sends it out, and where that stands. Sends out nothing at a rate of 0.
    pub fn emitter(self, effect: Handle<WeatherEffect>, rate: f32) -> (Emitter, Transform) {
        match self {
            Self::One => hose(effect, rate),
            // As fast as drops of 2.3 mm fall; said here, since a scene without drag has no such speed.
            Self::Two => sky(effect, rate, 4.0, 7.0),
        }
    }
}

/// What comes out of the hose.
pub fn water() -> WeatherEffect {
    WeatherEffect::from_ron(include_bytes!("../assets/effects/hose.effect.ron")).expect("the effect is valid")
}

/// What comes out of the hose, litres a minute: a garden hose. The more particles, the smaller each.
const HOSE_FLOW: Flow = Flow::LitresPerMinute(20.0);

fn hose(effect: Handle<WeatherEffect>, rate: f32) -> (Emitter, Transform) {
    let emitter = Emitter {
        effect,
        rate,
        flow: HOSE_FLOW,
        shape: EmitterShape::Cone { radius: 0.008 },
        speed: 8.8,
        spread: 4.0_f32.to_radians(),
        lifetime: LIFETIME,
        enabled: rate > 0.0,
        ..default()
    };
    let at = Transform::from_xyz(2.2, 1.0, 2.4).looking_at(Vec3::new(-0.25, 0.9, 0.1), Vec3::Y);
    (emitter, at)
}

/// Rain from `height`, m, at `speed`, m/s, on the 6 m by 6 m around the origin, but for a margin.
pub fn sky(effect: Handle<WeatherEffect>, rate: f32, height: f32, speed: f32) -> (Emitter, Transform) {
    let emitter = Emitter {
        effect,
        rate,
        shape: EmitterShape::Sky { half_size: Vec2::splat(2.95) },
        speed,
        lifetime: LIFETIME,
        enabled: rate > 0.0,
        ..default()
    };
    (emitter, Transform::from_xyz(0.0, height, 0.0))
}

/// Height of the dunes, m: broad ones, 0.15 m, with ripples on them.
pub fn dune_height(x: f32, z: f32) -> f32 {
    0.15 * (2.1 * x + 0.3).sin() * (1.7 * z).cos() + 0.03 * (19.0 * x).sin() * (23.0 * z).sin()
}

/// Dunes from `low`, of `size` along x and z, m; two triangles to a cell. Without normals and tangents, which cost more than
/// all the rest of millions of triangles and which nothing here reads.
pub fn dunes(low: Vec2, size: Vec2, cells: UVec2) -> Mesh {
    let count = ((cells.x + 1) * (cells.y + 1)) as usize;
    let (mut positions, mut uvs) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for row in 0..=cells.y {
        for column in 0..=cells.x {
            let uv = Vec2::new(column as f32, row as f32) / cells.as_vec2();
            let at = low + uv * size;
            positions.push([at.x, dune_height(at.x, at.y), at.y]);
            uvs.push(uv.to_array());
        }
    }
    let mut indices = Vec::with_capacity(6 * (cells.x * cells.y) as usize);
    for row in 0..cells.y {
        for column in 0..cells.x {
            let a = row * (cells.x + 1) + column;
            let (b, c, d) = (a + 1, a + cells.x + 1, a + cells.x + 2);
            indices.extend([a, c, b, b, c, d]);
        }
    }
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs)
        .with_inserted_indices(Indices::U32(indices))
}

/// Even numbers without a crate: the generator of Numerical Recipes, its upper bits.
pub struct Random(u32);

impl Random {
    /// The same numbers every time.
    pub fn new() -> Self {
        Self(1)
    }

    /// In [-1, 1).
    pub fn signed(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    /// In the cube [-1, 1)³.
    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
}
