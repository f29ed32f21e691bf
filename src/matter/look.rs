//! From what lies on a texel to what can be seen of it.
//!
//! Grains that lie at random cover `1 - exp(-3/2 h / g)` of a surface: each hides its cross-section, and the more there are the
//! more lie on each other (Beer-Lambert). Snow hides nothing by itself, it scatters: how much of the ground shines through
//! follows from Kubelka and Munk's layer over a ground, whose scattering is that of grains of ice (Warren 1982).
//!
//! Colours here are final: they go over the surface when water has done to it what it does. Wet soil has a colour of its
//! own, so that nothing darkens twice.
//!
//! Each function has a twin of the same name in `shaders/common/matter.wgsl`.
//!
//! - Kubelka 1948, *New contributions to the optics of intensely light-scattering materials*.
//! - Warren 1982, *Optical properties of snow*.

use bevy::prelude::*;
use bytemuck::{Pod, Zeroable};
use half::f16;
use serde::{Deserialize, Serialize};

use super::snow::RELATIVE_DENSITY;
use super::{SurfaceMatter, TexelMatter};
use crate::wetting::{TexelGeometry, Units};

/// How dust, mud and snow look, on all surfaces. May be changed at any time.
#[derive(Resource, Reflect, Serialize, Deserialize, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource, Default)]
#[serde(deny_unknown_fields, default)]
pub struct MatterLook {
    /// Dry soil, linear RGB, 0..=1.
    pub dust_color: [f32; 3],
    /// Perceptual roughness of dry soil, 0..=1.
    pub dust_roughness: f32,
    /// Soil soaked with water, linear RGB, 0..=1.
    pub mud_color: [f32; 3],
    /// Perceptual roughness of soaked soil, 0..=1.
    pub mud_roughness: f32,
    /// Deep snow, linear RGB, 0..=1.
    pub snow_color: [f32; 3],
    /// Perceptual roughness of snow, 0..=1.
    pub snow_roughness: f32,
    /// Width of a grain of soil, mm, above 0: the finer, the less of it covers.
    pub grain_mm: f32,
    /// Width of a flake, mm of snow, above 0: so much covers what gloss and relief there was.
    pub flake_mm: f32,
}

impl Default for MatterLook {
    fn default() -> Self {
        Self {
            dust_color: [0.42, 0.36, 0.28],
            dust_roughness: 0.95,
            mud_color: [0.16, 0.11, 0.07],
            mud_roughness: 0.6,
            snow_color: [0.9; 3],
            snow_roughness: 0.85,
            grain_mm: 0.05,
            flake_mm: 1.5,
        }
    }
}

/// A texel as the shader reads it: `TexelMatter` in `shaders/common/matter.wgsl` has the same fields.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct GpuTexelMatter {
    /// Loose (low) and bound soil, mm without pores, as two `f16`.
    pub dust_mud: u32,
    /// Depth of snow, mm of snow (low), as `f16`; the high half is 1 where the mesh lies, else 0.
    pub snow: u32,
}

impl GpuTexelMatter {
    /// The high half of [`Self::snow`] of a texel on the mesh.
    const LIES: u32 = 1 << 16;
}

/// The deepest that is told, mm: `f16` ends soon after.
const DEEPEST_MM: f64 = 60_000.0;

/// How dark a dry crust is, on the way from dry to wet soil.
pub const CRUST_PART: f64 = 0.25;

/// S: back-scattering of fresh snow, 1/mm: `3/4 (1 - g) 3 rho / (2 rho_ice r)`, with g .89, grains of 0.1 mm, 100 kg/m³.
pub const SNOW_SCATTERING_PER_MM: f64 = 0.135;

/// A texel as it is drawn.
pub(crate) fn pack_matter(
    matter: &SurfaceMatter,
    units: Units,
    geometry: &TexelGeometry,
    texel: u32,
) -> GpuTexelMatter {
    let bare =
        GpuTexelMatter { dust_mud: 0, snow: if geometry.lies(texel) { GpuTexelMatter::LIES } else { 0 } };
    // What is on maps of another size is gone.
    let texels: &[TexelMatter] = if matter.size == geometry.size() { matter.texels() } else { &[] };
    let Some(state) = texels.get(texel as usize).filter(|state| !state.is_clean()) else { return bare };
    let unit_mm = geometry.unit_mm(units, texel);
    let half = |units: u32, scale: f64| {
        u32::from(f16::from_f64((f64::from(units) * unit_mm * scale).min(DEEPEST_MM)).to_bits())
    };
    GpuTexelMatter {
        dust_mud: half(state.dust, 1.0) | half(state.mud, 1.0) << 16,
        snow: half(state.snow, 1.0 / RELATIVE_DENSITY) | bare.snow,
    }
}

/// Part of a surface that grains cover, `1 - exp(-3/2 h / g)`. `depth_mm`: h, 0 or more, without pores; `grain_mm`: g, above 0.
pub fn matter_cover(depth_mm: f64, grain_mm: f64) -> f64 {
    1.0 - (-1.5 * depth_mm.max(0.0) / grain_mm).exp()
}

/// Loose and bound soil as it is now: where a film has dried up since the texel was sent, all of it is bound, though nobody
/// has looked yet. `film_then_mm`, `film_mm`: of the texel as it was sent, and now; 0 or more.
pub fn settled_soil(dust_mm: f64, mud_mm: f64, film_then_mm: f64, film_mm: f64) -> [f64; 2] {
    if film_then_mm > 0.0 && film_mm <= 0.0 { [0.0, dust_mm + mud_mm] } else { [dust_mm, mud_mm] }
}

/// Colour of soil. `dry`, `wet`: a channel of its colours; `crust`: how much of it is bound; `wetness`; all 0..=1.
pub fn soil_color(dry: f64, wet: f64, crust: f64, wetness: f64) -> f64 {
    let dry = dry + (wet - dry) * CRUST_PART * crust;
    dry + (wet - dry) * wetness
}

/// A channel of a colour under mud, and dust over that. `base`: of the surface as water left it; `dry`, `wet`: of the soil;
/// `covers`: of dust and mud, by [`matter_cover`]; all 0..=1.
pub fn dust_color_over(base: f64, dry: f64, wet: f64, covers: [f64; 2], wetness: f64) -> f64 {
    let [dust, mud] = covers;
    let muddy = base + (soil_color(dry, wet, 1.0, wetness) - base) * mud;
    muddy + (soil_color(dry, wet, 0.0, wetness) - muddy) * dust
}

/// A channel of the albedo of snow over a ground: Kubelka-Munk,
/// `((Rg - R) / R E - R (Rg - 1/R)) / ((Rg - R) E - (Rg - 1/R))` with `E = exp(-S h (1/R - R))`. `ground`: Rg, 0..=1;
/// `deep`: R, of deep snow, clamped to .01..=.99; `depth_mm`: h, mm of snow, 0 or more.
pub fn snow_albedo(ground: f64, deep: f64, depth_mm: f64) -> f64 {
    let deep = deep.clamp(0.01, 0.99);
    let through = (-SNOW_SCATTERING_PER_MM * depth_mm.max(0.0) * (1.0 / deep - deep)).exp();
    let (above, below) = (ground - deep, ground - 1.0 / deep);
    (above / deep * through - deep * below) / (above * through - below)
}

/// How much deeper it lies before a place than behind it, mm. `before`, `here`, `after`: depths, mm; below 0 where nothing of the
/// mesh lies, as beside an island of the map: what lies `here` goes on there, or every island would have a rim.
pub fn heap_fall(before: f64, here: f64, after: f64) -> f64 {
    let depth = |depth: f64| if depth < 0.0 { here } else { depth };
    depth(before) - depth(after)
}

/// Perceptual roughness under a cover. `base`, `matter`: roughnesses; `cover`: by [`matter_cover`]; all 0..=1.
pub fn roughness_under(base: f64, matter: f64, cover: f64) -> f64 {
    base + (matter - base) * cover
}

#[cfg(test)]
mod tests {
    use super::super::test_world::{Ground, Place};
    use super::super::texel::MatterKind;
    use super::*;
    use crate::wetting::test_meshes::corner_of_a_map;

    #[test]
    fn a_layer_of_grains_as_thick_as_one_covers_most_and_layers_multiply() {
        assert_eq!([matter_cover(0.0, 0.05), matter_cover(-1.0, 0.05)], [0.0; 2]);
        assert!((matter_cover(0.05, 0.05) - 0.777).abs() < 0.001);
        // What two layers leave free is what one leaves of what the other leaves.
        let free = |depth| 1.0 - matter_cover(depth, 0.1);
        assert!((free(0.03) * free(0.05) - free(0.08)).abs() < 1e-12);
    }

    #[test]
    fn snow_over_snow_over_ground_is_deeper_snow_over_ground() {
        for ground in [0.0, 0.2, 0.9, 1.0] {
            assert!((snow_albedo(ground, 0.9, 0.0) - ground).abs() < 1e-12);
            assert!((snow_albedo(ground, 0.9, 1e4) - 0.9).abs() < 1e-6);
            let twice = snow_albedo(snow_albedo(ground, 0.9, 7.0), 0.9, 5.0);
            assert!((twice - snow_albedo(ground, 0.9, 12.0)).abs() < 1e-12, "{ground}");
            for mm in 1..60 {
                let [less, more] = [mm - 1, mm].map(|mm| snow_albedo(ground, 0.9, f64::from(mm)));
                assert!((more - 0.9).abs() <= (less - 0.9).abs() && (0.0..=1.0).contains(&more));
            }
        }
        // A centimetre over black is grey, a decimetre white.
        assert!((0.45..0.65).contains(&snow_albedo(0.0, 0.9, 10.0)));
        assert!(snow_albedo(0.0, 0.9, 100.0) > 0.85);
        assert!(snow_albedo(0.3, 1.0, 5.0).is_finite() && snow_albedo(0.3, 0.0, 5.0).is_finite());
    }

    #[test]
    fn dust_lies_over_mud_and_both_are_dark_when_wet() {
        let [dry, wet, base] = [0.4, 0.1, 0.8];
        let over = |covers, wetness| dust_color_over(base, dry, wet, covers, wetness);
        assert_eq!(over([0.0, 0.0], 1.0), base);
        assert!((over([1.0, 1.0], 0.0) - dry).abs() < 1e-12);
        let crust = over([0.0, 1.0], 0.0);
        assert!(crust < dry && crust > wet);
        assert!((over([0.0, 1.0], 1.0) - wet).abs() < 1e-12 && (over([1.0, 0.0], 1.0) - wet).abs() < 1e-12);
        assert_eq!(settled_soil(1.0, 2.0, 0.1, 0.0), [0.0, 3.0]);
        assert_eq!(settled_soil(1.0, 2.0, 0.0, 0.0), [1.0, 2.0]);
        assert_eq!(settled_soil(1.0, 2.0, 0.1, 0.05), [1.0, 2.0]);
    }

    #[test]
    fn depths_are_packed_as_halves() {
        let place = Place::flat(16, 0.01);
        let mut ground = Ground::new(&place);
        for (kind, mm) in [(MatterKind::Dust, 0.25), (MatterKind::Mud, 0.5), (MatterKind::Snow, 2.0)] {
            let units = ground.film_mm(&place, 33, mm);
            ground.matter.receive(33, kind, units);
        }
        let pack = |texel| pack_matter(&ground.matter, ground.water.units, &place.geometry, texel);
        let half = |bits: u32| f16::from_bits(bits as u16).to_f64();
        let halves = |word: u32| [word, word >> 16].map(half);
        let near = |found: [f64; 2], expected: [f64; 2]| {
            found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() <= 1e-3 * expected)
        };
        let packed = pack(33);
        assert!(near(halves(packed.dust_mud), [0.25, 0.5]), "{packed:?}");
        assert!((half(packed.snow) - 20.0).abs() <= 0.02 && packed.snow >> 16 == 1, "{packed:?}");
        let bare = GpuTexelMatter { dust_mud: 0, snow: 1 << 16 };
        assert_eq!(pack(34), bare);
        assert_eq!(pack_matter(&SurfaceMatter::default(), ground.water.units, &place.geometry, 33), bare);
    }

    #[test]
    fn beside_an_island_nothing_lies() {
        let (geometry, units) = (corner_of_a_map(), Units { shift: 0 });
        let pack = |texel| pack_matter(&SurfaceMatter::default(), units, &geometry, texel).snow >> 16;
        assert_eq!([pack(0), pack(16 + 2), pack(15), pack(16 * 12 + 12)], [1, 1, 0, 0]);
    }

    #[test]
    fn snow_falls_off_where_it_is_less_deep_and_not_where_the_map_ends() {
        assert_eq!(heap_fall(5.0, 4.0, 3.0), 2.0);
        assert_eq!(heap_fall(-1.0, 4.0, 3.0), 1.0);
        assert_eq!([heap_fall(4.0, 4.0, -1.0), heap_fall(-1.0, 4.0, -1.0)], [0.0; 2]);
    }
}
