// Lights a wet surface with everything that shines on it.
//
// Walks Bevy's lights as `apply_pbr_lighting` does. For each, `wet_layers` says what the coefficients of the base BRDF
// are for this light and what the water mirrors; Bevy's own light functions do the rest, with its shadows and clusters.

#define_import_path bevy_weathering::wet_lighting

#import bevy_pbr::{
    ambient,
    clustered_forward as clustering,
    lighting,
    lighting::{LAYER_BASE, LAYER_CLEARCOAT},
    mesh_types::{MESH_FLAGS_SHADOW_RECEIVER_BIT, MESH_FLAGS_TRANSMITTED_SHADOW_RECEIVER_BIT},
    mesh_view_bindings as view_bindings,
    mesh_view_types,
    pbr_functions::{calculate_diffuse_color, calculate_F0, calculate_F0_dielectric},
    pbr_types::PbrInput,
    shadows,
}
#import bevy_weathering::{
    water_film::{film_transmission, fresnel, WATER_REFLECTANCE},
    wet_layers::{
        AMBIENT_COSINE, Point, Through, add_water, blinn_phong, clearness, matter_coefficients, point_from_pbr,
        through_water,
    },
    wet_map::{has_flag, FLAG_BLINN_PHONG},
    wet_surface::Water,
}

#ifdef ENVIRONMENT_MAP
#import bevy_pbr::environment_map
#ifdef STANDARD_MATERIAL_ANISOTROPY
#import bevy_pbr::pbr_functions::bend_normal_for_anisotropy
#endif
#endif
#ifdef IRRADIANCE_VOLUME
#import bevy_pbr::irradiance_volume
#endif

// What the cosines and the shadows of one light depend on.
struct Lit {
    // Towards the light.
    L: vec3<f32>,
    // On a surface that faces it.
    irradiance: vec3<f32>,
    // Part of it that arrives.
    shadow: f32,
    // Whether it counts for the diffuse part; lightmaps may hold it already.
    diffuse: bool,
}

// What a point or spot light sends to a surface that faces it, without its shadow.
fn clustered_light(id: u32, position: vec3<f32>, spot: bool) -> Lit {
    let light = &view_bindings::clustered_lights.data[id];
    let to_light = (*light).position_radius.xyz - position;
    let color_and_range = (*light).color_inverse_square_range;
    var lit: Lit;
    lit.L = normalize(to_light);
    lit.irradiance =
        color_and_range.rgb * lighting::getDistanceAttenuation(dot(to_light, to_light), color_and_range.w);
    if spot {
        let custom = (*light).light_custom_data;
        var axis = vec3(custom.x, sqrt(max(0.0, 1.0 - custom.x * custom.x - custom.y * custom.y)), custom.y);
        if ((*light).flags & mesh_view_types::POINT_LIGHT_FLAGS_SPOT_LIGHT_Y_NEGATIVE) != 0u {
            axis.y = -axis.y;
        }
        let cone = saturate(dot(-axis, lit.L) * custom.z + custom.w);
        lit.irradiance *= cone * cone;
    }
    lit.shadow = 1.0;
    lit.diffuse = true;
#ifdef LIGHTMAP
    lit.diffuse = ((*light).flags & mesh_view_types::POINT_LIGHT_FLAGS_AFFECTS_LIGHTMAPPED_MESH_DIFFUSE_BIT) != 0u;
#endif
    return lit;
}

// Shadow of a point or spot light at a place that looks along `normal`.
fn clustered_shadow(id: u32, spot: bool, position: vec4<f32>, normal: vec3<f32>, frag_coord: vec2<f32>) -> f32 {
    let light = &view_bindings::clustered_lights.data[id];
    if ((*light).flags & mesh_view_types::POINT_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) == 0u {
        return 1.0;
    }
    if spot {
        return shadows::fetch_spot_shadow(id, position, normal, (*light).shadow_map_near_z, frag_coord);
    }
    return shadows::fetch_point_shadow(id, position, normal, frag_coord);
}

// The `StandardMaterial` of a point as input for Bevy's light functions.
fn lighting_input_from_pbr(in: PbrInput) -> lighting::LightingInput {
    let base = in.material.base_color.rgb;
    var input: lighting::LightingInput;
    input.layers[LAYER_BASE].N = in.N;
    input.layers[LAYER_BASE].R = reflect(-in.V, in.N);
    input.layers[LAYER_BASE].NdotV = max(dot(in.N, in.V), 0.0001);
    input.layers[LAYER_BASE].perceptual_roughness = in.material.perceptual_roughness;
    input.layers[LAYER_BASE].roughness = lighting::perceptualRoughnessToRoughness(in.material.perceptual_roughness);
    input.P = in.world_position.xyz;
    input.V = in.V;
    input.diffuse_color =
        calculate_diffuse_color(base, in.material.metallic, 0.0, in.material.diffuse_transmission);
    input.metallic = in.material.metallic;
    input.F0_dielectric = calculate_F0_dielectric(in.material.reflectance);
    input.F0_metallic = base;
    input.F_ab = lighting::F_AB(in.material.perceptual_roughness, input.layers[LAYER_BASE].NdotV);
#ifdef STANDARD_MATERIAL_CLEARCOAT
    input.layers[LAYER_CLEARCOAT].N = in.clearcoat_N;
    input.layers[LAYER_CLEARCOAT].R = reflect(-in.V, in.clearcoat_N);
    input.layers[LAYER_CLEARCOAT].NdotV = max(dot(in.clearcoat_N, in.V), 0.0001);
    input.layers[LAYER_CLEARCOAT].perceptual_roughness = in.material.clearcoat_perceptual_roughness;
    input.layers[LAYER_CLEARCOAT].roughness =
        lighting::perceptualRoughnessToRoughness(in.material.clearcoat_perceptual_roughness);
    input.clearcoat_strength = in.material.clearcoat;
#endif
#ifdef STANDARD_MATERIAL_ANISOTROPY
    input.anisotropy = in.anisotropy_strength;
    input.Ta = in.anisotropy_T;
    input.Ba = in.anisotropy_B;
#endif
    return input;
}

#ifdef STANDARD_MATERIAL_DIFFUSE_TRANSMISSION
// The far side of something thin: a Lambertian lobe that looks the other way.
fn far_side(in: PbrInput) -> lighting::LightingInput {
    var input: lighting::LightingInput;
    input.layers[LAYER_BASE].N = -in.N;
    input.layers[LAYER_BASE].NdotV = 1.0;
    input.layers[LAYER_BASE].perceptual_roughness = 1.0;
    input.layers[LAYER_BASE].roughness = 1.0;
    input.P = in.world_position.xyz - in.world_normal * in.material.thickness;
    input.V = -in.V;
    input.diffuse_color =
        in.material.base_color.rgb * (1.0 - in.material.metallic) * in.material.diffuse_transmission;
    input.F_ab = vec2(0.1);
    return input;
}
#endif

// Light of one source through all layers.
fn reflected(point: Point, input: ptr<function, lighting::LightingInput>, lit: Lit, kind: u32, id: u32) -> vec3<f32> {
    let pores = matter_coefficients(point, input, saturate(dot((*input).layers[LAYER_BASE].N, lit.L)));
    let through = through_water(point, input, pores, saturate(dot(point.surface.N, lit.L)));
    var base: vec3<f32>;
    if has_flag(FLAG_BLINN_PHONG) {
        base = blinn_phong(input, lit.L) * lit.irradiance;
    } else if kind == POINT {
        base = lighting::point_light(id, input, lit.diffuse, true);
    } else if kind == SPOT {
        base = lighting::spot_light(id, input, lit.diffuse);
    } else {
        base = lighting::directional_light(id, input, lit.diffuse);
    }
    return add_water(point, through, (*input).V, lit.L, base, lit.irradiance) * lit.shadow;
}

const POINT: u32 = 0u;
const SPOT: u32 = 1u;
const SUN: u32 = 2u;

// `normal`: of the water's surface where it is level.
fn apply_wet_lighting(in: PbrInput, water: Water, normal: vec3<f32>) -> vec4<f32> {
    var input = lighting_input_from_pbr(in);
    let point = point_from_pbr(in, input, water, normal);

    let view = &view_bindings::view;
    let view_z = dot(vec4((*view).view_from_world[0].z, (*view).view_from_world[1].z,
        (*view).view_from_world[2].z, (*view).view_from_world[3].z), in.world_position);
    let cluster = clustering::view_fragment_cluster_index(in.frag_coord.xy, view_z, in.is_orthographic);
    var ranges = clustering::unpack_clusterable_object_index_ranges(cluster);
    let shadowed = (in.flags & MESH_FLAGS_SHADOW_RECEIVER_BIT) != 0u;
#ifdef STANDARD_MATERIAL_DIFFUSE_TRANSMISSION
    var far = far_side(in);
    let far_position = vec4(far.P, 1.0);
    let far_shadowed = shadowed && (in.flags & MESH_FLAGS_TRANSMITTED_SHADOW_RECEIVER_BIT) != 0u;
#endif

    var direct = vec3(0.0);
    var transmitted = vec3(0.0);
    for (var i = ranges.first_point_light_index_offset; i < ranges.first_reflection_probe_index_offset; i += 1u) {
        let id = clustering::get_clusterable_object_id(i);
        let spot = i >= ranges.first_spot_light_index_offset;
        var lit = clustered_light(id, input.P, spot);
        if shadowed {
            lit.shadow = clustered_shadow(id, spot, in.world_position, in.world_normal, in.frag_coord.xy);
        }
        direct += reflected(point, &input, lit, select(POINT, SPOT, spot), id);
#ifdef STANDARD_MATERIAL_DIFFUSE_TRANSMISSION
        var far_shadow = 1.0;
        if far_shadowed {
            far_shadow = clustered_shadow(id, spot, far_position, -in.world_normal, in.frag_coord.xy);
        }
        if spot {
            transmitted += lighting::spot_light(id, &far, lit.diffuse) * far_shadow;
        } else {
            transmitted += lighting::point_light(id, &far, lit.diffuse, true) * far_shadow;
        }
#endif
    }
    for (var i = 0u; i < view_bindings::lights.n_directional_lights; i += 1u) {
        let light = &view_bindings::lights.directional_lights[i];
        let casts = ((*light).flags & mesh_view_types::DIRECTIONAL_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) != 0u;
        var lit = Lit((*light).direction_to_light.xyz, (*light).color.rgb, 1.0, true);
#ifdef LIGHTMAP
        lit.diffuse =
            ((*light).flags & mesh_view_types::DIRECTIONAL_LIGHT_FLAGS_AFFECTS_LIGHTMAPPED_MESH_DIFFUSE_BIT) != 0u;
#endif
        if shadowed && casts {
            lit.shadow = shadows::fetch_directional_shadow(i, in.world_position, in.world_normal, view_z, in.frag_coord.xy);
        }
        direct += reflected(point, &input, lit, SUN, i);
#ifdef STANDARD_MATERIAL_DIFFUSE_TRANSMISSION
        var far_shadow = 1.0;
        if far_shadowed && casts {
            far_shadow = shadows::fetch_directional_shadow(i, far_position, -in.world_normal, view_z, in.frag_coord.xy);
        }
        transmitted += lighting::directional_light(i, &far, lit.diffuse) * far_shadow;
#endif
    }

    // Light from everywhere: its mean angle counts for the pores. What got into the water comes out as it does of a lamp.
    let pores = matter_coefficients(point, &input, AMBIENT_COSINE);
    let coverage = point.water.coverage;
    let mirrored = fresnel(WATER_REFLECTANCE, point.surface.NdotV);
    let clear = clearness(point, AMBIENT_COSINE) * (1.0 - pores * mirrored);
    let spread = clear * (1.0 - coverage * mirrored);
    let highlight = clear * film_transmission(point.surface.NdotV, point.surface.NdotV, coverage);
    var indirect = vec3(0.0);
    var found_diffuse = false;
#ifdef LIGHTMAP
    indirect += in.lightmap_light * input.diffuse_color * spread;
    found_diffuse = true;
#endif
#ifdef IRRADIANCE_VOLUME
    if !found_diffuse {
        let irradiance = irradiance_volume::irradiance_volume_light(in.world_position.xyz, in.N, &ranges);
        indirect += irradiance * input.diffuse_color * in.diffuse_occlusion * spread;
        found_diffuse = true;
    }
#endif
#ifdef ENVIRONMENT_MAP
    var from_sky = input;
#ifdef STANDARD_MATERIAL_ANISOTROPY
#ifdef PBR_ANISOTROPY_TEXTURE_SUPPORTED
#ifdef VERTEX_TANGENTS
    // As Bevy lights the dry matter. Otherwise there are no axes to bend it along.
    bend_normal_for_anisotropy(&from_sky);
#endif
#endif
#endif
    let environment = environment_map::environment_map_light(&from_sky, &ranges, found_diffuse);
    indirect += environment.diffuse * (in.diffuse_occlusion * spread);
    indirect += environment.specular * (in.specular_occlusion * highlight);
    let mirror = (coverage + pores) * mirrored;
    if mirror > 0.0 {
        let sky = environment_map::compute_radiances(point.surface, &ranges, in.world_position.xyz, true);
        indirect += sky.radiance * (in.specular_occlusion * mirror);
    }
#ifdef STANDARD_MATERIAL_DIFFUSE_TRANSMISSION
    var far_sky = far;
    far_sky.diffuse_color = vec3(1.0);
    far_sky.F0_dielectric = vec3(1.0);
    far_sky.layers[LAYER_BASE].R = -in.V;
    transmitted += environment_map::environment_map_light(&far_sky, &ranges, false).diffuse * far.diffuse_color;
#endif
#endif
    var enable_ambient = true;
#ifdef LIGHTMAP
    enable_ambient = view_bindings::lights.ambient_light_affects_lightmapped_meshes != 0u;
#endif
    if enable_ambient {
        let F0 = mix(input.F0_dielectric, input.F0_metallic, input.metallic);
        indirect += spread * ambient::ambient_light(in.world_position, in.N, in.V, input.layers[LAYER_BASE].NdotV,
            input.diffuse_color, F0, in.material.perceptual_roughness, in.diffuse_occlusion);
#ifdef STANDARD_MATERIAL_DIFFUSE_TRANSMISSION
        transmitted += ambient::ambient_light(far_position, -in.N, -in.V, 1.0, far.diffuse_color, vec3(0.0), 1.0, vec3(1.0));
#endif
    }

    let alpha = in.material.base_color.a;
    let exposure = (*view).exposure;
    var emissive = in.material.emissive.rgb * alpha * mix(1.0, exposure, in.material.emissive.a);
#ifdef STANDARD_MATERIAL_CLEARCOAT
    emissive *= 1.0 - in.material.clearcoat * lighting::F_Schlick(0.04, 1.0, input.layers[LAYER_CLEARCOAT].NdotV);
#endif
    return vec4(exposure * (direct + transmitted + indirect) + emissive, alpha);
}
