//! The camera: it turns around a point, or flies. Right button turns, middle button moves, the wheel comes closer.
//!
//! Both ways share one state: an eye looks at a target from a distance. What differs is which of them stays where it is.

use bevy::input::mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy_weathering::collision::CollisionScene;
use bevy_weathering::scenario::ScenarioCamera;

use super::settings::Settings;
use super::shortcuts::Shortcuts;
use super::split::{self, Split};
use super::ui::{UiInput, keyboard_is_free};

/// Radians per pixel.
const TURN: f32 = 0.005;
/// Part of the distance per pixel.
const MOVE: f32 = 0.0015;
/// Part of the distance per notch.
const ZOOM: f32 = 0.1;
/// Part of the distance a second, in flight.
const FLY: f32 = 0.8;

/// Where the scene is seen from.
#[derive(Component, Debug, Clone, Copy, PartialEq)]
pub struct View {
    target: Vec3,
    distance: f32,
    yaw: f32,
    pitch: f32,
}

impl View {
    /// From an eye at a target.
    pub fn new(eye: Vec3, target: Vec3) -> Self {
        let offset = eye - target;
        let distance = offset.length().max(0.01);
        let pitch = (offset.y / distance).clamp(-1.0, 1.0).asin();
        Self { target, distance, yaw: offset.x.atan2(offset.z), pitch }
    }

    /// The eye, and what it looks at.
    pub fn line(&self) -> (Vec3, Vec3) {
        (self.eye(), self.target)
    }

    fn rotation(&self) -> Quat {
        Quat::from_euler(EulerRot::YXZ, self.yaw, -self.pitch, 0.0)
    }

    fn eye(&self) -> Vec3 {
        self.target + self.rotation() * (Vec3::Z * self.distance)
    }

    fn transform(&self) -> Transform {
        Transform { translation: self.eye(), rotation: self.rotation(), ..default() }
    }

    fn turn(&mut self, pixels: Vec2) {
        self.yaw -= pixels.x * TURN;
        self.pitch = (self.pitch + pixels.y * TURN).clamp(-1.5, 1.5);
    }

    /// Turns around the target.
    fn orbit(&mut self, pixels: Vec2) {
        self.turn(pixels);
    }

    /// Turns around the eye.
    fn look(&mut self, pixels: Vec2) {
        let eye = self.eye();
        self.turn(pixels);
        self.target = eye - self.rotation() * (Vec3::Z * self.distance);
    }

    /// Moves across the line of sight.
    fn pan(&mut self, pixels: Vec2) {
        let across = Vec3::new(-pixels.x, pixels.y, 0.0) * (self.distance * MOVE);
        self.target += self.rotation() * across;
    }

    /// Moves along its own axes: right, up, back.
    fn fly(&mut self, metres: Vec3) {
        self.target += self.rotation() * metres;
    }

    /// Comes closer by so many notches.
    fn zoom(&mut self, notches: f32) {
        self.distance = (self.distance * (1.0 - notches.clamp(-5.0, 5.0) * ZOOM)).clamp(0.05, 2000.0);
    }

    /// Sees a box, from where it looks from; `fov`: the smaller one of height and width, radians.
    fn frame(&mut self, (low, high): (Vec3, Vec3), fov: f32) {
        let radius = ((high - low).length() * 0.5).max(0.01);
        self.target = (low + high) * 0.5;
        self.distance = (radius / (fov * 0.5).sin().max(0.05)).clamp(0.05, 2000.0);
    }
}

pub fn plugin(app: &mut App) {
    app.add_systems(PreUpdate, take_over)
        .add_systems(Update, (steer, fly.run_if(keyboard_is_free), frame_scene, place).chain());
}

/// Begins where the scenario's camera begins, and is free from then on.
fn take_over(mut commands: Commands, cameras: Query<(Entity, &ScenarioCamera), Added<ScenarioCamera>>) {
    for (entity, camera) in &cameras {
        if let Some(key) = camera.keys.first() {
            let view = View::new(key.eye, key.target);
            commands.entity(entity).remove::<ScenarioCamera>().insert((view, view.transform()));
        }
    }
}

fn steer(
    buttons: Res<ButtonInput<MouseButton>>,
    motion: Res<AccumulatedMouseMotion>,
    scroll: Res<AccumulatedMouseScroll>,
    input: Res<UiInput>,
    settings: Res<Settings>,
    mut views: Query<&mut View>,
    mut steers: Local<bool>,
) {
    let both = [MouseButton::Right, MouseButton::Middle];
    // What begins in the scene may go on over a panel, and the other way round.
    if buttons.any_just_pressed(both) {
        *steers = !input.pointer;
    }
    *steers &= buttons.any_pressed(both);
    for mut view in &mut views {
        if *steers && motion.delta != Vec2::ZERO {
            match (buttons.pressed(MouseButton::Right), settings.flies) {
                (true, false) => view.orbit(motion.delta),
                (true, true) => view.look(motion.delta),
                (false, _) => view.pan(motion.delta),
            }
        }
        if !input.pointer && scroll.delta.y != 0.0 {
            view.zoom(notches(&scroll));
        }
    }
}

/// Touchpads tell pixels, wheels lines.
fn notches(scroll: &AccumulatedMouseScroll) -> f32 {
    match scroll.unit {
        MouseScrollUnit::Line => scroll.delta.y,
        MouseScrollUnit::Pixel => scroll.delta.y / MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR,
    }
}

/// Keys move it, in either mode.
fn fly(
    shortcuts: Res<Shortcuts>,
    keys: Res<ButtonInput<KeyCode>>,
    time: Res<Time<Real>>,
    mut views: Query<&mut View>,
) {
    let axis = |plus, minus| f32::from(shortcuts.is_held(plus)) - f32::from(shortcuts.is_held(minus));
    let way = Vec3::new(
        axis(KeyCode::KeyD, KeyCode::KeyA),
        axis(KeyCode::KeyE, KeyCode::KeyQ),
        axis(KeyCode::KeyS, KeyCode::KeyW),
    );
    // Ctrl and a letter mean something else.
    if way == Vec3::ZERO || keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]) {
        return;
    }
    let faster = if keys.any_pressed([KeyCode::ShiftLeft, KeyCode::ShiftRight]) { 4.0 } else { 1.0 };
    for mut view in &mut views {
        let metres = view.distance * FLY * faster * time.delta_secs().min(0.1);
        view.fly(way.normalize() * metres);
    }
}

/// F looks at all of it.
fn frame_scene(
    keys: Res<Shortcuts>,
    scene: Res<CollisionScene>,
    split: Option<Res<Split>>,
    mut views: Query<(&mut View, &Projection)>,
) {
    if !keys.pressed(KeyCode::KeyF) || scene.is_empty() {
        return;
    }
    for (mut view, projection) in &mut views {
        view.frame(split::bounds(split.as_deref(), &scene), field_of_view(projection));
    }
}

/// Of height or width, whichever sees less; radians.
fn field_of_view(projection: &Projection) -> f32 {
    let usual = PerspectiveProjection::default();
    let of = if let Projection::Perspective(perspective) = projection { perspective } else { &usual };
    2.0 * ((of.fov * 0.5).tan() * of.aspect_ratio.min(1.0)).atan()
}

fn place(mut views: Query<(&View, &mut Transform), Changed<View>>) {
    for (view, mut transform) in &mut views {
        transform.set_if_neq(view.transform());
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::DVec2;
    use bevy::window::PrimaryWindow;

    use super::super::ui::judge_pointer;
    use super::*;

    const EYE: Vec3 = Vec3::new(3.0, 2.0, -4.0);
    const TARGET: Vec3 = Vec3::new(0.5, 0.5, 0.0);

    fn is_near(one: Vec3, other: Vec3) -> bool {
        (one - other).length() < 1e-4
    }

    #[test]
    fn the_view_begins_where_it_is_told() {
        let transform = View::new(EYE, TARGET).transform();
        assert!(is_near(transform.translation, EYE));
        assert!(transform.forward().dot((TARGET - EYE).normalize()) > 0.9999);
        // From a point at itself is somewhere.
        assert!(View::new(EYE, EYE).transform().translation.is_finite());
    }

    #[test]
    fn orbiting_keeps_the_target_and_looking_keeps_the_eye() {
        let mut view = View::new(EYE, TARGET);
        view.orbit(Vec2::new(120.0, -45.0));
        assert!(is_near(view.target, TARGET) && !is_near(view.eye(), EYE));
        assert!(((view.eye() - TARGET).length() - (EYE - TARGET).length()).abs() < 1e-4);
        let mut view = View::new(EYE, TARGET);
        view.look(Vec2::new(120.0, -45.0));
        assert!(is_near(view.eye(), EYE) && !is_near(view.target, TARGET));
    }

    #[test]
    fn flight_goes_where_it_looks_and_panning_does_not() {
        let mut view = View::new(EYE, TARGET);
        view.fly(Vec3::NEG_Z * 2.0);
        assert!(is_near(view.eye(), EYE + (TARGET - EYE).normalize() * 2.0));
        let mut view = View::new(EYE, TARGET);
        view.pan(Vec2::new(30.0, 20.0));
        assert!((view.target - TARGET).dot(EYE - TARGET).abs() < 1e-3);
    }

    #[test]
    fn what_is_framed_fits() {
        let mut view = View::new(EYE, TARGET);
        let (low, high) = (Vec3::new(-2.0, 0.0, -1.0), Vec3::new(4.0, 3.0, 1.0));
        let lens = PerspectiveProjection { fov: 40.0f32.to_radians(), aspect_ratio: 0.6, ..default() };
        let up = (lens.fov * 0.5).tan();
        view.frame((low, high), field_of_view(&Projection::Perspective(lens)));
        let world_from_view = view.transform();
        for corner in 0..8u32 {
            let pick = |axis: u32, low: f32, high: f32| if corner >> axis & 1 == 0 { low } else { high };
            let point = Vec3::new(pick(0, low.x, high.x), pick(1, low.y, high.y), pick(2, low.z, high.z));
            let seen = world_from_view.compute_affine().inverse().transform_point3(point);
            let [across, high] = [seen.x, seen.y].map(|of| of.abs() / -seen.z);
            assert!(seen.z < 0.0 && high <= up + 1e-3 && across <= 0.6 * up + 1e-3, "{seen}");
        }
    }

    #[test]
    fn a_touchpad_is_no_faster_than_a_wheel() {
        let scroll = |unit, pixels| notches(&AccumulatedMouseScroll { unit, delta: Vec2::Y * pixels });
        assert_eq!(scroll(MouseScrollUnit::Line, 2.0), 2.0);
        assert_eq!(scroll(MouseScrollUnit::Pixel, 50.0), 0.5);
    }

    #[test]
    fn the_wheel_and_the_buttons_are_the_scenes_where_the_mouse_is_now() {
        let mut world = World::new();
        world.init_resource::<Settings>();
        // Panels at the left, and a window in front of the scene.
        let free = Some(Rect::new(300.0, 0.0, 960.0, 540.0));
        let fronts = vec![Rect::new(500.0, 0.0, 600.0, 540.0)];
        world.insert_resource(UiInput { free, fronts, ..default() });
        let mut window = Window::default();
        window.resolution.set_physical_resolution(960, 540);
        let window = world.spawn((window, PrimaryWindow)).id();
        let view = world.spawn(View::new(EYE, TARGET)).id();
        let mut schedule = Schedule::default();
        schedule.add_systems((judge_pointer, steer).chain());
        let mut moves = |x: f64, is_wheel: bool| {
            let at = Some(DVec2::new(x, 100.0));
            world.get_mut::<Window>(window).unwrap().set_physical_cursor_position(at);
            let mut buttons = ButtonInput::<MouseButton>::default();
            let (mut scrolled, mut moved) = (Vec2::Y, Vec2::ZERO);
            if !is_wheel {
                buttons.press(MouseButton::Right);
                (scrolled, moved) = (Vec2::ZERO, Vec2::X * 10.0);
            }
            world.insert_resource(buttons);
            world.insert_resource(AccumulatedMouseScroll { unit: MouseScrollUnit::Line, delta: scrolled });
            world.insert_resource(AccumulatedMouseMotion { delta: moved });
            let before = *world.get::<View>(view).unwrap();
            schedule.run(&mut world);
            *world.get::<View>(view).unwrap() != before
        };
        for is_wheel in [true, false] {
            let moved = [400.0, 200.0, 700.0, 550.0, 400.0].map(|x| moves(x, is_wheel));
            assert_eq!(moved, [true, false, true, false, true], "wheel: {is_wheel}");
        }
    }

    #[test]
    fn zooming_stays_within_reason() {
        let mut view = View::new(EYE, TARGET);
        (0..500).for_each(|_| view.zoom(5.0));
        assert!(view.distance >= 0.05);
        (0..500).for_each(|_| view.zoom(-5.0));
        assert!(view.distance <= 2000.0);
    }
}
