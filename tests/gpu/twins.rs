//! Wet models, films, floods, ripples and reliefs: every function of the shaders against its double-precision twin.

use bevy::math::{DVec2, DVec3};
use bevy_weathering::material::film::{flood, layer, ripples};
use bevy_weathering::material::footprint::axis_taps;
use bevy_weathering::material::models::{authored, film_on_pores, lagarde, lekner_dorf, twomey};
use bevy_weathering::material::normals::{self, Frame};
use bevy_weathering::matter::look as matter;
use bevy_weathering::wetting::evolve::{Amounts, Matter, evolve};
use bevy_weathering::wetting::look;

use super::harness;

const SOURCES: [(&str, &str); 13] = [
    ("hnat.wgsl", include_str!("../../shaders/common/hnat.wgsl")),
    ("lagarde.wgsl", include_str!("../../shaders/common/lagarde.wgsl")),
    ("lekner_dorf.wgsl", include_str!("../../shaders/common/lekner_dorf.wgsl")),
    ("twomey.wgsl", include_str!("../../shaders/common/twomey.wgsl")),
    ("authored.wgsl", include_str!("../../shaders/common/authored.wgsl")),
    ("film_on_pores.wgsl", include_str!("../../shaders/common/film_on_pores.wgsl")),
    ("water_film.wgsl", include_str!("../../shaders/common/water_film.wgsl")),
    ("flood.wgsl", include_str!("../../shaders/common/flood.wgsl")),
    ("ripples.wgsl", include_str!("../../shaders/common/ripples.wgsl")),
    ("drying.wgsl", include_str!("../../shaders/common/drying.wgsl")),
    ("matter.wgsl", include_str!("../../shaders/common/matter.wgsl")),
    ("normals.wgsl", include_str!("../../shaders/common/normals.wgsl")),
    ("footprint.wgsl", include_str!("../../shaders/common/footprint.wgsl")),
];

/// Random numbers of one input, each in `[0, 1)`.
const NUMBERS: usize = 8;

const INPUTS: usize = 10_000;

/// One function: an expression over `x: array<f32, 8>` in WGSL, and the same over `x: &[f64; 8]` in Rust.
struct Twin {
    wgsl: &'static str,
    rust: fn(&[f64; NUMBERS]) -> f64,
}

const TWINS: &[Twin] = &[
    Twin {
        // Exact in both precisions: it rounds down.
        wgsl: "f32(footprint::axis_taps(floor(4096.0 * x[0]) * 0.00390625 - 8.0, floor(1024.0 * x[1]) * 0.00390625).low)",
        rust: |x| {
            f64::from(axis_taps((4096.0 * x[0]).floor() / 256.0 - 8.0, (1024.0 * x[1]).floor() / 256.0).low)
        },
    },
    Twin {
        // Exact in both precisions: it rounds down.
        wgsl: "f32(footprint::axis_taps(floor(4096.0 * x[0]) * 0.00390625 - 8.0, floor(1024.0 * x[1]) * 0.00390625).high)",
        rust: |x| {
            f64::from(axis_taps((4096.0 * x[0]).floor() / 256.0 - 8.0, (1024.0 * x[1]).floor() / 256.0).high)
        },
    },
    Twin {
        wgsl: "footprint::axis_taps(0.6 + 0.8 * x[0], 5.0 * x[1]).part",
        rust: |x| axis_taps(0.6 + 0.8 * x[0], 5.0 * x[1]).part,
    },
    Twin {
        wgsl: "normals::surface_frame(normals::relief_normal(vec2(0.3, -0.2)), vec3(1.0 + x[0], x[1] - 0.5, x[2] - 0.5), vec3(x[3] - 0.5, 1.0 + x[4], 0.3), vec2(1.0 + x[5], x[6] - 0.5), vec2(x[7] - 0.5, 1.3)).along_v.x",
        rust: |x| frame(x, 1.3).along_v.x,
    },
    Twin {
        wgsl: "normals::slopes_in_frame(normals::surface_frame(normals::relief_normal(vec2(0.3, -0.2)), vec3(1.0 + x[0], x[1] - 0.5, x[2] - 0.5), vec3(x[3] - 0.5, 1.0 + x[4], 0.3), vec2(1.0 + x[5], x[6] - 0.5), vec2(x[7] - 0.5, 1.3)), vec2(x[1], x[2])).y",
        rust: |x| normals::slopes_in_frame(frame(x, 1.3), DVec2::new(x[1], x[2])).y,
    },
    Twin {
        wgsl: "normals::relieved(normals::surface_frame(normals::relief_normal(vec2(0.3, -0.2)), vec3(1.0 + x[0], x[1] - 0.5, x[2] - 0.5), vec3(x[3] - 0.5, 1.0 + x[4], 0.3), vec2(1.0 + x[5], x[6] - 0.5), vec2(x[7] - 0.5, 1.3)), normals::relief_normal(vec2(x[1], x[2])), vec2(x[3], -x[4])).y",
        rust: |x| normals::relieved(frame(x, 1.3), leaning(x[1], x[2]), DVec2::new(x[3], -x[4])).y,
    },
    Twin {
        wgsl: "normals::surface_frame(normals::relief_normal(vec2(0.3, -0.2)), vec3(1.0 + x[0], x[1] - 0.5, x[2] - 0.5), vec3(x[3] - 0.5, 1.0 + x[4], 0.3), vec2(1.0 + x[5], x[6] - 0.5), vec2(x[7] - 0.5, -1.3)).along_v.x",
        rust: |x| frame(x, -1.3).along_v.x,
    },
    Twin {
        wgsl: "normals::slopes_in_frame(normals::surface_frame(normals::relief_normal(vec2(0.3, -0.2)), vec3(1.0 + x[0], x[1] - 0.5, x[2] - 0.5), vec3(x[3] - 0.5, 1.0 + x[4], 0.3), vec2(1.0 + x[5], x[6] - 0.5), vec2(x[7] - 0.5, -1.3)), vec2(x[1], x[2])).y",
        rust: |x| normals::slopes_in_frame(frame(x, -1.3), DVec2::new(x[1], x[2])).y,
    },
    Twin {
        wgsl: "normals::relieved(normals::surface_frame(normals::relief_normal(vec2(0.3, -0.2)), vec3(1.0 + x[0], x[1] - 0.5, x[2] - 0.5), vec3(x[3] - 0.5, 1.0 + x[4], 0.3), vec2(1.0 + x[5], x[6] - 0.5), vec2(x[7] - 0.5, -1.3)), normals::relief_normal(vec2(x[1], x[2])), vec2(x[3], -x[4])).y",
        rust: |x| normals::relieved(frame(x, -1.3), leaning(x[1], x[2]), DVec2::new(x[3], -x[4])).y,
    },
    Twin {
        wgsl: "normals::reoriented(normals::relief_normal(vec2(6.0 * x[0] - 3.0, 6.0 * x[1] - 3.0)), normals::relief_normal(vec2(6.0 * x[2] - 3.0, 6.0 * x[3] - 3.0))).x",
        rust: |x| reoriented(x).x,
    },
    Twin {
        wgsl: "normals::reoriented(normals::relief_normal(vec2(6.0 * x[0] - 3.0, 6.0 * x[1] - 3.0)), normals::relief_normal(vec2(6.0 * x[2] - 3.0, 6.0 * x[3] - 3.0))).z",
        rust: |x| reoriented(x).z,
    },
    Twin {
        // What is flat changes nothing: the distance is 0, on either side.
        wgsl: "x[2] + length(normals::reoriented(normals::relief_normal(vec2(x[0], x[1])), vec3(0.0, 0.0, 1.0)) - normals::relief_normal(vec2(x[0], x[1])))",
        rust: |x| x[2],
    },
    Twin {
        wgsl: "x[2] + length(normals::reoriented(vec3(0.0, 0.0, 1.0), normals::relief_normal(vec2(x[0], x[1]))) - normals::relief_normal(vec2(x[0], x[1])))",
        rust: |x| x[2],
    },
    Twin {
        // A unit vector also where the base looks away.
        wgsl: "x[4] * length(normals::reoriented(normalize(vec3(x[0] - 0.5, x[1] - 0.5, x[5] - 0.6)), normals::relief_normal(vec2(x[2], x[3]))))",
        rust: |x| x[4],
    },
    Twin {
        wgsl: "normals::painted_slopes(vec4(x[0], x[1], 0.0, x[2])).y",
        rust: |x| normals::painted_slopes([x[0], x[1], x[2]]).y,
    },
    Twin {
        wgsl: "normals::faced(vec3(x[0], x[1], 0.3), vec3(x[2], x[3] - 0.8, 0.0)).x * f32(abs(x[0] * x[2] + x[1] * (x[3] - 0.8)) > 1e-4)",
        rust: |x| {
            // A step: near it single precision decides otherwise.
            let away = (x[0] * x[2] + x[1] * (x[3] - 0.8)).abs() > 1e-4;
            let faced = normals::faced(DVec3::new(x[0], x[1], 0.3), DVec3::new(x[2], x[3] - 0.8, 0.0));
            faced.x * f64::from(u8::from(away))
        },
    },
    Twin {
        wgsl: "matter::matter_cover(0.2 * x[0], 0.01 + 0.1 * x[1])",
        rust: |x| matter::matter_cover(0.2 * x[0], 0.01 + 0.1 * x[1]),
    },
    Twin {
        wgsl: "matter::dust_color_over(vec3(x[0]), vec3(x[1]), vec3(x[2]), vec2(x[3], x[4]), x[5]).y",
        rust: |x| matter::dust_color_over(x[0], x[1], x[2], [x[3], x[4]], x[5]),
    },
    Twin {
        wgsl: "matter::snow_albedo(vec3(x[0]), vec3(0.3 + 0.69 * x[1]), 40.0 * x[2]).z",
        rust: |x| matter::snow_albedo(x[0], 0.3 + 0.69 * x[1], 40.0 * x[2]),
    },
    Twin {
        // A step at 0: what is near it is left out, single precision decides otherwise there.
        wgsl: "matter::heap_fall(x[0] - 0.3, x[1], x[2] - 0.3) * f32(abs(x[0] - 0.3) > 1e-4 && abs(x[2] - 0.3) > 1e-4)",
        rust: |x| {
            let away = (x[0] - 0.3).abs() > 1e-4 && (x[2] - 0.3).abs() > 1e-4;
            matter::heap_fall(x[0] - 0.3, x[1], x[2] - 0.3) * f64::from(u8::from(away))
        },
    },
    Twin {
        wgsl: "matter::roughness_under(x[0], x[1], x[2])",
        rust: |x| matter::roughness_under(x[0], x[1], x[2]),
    },
    Twin {
        wgsl: "matter::settled_soil(x[0], x[1], x[2], x[3] - 0.5).x",
        rust: |x| matter::settled_soil(x[0], x[1], x[2], x[3] - 0.5)[0],
    },
    Twin {
        wgsl: "matter::settled_soil(x[0], x[1], x[2], x[3] - 0.5).y",
        rust: |x| matter::settled_soil(x[0], x[1], x[2], x[3] - 0.5)[1],
    },
    Twin { wgsl: "lagarde::kept_albedo(x[0], x[1])", rust: |x| lagarde::kept_albedo(x[0], x[1]) },
    Twin {
        wgsl: "lagarde::wet_albedo(vec3(x[0]), x[1], x[2]).y",
        rust: |x| lagarde::wet_albedo(x[0], x[1], x[2]),
    },
    Twin { wgsl: "lagarde::wet_gloss(x[0], x[1], x[2])", rust: |x| lagarde::wet_gloss(x[0], x[1], x[2]) },
    Twin { wgsl: "lagarde::porosity_from_gloss(x[0])", rust: |x| lagarde::porosity_from_gloss(x[0]) },
    Twin {
        wgsl: "lagarde::porosity_from_mask(x[0], x[1])",
        rust: |x| lagarde::porosity_from_mask(x[0], x[1]),
    },
    Twin {
        // A step: near it single precision decides otherwise.
        wgsl: "lagarde::metalness_from_specular(vec3(x[0], x[1], x[2])) * f32(abs(x[0] + x[1] + x[2] - 1.5167) > 1e-4)",
        rust: |x| {
            let away = (x[0] + x[1] + x[2] - 1.5167).abs() > 1e-4;
            lagarde::metalness_from_specular([x[0], x[1], x[2]]) * f64::from(u8::from(away))
        },
    },
    Twin { wgsl: "lagarde::roughness_from_gloss(x[0])", rust: |x| lagarde::roughness_from_gloss(x[0]) },
    Twin { wgsl: "lagarde::gloss_from_roughness(x[0])", rust: |x| lagarde::gloss_from_roughness(x[0]) },
    Twin {
        wgsl: "lagarde::wet_roughness(x[0], x[1], x[2])",
        rust: |x| lagarde::wet_roughness(x[0], x[1], x[2]),
    },
    Twin {
        wgsl: "lekner_dorf::wet_absorption(vec3(x[0]), 1.0 + 0.2 * x[1]).z",
        rust: |x| lekner_dorf::wet_absorption(x[0], 1.0 + 0.2 * x[1]),
    },
    Twin {
        wgsl: "lekner_dorf::wet_diffuse(vec3(x[0]), 1.0 + 0.2 * x[1], 0.9 * x[2]).x",
        rust: |x| lekner_dorf::wet_diffuse(x[0], 1.0 + 0.2 * x[1], 0.9 * x[2]),
    },
    Twin {
        wgsl: "twomey::wet_albedo(vec3(x[0]), 0.05 + 0.95 * x[1]).y",
        rust: |x| twomey::wet_albedo(x[0], 0.05 + 0.95 * x[1]),
    },
    Twin {
        wgsl: "authored::authored(vec3(x[0]), vec3(x[1]), x[2]).x",
        rust: |x| authored::authored(x[0], x[1], x[2]),
    },
    Twin {
        wgsl: "film_on_pores::film_darkening(vec3(x[0]), x[1], x[2], 1.0 + 0.2 * x[3], 0.9 * x[4], x[5]).x",
        rust: |x| film_on_pores::film_darkening(x[0], x[1], x[2], 1.0 + 0.2 * x[3], 0.9 * x[4], x[5]),
    },
    Twin {
        wgsl: "water_film::fresnel(x[0], x[1] * 1.2 - 0.1)",
        rust: |x| layer::fresnel(x[0], x[1] * 1.2 - 0.1),
    },
    Twin { wgsl: "water_film::mean_fresnel(x[0])", rust: |x| layer::mean_fresnel(x[0]) },
    Twin {
        wgsl: "water_film::reflectance_under_water(vec3(x[0])).x",
        rust: |x| layer::reflectance_under_water(x[0]),
    },
    Twin {
        wgsl: "water_film::film_coverage(x[0] * 0.3 - 0.05)",
        rust: |x| layer::film_coverage(x[0] * 0.3 - 0.05),
    },
    Twin {
        wgsl: "water_film::film_levelness(2.0 * x[0], 0.1 + x[1])",
        rust: |x| layer::film_levelness(2.0 * x[0], 0.1 + x[1]),
    },
    Twin {
        wgsl: "water_film::film_transmission(x[0], x[1], x[2])",
        rust: |x| layer::film_transmission(x[0], x[1], x[2]),
    },
    Twin {
        wgsl: "water_film::film_diffuse_transmission(x[0], x[1], x[2])",
        rust: |x| layer::film_diffuse_transmission(x[0], x[1], x[2]),
    },
    Twin {
        wgsl: "water_film::murk(vec3(x[0]), 3.0 * x[1], x[2], x[3]).z",
        rust: |x| layer::murk(x[0], 3.0 * x[1], x[2], x[3]),
    },
    Twin {
        wgsl: "flood::accumulated(x[0], x[1], x[2], x[3])",
        rust: |x| flood::accumulated(x[0], x[1], x[2], x[3]),
    },
    Twin {
        wgsl: "flood::flood_depth(3.0 * x[0], 2.0 * x[1], x[2], x[3], x[4])",
        rust: |x| flood::flood_depth(3.0 * x[0], 2.0 * x[1], x[2], x[3], x[4]),
    },
    Twin {
        wgsl: "dot(flood::region_weights(x[0], x[1], x[2]), vec4(1.0, 10.0, 100.0, 1000.0)) / 1000.0",
        rust: |x| {
            let [dry, wet, drenched, puddle] = flood::region_weights(x[0], x[1], x[2]);
            (dry + 10.0 * wet + 100.0 * drenched + 1000.0 * puddle) / 1000.0
        },
    },
    Twin {
        wgsl: "ripples::ring_slope(x[0], x[1] * 1.2 - 0.1, 0.5, 0.3)",
        rust: |x| ripples::ring_slope(x[0], x[1] * 1.2 - 0.1, 0.5, 0.3),
    },
    Twin {
        wgsl: "dot(ripples::layer_weights(30.0 * x[0]), vec4(0.1, 0.2, 0.3, 0.4))",
        rust: |x| {
            let weights = ripples::layer_weights(30.0 * x[0]);
            weights.iter().zip([0.1, 0.2, 0.3, 0.4]).map(|(weight, share)| weight * share).sum()
        },
    },
    Twin {
        wgsl: "ripples::rain_slopes(vec2(20.0 * x[0] - 10.0, 20.0 * x[1] - 10.0), 60.0 * x[2], 30.0 * x[3]).x",
        rust: |x| ripples::rain_slopes([20.0 * x[0] - 10.0, 20.0 * x[1] - 10.0], 60.0 * x[2], 30.0 * x[3])[0],
    },
    Twin {
        wgsl: "ripples::rain_slopes(vec2(20.0 * x[0] - 10.0, 20.0 * x[1] - 10.0), 60.0 * x[2], 30.0 * x[3]).y",
        rust: |x| ripples::rain_slopes([20.0 * x[0] - 10.0, 20.0 * x[1] - 10.0], 60.0 * x[2], 30.0 * x[3])[1],
    },
    Twin { wgsl: "drying::drying_sigmoid(x[0])", rust: |x| look::drying_sigmoid(x[0]) },
    Twin { wgsl: "drying::gloss_left(x[0])", rust: |x| look::gloss_left(x[0]) },
    Twin {
        wgsl: "drying::water_look(x[0], 0.05 + x[1], vec2(x[2], x[5]), 2.0 * x[3] - 0.5, 0.2 + x[4]).x",
        rust: |x| look::water_look(x[0], 0.05 + x[1], [x[2], x[5]], 2.0 * x[3] - 0.5, 0.2 + x[4]).wetness,
    },
    Twin {
        wgsl: "drying::water_look(x[0], 0.05 + x[1], vec2(x[2], x[5]), 2.0 * x[3] - 0.5, 0.2 + x[4]).y",
        rust: |x| look::water_look(x[0], 0.05 + x[1], [x[2], x[5]], 2.0 * x[3] - 0.5, 0.2 + x[4]).gloss,
    },
    Twin {
        wgsl: "drying::water_look(x[0], 0.05 + x[1], vec2(x[2], x[5]), 2.0 * x[3] - 0.5, 0.2 + x[4]).z",
        rust: |x| look::water_look(x[0], 0.05 + x[1], [x[2], x[5]], 2.0 * x[3] - 0.5, 0.2 + x[4]).film,
    },
    Twin {
        wgsl: "drying::evolve(drying::Amounts(x[0], x[1], 0.2 * x[2]), x[3] * x[3], 0.1 + 2.0 * x[4], 4.0 * x[5], 2.0 * x[6]).film_mm",
        rust: |x| evolved(x).film_mm,
    },
    Twin {
        wgsl: "drying::evolve(drying::Amounts(x[0], x[1], 0.2 * x[2]), x[3] * x[3], 0.1 + 2.0 * x[4], 4.0 * x[5], 2.0 * x[6]).pores_mm",
        rust: |x| evolved(x).pores_mm,
    },
    Twin {
        wgsl: "drying::evolve(drying::Amounts(x[0], x[1], 0.2 * x[2]), x[3] * x[3], 0.1 + 2.0 * x[4], 4.0 * x[5], 2.0 * x[6]).reserve_mm",
        rust: |x| evolved(x).reserve_mm,
    },
];

fn evolved(x: &[f64; NUMBERS]) -> Amounts {
    let before = Amounts { film_mm: x[0], pores_mm: x[1], reserve_mm: 0.2 * x[2] };
    let matter = Matter { sorptivity_squared: x[3] * x[3], capacity_mm: 0.1 + 2.0 * x[4] };
    evolve(before, matter, 4.0 * x[5], 2.0 * x[6])
}

fn leaning(u: f64, v: f64) -> DVec3 {
    normals::relief_normal(DVec2::new(u, v))
}

fn reoriented(x: &[f64; NUMBERS]) -> DVec3 {
    let leaning = |u: f64, v: f64| leaning(6.0 * u - 3.0, 6.0 * v - 3.0);
    normals::reoriented(leaning(x[0], x[1]), leaning(x[2], x[3]))
}

/// Of a surface that the screen looks at askew; `v`: how v changes down the screen.
fn frame(x: &[f64; NUMBERS], v: f64) -> Frame {
    normals::surface_frame(
        leaning(0.3, -0.2),
        DVec3::new(1.0 + x[0], x[1] - 0.5, x[2] - 0.5),
        DVec3::new(x[3] - 0.5, 1.0 + x[4], 0.3),
        DVec2::new(1.0 + x[5], x[6] - 0.5),
        DVec2::new(x[7] - 0.5, v),
    )
}

fn inputs() -> Vec<[f32; NUMBERS]> {
    let mut state = 0x1234_5678u32;
    let mut random = || {
        state = ripples::pcg(state.wrapping_add(0x9e37_79b9));
        // 24 bits: exact in both precisions.
        (state >> 8) as f32 / (1 << 24) as f32
    };
    (0..INPUTS).map(|_| std::array::from_fn(|_| random())).collect()
}

#[test]
fn shaders_match_their_twins() {
    let Some(gpu) = harness::gpu() else { return };
    let imports: String = SOURCES
        .iter()
        .map(|(file, _)| format!("#import bevy_weathering::{}\n", file.trim_end_matches(".wgsl")))
        .collect();
    let calls: String = TWINS
        .iter()
        .enumerate()
        .map(|(i, twin)| format!("    outputs[id.x][{i}] = {};\n", twin.wgsl))
        .collect();
    let entry = format!(
        "{imports}
@group(0) @binding(0) var<storage, read> inputs: array<array<f32, {NUMBERS}>>;
@group(0) @binding(1) var<storage, read_write> outputs: array<array<f32, {}>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
    if id.x >= arrayLength(&inputs) {{
        return;
    }}
    let x = inputs[id.x];
{calls}}}
",
        TWINS.len()
    );
    let inputs = inputs();
    const COUNT: usize = TWINS.len();
    let outputs: Vec<[f32; COUNT]> =
        harness::run_compute(&gpu, harness::compose(&SOURCES, &entry), &inputs, 64);
    for (i, twin) in TWINS.iter().enumerate() {
        let expected: Vec<f64> = inputs.iter().map(|input| (twin.rust)(&input.map(f64::from))).collect();
        let least = expected.iter().copied().fold(f64::INFINITY, f64::min);
        let spread = expected.iter().copied().fold(f64::NEG_INFINITY, f64::max) - least;
        assert!(spread > 1e-2, "{}: {spread} from {least} on says nothing", twin.wgsl);
        // A function that hardly varies must not pass for a constant.
        let tolerance = f64::min(2e-3, 0.05 * spread);
        for ((input, output), expected) in inputs.iter().zip(&outputs).zip(expected) {
            let error = (f64::from(output[i]) - expected).abs();
            assert!(error <= tolerance, "{}: {} instead of {expected} for {input:?}", twin.wgsl, output[i]);
        }
    }
}
