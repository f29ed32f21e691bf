//! The folder: pictures that hold words, and the state beside them.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageReader};

use super::{SaveError, SavedScene, SavedSurface, SceneState, SurfaceState, VERSION};
use crate::overlay::{TILE_SIZE, Weatherable, Wrap};
use crate::wetting::{Marks, SurfaceWater, TexelWater};

/// The name of the state.
const STATE: &str = "state.ron";

/// The largest state that is read: some ten million particles.
const MAX_STATE_BYTES: u64 = 2 << 30;

/// Colour maps of a surface, RGBA rows, premultiplied.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ColorMaps {
    /// Colour over the surface's.
    pub diffuse: Vec<u8>,
    /// Reflectance, smoothness, unused, coverage.
    pub specular: Vec<u8>,
    /// Slopes along u and v, unused, coverage.
    pub normal: Vec<u8>,
}

pub(super) fn write(scene: &SavedScene, folder: &Path) -> Result<(), SaveError> {
    let failed = |source| SaveError::Write { path: folder.into(), source };
    let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(parent).map_err(failed)?;
    if folder.exists()
        && !folder.join(STATE).exists()
        && fs::read_dir(folder).map_err(failed)?.next().is_some()
    {
        let source = std::io::Error::other("it is there, and is no saved scene");
        return Err(failed(source));
    }
    // Removes itself unless it is kept.
    let temporary = tempfile::Builder::new().prefix(".saving").tempdir_in(parent).map_err(failed)?;
    write_files(scene, temporary.path())?;
    if folder.exists() {
        fs::remove_dir_all(folder).map_err(failed)?;
    }
    fs::rename(temporary.keep(), folder).map_err(failed)
}

fn write_files(scene: &SavedScene, folder: &Path) -> Result<(), SaveError> {
    for (state, surface) in scene.state.surfaces.iter().zip(&scene.surfaces) {
        let size = state.size;
        let put = |map: &str, bytes: &[u8], size: u32| {
            write_png(&file(folder, &state.name, map), bytes, size, ExtendedColorType::Rgba8)
        };
        put("diffuse", &surface.colors.diffuse, size)?;
        put("specular", &surface.colors.specular, size)?;
        put("normal", &surface.colors.normal, size)?;
        let texels = surface.water.texels();
        if state.wet {
            let words = |of: &dyn Fn(&TexelWater) -> [u8; 4]| texels.iter().flat_map(of).collect::<Vec<u8>>();
            put("film", &words(&|texel| texel.film.to_le_bytes()), size)?;
            put("pores", &words(&|texel| texel.pores.to_le_bytes()), size)?;
            put("since", &words(&|texel| texel.tick.to_le_bytes()), size)?;
            put("look", &words(&|texel| [texel.shown, texel.reserve, texel.filmed, texel.rim]), size)?;
            let tiles = surface.water.tile_states().flat_map(|(flags, patience)| [flags, patience]);
            let tiles: Vec<u8> = tiles.collect();
            let path = file(folder, &state.name, "tiles");
            write_png(&path, &tiles, size / TILE_SIZE, ExtendedColorType::La8)?;
        }
        if state.marks {
            let bits = |of: &dyn Fn(&Marks) -> f32| {
                surface.water.marks().iter().flat_map(|marks| of(marks).to_le_bytes()).collect::<Vec<u8>>()
            };
            put("efflorescence", &bits(&|marks| marks.efflorescence), size)?;
            put("tide", &bits(&|marks| marks.tide), size)?;
        }
    }
    let path = folder.join(STATE);
    let text = ron::ser::to_string_pretty(&scene.state, ron::ser::PrettyConfig::default().depth_limit(3))
        .map_err(|source| SaveError::Encode { path: path.clone(), source: source.into() })?;
    fs::write(&path, text).map_err(|source| SaveError::Write { path, source })
}

fn file(folder: &Path, surface: &str, map: &str) -> PathBuf {
    folder.join(format!("{surface}_{map}.png"))
}

fn write_png(path: &Path, bytes: &[u8], size: u32, color: ExtendedColorType) -> Result<(), SaveError> {
    let mut png = Cursor::new(Vec::new());
    PngEncoder::new(&mut png)
        .write_image(bytes, size, size, color)
        .map_err(|source| SaveError::Image { path: path.into(), source })?;
    fs::write(path, png.get_ref()).map_err(|source| SaveError::Write { path: path.into(), source })
}

pub(super) fn read(folder: &Path) -> Result<SavedScene, SaveError> {
    let path = folder.join(STATE);
    let failed = |source| SaveError::Read { path: path.clone(), source };
    let size = fs::metadata(&path).map_err(failed)?.len();
    if size > MAX_STATE_BYTES {
        return Err(value(&path, "size", size, format!("at most {MAX_STATE_BYTES} bytes (MAX_STATE_BYTES)")));
    }
    let bytes = fs::read(&path).map_err(failed)?;
    let state: SceneState = ron::de::from_bytes(&bytes)
        .map_err(|source| SaveError::Parse { path: path.clone(), source: source.into() })?;
    if state.version != VERSION {
        return Err(value(&path, "version", state.version, VERSION.to_string()));
    }
    let mut surfaces = Vec::new();
    for (index, surface) in state.surfaces.iter().enumerate() {
        let plain = !surface.name.is_empty() && !surface.name.contains(['/', '\\']) && surface.name != "..";
        if !plain {
            let field = format!("surfaces[{index}].name");
            return Err(value(&path, &field, &surface.name, "a plain name".into()));
        }
        let whole = Weatherable { map_size: surface.size, wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp };
        if whole.texels() != surface.size {
            let field = format!("surfaces[{index}].size");
            let expected = format!("a multiple of {TILE_SIZE} up to {}", Weatherable::MAX_MAP_SIZE);
            return Err(value(&path, &field, surface.size, expected));
        }
        surfaces.push(read_surface(folder, surface)?);
    }
    Ok(SavedScene { state, surfaces })
}

fn read_surface(folder: &Path, state: &SurfaceState) -> Result<SavedSurface, SaveError> {
    let map = |map: &str| read_png(&file(folder, &state.name, map), state.size, 4);
    let words = |name: &str| -> Result<Vec<u32>, SaveError> {
        Ok(map(name)?.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect())
    };
    let colors = ColorMaps { diffuse: map("diffuse")?, specular: map("specular")?, normal: map("normal")? };
    let mut texels = Vec::new();
    let mut tiles = Vec::new();
    if state.wet {
        let (film, pores, since, look) = (words("film")?, words("pores")?, words("since")?, map("look")?);
        let rows = film.iter().zip(&pores).zip(&since).zip(look.as_chunks::<4>().0);
        texels = rows
            .map(|(((&film, &pores), &tick), &[shown, reserve, filmed, rim])| TexelWater {
                film,
                pores,
                tick,
                shown,
                reserve,
                filmed,
                rim,
            })
            .collect();
        let bytes = read_png(&file(folder, &state.name, "tiles"), state.size / TILE_SIZE, 2)?;
        tiles = bytes.as_chunks::<2>().0.iter().map(|&[flags, patience]| (flags, patience)).collect();
    }
    let mut marks = Vec::new();
    if state.marks {
        let (white, tide) = (words("efflorescence")?, words("tide")?);
        let both = white.iter().zip(&tide);
        marks = both
            .map(|(&white, &tide)| Marks {
                efflorescence: f32::from_bits(white).clamp(0.0, 1.0),
                tide: f32::from_bits(tide).clamp(0.0, 1.0),
            })
            .collect();
    }
    let water = SurfaceWater::from_saved(
        state.size,
        state.shift,
        texels,
        marks,
        &tiles,
        state.ledger,
        state.rained_at,
    );
    Ok(SavedSurface { water, colors })
}

/// The bytes of a picture of this size with so many channels of 8 bits.
fn read_png(path: &Path, size: u32, channels: u8) -> Result<Vec<u8>, SaveError> {
    let reader = ImageReader::open(path).map_err(|source| SaveError::Read { path: path.into(), source })?;
    let image = reader.decode().map_err(|source| SaveError::Image { path: path.into(), source })?;
    if (image.width(), image.height()) != (size, size) {
        let found = format!("{}x{}", image.width(), image.height());
        return Err(value(path, "size", found, format!("{size}x{size}")));
    }
    let color = image.color();
    if color.channel_count() != channels || color.bytes_per_pixel() != channels {
        return Err(value(path, "color", format!("{color:?}"), format!("{channels} channels of 8 bits")));
    }
    Ok(image.into_bytes())
}

pub(super) fn value(path: &Path, field: &str, value: impl ToString, expected: String) -> SaveError {
    SaveError::Value { path: path.into(), field: field.into(), value: value.to_string(), expected }
}
