//! Stamps: the marks that impacts leave, as textures.
//!
//! A stamp is a square seen from above, made from the height of what lies there. Three images hold it, none of them
//! premultiplied; in each, alpha is coverage, and the texels along the edges are free:
//!
//! | map | red | green | blue |
//! |---|---|---|---|
//! | diffuse | tint, linear | tint | tint |
//! | specular | reflectance | smoothness, 1 - perceptual roughness | 0 |
//! | normal | slope along u | slope along v | height |
//!
//! **Slopes** lean the way a normal does, downhill: 128 is flat, and 127 more is a fall by 1 for every 1 towards +u
//! (to the right) or +v (down the image); so it is `128 - 127 dh/du`. It is the convention of
//! [`slope_color`](crate::overlay::kernel::slope_color), where a raised dome is above 128 on its right, and of
//! [`painted_slopes`](crate::material::normals::painted_slopes), which reads them back to be laid on the surface's own normal:
//! green as DirectX has it, not as base normal maps do in Bevy. **Heights** are 255 at
//! [`StampKind::relief`], which is in radii of the stamp: half its side. So a stamp has the same slopes at any size.
//!
//! [`stamps()`] makes the variants of a kind side by side in a strip, and [`write_stamps`] keeps them in files. A
//! [`StampSet`] takes such strips, or a user's, to what painters read: 64 by 64 texels, premultiplied, sampled in
//! integers ([`sample`]); where a mark covers only a few texels of a map, from means of them ([`small`]).
//!
//! The same options give the same stamps on any machine: see `shapes.rs`. What this does not do: it paints nothing.

mod drop;
mod dust;
mod error;
mod field;
mod file;
mod mud;
mod read;
mod runnel;
pub mod sample;
mod shapes;
pub mod small;
mod snow;

use bevy::prelude::Reflect;
use serde::{Deserialize, Serialize};

use field::{Field, Shape, soft_rim};
use shapes::Dice;

pub use error::{StampError, StampMap};
pub use file::write_stamps;
pub use read::{RgbaStrip, Stamp, StampSet, StampTexel};

/// The marks that can be made.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum StampKind {
    /// A drop's spot, with a raised rim
    Drop,
    /// A patch of drops, for particles that stand for several
    Drops,
    /// Thrown mud: a thick body with fingers
    Splat,
    /// A thin cloud of fine grains
    Dust,
    /// A clump of snow crystals
    Flakes,
    /// A run down from where a slug of water hit
    Runnel,
}

impl StampKind {
    /// Every kind.
    pub const ALL: [Self; 6] = [Self::Drop, Self::Drops, Self::Splat, Self::Dust, Self::Flakes, Self::Runnel];

    /// As in the names of files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Drop => "drop",
            Self::Drops => "drops",
            Self::Splat => "splat",
            Self::Dust => "dust",
            Self::Flakes => "flakes",
            Self::Runnel => "runnel",
        }
    }

    /// The height that is 255 in the normal map, in radii of the stamp; nothing is higher.
    pub fn relief(self) -> f32 {
        match self {
            Self::Drop => 0.07,
            Self::Drops => 0.04,
            Self::Splat => 0.16,
            Self::Dust => 0.015,
            Self::Flakes => 0.11,
            Self::Runnel => 0.09,
        }
    }

    fn shape(self, dice: &mut Dice, soft: f32) -> Box<dyn Shape> {
        match self {
            Self::Drop => Box::new(drop::Spots::one(dice, soft)),
            Self::Drops => Box::new(drop::Spots::several(dice, soft)),
            Self::Splat => Box::new(mud::Mud::new(dice, soft)),
            Self::Dust => Box::new(dust::Dust::new(dice)),
            Self::Flakes => Box::new(snow::Snow::new(dice, soft)),
            Self::Runnel => Box::new(runnel::Runnel::new(dice, soft)),
        }
    }
}

/// What stamps are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StampOptions {
    /// Texels along each side of a stamp: 16, 32, 64, 128 or 256.
    pub size: u32,
    /// Stamps of a kind, 1 to [`StampSet::MAX_VARIANTS`].
    pub variants: u32,
    /// Another one, other stamps.
    pub seed: u64,
}

impl Default for StampOptions {
    fn default() -> Self {
        Self { size: sample::STAMP_SIZE, variants: 4, seed: 0 }
    }
}

impl StampOptions {
    /// Checks every number against the range its field documents.
    ///
    /// # Errors
    /// [`StampError::Parameter`].
    pub fn validate(&self) -> Result<(), StampError> {
        read::check_variants(self.variants)?;
        if read::is_stamp_size(self.size) {
            return Ok(());
        }
        let expected = "16, 32, 64, 128 or 256";
        Err(StampError::Parameter { name: "size", value: self.size, expected })
    }
}

/// Stamps of one kind: in each map its variants, from left to right.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StampStrips {
    /// Colour.
    pub diffuse: RgbaStrip,
    /// Reflectance and smoothness.
    pub specular: RgbaStrip,
    /// Slopes and height.
    pub normal: RgbaStrip,
}

/// Makes stamps. A variant depends on the kind, its number, the seed and the size, and not on how many there are.
///
/// # Errors
/// [`StampError::Parameter`].
pub fn stamps(kind: StampKind, options: &StampOptions) -> Result<StampStrips, StampError> {
    options.validate()?;
    let &StampOptions { size, variants, seed } = options;
    let field = |variant| {
        let shape = kind.shape(&mut Dice::new(seed, kind as u32, variant), soft_rim(size));
        Field::new(shape.as_ref(), size, kind.relief())
    };
    let fields: Vec<Field> = (0..variants).map(field).collect();
    let blank = || RgbaStrip { width: size * variants, height: size, pixels: Vec::new() };
    let mut strips = [blank(), blank(), blank()];
    for y in 0..size {
        for field in &fields {
            for x in 0..size {
                for (strip, pixel) in strips.iter_mut().zip(field.maps(x, y)) {
                    strip.pixels.push(pixel);
                }
            }
        }
    }
    let [diffuse, specular, normal] = strips;
    Ok(StampStrips { diffuse, specular, normal })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(size: u32, variants: u32, seed: u64) -> StampOptions {
        StampOptions { size, variants, seed }
    }

    /// Each stamp of 64 texels a side: kind and rows of its three maps.
    fn all() -> Vec<(StampKind, [Vec<[u8; 4]>; 3])> {
        let stamp = |strip: &RgbaStrip, variant: usize| -> Vec<[u8; 4]> {
            strip.pixels.chunks(256).flat_map(|row| row[64 * variant..][..64].to_vec()).collect()
        };
        let of_kind = |kind| {
            let strips = stamps(kind, &options(64, 4, 0)).unwrap();
            (0..4).map(move |variant| {
                let maps = [&strips.diffuse, &strips.specular, &strips.normal];
                (kind, maps.map(|strip| stamp(strip, variant)))
            })
        };
        StampKind::ALL.into_iter().flat_map(of_kind).collect()
    }

    #[test]
    fn edges_are_free_and_nothing_is_cut_off_at_them() {
        for (kind, maps) in all() {
            let from_edge = |at: usize| {
                let (x, y) = (at % 64, at / 64);
                x.min(y).min(63 - x).min(63 - y)
            };
            for (at, pixel) in maps[0].iter().enumerate() {
                match from_edge(at) {
                    0 | 1 => assert_eq!(pixel[3], 0, "{kind:?} {at}"),
                    // Here the square of the shape ends: what comes so far has faded.
                    2 => assert!(pixel[3] < 40, "{kind:?} {at}: {pixel:?}"),
                    _ => {}
                }
            }
        }
    }

    #[test]
    fn maps_cover_the_same_and_enough_to_be_seen() {
        for (kind, [diffuse, specular, normal]) in all() {
            let alpha = |map: &[[u8; 4]]| map.iter().map(|pixel| pixel[3]).collect::<Vec<_>>();
            assert_eq!(alpha(&diffuse), alpha(&specular), "{kind:?}");
            assert_eq!(alpha(&diffuse), alpha(&normal), "{kind:?}");
            let covered =
                alpha(&diffuse).iter().map(|&alpha| f32::from(alpha)).sum::<f32>() / (255.0 * 4096.0);
            assert!((0.03..0.6).contains(&covered), "{kind:?}: {covered}");
            assert!(specular.iter().all(|pixel| pixel[2] == 0));
        }
    }

    #[test]
    fn slopes_are_the_differences_of_heights() {
        for (kind, [.., normal]) in all() {
            let height = |x: usize, y: usize| f32::from(normal[y * 64 + x][2]) / 255.0 * kind.relief();
            let slope = |byte: u8| (f32::from(byte) - 128.0) / 127.0;
            // Heights are rounded to half a 255th, slopes to half a 127th.
            let tolerance = kind.relief() / 255.0 * 16.0 + 0.51 / 127.0;
            for y in 1..63 {
                for x in 1..63 {
                    let [along_u, along_v, ..] = normal[y * 64 + x].map(slope);
                    let fall_u = (height(x - 1, y) - height(x + 1, y)) * 16.0;
                    let fall_v = (height(x, y - 1) - height(x, y + 1)) * 16.0;
                    for (slope, fall) in [(along_u, fall_u), (along_v, fall_v)] {
                        let off = (slope - fall.clamp(-1.0, 1.0)).abs();
                        assert!(off <= tolerance, "{kind:?} {x} {y}: {slope} for {fall}");
                    }
                }
            }
        }
    }

    #[test]
    fn slopes_add_up_to_the_relief() {
        for (kind, [.., normal]) in all() {
            // By parts: what falls, times where it falls, is as much as there is to fall.
            let (mut moments, mut volume) = ([0.0; 2], 0.0);
            for (at, pixel) in normal.iter().enumerate() {
                let place = [at % 64, at / 64].map(|texel| (texel as f32 + 0.5) / 32.0 - 1.0);
                for ((moment, byte), place) in moments.iter_mut().zip(pixel).zip(place) {
                    *moment += (f32::from(*byte) - 128.0) / 127.0 * place;
                }
                volume += f32::from(pixel[2]) / 255.0 * kind.relief();
            }
            for moment in moments {
                assert!((moment / volume - 1.0).abs() < 0.08, "{kind:?}: {moment} for {volume}");
            }
        }
    }

    #[test]
    fn stamps_repeat_and_differ_by_seed_and_variant_alone() {
        for kind in StampKind::ALL {
            let small = stamps(kind, &options(32, 2, 7)).unwrap();
            assert_eq!(small, stamps(kind, &options(32, 2, 7)).unwrap());
            assert_ne!(small, stamps(kind, &options(32, 2, 8)).unwrap());
            let first = |strips: &StampStrips, variant: usize| -> Vec<[u8; 4]> {
                let width = strips.diffuse.width as usize;
                strips
                    .diffuse
                    .pixels
                    .chunks(width)
                    .flat_map(|row| row[32 * variant..][..32].to_vec())
                    .collect()
            };
            assert_ne!(first(&small, 0), first(&small, 1), "{kind:?}");
            let more = stamps(kind, &options(32, 3, 7)).unwrap();
            assert_eq!([0, 1].map(|i| first(&small, i)), [0, 1].map(|i| first(&more, i)), "{kind:?}");
        }
    }

    #[test]
    fn any_size_is_the_same_stamp() {
        for kind in StampKind::ALL {
            let covered = [32, 64, 128].map(|size| {
                let strips = stamps(kind, &options(size, 1, 3)).unwrap();
                let sum: u32 = strips.diffuse.pixels.iter().map(|pixel| u32::from(pixel[3])).sum();
                // The free edges take more of a small one.
                let filled = 1.0 - 4.0 / size as f32;
                sum as f32 / (size * size) as f32 / (filled * filled)
            });
            for (i, size) in [(0, 32), (2, 128)] {
                let off = covered[i] / covered[1] - 1.0;
                assert!(off.abs() < 0.25, "{kind:?} {size}: {covered:?}");
            }
        }
    }

    #[test]
    fn nonsense_is_named() {
        let error =
            |size, variants| stamps(StampKind::Drop, &options(size, variants, 0)).unwrap_err().to_string();
        for size in [0, 8, 48, 512, u32::MAX] {
            assert!(
                error(size, 1).contains(&format!("`size` is {size}, but must be 16")),
                "{}",
                error(size, 1)
            );
        }
        for variants in [0, 17, u32::MAX] {
            assert!(error(64, variants).contains(&format!("`variants` is {variants}, but must be 1 to 16")));
        }
    }
}
