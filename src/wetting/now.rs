//! What a surface's texels hold at a tick.

use super::evolve::{Amounts, Matter, evolve};
use super::look::{WaterLook, water_look};
use super::texel::{Scale, TexelWater, Units};
use super::{Exposure, TexelGeometry};
use crate::material::PorousMaterial;
use crate::weather::{Demand, DryingClock};

/// What a surface's texels are asked with: its material, its exposure, and the time.
pub(crate) struct Now<'a> {
    pub(crate) tick: u32,
    pub(crate) hz: u32,
    pub(crate) drying: &'a DryingClock,
    pub(crate) demand: Demand,
    pub(crate) geometry: &'a TexelGeometry,
    pub(crate) exposure: Option<&'a Exposure>,
    pub(crate) material: &'a PorousMaterial,
    pub(crate) matter: Matter,
}

impl<'a> Now<'a> {
    pub(crate) fn new(
        tick: u32,
        hz: u32,
        drying: &'a DryingClock,
        geometry: &'a TexelGeometry,
        exposure: Option<&'a Exposure>,
        material: &'a PorousMaterial,
    ) -> Self {
        let matter = material.matter();
        Self { tick, hz, drying, demand: drying.until(tick), geometry, exposure, material, matter }
    }

    /// Constants of a texel.
    #[inline]
    pub(crate) fn scale(&self, units: Units, texel: u32) -> Scale {
        Scale { unit_mm: self.geometry.unit_mm(units, texel), reserve_mm: self.material.reserve_mm() }
    }

    /// What a texel holds now, as depths.
    #[inline]
    pub(crate) fn amounts(&self, scale: &Scale, texel: u32, water: &TexelWater) -> Amounts {
        let before = scale.amounts(water);
        if water.tick >= self.tick {
            return before;
        }
        let seconds = f64::from(self.tick - water.tick) / f64::from(self.hz);
        let (air, sun) = self.exposure.map_or((1.0, 0.0), |exposure| exposure.at(texel));
        let demand = (self.demand - self.drying.until(water.tick)).at(air, sun);
        evolve(before, self.matter, seconds, demand)
    }

    /// How what it holds looks now.
    #[inline]
    pub(crate) fn look(&self, amounts: &Amounts, water: &TexelWater) -> WaterLook {
        let seconds = f64::from(self.tick.saturating_sub(water.tick)) / f64::from(self.hz);
        let shown = [water.shown, water.filmed].map(|byte| f64::from(byte) / 255.0);
        let fill = f64::from(self.material.t_fill);
        water_look(amounts.pores_mm, self.material.seen_mm(), shown, seconds, fill)
    }
}
