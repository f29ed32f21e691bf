#define_import_path bevy_weathering::ripples

// Ripples on standing water. Each function has a double-precision twin of the same name in `material::film::ripples`,
// where the story is told. Lengths in cells unless said otherwise, times in seconds.
//
// Lagarde 2013, "Water drop 2b: dynamic rain and its effects". Jarzynski and Olano 2020, "Hash functions for GPU
// rendering", for the hash.

const RIPPLES_TAU: f32 = 6.28318530717959;
// Seconds that a ring lives.
const RING_SECONDS: f32 = 0.5;
// Waves in half a ring's width.
const WAVES: f32 = 1.0;
// Steepest slope of a fresh ring.
const RING_SLOPE: f32 = 0.35;
// How far a ring gets, as a part of the side of a cell; with its width it stays inside its cell.
const RING_REACH: f32 = 0.2;
// Half the width of a ring, as a part of the side of a cell.
const RING_WIDTH: f32 = 0.08;
// Drops per second in a cell of each layer.
const LAYER_RATES: vec4<f32> = vec4(1.0, 0.85, 0.93, 1.13);
// Rain, in mm/h, at which all four layers are full.
const FULL_RAIN_MM_PER_H: f32 = 25.0;

// Slope away from the middle of a ring, at a distance, at an age of t times its life. reach and width (half of it) in
// the unit of the distance.
fn ring_slope(distance: f32, t: f32, reach: f32, width: f32) -> f32 {
    let phase = (distance - reach * t) / width;
    if t < 0.0 || t >= 1.0 || abs(phase) >= 1.0 {
        return 0.0;
    }
    let strength = 6.75 * t * (1.0 - t) * (1.0 - t);
    let window = 1.0 - phase * phase;
    return RING_SLOPE * strength * window * window * sin(RIPPLES_TAU * WAVES * phase);
}

// How much of each layer shows: one after the other as rain gets heavier.
fn layer_weights(rain_mm_per_h: f32) -> vec4<f32> {
    let intensity = saturate(rain_mm_per_h / FULL_RAIN_MM_PER_H);
    return saturate(4.0 * (intensity - vec4(0.0, 0.25, 0.5, 0.75)));
}

// 32 bits that look random.
fn pcg(x: u32) -> u32 {
    let state = x * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// Where in its cell the middle of a ring may be, from 16 random bits: the ring stays inside the cell.
fn ring_middle(bits: u32) -> f32 {
    let margin = RING_REACH + RING_WIDTH;
    return margin + (1.0 - 2.0 * margin) * f32(bits & 0xffffu) / 65536.0;
}

// Slopes along both axes of one layer of rain at a place.
fn layer_slopes(place: vec2<f32>, time: f32, layer: u32) -> vec2<f32> {
    let offset = 0.37 * f32(layer);
    let shifted = place + vec2(offset, -offset);
    let cell = floor(shifted);
    let seed = pcg(u32(i32(cell.x)) ^ pcg(u32(i32(cell.y)) ^ pcg(layer)));
    let beat = time * LAYER_RATES[layer] + f32(seed >> 16u) / 65536.0;
    let drop = pcg(seed ^ u32(i32(floor(beat))));
    let away = shifted - cell - vec2(ring_middle(drop), ring_middle(drop >> 16u));
    let distance = length(away);
    let seconds = fract(beat) / LAYER_RATES[layer];
    let slope = ring_slope(distance, seconds / RING_SECONDS, RING_REACH, RING_WIDTH);
    return away * select(slope / distance, 0.0, distance <= 0.0);
}

// Slopes along both axes of rain that is not simulated.
fn rain_slopes(place: vec2<f32>, time: f32, rain_mm_per_h: f32) -> vec2<f32> {
    let weights = layer_weights(rain_mm_per_h);
    var sum = vec2(0.0);
    for (var layer = 0u; layer < 4u; layer += 1u) {
        if weights[layer] > 0.0 {
            sum += weights[layer] * layer_slopes(place, time, layer);
        }
    }
    return sum;
}
