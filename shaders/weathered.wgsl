// A weathered surface: `StandardMaterial` with its overlays laid on, lit by `wet_lighting`.

#import bevy_pbr::{
    forward_io::{VertexOutput, FragmentOutput},
    decal::clustered::apply_decals,
    pbr_fragment::pbr_input_from_standard_material,
    pbr_functions::{alpha_discard, main_pass_post_lighting_processing},
    pbr_types::{PbrInput, STANDARD_MATERIAL_FLAGS_UNLIT_BIT},
}
#import bevy_weathering::{
    wet_lighting::{WetSurface, apply_wet_lighting},
    wet_map::{
        porous, diffuse_map, specular_map, normal_map, map_sampler, has_flag, wetness_at,
        FLAG_BLINN_PHONG, FLAG_SOLID, FLAG_SQRT_K,
    },
    hnat::PorousParams,
}

#ifdef VISIBILITY_RANGE_DITHER
#import bevy_pbr::pbr_functions::visibility_range_dither
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

@fragment
fn fragment(in: VertexOutput, @builtin(front_facing) is_front: bool) -> FragmentOutput {
#ifdef VISIBILITY_RANGE_DITHER
    visibility_range_dither(in.position, in.visibility_range_dither);
#endif
    var pbr = pbr_input_from_standard_material(in, is_front);
    pbr.material.base_color = alpha_discard(pbr.material, pbr.material.base_color);
    apply_decals(&pbr);

    var wetness = 0.0;
#ifdef VERTEX_UVS_A
    let diffuse = textureSample(diffuse_map, map_sampler, in.uv);
    pbr.material.base_color = vec4(
        pbr.material.base_color.rgb * (1.0 - diffuse.a) + diffuse.rgb,
        pbr.material.base_color.a,
    );
    let specular = textureSample(specular_map, map_sampler, in.uv);
    pbr.material.reflectance = pbr.material.reflectance * (1.0 - specular.a) + specular.r;
    pbr.material.perceptual_roughness =
        pbr.material.perceptual_roughness * (1.0 - specular.a) + (specular.a - specular.g);
    // Premultiplied around 0.5: no coverage is no slope.
    let normal = textureSample(normal_map, map_sampler, in.uv);
    let slopes = 2.0 * normal.rg - normal.a;
    pbr.N = tilt_normal(pbr.N, slopes, dpdx(in.world_position.xyz), dpdy(in.world_position.xyz),
        dpdx(in.uv), dpdy(in.uv));
    wetness = wetness_at(in.uv);
#endif

    var out: FragmentOutput;
    if (pbr.material.flags & STANDARD_MATERIAL_FLAGS_UNLIT_BIT) == 0u {
        var surface: WetSurface;
        surface.porous = PorousParams(
            porous.alpha_poro * (1.0 - pbr.material.metallic),
            porous.s_p,
            porous.m,
            porous.k_w,
            select(0u, 1u, has_flag(FLAG_SQRT_K)),
        );
        surface.k_s = porous.k_s;
        surface.tau = wetness;
        surface.solid = has_flag(FLAG_SOLID);
        surface.blinn_phong = has_flag(FLAG_BLINN_PHONG);
        out.color = apply_wet_lighting(pbr, surface);
    } else {
        out.color = pbr.material.base_color;
    }
    out.color = main_pass_post_lighting_processing(pbr, out.color);
    return out;
}
