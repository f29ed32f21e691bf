//! Giving surfaces the size of their maps, and less of it, or none, when there is no room for all.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::plan::{MapNeed, Wish, fit};
use super::release::Release;
use super::resize::{Resizing, tell};
use super::room::{Change, Mapped, Room, Step};
use super::{
    MapBudget, MapLoss, MapPool, MapSize, SurfaceEvicted, SurfaceOrder, SurfaceResized, Unmapped, label,
};
use crate::collision::{DeformingCollider, NotWeatherable, SurfaceCollider};
use crate::effect::{Carries, EffectTable, WeatherEffect};
use crate::overlay::{StampSpace, SurfaceFrames, SurfaceTotals, TexelArea, Weatherable};
use crate::wetting::{DripEffect, SurfaceWater, WetGeometry};

/// What may fall by the effects that there are.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Default)]
pub(super) struct Falling {
    /// Something that leaves marks.
    paint: bool,
    /// Dust, mud or snow.
    solids: bool,
}

impl Falling {
    /// By effects that are in use, and by those that are loaded and may come into use.
    fn new(table: &EffectTable, loaded: Option<&Assets<WeatherEffect>>, drips: Option<&DripEffect>) -> Self {
        // Lumps of snow and muddy drips fall only where snow and soil have come.
        let is_shed = |effect: AssetId<WeatherEffect>| {
            drips.is_some_and(|drips| drips.handles[1..].iter().any(|handle| handle.id() == effect))
        };
        let in_use = table.rows().iter().filter_map(|row| Some((row.handle.id(), row.effect.as_ref()?)));
        let mut falling = Self::default();
        for (id, effect) in in_use.chain(loaded.into_iter().flat_map(|loaded| loaded.iter())) {
            if !is_shed(id) {
                falling.paint |= effect.paints();
                falling.solids |= effect.carries != Carries::Water;
            }
        }
        falling
    }

    /// What a surface may come to hold.
    pub(super) fn need(self, surface: &Weatherable, is_posed: bool) -> MapNeed {
        let frames = self.paint && surface.stamps == StampSpace::Surface && !is_posed;
        MapNeed { colors: true, rings: true, water: true, matter: self.solids, frames }
    }
}

type Found = (
    (Entity, &'static Weatherable, &'static SurfaceOrder, &'static SurfaceTotals),
    (Option<&'static MapSize>, Has<Unmapped>, Option<&'static Resizing>),
    (Option<&'static SurfaceCollider>, Option<&'static GlobalTransform>, Has<DeformingCollider>),
    (Has<WetGeometry>, Has<SurfaceWater>, Has<SurfaceFrames>, Option<&'static TexelArea>),
);

/// A surface that has none.
#[derive(Clone, Copy)]
struct Waiting {
    entity: Entity,
    wish: Wish,
    /// Its shape is there.
    has_shape: bool,
    /// It had to go without before.
    again: bool,
}

/// Whether there is room.
enum Outcome {
    Now,
    /// When what is on its way has come.
    Soon,
    Never,
}

/// All that a decision is made from, and written to.
#[derive(SystemParam)]
pub(super) struct Sizing<'w, 's> {
    commands: Commands<'w, 's>,
    budget: Res<'w, MapBudget>,
    pool: ResMut<'w, MapPool>,
    evicted: MessageWriter<'w, SurfaceEvicted>,
    resized: MessageWriter<'w, SurfaceResized>,
    release: Release<'w, 's>,
    surfaces: Query<'w, 's, Found, (Without<NotWeatherable>, Shaped)>,
    names: Query<'w, 's, &'static Name>,
}

/// Surfaces that have a shape, or will have one. Nothing falls on others.
type Shaped = Or<(With<Mesh3d>, With<SurfaceCollider>)>;

/// Surfaces about which nothing has been decided.
type New = (With<Weatherable>, Without<MapSize>, Without<Unmapped>, Without<NotWeatherable>, Shaped);

/// Decides about surfaces that are new, were edited, go without or have less than they wish for. Does nothing while there are none.
pub(super) fn size_surfaces(
    effects: Res<EffectTable>,
    loaded: Option<Res<Assets<WeatherEffect>>>,
    drips: Option<Res<DripEffect>>,
    new: Query<(), New>,
    edited: Query<(), (With<MapSize>, Changed<Weatherable>)>,
    mut sizing: Sizing,
) {
    let falling = Falling::new(&effects, loaded.as_deref(), drips.as_deref());
    let MapPool { unmapped, reserved, next_bytes, .. } = *sizing.pool;
    let room_again = unmapped > 0 && reserved.saturating_add(next_bytes) <= sizing.budget.bytes;
    let unchanged = falling == sizing.pool.falling && !sizing.budget.is_changed();
    let (tick, hz) = sizing.release.now();
    let second = tick / hz;
    let is_due = second != sizing.pool.second && (unmapped > 0 || sizing.pool.reduced > 0);
    let is_over = reserved > sizing.budget.bytes;
    if unchanged && new.is_empty() && edited.is_empty() && !room_again && !is_due && !is_over {
        return;
    }
    sizing.pool.falling = falling;
    let (mapped, mut waiting) = sizing.sort_out();
    waiting.sort_unstable_by_key(|waiting| waiting.wish.order);
    let mut room = Room::new(sizing.budget.bytes, mapped);
    let turned_out = (sizing.pool.evictions, sizing.pool.refusals);
    sizing.make_room(&mut room, 0);
    let (again, new): (Vec<Waiting>, Vec<Waiting>) = waiting.into_iter().partition(|waiting| waiting.again);
    let is_complete = sizing.map_new(&mut room, &new);
    // Who went without is served when everybody else is.
    let next = if is_complete { sizing.map_again(&mut room, &again) } else { None };
    if is_due {
        sizing.pool.second = second;
        if is_complete {
            sizing.follow_use(&mut room, next, tick.checked_sub(MapBudget::IDLE_SECONDS * hz));
        }
    }
    let is_settled = turned_out == (sizing.pool.evictions, sizing.pool.refusals);
    sizing.pool.next_bytes = next.filter(|_| is_settled).unwrap_or(0);
}

impl Sizing<'_, '_> {
    /// Those with maps and those without. Who was edited so that other maps are needed is emptied, and is one of the latter.
    fn sort_out(&mut self) -> (Vec<Mapped>, Vec<Waiting>) {
        let falling = self.pool.falling;
        let (mut mapped, mut waiting) = (Vec::new(), Vec::new());
        for (
            (entity, surface, order, totals),
            (size, again, resizing),
            (collider, transform, is_posed),
            (has_geometry, has_water, _, area),
        ) in &self.surfaces
        {
            let need = falling.need(surface, is_posed);
            if let Some(size) = size {
                if size.is_for(surface) {
                    let is_there = collider.is_some() && transform.is_some();
                    mapped.push(Mapped {
                        entity,
                        age: (totals.last_tick, order.0),
                        need,
                        side: size.texels,
                        smallest: MapBudget::SMALLEST_SIDE.min(size.limit),
                        granted: size.granted,
                        wish: size.wish,
                        target: resizing.map(|resizing| resizing.to),
                        texel_mm2: area.map_or(0.0, |area| area.mean_mm2),
                        change: match (has_geometry, has_water) {
                            (true, true) if is_there => Change::Later,
                            (false, false) => Change::AtOnce,
                            _ => Change::Never,
                        },
                    });
                    continue;
                }
                let lost = self.release.release(&mut self.commands, entity);
                if lost.is_lost() {
                    info!("{} gets new maps; what was on the old ones is gone", label(&self.names, entity));
                }
            }
            let wish = Wish { order: order.0, limit: surface.texels(), extent: 0.0, need };
            waiting.push(Waiting { entity, wish, has_shape: collider.is_some(), again });
        }
        (mapped, waiting)
    }

    /// Makes room for so many bytes: by halving maps and, where that is not enough, by taking some away.
    fn make_room(&mut self, room: &mut Room, bytes: u64) -> Outcome {
        if !room.has(bytes) {
            self.change(room.give_way(bytes, u32::MAX));
        }
        while !room.will_have(bytes)
            && let Some(surface) = room.next_out()
        {
            let lost = self.release.release(&mut self.commands, surface);
            self.commands.entity(surface).insert(Unmapped::Evicted);
            self.pool.evictions += 1;
            warn!(
                "{} has lost its maps, for which the budget of {} bytes has no room any more, and with them its marks, {:.1} \
                 mm³ of water, {:.1} mm³ of dust and mud, {:.1} mm³ of snow",
                label(&self.names, surface),
                self.budget.bytes,
                MapLoss::mm3(lost.water),
                MapLoss::mm3(lost.soil),
                MapLoss::mm3(lost.snow)
            );
            self.evicted.write(SurfaceEvicted { surface, lost });
        }
        match (room.has(bytes), room.will_have(bytes)) {
            (true, _) => Outcome::Now,
            (false, true) => Outcome::Soon,
            (false, false) => Outcome::Never,
        }
    }

    /// Begins to give surfaces maps of another size.
    fn change(&mut self, steps: Vec<Step>) {
        for Step { entity, change, from, to } in steps {
            let Ok(((_, surface, ..), (Some(&size), ..), (collider, transform, ..), (_, _, has_frames, _))) =
                self.surfaces.get(entity)
            else {
                continue;
            };
            if change == Change::AtOnce {
                self.release.resize_queues(entity, from, to);
                let mut size = MapSize { texels: to, ..size };
                tell(&mut size, from, || label(&self.names, entity));
                self.commands.entity(entity).insert(size);
                self.pool.count_resize(from, to);
                self.resized.write(SurfaceResized { surface: entity, from, to });
            } else if let (Some(collider), Some(transform)) = (collider, transform) {
                let (tick, _) = self.release.now();
                let resizing = Resizing::begin(to, surface.wrap(), collider, transform, has_frames, tick);
                self.commands.entity(entity).insert(resizing);
            }
        }
    }

    /// Room for who went without, whose maps take `next` bytes; if nobody did, for those that are hit. `idle_until`: who was hit in this
    /// tick for the last time, or before, gives way; nobody does while there has been none.
    fn follow_use(&mut self, room: &mut Room, next: Option<u64>, idle_until: Option<u32>) {
        let steps = match (next, idle_until) {
            (None, _) => room.grow(idle_until),
            (Some(bytes), Some(idle_until)) if room.could_have(bytes, idle_until) => {
                room.give_way(bytes, idle_until)
            }
            (Some(_), _) => return,
        };
        self.change(steps);
    }

    /// Maps for surfaces that are new, in the order in which they were spawned. Whether nobody waits any more.
    fn map_new(&mut self, room: &mut Room, new: &[Waiting]) -> bool {
        let texel = self.budget.texel;
        let most: u64 = new.iter().map(|new| new.wish.need.bytes(new.wish.limit)).sum();
        // Where all get what they wish for, it does not matter who comes first. Else everybody has to be there.
        let plenty = room.has(most);
        let by_shape = !plenty || texel.is_some();
        let all_there = new.iter().all(|new| new.has_shape);
        if !plenty && !all_there {
            return false;
        }
        let ready: Vec<Waiting> = new.iter().filter(|new| new.has_shape || !by_shape).copied().collect();
        let wishes = self.wishes(&ready, by_shape);
        let sides = fit(&wishes, texel, room.bytes());
        let total: u64 = wishes.iter().zip(&sides).map(|(wish, &side)| wish.need.bytes(side)).sum();
        if !room.has(total) {
            // For all of them at once, since it takes a while.
            self.change(room.give_way(total, u32::MAX));
        }
        for ((surface, wish), side) in ready.iter().zip(&wishes).zip(sides) {
            let bytes = wish.need.bytes(side);
            match self.make_room(room, bytes) {
                Outcome::Now => {
                    room.take(bytes);
                    self.grant(surface.entity, side, wish.side(texel));
                }
                // Who comes after it waits, too.
                Outcome::Soon => return false,
                Outcome::Never => {
                    self.commands.entity(surface.entity).insert(Unmapped::Refused);
                    self.pool.refusals += 1;
                    error!(
                        "{} stays unweathered: a budget of {} bytes has no room for its maps, {side} x {side} texels",
                        label(&self.names, surface.entity),
                        self.budget.bytes
                    );
                }
            }
        }
        ready.len() == new.len()
    }

    /// Maps for those who went without, as far as there is room by itself. How many bytes the next of them needs.
    fn map_again(&mut self, room: &mut Room, again: &[Waiting]) -> Option<u64> {
        let smallest = |surface: &Waiting| surface.wish.need.bytes(surface.wish.smallest());
        let mut needed = 0;
        let fits = |&&surface: &&Waiting| {
            needed += smallest(&surface);
            surface.has_shape && room.has(needed)
        };
        let served = again.iter().take_while(fits).count();
        let (served, left) = again.split_at(served);
        let texel = self.budget.texel;
        let wishes = self.wishes(served, true);
        let sides = fit(&wishes, texel, room.bytes());
        for ((surface, wish), side) in served.iter().zip(&wishes).zip(sides) {
            room.take(wish.need.bytes(side));
            info!("{} has maps again, {side} x {side} texels", label(&self.names, surface.entity));
            self.grant(surface.entity, side, wish.side(texel));
        }
        left.first().map(smallest)
    }

    fn grant(&mut self, surface: Entity, side: u32, wish: u32) {
        let Ok(((_, settings, ..), ..)) = self.surfaces.get(surface) else { return };
        let size = MapSize::reduced(settings, side, wish);
        self.commands.entity(surface).remove::<Unmapped>().insert(size);
    }

    /// The wishes of surfaces; `by_shape`: with how large they are in the world.
    fn wishes(&self, surfaces: &[Waiting], by_shape: bool) -> Vec<Wish> {
        let wish = |waiting: &Waiting| {
            let mut wish = waiting.wish;
            if by_shape
                && let Ok((_, _, (Some(collider), transform, ..), _)) = self.surfaces.get(waiting.entity)
            {
                wish.extent = extent(collider, transform);
            }
            wish
        };
        surfaces.iter().map(wish).collect()
    }
}

/// Length of a map's side in the world, metres: of a square of as many texels as the surface's islands leave of it, so that
/// a surface with much waste on its map has texels as wide as others.
fn extent(collider: &SurfaceCollider, transform: Option<&GlobalTransform>) -> f64 {
    let world_from_mesh = transform.copied().unwrap_or_default().affine();
    let side = Weatherable::MAX_MAP_SIZE;
    let area = TexelArea::new(collider.0.triangles(), &world_from_mesh, side);
    f64::from(area.mean_mm2).sqrt() * 1e-3 * f64::from(side)
}
