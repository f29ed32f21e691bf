#define_import_path bevy_weathering::held_water

// From what a texel holds to what can be seen of it. The function has a double-precision twin of the same name in
// `material::film::held`, where the story is told.

#import bevy_weathering::hnat::wet_tau

// How wet a texel looks that holds so many nanolitres, in [0, 1], and the film on it in mm.
// seconds: since the first of it came; capacity_nl, capacity_mm: what the matter takes up, in both units, above 0;
// t_fill: seconds until it looks wet.
fn water_look(water_nl: u32, seconds: f32, capacity_nl: f32, capacity_mm: f32, t_fill: f32) -> vec2<f32> {
    if water_nl == 0u {
        return vec2(0.0);
    }
    let filled = f32(water_nl) / capacity_nl;
    return vec2(min(filled, 1.0) * wet_tau(seconds, 0.0, t_fill), max(filled - 1.0, 0.0) * capacity_mm);
}
