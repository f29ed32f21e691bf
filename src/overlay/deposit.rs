//! Impacts become splats on the surfaces they hit.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::frames::{FramesWork, SurfaceFrames, measure_frames, release_frames};
use super::site::Site;
use super::stamping::{Mark, deposit_stamp, patch_radius, splat_from_impact, unit_hash};
use super::{MapLoss, MapSize, MapSizeSystems, Splat, StampAtlas, StampSpace, TexelArea, Weatherable, pool};
use crate::clock::WeatheringClock;
use crate::collision::{DeformingCollider, Impact, Impacts, SurfaceCollider};
use crate::effect::drops::{drop_mm3, splashes};
use crate::effect::{Carries, EffectRow, EffectSystems, EffectTable, WeatherEffect};
use crate::emitter::{NewParticles, Source};
use crate::matter::wash::loosening_speed;
use crate::matter::{Deposit, MatterKind, MatterQueue, SurfaceMatter};
use crate::particle::{Lifespan, Particle, ParticleConfig, Particles};
use crate::schedule::{WeatheringSystems, WeatheringTick};
use crate::wetting::{Drop, DropQueue, MeasureSystems, SurfaceWater};

/// Splats of a surface that nobody has painted yet, in the order of their impacts: of all that leave a mark or bring water. A frame
/// may hold any number of ticks: each adds its own; the painter empties it.
#[derive(Component, Debug, Default)]
pub struct SplatQueue {
    splats: Vec<Splat>,
    /// What has ever been pushed.
    traces: SurfaceTraces,
}

/// What has ever come to a surface. What has not come need not be looked for when it is drawn.
#[derive(Component, Reflect, Serialize, Deserialize, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default)]
pub struct SurfaceTraces {
    /// Water.
    pub water: bool,
    /// Colour, gloss or relief.
    pub paint: bool,
    /// Dust, mud or snow.
    #[serde(default)]
    pub matter: bool,
}

impl SplatQueue {
    /// The waiting splats.
    pub fn splats(&self) -> &[Splat] {
        &self.splats
    }

    /// Adds a splat behind the others.
    pub fn push(&mut self, splat: Splat) {
        self.traces.paint |= splat.paints();
        self.splats.push(splat);
    }

    /// As they were when the surface was saved.
    pub(crate) fn restore_traces(&mut self, traces: SurfaceTraces) {
        self.traces = traces;
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.splats.is_empty()
    }

    /// Whether any that was pushed left colour, gloss or relief.
    pub fn has_painted(&self) -> bool {
        self.traces.paint
    }

    /// Forgets the splats, keeping the memory.
    pub fn clear(&mut self) {
        self.splats.clear();
    }

    /// Brings the splats to maps of another size. `from`, `to`: texels along each side.
    pub(super) fn resize(&mut self, from: u32, to: u32) {
        self.splats.iter_mut().for_each(|splat| *splat = splat.resized(from, to));
    }

    /// Moves the splats behind those in `painter`.
    pub fn drain_into(&mut self, painter: &mut Vec<Splat>) {
        painter.append(&mut self.splats);
    }
}

/// What a surface has received.
#[derive(Component, Reflect, Serialize, Deserialize, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default)]
pub struct SurfaceTotals {
    /// Particles that hit it.
    pub impacts: u64,
    /// Water they carried, nanolitres.
    pub water_nl: u64,
    /// Tick of the last of them; 0 for none.
    #[serde(default)]
    pub last_tick: u32,
}

/// In `PreUpdate`, after surfaces have learnt their shape: stamps get their numbers, and surfaces learn where their texels lie.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct StampSystems;

/// Gives surfaces their queues and fills them.
pub struct DepositPlugin;

impl Plugin for DepositPlugin {
    fn build(&self, app: &mut App) {
        pool::plugin(app);
        app.register_type::<Weatherable>()
            .register_type::<SurfaceTotals>()
            .register_type::<SurfaceTraces>()
            .init_resource::<StampAtlas>()
            .register_required_components::<Weatherable, SplatQueue>()
            .register_required_components::<Weatherable, SurfaceTotals>()
            .register_required_components::<Weatherable, SurfaceTraces>()
            .register_type::<StampSpace>()
            .init_resource::<FramesWork>()
            .add_observer(release_frames)
            .add_observer(release_texels)
            // Of maps whose size has been decided.
            .add_systems(PreUpdate, measure_texels.after(MapSizeSystems))
            .add_systems(
                PreUpdate,
                (number_stamps.after(EffectSystems), measure_frames.after(MeasureSystems))
                    .chain()
                    .in_set(StampSystems),
            )
            .add_systems(PostUpdate, note_traces)
            .add_systems(WeatheringTick, deposit_splats.in_set(WeatheringSystems::Deposit));
    }
}

/// Measures the texels of a surface when it gets a collider or maps of another size. A scale that changes later is not
/// followed: the water would be spread anew.
pub(crate) fn measure_texels(
    mut commands: Commands,
    changed: Query<
        (Entity, &MapSize, &SurfaceCollider, &GlobalTransform),
        Or<(Changed<Weatherable>, Changed<MapSize>, Changed<SurfaceCollider>)>,
    >,
) {
    for (entity, size, collider, transform) in &changed {
        let area = TexelArea::new(collider.0.triangles(), &transform.affine(), size.texels());
        commands.entity(entity).insert(area);
    }
}

/// A surface without maps has no texels.
fn release_texels(removed: On<Remove, MapSize>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<TexelArea>();
}

/// Tells those who draw what has come.
pub(crate) fn note_traces(
    mut surfaces: Query<
        (&SplatQueue, Option<&SurfaceWater>, Option<&SurfaceMatter>, &mut SurfaceTraces),
        Or<(Changed<SplatQueue>, Changed<SurfaceWater>, Changed<SurfaceMatter>)>,
    >,
) {
    for (queue, water, matter, mut traces) in &mut surfaces {
        let matter = traces.matter || matter.is_some_and(|matter| !matter.is_empty());
        let water = traces.water || water.is_some_and(SurfaceWater::is_wet);
        traces.set_if_neq(SurfaceTraces { water, matter, ..queue.traces });
    }
}

type Stamped = (
    &'static Weatherable,
    &'static mut SplatQueue,
    &'static mut SurfaceTotals,
    Option<&'static mut DropQueue>,
    Option<&'static mut MatterQueue>,
    Option<&'static SurfaceFrames>,
    Option<&'static GlobalTransform>,
    Option<&'static DeformingCollider>,
    Option<&'static MapSize>,
    Option<&'static mut MapLoss>,
);

/// Turns this tick's impacts into splats, in their order. What falls on a surface without maps is entered as lost.
pub(super) fn deposit_splats(
    clock: Res<WeatheringClock>,
    impacts: Res<Impacts>,
    effects: Res<EffectTable>,
    config: Res<ParticleConfig>,
    particles: Res<Particles>,
    mut new: ResMut<NewParticles>,
    mut surfaces: Query<Stamped>,
) {
    let room = config.max_alive as usize - particles.len().min(config.max_alive as usize);
    for impact in &impacts.0 {
        let Ok((surface, mut queue, mut totals, drops, matter, frames, transform, deforming, size, loss)) =
            surfaces.get_mut(impact.surface)
        else {
            continue;
        };
        let Some(row) = effects.row(impact.effect) else { continue };
        let Some(effect) = &row.effect else { continue };
        (totals.impacts, totals.last_tick) = (totals.impacts + 1, clock.tick());
        let (water_nl, solid_nl) = effect.carries.parts_nl(impact.volume_nl);
        let source = new.source_of(impact.sequence);
        new.attribute_to(source);
        let water_nl = water_nl - throw_up(impact, row, effect, water_nl, &clock, room, &mut new);
        totals.water_nl += u64::from(water_nl);
        let Some(size) = size else {
            if let Some(mut loss) = loss {
                let is_snow = effect.carries == Carries::Snow;
                let (soil_nl, snow_nl) = if is_snow { (0, solid_nl) } else { (solid_nl, 0) };
                loss.turn_away_impact(water_nl, soil_nl, snow_nl);
            }
            continue;
        };
        let map = (size.texels(), surface.wrap());
        let site = frames
            .zip(transform)
            .filter(|_| effect.paints())
            .and_then(|(frames, transform)| Site::of(impact, &frames.0, transform, deforming));
        let mark = Mark::of(impact, row, effect);
        let splat =
            splat_from_impact(impact, row, effect, mark, map, site.as_ref(), (clock.tick(), water_nl));
        if splat.paints() || water_nl > 0 {
            queue.push(splat);
        }
        let (center, radius) = (splat.center, patch_radius(impact, mark, size.texels()));
        if let Some(mut matter) = matter
            && let Some(kind) = kind_of(effect.carries)
            && solid_nl > 0
        {
            let stamp = deposit_stamp(impact, row, effect, mark, size.texels());
            matter.0.push(Deposit { center, radius, kind, volume_nl: solid_nl, stamp });
        }
        if let Some(mut drops) = drops
            && splat.water_nl > 0
        {
            let jet = effect.jet.then(|| forwards(impact, radius));
            drops.0.push(Drop { center, radius, water_nl, speed_mm: speed_mm(impact, row), jet, source });
        }
    }
    new.attribute_to(Source::UNKNOWN);
}

/// Speed of the drops of an impact, less what they need to move a grain, mm/s.
fn speed_mm(impact: &Impact, row: &EffectRow) -> u32 {
    // What a particle brings may be less than one of its drops, as of those that are thrown up.
    let drop = drop_mm3(row.diameters_mm[usize::from(impact.class)]).min(impact.volume_nl as f32 * 1.0e-3);
    (loosening_speed(f64::from(impact.velocity.length()), f64::from(drop)) * 1000.0) as u32
}

/// How far a jet that strikes carries forwards what it sweeps along, 1/256 texel along u and v: by the cosine of its angle to the
/// wall (Taylor 1960), at most half the width and height of its patch.
fn forwards(impact: &Impact, radius: [i32; 2]) -> [i32; 2] {
    let along_wall = impact.velocity.normalize_or_zero().reject_from(impact.normal);
    let part = |axis: usize| along_wall.dot(impact.along[axis]).clamp(-1.0, 1.0);
    [0, 1].map(|axis| (part(axis) * radius[axis] as f32).round() as i32)
}

/// Throws a part of an impact's water up again, as two drops that are born in the next tick; returns how much, nanolitres.
fn throw_up(
    impact: &Impact,
    row: &EffectRow,
    effect: &WeatherEffect,
    water_nl: u32,
    clock: &WeatheringClock,
    room: usize,
    new: &mut NewParticles,
) -> u32 {
    let speed = impact.velocity.dot(impact.normal).abs();
    let thrown_nl = (f64::from(water_nl) * f64::from(effect.splash)) as u32;
    let diameter = row.diameters_mm[usize::from(impact.class)];
    // What a particle of mud throws up would be mud again, and soil come out of water.
    if effect.carries != Carries::Water {
        return 0;
    }
    if thrown_nl < 2 * LEAST_THROWN_NL || new.waiting().len() + 2 > room || !splashes(diameter, speed) {
        return 0;
    }
    let ticks_left = (SPLASH_SECONDS * clock.hz() as f32).ceil() as u16;
    for (number, volume_nl) in [thrown_nl / 2, thrown_nl - thrown_nl / 2].into_iter().enumerate() {
        let random =
            |salt: u32| unit_hash(impact.sequence.0 ^ (salt + 3 * number as u32).wrapping_mul(0x9e37_79b9));
        let (sin, cos) = (std::f32::consts::TAU * random(0)).sin_cos();
        let first = impact.normal.any_orthonormal_vector();
        let sideways = first * cos + impact.normal.cross(first) * sin;
        // A crown: slower than what hit, and more sideways than up.
        let velocity = (impact.normal * (0.1 + 0.15 * random(1)) + sideways * (0.1 + 0.2 * random(2)))
            * speed
            + impact.velocity.reject_from(impact.normal) * 0.3;
        new.push(|sequence| Particle {
            position: impact.point + impact.normal * 2.0e-3,
            velocity,
            lifespan: Lifespan { ticks_left, born_at: 0 },
            volume_nl,
            sequence,
            effect: impact.effect,
            class: impact.class,
        });
    }
    thrown_nl
}

/// A drop of a millimetre: what is smaller stays where it is, rather than flying as mist.
const LEAST_THROWN_NL: u32 = 524;

/// Seconds that what is thrown up may fly.
const SPLASH_SECONDS: f32 = 2.0;

fn kind_of(carries: Carries) -> Option<MatterKind> {
    match carries {
        Carries::Water => None,
        Carries::Dust => Some(MatterKind::Dust),
        Carries::Mud(_) => Some(MatterKind::Mud),
        Carries::Snow => Some(MatterKind::Snow),
    }
}

/// Gives the stamps of new effects their numbers, and what no effect has any more free.
pub(crate) fn number_stamps(mut effects: ResMut<EffectTable>, mut atlas: ResMut<StampAtlas>) {
    let effects = effects.bypass_change_detection();
    if effects.without_stamps().next().is_none() {
        return;
    }
    let in_use = |first: u32| effects.rows().iter().any(|row| row.stamps.1 > 0 && row.stamps.0 == first);
    atlas.retire_unless(in_use);
    for (numbers, set) in effects.without_stamps() {
        match atlas.add(set) {
            Some(first) => *numbers = (first, set.variants.len() as u32),
            None => {
                warn_once!("more than {} stamps: some effects paint domes instead", StampAtlas::MAX_STAMPS)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::EffectIndex;
    use crate::particle::Sequence;

    fn impact(surface: Entity, number: u32) -> Impact {
        Impact {
            sequence: Sequence(number),
            surface,
            triangle: 0,
            point: Vec3::ZERO,
            normal: Vec3::Y,
            uv: Vec2::new(0.5, 1.25),
            uv_per_metre: Vec2::new(0.5, 0.25),
            along: [Vec3::X, Vec3::Z],
            back: false,
            velocity: Vec3::NEG_Y,
            effect: EffectIndex(0),
            class: 0,
            volume_nl: 4190,
        }
    }

    #[test]
    fn each_impact_is_one_splat_on_its_surface() {
        let mut world = World::new();
        let mut clock = WeatheringClock::new(60);
        clock.advance();
        world.insert_resource(clock);
        let mut effects = EffectTable::default();
        let at_any_speed = WeatherEffect { stamp_radius: Some(0.125), stamp_speed: Some(0.0), ..default() };
        effects.insert(Handle::default(), at_any_speed);
        world.insert_resource(effects);
        world.init_resource::<ParticleConfig>();
        world.init_resource::<Particles>();
        world.init_resource::<NewParticles>();
        let mut spawn =
            || world.spawn((Weatherable::default(), SplatQueue::default(), SurfaceTotals::default())).id();
        let (one, other, bare) = (spawn(), spawn(), spawn());
        for mapped in [one, other] {
            world.entity_mut(mapped).insert(MapSize::whole(&Weatherable::default()));
        }
        world.entity_mut(bare).insert(MapLoss::default());
        let gone = world.spawn_empty().id();
        world.insert_resource(Impacts(vec![
            impact(one, 4),
            impact(other, 5),
            impact(gone, 6),
            impact(one, 7),
            impact(bare, 8),
        ]));

        let mut schedule = Schedule::default();
        schedule.add_systems(deposit_splats);
        schedule.run(&mut world);

        let totals = |surface| *world.get::<SurfaceTotals>(surface).unwrap();
        assert_eq!(totals(one), SurfaceTotals { impacts: 2, water_nl: 8380, last_tick: 1 });
        assert_eq!(totals(other), SurfaceTotals { impacts: 1, water_nl: 4190, last_tick: 1 });
        // Without maps: counted, but not kept.
        assert_eq!(totals(bare), totals(other));
        assert!(world.get::<SplatQueue>(bare).unwrap().is_empty());
        let lost = MapLoss::UNITS.from_nl(4190);
        let expected = MapLoss { unpainted: 1, received: lost, water: lost, ..default() };
        assert_eq!(world.get::<MapLoss>(bare), Some(&expected));
        let splat = world.get::<SplatQueue>(other).unwrap().splats()[0];
        assert_eq!(splat.center, [256 * 256, 128 * 256]);
        assert_eq!(splat.radius, [32 * 256, 16 * 256]);
        assert_eq!((splat.water_nl, splat.tick), (4190, 1));
    }

    #[test]
    fn a_jet_aslant_sweeps_forwards_and_drops_lose_what_moves_no_grain() {
        let aslant = Impact { velocity: Vec3::new(3.0, -4.0, 0.0), ..impact(Entity::PLACEHOLDER, 4) };
        assert_eq!(forwards(&aslant, [1000, 500]), [600, 0]);
        let back = Impact { velocity: Vec3::new(0.0, -4.0, -3.0), ..aslant };
        assert_eq!(forwards(&back, [1000, 500]), [0, -300]);
        assert_eq!(forwards(&impact(Entity::PLACEHOLDER, 4), [1000, 500]), [0, 0]);
        let mut effects = EffectTable::default();
        effects.insert(Handle::default(), WeatherEffect::default());
        let row = &effects.rows()[0];
        // 52 µJ of a drop of 2 mm, of which it needs 5; a thousandth of that drop moves nothing.
        assert!(speed_mm(&aslant, row).abs_diff(4755) < 5, "{}", speed_mm(&aslant, row));
        assert_eq!(speed_mm(&Impact { volume_nl: 4, ..aslant }, row), 0);
    }

    #[test]
    fn what_splashes_throws_up_a_part_and_not_a_nanolitre_is_lost() {
        let mut effects = EffectTable::default();
        effects.insert(Handle::default(), WeatherEffect { splash: 0.3, ..default() });
        let (row, clock) = (&effects.rows()[0], WeatheringClock::new(60));
        let effect = row.effect.as_ref().unwrap();
        let thrown = |velocity: Vec3, room: usize| {
            let (mut new, hit) =
                (NewParticles::default(), Impact { velocity, ..impact(Entity::PLACEHOLDER, 4) });
            let thrown = throw_up(&hit, row, effect, 4189, &clock, room, &mut new);
            let flying: u32 = new.waiting().iter().map(|particle| particle.volume_nl).sum();
            assert_eq!(thrown, flying);
            assert!(new.waiting().iter().all(|particle| particle.velocity.y > 0.0));
            (thrown, new.waiting().len())
        };
        assert_eq!(thrown(Vec3::NEG_Y * 8.0, 10), (1256, 2));
        // Too slow, as what has been thrown up twice is; and where there is no room.
        assert_eq!(thrown(Vec3::NEG_Y * 8.0 * 0.35 * 0.35, 10), (0, 0));
        assert_eq!(thrown(Vec3::NEG_Y * 8.0, 1), (0, 0));
        // Its water would come down as mud.
        let mud = WeatherEffect { carries: Carries::Mud(0.4), ..effect.clone() };
        let hit = Impact { velocity: Vec3::NEG_Y * 8.0, ..impact(Entity::PLACEHOLDER, 4) };
        let mut new = NewParticles::default();
        assert_eq!(throw_up(&hit, row, &mud, 4189, &clock, 10, &mut new), 0);
        assert!(new.waiting().is_empty());
    }
}
