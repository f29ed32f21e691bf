//! The porous BRDF: the shader against its double-precision twin.

use std::f32::consts::FRAC_PI_2;

use bevy_weathering::material::models::hnat::{PorousParams, hnat_terms, wet_tau};

use super::harness;
use crate::common::Random;

const SOURCE: (&str, &str) = ("shaders/common/hnat.wgsl", include_str!("../../shaders/common/hnat.wgsl"));

const ENTRY: &str = "
#import bevy_weathering::hnat::{PorousParams, hnat_terms, wet_tau}

struct Input {
    kd: vec3<f32>,
    ks: f32,
    alpha_poro: f32,
    s_p: f32,
    m: f32,
    k_w: f32,
    n_dot_s: f32,
    n_dot_v: f32,
    theta_i: f32,
    theta_r: f32,
    tau: f32,
    t: f32,
    t_start: f32,
    t_fill: f32,
    sqrt_k: u32,
}

struct Output {
    kd_dry: vec3<f32>,
    ks_dry: f32,
    kd_wet: vec3<f32>,
    ks_wet: f32,
    a: vec3<f32>,
    water: f32,
    g: f32,
    nb: f32,
    tau: f32,
}

@group(0) @binding(0) var<storage, read> inputs: array<Input>;
@group(0) @binding(1) var<storage, read_write> outputs: array<Output>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&inputs) {
        return;
    }
    let x = inputs[id.x];
    let params = PorousParams(x.alpha_poro, x.s_p, x.m, x.k_w, x.sqrt_k);
    let terms = hnat_terms(params, x.ks, x.kd, x.n_dot_s, x.n_dot_v, x.theta_i, x.theta_r, x.tau);
    var y: Output;
    y.kd_dry = terms.kd_dry;
    y.ks_dry = terms.ks_dry;
    y.kd_wet = terms.kd_wet;
    y.ks_wet = terms.ks_wet;
    y.a = terms.a;
    y.water = terms.water;
    y.g = terms.g;
    y.nb = terms.nb;
    y.tau = wet_tau(x.t, x.t_start, x.t_fill);
    outputs[id.x] = y;
}
";

const WORKGROUP_SIZE: u32 = 64;

#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct GpuInput {
    kd: [f32; 3],
    ks: f32,
    alpha_poro: f32,
    s_p: f32,
    m: f32,
    k_w: f32,
    n_dot_s: f32,
    n_dot_v: f32,
    theta_i: f32,
    theta_r: f32,
    tau: f32,
    t: f32,
    t_start: f32,
    t_fill: f32,
    sqrt_k: u32,
    /// WGSL rounds the size up to a multiple of 16 bytes.
    padding: [u32; 3],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct GpuOutput {
    kd_dry: [f32; 3],
    ks_dry: f32,
    kd_wet: [f32; 3],
    ks_wet: f32,
    a: [f32; 3],
    water: f32,
    g: f32,
    nb: f32,
    tau: f32,
    /// WGSL rounds the size up to a multiple of 16 bytes.
    padding: u32,
}

/// Draws the same inputs on every machine.
struct Inputs(Random);

impl Inputs {
    /// Uniform in `[low, high)`.
    fn within(&mut self, low: f32, high: f32) -> f32 {
        let unit = (self.0.bits() >> 40) as f32 / (1u64 << 24) as f32;
        low + (high - low) * unit
    }

    /// One of `edges` in a quarter of the calls, otherwise uniform in `[low, high)`.
    fn pick(&mut self, low: f32, high: f32, edges: &[f32]) -> f32 {
        if self.0.bits() >> 62 == 0 { edges[self.0.below(edges.len())] } else { self.within(low, high) }
    }

    /// A colour coefficient: exactly 0, or large enough for single precision to resolve what a bounce keeps.
    fn coefficient(&mut self) -> f32 {
        self.pick(1e-3, 1.0, &[0.0, 0.5, 1.0])
    }

    fn input(&mut self) -> GpuInput {
        let cosine_edges = [0.0, 1.0, -0.5, 1.5];
        let angle_edges = [0.0, FRAC_PI_2, -0.5, 3.0];
        GpuInput {
            kd: [self.coefficient(), self.coefficient(), self.coefficient()],
            ks: self.coefficient(),
            alpha_poro: self.pick(0.0, 1.0, &[0.0, 1.0]),
            s_p: self.pick(1e-3, 1.0, &[0.0, 1e-6, 1e-3, 1.0]),
            m: self.pick(1e-3, 1.0, &[0.0, 1.0]),
            k_w: self.pick(0.0, 1.0, &[0.0, 1.0]),
            n_dot_s: self.pick(0.0, 1.0, &cosine_edges),
            n_dot_v: self.pick(0.0, 1.0, &cosine_edges),
            theta_i: self.pick(0.0, FRAC_PI_2, &angle_edges),
            theta_r: self.pick(0.0, FRAC_PI_2, &angle_edges),
            tau: self.pick(0.0, 1.0, &[0.0, 1.0]),
            t: self.pick(0.0, 1.0, &[0.0, 0.25, 1.0]),
            t_start: self.pick(0.0, 1.0, &[0.0, 0.25, 1.0]),
            t_fill: self.pick(0.01, 0.5, &[0.0, -1.0]),
            sqrt_k: (self.0.bits() >> 63) as u32,
            padding: [0; 3],
        }
    }
}

/// Every output of the shader with its name, and what the twin says it should be.
fn compare(input: &GpuInput, output: &GpuOutput) -> Vec<(&'static str, f32, f64)> {
    let params = PorousParams {
        alpha_poro: input.alpha_poro.into(),
        s_p: input.s_p.into(),
        m: input.m.into(),
        k_w: input.k_w.into(),
        sqrt_k: input.sqrt_k != 0,
    };
    let [red, green, blue] = input.kd.map(|kd| {
        hnat_terms(
            params,
            input.ks.into(),
            kd.into(),
            input.n_dot_s.into(),
            input.n_dot_v.into(),
            input.theta_i.into(),
            input.theta_r.into(),
            input.tau.into(),
        )
    });
    vec![
        ("kd_dry red", output.kd_dry[0], red.kd_dry),
        ("kd_dry green", output.kd_dry[1], green.kd_dry),
        ("kd_dry blue", output.kd_dry[2], blue.kd_dry),
        ("kd_wet red", output.kd_wet[0], red.kd_wet),
        ("kd_wet green", output.kd_wet[1], green.kd_wet),
        ("kd_wet blue", output.kd_wet[2], blue.kd_wet),
        ("a red", output.a[0], red.a),
        ("a green", output.a[1], green.a),
        ("a blue", output.a[2], blue.a),
        ("ks_dry", output.ks_dry, red.ks_dry),
        ("ks_wet", output.ks_wet, red.ks_wet),
        ("water", output.water, red.water),
        ("g", output.g, red.g),
        ("nb", output.nb, red.nb),
        ("tau", output.tau, wet_tau(input.t.into(), input.t_start.into(), input.t_fill.into())),
    ]
}

#[test]
fn shader_matches_its_twin() {
    const TOLERANCE: f64 = 2e-3;
    let Some(gpu) = harness::gpu() else { return };
    let mut random = Inputs(Random(2006));
    let inputs: Vec<GpuInput> = (0..10_000).map(|_| random.input()).collect();
    let module = harness::compose(&[SOURCE], ENTRY);
    let outputs: Vec<GpuOutput> = harness::run_compute(&gpu, module, &inputs, WORKGROUP_SIZE);
    assert_eq!(outputs.len(), inputs.len());
    for (input, output) in inputs.iter().zip(&outputs) {
        for (name, actual, expected) in compare(input, output) {
            let error = (f64::from(actual) - expected).abs();
            // Absolute below 1, relative above. A NaN fails as well.
            let close = error <= TOLERANCE * expected.abs().max(1.0);
            assert!(close, "{name}: shader {actual}, twin {expected}, for {input:?}");
        }
    }
}
