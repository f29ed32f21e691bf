//! Impacts become splats on the surfaces they hit.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::frames::{FramesWork, SurfaceFrames, measure_frames, release_frames};
use super::stamping::{Site, splat_from_impact};
use super::{Splat, StampAtlas, StampSpace, TexelArea, Weatherable};
use crate::clock::WeatheringClock;
use crate::collision::{Impacts, SurfaceCollider};
use crate::effect::{Carries, EffectTable, RefreshEffects};
use crate::matter::{Deposit, MatterKind, MatterQueue, SurfaceMatter};
use crate::schedule::{WeatheringSystems, WeatheringTick};
use crate::wetting::{Drop, DropQueue, MeasureSurfaces, SurfaceWater};

/// Splats of a surface that nobody has painted yet, in the order of their impacts. A frame may hold any number of
/// ticks: each adds its own; the painter empties it.
#[derive(Component, Debug, Default)]
pub struct SplatQueue {
    splats: Vec<Splat>,
    /// What has ever been pushed.
    traces: SurfaceTraces,
}

/// What has ever come to a surface. What has not come need not be looked for when it is drawn.
#[derive(Component, Reflect, Serialize, Deserialize, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component)]
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
        self.traces.paint |= splat.diffuse >> 24 > 0 || splat.specular >> 24 > 0 || splat.bump_opacity > 0;
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

    /// Forgets the splats, keeping the memory.
    pub fn clear(&mut self) {
        self.splats.clear();
    }

    /// Moves the splats behind those in `painter`.
    pub fn drain_into(&mut self, painter: &mut Vec<Splat>) {
        painter.append(&mut self.splats);
    }
}

/// What a surface has received.
#[derive(Component, Reflect, Serialize, Deserialize, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component)]
pub struct SurfaceTotals {
    /// Particles that hit it.
    pub impacts: u64,
    /// Water they carried, nanolitres.
    pub water_nl: u64,
}

/// In `PreUpdate`, after surfaces have learnt their shape: stamps get their numbers, and surfaces learn where their texels lie.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PrepareStamps;

/// Gives surfaces their queues and fills them.
pub struct DepositPlugin;

impl Plugin for DepositPlugin {
    fn build(&self, app: &mut App) {
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
            .add_systems(PreUpdate, measure_texels)
            .add_systems(
                PreUpdate,
                (number_stamps.after(RefreshEffects), measure_frames.after(MeasureSurfaces))
                    .chain()
                    .in_set(PrepareStamps),
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
        (Entity, &Weatherable, &SurfaceCollider, &GlobalTransform),
        Or<(Changed<Weatherable>, Changed<SurfaceCollider>)>,
    >,
) {
    for (entity, surface, collider, transform) in &changed {
        let area = TexelArea::new(collider.0.triangles(), &transform.affine(), surface.texels());
        commands.entity(entity).insert(area);
    }
}

/// Tells those who draw what has come.
pub(crate) fn note_traces(
    mut surfaces: Query<
        (&SplatQueue, Option<&SurfaceWater>, Option<&SurfaceMatter>, &mut SurfaceTraces),
        Or<(Changed<SplatQueue>, Changed<SurfaceWater>)>,
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
);

/// Turns this tick's impacts into splats, in their order.
pub fn deposit_splats(
    clock: Res<WeatheringClock>,
    impacts: Res<Impacts>,
    effects: Res<EffectTable>,
    mut surfaces: Query<Stamped>,
) {
    for impact in &impacts.0 {
        let Ok((surface, mut queue, mut totals, drops, matter, frames, transform)) =
            surfaces.get_mut(impact.surface)
        else {
            continue;
        };
        let Some(row) = effects.row(impact.effect) else { continue };
        let Some(effect) = &row.effect else { continue };
        totals.impacts += 1;
        let (water_nl, solid_nl) = effect.carries.parts_nl(impact.volume_nl);
        totals.water_nl += u64::from(water_nl);
        let site = frames
            .zip(transform)
            .map(|(frames, transform)| Site { frames: &frames.0, world_from_mesh: transform.affine() });
        let splat = splat_from_impact(impact, row, effect, surface, site.as_ref(), clock.tick(), water_nl);
        queue.push(splat);
        if let Some(mut matter) = matter
            && let Some(kind) = kind_of(effect.carries)
            && solid_nl > 0
        {
            let Splat { center, radius, .. } = splat;
            matter.0.push(Deposit { center, radius, kind, volume_nl: solid_nl });
        }
        if let Some(mut drops) = drops
            && splat.water_nl > 0
        {
            let speed_mm = (impact.velocity.length() * 1000.0) as u32;
            let Splat { center, radius, water_nl, .. } = splat;
            drops.0.push(Drop { center, radius, water_nl, speed_mm });
        }
    }
}

fn kind_of(carries: Carries) -> Option<MatterKind> {
    match carries {
        Carries::Water => None,
        Carries::Dust => Some(MatterKind::Dust),
        Carries::Mud(_) => Some(MatterKind::Mud),
        Carries::Snow => Some(MatterKind::Snow),
    }
}

/// Gives the stamps of new effects their numbers.
pub(crate) fn number_stamps(mut effects: ResMut<EffectTable>, mut atlas: ResMut<StampAtlas>) {
    for (numbers, set) in effects.bypass_change_detection().without_stamps() {
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
    use crate::collision::Impact;
    use crate::effect::{EffectIndex, WeatherEffect};
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
            velocity: Vec3::NEG_Y,
            effect: EffectIndex(0),
            class: 0,
            volume_nl: 4189,
        }
    }

    #[test]
    fn each_impact_is_one_splat_on_its_surface() {
        let mut world = World::new();
        let mut clock = WeatheringClock::new(60);
        clock.advance();
        world.insert_resource(clock);
        let mut effects = EffectTable::default();
        effects.insert(Handle::default(), WeatherEffect { stamp_radius: Some(0.125), ..default() });
        world.insert_resource(effects);
        let mut spawn =
            || world.spawn((Weatherable::default(), SplatQueue::default(), SurfaceTotals::default())).id();
        let (one, other) = (spawn(), spawn());
        let gone = world.spawn_empty().id();
        world.insert_resource(Impacts(vec![
            impact(one, 4),
            impact(other, 5),
            impact(gone, 6),
            impact(one, 7),
        ]));

        let mut schedule = Schedule::default();
        schedule.add_systems(deposit_splats);
        schedule.run(&mut world);

        let totals = |surface| *world.get::<SurfaceTotals>(surface).unwrap();
        assert_eq!(totals(one), SurfaceTotals { impacts: 2, water_nl: 8378 });
        assert_eq!(totals(other), SurfaceTotals { impacts: 1, water_nl: 4189 });
        let splat = world.get::<SplatQueue>(other).unwrap().splats()[0];
        assert_eq!(splat.center, [256 * 256, 128 * 256]);
        assert_eq!(splat.radius, [32 * 256, 16 * 256]);
        assert_eq!((splat.water_nl, splat.tick), (4189, 1));
    }
}
