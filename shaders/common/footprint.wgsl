#define_import_path bevy_weathering::footprint

// Which texels of a map without mip maps a pixel reads. The double-precision twin of the same name is in
// `material::footprint`, where the story is told. Lengths in texels. Pure: no bindings.

// Two texels along an axis, and the weight of the latter, 0..=1; the former has the rest.
struct Taps {
    low: i32,
    high: i32,
    part: f32,
}

// floor(p -+ s/2) with s = max(1, f/2); the weight goes from fract(p - 1/2) to 1/2 as f goes from 1 to 2. middle: p, of the
// pixel; covered: f, along the axis, 0 or more.
fn axis_taps(middle: f32, covered: f32) -> Taps {
    let away = 0.5 * max(1.0, 0.5 * covered);
    let part = mix(fract(middle - 0.5), 0.5, saturate(covered - 1.0));
    return Taps(i32(floor(middle - away)), i32(floor(middle + away)), part);
}
