//! The integral of what evaporates, one number for all texels.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Demand, Weather};
use crate::clock::WeatheringClock;

/// How much could have evaporated from the start until any tick: linear between the points at which the weather changed.
///
/// It only grows, and its past does not change when the weather does; so a texel's drying can be asked for at any time, in
/// any order.
#[derive(Resource, Debug, Clone, PartialEq)]
pub struct DryingClock {
    /// Never empty, in order of their ticks.
    points: Vec<DryingPoint>,
    /// What the last point was made from.
    weather: Option<Weather>,
}

/// From a tick on, a constant rate.
#[derive(Serialize, Deserialize, Debug, Clone, Copy, PartialEq, Default)]
pub struct DryingPoint {
    /// When.
    pub tick: u32,
    /// Until then, mm.
    pub total: Demand,
    /// From then on, mm a tick.
    pub per_tick: Demand,
}

impl Default for DryingClock {
    fn default() -> Self {
        Self { points: vec![DryingPoint::default()], weather: None }
    }
}

impl DryingClock {
    /// The most points: more are thinned out, the past first.
    pub const MAX_POINTS: usize = 1024;

    /// What could have evaporated until a tick, mm.
    pub fn until(&self, tick: u32) -> Demand {
        // The last one is what most ask for.
        if let Some(last) = self.points.last()
            && last.tick <= tick
        {
            return last.until(tick);
        }
        let after = self.points.partition_point(|point| point.tick <= tick);
        self.points[after.saturating_sub(1)].until(tick)
    }

    /// Where the rate changed, in order.
    pub fn points(&self) -> &[DryingPoint] {
        &self.points
    }

    /// A clock with these points; `None` if there are none, or they are out of order, or not finite.
    pub fn from_points(points: Vec<DryingPoint>) -> Option<Self> {
        let sound = |point: &DryingPoint| {
            [point.total, point.per_tick].iter().all(|d| d.air_mm.is_finite() && d.sun_mm.is_finite())
        };
        let ordered = points.windows(2).all(|pair| pair[0].tick < pair[1].tick);
        (ordered && !points.is_empty() && points.iter().all(sound)).then_some(Self { points, weather: None })
    }

    /// The rate is that of this weather from `tick` on. A change within a second of the last one waits, so that weather
    /// that changes all the time does not fill the memory: returns whether it was taken.
    pub fn change(&mut self, weather: &Weather, tick: u32, hz: u32) -> bool {
        let hourly = weather.demand_mm_per_h();
        let ticks = 3600.0 * f64::from(hz);
        // Nonsense would stay in the sums for ever.
        let sound = |rate: f64| if rate.is_finite() { rate / ticks } else { 0.0 };
        let per_tick = Demand { air_mm: sound(hourly.air_mm), sun_mm: sound(hourly.sun_mm) };
        let point = DryingPoint { tick, total: self.until(tick), per_tick };
        let count = self.points.len();
        match self.points.last_mut() {
            Some(last) if last.per_tick == per_tick => {}
            Some(last) if last.tick == tick => *last = point,
            // Before the last change, too, if somebody has set the clock back: its past stays what it was.
            Some(last) if tick < last.tick || (count > 1 && tick - last.tick < hz) => return false,
            _ => self.points.push(point),
        }
        if self.points.len() > Self::MAX_POINTS {
            self.thin_out();
        }
        true
    }

    /// Drops every second point of the older half. What was true at the points that stay is still true.
    fn thin_out(&mut self) {
        let half = self.points.len() / 2;
        let mut number = 0;
        self.points.retain(|_| {
            number += 1;
            number > half || number % 2 == 1
        });
        for i in 1..self.points.len() {
            let (before, next) = (self.points[i - 1], self.points[i]);
            let ticks = f64::from(next.tick - before.tick);
            let amount = next.total - before.total;
            self.points[i - 1].per_tick =
                Demand { air_mm: amount.air_mm / ticks, sun_mm: amount.sun_mm / ticks };
        }
    }
}

impl DryingPoint {
    fn until(&self, tick: u32) -> Demand {
        let ticks = f64::from(tick.saturating_sub(self.tick));
        Demand {
            air_mm: self.total.air_mm + self.per_tick.air_mm * ticks,
            sun_mm: self.total.sun_mm + self.per_tick.sun_mm * ticks,
        }
    }
}

/// Follows the [`Weather`].
pub fn advance_drying_clock(
    clock: Res<WeatheringClock>,
    weather: Res<Weather>,
    mut drying: ResMut<DryingClock>,
) {
    if drying.weather == Some(*weather) {
        return;
    }
    // What has passed before this tick had the old weather.
    if drying.change(&weather, clock.tick().saturating_sub(1), clock.hz()) {
        drying.weather = Some(*weather);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weather(drying_speed: f32) -> Weather {
        Weather { drying_speed, sun_w_per_m2: 500.0, ..default() }
    }

    #[test]
    fn an_hour_of_weather_is_its_hourly_rate_and_the_past_stays() {
        let mut clock = DryingClock::default();
        assert!(clock.change(&weather(1.0), 0, 10));
        let hourly = weather(1.0).demand_mm_per_h();
        let hour = clock.until(36_000);
        assert!((hour.air_mm - hourly.air_mm).abs() < 1e-12 && (hour.sun_mm - hourly.sun_mm).abs() < 1e-12);
        assert!(clock.change(&weather(3.0), 36_000, 10));
        assert_eq!(clock.until(36_000), hour);
        assert_eq!(clock.until(18_000).air_mm, hour.air_mm / 2.0);
        assert!((clock.until(72_000).air_mm - 4.0 * hourly.air_mm).abs() < 1e-12);
    }

    #[test]
    fn weather_that_changes_after_the_clock_was_set_back_waits_and_spoils_nothing() {
        let mut clock = DryingClock::default();
        assert!(clock.change(&weather(1.0), 0, 60) && clock.change(&weather(2.0), 600, 60));
        assert!(!clock.change(&weather(3.0), 10, 60));
        assert!(DryingClock::from_points(clock.points().to_vec()).is_some());
        assert!(clock.change(&weather(3.0), 700, 60));
    }

    #[test]
    fn nonsense_dries_nothing_and_does_not_stay() {
        let mut clock = DryingClock::default();
        assert!(clock.change(&Weather { wind: Vec3::ZERO.normalize() * 3.0, ..weather(1.0) }, 0, 10));
        assert!(clock.change(&weather(1.0), 36_000, 10));
        let hourly = weather(1.0).demand_mm_per_h();
        assert!((clock.until(72_000).air_mm - hourly.air_mm).abs() < 1e-9, "{:?}", clock.until(72_000));
    }

    #[test]
    fn weather_that_changes_all_the_time_is_followed_by_the_second_and_thinned() {
        let mut clock = DryingClock::default();
        clock.change(&weather(1.0), 0, 4);
        assert!(clock.change(&weather(1.5), 1, 4));
        assert!(!clock.change(&weather(2.0), 2, 4));
        let mut exact = vec![];
        for second in 2..3000 {
            exact.push((second * 4, clock.until(second * 4)));
            assert!(clock.change(&weather(1.0 + (second % 7) as f32), second * 4, 4));
        }
        assert!(clock.points().len() <= DryingClock::MAX_POINTS);
        assert!(DryingClock::from_points(clock.points().to_vec()).is_some());
        let total = clock.until(12_000).air_mm;
        for (tick, demand) in exact {
            // A thinned clock is straight between points that are some seconds apart.
            assert!((clock.until(tick).air_mm - demand.air_mm).abs() < total * 0.02, "{tick}");
        }
    }
}
