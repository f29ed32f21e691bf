//! What of the shader a surface needs.

use bevy::prelude::*;
use bevy::shader::ShaderDefVal;

use super::WettingModel;

/// Chooses what is compiled into the shader of a surface. What it does not have costs nothing, so a surface on which
/// nothing fell is drawn as a `StandardMaterial` is; the price is another pipeline when that changes.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(C)]
pub struct PorousKey {
    /// Water fell on it.
    pub water: bool,
    /// Dust, mud or snow did.
    pub matter: bool,
    /// Colour, gloss or relief did.
    pub paint: bool,
    /// It has [`StandingWater`](super::StandingWater).
    pub standing: bool,
    /// It looks other than its `StandardMaterial` when dry, too.
    pub unlike_standard: bool,
    /// Drying leaves something behind.
    pub marks: bool,
    /// Its maps lie over the second uvs of its mesh ([`UvSet::Second`](crate::collision::UvSet)).
    pub second_uvs: bool,
    /// A [`PlayedWetMap`](super::PlayedWetMap) is there.
    pub played_map: bool,
    /// [`WettingTextures::surface`](super::WettingTextures::surface) is there.
    pub surface_texture: bool,
    /// [`WettingTextures::wet_color`](super::WettingTextures::wet_color) is there.
    pub wet_color_texture: bool,
    /// [`PorousMaterial::model`](super::PorousMaterial::model).
    pub model: ModelKind,
}

/// [`WettingModel`] without its parameters.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "named as in `WettingModel`")]
#[repr(u8)]
pub enum ModelKind {
    Hnat,
    HnatLeknerDorf,
    Lagarde,
    LeknerDorf,
    Twomey,
    Authored,
}

impl From<&WettingModel> for ModelKind {
    fn from(model: &WettingModel) -> Self {
        match model {
            WettingModel::Hnat(_) => Self::Hnat,
            WettingModel::HnatLeknerDorf(..) => Self::HnatLeknerDorf,
            WettingModel::Lagarde(_) => Self::Lagarde,
            WettingModel::LeknerDorf(_) => Self::LeknerDorf,
            WettingModel::Twomey(_) => Self::Twomey,
            WettingModel::Authored(_) => Self::Authored,
        }
    }
}

impl ModelKind {
    fn shader_defs(self) -> &'static [&'static str] {
        match self {
            Self::Hnat => &["WEATHERED_PORES"],
            Self::HnatLeknerDorf => &["WEATHERED_PORES", "WEATHERED_FILM_ON_PORES"],
            Self::Lagarde => &["WEATHERED_LAGARDE"],
            Self::LeknerDorf => &["WEATHERED_LEKNER_DORF"],
            Self::Twomey => &["WEATHERED_TWOMEY"],
            Self::Authored => &["WEATHERED_AUTHORED"],
        }
    }
}

impl PorousKey {
    pub(super) fn shader_defs(self) -> impl Iterator<Item = ShaderDefVal> {
        let own_light = self.water || self.matter || self.standing || self.played_map || self.unlike_standard;
        let defs = [
            (own_light, "WEATHERED_LIGHT"),
            (self.water, "WEATHERED_WATER"),
            (self.water || self.matter, "WEATHERED_HELD"),
            (self.matter, "WEATHERED_MATTER"),
            (self.paint, "WEATHERED_PAINT"),
            (self.standing, "WEATHERED_STANDING"),
            (self.marks, "WEATHERED_MARKS"),
            (self.played_map, "WEATHERED_PLAYED_MAP"),
            (self.surface_texture, "WEATHERED_SURFACE_TEXTURE"),
            (self.wet_color_texture, "WEATHERED_WET_COLOR_TEXTURE"),
        ];
        let model = self.model.shader_defs().iter().copied();
        defs.into_iter().filter_map(|(set, def)| set.then_some(def)).chain(model).map(ShaderDefVal::from)
    }
}

impl From<&super::PorousExtension> for PorousKey {
    fn from(extension: &super::PorousExtension) -> Self {
        extension.key
    }
}
