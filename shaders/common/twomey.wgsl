#define_import_path bevy_weathering::twomey

// Wet by water between grains. The function has a double-precision twin of the same name in
// `material::models::twomey`, where the story is told. No units.
//
// Twomey, Bohren, Mergenthaler 1986, "Reflectance and albedo differences between wet and dry surfaces".

// Albedo with water between the grains: s = (1 - r) / (1 + r), s_w = s / sqrt(b + s^2 (1 - b)), (1 - s_w) / (1 + s_w).
// albedo: dry, in [0, 1]; backscatter: b, in (0, 1], 1 changes nothing.
fn wet_albedo(albedo: vec3<f32>, backscatter: f32) -> vec3<f32> {
    let r = saturate(albedo);
    let s = (1.0 - r) / (1.0 + r);
    let wet = s / sqrt(backscatter + s * s * (1.0 - backscatter));
    return (1.0 - wet) / (1.0 + wet);
}
