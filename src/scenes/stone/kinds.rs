//! The recipes: what is seen on a patch of each stone, coarse to fine.
//!
//! Brickwork has a file of its own, as have sand, asphalt and linen together.

use bevy::math::{Vec2, Vec3};

use super::noise::{Layers, smoothstep};

/// What a recipe says about one place.
pub(super) struct Texel {
    /// Linear, before occlusion and before the scaling to the stone's mean.
    pub(super) albedo: Vec3,
    pub(super) height_mm: f32,
    pub(super) roughness: f32,
}

pub(super) fn sandstone(layers: Layers) -> impl Fn(Vec2) -> Texel {
    let warp = layers.noise(1, Vec2::new(2.0, 2.0), 3);
    let beds = layers.noise(2, Vec2::new(0.6, 9.0), 4);
    let laminae = layers.noise(3, Vec2::new(1.5, 60.0), 3);
    let mottle = layers.noise(4, Vec2::new(5.0, 5.0), 4);
    let ragged = layers.noise(5, Vec2::new(28.0, 28.0), 3);
    let rough = layers.noise(6, Vec2::new(70.0, 70.0), 3);
    let (grains, fine_grains) = (layers.cells(7, 230.0), layers.cells(8, 420.0));
    let (iron, pits, small_pits) = (layers.cells(9, 9.0), layers.cells(10, 26.0), layers.cells(11, 75.0));
    move |uv| {
        // Beds are tilted and bent a little, spots and pits have ragged outlines.
        let bent = uv + Vec2::new(0.0, 0.018 * warp.at(uv));
        let edge = uv + 0.0035 * Vec2::new(ragged.at(uv), ragged.at(uv + 0.5));
        let bed = beds.at(bent);
        let lamina = laminae.at(bent);
        let mottle = mottle.at(uv);
        let ragged = ragged.at(uv);
        let grain = grains.nearest(uv);
        let fine = fine_grains.nearest(uv);
        let iron = iron.spot(edge, 0.32, 0.04, 0.22);
        let pit = pits.spot(edge, 0.16, 0.06, 0.36);
        let small_pit = small_pits.spot(edge, 0.28, 0.08, 0.34);

        let ochre = smoothstep(-0.55, 0.65, bed + 0.35 * lamina + 0.25 * mottle);
        let mut albedo = Vec3::new(0.52, 0.43, 0.305).lerp(Vec3::new(0.47, 0.34, 0.205), ochre);
        albedo *= 1.0 + 0.10 * lamina + 0.10 * mottle + 0.06 * ragged;
        // Quartz is pale, feldspar pinkish, a few grains are dark minerals.
        let tint = match grain.chance(1) {
            dark if dark < 0.012 => Vec3::new(0.46, 0.40, 0.36),
            pink if pink < 0.16 => Vec3::new(1.08, 0.94, 0.84),
            pale if pale < 0.36 => Vec3::new(1.24, 1.24, 1.22),
            _ => Vec3::splat(0.80 + 0.40 * grain.chance(2)),
        };
        let speck = if fine.chance(2) < 0.02 { 0.50 } else { 0.84 + 0.32 * fine.chance(1) };
        albedo *= tint * speck;
        let rust = smoothstep(0.0, 0.5, iron * (1.0 + 0.6 * ragged));
        albedo = albedo.lerp(albedo * Vec3::new(0.54, 0.34, 0.24), 0.85 * rust);
        let hollow = smoothstep(0.0, 0.45, pit);
        // Where the cement between the grains is weak, they have fallen out in swarms.
        let small_hollow = smoothstep(0.0, 0.5, small_pit) * smoothstep(0.0, 0.5, mottle + 0.4 * bed);
        albedo *= 1.0 - 0.30 * hollow - 0.22 * small_hollow;

        let height_mm = 0.30 * bed
            + 0.16 * lamina
            + 0.14 * rough.at(uv)
            + 0.10 * ragged
            + grains.dome_mm(&grain, 0.20) * (0.6 + 0.8 * grain.chance(3))
            + fine_grains.dome_mm(&fine, 0.12)
            + 0.15 * rust
            - 1.5 * hollow
            - 0.6 * small_hollow;
        let glint = if (0.16..0.36).contains(&grain.chance(1)) { 0.12 } else { 0.0 };
        Texel { albedo, height_mm, roughness: 0.90 - glint + 0.04 * mottle }
    }
}

pub(super) fn terracotta(layers: Layers) -> impl Fn(Vec2) -> Texel {
    let clouds = layers.noise(1, Vec2::new(2.5, 3.5), 4);
    let mottle = layers.noise(2, Vec2::new(14.0, 18.0), 4);
    let turning = layers.noise(3, Vec2::new(0.5, 22.0), 2);
    let combing = layers.noise(4, Vec2::new(0.9, 90.0), 2);
    let skin = layers.noise(5, Vec2::new(90.0, 90.0), 3);
    let bloom = layers.noise(6, Vec2::new(4.0, 3.0), 5);
    let wobble = layers.noise(7, Vec2::new(3.0, 3.0), 2);
    let clay = layers.cells(8, 430.0);
    let (temper, lime, pores) = (layers.cells(9, 120.0), layers.cells(10, 34.0), layers.cells(11, 60.0));
    let scratches = layers.scratches(12, 28);
    move |uv| {
        let edge = uv + 0.0012 * Vec2::new(skin.at(uv), skin.at(uv + 0.5));
        let bent = uv + Vec2::new(0.0, 0.004 * wobble.at(uv));
        let (clouds, mottle, skin) = (clouds.at(uv), mottle.at(uv), skin.at(uv));
        let (turning, combing) = (turning.at(bent), combing.at(bent));
        let clay_grain = clay.nearest(uv);
        let temper = temper.spot(edge, 0.30, 0.10, 0.30);
        let lime = lime.spot(edge, 0.10, 0.04, 0.12);
        let pore = pores.spot(edge, 0.14, 0.05, 0.20);
        let scratch = scratches.depth(bent + 0.002 * Vec2::splat(mottle));

        let fired = smoothstep(-0.7, 0.7, clouds + 0.5 * mottle);
        let mut albedo = Vec3::new(0.46, 0.205, 0.112).lerp(Vec3::new(0.545, 0.258, 0.148), fired);
        albedo *= 1.0 + 0.06 * mottle + 0.03 * turning + 0.03 * combing + 0.07 * skin;
        albedo *= 0.84 + 0.32 * clay_grain.chance(1);
        // Salts carried out by water while it dried.
        let pale = smoothstep(0.1, 1.0, bloom.at(uv) + 0.5 * mottle + 0.9 * skin);
        albedo = albedo.lerp(Vec3::new(0.66, 0.43, 0.30), 0.20 * pale);
        let speck = smoothstep(0.0, 0.5, temper);
        let dark = if clay_grain.chance(2) < 0.5 { 0.32 } else { 0.16 };
        albedo *= 1.0 - dark * speck;
        albedo = albedo.lerp(Vec3::new(0.72, 0.58, 0.45), 0.8 * smoothstep(0.0, 0.4, lime));
        let hollow = smoothstep(0.0, 0.5, pore);
        albedo *= 1.0 - 0.35 * hollow;
        albedo = albedo.lerp(albedo * Vec3::new(1.22, 1.30, 1.34), scratch);

        let height_mm = 0.55 * turning
            + 0.07 * combing
            + 0.10 * mottle
            + 0.07 * skin
            + clay.dome_mm(&clay_grain, 0.10)
            + 0.05 * speck
            - 0.45 * hollow
            - 0.12 * scratch;
        Texel { albedo, height_mm, roughness: 0.80 + 0.05 * mottle + 0.05 * pale + 0.06 * hollow }
    }
}

pub(super) fn concrete(layers: Layers) -> impl Fn(Vec2) -> Texel {
    let stain = layers.noise(1, Vec2::new(2.0, 2.0), 5);
    let mottle = layers.noise(2, Vec2::new(9.0, 9.0), 5);
    let trowel = layers.noise(3, Vec2::new(3.0, 14.0), 3);
    let skin = layers.noise(4, Vec2::new(60.0, 60.0), 4);
    let (sand, cement) = (layers.cells(5, 150.0), layers.cells(6, 430.0));
    let bubbles = [
        (layers.cells(7, 8.0), 0.40, 0.03, 0.17, 2.6),
        (layers.cells(8, 22.0), 0.38, 0.05, 0.20, 1.4),
        (layers.cells(9, 60.0), 0.34, 0.07, 0.24, 0.7),
    ];
    move |uv| {
        let edge = uv + 0.0018 * Vec2::new(skin.at(uv), skin.at(uv + 0.5));
        let (stain, mottle, trowel, skin) = (stain.at(uv), mottle.at(uv), trowel.at(uv), skin.at(uv));
        let (sand_grain, cement_grain) = (sand.nearest(edge), cement.nearest(uv));
        let mut albedo = Vec3::new(0.40, 0.38, 0.35).lerp(Vec3::new(0.47, 0.46, 0.44), 0.5 + 0.7 * stain);
        albedo *= 1.0 + 0.10 * mottle + 0.05 * trowel + 0.08 * skin;
        // Sand shows through the cement where the skin is thin.
        let bare = smoothstep(-0.1, 0.7, mottle + 0.4 * skin);
        let tint = Vec3::new(1.0, 0.97, 0.92) * (0.72 + 0.56 * sand_grain.chance(1));
        albedo *= Vec3::ONE.lerp(tint, 0.25 + 0.45 * bare);
        albedo *= 0.91 + 0.18 * cement_grain.chance(1);
        let mut height_mm = 0.25 * trowel
            + 0.12 * mottle
            + 0.14 * skin
            + sand.dome_mm(&sand_grain, 0.05) * (0.5 + bare)
            + cement.dome_mm(&cement_grain, 0.07);
        for (cells, share, least, most, depth) in &bubbles {
            let bubble = cells.spot(edge, *share, *least, *most);
            let hollow = smoothstep(0.0, 0.35, bubble);
            albedo *= 1.0 - 0.38 * hollow;
            height_mm -= depth * hollow;
        }
        Texel { albedo, height_mm, roughness: 0.86 + 0.06 * mottle + 0.03 * skin - 0.06 * stain.max(0.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::brick::{TILE_MM, brick};
    use super::super::grounds::{asphalt, linen, sand};
    use super::*;

    #[test]
    fn relief_goes_on_across_the_edge() {
        fn check(stone: &str, recipe: impl Fn(Vec2) -> Texel) {
            for i in 0..400 {
                let along = i as f32 / 400.0;
                for edge in [Vec2::new(1.0, along), Vec2::new(along, 1.0)] {
                    let inward = if edge.x == 1.0 { Vec2::X } else { Vec2::Y };
                    let before = recipe(edge - inward * 2e-6).height_mm;
                    let after = recipe(edge - inward * (1.0 - 2e-6)).height_mm;
                    assert!((before - after).abs() < 0.02, "{stone} {edge}: {before} mm, then {after} mm");
                }
            }
        }
        let layers = Layers { seed: 5, finest: 300.0, tile_mm: 400.0 };
        check("terracotta", terracotta(layers));
        check("sandstone", sandstone(layers));
        check("concrete", concrete(layers));
        check("brick", brick(Layers { tile_mm: TILE_MM, ..layers }));
        check("sand", sand(layers));
        check("asphalt", asphalt(Layers { tile_mm: 600.0, ..layers }));
        check("linen", linen(Layers { tile_mm: 100.0, ..layers }));
    }
}
