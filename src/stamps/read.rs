//! Stamps as painters read them.
//!
//! Strips of any allowed size become squares of 64 by 64 texels, so that all stamps lie in one array: larger ones by
//! the mean over squares of texels, smaller ones by bilinear interpolation. Both weigh with alpha: texels are
//! premultiplied from here on, so that a texel without coverage adds none of its colour to its neighbours, whatever
//! an artist's program left there. A normal map premultiplied is flat, not tilted, where it covers nothing, just as
//! the maps of a surface are.

use bytemuck::{Pod, Zeroable};

use super::sample::{STAMP_SIZE, STAMP_TEXELS};
use super::{StampError, StampMap};

/// Variants of a map side by side: 8-bit RGBA, not premultiplied.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RgbaStrip {
    /// Texels along a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels, row by row from the top.
    pub pixels: Vec<[u8; 4]>,
}

/// A texel of a stamp: three premultiplied RGBA colours, red in the lowest byte. What their channels are, the
/// [module](super) says. A row of the GPU's array of stamps: `StampTexel` in `shaders/common/stamp.wgsl` has the same
/// fields in the same order.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct StampTexel {
    /// Tint and coverage.
    pub diffuse: u32,
    /// Reflectance, smoothness, unused, coverage.
    pub specular: u32,
    /// Slope along u and v, height, coverage.
    pub normal: u32,
    /// To 16 bytes.
    pub pad: u32,
}

/// One stamp.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stamp {
    /// [`STAMP_TEXELS`], row by row from the top.
    pub texels: Vec<StampTexel>,
}

/// Stamps to choose from, all of one kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StampSet {
    /// Texels along each side of every stamp: [`STAMP_SIZE`], whatever the size of the images.
    pub size: u32,
    /// 1 to [`Self::MAX_VARIANTS`].
    pub variants: Vec<Stamp>,
}

impl StampSet {
    /// The most variants in a strip.
    pub const MAX_VARIANTS: u32 = 16;

    /// Cuts strips of so many variants into stamps. A map that is missing is left alone: its coverage is 0
    /// everywhere.
    ///
    /// # Errors
    /// [`StampError::Parameter`] for `variants`; [`StampError::NoMaps`]; [`StampError::Strip`],
    /// [`StampError::Size`], [`StampError::Count`] and [`StampError::Sizes`] name the map that is wrong.
    pub fn from_images(
        diffuse: Option<&RgbaStrip>,
        specular: Option<&RgbaStrip>,
        normal: Option<&RgbaStrip>,
        variants: u32,
    ) -> Result<Self, StampError> {
        check_variants(variants)?;
        let maps = [(StampMap::Diffuse, diffuse), (StampMap::Specular, specular), (StampMap::Normal, normal)];
        let mut first: Option<(StampMap, u32)> = None;
        for (map, strip) in maps {
            let Some(strip) = strip else { continue };
            let size = strip.stamp_size(map, variants)?;
            let (other, other_size) = *first.get_or_insert((map, size));
            if size != other_size {
                return Err(StampError::Sizes { map, size, other, other_size });
            }
        }
        let Some((_, size)) = first else { return Err(StampError::NoMaps) };
        let taps: Vec<Vec<Tap>> = (0..STAMP_SIZE).map(|texel| taps(texel, size)).collect();
        let stamp = |variant: u32| {
            let [diffuse, specular, normal] = maps.map(|(_, strip)| match strip {
                Some(strip) => strip.resampled(variant * size, &taps),
                None => vec![0; STAMP_TEXELS as usize],
            });
            let texel = |((diffuse, specular), normal)| StampTexel { diffuse, specular, normal, pad: 0 };
            Stamp { texels: diffuse.into_iter().zip(specular).zip(normal).map(texel).collect() }
        };
        Ok(Self { size: STAMP_SIZE, variants: (0..variants).map(stamp).collect() })
    }
}

/// A texel that counts towards another one: where along the axis, and how much.
type Tap = (u32, u32);

/// What the texel of a stamp is made of along one axis, from a square of `size` texels. Weights have the same sum
/// for every texel.
fn taps(texel: u32, size: u32) -> Vec<Tap> {
    if size >= STAMP_SIZE {
        let along = size / STAMP_SIZE;
        return (texel * along..(texel + 1) * along).map(|source| (source, 1)).collect();
    }
    let (along, last) = ((STAMP_SIZE / size) as i32, size as i32 - 1);
    // From the middle of the first source texel to that of this one, in half texels of the stamp.
    let at = 2 * texel as i32 + 1 - along;
    let (low, part) = (at.div_euclid(2 * along), at.rem_euclid(2 * along));
    let tap = |source: i32, weight: i32| (source.clamp(0, last) as u32, weight as u32);
    vec![tap(low, 2 * along - part), tap(low + 1, part)]
}

impl RgbaStrip {
    /// Texels along each side of a stamp, if this is a strip of so many.
    fn stamp_size(&self, map: StampMap, variants: u32) -> Result<u32, StampError> {
        let Self { width, height, .. } = *self;
        if u64::from(height) * u64::from(variants) != u64::from(width) {
            return Err(StampError::Strip { map, width, height, variants });
        }
        if !is_stamp_size(height) {
            return Err(StampError::Size { map, size: height });
        }
        self.check_count(map)?;
        Ok(height)
    }

    /// That there is a pixel for every texel.
    pub(super) fn check_count(&self, map: StampMap) -> Result<(), StampError> {
        let Self { width, height, .. } = *self;
        let (needed, got) = (width as usize * height as usize, self.pixels.len());
        if needed == got { Ok(()) } else { Err(StampError::Count { map, width, height, needed, got }) }
    }

    /// One stamp of the strip, from its column `left` on, premultiplied and packed.
    fn resampled(&self, left: u32, taps: &[Vec<Tap>]) -> Vec<u32> {
        let texel = |(row, column): (&Vec<Tap>, &Vec<Tap>)| {
            let (mut sums, mut total) = ([0; 4], 0);
            for &(y, in_row) in row {
                for &(x, in_column) in column {
                    let [red, green, blue, alpha] =
                        self.pixels[(y * self.width + left + x) as usize].map(u32::from);
                    // At most 64 times 255 times 255.
                    let weight = in_row * in_column;
                    for (sum, channel) in sums.iter_mut().zip([red, green, blue, 255]) {
                        *sum += channel * alpha * weight;
                    }
                    total += 255 * weight;
                }
            }
            u32::from_le_bytes(sums.map(|sum| ((sum + total / 2) / total) as u8))
        };
        taps.iter().flat_map(|row| taps.iter().map(move |column| (row, column))).map(texel).collect()
    }
}

/// Whether a stamp may have so many texels along each side.
pub(super) fn is_stamp_size(size: u32) -> bool {
    size.is_power_of_two() && (16..=256).contains(&size)
}

pub(super) fn check_variants(variants: u32) -> Result<(), StampError> {
    if (1..=StampSet::MAX_VARIANTS).contains(&variants) {
        return Ok(());
    }
    Err(StampError::Parameter { name: "variants", value: variants, expected: "1 to 16 (MAX_VARIANTS)" })
}

#[cfg(test)]
mod tests {
    use super::super::{StampKind, StampOptions, stamps};
    use super::*;

    fn strip(size: u32, variants: u32, pixel: impl Fn(u32, u32) -> [u8; 4]) -> RgbaStrip {
        let width = size * variants;
        let pixels = (0..width * size).map(|i| pixel(i % width, i / width)).collect();
        RgbaStrip { width, height: size, pixels }
    }

    fn plain(size: u32, variants: u32) -> RgbaStrip {
        strip(size, variants, |_, _| [200, 100, 50, 255])
    }

    fn bytes(texel: u32) -> [u8; 4] {
        texel.to_le_bytes()
    }

    fn diffuse_only(diffuse: &RgbaStrip, variants: u32) -> Vec<Vec<[u8; 4]>> {
        let set = StampSet::from_images(Some(diffuse), None, None, variants).unwrap();
        let texels = |stamp: &Stamp| stamp.texels.iter().map(|texel| bytes(texel.diffuse)).collect();
        set.variants.iter().map(texels).collect()
    }

    #[test]
    fn made_stamps_come_back_premultiplied() {
        let made = stamps(StampKind::Splat, &StampOptions { variants: 3, ..Default::default() }).unwrap();
        let set =
            StampSet::from_images(Some(&made.diffuse), Some(&made.specular), Some(&made.normal), 3).unwrap();
        assert_eq!((set.size, set.variants.len()), (64, 3));
        for (variant, stamp) in set.variants.iter().enumerate() {
            assert_eq!(stamp.texels.len(), 64 * 64);
            for (at, texel) in stamp.texels.iter().enumerate() {
                let source = at / 64 * 192 + variant * 64 + at % 64;
                for (texel, strip) in [
                    (texel.diffuse, &made.diffuse),
                    (texel.specular, &made.specular),
                    (texel.normal, &made.normal),
                ] {
                    let [red, green, blue, alpha] = strip.pixels[source];
                    let by_alpha =
                        |channel: u8| (f32::from(channel) * f32::from(alpha) / 255.0).round() as u8;
                    assert_eq!(bytes(texel), [by_alpha(red), by_alpha(green), by_alpha(blue), alpha]);
                }
                assert_eq!(texel.pad, 0);
            }
        }
    }

    #[test]
    fn every_size_keeps_colour_place_and_coverage() {
        for size in [16, 32, 64, 128, 256] {
            // The first variant covered in its left half, the second in its upper.
            let halves = strip(size, 2, |x, y| {
                let covered = if x < size { x < size / 2 } else { y < size / 2 };
                [200, 100, 50, if covered { 255 } else { 0 }]
            });
            let stamps = diffuse_only(&halves, 2);
            let (left, upper) = (&stamps[0], &stamps[1]);
            for i in 0..64usize {
                for j in 0..64usize {
                    assert_eq!(left[i * 64 + j], upper[j * 64 + i], "{size}");
                }
            }
            let covered: u32 = left.iter().map(|texel| u32::from(texel[3])).sum();
            assert!(covered.abs_diff(64 * 32 * 255) < 64 * 64, "{size}: {covered}");
            assert_eq!((left[0], left[63]), ([200, 100, 50, 255], [0; 4]), "{size}");
            // The rim is steep at full size, and as wide as the coarse texels of a small one.
            let rim = left[..64].iter().filter(|texel| !matches!(texel[3], 0 | 255)).count();
            assert_eq!(rim as u32, if size < 64 { 64 / size } else { 0 }, "{size}");
        }
    }

    #[test]
    fn colours_of_free_texels_do_not_bleed() {
        for size in [16, 64, 256] {
            let chequered =
                strip(
                    size,
                    1,
                    |x, y| {
                        if (x / 3 + y / 3) % 2 == 0 { [10, 20, 30, 255] } else { [255, 255, 255, 0] }
                    },
                );
            for [red, green, blue, alpha] in &diffuse_only(&chequered, 1)[0] {
                for (channel, full) in [(red, 10.0), (green, 20.0), (blue, 30.0)] {
                    let expected = full * f32::from(*alpha) / 255.0;
                    assert!(
                        (f32::from(*channel) - expected).abs() <= 1.0,
                        "{size}: {channel} for {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn missing_maps_cover_nothing() {
        let set = StampSet::from_images(None, Some(&plain(32, 1)), None, 1).unwrap();
        let texel = set.variants[0].texels[77];
        assert_eq!((texel.diffuse, bytes(texel.specular), texel.normal), (0, [200, 100, 50, 255], 0));
    }

    #[test]
    fn errors_name_the_map_and_what_is_wrong() {
        let error = |diffuse: Option<&RgbaStrip>, normal: Option<&RgbaStrip>, variants| {
            StampSet::from_images(diffuse, None, normal, variants).unwrap_err().to_string()
        };
        let good = plain(64, 4);
        let cases: [(String, &[&str]); 11] = [
            (error(None, None, 4), &["none"]),
            (error(Some(&good), None, 0), &["`variants` is 0", "1 to 16"]),
            (error(Some(&good), None, 17), &["`variants` is 17"]),
            (error(Some(&good), None, 3), &["diffuse", "256 by 64", "3 times"]),
            (error(Some(&good), Some(&plain(32, 4)), 4), &["normal", "32", "diffuse", "64"]),
            (error(None, Some(&plain(8, 2)), 2), &["normal", "have 8 texels"]),
            (error(None, Some(&plain(48, 1)), 1), &["normal", "have 48 texels"]),
            (error(None, Some(&plain(512, 1)), 1), &["normal", "have 512 texels"]),
            (error(Some(&RgbaStrip { width: 0, height: 0, pixels: vec![] }), None, 1), &["diffuse", "0"]),
            (
                error(Some(&RgbaStrip { pixels: vec![[0; 4]; 5], ..good.clone() }), None, 4),
                &["diffuse", "needs 16384 pixels", "are 5"],
            ),
            (
                error(Some(&RgbaStrip { width: u32::MAX, height: u32::MAX, pixels: vec![] }), None, 16),
                &["diffuse", "16 times"],
            ),
        ];
        for (message, named) in cases {
            assert!(named.iter().all(|part| message.contains(part)), "{message}: {named:?}");
        }
    }
}
