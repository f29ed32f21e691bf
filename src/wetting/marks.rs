//! What water leaves behind when it dries: efflorescence and tide marks.
//!
//! Water in pores carries salts. What evaporates from a pore leaves them at the surface; near the rim of a wet patch there is
//! more of it, since the rim dries first and draws water from inside (Deegan et al. 1997, "coffee rings"). Both grow with
//! every cycle of wetting and drying, and are seen when it is dry.

use bytemuck::{Pod, Zeroable};

use crate::material::PorousMaterial;

/// Marks of a texel. Each 0..=1 before the material's strength.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct Marks {
    /// White, all over what was wet.
    pub efflorescence: f32,
    /// Dark, along the rims of wet patches.
    pub tide: f32,
}

impl Marks {
    /// Water, mm, that has to dry in one place until there is no more to see.
    pub const FULL_MM: f64 = 2.0;
    /// What one cycle adds to a tide mark on the rim. It does not depend on the water there, since that comes from inside.
    pub const TIDE_PER_CYCLE: f64 = 0.35;

    /// `dried_mm`: water that has evaporated from the pores; `rim`: how near the texel is to one, 255 on it.
    pub(crate) fn grow(&mut self, material: &PorousMaterial, dried_mm: f64, rim: u8) {
        if dried_mm <= 0.0 {
            return;
        }
        let part = dried_mm / Self::FULL_MM;
        if material.efflorescence > 0.0 {
            self.efflorescence = (f64::from(self.efflorescence) + part).min(1.0) as f32;
        }
        if material.tide_mark > 0.0 {
            let cycle = (dried_mm / material.seen_mm()).min(1.0) * f64::from(rim) / 255.0;
            self.tide = (f64::from(self.tide) + Self::TIDE_PER_CYCLE * cycle).min(1.0) as f32;
        }
    }
}
