//! Kinds of matter, ready to be put beside a [`Weatherable`](crate::overlay::Weatherable).
//!
//! Where each number is from:
//!
//! | field | of | source |
//! |---|---|---|
//! | `sorptivity`, `pore_volume` | terracotta, brick, sandstone, concrete | within what Hall and Hoff 2012 (*Water transport in brick, stone and concrete*) list for fired clay, sandstones and concretes; single stones differ by several times |
//! | `pore_volume` | asphalt, sand | air voids of a dense asphalt; sand as it is poured |
//! | `sorptivity` | asphalt, sand, cloth | chosen: next to nothing; faster than any stone |
//! | `retained_mm` | all | .03 to .05 on smooth matter, .1 to .2 on rough |
//! | `model` | terracotta, brick, sandstone, concrete, cloth | Hnat, Porquet, Mérillou, Ghazanfarpour 2006, with s_p of .02 to .05, where wetness shows best; α_poro chosen by eye |
//! | | asphalt, glazed | Lekner and Dorf 1988; n_s of bitumen 1.6, of glass 1.5 |
//! | | sand | Twomey, Bohren, Mergenthaler 1986 |
//! | `capacity_mm` | brick, sandstone, concrete, asphalt, sand, cloth | chosen: `pore_volume` times the depth to which a shower wets it, 7, 8, 5, 3, 13 and .5 mm. Terracotta has that of a thin skin, which is full at once |
//! | `visible_mm`, `t_fill`, `rim_delay` | all | chosen by eye; that rims dry first is from Sun et al. 2007 and Lu et al. 2005 |
//! | `efflorescence`, `tide_mark`, `wet_translucency` | sandstone, concrete, cloth | chosen by eye |

use super::{BaseBrdf, Coated, Grains, Pores, PorousMaterial, TextureMeaning, WettingModel};

/// Ready-made kinds of matter. [`presets`](super::presets) tells where their numbers are from; any of them may be changed:
///
/// ```
/// # use bevy_weathering::prelude::*;
/// let old_brick = PorousMaterial { efflorescence: 0.6, ..PorousMaterial::BRICK };
/// ```
impl PorousMaterial {
    /// Fired clay with a skin that is full at once: the default.
    pub const TERRACOTTA: Self = Self {
        model: WettingModel::Hnat(Pores::TERRACOTTA),
        texture: TextureMeaning::DryLook,
        brdf: BaseBrdf::Ggx,
        t_fill: 0.4,
        capacity_mm: 0.05,
        visible_mm: 0.05,
        sorptivity: 2.0,
        pore_volume: 0.3,
        retained_mm: 0.1,
        rim_delay: 1.0,
        efflorescence: 0.0,
        tide_mark: 0.0,
        wet_translucency: 0.0,
    };
    /// Fired clay that takes up much.
    pub const BRICK: Self = Self { capacity_mm: 2.0, model: pores(0.6, 0.02), ..Self::TERRACOTTA };
    /// Sandstone, in which salts rise.
    pub const SANDSTONE: Self = Self {
        capacity_mm: 1.5,
        sorptivity: 0.8,
        pore_volume: 0.2,
        model: pores(0.5, 0.03),
        efflorescence: 0.3,
        ..Self::TERRACOTTA
    };
    /// Concrete, which takes up slowly and keeps rims of dried patches.
    pub const CONCRETE: Self = Self {
        capacity_mm: 0.6,
        sorptivity: 0.15,
        pore_volume: 0.12,
        retained_mm: 0.15,
        model: pores(0.4, 0.05),
        tide_mark: 0.4,
        ..Self::TERRACOTTA
    };
    /// Asphalt: takes up next to nothing, and is dark under its film.
    pub const ASPHALT: Self = Self {
        capacity_mm: 0.2,
        sorptivity: 0.02,
        pore_volume: 0.06,
        retained_mm: 0.2,
        model: WettingModel::LeknerDorf(Coated { porosity: 0.9, n_solid: 1.6 }),
        ..Self::TERRACOTTA
    };
    /// Dry sand: a film is gone at once.
    pub const SAND: Self = Self {
        capacity_mm: 5.0,
        sorptivity: 4.0,
        pore_volume: 0.4,
        retained_mm: 0.2,
        model: WettingModel::Twomey(Grains::SAND),
        ..Self::TERRACOTTA
    };
    /// Cloth, through which light comes when it is wet.
    pub const CLOTH: Self = Self {
        capacity_mm: 0.3,
        sorptivity: 3.0,
        pore_volume: 0.6,
        wet_translucency: 0.4,
        model: pores(0.8, 0.05),
        ..Self::TERRACOTTA
    };
    /// A glaze: takes up nothing, and drops run down.
    pub const GLAZED: Self = Self {
        capacity_mm: 0.0,
        sorptivity: 0.0,
        retained_mm: 0.03,
        model: WettingModel::LeknerDorf(Coated { porosity: 0.0, n_solid: 1.5 }),
        ..Self::TERRACOTTA
    };

    /// All of them, with a name to choose them by.
    pub const PRESETS: [(&'static str, Self); 8] = [
        ("terracotta", Self::TERRACOTTA),
        ("brick", Self::BRICK),
        ("sandstone", Self::SANDSTONE),
        ("concrete", Self::CONCRETE),
        ("asphalt", Self::ASPHALT),
        ("sand", Self::SAND),
        ("cloth", Self::CLOTH),
        ("glazed", Self::GLAZED),
    ];
}

/// Pores of this α_poro and s_p, and a film over the solid between them.
const fn pores(alpha_poro: f32, s_p: f32) -> WettingModel {
    WettingModel::HnatLeknerDorf(Pores { alpha_poro, s_p, ..Pores::TERRACOTTA }, Coated::ROUGH)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_valid_and_differ() {
        for (index, (name, preset)) in PorousMaterial::PRESETS.iter().enumerate() {
            assert_eq!(preset.validate(), Ok(()), "{name}");
            let before = &PorousMaterial::PRESETS[..index];
            assert!(before.iter().all(|(_, other)| other != preset), "{name} is another's double");
        }
        assert_eq!(PorousMaterial::default(), PorousMaterial::TERRACOTTA);
    }

    #[test]
    fn what_takes_up_more_is_told_apart_by_its_numbers() {
        let by_sorptivity = [
            PorousMaterial::GLAZED,
            PorousMaterial::ASPHALT,
            PorousMaterial::CONCRETE,
            PorousMaterial::SANDSTONE,
            PorousMaterial::BRICK,
            PorousMaterial::CLOTH,
            PorousMaterial::SAND,
        ];
        assert!(by_sorptivity.is_sorted_by(|less, more| less.sorptivity < more.sorptivity));
        // No more fits in than there are pores, in a layer of a few centimetres.
        let deep = |of: &PorousMaterial| of.capacity_mm / of.pore_volume;
        assert!(by_sorptivity.iter().all(|of| deep(of) < 20.0));
    }
}
