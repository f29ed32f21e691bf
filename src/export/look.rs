//! How weathered matter looks, as the parameters of a plain renderer.
//!
//! The models of [`material`](crate::material) work per light. A texture cannot: its colour is what they say for light and
//! viewer along the normal, where masking takes nothing. Water's own mirror becomes a lower roughness of the one lobe that a
//! glTF has, in proportion to the part of the point that mirrors; a film levels the normal as far as it is level.
//!
//! Not here: murky water, salts and tide marks, textures of porosity, light through wet cloth.

use bevy::math::{DVec2, DVec3};

use crate::material::film::layer::{film_coverage, film_levelness};
use crate::material::models::authored::authored;
use crate::material::models::film_on_pores::film_darkening;
use crate::material::models::hnat::{PorousParams, hnat_terms};
use crate::material::models::lekner_dorf::{LiquidFilm, N_WATER};
use crate::material::models::{lagarde, lekner_dorf, twomey};
use crate::material::normals::{relief_normal, reoriented};
use crate::material::{PorositySource, PorousMaterial, StandingWater, TextureMeaning, WettingModel};
use crate::matter::MatterLook;
use crate::matter::look::{dust_color_over, matter_cover, roughness_under, snow_albedo};

/// Perceptual roughness of water in pores, and of a film: as in `shaders/common/wet_layers.wgsl`.
const PORE_ROUGHNESS: f64 = 0.12;
const FILM_ROUGHNESS: f64 = 0.089;
/// Reflectance at normal incidence of what is no metal.
const DIELECTRIC: f64 = 0.04;

/// Matter as a glTF describes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dry {
    /// Linear.
    pub(super) color: [f64; 3],
    /// Perceptual.
    pub(super) roughness: f64,
    pub(super) metallic: f64,
    /// In the frame of tangents, unit.
    pub(super) normal: DVec3,
}

/// What lies on a point, and how it looks.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Held {
    /// 0..=1: of the matter, and how much of its pores mirrors.
    pub(super) wetness: f32,
    pub(super) gloss: f32,
    /// As much of it as is to be seen, mm.
    pub(super) film_mm: f32,
    /// Loose and bound soil without pores, snow as snow, mm.
    pub(super) dust_mm: f32,
    pub(super) mud_mm: f32,
    pub(super) snow_mm: f32,
    /// Colour maps, premultiplied, 0..=1.
    pub(super) diffuse: [f32; 4],
    pub(super) specular: [f32; 4],
    pub(super) normal: [f32; 4],
}

/// A model with all its constants.
#[derive(Debug, Clone)]
pub(super) struct WetModel {
    material: PorousMaterial,
    film: LiquidFilm,
    matter: MatterLook,
    levelling_mm: f64,
}

impl Held {
    /// On the way to another; `part` from 0 to 1.
    pub(super) fn mixed(&self, other: &Self, part: f32) -> Self {
        let mix = |a: f32, b: f32| a + (b - a) * part;
        let mix4 = |a: [f32; 4], b: [f32; 4]| std::array::from_fn(|i| mix(a[i], b[i]));
        Self {
            wetness: mix(self.wetness, other.wetness),
            gloss: mix(self.gloss, other.gloss),
            film_mm: mix(self.film_mm, other.film_mm),
            dust_mm: mix(self.dust_mm, other.dust_mm),
            mud_mm: mix(self.mud_mm, other.mud_mm),
            snow_mm: mix(self.snow_mm, other.snow_mm),
            diffuse: mix4(self.diffuse, other.diffuse),
            specular: mix4(self.specular, other.specular),
            normal: mix4(self.normal, other.normal),
        }
    }
}

impl WetModel {
    pub(super) fn new(material: &PorousMaterial, matter: MatterLook) -> Self {
        let n_solid = match material.model {
            WettingModel::LeknerDorf(coated) | WettingModel::HnatLeknerDorf(_, coated) => coated.n_solid,
            _ => 1.5,
        };
        let film = LiquidFilm::new(N_WATER, f64::from(n_solid.clamp(1.34, 4.0)));
        let levelling_mm = f64::from(StandingWater::default().levelling_mm);
        Self { material: *material, film, matter, levelling_mm: levelling_mm.max(1e-3) }
    }

    /// Matter with what lies on it.
    pub(super) fn weathered(&self, dry: &Dry, held: &Held) -> Dry {
        let mut look = painted(dry, held);
        let film_mm = f64::from(held.film_mm);
        let mut coverage = film_coverage(film_mm);
        let wetness = f64::from(held.wetness).max(coverage).clamp(0.0, 1.0);
        let gloss = f64::from(held.gloss).max(coverage).clamp(0.0, 1.0);
        let mut mirror = self.apply_model(&mut look, &mut coverage, wetness, gloss);
        let mut level = film_levelness(film_mm, self.levelling_mm) * film_coverage(film_mm);

        let cover = |mm: f32, grain: f32| matter_cover(f64::from(mm), f64::from(grain.max(1e-6)));
        let soil = [held.dust_mm, held.mud_mm].map(|mm| cover(mm, self.matter.grain_mm));
        let covered = 1.0 - (1.0 - soil[0]) * (1.0 - soil[1]);
        let snow = cover(held.snow_mm, self.matter.flake_mm);
        if covered > 0.0 || snow > 0.0 {
            look.color = std::array::from_fn(|i| {
                let [dry, wet] = [self.matter.dust_color[i], self.matter.mud_color[i]].map(f64::from);
                let soiled = dust_color_over(look.color[i], dry, wet, soil, wetness);
                snow_albedo(soiled, f64::from(self.matter.snow_color[i]), f64::from(held.snow_mm))
            });
            let [dry, wet] = [self.matter.dust_roughness, self.matter.mud_roughness].map(f64::from);
            let soiled = roughness_under(look.roughness, authored(dry, wet, wetness), covered);
            look.roughness = roughness_under(soiled, f64::from(self.matter.snow_roughness), snow);
            let hidden = 1.0 - (1.0 - covered) * (1.0 - snow);
            look.metallic *= 1.0 - hidden;
            look.normal = look.normal.lerp(DVec3::Z, hidden).normalize();
            mirror *= 1.0 - hidden;
            coverage *= 1.0 - snow;
            level *= 1.0 - snow;
        }
        // The mirrors of pores and film, in the one lobe that there is.
        look.roughness = authored(look.roughness, look.roughness.min(PORE_ROUGHNESS), mirror);
        look.roughness = authored(look.roughness, look.roughness.min(FILM_ROUGHNESS), coverage);
        look.normal = look.normal.lerp(DVec3::Z, level).normalize();
        look
    }

    /// What water does to the matter; the part of it that is pores which mirror.
    fn apply_model(&self, look: &mut Dry, coverage: &mut f64, wetness: f64, gloss: f64) -> f64 {
        let solid = 1.0 - look.metallic;
        let unit = |value: f32| f64::from(value.clamp(0.0, 1.0));
        match self.material.model {
            WettingModel::Hnat(pores) | WettingModel::HnatLeknerDorf(pores, _) => {
                let params = PorousParams {
                    alpha_poro: unit(pores.alpha_poro) * solid,
                    s_p: unit(pores.s_p),
                    m: unit(pores.m),
                    k_w: unit(pores.k_w),
                    sqrt_k: pores.sqrt_k,
                };
                let filmed = matches!(self.material.model, WettingModel::HnatLeknerDorf(..));
                let LiquidFilm { x, p, .. } = self.film;
                let mut water = 0.0;
                look.color = look.color.map(|dry| {
                    let terms = hnat_terms(params, unit(pores.k_s), dry, 1.0, 1.0, 0.0, 0.0, wetness);
                    water = terms.water;
                    // A metal has no diffuse light to lose.
                    let covered = if filmed { *coverage * solid } else { 0.0 };
                    let wet = terms.kd_wet - film_darkening(dry, params.alpha_poro, terms.g, x, p, covered);
                    match self.material.texture {
                        TextureMeaning::Solid => wet,
                        TextureMeaning::DryLook => dry * wet / terms.kd_dry.max(1e-6),
                    }
                });
                water * gloss / wetness.max(1e-4) * (1.0 - *coverage)
            }
            WettingModel::Lagarde(tweaked) => {
                let own = lagarde::porosity_from_gloss(lagarde::gloss_from_roughness(look.roughness));
                let guessed = match tweaked.source {
                    PorositySource::Scalar | PorositySource::Texture => 1.0,
                    PorositySource::MaskAndGloss | PorositySource::Gloss => own,
                };
                let specular = look.color.map(|color| authored(DIELECTRIC, color, look.metallic));
                let metalness = if tweaked.metalness_from_specular {
                    lagarde::metalness_from_specular(specular)
                } else {
                    look.metallic
                };
                let f = lagarde::kept_albedo(unit(tweaked.porosity) * guessed, metalness);
                look.color = look.color.map(|dry| lagarde::wet_albedo(dry, f, wetness));
                look.roughness = lagarde::wet_roughness(look.roughness, f, gloss);
                0.0
            }
            WettingModel::LeknerDorf(coated) => {
                let porous = unit(coated.porosity) * solid;
                let LiquidFilm { x, p, .. } = self.film;
                let wet = |dry| authored(dry, lekner_dorf::wet_diffuse(dry, x, p), wetness * porous);
                look.color = look.color.map(wet);
                *coverage = coverage.max(gloss * porous);
                0.0
            }
            WettingModel::Twomey(grains) => {
                let backscatter = f64::from(grains.backscatter.clamp(0.05, 1.0));
                let soaked = wetness * unit(grains.porosity) * solid;
                look.color =
                    look.color.map(|dry| authored(dry, twomey::wet_albedo(dry, backscatter), soaked));
                0.0
            }
            WettingModel::Authored(wet) => {
                let colors = wet.color.map(unit);
                look.color = std::array::from_fn(|i| {
                    authored(look.color[i], look.color[i] * colors[i], wetness * solid)
                });
                look.roughness = authored(look.roughness, unit(wet.roughness), gloss * solid);
                0.0
            }
        }
    }
}

/// Matter with the colour maps over it.
fn painted(dry: &Dry, held: &Held) -> Dry {
    let [diffuse, specular, normal] =
        [held.diffuse, held.specular, held.normal].map(|map| map.map(f64::from));
    let slopes = slopes(normal);
    // v grows downwards in an image, but the second axis of a glTF's tangent frame upwards.
    let relief = relief_normal(DVec2::new(slopes.x, -slopes.y));
    Dry {
        color: std::array::from_fn(|i| dry.color[i] * (1.0 - diffuse[3]) + diffuse[i]),
        roughness: dry.roughness * (1.0 - specular[3]) + specular[3] - specular[1],
        // What covers metal is none.
        metallic: dry.metallic * (1.0 - diffuse[3]),
        normal: if slopes == DVec2::ZERO { dry.normal } else { reoriented(dry.normal, relief) },
    }
}

/// Slopes of the normal map along u and v; rounding is no relief.
fn slopes([red, green, _, coverage]: [f64; 4]) -> DVec2 {
    let slopes = crate::material::normals::painted_slopes([red, green, coverage]);
    if slopes.abs().max_element() < 1e-4 { DVec2::ZERO } else { slopes }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Coated, Grains, Pores, Tweaked};

    const CLAY: Dry = Dry { color: [0.45, 0.22, 0.15], roughness: 0.8, metallic: 0.0, normal: DVec3::Z };

    fn looks() -> Vec<WetModel> {
        let models = [
            WettingModel::default(),
            WettingModel::HnatLeknerDorf(Pores::default(), Coated::default()),
            WettingModel::Lagarde(Tweaked::default()),
            WettingModel::LeknerDorf(Coated::default()),
            WettingModel::Twomey(Grains::default()),
            WettingModel::Authored(crate::material::WetLook::default()),
        ];
        let look =
            |model| WetModel::new(&PorousMaterial { model, ..Default::default() }, MatterLook::default());
        models.into_iter().map(look).collect()
    }

    #[test]
    fn dry_matter_stays_as_it_is() {
        for look in looks() {
            let dry = look.weathered(&CLAY, &Held::default());
            assert!((0..3).all(|i| (dry.color[i] - CLAY.color[i]).abs() < 1e-12), "{dry:?}");
            assert!((dry.roughness - CLAY.roughness).abs() < 1e-12 && dry.normal == DVec3::Z, "{dry:?}");
        }
    }

    #[test]
    fn wet_matter_is_darker_and_not_rougher_the_wetter_the_more() {
        for look in looks() {
            let mut before = CLAY;
            for wetness in [0.3, 0.7, 1.0] {
                let held = Held { wetness, gloss: wetness, ..Held::default() };
                let wet = look.weathered(&CLAY, &held);
                assert!((0..3).all(|i| wet.color[i] < before.color[i] && wet.color[i] > 0.0), "{wet:?}");
                assert!(wet.roughness <= before.roughness, "{wet:?}");
                before = wet;
            }
            let flooded = Held { wetness: 1.0, gloss: 1.0, film_mm: 2.0, ..Held::default() };
            assert!(look.weathered(&CLAY, &flooded).roughness < 0.1);
        }
    }

    #[test]
    fn metal_does_not_darken_but_mirrors_under_a_film() {
        let metal = Dry { metallic: 1.0, ..CLAY };
        for look in looks() {
            let held = Held { wetness: 1.0, gloss: 1.0, film_mm: 2.0, ..Held::default() };
            let wet = look.weathered(&metal, &held);
            assert!((0..3).all(|i| (wet.color[i] - metal.color[i]).abs() < 1e-9), "{wet:?}");
            assert!(wet.roughness < 0.1, "{wet:?}");
            let half_painted = Held { diffuse: [0.1, 0.1, 0.1, 0.5], ..Held::default() };
            assert_eq!(look.weathered(&metal, &half_painted).metallic, 0.5);
        }
    }

    #[test]
    fn a_film_levels_a_relief_and_snow_hides_colour() {
        let look = &looks()[0];
        let rough = Dry { normal: DVec3::new(0.6, 0.0, 0.8), ..CLAY };
        let film = |film_mm| look.weathered(&rough, &Held { film_mm, ..Held::default() }).normal.z;
        assert!(film(0.0) < film(0.2) && film(0.2) < film(5.0));
        let snow = look.weathered(&CLAY, &Held { snow_mm: 200.0, ..Held::default() });
        assert!(snow.color.iter().all(|&color| color > 0.8), "{snow:?}");
    }

    #[test]
    fn paint_lies_over_colour_and_leans_the_normal_along_u_and_against_v() {
        let held = Held {
            diffuse: [0.5, 0.0, 0.0, 0.5],
            normal: [192.0 / 255.0, 192.0 / 255.0, 0.0, 1.0],
            ..Held::default()
        };
        let look = looks()[0].weathered(&CLAY, &held);
        assert!((look.color[0] - 0.725).abs() < 1e-9);
        assert!(look.normal.x > 0.3 && look.normal.y < -0.3, "{look:?}");
    }
}
