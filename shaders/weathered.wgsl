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
    pbr_types::{
        PbrInput, STANDARD_MATERIAL_FLAGS_ALPHA_MODE_OPAQUE, STANDARD_MATERIAL_FLAGS_ALPHA_MODE_RESERVED_BITS,
        STANDARD_MATERIAL_FLAGS_UNLIT_BIT,
    },
}
#import bevy_weathering::{
    wet_lighting::apply_wet_lighting,
    wet_map::{
        porous, matter_look, heap_falls, diffuse_map, specular_map, normal_map, map_sampler, surface_texture, surface_sampler,
        wet_color_texture, wet_color_sampler,
    },
    wet_surface::{Water, apply_model, ripples, water_on},
    matter::{dust_color_over, matter_cover, roughness_under, snow_albedo},
    normals::{Frame, faced, painted_slopes, relief_normal, relieved, reoriented, slopes_in_frame, surface_frame},
}

#ifdef VISIBILITY_RANGE_DITHER
#import bevy_pbr::pbr_functions::visibility_range_dither
#endif

#ifdef OIT_ENABLED
#import bevy_core_pipeline::oit::oit_draw
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

// How uvs lie at a point. ground: the normal without any relief; relief: with the base normal map, which Bevy turns to the
// viewer on a back face, while it may leave the other.
fn frame_of(in: VertexOutput, ground: vec3<f32>, relief: vec3<f32>) -> Frame {
    let normal = faced(normalize(ground), relief);
#ifdef WEATHERED_UVS
    let uv = map_uv(in);
    return surface_frame(normal, dpdx(in.world_position.xyz), dpdy(in.world_position.xyz), dpdx(uv), dpdy(uv));
#else
    return Frame(vec3(0.0), vec3(0.0), normal, 0.0, vec2(0.0));
#endif
}

// Colour, gloss and relief that fell on the surface, over its own.
fn apply_paint(pbr: ptr<function, PbrInput>, in: VertexOutput, frame: Frame) {
#ifdef WEATHERED_UVS
    let uv = map_uv(in);
    let diffuse = textureSample(diffuse_map, map_sampler, uv);
    let base = (*pbr).material.base_color;
    (*pbr).material.base_color = vec4(base.rgb * (1.0 - diffuse.a) + diffuse.rgb, base.a);
    // What covers metal is none.
    (*pbr).material.metallic *= 1.0 - diffuse.a;
    let specular = textureSample(specular_map, map_sampler, uv);
    (*pbr).material.reflectance = (*pbr).material.reflectance * (1.0 - specular.a) + specular.r;
    (*pbr).material.perceptual_roughness =
        (*pbr).material.perceptual_roughness * (1.0 - specular.a) + (specular.a - specular.g);
    let slopes = painted_slopes(textureSample(normal_map, map_sampler, uv));
    (*pbr).N = relieved(frame, (*pbr).N, slopes);
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
fn weathered_color(pbr_input: PbrInput, in: VertexOutput, frame: Frame) -> vec4<f32> {
    var pbr = pbr_input;
    var water: Water;
    var normal = frame.normal;
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
    let heaps = slopes_in_frame(frame, heap_falls(uv));
    // What covers a relief evens it out; its own lies on what is left.
    let evened = normalize(mix(pbr.N, normal, matter_cover(water.matter.z, matter_look.flake_mm)));
    pbr.N = relieved(frame, evened, heaps);
    normal = relieved(frame, normal, heaps);
#endif
#ifdef WEATHERED_STANDING
    let waves = ripples(uv, in.world_position.xyz, water.levelness);
    normal = relieved(frame, normal, -waves.xy);
    // Rain that is not simulated knows no uvs: its waves are those of level water, laid on this one. On a slope of 41 degrees
    // water runs, and there are none.
    let level = saturate(4.0 * frame.normal.y - 3.0);
    normal = reoriented(normal.xzy, relief_normal(-level * waves.zw)).xzy;
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
    let frame = frame_of(in, pbr.world_normal, pbr.N);
#ifdef WEATHERED_PAINT
    apply_paint(&pbr, in, frame);
#endif

    var out: FragmentOutput;
    if (pbr.material.flags & STANDARD_MATERIAL_FLAGS_UNLIT_BIT) != 0u {
        out.color = pbr.material.base_color;
    } else {
#ifdef WEATHERED_LIGHT
        out.color = weathered_color(pbr, in, frame);
#else
        out.color = apply_pbr_lighting(pbr);
#endif
    }
    out.color = main_pass_post_lighting_processing(pbr, out.color);
#ifdef OIT_ENABLED
    // What is not opaque is only noted down here, and drawn when all of it is known.
    let alpha_mode = pbr.material.flags & STANDARD_MATERIAL_FLAGS_ALPHA_MODE_RESERVED_BITS;
    if alpha_mode != STANDARD_MATERIAL_FLAGS_ALPHA_MODE_OPAQUE {
        oit_draw(in.position, out.color);
        discard;
    }
#endif
    return out;
}
