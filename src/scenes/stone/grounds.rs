//! The recipes for what one walks on and for what one wears: beach sand, asphalt and linen.
//!
//! Sand is heaped: wide swells, ripples, then grains. Asphalt is sieved: chippings of three sizes compete for
//! every place and the highest shows, the bitumen keeps to the gaps and to what the wheels have not reached.
//! Linen is counted: warp and weft are numbered threads, and of the two that cross the upper one shows.

use std::f32::consts::{PI, TAU};

use bevy::math::{IVec2, Vec2, Vec3};

use super::kinds::Texel;
use super::noise::{Cells, Layers, Noise, hash, smoothstep, unit};

/// Ripples per tile of sand.
const RIPPLES: f32 = 7.0;

pub(super) fn sand(layers: Layers) -> impl Fn(Vec2) -> Texel {
    let wander = layers.noise(1, Vec2::new(3.0, 3.0), 3);
    let strength = layers.noise(2, Vec2::new(2.5, 4.0), 2);
    let swell = layers.noise(3, Vec2::new(1.5, 1.5), 2);
    let mottle = layers.noise(4, Vec2::new(5.0, 5.0), 4);
    let clouds = layers.noise(5, Vec2::new(2.0, 3.0), 4);
    let rough = layers.noise(6, Vec2::new(60.0, 60.0), 3);
    let (grains, coarse_grains) = (layers.cells(7, 420.0), layers.cells(8, 210.0));
    let shells = layers.cells(9, 70.0);
    move |uv| {
        let (wander, mottle, clouds) = (wander.at(uv), mottle.at(uv), clouds.at(uv));
        let ragged = Vec2::new(rough.at(uv), rough.at(uv + 0.5));
        // Grains drift with the ripples, so that their cells do not line up with the edges of the tile.
        let drift = uv + 0.02 * wander;
        let grain = grains.nearest(drift);
        let coarse = coarse_grains.nearest(drift);
        let shell = smoothstep(0.0, 0.4, shells.spot(drift + 0.002 * ragged, 0.14, 0.05, 0.22));

        // Long to windward, short to leeward; half a ripple on, for the tile to end on the gentle side.
        let phase = TAU * (RIPPLES * uv.y + 0.5 + 0.45 * wander + 0.03 * mottle);
        let ripple = (phase + 0.5 * phase.sin()).sin() * (1.0 + 0.6 * strength.at(uv)).clamp(0.5, 1.3);
        // The wind leaves the larger grains behind, more of them in the troughs.
        let left = smoothstep(-0.2, 0.7, 1.2 * coarse.chance(4) - 0.6 - 0.35 * ripple + 0.5 * mottle);

        let tint = |kind: f32, shade: f32| match kind {
            dark if dark < 0.025 => Vec3::new(0.38, 0.33, 0.30),
            ochre if ochre < 0.33 => Vec3::new(1.08, 0.90, 0.66) * (0.80 + 0.30 * shade),
            quartz if quartz < 0.60 => Vec3::new(1.22, 1.26, 1.36) * (0.90 + 0.25 * shade),
            bright if bright < 0.63 => Vec3::new(1.42, 1.55, 1.85),
            _ => Vec3::splat(0.72 + 0.45 * shade),
        };
        let mut albedo = Vec3::new(0.48, 0.39, 0.27);
        albedo *= 1.0 + 0.10 * mottle + 0.10 * clouds + 0.05 * ripple;
        albedo *= tint(grain.chance(1), grain.chance(2));
        albedo *= Vec3::ONE.lerp(tint(coarse.chance(1), coarse.chance(2)), 0.45 * left);
        albedo = albedo.lerp(Vec3::new(0.78, 0.70, 0.60), 0.8 * shell);

        // Grains keep their height where they are drawn larger: they must not bury the ripples.
        let height_mm = 1.5 * ripple
            + 0.9 * swell.at(uv)
            + 0.35 * clouds
            + 0.16 * mottle
            + 0.14 * ragged.x
            + 0.30 * grain.dome() * (0.5 + grain.chance(3))
            + 0.30 * coarse.dome() * left * (0.5 + coarse.chance(3))
            + 0.35 * shell;
        let glint = if (0.33..0.60).contains(&grain.chance(1)) { 0.05 } else { 0.0 };
        Texel { albedo, height_mm, roughness: 0.93 - glint + 0.03 * mottle - 0.06 * shell }
    }
}

/// Chippings of one size: a place is taken by one of them or by none.
struct Sieve {
    cells: Cells,
    /// How many of its cells hold a chipping.
    share: f32,
    /// How far the lowest and the highest of them rise above the bottom of the gaps.
    least_mm: f32,
    most_mm: f32,
}

/// What a chipping shows at a place.
struct Chipping {
    height_mm: f32,
    albedo: Vec3,
    /// How much of the bitumen is gone from it, `0..=1`.
    bare: f32,
}

impl Sieve {
    /// The chipping at a place; where there is none its height is 0. `wear` shifts how many are bare.
    fn chipping(&self, uv: Vec2, wear: f32) -> Chipping {
        let grain = self.cells.nearest(uv);
        let shoulder = smoothstep(0.02, 0.42, grain.inside());
        let rise = self.least_mm + (self.most_mm - self.least_mm) * grain.chance(2);
        let rock = match grain.chance(3) {
            brown if brown < 0.22 => Vec3::new(0.225, 0.198, 0.170),
            blue if blue < 0.45 => Vec3::new(0.172, 0.186, 0.198),
            pale if pale < 0.49 => Vec3::new(0.320, 0.310, 0.290),
            _ => Vec3::new(0.195, 0.193, 0.190),
        };
        Chipping {
            height_mm: if grain.chance(1) < self.share { rise * shoulder } else { 0.0 },
            albedo: rock * (0.65 + 0.70 * grain.chance(4)),
            bare: smoothstep(0.45, 0.95, shoulder) * smoothstep(-0.15, 0.45, grain.chance(5) + wear),
        }
    }
}

pub(super) fn asphalt(layers: Layers) -> impl Fn(Vec2) -> Texel {
    let patches = layers.noise(1, Vec2::new(2.0, 2.5), 4);
    let film = layers.noise(2, Vec2::new(11.0, 11.0), 3);
    let ragged = layers.noise(3, Vec2::new(90.0, 90.0), 2);
    let skin = layers.noise(4, Vec2::new(170.0, 170.0), 3);
    let bend = layers.noise(5, Vec2::new(9.0, 9.0), 4);
    // Pitches of 11, 7 and 3.5 mm.
    let sieves = [(6, 56.0, 0.50, 1.7, 2.5), (7, 88.0, 0.80, 1.1, 2.1), (8, 170.0, 0.95, 0.4, 1.3)].map(
        |(layer, per_side, share, least_mm, most_mm)| Sieve {
            cells: layers.cells(layer, per_side),
            share,
            least_mm,
            most_mm,
        },
    );
    // Cracks run between blocks, where the ground gives way and no further.
    let blocks = layers.cells(9, 3.0);
    let loose = layers.noise(10, Vec2::new(3.0, 3.0), 2);
    // A hair, or what the texels can show of one.
    let texel_mm = layers.tile_mm / (3.0 * layers.finest);
    let crack_mm = (0.5 * texel_mm).max(0.7);
    move |uv| {
        let (patch, film, skin) = (patches.at(uv), film.at(uv), skin.at(uv));
        let edge = uv + 0.02 * patch + 0.0016 * Vec2::new(ragged.at(uv), ragged.at(uv + 0.5));
        let block = blocks.nearest(uv + 0.02 * Vec2::new(bend.at(uv), bend.at(uv + 0.5)));
        let crack = smoothstep(crack_mm, 0.3 * crack_mm, blocks.border_mm(&block))
            * smoothstep(0.05, 0.30, loose.at(uv));

        let mut chipping = Chipping { height_mm: 0.0, albedo: Vec3::ZERO, bare: 0.0 };
        for sieve in &sieves {
            let other = sieve.chipping(edge, 0.4 * film + 0.4 * patch);
            if other.height_mm > chipping.height_mm {
                chipping = other;
            }
        }
        // Wheels rub the highest bare and pale.
        let worn = smoothstep(0.6, 1.9, chipping.height_mm);
        let bitumen = Vec3::new(0.058, 0.0575, 0.057) * (1.0 + 0.15 * film + 0.25 * skin + 0.20 * patch);
        let rock = chipping.albedo * (0.75 + 0.35 * worn + 0.12 * skin);
        let mut albedo = bitumen.lerp(rock, chipping.bare * (0.5 + 0.5 * worn));
        albedo *= (1.0 + 0.10 * patch) * (1.0 - 0.70 * crack);

        let height_mm = chipping.height_mm + 0.25 * patch + 0.14 * skin - 0.9 * crack;
        Texel { albedo, height_mm, roughness: 0.93 - 0.06 * chipping.bare * worn + 0.03 * film }
    }
}

/// Threads per tile of linen, either way, if the texels can show them.
const THREADS: f32 = 100.0;

/// How many threads are drawn: an even number, so that the weave goes on across the edge, and no more than
/// leave 4 texels to each. `finest` is that of [`Layers`], a cell for every 3 texels.
fn threads(finest: f32) -> usize {
    2 * ((THREADS.min(0.75 * finest) / 2.0) as usize).max(1)
}

/// What sets one thread apart from the others.
struct Thread {
    tone: Vec3,
    /// Which part of the noise its slubs come from.
    cut: f32,
    /// How readily it was spun thick, `0..1`.
    slubby: f32,
    /// Where its twist begins, in turns.
    turn: f32,
}

/// All threads that run one way: the warp along v, the weft along u.
struct Threads {
    threads: Vec<Thread>,
    slubs: Noise,
    fibres: Noise,
}

/// What a thread shows at a place.
struct Strand {
    /// Above the bottom of the gaps, 0 beside the thread.
    height_mm: f32,
    albedo: Vec3,
}

impl Threads {
    /// Takes up `layer` and the one after it.
    fn new(layers: Layers, layer: u32) -> Self {
        let count = threads(layers.finest);
        let thread = |number: usize| {
            let random = |which| unit(hash([layers.seed, number as u32, 64 + 8 * layer + which]));
            let warmth = random(0) - 0.5;
            let tint = Vec3::new(1.0, 1.0 - 0.03 * warmth, 1.0 - 0.12 * warmth);
            Thread {
                tone: Vec3::new(0.66, 0.62, 0.535) * tint * (0.90 + 0.20 * random(1)),
                cut: random(2),
                slubby: random(3),
                turn: random(4),
            }
        };
        Self {
            threads: (0..count).map(thread).collect(),
            slubs: layers.noise(layer, Vec2::new(60.0, 9.0), 2),
            fibres: layers.noise(layer + 1, Vec2::new(3.0, 0.7) * count as f32, 2),
        }
    }

    /// One thread. x is across the threads and y along them: `at` in tiles, `off` from the middle of the
    /// crossing in threads, -0.5 to 0.5. `lies` is 1 where it goes over the other and -1 where under.
    fn strand(&self, number: usize, at: Vec2, off: Vec2, lies: f32) -> Strand {
        let thread = &self.threads[number];
        let slub = self.slubs.at(Vec2::new(thread.cut, at.y));
        let fibre = self.fibres.at(at);
        let thick = smoothstep(0.1, 0.5, slub + 0.6 * thread.slubby - 0.35);
        // Half a thread is as far as it may reach: beyond begins the next.
        let half = (0.43 + 0.05 * slub + 0.06 * thick).clamp(0.34, 0.5);
        let section = (1.0 - (off.x / half).powi(2)).max(0.0);
        let twist = (TAU * (0.9 * off.x + at.y * self.threads.len() as f32 + thread.turn)).cos();
        let crimp = 1.0 + 0.85 * lies * (PI * off.y).cos();
        Strand {
            height_mm: section * (0.36 * half * crimp + 0.020 * fibre + 0.008 * twist),
            albedo: thread.tone * (1.0 + 0.16 * fibre + 0.04 * twist + 0.12 * slub),
        }
    }
}

pub(super) fn linen(layers: Layers) -> impl Fn(Vec2) -> Texel {
    let count = threads(layers.finest);
    let wander = layers.noise(1, Vec2::new(5.0, 5.0), 3);
    let clouds = layers.noise(2, Vec2::new(2.5, 2.5), 3);
    let (warp, weft) = (Threads::new(layers, 3), Threads::new(layers, 5));
    move |uv| {
        let clouds = clouds.at(uv);
        let bent = uv + 0.32 / count as f32 * Vec2::new(wander.at(uv), wander.at(uv + 0.5));
        // The edges of the tile run through the middle of a thread.
        let place = bent * count as f32 + 0.5;
        let off = place - place.floor() - 0.5;
        let IVec2 { x: column, y: row } = place.floor().as_ivec2().rem_euclid(IVec2::splat(count as i32));
        let lies = if (column + row) % 2 == 0 { 1.0 } else { -1.0 };
        let warp = warp.strand(column as usize, bent, off, lies);
        let weft = weft.strand(row as usize, Vec2::new(bent.y, bent.x), Vec2::new(off.y, off.x), -lies);
        let upper = if warp.height_mm > weft.height_mm { warp } else { weft };

        // The gaps are too narrow for the occlusion to find.
        let light = 0.45 + 0.55 * smoothstep(0.0, 0.17, upper.height_mm);
        Texel {
            albedo: upper.albedo * light * (1.0 + 0.05 * clouds),
            height_mm: upper.height_mm.max(0.0),
            roughness: 0.90 + 0.03 * clouds,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYERS: Layers = Layers { seed: 5, finest: 300.0, tile_mm: 400.0 };

    fn places() -> impl Iterator<Item = Vec2> {
        (0..6400).map(|i| (Vec2::new((i % 80) as f32, (i / 80) as f32) + 0.37) / 80.0)
    }

    #[test]
    fn ripples_run_along_u() {
        let sand = sand(LAYERS);
        let change = |step: Vec2| -> f32 {
            places().map(|uv| (sand(uv + step).height_mm - sand(uv).height_mm).powi(2)).sum()
        };
        let half = 0.5 / RIPPLES;
        let (along, across) = (change(Vec2::new(half, 0.0)), change(Vec2::new(0.0, half)));
        assert!(across > 2.0 * along, "{across} and {along}");
    }

    #[test]
    fn chippings_stand_pale_above_the_bitumen() {
        let asphalt = asphalt(Layers { tile_mm: 600.0, ..LAYERS });
        // Mean albedo of the places where the relief is within the bounds.
        let mean = |least: f32, most: f32| {
            let here: Vec<Texel> =
                places().map(&asphalt).filter(|texel| (least..most).contains(&texel.height_mm)).collect();
            here.iter().map(|texel| texel.albedo).sum::<Vec3>() / here.len() as f32
        };
        let (gaps, tops) = (mean(-2.0, 0.4), mean(1.7, 4.0));
        assert!(gaps.max_element() < 0.09 && tops.min_element() > 0.11, "{gaps} and {tops}");
    }

    #[test]
    fn threads_are_wide_enough_to_see() {
        for size in [16_u32, 100, 256, 401, 1024, 4096] {
            let count = threads(size as f32 / 3.0);
            assert!(count.is_multiple_of(2) && (2..=100).contains(&count), "{size}: {count}");
            assert!(4 * count <= size as usize, "{size}: {count}");
        }
        assert_eq!(threads(1024.0 / 3.0), 100);
    }

    #[test]
    fn threads_go_over_and_under_and_end_before_the_next() {
        let weft = Threads::new(LAYERS, 5);
        for number in 0..threads(LAYERS.finest) {
            for i in 0..50 {
                let at = Vec2::new(number as f32 / THREADS, i as f32 / 50.0);
                let height =
                    |across: f32, lies: f32| weft.strand(number, at, Vec2::new(across, 0.0), lies).height_mm;
                assert!(height(0.0, 1.0) > height(0.0, -1.0) + 0.15, "{number} {i}");
                assert!(height(0.5, 1.0) == 0.0 && height(-0.5, 1.0) == 0.0, "{number} {i}");
            }
        }
    }
}
