//! A contact sheet: some pictures of a run side by side, each with its time below.

use std::path::{Path, PathBuf};

use bevy::math::UVec2;
use image::imageops::{replace, thumbnail};
use image::{ImageFormat, Rgb, RgbImage};

use super::{ReplayError, ReplayOptions};
use crate::picture::{read_picture, write_picture};

pub(super) const SHEET_FILE: &str = "sheet.png";

/// The widest picture on a sheet, pixels.
const WIDEST: u32 = 320;
const GAP: u32 = 8;
const BACKGROUND: Rgb<u8> = Rgb([255; 3]);
const INK: Rgb<u8> = Rgb([32; 3]);
/// Pixels of a sheet for each of a glyph.
const MAGNIFIED: u32 = 2;

/// Writes `count` of the pictures, evenly spread from the first to the last, in rows. With each picture comes its time in
/// seconds. Nothing is written of no pictures.
///
/// # Errors
/// [`ReplayError::Picture`].
pub(super) fn write_sheet(
    out: &Path,
    pictures: &[(f64, PathBuf)],
    count: u32,
) -> Result<Option<PathBuf>, ReplayError> {
    let chosen: Vec<_> = spread(pictures.len(), count as usize).map(|at| &pictures[at]).collect();
    let Some((_, first)) = chosen.first() else { return Ok(None) };
    let read = |path: &Path| read_picture(path, ImageFormat::Png, ReplayOptions::MAX_SIZE);
    let first = read(first)?;
    let width = first.width().min(WIDEST);
    let height = (u64::from(first.height()) * u64::from(width) / u64::from(first.width())).max(1) as u32;
    let cell = UVec2::new(width, height + GLYPH.y * MAGNIFIED + GAP) + GAP;
    let across = (chosen.len() as f64).sqrt().ceil() as u32;
    let rows = (chosen.len() as u32).div_ceil(across);
    let mut sheet = RgbImage::from_pixel(across * cell.x + GAP, rows * cell.y + GAP, BACKGROUND);
    for (number, (seconds, path)) in chosen.into_iter().enumerate() {
        let number = number as u32;
        let corner = UVec2::new(number % across, number / across) * cell + GAP;
        let small = thumbnail(&read(path)?.to_rgb8(), width, height);
        replace(&mut sheet, &small, corner.x.into(), corner.y.into());
        draw_text(&mut sheet, corner + UVec2::new(0, height + GAP / 2), &format!("{seconds:.2} s"));
    }
    let path = out.join(SHEET_FILE);
    write_picture(&path, &sheet.into(), ImageFormat::Png)?;
    Ok(Some(path))
}

/// Up to `count` numbers below `len`, evenly spread, with the first and the last.
fn spread(len: usize, count: usize) -> impl Iterator<Item = usize> {
    let count = count.min(len);
    let steps = count.saturating_sub(1).max(1);
    (0..count).map(move |number| number * (len - 1) / steps)
}

/// Columns and rows of a glyph.
const GLYPH: UVec2 = UVec2::new(5, 7);

/// What times are written with: rows from the top, the lowest bit on the right.
const GLYPHS: [(char, [u8; GLYPH.y as usize]); 12] = [
    ('0', [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110]),
    ('1', [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110]),
    ('2', [0b01110, 0b10001, 0b00001, 0b00110, 0b01000, 0b10000, 0b11111]),
    ('3', [0b11111, 0b00010, 0b00100, 0b00010, 0b00001, 0b10001, 0b01110]),
    ('4', [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010]),
    ('5', [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110]),
    ('6', [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110]),
    ('7', [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000]),
    ('8', [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110]),
    ('9', [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100]),
    ('.', [0b00000, 0b00000, 0b00000, 0b00000, 0b00000, 0b01100, 0b01100]),
    ('s', [0b00000, 0b00000, 0b01111, 0b10000, 0b01110, 0b00001, 0b11110]),
];

/// Draws text from this corner to the right, as far as there is room. Characters without a glyph are left blank.
fn draw_text(picture: &mut RgbImage, corner: UVec2, text: &str) {
    for (place, character) in text.chars().enumerate() {
        let Some((_, rows)) = GLYPHS.iter().find(|(known, _)| *known == character) else { continue };
        let left = place as u32 * (GLYPH.x + 1);
        for y in 0..GLYPH.y * MAGNIFIED {
            for x in 0..GLYPH.x * MAGNIFIED {
                let row = rows[(y / MAGNIFIED) as usize];
                let is_ink = (row >> (GLYPH.x - 1 - x / MAGNIFIED)) & 1 == 1;
                let at = corner + UVec2::new(left * MAGNIFIED + x, y);
                if let Some(pixel) = picture.get_pixel_mut_checked(at.x, at.y).filter(|_| is_ink) {
                    *pixel = INK;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_spread_from_the_first_to_the_last() {
        let spread = |len, count| spread(len, count).collect::<Vec<_>>();
        assert_eq!(spread(10, 4), [0, 3, 6, 9]);
        assert_eq!(spread(3, 12), [0, 1, 2]);
        assert_eq!(spread(5, 1), [0]);
        assert!(spread(0, 12).is_empty() && spread(5, 0).is_empty());
    }

    #[test]
    fn a_sheet_holds_the_pictures_and_their_times() {
        let folder = tempfile::tempdir().unwrap();
        let picture = |number: u8| {
            let path = folder.path().join(format!("{number}.png"));
            RgbImage::from_pixel(640, 320, Rgb([number * 60, 200, 0])).save(&path).unwrap();
            (f64::from(number), path)
        };
        let pictures: Vec<_> = (0..4).map(picture).collect();
        let path = write_sheet(folder.path(), &pictures, 3).unwrap().unwrap();
        let sheet = image::open(path).unwrap().to_rgb8();
        // Two rows of two; each picture half as large as it was, over a line of text.
        let cell = UVec2::new(320 + 8, 160 + 14 + 8 + 8);
        assert_eq!(sheet.dimensions(), (2 * cell.x + 8, 2 * cell.y + 8));
        let middle = |x: u32, y: u32| sheet.get_pixel(x * cell.x + 168, y * cell.y + 88).0;
        assert_eq!([middle(0, 0)[0], middle(1, 0)[0], middle(0, 1)[0]], [0, 60, 180]);
        assert_eq!(middle(1, 1), BACKGROUND.0);
        let is_ink = |x: u32, y: u32| *sheet.get_pixel(8 + x, 8 + 160 + 4 + y) == INK;
        // The zero of 0.00 s: its upper corners are blank, what is between them is not.
        assert!(!is_ink(0, 0) && is_ink(4, 0) && !is_ink(9, 0) && is_ink(0, 3));
        assert!(write_sheet(folder.path(), &[], 3).unwrap().is_none());
    }

    #[test]
    fn text_ends_where_the_picture_does() {
        let mut tiny = RgbImage::from_pixel(3, 3, BACKGROUND);
        draw_text(&mut tiny, UVec2::ZERO, "1234567890.s?");
        assert_eq!(tiny.dimensions(), (3, 3));
    }
}
