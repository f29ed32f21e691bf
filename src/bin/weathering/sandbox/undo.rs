//! Taking brush strokes back, and emitters that were added or removed, and doing so again.
//!
//! Before a stroke first touches a surface, what it holds is kept. Taking the stroke back puts that there again, whatever has
//! happened on the surface since, and keeps what was there instead, for the way back. What is oldest is forgotten when all
//! together takes too much room. While a session is recorded, strokes are taken back by running it again (`record`).

use std::collections::VecDeque;

use bevy::prelude::*;
use bevy_weathering::brush::BrushQueue;
use bevy_weathering::record::Recording;
use bevy_weathering::wetting::{KeptSurface, NotPutBack};

use super::added::Done;
use super::shortcuts::Shortcuts;
use super::ui::Note;
use super::{brush, record};

/// Bytes of all that is kept, of what can be taken back and of what can be done again.
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
        self.retain(|_| false);
    }

    /// Forgets all but some.
    fn retain(&mut self, is_kept: impl Fn(&T) -> bool) {
        self.entries.retain(|(_, entry)| is_kept(entry));
        self.bytes = self.entries.iter().map(|(bytes, _)| bytes).sum();
    }

    fn len(&self) -> usize {
        self.entries.len()
    }
}

/// A surface before a stroke, or after it.
struct Before {
    surface: Entity,
    kept: KeptSurface,
}

/// Something that may be taken back, or done again.
enum Step {
    Stroke(Vec<Before>),
    Emitter(Done),
}

impl Step {
    fn bytes(&self) -> usize {
        match self {
            Self::Stroke(stroke) => stroke.iter().map(|before| before.kept.bytes()).sum(),
            Self::Emitter(_) => EMITTER,
        }
    }
}

impl Stack<Step> {
    /// Adds one, if there is one.
    fn keep(&mut self, step: Option<Step>) {
        if let Some(step) = step {
            self.push(step.bytes(), step);
        }
    }
}

/// What may be taken back and done again, and the stroke that is being painted.
#[derive(Resource)]
pub struct Undo {
    steps: Stack<Step>,
    undone: Stack<Step>,
    current: Vec<Before>,
}

impl Default for Undo {
    fn default() -> Self {
        Self { steps: Stack::new(ROOM), undone: Stack::new(ROOM), current: Vec::new() }
    }
}

impl Undo {
    /// Keeps what a surface holds, if this stroke has not touched it yet.
    pub fn keep(&mut self, surface: Entity, kept: impl FnOnce() -> KeptSurface) {
        if self.current.iter().all(|before| before.surface != surface) {
            self.current.push(Before { surface, kept: kept() });
            // It was done on what is painted over now.
            self.undone.clear();
        }
    }

    /// The stroke is over.
    pub fn end_stroke(&mut self) {
        if !self.current.is_empty() {
            let stroke = Step::Stroke(std::mem::take(&mut self.current));
            self.steps.push(stroke.bytes(), stroke);
        }
    }

    /// Keeps what was done to an emitter.
    pub fn keep_emitter(&mut self, done: Done) {
        self.end_stroke();
        self.undone.clear();
        self.steps.push(EMITTER, Step::Emitter(done));
    }

    /// Nothing of what was done is there any more.
    pub fn clear(&mut self) {
        self.steps.clear();
        self.undone.clear();
        self.current.clear();
    }

    /// All surfaces begin anew, and emitters stay as they are. Whether any stroke is gone for good with that.
    pub fn forget_strokes(&mut self) -> bool {
        self.end_stroke();
        let before = self.steps.len() + self.undone.len();
        for stack in [&mut self.steps, &mut self.undone] {
            stack.retain(|step| matches!(step, Step::Emitter(_)));
        }
        self.steps.len() + self.undone.len() < before
    }

    /// How much may be taken back, and how much done again: strokes and emitters.
    pub fn counts(&self) -> [usize; 2] {
        [self.steps.len(), self.undone.len()]
    }
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Undo>().add_systems(Update, press);
}

fn press(keys: Res<Shortcuts>, mut commands: Commands) {
    if keys.with_control_and_shift('z') {
        commands.queue(redo);
    } else if keys.with_control('z') {
        commands.queue(undo);
    }
}

/// Takes back what was done last. While a session is recorded, the last stroke, by running it again without the stroke.
pub fn undo(world: &mut World) {
    // What is painted with the button still held is taken back as it is, and not painted on.
    brush::let_go(world);
    if world.contains_resource::<Recording>() {
        record::take_back_stroke(world);
        return;
    }
    step(world, |Undo { steps, undone, .. }| (steps, undone), ["took a stroke back", "nothing to take back"]);
}

/// Does again what was taken back last, if nothing else was done since.
pub fn redo(world: &mut World) {
    if world.contains_resource::<Recording>() {
        // A stroke that is taken back out of a session has never been.
        return world.resource_mut::<Note>().tell("nothing is done again while a session is recorded");
    }
    step(
        world,
        |Undo { steps, undone, .. }| (undone, steps),
        ["brought a stroke back", "nothing to do again"],
    );
}

/// Makes the last of one stack as it was, for the other to lead back. What is told of a stroke, and of an empty stack.
fn step(
    world: &mut World,
    stacks: fn(&mut Undo) -> (&mut Stack<Step>, &mut Stack<Step>),
    [of_stroke, of_none]: [&str; 2],
) {
    let mut undo = world.resource_mut::<Undo>();
    undo.end_stroke();
    let Some(last) = stacks(&mut undo).0.pop() else {
        return world.resource_mut::<Note>().tell(of_none);
    };
    let (done, later) = exchange(world, last, of_stroke);
    let mut undo = world.resource_mut::<Undo>();
    let (from, to) = stacks(&mut undo);
    to.keep(done);
    from.keep(later);
}

/// Makes it as it was, and tells so. Returns what leads the other way, and what may be done later. `of_stroke`: what is told of a
/// stroke.
fn exchange(world: &mut World, step: Step, of_stroke: &str) -> (Option<Step>, Option<Step>) {
    let stroke = match step {
        Step::Stroke(stroke) => stroke,
        Step::Emitter(done) => {
            let (told, back) = done.take_back(world);
            world.resource_mut::<Note>().tell(told);
            return (back.map(Step::Emitter), None);
        }
    };
    let Exchanged { back, later, wrong } = put_back(world, stroke);
    let mut note = world.resource_mut::<Note>();
    match (wrong.is_empty(), back.is_empty()) {
        (true, _) => note.tell(of_stroke),
        (false, false) => note.complain(format!("{of_stroke}, but not everywhere: {}", wrong.join("; "))),
        (false, true) => note.complain(format!("the stroke stays as it is: {}", wrong.join("; "))),
    }
    let stroke = |surfaces: Vec<Before>| (!surfaces.is_empty()).then_some(Step::Stroke(surfaces));
    (stroke(back), stroke(later))
}

/// What became of the surfaces of a stroke.
#[derive(Default)]
struct Exchanged {
    /// As they have been until now, of those that are as they were.
    back: Vec<Before>,
    /// Those that may be as they were later.
    later: Vec<Before>,
    /// Why others, and these, are not.
    wrong: Vec<String>,
}

/// Surfaces as they were.
fn put_back(world: &mut World, stroke: Vec<Before>) -> Exchanged {
    // Its last touches may still wait for a tick.
    if let Some(mut queue) = world.get_resource_mut::<BrushQueue>() {
        queue.0.clear();
    }
    let mut exchanged = Exchanged::default();
    for Before { surface, kept } in stroke {
        let now = KeptSurface::of(world, surface);
        match kept.put_back(world, surface) {
            Ok(()) => exchanged.back.extend(now.map(|kept| Before { surface, kept })),
            Err(why) => {
                let name = world.get::<Name>(surface).map_or("a surface", Name::as_str);
                exchanged.wrong.push(format!("{name} {why}"));
                // That passes.
                if why == NotPutBack::Measured {
                    exchanged.later.push(Before { surface, kept });
                }
            }
        }
    }
    exchanged
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bevy::math::Affine3A;
    use bevy_weathering::collision::{MeshBvh, MeshTriangles, SurfaceCollider};
    use bevy_weathering::matter::SurfaceMatter;
    use bevy_weathering::overlay::{Unmapped, Wrap};
    use bevy_weathering::wetting::{SurfaceWater, TexelGeometry, WetGeometry};

    use super::*;

    const WRAP: [Wrap; 2] = [Wrap::Clamp; 2];

    fn world() -> World {
        let mut world = World::new();
        world.init_resource::<Undo>();
        world.init_resource::<Note>();
        world.init_resource::<BrushQueue>();
        world
    }

    /// A dry plate.
    fn plate(world: &mut World, name: &'static str) -> Entity {
        let mesh = Mesh::from(Plane3d::new(Vec3::Y, Vec2::ONE));
        let bvh = Arc::new(MeshBvh::build(MeshTriangles::from_mesh(&mesh).unwrap()));
        let geometry = TexelGeometry::new(bvh.triangles(), &Affine3A::IDENTITY, Vec3::Y, 32, WRAP);
        let water = SurfaceWater::of_size(32, WRAP, geometry.mean_mm2());
        let parts = (Name::new(name), SurfaceCollider(bvh), WetGeometry(Arc::new(geometry)));
        world.spawn((parts, water, SurfaceMatter::default())).id()
    }

    /// A stroke over surfaces, after which they are wet.
    fn paint(world: &mut World, surfaces: &[Entity]) {
        for &surface in surfaces {
            let kept = KeptSurface::of(world, surface).unwrap();
            world.resource_mut::<Undo>().keep(surface, || kept);
            let geometry = world.get::<WetGeometry>(surface).unwrap().0.clone();
            world.get_mut::<SurfaceWater>(surface).unwrap().cover(&geometry, 0.1, 0.0, 1);
        }
    }

    fn film(world: &World, surface: Entity) -> u64 {
        let texels = world.get::<SurfaceWater>(surface).unwrap().texels();
        texels.iter().map(|texel| u64::from(texel.film)).sum()
    }

    /// What was told last, and whether it is a complaint.
    fn told(world: &World) -> (String, bool) {
        let (text, is_wrong) = world.resource::<Note>().shown().unwrap();
        (text.to_owned(), is_wrong)
    }

    #[test]
    fn a_stroke_over_several_surfaces_is_taken_back_and_done_again_on_all_of_them() {
        let mut world = world();
        let plates = ["left", "right"].map(|name| plate(&mut world, name));
        let films = |world: &World| plates.map(|plate| film(world, plate));
        paint(&mut world, &plates);
        let once = films(&world);
        assert!(once.iter().all(|&film| film > 0));
        // Still being painted, and yet all that there is to take back.
        undo(&mut world);
        assert_eq!((films(&world), told(&world).1), ([0, 0], false));
        redo(&mut world);
        assert_eq!((films(&world), told(&world).1), (once, false));
        redo(&mut world);
        assert_eq!(told(&world).0, "nothing to do again");

        paint(&mut world, &plates[..1]);
        world.resource_mut::<Undo>().end_stroke();
        assert_eq!(films(&world), [2 * once[0], once[1]]);
        undo(&mut world);
        assert_eq!((films(&world), world.resource::<Undo>().counts()), (once, [1, 1]));
        undo(&mut world);
        assert_eq!((films(&world), world.resource::<Undo>().counts()), ([0, 0], [0, 2]));
        // What is painted now is not below what was taken back.
        paint(&mut world, &plates[1..]);
        assert_eq!(world.resource::<Undo>().counts(), [0, 0]);
    }

    #[test]
    fn where_a_stroke_cannot_be_taken_back_it_is_said_and_not_claimed() {
        let mut world = world();
        let plates = ["left", "right"].map(|name| plate(&mut world, name));
        paint(&mut world, &plates);
        let water = world.entity_mut(plates[0]).take::<SurfaceWater>().unwrap();
        undo(&mut world);
        let (text, is_wrong) = told(&world);
        assert!(is_wrong && text.contains("left is being measured") && !text.contains("right"), "{text}");
        assert_eq!((film(&world, plates[1]), world.resource::<Undo>().counts()), (0, [1, 1]));
        // What could not be done then is done now.
        world.entity_mut(plates[0]).insert(water);
        assert!(film(&world, plates[0]) > 0);
        undo(&mut world);
        assert_eq!((film(&world, plates[0]), told(&world).1), (0, false));
        redo(&mut world);
        redo(&mut world);
        assert!(plates.iter().all(|&plate| film(&world, plate) > 0) && !told(&world).1);
        assert_eq!(world.resource::<Undo>().counts(), [2, 0]);
        // Others needed its room: nothing is there that could be taken back.
        world.entity_mut(plates[0]).remove::<SurfaceWater>();
        world.entity_mut(plates[0]).insert(Unmapped::Evicted);
        undo(&mut world);
        undo(&mut world);
        let texts = told(&world);
        assert_eq!(world.resource::<Undo>().counts(), [0, 1], "{texts:?}");
        assert_eq!(film(&world, plates[1]), 0);
        redo(&mut world);
        assert!(film(&world, plates[1]) > 0 && !told(&world).1);
        world.despawn(plates[1]);
        undo(&mut world);
        let (text, is_wrong) = told(&world);
        assert!(is_wrong && text.contains("is no more") && !text.contains("took"), "{text}");
        assert_eq!(world.resource::<Undo>().counts(), [0, 0]);
    }

    #[test]
    fn strokes_go_with_what_they_were_painted_on_and_emitters_stay() {
        let mut world = world();
        let plates = [plate(&mut world, "left")];
        assert!(!world.resource_mut::<Undo>().forget_strokes());
        paint(&mut world, &plates);
        world.resource_mut::<Undo>().keep_emitter(Done::Added(7));
        paint(&mut world, &plates);
        undo(&mut world);
        assert_eq!(world.resource::<Undo>().counts(), [2, 1]);
        paint(&mut world, &plates);
        // One of them still being painted.
        assert!(world.resource_mut::<Undo>().forget_strokes());
        assert_eq!(world.resource::<Undo>().counts(), [1, 0]);
        let before = film(&world, plates[0]);
        undo(&mut world);
        assert_eq!((told(&world).0.as_str(), film(&world, plates[0])), ("the emitter has gone", before));
        undo(&mut world);
        assert_eq!(told(&world).0, "nothing to take back");
    }

    #[test]
    fn shift_turns_the_key_round() {
        let mut world = world();
        let mut hit = |control: bool, shift: bool| {
            world.insert_resource(Shortcuts::typed('z', control, shift));
            world.insert_resource(Note::default());
            world.run_system_cached(press).unwrap();
            world.resource::<Note>().shown().map(|(text, _)| text.to_owned())
        };
        assert_eq!((hit(false, false), hit(false, true)), (None, None));
        assert_eq!(hit(true, false).as_deref(), Some("nothing to take back"));
        assert_eq!(hit(true, true).as_deref(), Some("nothing to do again"));
    }

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
