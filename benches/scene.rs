//! Scene 1, for the library and for the baseline: a hose on a ball and a bunny on paving.
//!
//! | surface | triangles | where |
//! |---|---|---|
//! | ground, 6 m by 6 m | 1,584 | the origin |
//! | sphere, 0.32 m | 936 | left of the bunny |
//! | bunny, 1 m | 1,000 | in the middle |
//!
//! The library gets meshes and transforms, the baseline the same triangles in world space.

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
pub fn surfaces() -> [(Mesh, Vec3, Weatherable); 3] {
    let maps = |map_size, wrap_u| Weatherable { map_size, wrap_u, wrap_v: Wrap::Clamp, ..default() };
    let ground = meshes::ground(Vec2::splat(6.0), UVec2::new(24, 33)).expect("sizes are positive");
    let sphere = meshes::uv_sphere(0.32, 26, 19).expect("sizes are positive");
    [
        (ground, Vec3::ZERO, maps(1024, Wrap::Clamp)),
        (sphere, Vec3::new(-0.95, 0.32, 0.15), maps(512, Wrap::Repeat)),
        (glb::mesh(glb::BUNNY_1000), Vec3::new(0.2, 0.0, 0.0), maps(1024, Wrap::Clamp)),
    ]
}

/// The surfaces for the baseline.
pub fn hoff(reject: HoffReject) -> HoffSystem {
    let (objects, uvs): (Vec<_>, Vec<_>) = surfaces()
        .into_iter()
        .map(|(mesh, at, _)| {
            let mut triangles = MeshTriangles::from_mesh(&mesh).expect("the meshes have triangles and uvs");
            triangles.positions.iter_mut().flatten().for_each(|corner| *corner += at);
            (triangles.positions, triangles.uvs)
        })
        .unzip();
    let mut system = HoffSystem::new(&objects, &uvs, reject);
    system.lifetime = LIFETIME;
    system
}

/// What comes out of the hose.
pub fn water() -> WeatherEffect {
    WeatherEffect::from_ron(include_bytes!("../assets/effects/hose.effect.ron")).expect("the effect is valid")
}

/// What comes out of the hose, litres a minute: a garden hose. The more particles, the smaller each.
const HOSE_FLOW: f32 = 20.0;

/// The hose, and where it stands. Sends out nothing at a rate of 0.
pub fn hose(effect: Handle<WeatherEffect>, rate: f32) -> (Emitter, Transform) {
    let emitter = Emitter {
        effect,
        rate,
        flow: Flow::LitresPerMinute(HOSE_FLOW),
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
