//! The whole way: read, rain, bake, write.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bevy::mesh::Mesh;

use super::document::{Document, number};
use super::look::WetModel;
use super::paint::{self, Source};
use super::scene::Place;
use super::shape::Shape;
use super::simulate::{Exposed, simulate};
use super::soaked::Soaked;
use super::texture::Pictures;
use super::write::Writer;
use super::{BakedSurface, ExportError, ExportOptions, ExportReport};
use crate::collision::{MeshTriangles, TriangleError};
use crate::matter::MatterLook;
use crate::output::{refuse_file, temporary_beside, write_atomic};
use crate::replay::{Progress, SurfaceMaps, write_maps};

/// The most texels of all maps together: 128 maps of 512 x 512. Each takes some 200 bytes while it is baked.
pub const MAX_MAP_TEXELS: u64 = 1 << 25;

/// The largest texture unless one is asked for, texels along each side.
const MAX_USUAL_TEXTURE: u32 = 2048;

/// A baked scene, not written yet.
#[derive(Debug, Clone)]
pub struct Export {
    /// The scene as a `.glb`.
    pub glb: Vec<u8>,
    /// The maps of its surfaces.
    pub maps: Vec<SurfaceMaps>,
    /// Where all the water is.
    pub report: ExportReport,
}

/// A primitive that a node shows, with all that is needed of it.
pub(super) struct Surface {
    pub(super) place: Place,
    pub(super) shape: Arc<Shape>,
    pub(super) source: Source,
}

/// Lets it rain on the scene of a `.gltf` or `.glb`, and bakes what that leaves.
///
/// # Errors
/// [`ExportError`]: options out of range, a file that cannot be read or names what lies outside its folder, no meshes, meshes
/// that cannot be unwrapped, too many of them.
pub fn bake(
    file: &Path,
    options: &ExportOptions,
    progress: impl FnMut(Progress),
) -> Result<Export, ExportError> {
    options.check()?;
    let document = Document::open(file)?;
    let (surfaces, exposed) = surfaces(&document, options)?;
    let failed = |number: usize, source| {
        let surface = surfaces.get(number).map(|surface| surface.place.name.clone()).unwrap_or_default();
        ExportError::Surface { path: file.into(), surface, source }
    };
    let outcome = simulate(exposed, options, failed, progress)?;

    let model = WetModel::new(&options.material, MatterLook::default());
    let places: Vec<_> = surfaces.iter().map(|surface| &surface.place).collect();
    let mut writer = Writer::new(document, &places);
    let mut rows = Vec::new();
    for (surface, (soaked, maps)) in surfaces.iter().zip(outcome.surfaces.iter().zip(&outcome.maps)) {
        let size = texture_size(&surface.source, options.texture_size, options.map_size);
        rows.push(write_wet(&mut writer, surface, &model, soaked, maps, size)?);
    }
    let scene = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let report = ExportReport::new(scene, options, &outcome, rows);
    Ok(Export { glb: writer.document.to_glb()?, maps: outcome.maps, report })
}

/// Bakes the wet look of a surface into textures of `size`, and writes its wet form.
pub(super) fn write_wet(
    writer: &mut Writer,
    Surface { place, shape, source }: &Surface,
    model: &WetModel,
    soaked: &Soaked,
    maps: &SurfaceMaps,
    size: u32,
) -> Result<BakedSurface, ExportError> {
    let baked = paint::bake(shape, source, model, &soaked.held, maps.size, size);
    let sampler = writer.sampler;
    let textures = writer.document.push_textures(&place.name, &baked, sampler)?;
    let amounts = writer.document.push_amounts(maps)?;
    writer.add(place, shape, textures, amounts)?;
    Ok(BakedSurface::new(place, shape, soaked, maps, size))
}

/// All surfaces of a scene, and the same in the world. Primitives without area are left out.
fn surfaces(
    document: &Document,
    options: &ExportOptions,
) -> Result<(Vec<Surface>, Vec<Exposed>), ExportError> {
    let places = document.places()?;
    let (each, path) = (u64::from(options.map_size).pow(2), || document.path.clone());
    let texels = each * places.len() as u64;
    if texels > MAX_MAP_TEXELS {
        let what = "texels of maps (surfaces times the square of their size)";
        return Err(ExportError::TooMany { path: path(), what, value: texels, max: MAX_MAP_TEXELS });
    }
    let mut shapes: BTreeMap<(usize, usize), Option<Arc<Shape>>> = BTreeMap::new();
    let (mut pictures, mut surfaces, mut exposed) = (Pictures::default(), Vec::new(), Vec::new());
    for place in places {
        let key = (place.mesh, place.primitive);
        let shape = match shapes.get(&key) {
            Some(shape) => shape.clone(),
            None => {
                let shape = document.shape(&place, options.map_size)?.map(Arc::new);
                shapes.insert(key, shape.clone());
                shape
            }
        };
        let Some(shape) = shape else { continue };
        let mesh = shape.world_mesh(&place.world_from_mesh);
        if is_flattened(&mesh) {
            continue;
        }
        exposed.push(Exposed { name: place.name.clone(), mesh, material: options.material });
        let primitive = &document.entry("meshes", place.mesh)?["primitives"][place.primitive];
        let source = document.source(number(&primitive["material"]), &mut pictures)?;
        surfaces.push(Surface { place, shape, source });
    }
    if surfaces.is_empty() { Err(ExportError::NoMesh { path: path() }) } else { Ok((surfaces, exposed)) }
}

/// Whether a node has scaled a mesh to nothing: so scenes hide things.
fn is_flattened(mesh: &Mesh) -> bool {
    let triangles = MeshTriangles::from_mesh(mesh);
    matches!(triangles, Err(TriangleError::Empty(report)) if report.degenerate == report.total)
}

/// Texels along each side of the textures of a surface with maps of this size.
pub(super) fn texture_size(source: &Source, wanted: Option<u32>, map_size: u32) -> u32 {
    wanted.unwrap_or_else(|| {
        let maps = [&source.color_map, &source.surface_map, &source.normal_map].into_iter().flatten();
        let largest = maps.map(|map| map.picture.width.max(map.picture.height)).max().unwrap_or(0);
        largest.clamp(map_size.min(MAX_USUAL_TEXTURE), MAX_USUAL_TEXTURE)
    })
}

fn scene_file(stem: &str) -> String {
    format!("{stem}_weathered.glb")
}

impl Export {
    /// Checks that a folder can be written into or, if it is not there, that it can be made, and that a file of the name for
    /// this stem can be in it: better before a long run than after it. Nothing is left of the check.
    ///
    /// # Errors
    /// [`ExportError::Write`] with the folder or the file.
    pub fn check_folder(folder: &Path, stem: &str) -> Result<(), ExportError> {
        // The nearest that there is, which has to be a folder.
        let there = folder.ancestors().find(|path| path.exists()).unwrap_or(Path::new("."));
        let writable = refuse_file(there).and_then(|()| temporary_beside(&there.join("report.json")));
        writable.map(drop).map_err(|source| ExportError::Write { path: folder.into(), source })?;
        let scene = scene_file(stem);
        match fs::symlink_metadata(there.join(&scene)) {
            // Too long.
            Err(source) if source.kind() == io::ErrorKind::InvalidFilename => {
                Err(ExportError::Write { path: folder.join(scene), source })
            }
            _ => Ok(()),
        }
    }

    /// Writes `<stem>_weathered.glb`, `maps/<surface>_*.png` as a replay does, and, when all of them are there, `report.json`.
    /// Each is written whole or not at all; a report of before is removed first, so one that is there is about what lies beside
    /// it. The paths of scene and report.
    ///
    /// # Errors
    /// [`ExportError::Write`], [`ExportError::Replay`] with the file.
    pub fn write(&self, folder: &Path, stem: &str) -> Result<[PathBuf; 2], ExportError> {
        let [scene, report] = [folder.join(scene_file(stem)), folder.join("report.json")];
        let write = |path: &Path, bytes: &[u8]| {
            write_atomic(path, bytes).map_err(|source| ExportError::Write { path: path.into(), source })
        };
        let json = serde_json::to_vec_pretty(&self.report)?;
        match fs::remove_file(&report) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => {
                return Err(ExportError::Write { path: report, source });
            }
            _ => {}
        }
        write_maps(&folder.join("maps"), &self.maps)?;
        write(&scene, &self.glb)?;
        write(&report, &json)?;
        Ok([scene, report])
    }
}
