//! A jet that strikes: it pushes the film aside, and its wall jet takes along outwards what it has lifted.
//!
//! **Film.** Under a hose water stands millimetres deep, which would shelter the ground from drops. A jet presses through: where
//! its momentum, `rho q v` on an area, is more than the weight of the film, `rho g h`, it has pushed the film aside
//! ([`cleared_mm`]). So what it lifts and loosens goes by its energy, as with drops (`wash`), but by the film that is left.
//!
//! **Wall jet.** From where it struck the water runs outwards along the wall, at first as fast as it came, in a thin layer that
//! drags at the ground by [`wall_shear`]. In a tick it comes farther than a stamp reaches: grains that float under the stamp are
//! at its rim then. A jet that strikes aslant runs forwards for the most part, by the cosine of its angle to the wall (Taylor
//! 1960), and so do the grains. They go no farther than there is water, and over the mesh as its water does.
//!
//! Not here: the film's own momentum, so that water gets out of the way by its weight alone; what is beyond the hydraulic jump.
//!
//! - Watson 1964, *The radial spread of a liquid jet over a horizontal plane*.
//! - Glauert 1956, *The wall jet*: the same in air or under water, which is slowed down by what is around it.
//! - Taylor 1960, *Formation of thin flat sheets of water*.

use super::SurfaceMatter;
use super::wash::bind_dried;
use crate::overlay::{Splat, Wrap};
use crate::wetting::{Drop, Now, Side, SurfaceWater, texel_under};

/// Shear that moves grains of silt which lie loose, Pa (Shields' curve for 50 µm of quartz: 0.1).
pub const CRITICAL_SHEAR_PA: f64 = 0.1;

/// Gravity, m/s².
const GRAVITY: f64 = 9.81;

/// Density of water, kg/m³, and its viscosity, m²/s.
const DENSITY: f64 = 998.0;
const VISCOSITY: f64 = 1.0e-6;

/// Where grains come to rest, in parts of the stamp's half axes: beyond that hardly any of its water lies.
const RIM: f64 = 0.75;

/// How deep a film a jet pushes aside where it strikes, mm: `h = q v / g`. `mm_per_s`, q: water that comes to a place, 0 or more;
/// `speed`, v: at which it comes, m/s. For water that strikes steeply; of what comes aslant all of its momentum counts, too.
pub fn cleared_mm(mm_per_s: f64, speed: f64) -> f64 {
    mm_per_s * speed / GRAVITY
}

/// Drag of a wall jet on the ground, Pa: `0.332 sqrt(3) rho v^2 / sqrt(v r / nu)`, of a laminar layer that grows outwards from the
/// middle of the jet, under water that is as fast as it came (Watson 1964; Blasius' layer, thinner by sqrt(3) as it spreads).
/// `speed`, v: m/s; `radius`, r: metres from the middle, above 0. From a jet's width to 0.32 a (Q / (nu a))^(1/3), with its
/// radius a and its flow Q: 3 to 41 mm of 15 l/min through 6 mm. Farther out the water is slower, and this is too much.
pub fn wall_shear(speed: f64, radius: f64) -> f64 {
    let reynolds = speed * radius / VISCOSITY;
    if reynolds > 0.0 { 0.332 * 3.0f64.sqrt() * DENSITY * speed * speed / reynolds.sqrt() } else { 0.0 }
}

/// Takes grains that float under the stamp of a jet to its rim. After the tick's water has come.
pub(crate) fn sweep(water: &mut SurfaceWater, matter: &mut SurfaceMatter, now: &Now, drop: &Drop) {
    let Some(forwards) = drop.jet else { return };
    if matter.stirred().is_empty() {
        return;
    }
    let size = water.size;
    let under = texel_under(drop.center, size);
    let home = now.geometry.stand_in(under).unwrap_or(under);
    let sides = [Side::PlusU, Side::PlusV].map(|side| f64::from(now.geometry.distance(home, side)));
    let radius = drop.radius.map(|radius| f64::from(radius.max(1)));
    let farthest = RIM * (radius[0] * sides[0]).max(radius[1] * sides[1]) / 256.0;
    if wall_shear(f64::from(drop.speed_mm) * 1.0e-3, farthest) < CRITICAL_SHEAR_PA {
        return;
    }
    let ground = Ground::new(water, now, drop, forwards, home);
    let stamp = Splat { center: drop.center, radius: drop.radius, ..bytemuck::Zeroable::zeroed() };
    let (columns, rows) = (stamp.span(0), stamp.span(1));
    for row in rows.0..=rows.1 {
        for column in columns.0..=columns.1 {
            let Some(from) = ground.texel(now, [column, row]) else { continue };
            let afloat = matter.stirred_on(from);
            if afloat == 0 {
                continue;
            }
            // From the middle, in parts of the half axes.
            let off = [(column, 0), (row, 1)].map(|(cell, axis): (i32, usize)| {
                f64::from(cell * 256 + 128 - drop.center[axis]) / radius[axis]
            });
            let distance = (off[0] * off[0] + off[1] * off[1]).sqrt();
            if distance >= RIM {
                continue;
            }
            let outwards = if distance > 0.0 { off.map(|part| part / distance * RIM) } else { [0.0; 2] };
            // As far as there is water.
            for part in [1.0, 0.5, 0.0] {
                let landing = [0, 1].map(|axis: usize| {
                    let way = outwards[axis] * radius[axis] + part * f64::from(forwards[axis]);
                    (drop.center[axis] + way.round() as i32) >> 8
                });
                let Some(to) = ground.texel(now, landing).filter(|&to| to != from) else { continue };
                water.settle(now, to);
                bind_dried(water, matter);
                if water.texels[to as usize].film == 0 {
                    continue;
                }
                matter.move_dust(from, to, u64::from(afloat), u64::from(afloat));
                for texel in [from, to] {
                    let tile = water.tile_of(texel);
                    water.tiles.touch(tile);
                }
                break;
            }
        }
    }
}

/// The texels that a jet's stamp and what it sweeps lie on.
struct Ground {
    size: u32,
    wrap: [Wrap; 2],
    home: u32,
    /// The island to keep to, if others lie near.
    island: Option<u32>,
}

impl Ground {
    fn new(water: &SurfaceWater, now: &Now, drop: &Drop, forwards: [i32; 2], home: u32) -> Self {
        let reach = |axis: usize| {
            let (center, radius, way) = (drop.center[axis], drop.radius[axis], forwards[axis]);
            ((center - radius + way.min(0)) >> 8, (center + radius + way.max(0)) >> 8)
        };
        let under = texel_under(drop.center, water.size);
        let island = now.geometry.island_to_keep_to(under, reach(0), reach(1));
        Self { size: water.size, wrap: water.wrap, home, island }
    }

    /// The texel that stands for a column and row of the image.
    fn texel(&self, now: &Now, cell: [i32; 2]) -> Option<u32> {
        let count = self.size as i32;
        let [x, y] = [0, 1].map(|axis: usize| match self.wrap[axis] {
            Wrap::Repeat => cell[axis].rem_euclid(count) as u32,
            Wrap::Clamp => cell[axis].clamp(0, count - 1) as u32,
        });
        let over = y * self.size + x;
        match self.island {
            None => now.geometry.stand_in(over),
            Some(island) => Some(now.geometry.on_island(island, over, self.home)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::MatterKind;
    use super::super::test_world::{Ground as World, Place, assert_balanced};
    use super::*;
    use crate::emitter::Source;

    /// A slug of a hose in the middle of 64 x 64 texels of 5 mm.
    fn slug(forwards: [i32; 2]) -> Drop {
        Drop {
            center: [32 * 256 + 128; 2],
            radius: [8 * 256; 2],
            water_nl: 278_000,
            speed_mm: 8800,
            jet: Some(forwards),
            source: Source::UNKNOWN,
        }
    }

    /// A floor under a film, with so much dust on each texel.
    fn dusty(place: &Place, film_mm: f32, units: u64) -> World {
        let mut world = World::new(place);
        world.water.cover(&place.geometry, film_mm, 0.0, 1);
        for texel in 0..place.texels() {
            world.matter.receive(texel, MatterKind::Dust, units);
        }
        world
    }

    /// Grains on texels that are so far from the middle, in texels.
    fn grains(world: &World, near: std::ops::Range<f32>) -> u64 {
        let distance = |texel: u32| {
            let [x, y] = [texel % 64, texel / 64].map(|at| at as f32 - 32.0);
            x.hypot(y)
        };
        let texels = (0u32..).zip(world.matter.texels());
        texels.filter(|&(texel, _)| near.contains(&distance(texel))).map(|(_, texel)| texel.soil()).sum()
    }

    #[test]
    fn a_hose_presses_through_its_own_water_and_drags_less_farther_out() {
        // 12 mm/s at 8.8 m/s carry 10.8 mm of water.
        assert!((cleared_mm(12.0, 8.8) - 10.76).abs() < 0.01);
        assert!(cleared_mm(10.0 / 3600.0, 6.5) < 0.002);
        // By hand: 0.575 x 998 x 77.44 / sqrt(264,000).
        assert!((wall_shear(8.8, 0.03) - 86.5).abs() < 0.2, "{}", wall_shear(8.8, 0.03));
        assert!((wall_shear(8.8, 0.01) / wall_shear(8.8, 0.04) - 2.0).abs() < 1e-9);
        assert!(wall_shear(0.05, 0.03) < CRITICAL_SHEAR_PA);
        assert_eq!([wall_shear(0.0, 0.03), wall_shear(f64::NAN, 0.03)], [0.0, 0.0]);
    }

    #[test]
    fn a_jet_lifts_by_its_energy_what_drops_do_not_under_so_deep_a_film() {
        let place = Place::flat(64, 0.005);
        // All of it is cleared away in the middle, and drops lift exp(-6) of it.
        let lifted = |jet: Option<[i32; 2]>| {
            let mut world = dusty(&place, 3.0, 1_000_000);
            world.pour(&place, 2, Drop { jet, ..slug([0; 2]) });
            assert_balanced(&world.matter);
            world.matter.stirred().iter().map(|&units| f64::from(units)).sum::<f64>()
        };
        let (jet, drops) = (lifted(Some([0; 2])), lifted(None));
        // 278 mg at 8.8 m/s have 10.8 mJ; 4 g/J of that are 43 mg, or 16.2 mm³.
        let energy = dusty(&place, 3.0, 0).water.units().from_nl(1000) as f64 * 16.2;
        assert!((0.5..1.01).contains(&(jet / energy)), "{jet} of {energy}");
        assert!(drops < 0.01 * energy && drops > 0.0, "{drops} of {energy}");
    }

    #[test]
    fn what_a_jet_lifts_is_at_the_rim_and_of_one_aslant_in_front_of_it() {
        let place = Place::flat(64, 0.005);
        let mut world = dusty(&place, 0.5, 20_000);
        let all = world.matter.stock().dust;
        let (inside, rim) = (grains(&world, 0.0..4.0), grains(&world, 5.0..8.0));
        for tick in 2..12 {
            world.pour(&place, tick, slug([0; 2]));
            assert_balanced(&world.matter);
        }
        assert!(grains(&world, 0.0..4.0) < inside / 10, "{} of {inside}", grains(&world, 0.0..4.0));
        assert!(grains(&world, 5.0..8.0) > rim, "{} of {rim}", grains(&world, 5.0..8.0));
        assert_eq!(world.matter.stock().dust, all);
        // Forwards is along u.
        let mut world = dusty(&place, 0.5, 20_000);
        (2..12).for_each(|tick| world.pour(&place, tick, slug([8 * 256, 0])));
        let half = |world: &World, ahead: bool| {
            let texels = (0u32..).zip(world.matter.texels());
            texels.filter(|(texel, _)| (texel % 64 > 32) == ahead).map(|(_, texel)| texel.soil()).sum::<u64>()
        };
        let untouched = dusty(&place, 0.5, 20_000);
        assert!(half(&world, true) > half(&untouched, true));
        assert!(half(&world, false) < half(&untouched, false));
        assert_eq!(world.matter.stock().dust, all);
        assert_balanced(&world.matter);
    }

    #[test]
    fn grains_stay_where_no_water_goes_and_where_none_float() {
        let place = Place::flat(64, 0.005);
        let mut world = dusty(&place, 0.0, 20_000);
        let before = world.matter.texels().to_vec();
        sweep(&mut world.water, &mut world.matter, &place.now(2), &slug([0; 2]));
        assert_eq!(world.matter.texels(), before);
        world.matter.stir(32 * 64 + 34, 5000);
        sweep(&mut world.water, &mut world.matter, &place.now(2), &slug([0; 2]));
        assert_eq!(world.matter.texels(), before);
        // A trickle has not the strength for it.
        let mut world = dusty(&place, 0.5, 20_000);
        world.matter.stir(32 * 64 + 34, 5000);
        let trickle = Drop { speed_mm: 50, ..slug([0; 2]) };
        sweep(&mut world.water, &mut world.matter, &place.now(2), &trickle);
        assert_eq!(world.matter.texels(), before);
        sweep(&mut world.water, &mut world.matter, &place.now(2), &slug([0; 2]));
        assert_eq!(world.matter.texels()[32 * 64 + 34].dust, 15_000);
        assert_balanced(&world.matter);
    }
}
