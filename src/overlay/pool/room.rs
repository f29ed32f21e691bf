//! What is left of the budget, and who can be asked for more. Pure: numbers in, decisions out.

use bevy::prelude::*;

use super::plan::MapNeed;
use crate::overlay::TILE_SIZE;

/// How the maps of a surface can get another size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Change {
    /// Nothing has been measured for it, nothing lies on it.
    AtOnce,
    /// When the new texels are measured.
    Later,
    /// Not now.
    Never,
}

/// A surface that has maps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mapped {
    pub(super) entity: Entity,
    /// Tick of the last impact, then the order of spawning.
    pub(super) age: (u32, u64),
    pub(super) need: MapNeed,
    /// Texels along each side: now, at least, as it was given first, and as it would have if there were room for all.
    pub(super) side: u32,
    pub(super) smallest: u32,
    pub(super) granted: u32,
    pub(super) wish: u32,
    /// What it is on its way to.
    pub(super) target: Option<u32>,
    /// Area of its texels in the world, mm².
    pub(super) texel_mm2: f32,
    pub(super) change: Change,
}

impl Mapped {
    /// What it is charged with: the larger of what it has and will have.
    fn bytes(&self) -> i128 {
        i128::from(self.need.bytes(self.side.max(self.target.unwrap_or(0))))
    }

    /// What becomes free when it has what it is on its way to.
    fn coming(&self) -> i128 {
        self.target.map_or(0, |target| self.bytes() - i128::from(self.need.bytes(target)))
    }

    /// What becomes free after that, if it is halved as often as it can be once it is there.
    fn left(&self) -> i128 {
        let Some(target) = self.target else { return 0 };
        let mut least = target;
        while let Some(half) = self.half(least) {
            least = half;
        }
        i128::from(self.need.bytes(target)) - i128::from(self.need.bytes(least))
    }

    /// What half of a side is, if it may have that: whole tiles, and not less than the least.
    fn half(&self, side: u32) -> Option<u32> {
        (side.is_multiple_of(2 * TILE_SIZE) && side / 2 >= self.smallest).then_some(side / 2)
    }

    /// Its side if its maps are halved until `bytes` more are free, or as often as they can be.
    fn side_for(&self, bytes: i128) -> u32 {
        let mut side = self.side;
        if self.target.is_some() || self.change == Change::Never {
            return side;
        }
        while self.gain(side) < bytes
            && let Some(half) = self.half(side)
        {
            side = half;
        }
        side
    }

    /// What is free when it has so many texels along a side.
    fn gain(&self, side: u32) -> i128 {
        i128::from(self.need.bytes(self.side)) - i128::from(self.need.bytes(side))
    }

    fn may_grow(&self, hit_after: u32) -> bool {
        let is_hit = self.age.0 > hit_after;
        is_hit && self.change == Change::Later && self.target.is_none() && self.side * 2 <= self.wish
    }

    /// Whether it has what it was given first.
    fn is_whole(&self) -> bool {
        self.side >= self.granted
    }
}

/// The maps of a surface get another size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Step {
    pub(super) entity: Entity,
    pub(super) change: Change,
    /// Texels along each side.
    pub(super) from: u32,
    pub(super) to: u32,
}

/// What is left of the budget, and who has the rest.
#[derive(Debug)]
pub(super) struct Room {
    /// Bytes; below 0 if more are taken than there are.
    free: i128,
    /// Bytes that become free when all that is on its way has come.
    coming: i128,
    /// Who was hit longest ago comes first.
    mapped: Vec<Mapped>,
    /// So many of them, from the first on, have lost their maps.
    gone: usize,
}

impl Room {
    pub(super) fn new(budget: u64, mut mapped: Vec<Mapped>) -> Self {
        mapped.sort_unstable_by_key(|mapped| mapped.age);
        let taken: i128 = mapped.iter().map(Mapped::bytes).sum();
        let coming = mapped.iter().map(Mapped::coming).sum();
        Self { free: i128::from(budget) - taken, coming, mapped, gone: 0 }
    }

    /// Bytes that are free.
    pub(super) fn bytes(&self) -> u64 {
        u64::try_from(self.free).unwrap_or(0)
    }

    /// Whether so many are free.
    pub(super) fn has(&self, bytes: u64) -> bool {
        self.free >= i128::from(bytes)
    }

    /// Whether so many will be, if nobody else takes them: when what is on its way has come, and can be halved in its turn.
    pub(super) fn will_have(&self, bytes: u64) -> bool {
        let left: i128 = self.mapped[self.gone..].iter().map(Mapped::left).sum();
        self.free + self.coming + left >= i128::from(bytes)
    }

    /// They are taken.
    pub(super) fn take(&mut self, bytes: u64) {
        self.free -= i128::from(bytes);
    }

    /// Whether so many would be free if all who were hit at this tick for the last time, or before, had their least.
    pub(super) fn could_have(&self, bytes: u64, hit_until: u32) -> bool {
        let idle = self.mapped[self.gone..].iter().take_while(|mapped| mapped.age.0 <= hit_until);
        let gain: i128 = idle.map(|mapped| mapped.gain(mapped.side_for(i128::MAX))).sum();
        self.free + self.coming + gain >= i128::from(bytes)
    }

    /// Halves maps until so many bytes are free or will be: those of who was hit longest ago first, down to the smallest, and of
    /// nobody who was hit after this tick.
    pub(super) fn give_way(&mut self, bytes: u64, hit_until: u32) -> Vec<Step> {
        let mut steps = Vec::new();
        for mapped in &mut self.mapped[self.gone..] {
            let missing = i128::from(bytes) - self.free - self.coming;
            if missing <= 0 || mapped.age.0 > hit_until {
                break;
            }
            let (from, to) = (mapped.side, mapped.side_for(missing));
            if to == from {
                continue;
            }
            let gain = mapped.gain(to);
            if mapped.change == Change::AtOnce {
                self.free += gain;
                mapped.side = to;
            } else {
                self.coming += gain;
                mapped.target = Some(to);
            }
            steps.push(Step { entity: mapped.entity, change: mapped.change, from, to });
        }
        steps
    }

    /// Who loses its maps next, with what it has.
    pub(super) fn next_out(&mut self) -> Option<Entity> {
        let out = self.mapped.get(self.gone)?;
        self.gone += 1;
        self.free += out.bytes();
        self.coming -= out.coming();
        Some(out.entity)
    }

    /// Who gets twice the side, of those that were hit after this tick; and who gives way for it, of the others. `None`: nobody
    /// gives way.
    ///
    /// Those that have less than they were given first come first. Who never had what it wished for comes after them, the coarsest
    /// first, and waits for each other: else the small would become finer than the large.
    pub(super) fn grow(&mut self, idle_until: Option<u32>) -> Vec<Step> {
        let hit_after = idle_until.unwrap_or(0);
        let mut order: Vec<usize> =
            (self.gone..self.mapped.len()).filter(|&index| self.mapped[index].may_grow(hit_after)).collect();
        order.sort_unstable_by(|&one, &other| {
            let (one, other) = (&self.mapped[one], &self.mapped[other]);
            let coarsest = other.texel_mm2.total_cmp(&one.texel_mm2);
            one.is_whole().cmp(&other.is_whole()).then(coarsest).then(one.age.1.cmp(&other.age.1))
        });
        let mut steps = Vec::new();
        for index in order {
            let Mapped { entity, need, side, change, .. } = self.mapped[index];
            let more = need.bytes(side * 2) - need.bytes(side);
            if !self.has(more)
                && let Some(idle_until) = idle_until
                && self.could_have(more, idle_until)
            {
                steps.extend(self.give_way(more, idle_until));
            }
            if self.has(more) {
                self.take(more);
                self.mapped[index].target = Some(side * 2);
                steps.push(Step { entity, change, from: side, to: side * 2 });
            } else if self.mapped[index].is_whole() {
                break;
            }
        }
        steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NEED: MapNeed = MapNeed { colors: true, rings: true, water: true, matter: false, frames: false };

    /// Number `order` was hit last at this tick.
    fn mapped(order: u64, last_tick: u32, side: u32) -> Mapped {
        Mapped {
            entity: Entity::from_bits(order + 1),
            age: (last_tick, order),
            need: NEED,
            side,
            smallest: 64,
            granted: side,
            wish: side,
            target: None,
            texel_mm2: 1.0,
            change: Change::Later,
        }
    }

    fn sides(steps: &[Step]) -> Vec<(u64, u32)> {
        steps.iter().map(|step| (step.entity.to_bits() - 1, step.to)).collect()
    }

    #[test]
    fn who_was_hit_longest_ago_halves_first_and_no_more_than_it_takes() {
        let all = || vec![mapped(0, 50, 256), mapped(1, 9, 256), mapped(2, 9, 256)];
        let full = 3 * NEED.bytes(256);
        let mut room = Room::new(full, all());
        assert!(room.has(0) && !room.has(1));
        // Half of the idlest, which is the first of the two.
        assert_eq!(sides(&room.give_way(1, u32::MAX)), [(1, 128)]);
        assert!(!room.has(1) && room.will_have(1));
        // It is on its way already.
        assert!(room.give_way(1, u32::MAX).is_empty());
        // Down to its least, then the next.
        let mut room = Room::new(full, all());
        let least = NEED.bytes(256) - NEED.bytes(64);
        assert_eq!(sides(&room.give_way(least + 1, u32::MAX)), [(1, 64), (2, 128)]);
        // Nobody who was hit since.
        let mut room = Room::new(full, all());
        assert_eq!(sides(&room.give_way(u64::MAX, 49)), [(1, 64), (2, 64)]);
        assert!(!room.will_have(3 * least));
        // What is out takes along what it would have given.
        assert_eq!(room.next_out(), Some(mapped(1, 9, 256).entity));
        assert!(room.has(NEED.bytes(256)) && !room.will_have(NEED.bytes(256) + least + 1));
        assert!(room.will_have(NEED.bytes(256) + least));
    }

    #[test]
    fn sides_that_make_no_whole_tiles_and_those_that_cannot_change_stay() {
        let mut odd = mapped(0, 0, 304);
        odd.smallest = 64;
        let never = Mapped { change: Change::Never, ..mapped(1, 0, 256) };
        let at_once = Mapped { change: Change::AtOnce, ..mapped(2, 0, 512) };
        let mut room =
            Room::new(NEED.bytes(304) + NEED.bytes(256) + NEED.bytes(512), vec![odd, never, at_once]);
        let steps = room.give_way(u64::MAX, u32::MAX);
        // 304 is 19 tiles, of which 152 texels would be 9 and a half.
        assert_eq!(sides(&steps), [(2, 64)]);
        assert_eq!(room.bytes(), NEED.bytes(512) - NEED.bytes(64));
    }

    #[test]
    fn who_is_hit_grows_where_there_is_room_or_idle_ones_can_give_it() {
        let grows =
            |budget: u64, all: Vec<Mapped>, idle_until| sides(&Room::new(budget, all).grow(idle_until));
        let small = |order, last_tick| Mapped { wish: 256, ..mapped(order, last_tick, 128) };
        let more = NEED.bytes(256) - NEED.bytes(128);
        let two = 2 * NEED.bytes(128);
        // Neither if it is not hit, nor if there is no room.
        assert!(grows(two + more, vec![small(0, 10), small(1, 0)], Some(10)).is_empty());
        assert!(grows(two + more - 1, vec![small(0, 20), small(1, 20)], Some(10)).is_empty());
        assert_eq!(grows(two + more, vec![small(0, 20), small(1, 20)], Some(10)), [(0, 256)]);
        assert_eq!(grows(two + more, vec![small(0, 3)], None), [(0, 256)]);
        // The coarsest of them.
        let coarse = Mapped { texel_mm2: 2.0, ..small(1, 20) };
        assert_eq!(grows(two + more, vec![small(0, 20), coarse], Some(10)), [(1, 256)]);
        // Who has given way before comes first.
        let gave = Mapped { granted: 256, ..small(2, 20) };
        assert_eq!(grows(3 * NEED.bytes(128) + more, vec![small(0, 20), coarse, gave], Some(10)), [(2, 256)]);
        // An idle one gives way, and the other waits for that.
        let idle = mapped(3, 10, 512);
        let full = NEED.bytes(512) + NEED.bytes(128);
        assert_eq!(grows(full, vec![small(0, 20), idle], Some(10)), [(3, 256)]);
        // Nobody does where it would be in vain.
        let large = Mapped { wish: 2048, ..mapped(4, 20, 1024) };
        assert!(grows(NEED.bytes(1024) + NEED.bytes(512), vec![large, idle], Some(10)).is_empty());
        // Nobody finer than the coarsest gets what that one waits for.
        let coarse = Mapped { texel_mm2: 2.0, ..large };
        let budget = NEED.bytes(1024) + NEED.bytes(128) + more;
        assert!(grows(budget, vec![coarse, small(0, 20)], Some(10)).is_empty());
    }

    #[test]
    fn what_grows_is_charged_at_once_and_what_shrinks_until_it_has() {
        let grows = Mapped { target: Some(256), ..mapped(0, 1, 128) };
        let shrinks = Mapped { target: Some(64), ..mapped(1, 1, 128) };
        let mut room = Room::new(NEED.bytes(256) + NEED.bytes(128), vec![grows, shrinks]);
        assert!(room.has(0) && !room.has(1));
        // The larger one can be halved again, but not before it is there; until then nobody has to lose its maps.
        let coming = NEED.bytes(128) - NEED.bytes(64) + NEED.bytes(256) - NEED.bytes(64);
        assert!(room.will_have(coming) && !room.will_have(coming + 1));
        assert!(room.give_way(coming, u32::MAX).is_empty());
    }
}
