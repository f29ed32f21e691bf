//! From what users set to what the shader reads.

use bevy::prelude::*;

use super::models::lekner_dorf::{LiquidFilm, N_WATER};
use super::{
    BaseBrdf, Coated, Flood, PlayedWetMap, Playing, PorositySource, PorousKey, PorousMaterial, PorousUniform,
    StandingWater, TextureMeaning, WettingModel, WettingTextures,
};
use crate::collision::UvSet;
use crate::overlay::{Overlays, SurfaceTraces, Wrap};

impl PorousUniform {
    /// [`Pores::sqrt_k`](super::Pores::sqrt_k).
    pub const FLAG_SQRT_K: u32 = 1;
    /// [`TextureMeaning::Solid`].
    pub const FLAG_SOLID: u32 = 1 << 1;
    /// [`BaseBrdf::BlinnPhong`].
    pub const FLAG_BLINN_PHONG: u32 = 1 << 2;
    /// [`Wrap::Clamp`] along u.
    pub const FLAG_CLAMP_U: u32 = 1 << 3;
    /// [`Wrap::Clamp`] along v.
    pub const FLAG_CLAMP_V: u32 = 1 << 4;
    /// [`Flood::Accumulation`].
    pub const FLAG_ACCUMULATION: u32 = 1 << 5;
    /// [`Flood::Level`].
    pub const FLAG_LEVEL: u32 = 1 << 6;
    /// [`PorositySource::Texture`] and [`PorositySource::MaskAndGloss`].
    pub const FLAG_POROSITY_TEXTURE: u32 = 1 << 7;
    /// [`PorositySource::MaskAndGloss`] and [`PorositySource::Gloss`].
    pub const FLAG_POROSITY_GLOSS: u32 = 1 << 8;
    /// [`Tweaked::metalness_from_specular`](super::Tweaked::metalness_from_specular).
    pub const FLAG_METALNESS_FROM_SPECULAR: u32 = 1 << 9;
    /// [`Playing::Drying`].
    pub const FLAG_MAP_DRIES: u32 = 1 << 10;
}

/// Everything about a surface that its constants depend on.
pub(super) struct SurfaceLook<'a> {
    pub(super) porous: PorousMaterial,
    pub(super) standing: Option<StandingWater>,
    pub(super) textures: &'a WettingTextures,
    pub(super) played: Option<&'a PlayedWetMap>,
    /// Ticks per second.
    pub(super) hz: u32,
    pub(super) maps: &'a Overlays,
    pub(super) traces: SurfaceTraces,
    pub(super) uvs: UvSet,
}

impl SurfaceLook<'_> {
    /// What of the shader is needed.
    pub(super) fn key(&self) -> PorousKey {
        let solid = self.porous.texture == TextureMeaning::Solid && self.porous.model.pores().is_some();
        PorousKey {
            water: self.traces.water,
            matter: self.traces.matter,
            paint: self.traces.paint,
            standing: self.standing.is_some_and(|water| water.flood != Flood::None),
            unlike_standard: solid || self.porous.brdf == BaseBrdf::BlinnPhong,
            marks: self.traces.water && self.porous.leaves_marks(),
            second_uvs: self.uvs == UvSet::Second,
            played_map: self.played.is_some(),
            surface_texture: self.textures.surface.is_some(),
            wet_color_texture: self.textures.wet_color.is_some(),
            model: (&self.porous.model).into(),
        }
    }

    /// The constants, with every value brought into its range.
    pub(super) fn uniform(&self) -> PorousUniform {
        let Self { porous, standing, maps, .. } = self;
        let standing = standing.unwrap_or_default();
        let flag = |set: bool, flag: u32| if set { flag } else { 0 };
        let matter = porous.matter();
        let mut uniform = PorousUniform {
            absorption_per_mm: Vec3::from_array(standing.absorption_per_mm).max(Vec3::ZERO),
            levelling_mm: standing.levelling_mm.max(1e-3),
            t_fill: porous.t_fill.max(0.0),
            capacity_mm: matter.capacity_mm as f32,
            visible_mm: porous.seen_mm() as f32,
            sorptivity_squared: matter.sorptivity_squared as f32,
            reserve_mm: porous.reserve_mm() as f32,
            efflorescence: unit(porous.efflorescence),
            tide_mark: unit(porous.tide_mark),
            wet_translucency: porous.wet_translucency.clamp(0.0, 1.0),
            rain_mm_per_h: standing.rain_mm_per_h.max(0.0),
            ripple_cell: standing.ripple_cell.max(1e-3),
            size: maps.size,
            flags: flag(porous.texture == TextureMeaning::Solid, PorousUniform::FLAG_SOLID)
                | flag(porous.brdf == BaseBrdf::BlinnPhong, PorousUniform::FLAG_BLINN_PHONG)
                | flag(maps.wrap[0] == Wrap::Clamp, PorousUniform::FLAG_CLAMP_U)
                | flag(maps.wrap[1] == Wrap::Clamp, PorousUniform::FLAG_CLAMP_V),
            ..default()
        };
        set_model(&mut uniform, &porous.model);
        if let Some(played) = self.played {
            uniform.map_ticks = (played.seconds * self.hz as f32).max(1.0);
            uniform.map_fill = unit(played.t_fill);
            uniform.map_tick = played.from_tick;
            uniform.flags |= flag(played.playing == Playing::Drying, PorousUniform::FLAG_MAP_DRIES);
        }
        match standing.flood {
            Flood::None => {}
            Flood::Accumulation { cracks, puddles } => {
                uniform.flags |= PorousUniform::FLAG_ACCUMULATION;
                uniform.flood = Vec3::new(unit(cracks), unit(puddles), 0.0);
            }
            Flood::Level { level_mm, basin_mm, relief_mm } => {
                uniform.flags |= PorousUniform::FLAG_LEVEL;
                uniform.flood = Vec3::new(level_mm, basin_mm, relief_mm).max(Vec3::ZERO);
            }
        }
        uniform
    }
}

fn unit(value: f32) -> f32 {
    value.clamp(0.0, 1.0)
}

fn set_model(uniform: &mut PorousUniform, model: &WettingModel) {
    if let Some(pores) = model.pores() {
        uniform.porosity = unit(pores.alpha_poro);
        uniform.s_p = unit(pores.s_p);
        uniform.m = unit(pores.m);
        uniform.k_s = unit(pores.k_s);
        uniform.k_w = unit(pores.k_w);
        if pores.sqrt_k {
            uniform.flags |= PorousUniform::FLAG_SQRT_K;
        }
    } else {
        // Without pores there is nothing between a dry look and a solid.
        uniform.flags &= !PorousUniform::FLAG_SOLID;
    }
    match *model {
        WettingModel::Hnat(_) => {}
        WettingModel::HnatLeknerDorf(_, coated) => {
            set_film(uniform, coated);
        }
        WettingModel::Lagarde(tweaked) => {
            uniform.porosity = unit(tweaked.porosity);
            let (texture, gloss) = match tweaked.source {
                PorositySource::Scalar => (false, false),
                PorositySource::Texture => (true, false),
                PorositySource::MaskAndGloss => (true, true),
                PorositySource::Gloss => (false, true),
            };
            for (set, flag) in [
                (texture, PorousUniform::FLAG_POROSITY_TEXTURE),
                (gloss, PorousUniform::FLAG_POROSITY_GLOSS),
                (tweaked.metalness_from_specular, PorousUniform::FLAG_METALNESS_FROM_SPECULAR),
            ] {
                uniform.flags |= if set { flag } else { 0 };
            }
        }
        WettingModel::LeknerDorf(coated) => {
            uniform.porosity = unit(coated.porosity);
            set_film(uniform, coated);
        }
        WettingModel::Twomey(grains) => {
            uniform.porosity = unit(grains.porosity);
            uniform.backscatter = grains.backscatter.clamp(0.05, 1.0);
        }
        WettingModel::Authored(look) => {
            uniform.porosity = 1.0;
            uniform.wet_color = Vec3::from_array(look.color).clamp(Vec3::ZERO, Vec3::ONE);
            uniform.wet_roughness = unit(look.roughness);
            uniform.wet_reflectance = unit(look.reflectance);
        }
    }
}

fn set_film(uniform: &mut PorousUniform, coated: Coated) {
    let film = LiquidFilm::new(N_WATER, f64::from(coated.n_solid.clamp(1.34, 4.0)));
    (uniform.film_p, uniform.film_x) = (film.p as f32, film.x as f32);
}
