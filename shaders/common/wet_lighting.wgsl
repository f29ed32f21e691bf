// Lights a porous, wet surface with everything that shines on it.
//
// Walks Bevy's lights. For each, the porous BRDF post-process (`hnat`) says what the coefficients of the base BRDF are
// for this light; Bevy's own light functions do the rest, with its shadows and clusters. The water in the pores is a
// lobe of its own, nearly a mirror, which also reflects the environment map.

#define_import_path bevy_weathering::wet_lighting

#import bevy_pbr::{
    ambient,
    clustered_forward as clustering,
    lighting,
    lighting::{LAYER_BASE, LAYER_CLEARCOAT},
    mesh_types::MESH_FLAGS_SHADOW_RECEIVER_BIT,
    mesh_view_bindings as view_bindings,
    mesh_view_types,
    pbr_functions::{calculate_diffuse_color, calculate_F0, calculate_F0_dielectric},
    pbr_types,
    shadows,
}
#import bevy_weathering::hnat::{PorousParams, HnatTerms, hnat_terms}

#ifdef ENVIRONMENT_MAP
#import bevy_pbr::environment_map
#endif
#ifdef IRRADIANCE_VOLUME
#import bevy_pbr::irradiance_volume
#endif

const PI: f32 = 3.14159265358979;
// Reflectance of water at normal incidence, n = 1.33.
const WATER_REFLECTANCE: f32 = 0.02;
// Perceptual roughness of water in pores: nearly a mirror.
const WATER_ROUGHNESS: f32 = 0.12;
// How far water levels out the normal of what it covers.
const WATER_LEVELLING: f32 = 0.6;
// Mean cosine of light that comes from everywhere.
const AMBIENT_COSINE: f32 = 0.6666667;

// The porous side of a surface point.
struct WetSurface {
    porous: PorousParams,
    // Part of the light that the dry surface scatters back.
    k_s: f32,
    // How wet, 0..=1.
    tau: f32,
    // The base colour is the solid's, not the dry porous look.
    solid: bool,
    // Blinn-Phong instead of GGX under the post-process.
    blinn_phong: bool,
}

// What a point keeps for all lights.
struct Point {
    surface: WetSurface,
    // Colours before the post-process.
    diffuse: vec3<f32>,
    reflectance: vec3<f32>,
    // The water's layer.
    water: lighting::LayerLightingInput,
}

// Sets the coefficients of the base BRDF for light from a direction at cosine `n_dot_s`; returns the water's part.
fn wet_coefficients(point: Point, input: ptr<function, lighting::LightingInput>, n_dot_s: f32) -> f32 {
    let n_dot_v = (*input).layers[LAYER_BASE].NdotV;
    let terms = hnat_terms(point.surface.porous, point.surface.k_s, point.diffuse, n_dot_s, n_dot_v,
        acos(clamp(n_dot_s, 0.0, 1.0)), acos(clamp(n_dot_v, 0.0, 1.0)), point.surface.tau);
    if point.surface.solid {
        (*input).diffuse_color = terms.kd_wet;
        (*input).F0_dielectric = point.reflectance * (terms.ks_dry / max(point.surface.k_s, 1e-6));
    } else {
        (*input).diffuse_color = point.diffuse * terms.kd_wet / max(terms.kd_dry, vec3(1e-6));
    }
    return terms.water;
}

// Fresnel factor of water (Schlick 1994).
fn water_fresnel(cosine: f32) -> f32 {
    return lighting::F_Schlick(WATER_REFLECTANCE, 1.0, saturate(cosine));
}

// Light of a direction that the water reflects, for an irradiance of 1.
fn water_specular(point: Point, V: vec3<f32>, L: vec3<f32>) -> f32 {
    let N = point.water.N;
    let H = normalize(L + V);
    let n_dot_l = saturate(dot(N, L));
    let distribution = lighting::D_GGX(point.water.roughness, saturate(dot(N, H)));
    let visibility = lighting::V_SmithGGXCorrelated(point.water.roughness, point.water.NdotV, max(n_dot_l, 1e-4));
    return distribution * visibility * water_fresnel(dot(L, H)) * n_dot_l;
}

// Normalized Blinn-Phong over Lambert, for an irradiance of 1 (n + 8 over 8 pi: Akenine-Moller et al. 2008, 7.6).
fn blinn_phong(input: ptr<function, lighting::LightingInput>, L: vec3<f32>) -> vec3<f32> {
    let N = (*input).layers[LAYER_BASE].N;
    let roughness = (*input).layers[LAYER_BASE].roughness;
    let exponent = max(2.0 / (roughness * roughness) - 2.0, 0.0);
    let n_dot_h = max(dot(N, normalize(L + (*input).V)), 1e-4);
    let F0 = mix((*input).F0_dielectric, (*input).F0_metallic, (*input).metallic);
    let specular = F0 * ((exponent + 8.0) / 8.0 * pow(n_dot_h, exponent));
    return ((*input).diffuse_color + specular) * (saturate(dot(N, L)) / PI);
}

// Adds the water to what the base reflects of one light. `base` includes the irradiance.
fn add_water(point: Point, V: vec3<f32>, L: vec3<f32>, water: f32, base: vec3<f32>, irradiance: vec3<f32>) -> vec3<f32> {
    if water <= 0.0 {
        return base;
    }
    let through = 1.0 - water * water_fresnel(point.water.NdotV);
    return base * through + irradiance * (water * water_specular(point, V, L));
}

// Irradiance of a point light on a surface that faces it.
fn point_irradiance(light_id: u32, to_light: vec3<f32>) -> vec3<f32> {
    let light = &view_bindings::clustered_lights.data[light_id];
    let color_and_range = (*light).color_inverse_square_range;
    return color_and_range.rgb * lighting::getDistanceAttenuation(dot(to_light, to_light), color_and_range.w);
}

// What a spot light leaves of a point light's irradiance.
fn spot_attenuation(light_id: u32, L: vec3<f32>) -> f32 {
    let light = &view_bindings::clustered_lights.data[light_id];
    let custom = (*light).light_custom_data;
    var axis = vec3(custom.x, sqrt(max(0.0, 1.0 - custom.x * custom.x - custom.y * custom.y)), custom.y);
    if ((*light).flags & mesh_view_types::POINT_LIGHT_FLAGS_SPOT_LIGHT_Y_NEGATIVE) != 0u {
        axis.y = -axis.y;
    }
    let attenuation = saturate(dot(-axis, L) * custom.z + custom.w);
    return attenuation * attenuation;
}

// Light from a point or spot light, without its shadow.
fn clustered_light(point: Point, input: ptr<function, lighting::LightingInput>, light_id: u32, spot: bool) -> vec3<f32> {
    let to_light = view_bindings::clustered_lights.data[light_id].position_radius.xyz - (*input).P;
    let L = normalize(to_light);
    let water = wet_coefficients(point, input, saturate(dot((*input).layers[LAYER_BASE].N, L)));
    var irradiance = point_irradiance(light_id, to_light);
    if spot {
        irradiance *= spot_attenuation(light_id, L);
    }
    var base: vec3<f32>;
    if point.surface.blinn_phong {
        base = blinn_phong(input, L) * irradiance;
    } else if spot {
        base = lighting::spot_light(light_id, input, true);
    } else {
        base = lighting::point_light(light_id, input, true, true);
    }
    return add_water(point, (*input).V, L, water, base, irradiance);
}

// Light from a directional light, without its shadow.
fn sun_light(point: Point, input: ptr<function, lighting::LightingInput>, light_id: u32) -> vec3<f32> {
    let L = view_bindings::lights.directional_lights[light_id].direction_to_light.xyz;
    let irradiance = view_bindings::lights.directional_lights[light_id].color.rgb;
    let water = wet_coefficients(point, input, saturate(dot((*input).layers[LAYER_BASE].N, L)));
    var base: vec3<f32>;
    if point.surface.blinn_phong {
        base = blinn_phong(input, L) * irradiance;
    } else {
        base = lighting::directional_light(light_id, input, true);
    }
    return add_water(point, (*input).V, L, water, base, irradiance);
}

// The `StandardMaterial` of a point as input for Bevy's light functions.
fn lighting_input_from_pbr(in: pbr_types::PbrInput) -> lighting::LightingInput {
    let base = in.material.base_color.rgb;
    var input: lighting::LightingInput;
    input.layers[LAYER_BASE].N = in.N;
    input.layers[LAYER_BASE].R = reflect(-in.V, in.N);
    input.layers[LAYER_BASE].NdotV = max(dot(in.N, in.V), 0.0001);
    input.layers[LAYER_BASE].perceptual_roughness = in.material.perceptual_roughness;
    input.layers[LAYER_BASE].roughness = lighting::perceptualRoughnessToRoughness(in.material.perceptual_roughness);
    input.P = in.world_position.xyz;
    input.V = in.V;
    input.diffuse_color = calculate_diffuse_color(base, in.material.metallic, 0.0, 0.0);
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

// The water's layer: leveller than what it covers, and nearly a mirror.
fn water_layer(in: pbr_types::PbrInput, tau: f32) -> lighting::LayerLightingInput {
    var layer: lighting::LayerLightingInput;
    layer.N = normalize(mix(in.N, normalize(in.world_normal), WATER_LEVELLING * tau));
    layer.R = reflect(-in.V, layer.N);
    layer.NdotV = max(dot(layer.N, in.V), 0.0001);
    layer.perceptual_roughness = WATER_ROUGHNESS;
    layer.roughness = lighting::perceptualRoughnessToRoughness(WATER_ROUGHNESS);
    return layer;
}

fn apply_wet_lighting(in: pbr_types::PbrInput, surface: WetSurface) -> vec4<f32> {
    var input = lighting_input_from_pbr(in);
    var point: Point;
    point.surface = surface;
    point.diffuse = input.diffuse_color;
    point.reflectance = input.F0_dielectric;
    point.water = water_layer(in, surface.tau);

    let view = &view_bindings::view;
    let view_z = dot(vec4((*view).view_from_world[0].z, (*view).view_from_world[1].z,
        (*view).view_from_world[2].z, (*view).view_from_world[3].z), in.world_position);
    let cluster = clustering::view_fragment_cluster_index(in.frag_coord.xy, view_z, in.is_orthographic);
    var ranges = clustering::unpack_clusterable_object_index_ranges(cluster);
    let shadowed = (in.flags & MESH_FLAGS_SHADOW_RECEIVER_BIT) != 0u;

    var direct = vec3(0.0);
    for (var i = ranges.first_point_light_index_offset; i < ranges.first_spot_light_index_offset; i += 1u) {
        let id = clustering::get_clusterable_object_id(i);
        let flags = view_bindings::clustered_lights.data[id].flags;
        var shadow = 1.0;
        if shadowed && (flags & mesh_view_types::POINT_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) != 0u {
            shadow = shadows::fetch_point_shadow(id, in.world_position, in.world_normal, in.frag_coord.xy);
        }
        direct += clustered_light(point, &input, id, false) * shadow;
    }
    for (var i = ranges.first_spot_light_index_offset; i < ranges.first_reflection_probe_index_offset; i += 1u) {
        let id = clustering::get_clusterable_object_id(i);
        let flags = view_bindings::clustered_lights.data[id].flags;
        var shadow = 1.0;
        if shadowed && (flags & mesh_view_types::POINT_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) != 0u {
            shadow = shadows::fetch_spot_shadow(id, in.world_position, in.world_normal,
                view_bindings::clustered_lights.data[id].shadow_map_near_z, in.frag_coord.xy);
        }
        direct += clustered_light(point, &input, id, true) * shadow;
    }
    for (var i = 0u; i < view_bindings::lights.n_directional_lights; i += 1u) {
        let flags = view_bindings::lights.directional_lights[i].flags;
        var shadow = 1.0;
        if shadowed && (flags & mesh_view_types::DIRECTIONAL_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) != 0u {
            shadow = shadows::fetch_directional_shadow(i, in.world_position, in.world_normal, view_z, in.frag_coord.xy);
        }
        direct += sun_light(point, &input, i) * shadow;
    }

    let water = wet_coefficients(point, &input, AMBIENT_COSINE);
    var indirect = vec3(0.0);
    var found_diffuse = false;
#ifdef LIGHTMAP
    indirect += in.lightmap_light * input.diffuse_color;
    found_diffuse = true;
#endif
#ifdef IRRADIANCE_VOLUME
    if !found_diffuse {
        let irradiance = irradiance_volume::irradiance_volume_light(in.world_position.xyz, in.N, &ranges);
        indirect += irradiance * input.diffuse_color * in.diffuse_occlusion;
        found_diffuse = true;
    }
#endif
#ifdef ENVIRONMENT_MAP
    let environment = environment_map::environment_map_light(&input, &ranges, found_diffuse);
    indirect += environment.diffuse * in.diffuse_occlusion + environment.specular * in.specular_occlusion;
    if water > 0.0 {
        let mirrored = environment_map::compute_radiances(point.water, &ranges, in.world_position.xyz, true);
        let fresnel = water * water_fresnel(point.water.NdotV);
        indirect = indirect * (1.0 - fresnel) + mirrored.radiance * (fresnel * in.specular_occlusion);
    }
#endif
    let F0 = calculate_F0(in.material.base_color.rgb, in.material.metallic, in.material.reflectance);
    indirect += ambient::ambient_light(in.world_position, in.N, in.V, input.layers[LAYER_BASE].NdotV,
        input.diffuse_color, F0, in.material.perceptual_roughness, in.diffuse_occlusion);

    let alpha = in.material.base_color.a;
    let exposure = (*view).exposure;
    let emissive = in.material.emissive.rgb * alpha * mix(1.0, exposure, in.material.emissive.a);
    return vec4(exposure * (direct + indirect) + emissive, alpha);
}
