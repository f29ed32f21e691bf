//! The command line.

use std::path::{Path, PathBuf};

use crate::bake::BakeArgs;
use crate::stamps::StampsArgs;
use crate::wetmap::WetMapCommand;
use bevy::math::UVec2;
use clap::{Args, Parser, Subcommand, ValueEnum};

/// Rain, hoses and dust on real meshes: replay scenarios, or play with them.
#[derive(Parser, Debug)]
#[command(version, about)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand, Debug)]
pub enum Command {
    /// Run a scenario without a window: pictures, maps, report.json
    Replay(ReplayArgs),
    /// Check scenarios, their variants and the files they name, without running them
    Check(CheckArgs),
    /// Print the JSON Schema of scenario files
    Schema,
    /// Open a scenario or a model in a window, to play with
    Sandbox(SandboxArgs),
    /// Let it rain on a glTF scene, and bake what that leaves into its textures
    Bake(BakeArgs),
    /// Make a wet map: what of a surface gets wet first
    #[command(subcommand)]
    Wetmap(WetMapCommand),
    /// Make stamps: the marks that impacts leave, as textures
    Stamps(StampsArgs),
    /// Make a wet version of a base colour texture
    WetTexture(WetTextureArgs),
}

#[derive(Args, Debug)]
pub struct ReplayArgs {
    /// The scenario (.ron); exit code 1 if one of its expectations does not hold. Of several, each is run by a program of its
    /// own and has its own folder in --out, named after its file
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// One of its variants
    #[arg(long)]
    pub variant: Option<String>,
    /// Folder for pictures, maps, series, plots and report.json; without it the report goes to standard output
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// How many scenarios run at a time; a single file, too, has a folder of its own in --out then [default: 1]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub jobs: Option<u32>,
    /// Run only one of the files: its number, counted from 0
    #[arg(long, value_name = "INDEX", allow_negative_numbers = true)]
    pub only: Option<usize>,
    /// Pictures per second of weather time
    #[arg(long, default_value_t = 24, allow_negative_numbers = true)]
    pub fps: u32,
    /// Size of the pictures, WIDTHxHEIGHT
    #[arg(long, default_value = "640x360", value_parser = parse_size)]
    pub size: UVec2,
    /// Seconds of weather time from the start, in place of the scenario's
    #[arg(long, allow_negative_numbers = true)]
    pub seconds: Option<f32>,
    /// Seed, in place of the scenario's
    #[arg(long, conflicts_with = "resume", allow_negative_numbers = true)]
    pub seed: Option<u64>,
    /// Threads to compute ticks with, up to 1024; how open surfaces lie is found out by all cores [default: all cores]
    #[arg(long, allow_negative_numbers = true)]
    pub threads: Option<usize>,
    /// Go on from a folder written by --save-state; of the pictures in --out, those from before stay
    #[arg(long)]
    pub resume: Option<PathBuf>,
    /// Folder to save the scene into at the end, to go on from; holds nothing else
    #[arg(long)]
    pub save_state: Option<PathBuf>,
    /// Simulate only; needs no graphics driver, and gives the same digest
    #[arg(long)]
    pub no_render: bool,
    /// Seconds of weather time between two rows of series.csv [default: 1]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub every: Option<f32>,
    /// Make a video of the pictures: video.mp4 with ffmpeg, or else video.apng
    #[arg(long, requires = "out", conflicts_with = "no_render")]
    pub video: bool,
    /// Make sheet.png of so many of the pictures, with their times; 12 if no number is given
    #[arg(long, value_name = "PICTURES", num_args = 0..=1, require_equals = true, default_missing_value = "12")]
    #[arg(requires = "out", conflicts_with = "no_render", allow_negative_numbers = true)]
    pub sheet: Option<u32>,
    /// Folder for the scene as it is at the end, for other engines: NAME_weathered.glb, maps/, report.json; not that of --out
    #[arg(long, value_name = "DIR")]
    pub export: Option<PathBuf>,
    /// End when standard input does, as it does when whoever holds the other end of it is gone
    #[arg(long, hide = true)]
    pub end_with_input: bool,
}

impl ReplayArgs {
    /// Whether each scenario gets a program and a folder of its own.
    pub fn is_batch(&self) -> bool {
        self.files.len() > 1 || self.jobs.is_some() || self.only.is_some()
    }
}

#[derive(Args, Debug)]
pub struct CheckArgs {
    /// The scenarios (.ron)
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// Only with this of their variants [default: without, and with each of them]
    #[arg(long)]
    pub variant: Option<String>,
}

#[derive(Args, Debug)]
pub struct SandboxArgs {
    /// A scenario (.ron), or a model by itself (.glb, .gltf)
    #[arg(default_value = "assets/scenarios/hose.ron")]
    pub file: PathBuf,
    /// One of its variants
    #[arg(long)]
    pub variant: Option<String>,
    /// Folder for screenshots and saved scenes
    #[arg(long, default_value = "out")]
    pub out: PathBuf,
}

/// Without `--model`, the spectral experiment.
#[derive(Args, Debug)]
pub struct WetTextureArgs {
    /// The dry texture, .png
    pub file: PathBuf,
    /// Where to [default: beside it, with `_wet` behind its name]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Taken from every bin of the spectrum, 0 to 1
    #[arg(long, default_value_t = 0.05, conflicts_with = "model", allow_negative_numbers = true)]
    pub shift: f64,
    /// Part of the way of the spectrum towards water, 0 to 1
    #[arg(long, default_value_t = 0.025, conflicts_with = "model", allow_negative_numbers = true)]
    pub lerp: f64,
    /// A model in place of the spectrum
    #[arg(long, value_enum)]
    pub model: Option<TextureModel>,
    /// How porous it is, 0 to 1
    #[arg(long, default_value_t = 1.0, requires = "model", allow_negative_numbers = true)]
    pub porosity: f64,
}

#[derive(ValueEnum, Debug, Clone, Copy)]
pub enum TextureModel {
    /// Lekner and Dorf: a film over rough matter
    Ld,
    /// Twomey, Bohren, Mergenthaler: water between grains
    Tbm,
    /// Lagarde: the more porous, the darker
    Lagarde,
}

/// What opens a model and what opens a scenario are easily mixed up.
///
/// # Errors
/// A glTF where a scenario should be.
pub fn refuse_model(file: &Path) -> Result<(), String> {
    let is_model =
        |ending: &str| file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(ending));
    if ["glb", "gltf"].into_iter().any(is_model) {
        let file = file.display();
        return Err(format!(
            "{file}: a model, not a scenario; `weathering sandbox` opens it, `weathering bake` lets it rain on it"
        ));
    }
    Ok(())
}

fn parse_size(text: &str) -> Result<UVec2, String> {
    let parse = |number: &str| number.parse::<u32>().map_err(|error| format!("{number:?}: {error}"));
    let (width, height) = text.split_once(['x', 'X']).ok_or("expected WIDTHxHEIGHT, like 640x360")?;
    Ok(UVec2::new(parse(width)?, parse(height)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_fit_together() {
        <Cli as clap::CommandFactory>::command().debug_assert();
    }

    #[test]
    fn negative_numbers_are_numbers() {
        let parse = |line: &str| Cli::try_parse_from(line.split(' '));
        let Ok(Cli { command: Command::Replay(replay) }) = parse("weathering replay a.ron --seconds -1")
        else {
            panic!("the library tells the range");
        };
        assert_eq!(replay.seconds, Some(-1.0));
        let fps = parse("weathering replay a.ron --fps -1").unwrap_err().to_string();
        assert!(fps.contains("--fps"), "{fps}");
        assert!(parse("weathering bake a.glb --out b --minutes -1").is_ok());
    }

    #[test]
    fn models_are_no_scenarios() {
        for file in ["a.glb", "a/b.GLTF"] {
            assert!(refuse_model(Path::new(file)).unwrap_err().starts_with(file));
        }
        for file in ["a.ron", "glb", "a.glb.ron", "-"] {
            assert_eq!(refuse_model(Path::new(file)), Ok(()));
        }
    }

    #[test]
    fn sizes_are_two_numbers() {
        assert_eq!(parse_size("640x360"), Ok(UVec2::new(640, 360)));
        for wrong in ["640", "x", "640x-1", "axb", "1x2x3"] {
            assert!(parse_size(wrong).is_err(), "{wrong}");
        }
    }
}
