//! Effects, wet maps, photographs and stamps.

use std::collections::BTreeMap;
use std::fs;

use bevy_weathering::effect::WeatherEffect;
use bevy_weathering::wetmap::{GreyMap, read_map, read_photo, write_map};
use image::{Rgba, RgbaImage};

use super::harness::fuzz;
use super::{mutate, texts, write};

/// Stamps from pictures: four of 16 texels.
const IMAGES: &str = r#"(
    volume_mm3: 12.5,
    carries: Mud(0.4),
    drops: MarshallPalmer(10.0),
    terminal_speed: 6.0,
    flutter: 0.2,
    splash: 0.1,
    jet: true,
    stamps: Images(diffuse: "stamp.png", specular: None, normal: "stamp.png", variants: 4),
    stamp_radius: 0.02,
    stamp_speed: 5.0,
    stamp_turn: Flight,
    stamp_stretch: 2.0,
    diffuse: (color: (0.3, 0.2, 0.1), opacity: 0.5),
    look: (color: (0.5, 0.5, 0.5, 0.4), width: 0.004, exposure: 0.01, sprite: Drop, splash: 0.01),
)"#;

/// A strip of four stamps as a PNG.
fn strip() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    RgbaImage::from_fn(64, 16, |x, y| Rgba([x as u8, y as u8, 99, (x * y) as u8]))
        .write_to(&mut bytes, image::ImageFormat::Png)
        .expect("it can be encoded");
    bytes.into_inner()
}

#[test]
fn spoilt_effects_are_loaded_or_refused() {
    let mut corpus = texts("effects");
    corpus.extend([IMAGES.to_owned(), IMAGES.to_owned()]);
    let strip = strip();
    let tally = fuzz("effects", 2000, move |_, random| {
        let whole = mutate::pick(random, &corpus);
        let text = mutate::text(random, whole, &corpus);
        let effect = WeatherEffect::from_ron(&text).map_err(|error| error.to_string())?;
        let diameters = effect.drops.diameters_mm();
        assert!(diameters.iter().all(|mm| *mm > 0.0 && *mm <= 100.0), "{diameters:?}");
        let (water, rest) = effect.carries.parts_nl(u32::MAX);
        assert_eq!(water.checked_add(rest), Some(u32::MAX));
        let files: BTreeMap<_, _> =
            effect.stamps.files().map(|file| (file.to_owned(), strip.clone())).collect();
        // Making stamps takes a while.
        if !files.is_empty() || random.below(50) == 0 {
            effect.stamps.read(&files).map_err(|error| error.to_string())?;
        }
        Ok(())
    });
    assert!(tally.accepted > 80 && tally.refused > 400, "{tally:?}");
}

#[test]
fn spoilt_pictures_are_read_or_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name);
    let values = (0..48 * 32).map(|at| at as f32 / 1536.0).collect();
    let map = GreyMap::new(48, 32, values).expect("all values are 0 to 1");
    let mut corpus = vec![("png", strip())];
    for (name, kind) in [("map.png", "png"), ("map.exr", "exr")] {
        write_map(&path(name), &map).expect("it can be written");
        corpus.push((kind, fs::read(path(name)).expect("it was written")));
    }
    RgbaImage::new(8, 8).save(path("plain.png")).expect("it can be written");
    corpus.push(("png", fs::read(path("plain.png")).expect("it was written")));
    let effect = WeatherEffect::from_ron(IMAGES.as_bytes()).expect("it is whole");
    let tally = fuzz("pictures", 2000, move |number, random| {
        let (kind, picture) = mutate::pick(random, &corpus);
        let spoilt = if *kind == "png" {
            mutate::png(random, picture)
        } else {
            let mut spoilt = picture.clone();
            mutate::bytes(random, &mut spoilt);
            spoilt
        };
        let file = folder.path().join(format!("spoilt.{kind}"));
        write(&file, &spoilt);
        let named = |message: String| {
            assert!(message.contains("spoilt"), "no file is named: {message}");
            message
        };
        match number % 3 {
            0 => {
                let map = read_map(&file).map_err(|error| named(error.to_string()))?;
                assert!(map.values.iter().all(|value| (0.0..=1.0).contains(value)));
            }
            1 => drop(read_photo(&file).map_err(|error| named(error.to_string()))?),
            _ => {
                let files = BTreeMap::from([("stamp.png".to_owned(), spoilt)]);
                effect.stamps.read(&files).map_err(|error| error.to_string())?;
            }
        }
        Ok(())
    });
    assert!(tally.accepted > 5 && tally.refused > 600, "{tally:?}");
}
