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

/// Field, value, least, most.
type Range = (&'static str, f32, f32, f32);

fn check(ranges: &[Range]) -> Result<(), OutOfRange> {
    // Written so that NaN fails.
    let bad = ranges.iter().find(|(_, value, least, most)| !(value >= least && value <= most));
    bad.map_or(Ok(()), |&(field, value, least, most)| Err(OutOfRange { field, value, least, most }))
}

impl PorousMaterial {
    /// The first value that is out of its range.
    ///
    /// # Errors
    /// [`OutOfRange`].
    pub fn validate(&self) -> Result<(), OutOfRange> {
        check(&[
            ("t_fill", self.t_fill, 0.0, 86_400.0),
            ("capacity_mm", self.capacity_mm, 0.0, 1000.0),
            ("visible_mm", self.visible_mm, 1e-5, 1000.0),
            ("sorptivity", self.sorptivity, 0.0, 1000.0),
            ("pore_volume", self.pore_volume, 0.001, 1.0),
            ("retained_mm", self.retained_mm, 0.0, 1000.0),
            ("rim_delay", self.rim_delay, 0.0, 1000.0),
            ("efflorescence", self.efflorescence, 0.0, 1.0),
            ("tide_mark", self.tide_mark, 0.0, 1.0),
            ("wet_translucency", self.wet_translucency, 0.0, 1.0),
        ])?;
        self.model.validate()
    }
}

impl WettingModel {
    fn validate(&self) -> Result<(), OutOfRange> {
        if let Some(pores) = self.pores() {
            check(&[
                ("model.alpha_poro", pores.alpha_poro, 0.0, 1.0),
                ("model.s_p", pores.s_p, 0.0, 1.0),
                ("model.m", pores.m, 0.0, 1.0),
                ("model.k_s", pores.k_s, 0.0, 1.0),
                ("model.k_w", pores.k_w, 0.0, 1.0),
            ])?;
        }
        let coated = |coated: &Coated| {
            check(&[
                ("model.porosity", coated.porosity, 0.0, 1.0),
                ("model.n_solid", coated.n_solid, 1.34, 4.0),
            ])
        };
        match self {
            Self::Hnat(_) => Ok(()),
            Self::HnatLeknerDorf(_, film) | Self::LeknerDorf(film) => coated(film),
            Self::Lagarde(tweaked) => check(&[("model.porosity", tweaked.porosity, 0.0, 1.0)]),
            Self::Twomey(grains) => check(&[
                ("model.porosity", grains.porosity, 0.0, 1.0),
                ("model.backscatter", grains.backscatter, 0.05, 1.0),
            ]),
            Self::Authored(look) => check(&[
                ("model.color", look.color[0], 0.0, 1.0),
                ("model.color", look.color[1], 0.0, 1.0),
                ("model.color", look.color[2], 0.0, 1.0),
                ("model.roughness", look.roughness, 0.0, 1.0),
                ("model.reflectance", look.reflectance, 0.0, 1.0),
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
            ("levelling_mm", self.levelling_mm, 1e-3, 1000.0),
            ("rain_mm_per_h", self.rain_mm_per_h, 0.0, 1000.0),
            ("ripple_cell", self.ripple_cell, 1e-3, 1000.0),
            ("absorption_per_mm", self.absorption_per_mm[0], 0.0, 1e3),
            ("absorption_per_mm", self.absorption_per_mm[1], 0.0, 1e3),
            ("absorption_per_mm", self.absorption_per_mm[2], 0.0, 1e3),
        ])?;
        match self.flood {
            Flood::None => Ok(()),
            Flood::Accumulation { cracks, puddles } => {
                check(&[("flood.cracks", cracks, 0.0, 1.0), ("flood.puddles", puddles, 0.0, 2.0)])
            }
            Flood::Level { level_mm, basin_mm, relief_mm } => check(&[
                ("flood.level_mm", level_mm, 0.0, 1e6),
                ("flood.basin_mm", basin_mm, 0.0, 1e6),
                ("flood.relief_mm", relief_mm, 0.0, 1e6),
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
