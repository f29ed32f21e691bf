#define_import_path bevy_weathering::authored

// Wet as somebody painted it. The function has a double-precision twin of the same name in
// `material::models::authored`, where the story is told. No units.

// Parameters between their dry and their wet values; w: wetness in [0, 1].
fn authored(dry: vec3<f32>, wet: vec3<f32>, w: f32) -> vec3<f32> {
    return mix(dry, wet, w);
}
