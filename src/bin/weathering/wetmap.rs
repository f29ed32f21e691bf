//! `weathering wetmap`.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bevy::math::{Affine3A, Vec2, Vec3};
use bevy::prelude::Entity;
use bevy_weathering::collision::{CollisionScene, MeshBvh, MeshTriangles};
use bevy_weathering::overlay::{Weatherable, Wrap};
use bevy_weathering::scenario::Scenario;
use bevy_weathering::scenes::gltf_mesh::{NamedMesh, read_meshes};
use bevy_weathering::wetmap::{
    DropsOptions, ExposureOptions, GreyMap, PerlinOptions, PhotoOptions, RainSource, check_map_name, drops,
    exposure, perlin, read_map, read_photo, wet_mask, write_map,
};
use bevy_weathering::wetting::surface_points;
use clap::{Args, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};

#[derive(Subcommand, Debug)]
pub enum WetMapCommand {
    /// From two photographs of one surface, dry and wet: splats that dry from their rims
    FromPhoto(FromPhotoArgs),
    /// From noise: a soaked surface that dries unevenly
    Perlin(PerlinArgs),
    /// From rays towards the rain: what is sheltered and what is not
    Exposure(ExposureArgs),
    /// The first drops of a shower: points and short lines
    Drops(DropsArgs),
}

#[derive(Args, Debug)]
pub struct FromPhotoArgs {
    /// The dry surface, .png or linear .exr
    pub dry: PathBuf,
    /// The wet surface, from the same place and of the same size
    pub wet: PathBuf,
    /// The map, .png or .exr
    #[arg(long)]
    pub out: PathBuf,
    /// How far a spot falls from its middle to its rim, 0 to 1
    #[arg(long, default_value_t = PhotoOptions::default().gradient, allow_negative_numbers = true)]
    pub gradient: f32,
    /// Spots of fewer pixels are noise
    #[arg(long, default_value_t = PhotoOptions::default().min_area, allow_negative_numbers = true)]
    pub min_area: u32,
    /// Holes of up to this many pixels are filled
    #[arg(long, default_value_t = PhotoOptions::default().max_hole, allow_negative_numbers = true)]
    pub max_hole: u32,
    /// Wet over dry, linear, below which a pixel is wet [default: found by itself]
    #[arg(long, allow_negative_numbers = true)]
    pub threshold: Option<f32>,
}

#[derive(Args, Debug)]
pub struct PerlinArgs {
    /// The map, .png or .exr
    #[arg(long)]
    pub out: PathBuf,
    /// Texels along each side
    #[arg(long, default_value_t = PerlinOptions::default().size, allow_negative_numbers = true)]
    pub size: u32,
    /// Another one, another map
    #[arg(long, default_value_t = PerlinOptions::default().seed, allow_negative_numbers = true)]
    pub seed: u64,
    /// Features along each side
    #[arg(long, default_value_t = PerlinOptions::default().cycles, allow_negative_numbers = true)]
    pub cycles: f32,
    /// Layers of ever finer features, 1 to 12
    #[arg(long, default_value_t = PerlinOptions::default().octaves, allow_negative_numbers = true)]
    pub octaves: u32,
    /// Part of the area that ever gets wet, 0 to 1
    #[arg(long, default_value_t = PerlinOptions::default().coverage, allow_negative_numbers = true)]
    pub coverage: f32,
}

#[derive(Args, Debug)]
pub struct ExposureArgs {
    /// A .glb or .gltf, or a scenario (.ron)
    pub scene: PathBuf,
    /// The map, .png or .exr
    #[arg(long)]
    pub out: PathBuf,
    /// Name of the surface; of its node or mesh in a glTF [default: the first]
    #[arg(long)]
    pub surface: Option<String>,
    /// Texels along each side [default: the surface's in a scenario, else 512]
    #[arg(long, allow_negative_numbers = true)]
    pub size: Option<u32>,
    /// Rays per texel
    #[arg(long, default_value_t = ExposureOptions::default().rays, allow_negative_numbers = true)]
    pub rays: u32,
    /// Wind, m/s [default: the scenario's, else none]
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true)]
    pub wind: Option<[f32; 3]>,
    /// How fast the rain falls in still air, m/s
    #[arg(long, default_value_t = ExposureOptions::default().fall_speed, allow_negative_numbers = true)]
    pub fall_speed: f32,
    /// Half-angle of the cone of sky that it comes from: 0 is parallel, 90 the whole sky
    #[arg(long, default_value_t = 8.6, conflicts_with = "plane", allow_negative_numbers = true)]
    pub spread_deg: f32,
    /// A plane that it comes from in place of the sky: middle, and half its size along x and z, m
    #[arg(long, value_name = "CX,CY,CZ,HX,HZ", value_parser = numbers::<5>, allow_hyphen_values = true)]
    pub plane: Option<[f32; 5]>,
}

#[derive(Args, Debug)]
pub struct DropsArgs {
    /// The map, .png or .exr
    #[arg(long)]
    pub out: PathBuf,
    /// A map to add the drops to
    #[arg(long)]
    pub over: Option<PathBuf>,
    /// Texels along each side [default: those of the other map, else 512]
    #[arg(long, allow_negative_numbers = true)]
    pub size: Option<u32>,
    /// Another one, other drops
    #[arg(long, default_value_t = DropsOptions::default().seed, allow_negative_numbers = true)]
    pub seed: u64,
    /// How many
    #[arg(long, default_value_t = DropsOptions::default().drops, allow_negative_numbers = true)]
    pub drops: u32,
    /// Part of them that run down in lines, 0 to 1
    #[arg(long, default_value_t = DropsOptions::default().lines, allow_negative_numbers = true)]
    pub lines: f32,
    /// Least and greatest radius, texels
    #[arg(long, value_name = "MIN,MAX", default_value = "1.5,5", allow_hyphen_values = true, value_parser = numbers::<2>)]
    pub radius: [f32; 2],
    /// The longest line, texels
    #[arg(long, default_value_t = DropsOptions::default().line_length, allow_negative_numbers = true)]
    pub line_length: f32,
}

pub fn run(command: &WetMapCommand) -> Result<(), Box<dyn Error>> {
    let out = match command {
        WetMapCommand::FromPhoto(arguments) => &arguments.out,
        WetMapCommand::Perlin(arguments) => &arguments.out,
        WetMapCommand::Exposure(arguments) => &arguments.out,
        WetMapCommand::Drops(arguments) => &arguments.out,
    };
    check_map_name(out)?;
    let map = match command {
        WetMapCommand::FromPhoto(arguments) => spotted(arguments)?,
        WetMapCommand::Perlin(arguments) => {
            let &PerlinArgs { size, seed, cycles, octaves, coverage, .. } = arguments;
            perlin(&PerlinOptions { size, seed, cycles, octaves, coverage })?
        }
        WetMapCommand::Exposure(arguments) => exposed(arguments)?,
        WetMapCommand::Drops(arguments) => dropped(arguments)?,
    };
    write_map(out, &map)?;
    crate::print(out.display())
}

fn spotted(arguments: &FromPhotoArgs) -> Result<GreyMap, Box<dyn Error>> {
    let &FromPhotoArgs { gradient, min_area, max_hole, threshold, .. } = arguments;
    let options = PhotoOptions { gradient, min_area, max_hole, threshold };
    let (dry, wet) = (read_photo(&arguments.dry)?, read_photo(&arguments.wet)?);
    let both = format!("{} and {}", arguments.dry.display(), arguments.wet.display());
    let mask = wet_mask(&dry, &wet, &options).map_err(|error| format!("{both}: {error}"))?;
    let map = mask.gradients(gradient)?;
    let coverage = 100.0 * mask.coverage();
    crate::print(format!("{} spots on {coverage:.1} % of the picture", mask.spots().len()))?;
    Ok(map)
}

fn dropped(arguments: &DropsArgs) -> Result<GreyMap, Box<dyn Error>> {
    let &DropsArgs { seed, drops: count, lines, radius, line_length, .. } = arguments;
    let over = arguments.over.as_deref().map(|path| Ok::<_, Box<dyn Error>>((path, read_map(path)?)));
    let over = over.transpose()?;
    let own_size = over.as_ref().map_or(DropsOptions::default().size, |(_, map)| map.width);
    let size = arguments.size.unwrap_or(own_size);
    let map = drops(&DropsOptions { size, seed, drops: count, lines, radius, line_length })?;
    match over {
        Some((path, below)) => {
            below.add(&map).map_err(|error| format!("{} and the drops: {error}", path.display()).into())
        }
        None => Ok(map),
    }
}

fn exposed(arguments: &ExposureArgs) -> Result<GreyMap, Box<dyn Error>> {
    let scene = load_scene(&arguments.scene)?;
    let target = match &arguments.surface {
        None => 0,
        Some(name) => scene.position(name).ok_or_else(|| scene.no_such_surface(&arguments.scene, name))?,
    };
    let surface = &scene.surfaces[target];
    if !surface.has_uvs {
        let (file, name) = (arguments.scene.display(), &surface.name);
        return Err(format!("{file}: surface `{name}` has no texture coordinates, so no map").into());
    }
    let size = arguments.size.unwrap_or(surface.size);
    if !(1..=GreyMap::MAX_SIZE).contains(&size) {
        return Err(format!("`size` is {size}, but must be 1 to {} (MAX_SIZE)", GreyMap::MAX_SIZE).into());
    }
    let source = match arguments.plane {
        Some([x, y, z, half_x, half_z]) => {
            RainSource::Plane { center: Vec3::new(x, y, z), half_size: Vec2::new(half_x, half_z) }
        }
        None => RainSource::Sky { spread: arguments.spread_deg.to_radians() },
    };
    let options = ExposureOptions {
        source,
        wind: arguments.wind.map_or(scene.wind, Vec3::from_array),
        fall_speed: arguments.fall_speed,
        rays: arguments.rays,
    };
    let points = surface_points(&surface.triangles, &surface.transform, size, surface.wrap);
    let bar = ProgressBar::new(points.len() as u64).with_style(
        ProgressStyle::with_template("{bar:40} texel {pos}/{len}, {elapsed} gone, {eta} to go")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let map = exposure(&scene.occluders, &points, size, &options, |more| bar.inc(more));
    bar.finish_and_clear();
    let file = arguments.scene.display();
    map.map_err(|error| format!("{file}: surface `{}`: {error}", surface.name).into())
}

/// What can be looked at, and all that is in the way.
struct ExposureScene {
    surfaces: Vec<Surface>,
    occluders: CollisionScene,
    wind: Vec3,
}

struct Surface {
    name: String,
    /// Another name that it goes by.
    mesh_name: Option<String>,
    triangles: MeshTriangles,
    transform: Affine3A,
    wrap: [Wrap; 2],
    size: u32,
    has_uvs: bool,
}

impl ExposureScene {
    fn new(surfaces: Vec<Surface>, wind: Vec3) -> Self {
        let occluder = |(number, surface): (u32, &Surface)| {
            let bvh = Arc::new(MeshBvh::build(surface.triangles.clone()));
            Entity::from_raw_u32(number).map(|entity| (entity, surface.transform, bvh))
        };
        let occluders = CollisionScene::new((0..).zip(&surfaces).filter_map(occluder));
        Self { surfaces, occluders, wind }
    }

    fn position(&self, name: &str) -> Option<usize> {
        let by_name = self.surfaces.iter().position(|surface| surface.name == name);
        by_name
            .or_else(|| self.surfaces.iter().position(|surface| surface.mesh_name.as_deref() == Some(name)))
    }

    fn no_such_surface(&self, file: &Path, name: &str) -> String {
        let names: Vec<&str> = self.surfaces.iter().map(|surface| surface.name.as_str()).collect();
        format!("{}: there is no surface `{name}`, only `{}`", file.display(), names.join("`, `"))
    }
}

fn load_scene(file: &Path) -> Result<ExposureScene, Box<dyn Error>> {
    if file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ron")) {
        let loaded = Scenario::load(file)?;
        let surfaces: Vec<Surface> = loaded
            .surface_meshes()?
            .into_iter()
            .map(|(name, triangles, transform, maps)| Surface {
                name,
                mesh_name: None,
                triangles,
                transform,
                wrap: maps.wrap(),
                size: maps.texels(),
                has_uvs: true,
            })
            .collect();
        if surfaces.is_empty() {
            return Err(format!("{}: field `surfaces` is empty", file.display()).into());
        }
        return Ok(ExposureScene::new(surfaces, loaded.scenario.wind));
    }
    let maps = Weatherable::default();
    let surface = |mesh: NamedMesh| Surface {
        name: mesh.name,
        mesh_name: mesh.mesh_name,
        triangles: mesh.triangles,
        transform: mesh.transform,
        wrap: maps.wrap(),
        size: maps.texels(),
        has_uvs: mesh.has_uvs,
    };
    Ok(ExposureScene::new(read_meshes(file)?.into_iter().map(surface).collect(), Vec3::ZERO))
}

/// `N` finite numbers with commas between them.
pub fn numbers<const N: usize>(text: &str) -> Result<[f32; N], String> {
    let parse = |number: &str| match number.trim().parse::<f32>() {
        Ok(number) if number.is_finite() => Ok(number),
        Ok(number) => Err(format!("{number} is not finite")),
        Err(error) => Err(format!("{number:?}: {error}")),
    };
    let numbers: Vec<f32> = text.split(',').map(parse).collect::<Result<_, _>>()?;
    let count = numbers.len();
    numbers.try_into().map_err(|_| format!("expected {N} numbers with commas between them, got {count}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_as_many_as_expected_and_finite() {
        assert_eq!(numbers::<3>("1,-2.5, 3e1"), Ok([1.0, -2.5, 30.0]));
        for wrong in ["1,2", "1,2,3,4", "a,b,c", "", "1,2,NaN", "1,2,inf"] {
            assert!(numbers::<3>(wrong).is_err(), "{wrong}");
        }
    }
}
