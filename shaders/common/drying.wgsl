// What becomes of the water in a texel, and how it looks: twins of `evolve` and `look` in `src/wetting/`, where the story
// is told.

#define_import_path bevy_weathering::drying

const CRITICAL_SATURATION: f32 = 0.3;
const SIGMOID_STEEPNESS: f32 = 10.0;
const GLOSS_LIFE: f32 = 0.2;

// Water in and on a texel, mm.
struct Amounts {
    film_mm: f32,
    pores_mm: f32,
    reserve_mm: f32,
}

// Pores that dry: first the reserve goes by, then they lose `E min(1, s/.3)`.
fn dry_pores(pores: f32, reserve: f32, capacity_mm: f32, demand_mm: f32) -> Amounts {
    let spared = min(reserve, demand_mm);
    let demand = demand_mm - spared;
    let critical = CRITICAL_SATURATION * capacity_mm;
    let even = clamp(pores - critical, 0.0, demand);
    let rest = select(0.0, exp(-(demand - even) / max(critical, 1e-20)), critical > 0.0);
    return Amounts(0.0, (pores - even) * rest, reserve - spared);
}

// The part of the time after which a film that does not last is gone.
fn film_part(film: f32, pores: f32, full: f32, squared: f32, seconds: f32, demand_mm: f32) -> f32 {
    let rate = demand_mm / max(seconds, 1e-9);
    let supply = film + pores;
    let room = full - pores;
    let b = 2.0 * supply * rate + squared;
    let c = film * (supply + pores);
    let root = sqrt(max(b * b - 4.0 * rate * rate * c, 0.0));
    let taking_up = 2.0 * c / max(b + root, 1e-30);
    let until_full = room * (full + pores) / max(squared, 1e-30);
    let after = (film - room) / max(rate, 1e-30);
    let when = select(after, taking_up, room > 0.0 && taking_up <= until_full);
    return clamp(when / max(seconds, 1e-9), 0.0, 1.0);
}

// The amounts `seconds` later, if the weather demands `demand_mm` during that time.
// squared: of the sorptivity, mm^2/s.
fn evolve(before: Amounts, squared: f32, capacity_mm: f32, seconds: f32, demand_mm: f32) -> Amounts {
    let film = before.film_mm;
    let pores = before.pores_mm;
    let full = max(capacity_mm, pores);
    var soaked = min(sqrt(pores * pores + squared * seconds), full);
    let left = film - (soaked - pores) - demand_mm;
    if left >= 0.0 {
        return Amounts(left, soaked, before.reserve_mm);
    }
    if film <= 0.0 {
        return dry_pores(pores, before.reserve_mm, capacity_mm, demand_mm);
    }
    let part = film_part(film, pores, full, squared, seconds, demand_mm);
    soaked = clamp(film + pores - demand_mm * part, pores, full);
    return dry_pores(soaked, before.reserve_mm, capacity_mm, demand_mm * (1.0 - part));
}

fn sigmoid(u: f32) -> f32 {
    return 1.0 / (1.0 + exp(-SIGMOID_STEEPNESS * (u - 0.5)));
}

// How dry it looks when the part `u` of its water is gone.
fn drying_sigmoid(u: f32) -> f32 {
    let least = sigmoid(0.0);
    return saturate((sigmoid(saturate(u)) - least) / (sigmoid(1.0) - least));
}

// How much of its gloss is left when the part `u` of its water is gone.
fn gloss_left(u: f32) -> f32 {
    let end = exp(-1.0 / GLOSS_LIFE);
    return (exp(-saturate(u) / GLOSS_LIFE) - end) / (1.0 - end);
}

// How absorbed water looks, wetness and gloss, and how much of a film is to be seen.
fn water_look(pores_mm: f32, visible_mm: f32, shown: vec2<f32>, seconds: f32, t_fill: f32) -> vec3<f32> {
    let gone = 1.0 - min(pores_mm / visible_mm, 1.0);
    let ramp = select(vec2(0.0), shown + seconds / max(t_fill, 1e-6), seconds >= 0.0);
    return min(vec3(1.0 - drying_sigmoid(gone), gloss_left(gone), 1.0), ramp.xxy);
}
