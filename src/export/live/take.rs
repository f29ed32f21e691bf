//! Reading the surfaces of a world.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bevy::math::Affine3A;
use bevy::prelude::*;
use serde_json::{Value, json};

use super::material::Looks;
use super::mesh::LiveMesh;
use super::{Shown, Snapshot, SurfaceColors};
use crate::clock::WeatheringClock;
use crate::collision::{ColliderReport, DeformingCollider, TriangleError, UvSet};
use crate::emitter::EmissionSeed;
use crate::export::bake::MAX_MAP_TEXELS;
use crate::export::soaked::Soaked;
use crate::export::{ExportError, ExportReport};
use crate::material::{DryMaterial, Flood, PorousMaterial, StandingWater};
use crate::matter::{MatterLook, SurfaceMatter};
use crate::overlay::{CpuMaps, MapLoss, MapSize, SurfaceTotals, Weatherable};
use crate::particle::ParticleCounts;
use crate::replay::{ParticleReport, SurfaceMaps, water_of};
use crate::save::ColorMaps;
use crate::scenario::ScenarioSurface;
use crate::weather::{DryingClock, Weather};
use crate::wetting::{Exposure, Now, SurfaceWater, WetGeometry};

/// What is read of a surface.
type Item = (
    (Entity, &'static Weatherable, &'static Mesh3d, &'static GlobalTransform),
    (Option<&'static Name>, Option<&'static ScenarioSurface>, Option<&'static UvSet>),
    (
        Option<&'static DryMaterial>,
        Option<&'static MeshMaterial3d<StandardMaterial>>,
        Option<&'static StandingWater>,
    ),
    (Option<&'static MapSize>, Option<&'static SurfaceWater>, Option<&'static WetGeometry>),
    (
        Option<&'static SurfaceMatter>,
        Option<&'static MapLoss>,
        Option<&'static Exposure>,
        Option<&'static PorousMaterial>,
    ),
    (Option<&'static CpuMaps>, Option<&'static SurfaceTotals>, Option<&'static ColliderReport>),
    Option<&'static DeformingCollider>,
);

/// Meshes that several surfaces show are there once.
#[derive(Default)]
struct Meshes {
    numbers: BTreeMap<(AssetId<Mesh>, usize, bool), usize>,
    all: Vec<LiveMesh>,
}

impl Snapshot {
    /// Reads all surfaces of a world. `name`: what errors and the report call the scene. `colors`: colour maps that were read
    /// back from the GPU; without a renderer none are needed.
    ///
    /// Those of a scenario come in its order, before others. Surfaces without maps come along dry.
    ///
    /// # Errors
    /// [`ExportError::NoSurface`] if there are none, or no plugins that wet them; [`ExportError::Surface`] for a mesh,
    /// [`ExportError::Look`] for a material or a place that cannot be written, [`ExportError::TooMany`] texels of maps.
    pub fn take(world: &mut World, name: &str, colors: &SurfaceColors) -> Result<Self, ExportError> {
        let path = PathBuf::from(name);
        let mut surfaces = world.query::<Item>();
        let world: &World = world;
        // Before anything is copied.
        let texels: u64 = surfaces.iter(world).map(|(.., (size, ..), _, _, _)| texels(size)).sum();
        if texels > MAX_MAP_TEXELS {
            let what = "texels of maps";
            return Err(ExportError::TooMany { path, what, value: texels, max: MAX_MAP_TEXELS });
        }
        let mut items: Vec<_> = surfaces.iter(world).collect();
        items.sort_by_key(|((entity, ..), (_, scenario, _), ..)| {
            (scenario.map_or(u32::MAX, |surface| surface.index), *entity)
        });
        if items.is_empty() || !is_simulated(world) {
            return Err(ExportError::NoSurface { path });
        }
        let clock = *world.resource::<WeatheringClock>();
        let (mut looks, mut meshes) = (Looks::default(), Meshes::default());
        let (mut shown, mut without) = (Vec::<Shown>::new(), Vec::new());
        for item in items {
            let ((entity, settings, mesh, transform), (given, _, set), ..) = item;
            let (_, _, (dry, standard, standing), (size, water, geometry), ..) = item;
            let (.., (matter, loss, exposure, porous), (cpu, totals, collider), deforming) = item;
            let name = given.map_or_else(|| format!("surface_{entity}"), ToString::to_string);
            let look_error = |reason| ExportError::Look { path: path.clone(), surface: name.clone(), reason };
            let set = match set.copied().unwrap_or_default() {
                UvSet::First => 0,
                UvSet::Second => 1,
            };
            // One that has just been given is the newer.
            let dry = standard.map(|standard| &standard.0).or_else(|| dry.map(|dry| &dry.0));
            let material = looks.add(world, dry, has_tangents(world, mesh)).map_err(look_error)?;
            let uv_sets = looks.uv_sets(material).max(set + 1);
            // Vertex colours of a flood are how high it stands.
            let paint = standing.is_some_and(|standing| standing.flood != Flood::None);
            let placed = meshes.place(world, mesh, uv_sets, paint, transform.affine(), deforming);
            let (mesh, node) = match placed {
                Ok(placed) => placed,
                Err(Unplaced::Mesh(source)) => {
                    return Err(ExportError::Surface { path, surface: name, source });
                }
                Err(Unplaced::Transform) => {
                    return Err(look_error("stands nowhere: its transform is not finite".into()));
                }
            };
            let porous = porous.copied().unwrap_or_default();
            let loss = loss.copied().unwrap_or_default();
            let state = match (size, water, geometry) {
                (Some(size), Some(water), Some(geometry)) => {
                    let drying = world.resource::<DryingClock>();
                    let now = Now::new(clock.tick(), clock.hz(), drying, &geometry.0, exposure, &porous);
                    let nothing = SurfaceMatter::default();
                    let matter = matter.unwrap_or(&nothing);
                    let mut maps =
                        SurfaceMaps::new(name.clone(), size.texels(), water, matter, loss, cpu, &now);
                    if cpu.is_none() {
                        paint_over(&mut maps, colors.of(entity));
                    }
                    let triangles = collider.map_or(0, |collider| collider.0.total);
                    let soaked = Soaked::new(&maps, &now, totals.copied().unwrap_or_default(), triangles);
                    Some((soaked, maps))
                }
                _ => {
                    without.push(SurfaceMaps::none(name.clone(), settings, loss, clock.hz()));
                    None
                }
            };
            shown.push(Shown { name, mesh, material, node, set, porous, state });
        }
        let with = shown.iter().filter_map(|shown| shown.state.as_ref().map(|(_, maps)| maps));
        let report = ExportReport {
            scene: Path::new(name).file_name().unwrap_or_default().to_string_lossy().into_owned(),
            seed: world.get_resource::<EmissionSeed>().map_or(0, |seed| seed.0),
            rain_mm_per_h: None,
            wind: world.get_resource::<Weather>().copied().unwrap_or_default().wind.to_array(),
            ticks: clock.tick(),
            seconds: clock.seconds(),
            particles: ParticleReport::from(*world.resource::<ParticleCounts>()),
            water: water_of(world, with.chain(&without)),
            surfaces: Vec::new(),
        };
        let matter = world.get_resource::<MatterLook>().copied().unwrap_or_default();
        Ok(Self { path, looks, meshes: meshes.all, surfaces: shown, matter, report })
    }
}

/// Whether there are the plugins that wet surfaces.
fn is_simulated(world: &World) -> bool {
    world.contains_resource::<WeatheringClock>()
        && world.contains_resource::<DryingClock>()
        && world.contains_resource::<ParticleCounts>()
}

fn texels(size: Option<&MapSize>) -> u64 {
    size.map_or(0, |size| u64::from(size.texels()).pow(2))
}

/// Whether what a surface shows has tangents. In a pose it has too, though none are written.
fn has_tangents(world: &World, handle: &Mesh3d) -> bool {
    let mesh = world.get_resource::<Assets<Mesh>>().and_then(|meshes| meshes.get(&handle.0));
    mesh.is_some_and(|mesh| mesh.try_contains_attribute(Mesh::ATTRIBUTE_TANGENT).unwrap_or(false))
}

/// Colour maps that came from the GPU; without them, nothing has been painted.
fn paint_over(maps: &mut SurfaceMaps, colors: Option<&ColorMaps>) {
    let length = maps.size.pow(2) as usize * 4;
    let of = |map: fn(&ColorMaps) -> &Vec<u8>| {
        let painted = colors.map(map).filter(|painted| painted.len() == length);
        painted.cloned().unwrap_or_else(|| vec![0; length])
    };
    maps.diffuse = of(|colors| &colors.diffuse);
    maps.specular = of(|colors| &colors.specular);
    maps.normal = of(|colors| &colors.normal);
}

/// Why a mesh stands nowhere.
enum Unplaced {
    Mesh(TriangleError),
    Transform,
}

impl From<TriangleError> for Unplaced {
    fn from(error: TriangleError) -> Self {
        Self::Mesh(error)
    }
}

impl Meshes {
    /// The number of what a surface shows, and the fields of a node that put it where it is.
    fn place(
        &mut self,
        world: &World,
        handle: &Mesh3d,
        uv_sets: usize,
        paint: bool,
        world_from_mesh: Affine3A,
        deforming: Option<&DeformingCollider>,
    ) -> Result<(usize, Value), Unplaced> {
        let meshes = world.get_resource::<Assets<Mesh>>();
        let mesh = meshes.and_then(|meshes| meshes.get(&handle.0)).ok_or(TriangleError::NotLoaded)?;
        let posed = deforming.and_then(DeformingCollider::posed);
        let in_world = posed.is_some_and(|posed| posed.is_in_world());
        let world_from_mesh = if in_world { Affine3A::IDENTITY } else { world_from_mesh };
        if !world_from_mesh.is_finite() {
            return Err(Unplaced::Transform);
        }
        let node = node(&world_from_mesh);
        if posed.is_none()
            && let Some(node) = &node
        {
            let key = (handle.0.id(), uv_sets, paint);
            let number = match self.numbers.get(&key) {
                Some(&number) => number,
                None => {
                    let number = self.push(LiveMesh::new(mesh, uv_sets, paint)?);
                    self.numbers.insert(key, number);
                    number
                }
            };
            return Ok((number, node.clone()));
        }
        // Of its own: nobody else has this pose.
        let mut own = LiveMesh::new(mesh, uv_sets, paint)?;
        if let Some(posed) = posed {
            own = own.posed(posed.positions());
        }
        if node.is_none() {
            own = own.moved(&world_from_mesh);
        }
        Ok((self.push(own), node.unwrap_or_else(|| json!({}))))
    }

    fn push(&mut self, mesh: LiveMesh) -> usize {
        self.all.push(mesh);
        self.all.len() - 1
    }
}

/// The fields of a node that moves its mesh like this; `None` if none can: nodes do not shear or flatten.
fn node(by: &Affine3A) -> Option<Value> {
    if by.matrix3.determinant() == 0.0 {
        return None;
    }
    let (scale, rotation, translation) = by.to_scale_rotation_translation();
    let rotation = rotation.normalize();
    let again = Affine3A::from_scale_rotation_translation(scale, rotation, translation);
    let tolerance = 1e-5 * scale.abs().max_element();
    let is_it = rotation.is_finite() && again.matrix3.abs_diff_eq(by.matrix3, tolerance);
    is_it.then(|| {
        json!({
            "translation": translation.to_array(), "rotation": rotation.to_array(), "scale": scale.to_array(),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_do_all_but_shear_and_flatten() {
        let turned = Affine3A::from_scale_rotation_translation(
            Vec3::new(2.0, -3.0, 0.5),
            Quat::from_rotation_y(0.7),
            Vec3::new(1.0, 2.0, 3.0),
        );
        let fields = node(&turned).unwrap();
        let numbers = |name: &str| -> Vec<f32> {
            fields[name].as_array().unwrap().iter().map(|part| part.as_f64().unwrap() as f32).collect()
        };
        let [s, r, t] = ["scale", "rotation", "translation"].map(numbers);
        let again = Affine3A::from_scale_rotation_translation(
            Vec3::from_slice(&s),
            Quat::from_slice(&r),
            Vec3::from_slice(&t),
        );
        assert!(again.abs_diff_eq(turned, 1e-5), "{again:?}");
        let sheared = Affine3A::from_mat3(Mat3::from_cols(Vec3::X, Vec3::ONE, Vec3::Z));
        assert!(node(&sheared).is_none());
        assert!(node(&Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0))).is_none());
    }

    #[test]
    fn colours_that_do_not_fit_are_none() {
        let water = SurfaceWater::of_size(16, Weatherable::default().wrap(), 1.0);
        let mut maps = SurfaceMaps::none("wall".into(), &Weatherable::default(), MapLoss::default(), 60);
        (maps.size, maps.water) = (16, water);
        let whole = vec![7; 16 * 16 * 4];
        let colors = ColorMaps { diffuse: whole.clone(), specular: vec![7], normal: vec![] };
        paint_over(&mut maps, Some(&colors));
        let nothing = vec![0; whole.len()];
        assert_eq!((maps.diffuse, maps.specular, maps.normal), (whole, nothing.clone(), nothing));
    }
}
