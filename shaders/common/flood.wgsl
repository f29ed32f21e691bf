#define_import_path bevy_weathering::flood

// Where water stands. Each function has a double-precision twin of the same name in `material::film::flood`, where
// the story is told. Depths in mm, the rest in [0, 1].
//
// Lagarde 2013, "Water drop 2b: dynamic rain and its effects".

// Range of the painted channel over which a rising level soaks in from the rim to the middle.
const PAINT_SOFTNESS: f32 = 0.4;

// Accumulated water by the painter's law, max(min(cracks, 1 - height), saturate((puddles - paint) / 0.4)).
// cracks, puddles: flood levels; height: of the relief, 1 is on top; paint: 1 never floods.
fn accumulated(cracks: f32, puddles: f32, height: f32, paint: f32) -> f32 {
    return max(min(cracks, 1.0 - height), saturate((puddles - paint) / PAINT_SOFTNESS));
}

// Depth of the water by the physical law, max(0, level - (paint basin + height relief)).
// level_mm: above the lowest point there can be; basin_mm, relief_mm: what paint and height in [0, 1] span.
fn flood_depth(level_mm: f32, basin_mm: f32, relief_mm: f32, height: f32, paint: f32) -> f32 {
    return max(level_mm - (paint * basin_mm + height * relief_mm), 0.0);
}

// How much of each look a point has: dry, wet, drenched, puddle; their sum is 1. wetness of the matter, coverage and
// levelness of the film.
fn region_weights(wetness: f32, coverage: f32, levelness: f32) -> vec4<f32> {
    let puddle = coverage * levelness;
    let bare = 1.0 - coverage;
    return vec4(bare * (1.0 - wetness), bare * wetness, coverage - puddle, puddle);
}
