//! The folder: pictures that hold words, and the state beside them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::{fs, io};

use image::{ImageFormat, LumaA, Rgba};

use super::leftovers::{self, NEW, OLD, folder_beside};
use super::{SaveError, SavedScene, SavedSurface, SceneState, SurfaceState, VERSION};
use crate::input::{read_file, require_plain_file};
use crate::matter::{SurfaceMatter, TexelMatter};
use crate::output::write_atomic;
use crate::overlay::{TILE_SIZE, Weatherable, Wrap};
use crate::picture::{PictureError, read_picture, square, write_picture};
use crate::scenario::Scenario;
use crate::wetting::{Marks, SurfaceWater, TexelWater};

/// The name of the state.
pub(super) const STATE: &str = "state.ron";

/// The maps of a surface; see [`file`].
const MAPS: [&str; 15] = [
    "diffuse",
    "specular",
    "normal",
    "film",
    "pores",
    "since",
    "look",
    "tiles",
    "efflorescence",
    "tide",
    "dust",
    "mud",
    "snow",
    "stirred",
    "heaps",
];

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

/// The place that a folder names, if a scene can be saved there.
pub(super) fn check(folder: &Path) -> Result<PathBuf, SaveError> {
    let failed = |source| SaveError::Write { path: folder.into(), source };
    let refused = |reason: &str| Err(failed(io::Error::other(reason)));
    // Without `.`, `..` and links, so that what is renamed is the folder itself.
    let place = if folder.exists() { folder.canonicalize() } else { std::path::absolute(folder) };
    let place = place.map_err(failed)?;
    let (Some(parent), Some(_)) = (place.parent(), place.file_name()) else {
        return refused("it is no folder that can be replaced");
    };
    fs::create_dir_all(parent).map_err(failed)?;
    leftovers::recover(&place).map_err(failed)?;
    if place.exists() {
        if std::env::current_dir().and_then(fs::canonicalize).is_ok_and(|here| here == place) {
            return refused("it is the folder that this runs in, which cannot be replaced");
        }
        if is_mounted(&place, parent).map_err(failed)? {
            return refused("it is a mount point, which cannot be replaced; name a folder in it");
        }
        let mut is_empty = true;
        for entry in fs::read_dir(&place).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let name = entry.file_name();
            if !name.to_str().is_some_and(is_ours) || !entry.file_type().map_err(failed)?.is_file() {
                return refused(&format!("it holds {name:?}, which is no part of a saved scene"));
            }
            is_empty = false;
        }
        if !is_empty && !place.join(STATE).exists() {
            return refused(&format!("it holds maps, but no {STATE}: it is no saved scene"));
        }
    }
    leftovers::remove(&place).map_err(failed)?;
    folder_beside(&place).map_err(failed)?;
    Ok(place)
}

/// Whether a file of this name is part of a saved scene.
fn is_ours(name: &str) -> bool {
    let map = name.strip_suffix(".png").and_then(|name| name.rsplit_once('_'));
    name == STATE || map.is_some_and(|(surface, map)| !surface.is_empty() && MAPS.contains(&map))
}

#[cfg(unix)]
fn is_mounted(folder: &Path, parent: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    Ok(fs::metadata(folder)?.dev() != fs::metadata(parent)?.dev())
}

/// Found out when it is renamed.
#[cfg(not(unix))]
fn is_mounted(_: &Path, _: &Path) -> io::Result<bool> {
    Ok(false)
}

pub(super) fn write(scene: &SavedScene, folder: &Path) -> Result<(), SaveError> {
    let failed = |source| SaveError::Write { path: folder.into(), source };
    let place = check(folder)?;
    let temporary = folder_beside(&place).map_err(failed)?;
    let (new, old) = (temporary.path().join(NEW), temporary.path().join(OLD));
    fs::create_dir(&new).map_err(failed)?;
    write_files(scene, &new)?;
    let replaces = place.exists();
    if replaces {
        fs::rename(&place, &old).map_err(failed)?;
    }
    let Err(source) = fs::rename(&new, &place) else { return Ok(()) };
    if replaces && fs::rename(&old, &place).is_err() {
        // Better in another place than gone.
        let kept = temporary.keep().join(OLD);
        let reason = format!("{source}; what was there is now {}", kept.display());
        return Err(failed(io::Error::other(reason)));
    }
    Err(failed(source))
}

fn write_files(scene: &SavedScene, folder: &Path) -> Result<(), SaveError> {
    let surfaces = scene.state.surfaces.iter().zip(&scene.surfaces);
    for (state, surface) in surfaces.filter(|(state, _)| state.size > 0) {
        let size = state.size;
        let put = |map: &str, bytes: Vec<u8>| {
            let path = file(folder, &state.name, map);
            write_picture(&path, &square::<Rgba<u8>>(&path, size, bytes)?, ImageFormat::Png)
        };
        put("diffuse", surface.colors.diffuse.clone())?;
        put("specular", surface.colors.specular.clone())?;
        put("normal", surface.colors.normal.clone())?;
        let texels = surface.water.texels();
        if state.wet {
            let words = |of: &dyn Fn(&TexelWater) -> [u8; 4]| texels.iter().flat_map(of).collect::<Vec<u8>>();
            put("film", words(&|texel| texel.film.to_le_bytes()))?;
            put("pores", words(&|texel| texel.pores.to_le_bytes()))?;
            put("since", words(&|texel| texel.tick.to_le_bytes()))?;
            put("look", words(&|texel| [texel.shown, texel.reserve, texel.filmed, texel.rim]))?;
            let tiles = surface.water.tile_states().flat_map(|(flags, patience)| [flags, patience]);
            let tiles: Vec<u8> = tiles.collect();
            let path = file(folder, &state.name, "tiles");
            let picture = square::<LumaA<u8>>(&path, size / TILE_SIZE, tiles)?;
            write_picture(&path, &picture, ImageFormat::Png)?;
        }
        if state.marks {
            let bits = |of: &dyn Fn(&Marks) -> f32| {
                surface.water.marks().iter().flat_map(|marks| of(marks).to_le_bytes()).collect::<Vec<u8>>()
            };
            put("efflorescence", bits(&|marks| marks.efflorescence))?;
            put("tide", bits(&|marks| marks.tide))?;
        }
        if state.matter {
            let words = |of: &dyn Fn(&TexelMatter) -> u32| {
                surface.matter.texels().iter().flat_map(|texel| of(texel).to_le_bytes()).collect::<Vec<u8>>()
            };
            put("dust", words(&|texel| texel.dust))?;
            put("mud", words(&|texel| texel.mud))?;
            put("snow", words(&|texel| texel.snow))?;
            if state.stirred {
                let stirred = surface.matter.stirred();
                put("stirred", stirred.iter().flat_map(|units| units.to_le_bytes()).collect::<Vec<u8>>())?;
            }
            let path = file(folder, &state.name, "heaps");
            let flags = surface.matter.tile_flags().iter().flat_map(|&flags| [flags, u8::MAX]).collect();
            write_picture(&path, &square::<LumaA<u8>>(&path, size / TILE_SIZE, flags)?, ImageFormat::Png)?;
        }
    }
    let path = folder.join(STATE);
    let text = ron::ser::to_string_pretty(&scene.state, ron::ser::PrettyConfig::default().depth_limit(3))
        .map_err(|source| SaveError::Encode { path: path.clone(), source: source.into() })?;
    write_atomic(&path, text.as_bytes()).map_err(|source| SaveError::Write { path, source })
}

fn file(folder: &Path, surface: &str, map: &str) -> PathBuf {
    folder.join(format!("{surface}_{map}.png"))
}

pub(super) fn read(folder: &Path) -> Result<SavedScene, SaveError> {
    let path = folder.join(STATE);
    let failed = |source| SaveError::Read { path: path.clone(), source };
    leftovers::recover(folder).map_err(failed)?;
    // Of a stranger's folder, a link might lead anywhere.
    require_plain_file(&path).map_err(failed)?;
    let bytes = read_file(&path, MAX_STATE_BYTES).map_err(failed)?;
    let state: SceneState = ron::de::from_bytes(&bytes)
        .map_err(|source| SaveError::Parse { path: path.clone(), source: source.into() })?;
    if state.version != VERSION {
        return Err(value(&path, "version", state.version, VERSION.to_string()));
    }
    if state.surfaces.len() > Scenario::MAX_SURFACES {
        let expected = format!("at most {} (MAX_SURFACES)", Scenario::MAX_SURFACES);
        return Err(value(&path, "surfaces", state.surfaces.len(), expected));
    }
    let (mut surfaces, mut names) = (Vec::new(), BTreeSet::new());
    for (index, surface) in state.surfaces.iter().enumerate() {
        let plain = !surface.name.is_empty() && !surface.name.contains(['/', '\\']) && surface.name != "..";
        if !plain {
            let field = format!("surfaces[{index}].name");
            return Err(value(&path, &field, &surface.name, "a plain name".into()));
        }
        if !names.insert(&surface.name) {
            let field = format!("surfaces[{index}].name");
            return Err(value(&path, &field, &surface.name, "unique".into()));
        }
        if surface.size == 0 {
            surfaces.push(SavedSurface {
                water: SurfaceWater::of_size(TILE_SIZE, [Wrap::Clamp; 2], 1.0),
                matter: SurfaceMatter::default(),
                colors: ColorMaps::default(),
            });
            continue;
        }
        let whole = Weatherable {
            map_size: surface.size,
            wrap_u: Wrap::Clamp,
            wrap_v: Wrap::Clamp,
            ..Weatherable::default()
        };
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
        marks = both.map(|(&white, &tide)| Marks { efflorescence: part(white), tide: part(tide) }).collect();
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
    let mut matter = SurfaceMatter::default();
    if state.matter {
        let (dust, mud, snow) = (words("dust")?, words("mud")?, words("snow")?);
        let rows = dust.into_iter().zip(mud).zip(snow);
        let texels = rows.map(|((dust, mud), snow)| TexelMatter { dust, mud, snow }).collect();
        let stirred = if state.stirred { words("stirred")? } else { Vec::new() };
        let bytes = read_png(&file(folder, &state.name, "heaps"), state.size / TILE_SIZE, 2)?;
        let flags: Vec<u8> = bytes.as_chunks::<2>().0.iter().map(|&[flags, _]| flags).collect();
        matter = SurfaceMatter::from_saved(state.size, texels, stirred, &flags, state.matter_ledger);
    }
    Ok(SavedSurface { water, matter, colors })
}

/// A part of one from its bits; what is no number is nothing.
fn part(bits: u32) -> f32 {
    let part = f32::from_bits(bits);
    if part.is_nan() { 0.0 } else { part.clamp(0.0, 1.0) }
}

/// The bytes of a picture of this size with so many channels of 8 bits.
fn read_png(path: &Path, size: u32, channels: u8) -> Result<Vec<u8>, SaveError> {
    require_plain_file(path).map_err(|source| PictureError::File { path: path.into(), source })?;
    let image = read_picture(path, ImageFormat::Png, Weatherable::MAX_MAP_SIZE)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weather::DryingPoint;

    /// A scene without surfaces.
    fn scene(tick: u32) -> SavedScene {
        let state = SceneState {
            version: VERSION,
            scenario: String::new(),
            seed: 0,
            tick,
            hz: 60,
            digest: [0; 32],
            weather: Default::default(),
            drying: vec![DryingPoint::default()],
            counts: Default::default(),
            water: Default::default(),
            next_sequence: 0,
            emitters: vec![],
            particles: vec![],
            waiting: vec![],
            surfaces: vec![],
            settings: None,
        };
        SavedScene { state, surfaces: vec![] }
    }

    fn saved_tick(folder: &Path) -> u32 {
        SavedScene::read(folder).unwrap().tick()
    }

    #[test]
    fn a_scene_takes_the_place_of_the_one_before_however_its_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let kept = folder.path().join("deep/kept");
        let names = [kept.clone(), kept.clone(), kept.join("."), kept.join(""), kept.join("../kept")];
        for (name, tick) in names.iter().zip(1..) {
            scene(tick).write(name).unwrap();
            assert_eq!(saved_tick(&kept), tick, "{}", name.display());
            // Of what was there before, nothing is left beside it.
            assert_eq!(fs::read_dir(folder.path().join("deep")).unwrap().count(), 1);
        }
        let empty = folder.path().join("empty");
        fs::create_dir(&empty).unwrap();
        scene(9).write(&empty).unwrap();
        assert_eq!(saved_tick(&empty), 9);
    }

    #[test]
    fn what_is_no_saved_scene_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let kept = folder.path().join("kept");
        scene(1).write(&kept).unwrap();
        for foreign in ["thesis.txt", "frame_00000.png", "wall_wetness.png", "_film.png", ".hidden"] {
            fs::write(kept.join(foreign), "mine").unwrap();
            for error in [scene(2).write(&kept), SavedScene::check_folder(&kept)] {
                let error = error.unwrap_err().to_string();
                assert!(error.contains("kept") && error.contains(foreign), "{foreign}: {error}");
            }
            assert_eq!(fs::read_to_string(kept.join(foreign)).unwrap(), "mine");
            assert_eq!(saved_tick(&kept), 1);
            fs::remove_file(kept.join(foreign)).unwrap();
        }
        // Folders are never ours.
        fs::create_dir(kept.join("wall_film.png")).unwrap();
        assert!(scene(2).write(&kept).is_err());
        fs::remove_dir(kept.join("wall_film.png")).unwrap();
        fs::write(kept.join("wall_film.png"), "stale").unwrap();
        scene(3).write(&kept).unwrap();
        assert!(!kept.join("wall_film.png").exists());
        // The maps of a replay.
        fs::write(kept.join("wall_film.png"), "mine").unwrap();
        fs::remove_file(kept.join(STATE)).unwrap();
        assert!(scene(4).write(&kept).unwrap_err().to_string().contains(STATE));
        assert!(kept.join("wall_film.png").exists());
        let file = folder.path().join("file");
        fs::write(&file, "mine").unwrap();
        assert!(scene(5).write(&file).is_err() && scene(5).write(&file.join("below")).is_err());
        assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
        assert!(scene(5).write(Path::new("/")).is_err());
    }

    #[test]
    fn marks_that_are_no_numbers_are_none() {
        let parts = [f32::NAN, -1.0, 0.25, 7.0, f32::INFINITY].map(|value| part(value.to_bits()));
        assert_eq!(parts, [0.0, 0.0, 0.25, 1.0, 1.0]);
    }
}
