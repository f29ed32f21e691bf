//! What has become of a surface, texel by texel.

use super::look::Held;
use crate::matter::TexelMatter;
use crate::matter::snow::RELATIVE_DENSITY;
use crate::overlay::SurfaceTotals;
use crate::replay::SurfaceMaps;
use crate::wetting::Now;

/// What has become of one surface.
#[derive(Debug, Clone)]
pub(super) struct Soaked {
    pub(super) area_m2: f64,
    pub(super) triangles: u32,
    pub(super) totals: SurfaceTotals,
    /// Texel by texel, also beside the islands.
    pub(super) held: Vec<Held>,
}

impl Soaked {
    /// Of a surface with these maps.
    pub(super) fn new(maps: &SurfaceMaps, now: &Now, totals: SurfaceTotals, triangles: u32) -> Self {
        Self {
            area_m2: now.geometry.area_mm2().iter().copied().map(f64::from).sum::<f64>() / 1e6,
            triangles,
            totals,
            held: held(maps, now),
        }
    }
}

/// What lies on each texel now, and how it looks.
fn held(maps: &SurfaceMaps, now: &Now) -> Vec<Held> {
    // Empty where nothing has been painted.
    let channels = |map: &[u8], texel: usize| {
        let (texels, _) = map.as_chunks::<4>();
        texels.get(texel).map_or([0.0; 4], |texel| texel.map(|channel| f32::from(channel) / 255.0))
    };
    let (water, matter) = (&maps.water, &maps.matter);
    let one = |texel: u32| {
        // Beside an island, what lies at its border.
        let texel = now.geometry.stand_in(texel).unwrap_or(texel);
        let index = texel as usize;
        let mut held = Held::default();
        if let Some(state) = water.texels().get(index) {
            let amounts = now.amounts(&now.scale(water.units(), texel), texel, state);
            let look = now.look(&amounts, state);
            held.wetness = look.wetness as f32;
            held.gloss = look.gloss as f32;
            held.film_mm = (amounts.film_mm * look.film) as f32;
        }
        let unit_mm = now.geometry.unit_mm(water.units(), texel);
        let depth = |units: u32| (f64::from(units) * unit_mm) as f32;
        let TexelMatter { dust, mud, snow } = matter.texels().get(index).copied().unwrap_or_default();
        (held.dust_mm, held.mud_mm) = (depth(dust), depth(mud));
        held.snow_mm = depth(snow) / RELATIVE_DENSITY as f32;
        held.diffuse = channels(&maps.diffuse, index);
        held.specular = channels(&maps.specular, index);
        held.normal = channels(&maps.normal, index);
        held
    };
    (0..maps.size * maps.size).map(one).collect()
}
