//! The files and generated data a scenario is made of. Everything is loaded before the first tick.

use std::collections::BTreeMap;
use std::path::Path;

use bevy::asset::RenderAssetUsages;
use bevy::math::{Affine2, Affine3A};
use bevy::prelude::*;
use bevy::render::render_resource::Face;

use super::{
    LoadedScenario, MaterialSpec, MeshSpec, Scenario, ScenarioError, SurfaceSpec, SurfaceTextureSpec,
    TextureSpec,
};
use crate::collision::MeshTriangles;
use crate::effect::WeatherEffect;
use crate::input::read_file;
use crate::material::WettingTextures;
use crate::overlay::Weatherable;
use crate::picture::read_picture;
use crate::scenes::environment::{
    EnvironmentMaps, EnvironmentSettings, environment_maps_from_equirect, load_equirect,
};
use crate::scenes::gltf_mesh::read_first_primitive_mesh;
use crate::scenes::meshes::{self, MeshError};
use crate::scenes::mips::{MipContent, tiling_sampler, with_mips};
use crate::scenes::stone::stone_maps;
use crate::unwrap::{MapTrianglesError, map_triangles};

/// Name, triangles, where it stands, and its maps.
pub type SurfaceMesh = (String, MeshTriangles, Affine3A, Weatherable);

/// How much of the look of a scenario is loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Looks {
    /// Nothing, for runs that draw nothing.
    None,
    /// What surfaces look like when they are dry, for runs that draw nothing but are exported.
    Materials,
    /// All.
    All,
}

impl Looks {
    pub(super) fn drawn(is_drawn: bool) -> Self {
        if is_drawn { Self::All } else { Self::None }
    }
}

/// Everything but meshes from files, which Bevy's asset server loads.
pub(super) struct Content {
    /// In the order of the emitters.
    pub(super) effects: Vec<WeatherEffect>,
    /// In the order of the surfaces; `None` for files.
    pub(super) meshes: Vec<Option<Mesh>>,
    /// In the order of the materials; empty unless they are asked for.
    pub(super) materials: Vec<MaterialMaps>,
    /// Played wet maps, in the order of the surfaces; empty without a renderer.
    pub(super) wet_maps: Vec<Option<Image>>,
    /// `None` without a renderer.
    pub(super) environment: Option<EnvironmentMaps>,
}

/// The maps of a material.
#[derive(Default)]
pub(super) struct MaterialMaps {
    pub(super) albedo: Option<Image>,
    pub(super) normal: Option<Image>,
    pub(super) roughness: Option<Image>,
    pub(super) surface: Option<Image>,
    pub(super) wet_color: Option<Image>,
}

impl LoadedScenario {
    /// Loads and generates; of looks only what is asked for.
    pub(super) fn content(&self, looks: Looks) -> Result<Content, ScenarioError> {
        let scenario = &self.scenario;
        let effects = self.effects()?;
        let mut meshes = Vec::new();
        for (index, surface) in scenario.surfaces.iter().enumerate() {
            let mesh = generate(&surface.mesh);
            let unusable = |e| self.content_error(&format!("surfaces[{index}].mesh"), &surface.name, e);
            meshes.push(mesh.transpose().map_err(unusable)?);
        }
        let mut materials = Vec::new();
        let mut environment = None;
        let mut wet_maps = Vec::new();
        if looks == Looks::All {
            for (index, surface) in scenario.surfaces.iter().enumerate() {
                let field = format!("surfaces[{index}].wet_map.map");
                let map = surface.wet_map.as_ref().map(|map| self.photo(&field, &map.map, false));
                wet_maps.push(map.transpose()?);
            }
            if let Some(spec) = &scenario.environment {
                let path = self.resolve("environment.map", &spec.map)?;
                let unusable = |e| self.content_error("environment.map", &spec.map, e);
                let (width, height, pixels) = load_equirect(&path).map_err(unusable)?;
                let settings = EnvironmentSettings::default();
                environment =
                    Some(environment_maps_from_equirect(width, height, &pixels, settings).map_err(unusable)?);
            }
        }
        if looks != Looks::None {
            // Growing a stone takes a second; each has a thread.
            materials = std::thread::scope(|threads| {
                let growing: Vec<_> = scenario
                    .materials
                    .iter()
                    .map(|(name, material)| {
                        let field = format!("materials.{name}");
                        let maps = threads.spawn({
                            let field = field.clone();
                            move || self.material_maps(&field, material)
                        });
                        (field, name, maps)
                    })
                    .collect();
                growing
                    .into_iter()
                    .map(|(field, name, maps)| {
                        let crashed =
                            |_| Err(self.content_error(&field, name, "its textures could not be made"));
                        maps.join().unwrap_or_else(crashed)
                    })
                    .collect::<Result<Vec<_>, _>>()
            })?;
        }
        Ok(Content { effects, meshes, materials, wet_maps, environment })
    }

    /// The effects of all emitters, in their order.
    fn effects(&self) -> Result<Vec<WeatherEffect>, ScenarioError> {
        let mut effects = Vec::new();
        for (index, emitter) in self.scenario.emitters.iter().enumerate() {
            let field = format!("emitters[{index}].effect");
            let path = self.resolve(&field, &emitter.effect)?;
            let bytes = read_file(&path, WeatherEffect::MAX_FILE_BYTES)
                .map_err(|e| self.content_error(&field, &emitter.effect, e))?;
            let wrong = |e| self.content_error(&field, &emitter.effect, e);
            let mut effect = WeatherEffect::from_ron(&bytes).map_err(wrong)?;
            let mut files = BTreeMap::new();
            for file in effect.stamps.files() {
                let beside = Path::new(&emitter.effect).with_file_name(file);
                let path = self.resolve(&field, &beside.to_string_lossy())?;
                let bytes = read_file(&path, WeatherEffect::MAX_PICTURE_BYTES)
                    .map_err(|e| self.content_error(&field, file, e))?;
                files.insert(file.to_owned(), bytes);
            }
            effect.stamp_set = effect.stamps.read(&files).map_err(wrong)?;
            effects.push(effect);
        }
        Ok(effects)
    }

    /// Reads all that the scenario names, as a run would; what is generated is generated, but for stones. Returns the number
    /// of triangles of all surfaces. Needs no renderer.
    ///
    /// # Errors
    /// [`ScenarioError::Content`] for the first that cannot be used.
    pub fn check_content(&self) -> Result<u64, ScenarioError> {
        self.effects()?;
        let triangles = self.surface_meshes()?.iter().map(|(_, mesh, ..)| mesh.positions.len() as u64).sum();
        for (index, surface) in self.scenario.surfaces.iter().enumerate() {
            if let Some(map) = &surface.wet_map {
                self.photo(&format!("surfaces[{index}].wet_map.map"), &map.map, false)?;
            }
        }
        for (name, material) in &self.scenario.materials {
            let photo = match &material.texture {
                TextureSpec::Photo(file) => Some(("texture", file)),
                _ => None,
            };
            let surface = match &material.surface {
                SurfaceTextureSpec::File(file) => Some(("surface", file)),
                _ => None,
            };
            let wet_color = material.wet_color.as_ref().map(|file| ("wet_color", file));
            for (field, file) in [photo, surface, wet_color].into_iter().flatten() {
                self.photo(&format!("materials.{name}.{field}"), file, false)?;
            }
        }
        if let Some(spec) = &self.scenario.environment {
            let path = self.resolve("environment.map", &spec.map)?;
            let unusable = |e| self.content_error("environment.map", &spec.map, e);
            load_equirect(&path).map_err(unusable)?;
        }
        Ok(triangles)
    }

    /// The shape of every surface, for tools that need no app: name, triangles with the uvs that its maps lie over, where it
    /// stands, and its maps.
    ///
    /// # Errors
    /// [`ScenarioError::Content`] for meshes that cannot be used.
    pub fn surface_meshes(&self) -> Result<Vec<SurfaceMesh>, ScenarioError> {
        let one = |(index, surface): (usize, &SurfaceSpec)| {
            let field = format!("surfaces[{index}].mesh");
            let (value, mesh) = match (&surface.mesh, generate(&surface.mesh)) {
                (MeshSpec::File(file), _) => {
                    let path = self.resolve(&field, file)?;
                    let mesh = read_first_primitive_mesh(&path);
                    (file, mesh.map_err(|e| self.content_error(&field, file, e))?)
                }
                (_, Some(mesh)) => {
                    let mesh = mesh.map_err(|e| self.content_error(&field, &surface.name, e))?;
                    (&surface.name, mesh)
                }
                (_, None) => return Err(self.content_error(&field, &surface.name, "has no shape")),
            };
            let triangles = map_triangles(&mesh, &surface.maps).map_err(|error| match error {
                MapTrianglesError::Unwrap(error) => {
                    let field = format!("surfaces[{index}].maps.uv");
                    self.content_error(&field, "Unique", format!("{value}: {error}"))
                }
                error => self.content_error(&field, value, error),
            })?;
            Ok((surface.name.clone(), triangles, surface.transform().compute_affine(), surface.maps))
        };
        let own = self.scenario.surfaces.iter().enumerate().map(one);
        let mut meshes = own.collect::<Result<Vec<_>, ScenarioError>>()?;
        meshes.extend(self.scene_meshes()?);
        Ok(meshes)
    }

    fn material_maps(&self, field: &str, material: &MaterialSpec) -> Result<MaterialMaps, ScenarioError> {
        let mut maps = MaterialMaps::default();
        match &material.texture {
            TextureSpec::Plain => {}
            TextureSpec::Photo(photo) => {
                let mut albedo = self.photo(&format!("{field}.texture"), photo, true)?;
                // Whoever exports the scene wants to read it, as those that are generated can be read.
                albedo.asset_usage = RenderAssetUsages::default();
                maps.albedo = Some(albedo);
            }
            &TextureSpec::Stone { kind, size, seed } => {
                let stone = stone_maps(kind, size, seed);
                if material.surface == SurfaceTextureSpec::Relief {
                    maps.surface = Some(stone.surface_map());
                }
                maps.albedo = Some(stone.albedo);
                maps.normal = Some(stone.normal);
                maps.roughness = Some(stone.roughness);
            }
        }
        if let SurfaceTextureSpec::File(file) = &material.surface {
            maps.surface = Some(self.photo(&format!("{field}.surface"), file, false)?);
        }
        if let Some(file) = &material.wet_color {
            maps.wet_color = Some(self.photo(&format!("{field}.wet_color"), file, true)?);
        }
        Ok(maps)
    }

    /// A tiling texture from a `.png`.
    fn photo(&self, field: &str, file: &str, is_srgb: bool) -> Result<Image, ScenarioError> {
        let path = self.resolve(field, file)?;
        let picture = read_picture(&path, image::ImageFormat::Png, Scenario::MAX_TEXTURE);
        let picture = picture.map_err(|e| self.content_error(field, file, e))?;
        // Whatever it was: 16-bit and grey ones, as wet maps are, too.
        let image =
            Image::from_dynamic(picture.into_rgba8().into(), is_srgb, RenderAssetUsages::RENDER_WORLD);
        let mut image =
            with_mips(image, MipContent::Values).map_err(|e| self.content_error(field, file, e))?;
        image.sampler = tiling_sampler();
        Ok(image)
    }
}

fn generate(mesh: &MeshSpec) -> Option<Result<Mesh, MeshError>> {
    match *mesh {
        MeshSpec::Ground { size, cells } => Some(meshes::ground(size, cells)),
        MeshSpec::Sphere { radius, sectors, stacks } => Some(meshes::uv_sphere(radius, sectors, stacks)),
        MeshSpec::Vase { height, segments, rings } => Some(meshes::vase(height, segments, rings)),
        MeshSpec::Flowerpot { height, segments, rings } => Some(meshes::flowerpot(height, segments, rings)),
        MeshSpec::Rock { radius, sectors, stacks, seed } => Some(meshes::rock(radius, sectors, stacks, seed)),
        MeshSpec::Road { size, cells, seed } => Some(meshes::road(size, cells, seed)),
        MeshSpec::Cloth { size, cells } => Some(meshes::cloth(size, cells)),
        MeshSpec::BasRelief { size, depth, cells, seed } => {
            Some(meshes::bas_relief(size, depth, cells, seed))
        }
        MeshSpec::Stair { width, steps, rise, going, hollow, cells, seed } => {
            Some(meshes::stair(width, steps, rise, going, hollow, cells, seed))
        }
        MeshSpec::Roof { size, pitch_deg, tiles, cells } => Some(meshes::roof(size, pitch_deg, tiles, cells)),
        MeshSpec::Car { length, cells } => Some(meshes::car(length, cells)),
        MeshSpec::File(_) => None,
    }
}

impl MaterialMaps {
    /// The material with its maps, and what tells how it gets wet from place to place.
    pub(super) fn into_material(
        self,
        spec: &MaterialSpec,
        images: &mut Assets<Image>,
    ) -> (StandardMaterial, WettingTextures) {
        let mut add = |image: Option<Image>| image.map(|image| images.add(image));
        let textures = WettingTextures { surface: add(self.surface), wet_color: add(self.wet_color) };
        // Its red channel is the ambient occlusion.
        let roughness = add(self.roughness);
        let [red, green, blue] = spec.color;
        let material = StandardMaterial {
            base_color: Color::linear_rgb(red, green, blue),
            base_color_texture: add(self.albedo),
            normal_map_texture: add(self.normal),
            metallic_roughness_texture: roughness.clone(),
            occlusion_texture: roughness,
            perceptual_roughness: spec.roughness,
            reflectance: spec.reflectance,
            metallic: spec.metallic,
            uv_transform: Affine2::from_scale(spec.tiles),
            diffuse_transmission: spec.translucency,
            double_sided: spec.double_sided,
            cull_mode: (!spec.double_sided).then_some(Face::Back),
            ..default()
        };
        (material, textures)
    }
}

#[cfg(test)]
mod tests {
    use bevy::render::render_resource::TextureFormat;

    use super::*;
    use crate::wetmap::{GreyMap, write_map};

    #[test]
    fn wet_maps_are_read_as_they_are_written() {
        let folder = tempfile::tempdir().unwrap();
        let map = GreyMap::new(2, 2, vec![0.0, 0.25, 0.5, 1.0]).unwrap();
        write_map(&folder.path().join("map.png"), &map).unwrap();
        let scenario = r#"(
            seconds: 1.0,
            camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
            materials: {"plain": ()},
            surfaces: [(
                name: "ground",
                mesh: Ground(size: (1.0, 1.0), cells: (2, 2)),
                material: "plain",
                wet_map: (map: "map.png", seconds: 1.0),
            )],
        )"#;
        let file = folder.path().join("scene.ron");
        std::fs::write(&file, scenario).unwrap();
        let content = Scenario::load(&file).unwrap().content(Looks::All).unwrap();
        let image = content.wet_maps[0].as_ref().expect("there is a map");
        assert_eq!(image.texture_descriptor.format, TextureFormat::Rgba8Unorm);
        let texels = &image.data.as_ref().expect("it has texels")[..16];
        assert_eq!([0, 4, 8, 12].map(|at| texels[at]), [0, 64, 128, 255]);
    }
}
