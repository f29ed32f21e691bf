//! The program's smaller tools, run as their users run them.

use std::path::Path;
use std::process::{Command, Output};

use bevy_weathering::prelude::WeatherEffect;
use image::RgbImage;

fn weathering(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_weathering"));
    command.current_dir(folder).args(arguments.split_whitespace()).output().expect("the program runs")
}

fn clay(folder: &Path) -> RgbImage {
    let clay = RgbImage::from_fn(4, 4, |x, y| image::Rgb([180, 120 + x as u8, 100 + y as u8]));
    clay.save(folder.join("clay.png")).unwrap();
    clay
}

#[test]
fn wet_textures_are_written_for_every_model() {
    let folder = tempfile::tempdir().unwrap();
    let dry = clay(folder.path());
    for options in [
        "",
        "--shift 0.1 --lerp 0.05",
        "--model ld",
        "--model tbm --porosity 0.5",
        "--model lagarde --porosity 0.8",
    ] {
        let output = weathering(folder.path(), &format!("wet-texture clay.png {options}"));
        assert!(output.status.success(), "{options}: {}", String::from_utf8_lossy(&output.stderr));
        let wet = image::open(folder.path().join("clay_wet.png")).unwrap().to_rgb8();
        assert_eq!(wet.dimensions(), dry.dimensions());
        let darker = |(wet, dry): (&u8, &u8)| wet < dry;
        assert!(wet.as_raw().iter().zip(dry.as_raw()).all(darker), "{options}");
    }
    let nothing =
        weathering(folder.path(), "wet-texture clay.png --model lagarde --porosity 0 --out same.png");
    assert!(nothing.status.success());
    assert_eq!(image::open(folder.path().join("same.png")).unwrap().to_rgb8(), dry);
}

#[test]
fn wet_textures_refuse_nonsense_and_write_nothing() {
    let folder = tempfile::tempdir().unwrap();
    clay(folder.path());
    std::fs::write(folder.path().join("text.png"), "no picture").unwrap();
    for (arguments, named) in [
        ("clay.png --model ld --porosity 1.5", "porosity"),
        ("clay.png --shift NaN", "shift"),
        ("clay.png --model ld --lerp 0.5", "--lerp"),
        ("clay.png --model glass", "glass"),
        ("text.png", "text.png"),
        ("nowhere.png", "nowhere.png"),
    ] {
        let output = weathering(folder.path(), &format!("wet-texture {arguments} --out out/wet.png"));
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(message.contains(named) && !message.contains("panicked"), "{arguments}: {message}");
        assert!(!folder.path().join("out").exists(), "{arguments}");
    }
}

#[test]
fn stamps_are_written_as_strips_and_an_effect_can_use_them() {
    let folder = tempfile::tempdir().unwrap();
    let output = weathering(folder.path(), "stamps --out marks --kind splat --variants 3 --size 32");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut files = std::collections::BTreeMap::new();
    for map in ["diffuse", "specular", "normal"] {
        let name = format!("splat_{map}.png");
        let bytes = std::fs::read(folder.path().join("marks").join(&name)).unwrap();
        let strip = image::load_from_memory(&bytes).unwrap().to_rgba8();
        assert_eq!(strip.dimensions(), (96, 32));
        assert!(strip.pixels().any(|pixel| pixel.0[3] > 200) && strip.get_pixel(0, 0).0[3] == 0, "{map}");
        files.insert(name, bytes);
    }
    let effect = r#"(stamps: Images(
        diffuse: "splat_diffuse.png", specular: "splat_specular.png", normal: "splat_normal.png", variants: 3,
    ))"#;
    let effect = WeatherEffect::from_ron(effect.as_bytes()).unwrap();
    assert_eq!(effect.stamps.read(&files).unwrap().unwrap().variants.len(), 3);
    for (arguments, named) in [("--size 33", "size"), ("--variants 0", "variants"), ("--kind glass", "glass")]
    {
        let output = weathering(folder.path(), &format!("stamps --out none {arguments}"));
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(message.contains(named) && !message.contains("panicked"), "{arguments}: {message}");
        assert!(!folder.path().join("none").exists(), "{arguments}");
    }
}
