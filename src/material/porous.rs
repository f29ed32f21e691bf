//! How a surface takes up water and looks with it.

use bevy::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::wetting::evolve::Matter;

/// How a surface takes up water and looks with it. On an entity with [`Weatherable`](crate::overlay::Weatherable);
/// without it, the default is used. May be changed at any time. [`PorousMaterial::BRICK`] and others are
/// [`presets`](super::presets).
#[derive(Component, Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default)]
#[serde(deny_unknown_fields, default)]
pub struct PorousMaterial {
    /// What water does to its look.
    pub model: WettingModel,
    /// What the base colour shows; only for models with [`Pores`].
    pub texture: TextureMeaning,
    /// The BRDF below the water.
    pub brdf: BaseBrdf,
    /// Seconds from the first water in a texel until it looks wet; 0 is at once.
    pub t_fill: f32,
    /// Water, in mm, that the pores can take up: porosity times depth. What comes on top stays a film. 0 is glazed.
    pub capacity_mm: f32,
    /// Absorbed water, in mm, at which the surface looks fully wet; no more than `capacity_mm` counts.
    pub visible_mm: f32,
    /// S, sorptivity, mm/√min: how fast a film is taken up. Brick 2, sandstone .8, concrete .15, asphalt .02.
    pub sorptivity: f32,
    /// θ_s, part of the matter's volume that is pores, above 0 to 1: the fewer, the wider a patch spreads.
    pub pore_volume: f32,
    /// Film, in mm, that does not run: .03 to .05 on smooth matter, .1 to .2 on rough.
    pub retained_mm: f32,
    /// How much longer the middle of a wet patch stays wet than its rim, in parts of the time `visible_mm` takes to dry.
    pub rim_delay: f32,
    /// Strength of the white salts that drying leaves behind, 0..=1.
    pub efflorescence: f32,
    /// Strength of the dark lines that drying leaves behind along the rims of wet patches, 0..=1.
    pub tide_mark: f32,
    /// Part of the diffuse light that comes out at the back when soaked, 0..=1: cloth and paper. The dry part is
    /// `StandardMaterial::diffuse_transmission`.
    pub wet_translucency: f32,
}

impl Default for PorousMaterial {
    /// [`PorousMaterial::TERRACOTTA`].
    fn default() -> Self {
        Self::TERRACOTTA
    }
}

impl PorousMaterial {
    /// What its pores do with water.
    pub fn matter(&self) -> Matter {
        let limit = |value: f32, most: f32| f64::from(value.clamp(0.0, most));
        Matter::new(limit(self.sorptivity, 1000.0), limit(self.capacity_mm, 1000.0))
    }

    /// Absorbed water that looks fully wet, mm: `visible_mm`, but no more than fits in; above 0.
    pub fn seen_mm(&self) -> f64 {
        let most = if self.capacity_mm > 0.0 { self.capacity_mm } else { 1000.0 };
        f64::from(self.visible_mm.min(most).max(1e-5))
    }

    /// Demand of the weather, mm, that goes by in the middle of a wet patch before its pores dry.
    pub fn reserve_mm(&self) -> f64 {
        f64::from(self.rim_delay.max(0.0)) * self.seen_mm()
    }

    /// Whether drying leaves anything behind.
    pub fn leaves_marks(&self) -> bool {
        self.efflorescence > 0.0 || self.tide_mark > 0.0
    }
}

/// A way to look wet. One per material, so that darkenings never stack by accident.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[reflect(Default)]
pub enum WettingModel {
    /// Filled pores give back no diffuse light and mirror instead; see [`hnat`](super::models::hnat). A film on top
    /// reflects, but does not darken.
    Hnat(Pores),
    /// The same in the pores, and over the solid between them the film of [`lekner_dorf`](super::models::lekner_dorf)
    /// where one lies.
    HnatLeknerDorf(Pores, Coated),
    /// Albedo down, gloss up; see [`lagarde`](super::models::lagarde).
    Lagarde(Tweaked),
    /// A film that follows the relief; see [`lekner_dorf`](super::models::lekner_dorf).
    LeknerDorf(Coated),
    /// Water between grains; see [`twomey`](super::models::twomey).
    Twomey(Grains),
    /// As painted; see [`authored`](super::models::authored).
    Authored(WetLook),
}

impl Default for WettingModel {
    fn default() -> Self {
        Self::Hnat(Pores::default())
    }
}

impl WettingModel {
    /// The pores, of the models that have them.
    pub fn pores(&self) -> Option<&Pores> {
        match self {
            Self::Hnat(pores) | Self::HnatLeknerDorf(pores, _) => Some(pores),
            _ => None,
        }
    }
}

/// Parameters of the porous BRDF.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[reflect(Default)]
#[serde(deny_unknown_fields, default)]
pub struct Pores {
    /// α_poro, the part of the surface that is pores; 0 (glazed) to 1.
    pub alpha_poro: f32,
    /// s_p, shape of a pore from deep (near 0) to shallow (1). Deep pores are dark when dry already, so .005 to
    /// .15 show wetness best.
    pub s_p: f32,
    /// m, RMS slope of the surface between pores, 0..=1.
    pub m: f32,
    /// k_s, the part of the light that the dry surface scatters back without entering it, 0..=1. What of it falls
    /// into pores is a whitish veil over the dry colour, which water takes away: the more, the more saturated wet.
    pub k_s: f32,
    /// k_w, strength of the water's own reflection, 0..=1.
    pub k_w: f32,
    /// Uses k = sqrt(2 m²/π) (Schlick 1994) instead of k = 2 m²/π as printed.
    pub sqrt_k: bool,
}

impl Pores {
    /// Those of fired clay: the default.
    pub const TERRACOTTA: Self =
        Self { alpha_poro: 0.5, s_p: 0.02, m: 0.35, k_s: 0.04, k_w: 0.9, sqrt_k: false };
}

impl Default for Pores {
    fn default() -> Self {
        Self::TERRACOTTA
    }
}

/// Parameters of a film over rough matter.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[reflect(Default)]
#[serde(deny_unknown_fields, default)]
pub struct Coated {
    /// Part of the surface that is rough matter and takes the film, 0 (glazed) to 1.
    pub porosity: f32,
    /// Refractive index of the solid, 1.34..=4.
    pub n_solid: f32,
}

impl Coated {
    /// A solid as dense as glass, rough everywhere: the default.
    pub const ROUGH: Self = Self { porosity: 1.0, n_solid: 1.5 };
}

impl Default for Coated {
    fn default() -> Self {
        Self::ROUGH
    }
}

/// Parameters of matter made of grains.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[reflect(Default)]
#[serde(deny_unknown_fields, default)]
pub struct Grains {
    /// Part of the surface that is grains, 0 (glazed) to 1.
    pub porosity: f32,
    /// How much less light a grain turns back in water, 0.05..=1; 1 is no difference.
    pub backscatter: f32,
}

impl Grains {
    /// Nothing but grains: the default.
    pub const SAND: Self =
        Self { porosity: 1.0, backscatter: super::models::twomey::WATER_BACKSCATTER as f32 };
}

impl Default for Grains {
    fn default() -> Self {
        Self::SAND
    }
}

/// Parameters of the tweak of albedo and gloss.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[reflect(Default)]
#[serde(deny_unknown_fields, default)]
pub struct Tweaked {
    /// 0 (glazed) to 1; what `source` says multiplies it.
    pub porosity: f32,
    /// Where porosity varies.
    pub source: PorositySource,
    /// Takes the metalness, which has no pores, from the specular colour instead of the material.
    pub metalness_from_specular: bool,
}

impl Default for Tweaked {
    fn default() -> Self {
        Self { porosity: 1.0, source: PorositySource::Scalar, metalness_from_specular: false }
    }
}

/// Where the porosity of a texel comes from.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Default)]
pub enum PorositySource {
    /// The same everywhere.
    #[default]
    Scalar,
    /// The red channel of [`WettingTextures::surface`].
    Texture,
    /// The red channel as a mask of what may be porous, times what the gloss says.
    MaskAndGloss,
    /// What the gloss says: full up to .1, none from .5 on.
    Gloss,
}

/// A second set of parameters, for wetness 1.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq)]
#[reflect(Default)]
#[serde(deny_unknown_fields, default)]
pub struct WetLook {
    /// Linear RGB; multiplies [`WettingTextures::wet_color`] or, without it, the dry colour.
    pub color: [f32; 3],
    /// Perceptual roughness, 0..=1.
    pub roughness: f32,
    /// Bevy's reflectance: F0 = 0.16 reflectance².
    pub reflectance: f32,
}

impl Default for WetLook {
    fn default() -> Self {
        Self { color: [0.45; 3], roughness: 0.3, reflectance: 0.5 }
    }
}

/// What a base colour texture is a picture of.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Default)]
pub enum TextureMeaning {
    /// The porous surface, dry: a photograph. Wetness multiplies by `kd_w / kd'`.
    #[default]
    DryLook,
    /// The solid between the pores. Porosity darkens it dry, too.
    Solid,
}

/// The BRDF under the post-process.
#[derive(Reflect, Serialize, Deserialize, JsonSchema, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Default)]
pub enum BaseBrdf {
    /// Bevy's own: GGX and Burley's diffuse.
    #[default]
    Ggx,
    /// Blinn-Phong and Lambert, as in the paper.
    BlinnPhong,
}

/// Textures that say how water acts from place to place, in the uvs of the base colour. Optional, on the same entity.
#[derive(Component, Reflect, Debug, Clone, Default, PartialEq)]
#[reflect(Component, Default)]
pub struct WettingTextures {
    /// Red: porosity or mask, see [`PorositySource`]. Green: height of the relief, 1 is on top, see
    /// [`Flood`](super::Flood). Linear.
    pub surface: Option<Handle<Image>>,
    /// Base colour when wet, see [`WetLook`].
    pub wet_color: Option<Handle<Image>>,
}
