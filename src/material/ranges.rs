//! What values make sense. The shader clamps; files are refused.

use super::{Coated, Flood, PorousMaterial, StandingWater, WettingModel};

/// A value out of its range.
#[derive(thiserror::Error, Debug, Clone, PartialEq)]
#[error("`{field}` is {value}, but must be {least} to {most}")]
pub struct OutOfRange {
    /// The field, from the component on: `model.s_p`.
    pub field: &'static str,
    /// What it is.
    pub value: f32,
    /// The least it may be.
    pub least: f32,
    /// The most it may be.
    pub most: f32,
}

/// Field, least, most.
const RANGES: &[(&str, f32, f32)] = &[
    ("t_fill", 0.0, 86_400.0),
    ("capacity_mm", 0.0, 1000.0),
    ("visible_mm", 1e-5, 1000.0),
    ("sorptivity", 0.0, 1000.0),
    ("pore_volume", 0.001, 1.0),
    ("retained_mm", 0.0, 1000.0),
    ("rim_delay", 0.0, 1000.0),
    ("efflorescence", 0.0, 1.0),
    ("tide_mark", 0.0, 1.0),
    ("wet_translucency", 0.0, 1.0),
    ("model.alpha_poro", 0.0, 1.0),
    ("model.s_p", 0.0, 1.0),
    ("model.m", 0.0, 1.0),
    ("model.k_s", 0.0, 1.0),
    ("model.k_w", 0.0, 1.0),
    ("model.porosity", 0.0, 1.0),
    ("model.n_solid", 1.34, 4.0),
    ("model.backscatter", 0.05, 1.0),
    ("model.color", 0.0, 1.0),
    ("model.roughness", 0.0, 1.0),
    ("model.reflectance", 0.0, 1.0),
    ("levelling_mm", 1e-3, 1000.0),
    ("rain_mm_per_h", 0.0, 1000.0),
    ("ripple_cell", 1e-3, 1000.0),
    ("absorption_per_mm", 0.0, 1e3),
    ("flood.cracks", 0.0, 1.0),
    ("flood.puddles", 0.0, 2.0),
    ("flood.level_mm", 0.0, 1e6),
    ("flood.basin_mm", 0.0, 1e6),
    ("flood.relief_mm", 0.0, 1e6),
];

/// The least and the most that a number of a [`PorousMaterial`] or of [`StandingWater`] may be, by the name that
/// [`OutOfRange::field`] has for it: `capacity_mm`, `model.s_p`, `flood.cracks`.
pub fn range_of(field: &str) -> Option<(f32, f32)> {
    RANGES.iter().find(|(name, ..)| *name == field).map(|&(_, least, most)| (least, most))
}

fn check(values: &[(&'static str, f32)]) -> Result<(), OutOfRange> {
    for &(field, value) in values {
        // What has no range may be any number.
        let (least, most) = range_of(field).unwrap_or((f32::MIN, f32::MAX));
        // Written so that NaN fails.
        if !(value >= least && value <= most) {
            return Err(OutOfRange { field, value, least, most });
        }
    }
    Ok(())
}

impl PorousMaterial {
    /// The first value that is out of its range.
    ///
    /// # Errors
    /// [`OutOfRange`].
    pub fn validate(&self) -> Result<(), OutOfRange> {
        check(&[
            ("t_fill", self.t_fill),
            ("capacity_mm", self.capacity_mm),
            ("visible_mm", self.visible_mm),
            ("sorptivity", self.sorptivity),
            ("pore_volume", self.pore_volume),
            ("retained_mm", self.retained_mm),
            ("rim_delay", self.rim_delay),
            ("efflorescence", self.efflorescence),
            ("tide_mark", self.tide_mark),
            ("wet_translucency", self.wet_translucency),
        ])?;
        self.model.validate()
    }
}

impl WettingModel {
    fn validate(&self) -> Result<(), OutOfRange> {
        if let Some(pores) = self.pores() {
            check(&[
                ("model.alpha_poro", pores.alpha_poro),
                ("model.s_p", pores.s_p),
                ("model.m", pores.m),
                ("model.k_s", pores.k_s),
                ("model.k_w", pores.k_w),
            ])?;
        }
        let coated = |coated: &Coated| {
            check(&[("model.porosity", coated.porosity), ("model.n_solid", coated.n_solid)])
        };
        match self {
            Self::Hnat(_) => Ok(()),
            Self::HnatLeknerDorf(_, film) | Self::LeknerDorf(film) => coated(film),
            Self::Lagarde(tweaked) => check(&[("model.porosity", tweaked.porosity)]),
            Self::Twomey(grains) => {
                check(&[("model.porosity", grains.porosity), ("model.backscatter", grains.backscatter)])
            }
            Self::Authored(look) => check(&[
                ("model.color", look.color[0]),
                ("model.color", look.color[1]),
                ("model.color", look.color[2]),
                ("model.roughness", look.roughness),
                ("model.reflectance", look.reflectance),
            ]),
        }
    }
}

impl StandingWater {
    /// The first value that is out of its range.
    ///
    /// # Errors
    /// [`OutOfRange`].
    pub fn validate(&self) -> Result<(), OutOfRange> {
        check(&[
            ("levelling_mm", self.levelling_mm),
            ("rain_mm_per_h", self.rain_mm_per_h),
            ("ripple_cell", self.ripple_cell),
            ("absorption_per_mm", self.absorption_per_mm[0]),
            ("absorption_per_mm", self.absorption_per_mm[1]),
            ("absorption_per_mm", self.absorption_per_mm[2]),
        ])?;
        match self.flood {
            Flood::None => Ok(()),
            Flood::Accumulation { cracks, puddles } => {
                check(&[("flood.cracks", cracks), ("flood.puddles", puddles)])
            }
            Flood::Level { level_mm, basin_mm, relief_mm } => check(&[
                ("flood.level_mm", level_mm),
                ("flood.basin_mm", basin_mm),
                ("flood.relief_mm", relief_mm),
            ]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Pores, Tweaked, WetLook};
    use super::*;

    #[test]
    fn defaults_are_in_range_and_nonsense_is_named() {
        let of = |model| PorousMaterial { model, ..Default::default() }.validate();
        for model in [
            WettingModel::default(),
            WettingModel::HnatLeknerDorf(Pores::default(), Coated::default()),
            WettingModel::Lagarde(Tweaked::default()),
            WettingModel::LeknerDorf(Coated::default()),
            WettingModel::Twomey(Default::default()),
            WettingModel::Authored(WetLook::default()),
        ] {
            assert_eq!(of(model), Ok(()));
        }
        assert_eq!(StandingWater::default().validate(), Ok(()));
        let field = |model| of(model).unwrap_err().field;
        assert_eq!(field(WettingModel::Hnat(Pores { s_p: f32::NAN, ..Default::default() })), "model.s_p");
        let glass = Coated { n_solid: 1.0, ..Default::default() };
        assert_eq!(field(WettingModel::LeknerDorf(glass)), "model.n_solid");
        let black = WetLook { color: [0.1, -0.1, 0.1], ..Default::default() };
        assert_eq!(field(WettingModel::Authored(black)), "model.color");
        let deep = StandingWater {
            flood: Flood::Level { level_mm: f32::INFINITY, basin_mm: 0.0, relief_mm: 1.0 },
            ..Default::default()
        };
        assert_eq!(deep.validate().unwrap_err().field, "flood.level_mm");
    }
}
