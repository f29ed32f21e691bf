//! What a texel holds, in whole numbers.
//!
//! Amounts are volumes in *units* of `2^-shift` nanolitres, one shift for all texels of a surface, chosen so that a unit is
//! about a nanometre deep on a texel of mean size. So what goes from one texel to another is exact whatever their areas,
//! and what came with particles, in whole nanolitres, is exact too.

use bytemuck::{Pod, Zeroable};

use super::evolve::Amounts;
use super::look::WaterLook;

/// State of one texel: what it held at its reference tick. What it holds now is [`evolve`](super::evolve::evolve)'s to say.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct TexelWater {
    /// Film on the surface, units.
    pub film: u32,
    /// Absorbed, units.
    pub pores: u32,
    /// Reference tick; 0 if it never was wet.
    pub tick: u32,
    /// How wet it looked at the reference tick, 0..=255.
    pub shown: u8,
    /// Demand that goes by before its pores dry, in 1/255 of the material's
    /// [`reserve_mm`](crate::material::PorousMaterial::reserve_mm).
    pub reserve: u8,
    /// How much of its film was to be seen at the reference tick, 0..=255.
    pub filmed: u8,
    /// How near the rim of a wet patch it lies, 255 on it; 0 well inside, or while nobody has looked.
    pub rim: u8,
}

impl TexelWater {
    /// All water, units.
    pub fn total(&self) -> u64 {
        u64::from(self.film) + u64::from(self.pores)
    }

    /// Whether it holds nothing.
    pub fn is_dry(&self) -> bool {
        self.film == 0 && self.pores == 0
    }
}

/// Volumes of a surface: how many units there are to a nanolitre.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Units {
    /// A unit is 2^-shift nanolitres.
    pub shift: u32,
}

impl Units {
    /// The finest unit.
    pub const MAX_SHIFT: u32 = 12;

    /// Such that a unit is about a nanometre on a texel of this area, mm², and never more than a nanolitre.
    pub fn for_area(mean_mm2: f32) -> Self {
        let per_nl = 1000.0 / mean_mm2.max(1e-3);
        Self { shift: per_nl.log2().round().clamp(0.0, Self::MAX_SHIFT as f32) as u32 }
    }

    /// Units in so many nanolitres.
    pub fn from_nl(self, nl: u64) -> u64 {
        nl << self.shift
    }

    /// Whole nanolitres in so many units.
    pub fn whole_nl(self, units: u64) -> u64 {
        units >> self.shift
    }

    /// Cubic millimetres: 1 nl is 0.001 mm³.
    pub fn mm3(self, units: u64) -> f64 {
        units as f64 * self.mm_on(1.0)
    }

    /// Depth of a unit on a texel of this area, mm² above 0, in mm.
    pub fn mm_on(self, area_mm2: f32) -> f64 {
        1.0e-3 / (f64::from(1u32 << self.shift) * f64::from(area_mm2))
    }
}

/// What a texel is worth in mm, and its constants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Depth of a unit, mm.
    pub unit_mm: f64,
    /// What 255 of [`TexelWater::reserve`] stand for, mm.
    pub reserve_mm: f64,
}

impl Scale {
    /// As depths.
    pub fn amounts(&self, texel: &TexelWater) -> Amounts {
        Amounts {
            film_mm: f64::from(texel.film) * self.unit_mm,
            pores_mm: f64::from(texel.pores) * self.unit_mm,
            reserve_mm: f64::from(texel.reserve) / 255.0 * self.reserve_mm,
        }
    }

    /// Makes `amounts` the texel's own at `tick`; returns the units that evaporated on the way. What is rounded off stays
    /// in the film or, if there is none, counts as evaporated: nothing is lost. What is more than pores have a number for stays
    /// on them as a film. `jitter`, evenly spread over [0, 1), decides which way bytes are rounded: else what changes by less than
    /// half a step each time would never change.
    pub fn commit(
        &self,
        texel: &mut TexelWater,
        amounts: Amounts,
        look: WaterLook,
        tick: u32,
        jitter: f64,
    ) -> u64 {
        let before = texel.total();
        // Rounds, since it is not negative; saturates.
        let units = |mm: f64| (mm.max(0.0) / self.unit_mm + 0.5) as u64;
        let most = u64::from(u32::MAX);
        let pores = units(amounts.pores_mm).min(before).min(most);
        let gone = before as f64 * self.unit_mm - amounts.film_mm - amounts.pores_mm;
        let keeps_film = amounts.film_mm > 0.0 || pores == most;
        let film = if keeps_film { (before - pores).saturating_sub(units(gone)) } else { 0 };
        texel.film = u32::try_from(film).unwrap_or(u32::MAX);
        texel.pores = u32::try_from(pores).unwrap_or(u32::MAX);
        texel.tick = tick;
        let byte = |part: f64| (part * 255.0 + jitter) as u8;
        texel.shown = byte(look.wetness);
        texel.filmed = if film > 0 { byte(look.film) } else { 0 };
        let reserve = if self.reserve_mm > 0.0 { amounts.reserve_mm / self.reserve_mm } else { 0.0 };
        texel.reserve = byte(reserve);
        before - texel.total()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_about_a_nanometre_deep_on_the_mean_texel() {
        for area in [0.05, 0.25, 1.0, 25.0, 333.0] {
            let units = Units::for_area(area);
            let depth = units.mm_on(area);
            assert!((0.7e-6..1.5e-6).contains(&depth) || units.shift == Units::MAX_SHIFT, "{area}: {depth}");
        }
        assert_eq!(Units::for_area(1e6).shift, 0);
        let units = Units { shift: 5 };
        assert_eq!(units.whole_nl(units.from_nl(77) + 31), 77);
        assert!((units.mm3(units.from_nl(2_500_000)) - 2500.0).abs() < 1e-9);
    }

    #[test]
    fn what_is_committed_adds_up() {
        let scale = Scale { unit_mm: 1.0e-6, reserve_mm: 0.05 };
        let look = WaterLook { wetness: 0.5, gloss: 0.2, film: 1.0 };
        let start = TexelWater { film: 1000, pores: 5000, tick: 1, ..Default::default() };
        let mut texel = start;
        let amounts = Amounts { film_mm: 0.0006, pores_mm: 0.0053, reserve_mm: 0.01 };
        let gone = scale.commit(&mut texel, amounts, look, 9, 0.5);
        assert_eq!((texel.film, texel.pores, texel.tick, gone), (600, 5300, 9, 100));
        assert_eq!((texel.shown, texel.reserve), (128, 51));
        let gone = scale.commit(&mut texel, Amounts::default(), look, 10, 0.5);
        assert_eq!((texel.total(), gone), (0, 5900));
    }

    #[test]
    fn what_pores_have_no_number_for_stays_on_them_and_evaporates_like_the_rest() {
        let scale = Scale { unit_mm: 1.0e-6, reserve_mm: 0.0 };
        let mut texel = TexelWater { film: 1_000_000, pores: u32::MAX - 5, tick: 1, ..Default::default() };
        // All of it is absorbed, and then they dry.
        let total_mm = texel.total() as f64 * scale.unit_mm;
        for (tick, gone_mm, left, evaporated) in [
            (2, 0.0, (999_995, u32::MAX), 0),
            (3, 0.4, (599_995, u32::MAX), 400_000),
            (4, 1.4, (0, u32::MAX - 400_005), 1_000_000),
        ] {
            let amounts = Amounts { pores_mm: total_mm - gone_mm, ..Default::default() };
            let gone = scale.commit(&mut texel, amounts, WaterLook::default(), tick, 0.0);
            assert_eq!(((texel.film, texel.pores), gone), (left, evaporated), "{gone_mm}");
        }
    }
}
