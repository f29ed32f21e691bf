//! Taking brush strokes back, and emitters that were added or removed.
//!
//! Before a stroke first touches a surface, what it holds is kept. Taking the stroke back puts that there again, whatever has
//! happened on the surface since. What is oldest is forgotten when all together takes too much room.

use std::collections::VecDeque;

use bevy::prelude::*;
use bevy_weathering::brush::BrushQueue;
use bevy_weathering::clock::WeatheringClock;
use bevy_weathering::matter::SurfaceMatter;
use bevy_weathering::record::Recording;
use bevy_weathering::wetting::SurfaceWater;

use super::added::Done;
use super::record;
use super::shortcuts::Shortcuts;
use super::ui::Note;

/// Bytes of all that is kept.
const ROOM: usize = 256 << 20;
/// Bytes that an emitter counts for.
const EMITTER: usize = 1 << 10;

/// Things that may be taken back, the last one first, and how large they are.
struct Stack<T> {
    entries: VecDeque<(usize, T)>,
    bytes: usize,
    room: usize,
}

impl<T> Stack<T> {
    fn new(room: usize) -> Self {
        Self { entries: VecDeque::new(), bytes: 0, room }
    }

    /// Adds one, and forgets the oldest as far as there is no room; but never the last one.
    fn push(&mut self, bytes: usize, entry: T) {
        self.entries.push_back((bytes, entry));
        self.bytes += bytes;
        while self.bytes > self.room && self.entries.len() > 1 {
            if let Some((bytes, _)) = self.entries.pop_front() {
                self.bytes -= bytes;
            }
        }
    }

    fn pop(&mut self) -> Option<T> {
        let (bytes, entry) = self.entries.pop_back()?;
        self.bytes -= bytes;
        Some(entry)
    }

    fn clear(&mut self) {
        self.entries.clear();
        self.bytes = 0;
    }
}

/// A surface before a stroke.
struct Before {
    surface: Entity,
    water: SurfaceWater,
    matter: SurfaceMatter,
}

/// Something that may be taken back.
enum Step {
    Stroke(Vec<Before>),
    Emitter(Done),
}

/// What may be taken back, and the stroke that is being painted.
#[derive(Resource)]
pub struct Undo {
    steps: Stack<Step>,
    current: Vec<Before>,
}

impl Default for Undo {
    fn default() -> Self {
        Self { steps: Stack::new(ROOM), current: Vec::new() }
    }
}

impl Undo {
    /// Keeps what a surface holds, if this stroke has not touched it yet.
    pub fn keep(&mut self, surface: Entity, water: &SurfaceWater, matter: &SurfaceMatter) {
        if self.current.iter().all(|before| before.surface != surface) {
            self.current.push(Before { surface, water: water.clone(), matter: matter.clone() });
        }
    }

    /// The stroke is over.
    pub fn end_stroke(&mut self) {
        if !self.current.is_empty() {
            let stroke = std::mem::take(&mut self.current);
            let bytes = stroke.iter().map(|before| before.water.bytes() + before.matter.bytes()).sum();
            self.steps.push(bytes, Step::Stroke(stroke));
        }
    }

    /// Keeps what was done to an emitter.
    pub fn keep_emitter(&mut self, done: Done) {
        self.end_stroke();
        self.steps.push(EMITTER, Step::Emitter(done));
    }

    /// Nothing of what was done is there any more.
    pub fn clear(&mut self) {
        self.steps.clear();
        self.current.clear();
    }

    /// How much may be taken back: strokes and emitters.
    pub fn count(&self) -> usize {
        self.steps.entries.len()
    }
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Undo>()
        .add_systems(Update, press)
        // Before anything new is painted on what begins anew.
        .add_systems(PreUpdate, forget);
}

fn press(keys: Res<Shortcuts>, mut commands: Commands) {
    if keys.with_control(KeyCode::KeyZ) {
        commands.queue(undo);
    }
}

/// Takes back what was done last. While a session is recorded, the last stroke, by running it again without the stroke.
pub fn undo(world: &mut World) {
    if world.contains_resource::<Recording>() {
        record::take_back_stroke(world);
        return;
    }
    let mut undo = world.resource_mut::<Undo>();
    undo.end_stroke();
    let last = undo.steps.pop();
    let told = match last {
        Some(Step::Stroke(stroke)) => put_back(world, &stroke),
        Some(Step::Emitter(done)) => done.take_back(world),
        None => "nothing to take back",
    };
    world.resource_mut::<Note>().tell(told);
}

/// Surfaces as they were before a stroke.
fn put_back(world: &mut World, stroke: &[Before]) -> &'static str {
    // Its last touches may still wait for a tick.
    world.resource_mut::<BrushQueue>().0.clear();
    let mut surfaces = world.query::<(&mut SurfaceWater, &mut SurfaceMatter)>();
    for Before { surface, water, matter } in stroke {
        if let Ok((mut there, mut beside)) = surfaces.get_mut(world, *surface) {
            there.put_back(&mut beside, water, matter);
        }
    }
    "took a stroke back"
}

/// What was painted before the scene began anew is no more.
fn forget(clock: Res<WeatheringClock>, mut undo: ResMut<Undo>, mut last: Local<u32>) {
    if clock.tick() < *last {
        undo.clear();
    }
    *last = clock.tick();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_comes_back_first_and_the_oldest_are_forgotten() {
        let mut stack = Stack::new(100);
        for (bytes, name) in [(40, "a"), (40, "b"), (40, "c")] {
            stack.push(bytes, name);
        }
        assert_eq!((stack.pop(), stack.pop(), stack.pop()), (Some("c"), Some("b"), None));
        assert_eq!(stack.bytes, 0);
        // However large it is, the last one can be taken back.
        stack.push(10, "d");
        stack.push(1000, "e");
        assert_eq!((stack.pop(), stack.pop()), (Some("e"), None));
        stack.push(10, "f");
        stack.clear();
        assert_eq!((stack.pop(), stack.bytes), (None, 0));
    }
}
