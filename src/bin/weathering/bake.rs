//! `weathering bake`.

use std::error::Error;
use std::path::PathBuf;

use bevy::math::Vec3;
use bevy_weathering::export::{Export, ExportOptions, bake};
use bevy_weathering::weather::Weather;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use crate::wetmap::numbers;
use crate::{log_warnings, print};

#[derive(Args, Debug)]
pub struct BakeArgs {
    /// The scene, .glb or .gltf
    pub scene: PathBuf,
    /// Folder for NAME_weathered.glb, maps/ and report.json
    #[arg(long)]
    pub out: PathBuf,
    /// Water on level ground, mm/h, 0.1 to 300
    #[arg(long, value_name = "MM_PER_H", default_value_t = ExportOptions::default().rain_mm_per_h)]
    #[arg(allow_negative_numbers = true)]
    pub rain: f32,
    /// Wind, m/s [default: none]
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true)]
    pub wind: Option<[f32; 3]>,
    /// How long it rains, minutes, up to a day
    #[arg(long, default_value_t = ExportOptions::default().minutes, allow_negative_numbers = true)]
    pub minutes: f32,
    /// °C, -40 to 60
    #[arg(long, default_value_t = Weather::default().temperature_c, allow_hyphen_values = true)]
    pub temperature: f32,
    /// Relative humidity, 0 to 1
    #[arg(long, default_value_t = Weather::default().humidity, allow_negative_numbers = true)]
    pub humidity: f32,
    /// Texels along each side of a surface's maps, a multiple of 16 up to 2048
    #[arg(long, default_value_t = ExportOptions::default().map_size, allow_negative_numbers = true)]
    pub size: u32,
    /// Texels along each side of the textures [default: as the scene's own, up to 2048]
    #[arg(long, allow_negative_numbers = true)]
    pub texture_size: Option<u32>,
    /// Ticks a second: films run at most one texel a tick
    #[arg(long, default_value_t = ExportOptions::default().tick_hz, allow_negative_numbers = true)]
    pub hz: u32,
    /// Particles a second above the scene, each for many drops
    #[arg(long, default_value_t = ExportOptions::default().particles_per_second, allow_negative_numbers = true)]
    pub particles: f32,
    /// Seed: another one, other drops
    #[arg(long, default_value_t = ExportOptions::default().seed, allow_negative_numbers = true)]
    pub seed: u64,
    /// Threads to compute ticks with, 1 to 1024 [default: all cores]
    #[arg(long, allow_negative_numbers = true)]
    pub threads: Option<usize>,
}

pub fn run(arguments: &BakeArgs) -> Result<(), Box<dyn Error>> {
    log_warnings();
    let weather = Weather {
        wind: arguments.wind.map_or(Vec3::ZERO, Vec3::from_array),
        temperature_c: arguments.temperature,
        humidity: arguments.humidity,
        ..Weather::default()
    };
    let options = ExportOptions {
        rain_mm_per_h: arguments.rain,
        minutes: arguments.minutes,
        weather,
        map_size: arguments.size,
        texture_size: arguments.texture_size,
        tick_hz: arguments.hz,
        particles_per_second: arguments.particles,
        seed: arguments.seed,
        threads: arguments.threads,
        ..ExportOptions::default()
    };
    if arguments.scene.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ron")) {
        let scene = arguments.scene.display();
        return Err(format!(
            "{scene}: not a glTF; of a scenario, `weathering replay --export DIR` writes the same"
        )
        .into());
    }
    options.check()?;
    let stem = arguments.scene.file_stem().unwrap_or_default().to_string_lossy();
    Export::check_folder(&arguments.out, &stem)?;
    let bar = ProgressBar::no_length().with_style(
        ProgressStyle::with_template("{bar:40} tick {pos}/{len}, {elapsed} gone, {eta} to go")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let export = bake(&arguments.scene, &options, |progress| {
        bar.set_length(progress.ticks.into());
        bar.set_position(progress.tick.into());
    })?;
    bar.finish_and_clear();
    for path in export.write(&arguments.out, &stem)? {
        print(path.display())?;
    }
    Ok(())
}
