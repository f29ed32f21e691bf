#define_import_path bevy_weathering::matter

// Dust, mud and snow over a surface. Each function has a double-precision twin of the same name in `src/matter/look.rs`,
// where the story is told. Depths in mm, the rest without unit. Pure: no bindings.
//
// Kubelka 1948, "New contributions to the optics of intensely light-scattering materials". Warren 1982, "Optical properties
// of snow".

// The twin of `GpuTexelMatter` in `src/matter/look.rs`.
struct TexelMatter {
    // Loose and bound soil, mm without pores, two halves.
    dust_mud: u32,
    // Snow, mm of snow, a half; above it 1 where the mesh lies.
    snow: u32,
}

// How dark a dry crust is, on the way from dry to wet soil.
const CRUST_PART: f32 = 0.25;
// Back-scattering of fresh snow, 1/mm.
const SNOW_SCATTERING_PER_MM: f32 = 0.135;

// Loose soil, bound soil and snow of a texel, mm.
fn matter_depths(texel: TexelMatter) -> vec3<f32> {
    return vec3(unpack2x16float(texel.dust_mud), unpack2x16float(texel.snow).x);
}

// Whether the mesh lies at a texel.
fn lies(texel: TexelMatter) -> bool {
    return (texel.snow >> 16u) != 0u;
}

// How much deeper it lies before a place than behind it, mm. before, here, after: depths, mm; below 0 where nothing of the mesh
// lies: what lies `here` goes on there.
fn heap_fall(before: f32, here: f32, after: f32) -> f32 {
    return select(before, here, before < 0.0) - select(after, here, after < 0.0);
}

// Part of a surface that grains cover, 1 - exp(-3/2 h / g). depth_mm: h, at least 0; grain_mm: g, above 0.
fn matter_cover(depth_mm: f32, grain_mm: f32) -> f32 {
    return 1.0 - exp(-1.5 * max(depth_mm, 0.0) / grain_mm);
}

// Loose and bound soil as it is now: where a film has dried up since the texel was sent, all of it is bound. film_then_mm:
// of the texel as it was sent; film_mm: now; at least 0.
fn settled_soil(dust_mm: f32, mud_mm: f32, film_then_mm: f32, film_mm: f32) -> vec2<f32> {
    let is_bound = film_then_mm > 0.0 && film_mm <= 0.0;
    return select(vec2(dust_mm, mud_mm), vec2(0.0, dust_mm + mud_mm), is_bound);
}

// Colour of soil. dry, wet: its colours; crust: how much of it is bound; wetness; all in [0, 1].
fn soil_color(dry: vec3<f32>, wet: vec3<f32>, crust: f32, wetness: f32) -> vec3<f32> {
    return mix(mix(dry, wet, CRUST_PART * crust), wet, wetness);
}

// A colour under mud, and dust over that. base: of the surface as water left it; dry, wet: of the soil; covers: of dust and
// mud, by `matter_cover`; all in [0, 1].
fn dust_color_over(
    base: vec3<f32>,
    dry: vec3<f32>,
    wet: vec3<f32>,
    covers: vec2<f32>,
    wetness: f32,
) -> vec3<f32> {
    let muddy = mix(base, soil_color(dry, wet, 1.0, wetness), covers.y);
    return mix(muddy, soil_color(dry, wet, 0.0, wetness), covers.x);
}

// Albedo of snow over a ground, ((Rg - R) / R E - R (Rg - 1/R)) / ((Rg - R) E - (Rg - 1/R)), E = exp(-S h (1/R - R)).
// ground: Rg, in [0, 1]; deep: R, of deep snow, clamped to [.01, .99]; depth_mm: h, mm of snow, at least 0.
fn snow_albedo(ground: vec3<f32>, deep: vec3<f32>, depth_mm: f32) -> vec3<f32> {
    let white = clamp(deep, vec3(0.01), vec3(0.99));
    let through = exp(-SNOW_SCATTERING_PER_MM * max(depth_mm, 0.0) * (1.0 / white - white));
    let above = ground - white;
    let below = ground - 1.0 / white;
    return (above / white * through - white * below) / (above * through - below);
}

// Perceptual roughness under a cover. base, matter: roughnesses; cover: by `matter_cover`; all in [0, 1].
fn roughness_under(base: f32, matter: f32, cover: f32) -> f32 {
    return mix(base, matter, cover);
}
