// A weathered surface: `StandardMaterial` with its overlays laid on, lit by `wet_lighting`.
//
// What a surface does not have is not compiled in, see `PorousKey` in `src/material/key.rs`: a dry one is lit by Bevy.
//
// Textures of the material lie in the first uvs of the mesh and its normal map in the frame of its tangents. What fell on the
// surface, colour, relief, water and matter, lies in `map_uv` and in the frame of that. Both may be the same.

#import bevy_pbr::{
    forward_io::{VertexOutput, FragmentOutput},
    decal::clustered::apply_decals,
    pbr_bindings,
    pbr_fragment::pbr_input_from_standard_material,
    pbr_functions::{alpha_discard, apply_pbr_lighting, main_pass_post_lighting_processing},
    pbr_types::{PbrInput, STANDARD_MATERIAL_FLAGS_UNLIT_BIT},
}
#import bevy_weathering::{
    wet_lighting::apply_wet_lighting,
    wet_map::{
        porous, matter_look, heap_slopes, diffuse_map, specular_map, normal_map, map_sampler, surface_texture, surface_sampler,
        wet_color_texture, wet_color_sampler,
    },
    wet_surface::{Water, apply_model, ripples, water_on},
    matter::{dust_color_over, matter_cover, roughness_under, snow_albedo},
}

#ifdef VISIBILITY_RANGE_DITHER
#import bevy_pbr::pbr_functions::visibility_range_dither
#endif

#ifdef WEATHERED_UVS
// Where a point lies on the maps of the surface: in the second uvs of the mesh where the first are not unique.
fn map_uv(in: VertexOutput) -> vec2<f32> {
#ifdef WEATHERED_UVS_B
    return in.uv_b;
#else
    return in.uv;
#endif
}
#endif

// Tilts a normal by slopes along the directions in which u and v grow.
//
// The directions come from screen-space derivatives of position and uv, so the mesh needs no tangents (Mikkelsen
// 2010, "Bump mapping unparametrized surfaces on the GPU").
fn tilt_normal(normal: vec3<f32>, slopes: vec2<f32>, dp_dx: vec3<f32>, dp_dy: vec3<f32>,
               duv_dx: vec2<f32>, duv_dy: vec2<f32>) -> vec3<f32> {
    let facing = sign(duv_dx.x * duv_dy.y - duv_dx.y * duv_dy.x);
    let along_u = (dp_dx * duv_dy.y - dp_dy * duv_dx.y) * facing;
    let along_v = (dp_dy * duv_dx.x - dp_dx * duv_dy.x) * facing;
    let squares = vec2(dot(along_u, along_u), dot(along_v, along_v));
    if squares.x == 0.0 || squares.y == 0.0 {
        return normal;
    }
    let tilt = along_u * inverseSqrt(squares.x) * slopes.x + along_v * inverseSqrt(squares.y) * slopes.y;
    return normalize(normal + tilt);
}

// Colour, gloss and relief that fell on the surface, over its own.
fn apply_paint(pbr: ptr<function, PbrInput>, in: VertexOutput) {
#ifdef WEATHERED_UVS
    let uv = map_uv(in);
    let diffuse = textureSample(diffuse_map, map_sampler, uv);
    let base = (*pbr).material.base_color;
    (*pbr).material.base_color = vec4(base.rgb * (1.0 - diffuse.a) + diffuse.rgb, base.a);
    let specular = textureSample(specular_map, map_sampler, uv);
    (*pbr).material.reflectance = (*pbr).material.reflectance * (1.0 - specular.a) + specular.r;
    (*pbr).material.perceptual_roughness =
        (*pbr).material.perceptual_roughness * (1.0 - specular.a) + (specular.a - specular.g);
    // Premultiplied around 0.5: no coverage is no slope.
    let normal = textureSample(normal_map, map_sampler, uv);
    let slopes = 2.0 * normal.rg - normal.a;
    (*pbr).N = tilt_normal((*pbr).N, slopes, dpdx(in.world_position.xyz), dpdy(in.world_position.xyz),
        dpdx(uv), dpdy(uv));
#endif
}

#ifdef WEATHERED_MARKS
// Colour of salts.
const EFFLORESCENCE: vec3<f32> = vec3(0.78, 0.77, 0.74);
// What a full tide mark leaves of the light.
const TIDE: vec3<f32> = vec3(0.52, 0.46, 0.40);

// What dried water left on a colour. Salts dissolve where it is wet.
fn left_behind(color: vec3<f32>, water: Water) -> vec3<f32> {
    let dry = 1.0 - water.wetness;
    let marked = color * mix(vec3(1.0), TIDE, porous.tide_mark * water.marks.y);
    return mix(marked, EFFLORESCENCE, porous.efflorescence * water.marks.x * dry);
}
#endif

#ifdef WEATHERED_MATTER
// Dust, mud and snow over a point. They hide what water has done to it, and are wet themselves.
fn apply_matter(pbr: ptr<function, PbrInput>, water: ptr<function, Water>) {
    let depths = (*water).matter;
    let soil = vec2(matter_cover(depths.x, matter_look.grain_mm), matter_cover(depths.y, matter_look.grain_mm));
    let base = (*pbr).material.base_color;
    var color = dust_color_over(base.rgb, matter_look.dust_color, matter_look.mud_color, soil, (*water).wetness);
    let covered = 1.0 - (1.0 - soil.x) * (1.0 - soil.y);
    let soil_roughness = mix(matter_look.dust_roughness, matter_look.mud_roughness, (*water).wetness);
    var roughness = roughness_under((*pbr).material.perceptual_roughness, soil_roughness, covered);
    color = snow_albedo(color, matter_look.snow_color, depths.z);
    let snow = matter_cover(depths.z, matter_look.flake_mm);
    roughness = roughness_under(roughness, matter_look.snow_roughness, snow);
    let hidden = 1.0 - (1.0 - covered) * (1.0 - snow);
    (*pbr).material.base_color = vec4(color, base.a);
    (*pbr).material.perceptual_roughness = roughness;
    (*pbr).material.metallic *= 1.0 - hidden;
    (*pbr).material.reflectance = mix((*pbr).material.reflectance, vec3(0.35), hidden);
    // Pores under a cover are not seen; a film on mud is, on snow is not.
    (*water).wetness *= 1.0 - hidden;
    (*water).gloss *= 1.0 - hidden;
    (*water).coverage *= 1.0 - snow;
    (*water).levelness *= 1.0 - snow;
}
#endif

#ifdef WEATHERED_LIGHT
// The point with the water on it, lit.
fn weathered_color(pbr_input: PbrInput, in: VertexOutput) -> vec4<f32> {
    var pbr = pbr_input;
    var water: Water;
    var normal = normalize(pbr.world_normal);
#ifdef WEATHERED_UVS
    let uv = map_uv(in);
    var texture_uv = vec2(0.0);
#ifdef VERTEX_UVS_A
    texture_uv = (pbr_bindings::material.uv_transform * vec3(in.uv, 1.0)).xy;
#endif
    var surface = vec4(1.0);
#ifdef WEATHERED_SURFACE_TEXTURE
    surface = textureSample(surface_texture, surface_sampler, texture_uv);
#endif
    var paint = 1.0;
#ifdef VERTEX_COLORS
    paint = in.color.g;
#endif
    water = water_on(uv, surface.g, paint);
    var wet_color = pbr.material.base_color.rgb;
#ifdef WEATHERED_WET_COLOR_TEXTURE
    wet_color = textureSample(wet_color_texture, wet_color_sampler, texture_uv).rgb;
#endif
#ifdef WEATHERED_MARKS
    pbr.material.base_color = vec4(left_behind(pbr.material.base_color.rgb, water), pbr.material.base_color.a);
#endif
    apply_model(&pbr, &water, surface.r, wet_color * porous.wet_color);
#ifdef WEATHERED_MATTER
    apply_matter(&pbr, &water);
    let heaps = heap_slopes(uv);
    normal = tilt_normal(normal, heaps, dpdx(in.world_position.xyz), dpdy(in.world_position.xyz), dpdx(uv), dpdy(uv));
    // What covers a relief evens it out.
    pbr.N = normalize(mix(tilt_normal(pbr.N, heaps, dpdx(in.world_position.xyz), dpdy(in.world_position.xyz), dpdx(uv), dpdy(uv)),
        normal, matter_cover(water.matter.z, matter_look.flake_mm)));
#endif
#ifdef WEATHERED_STANDING
    let waves = ripples(uv, in.world_position.xyz, water.levelness);
    normal = tilt_normal(normal, -waves.xy, dpdx(in.world_position.xyz), dpdy(in.world_position.xyz), dpdx(uv), dpdy(uv));
    normal = normalize(normal - vec3(waves.z, 0.0, waves.w));
#endif
#endif
    pbr.material.diffuse_transmission =
        mix(pbr.material.diffuse_transmission, max(porous.wet_translucency, pbr.material.diffuse_transmission), water.wetness);
    return apply_wet_lighting(pbr, water, normal);
}
#endif

@fragment
fn fragment(in: VertexOutput, @builtin(front_facing) is_front: bool) -> FragmentOutput {
#ifdef VISIBILITY_RANGE_DITHER
    visibility_range_dither(in.position, in.visibility_range_dither);
#endif
    var plain = in;
#ifdef WEATHERED_STANDING
#ifdef VERTEX_COLORS
    // They say where water stands, not what is seen.
    plain.color = vec4(1.0, 1.0, 1.0, in.color.a);
#endif
#endif
    var pbr = pbr_input_from_standard_material(plain, is_front);
    pbr.material.base_color = alpha_discard(pbr.material, pbr.material.base_color);
    apply_decals(&pbr);
#ifdef WEATHERED_PAINT
    apply_paint(&pbr, in);
#endif

    var out: FragmentOutput;
    if (pbr.material.flags & STANDARD_MATERIAL_FLAGS_UNLIT_BIT) != 0u {
        out.color = pbr.material.base_color;
    } else {
#ifdef WEATHERED_LIGHT
        out.color = weathered_color(pbr, in);
#else
        out.color = apply_pbr_lighting(pbr);
#endif
    }
    out.color = main_pass_post_lighting_processing(pbr, out.color);
    return out;
}
