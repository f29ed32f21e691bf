//! Files of strangers: ten thousand spoilt ones, none of which may crash the library, keep it busy for ever, or be refused
//! without saying why; what they may ask for at most; and that none of them leads out of its folder.
//!
//! | kind | inputs | read by |
//! |---|---|---|
//! | scenarios | 3,900 | `Scenario::load`, a part of those accepted by `check_content` |
//! | small scenarios | 100 | `replay`, for a few ticks |
//! | effects | 2,000 | `WeatherEffect::from_ron`, `StampSource::read` |
//! | pictures | 2,000 | `read_map`, `read_photo`, `StampSource::read` |
//! | states | 1,000 | `SavedScene::read`, a part of those accepted by `replay` |
//! | models | 1,000 | `read_meshes`, `Scenario::load`, a part of those accepted by `replay` |

/// Effects and pictures.
mod effects;
mod harness;
/// What may be asked for, and from where.
mod limits;
/// glTF.
mod models;
mod mutate;
/// Scenarios, loaded and run.
mod scenarios;
/// Folders of saved scenes.
mod states;

use std::fs;
use std::path::{Path, PathBuf};

use bevy_weathering::replay::{ReplayOptions, replay};
use bevy_weathering::scenario::{LoadedScenario, MeshSpec, Scenario};

/// The assets of the repository.
fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets")
}

/// The texts of the files in a folder of the assets, in the order of their names.
fn texts(folder: &str) -> Vec<String> {
    let entries = fs::read_dir(assets().join(folder)).expect("the folder is in the repository");
    let mut files: Vec<_> = entries.map(|entry| entry.expect("it can be read").path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "ron"));
    files.sort();
    files.iter().map(|file| fs::read_to_string(file).expect("it is text")).collect()
}

/// Writes a file, and the folders that it lies in.
fn write(file: &Path, content: impl AsRef<[u8]>) {
    fs::create_dir_all(file.parent().expect("a file in a folder")).expect("a new folder");
    fs::write(file, content).expect("a new file");
}

/// Whether it asks for little enough to be made or run here.
fn is_small(scenario: &Scenario) -> bool {
    let few = |counts: &[u32]| counts.iter().map(|&count| u64::from(count)).product::<u64>() < 30_000;
    let small = |mesh: &MeshSpec| match mesh {
        MeshSpec::Ground { cells, .. } | MeshSpec::Road { cells, .. } | MeshSpec::Cloth { cells, .. } => {
            few(&[cells.x, cells.y])
        }
        MeshSpec::Sphere { sectors, stacks, .. } | MeshSpec::Rock { sectors, stacks, .. } => {
            few(&[*sectors, *stacks])
        }
        MeshSpec::Vase { segments, rings, .. } | MeshSpec::Flowerpot { segments, rings, .. } => {
            few(&[*segments, *rings])
        }
        MeshSpec::BasRelief { cells, .. } => few(&[cells.x, cells.y]),
        MeshSpec::Stair { steps, cells, .. } => few(&[*steps, cells.x + 2, cells.y + 9]),
        MeshSpec::Roof { tiles, cells, .. } => few(&[tiles.x, tiles.y, cells + 4, cells + 4]),
        MeshSpec::Car { cells, .. } => few(&[28, *cells, *cells]),
        MeshSpec::File(_) => true,
    };
    scenario.surfaces.len() <= 16 && scenario.surfaces.iter().all(|surface| small(&surface.mesh))
}

/// Whether a few ticks of it are quickly done.
fn is_quick(scenario: &Scenario) -> bool {
    let rate: f32 = scenario.emitters.iter().map(|emitter| emitter.rate).sum();
    let texels: u64 = scenario.surfaces.iter().map(|surface| u64::from(surface.maps.map_size).pow(2)).sum();
    is_small(scenario) && rate < 20_000.0 && texels <= 4 * 64 * 64
}

/// Runs a scenario without a renderer until `seconds`.
fn run(scenario: LoadedScenario, seconds: f32, resume: Option<PathBuf>) -> Result<(), String> {
    let seconds = Some(seconds);
    let options = ReplayOptions { render: false, seconds, resume, ..ReplayOptions::new(scenario) };
    replay(&options, |_| ()).map(drop).map_err(|error| error.to_string())
}
