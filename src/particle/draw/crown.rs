//! A drop that hits: the crown it throws up, and the jet that follows.
//!
//! A thin sheet rises from the rim of the crater and widens; its edge gathers water and throws out fingers, which break up
//! into droplets. When the sheet has fallen back, the crater closes and a jet stands up in its middle. Radii grow with the
//! time to the power of 0.43 (Cossali et al. 2004, *The role of time in single drop splash on thin film*). Seen a little
//! from above, so that the crown is open.

use std::f32::consts::{PI, TAU};

use bevy::math::Vec2;

use super::sprites::{Texel, random, smoothstep};

/// A moment in the life of a splash.
pub(super) struct Crown {
    /// Radius of the crown at the ground, and at its edge.
    base: f32,
    edge: f32,
    /// Of the sheet above the ground.
    height: f32,
    /// How much of the light the sheet takes where one looks straight through it.
    thin: f32,
    /// What is left to be seen.
    fade: f32,
    /// Edge, fingers, droplets, jet.
    threads: Vec<Thread>,
}

/// Water between two points, round at its ends.
struct Thread {
    from: Vec2,
    to: Vec2,
    radius: f32,
}

/// Where the ground is, on a tile whose lower end is at -1.
const GROUND: f32 = -0.86;
/// Sine and cosine of the angle from which it is seen.
const LOOK_DOWN: f32 = 0.2;
const LOOK_ALONG: f32 = 0.98;
/// Fingers of a crown.
const FINGERS: u32 = 11;

/// A point at a height over the ground, on a circle round the middle.
fn on_circle(angle: f32, radius: f32, height: f32) -> Vec2 {
    let (sin, cos) = angle.sin_cos();
    Vec2::new(radius * sin, GROUND + height * LOOK_ALONG - radius * cos * LOOK_DOWN)
}

impl Crown {
    /// At `time` from 0, the impact, to 1.
    pub(super) fn new(time: f32) -> Self {
        let base = 0.14 + 0.5 * time.powf(0.43);
        let rising = (time / 0.72).min(1.0);
        let height = 0.78 * (PI * rising.powf(0.8)).sin().max(0.0);
        let edge = base * (1.06 + 0.24 * rising);
        let mut crown = Self {
            base,
            edge,
            height,
            thin: 0.24 * (1.0 - 0.6 * time),
            fade: 1.0 - smoothstep(0.8, 1.06, time),
            threads: Vec::new(),
        };
        crown.add_fingers(time);
        crown.add_jet(time);
        crown
    }

    fn add_fingers(&mut self, time: f32) {
        let (edge, height) = (self.edge, self.height);
        let grown = smoothstep(0.0, 0.3, time) * smoothstep(0.85, 0.6, time);
        let mut last = None;
        for i in 0..=4 * FINGERS {
            let angle = TAU * i as f32 / (4 * FINGERS) as f32;
            let point = on_circle(angle, edge, height * crest(angle));
            if let Some(from) = last.replace(point)
                && height > 0.02
            {
                self.threads.push(Thread { from, to: point, radius: 0.018 + 0.012 * time });
            }
        }
        for i in 0..FINGERS {
            let angle = TAU * (i as f32 + 0.6 * (random(i, 31) - 0.5)) / FINGERS as f32;
            let foot = height * crest(angle);
            let long = grown * (0.1 + 0.16 * random(i, 32));
            let (out, up) = (0.45 * long, 0.9 * long);
            if long > 0.02 && height > 0.02 {
                let from = on_circle(angle, edge, foot);
                let to = on_circle(angle, edge + out, foot + up);
                self.threads.push(Thread { from, to, radius: 0.02 });
                self.threads.push(Thread { from: to, to, radius: 0.034 });
            }
            // Droplets that came off a finger fly on, up to where they fall.
            for droplet in 0..2 {
                let born = 0.2 + 0.22 * droplet as f32 + 0.14 * random(i, 33 + droplet);
                let flown = time - born;
                if flown <= 0.0 {
                    continue;
                }
                let radius = edge * (0.9 + 0.1 * random(i, 36 + droplet)) + 0.42 * flown;
                let speed = 1.3 + 0.9 * random(i, 39 + droplet);
                let up = 0.55 + 0.25 * random(i, 42 + droplet) + flown * speed - 3.1 * flown * flown;
                if up > 0.0 {
                    let at = on_circle(angle, radius, up);
                    let radius = 0.016 + 0.02 * random(i, 45 + droplet);
                    self.threads.push(Thread { from: at, to: at, radius });
                }
            }
        }
    }

    /// The jet in the middle, and the drop it lets go.
    fn add_jet(&mut self, time: f32) {
        let part = (time - 0.58) / 0.46;
        if part <= 0.0 {
            return;
        }
        let tall = 0.62 * (PI * part.min(1.0)).sin();
        let foot = Vec2::new(0.0, GROUND);
        let head = foot + Vec2::Y * tall;
        self.threads.push(Thread { from: foot, to: head, radius: 0.05 });
        self.threads.push(Thread { from: head, to: head, radius: 0.075 });
        self.threads.push(Thread { from: foot - Vec2::X * 0.13, to: foot + Vec2::X * 0.13, radius: 0.045 });
        if part > 0.4 {
            let drop = head + Vec2::Y * (0.14 + 0.5 * (part - 0.4));
            self.threads.push(Thread { from: drop, to: drop, radius: 0.06 });
        }
    }

    pub(super) fn at(&self, at: Vec2) -> Texel {
        // Its droplets are to reach the sides of the tile.
        let at = Vec2::new(at.x, at.y + 1.0) / 1.2 - Vec2::Y;
        let mut seen = Seen { clear: 1.0, slope: Vec2::ZERO, shade: 0.0 };
        for thread in &self.threads {
            thread.add(at, &mut seen);
        }
        self.add_sheet(at, -1.0, &mut seen);
        self.add_sheet(at, 1.0, &mut seen);
        let cover = 1.0 - seen.clear;
        if cover < 1e-4 {
            return Texel::NONE;
        }
        Texel { slope: seen.slope / cover, shade: seen.shade / cover, cover: cover * self.fade }
    }

    /// The far (-1) or near (1) half of the sheet: the flatter one looks through it, the more of it there is.
    fn add_sheet(&self, at: Vec2, side: f32, seen: &mut Seen) {
        if self.height < 0.02 {
            return;
        }
        // The radius grows upwards; how high a place is depends on the radius, a little.
        let mut radius = self.base;
        let mut height = 0.0;
        for _ in 0..3 {
            let part = at.x / radius;
            if part.abs() >= 1.0 && radius >= self.edge {
                return;
            }
            let toward = side * radius * (1.0 - part * part).max(0.0).sqrt();
            height = (at.y - GROUND + toward * LOOK_DOWN) / LOOK_ALONG;
            let up = (height / self.height).clamp(0.0, 1.0);
            radius = self.base + (self.edge - self.base) * up * up;
        }
        let part = at.x / radius;
        if part.abs() >= 1.0 || height < 0.0 {
            return;
        }
        let angle = if side > 0.0 { part.asin() } else { PI - part.asin() };
        let top = self.height * crest(angle);
        let steep = 1.0 / (1.0 - part * part + 0.04).sqrt();
        let within = smoothstep(top, top - 0.03, height) * smoothstep(0.0, 0.03, height);
        // Thicker at its foot, where it is fed.
        let thick = 1.0 + 0.9 * smoothstep(0.35 * top, 0.0, height);
        seen.add((self.thin * steep * thick * within).min(0.85), Vec2::new(0.8 * part, 0.15), 0.55);
    }
}

/// How high the edge stands there, against the mean: it dips between fingers.
fn crest(angle: f32) -> f32 {
    0.92 + 0.08 * (angle * FINGERS as f32).cos() + 0.05 * (2.0 * angle + 0.7).sin()
}

/// What a line of sight has met.
struct Seen {
    /// Part of the light that still comes through.
    clear: f32,
    /// Weighed by what was covered.
    slope: Vec2,
    shade: f32,
}

impl Seen {
    fn add(&mut self, cover: f32, slope: Vec2, shade: f32) {
        let new = self.clear * cover;
        self.slope += slope * new;
        self.shade += shade * new;
        self.clear -= new;
    }
}

impl Thread {
    fn add(&self, at: Vec2, seen: &mut Seen) {
        let along = self.to - self.from;
        let part = (at - self.from).dot(along) / along.length_squared().max(1e-12);
        let off = at - (self.from + along * part.clamp(0.0, 1.0));
        let far = off.length();
        let cover = 0.9 * smoothstep(self.radius + 0.01, self.radius - 0.01, far);
        if cover > 0.0 {
            let slope = (off / self.radius).clamp_length_max(1.0);
            // A bead gathers light behind the side that faces it.
            seen.add(cover, slope, 0.5 + 0.2 * (1.0 - slope.length()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Part of the tile that is covered, and how high that reaches.
    fn measure(time: f32) -> (f32, f32) {
        let crown = Crown::new(time);
        let places = (0..2500).map(|i| (Vec2::new((i % 50) as f32, (i / 50) as f32) + 0.5) / 25.0 - 1.0);
        let covered: Vec<(f32, f32)> = places.map(|at| (crown.at(at).cover, at.y)).collect();
        let sum = covered.iter().map(|(cover, _)| cover).sum::<f32>() / covered.len() as f32;
        let top = covered.iter().filter(|(cover, _)| *cover > 0.1).map(|(_, y)| *y).fold(-1.0, f32::max);
        (sum, top)
    }

    #[test]
    fn a_crown_rises_and_falls() {
        let heights = [0.02, 0.06, 0.19, 0.31].map(|time| Crown::new(time).height);
        assert!(heights.is_sorted_by(|a, b| a < b), "{heights:?}");
        assert!(Crown::new(0.75).height < 0.05 && Crown::new(0.35).height > 0.6);
        let (_, low) = measure(0.02);
        let (_, high) = measure(0.4);
        assert!(high > low + 0.5, "{low} {high}");
    }

    #[test]
    fn it_widens_while_it_lives() {
        let radii: Vec<f32> = (0..8).map(|i| Crown::new((i as f32 + 0.5) / 8.0).base).collect();
        assert!(radii.is_sorted_by(|a, b| a < b) && radii[7] < 0.75, "{radii:?}");
    }

    #[test]
    fn nothing_is_left_in_the_end() {
        let (middle, _) = measure(0.45);
        let (end, _) = measure(0.99);
        assert!(end < 0.35 * middle, "{middle} {end}");
    }
}
