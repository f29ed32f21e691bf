//! The parts of the window that cameras draw: what panels leave of it, so that what is looked at is in the middle of that; in a
//! comparison the two sides of the divider. In pictures without panels, all of it; also between those of a sequence, or the scene
//! would jump.

use bevy::camera::{CameraUpdateSystems, Viewport};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;

use super::camera::View;
use super::settings::Settings;
use super::shots::{Sequence, TakeSystems};
use super::split::{SecondCamera, Split};
use super::ui::{UiCamera, UiInput};

pub fn plugin(app: &mut App) {
    // Pictures may have other parts than the window has, and a camera draws what fits its part.
    app.add_systems(PostUpdate, share_out.after(TakeSystems).before(CameraUpdateSystems));
}

/// Gives each camera its part.
fn share_out(
    split: Option<Res<Split>>,
    input: Res<UiInput>,
    (sequence, settings): (Res<Sequence>, Res<Settings>),
    panels: Query<&Camera, (With<UiCamera>, Without<View>, Without<SecondCamera>)>,
    window: Query<&Window, With<PrimaryWindow>>,
    mut first: Query<&mut Camera, (With<View>, Without<SecondCamera>)>,
    mut second: Query<&mut Camera, With<SecondCamera>>,
) {
    let Ok(window) = window.single() else { return };
    let has_panels = !sequence.fills(&settings) && panels.iter().any(|camera| camera.is_active);
    let free = input.free.filter(|_| has_panels);
    let all = area(window.physical_size(), free);
    let [left, right] = split.map_or([all; 2], |split| halves(all, split.at));
    for mut camera in &mut first {
        give(&mut camera, left);
    }
    for mut camera in &mut second {
        give(&mut camera, right);
    }
}

fn give(camera: &mut Mut<Camera>, part: URect) {
    let is_there = camera
        .viewport
        .as_ref()
        .is_some_and(|there| (there.physical_position, there.physical_size) == (part.min, part.size()));
    if !is_there {
        let viewport = Viewport { physical_position: part.min, physical_size: part.size(), ..default() };
        camera.viewport = Some(viewport);
    }
}

/// The pixels of a window that panels leave free; all of them, if they leave none. At least two beside each other.
fn area(size: UVec2, free: Option<Rect>) -> URect {
    let whole = URect::from_corners(UVec2::ZERO, size.max(UVec2::new(2, 1)));
    let free = free.map(|free| free.as_urect().intersect(whole));
    free.filter(|free| free.width() >= 2 && free.height() >= 1).unwrap_or(whole)
}

/// Left and right of a divider; neither is empty, and together they are the area.
fn halves(area: URect, at: f32) -> [URect; 2] {
    let width = area.width().max(2);
    let middle = area.min.x + ((width as f32 * at) as u32).clamp(1, width - 1);
    [
        URect { max: UVec2::new(middle, area.max.y), ..area },
        URect { min: UVec2::new(middle, area.min.y), ..area },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: Rect = Rect { min: Vec2::new(340.0, 30.0), max: Vec2::new(1000.0, 550.0) };

    #[test]
    fn the_two_halves_are_what_panels_leave() {
        for (size, free, at) in [
            ((1280, 720), None, 0.5),
            ((1281, 720), Some(FREE), 0.3),
            ((3, 1), None, 0.9),
            ((0, 0), None, 0.1),
            // Panels of a window that has become small since, and panels that leave nothing.
            ((900, 400), Some(FREE), 0.5),
            ((320, 200), Some(FREE), 0.5),
            ((1280, 720), Some(Rect::new(340.0, 30.0, 340.0, 720.0)), 0.5),
        ] {
            let size = UVec2::from(size);
            let area = area(size, free);
            assert!(area.max.cmple(size.max(UVec2::new(2, 1))).all(), "{area:?}");
            let [left, right] = halves(area, at);
            assert_eq!((left.min, right.max), (area.min, area.max));
            assert_eq!((left.max.x, left.max.y), (right.min.x, area.max.y));
            assert!(left.size().min_element() > 0 && right.size().min_element() > 0);
        }
        assert_eq!(area(UVec2::new(1280, 720), Some(FREE)), URect::new(340, 30, 1000, 550));
    }

    #[test]
    fn a_scene_alone_has_all_that_panels_leave_and_pictures_without_them_the_window() {
        let mut world = World::new();
        world.insert_resource(UiInput { free: Some(FREE), ..default() });
        world.init_resource::<Sequence>();
        world.init_resource::<Settings>();
        let mut window = Window::default();
        window.resolution.set_physical_resolution(1280, 720);
        world.spawn((window, PrimaryWindow));
        let panels = world.spawn((UiCamera, Camera::default())).id();
        let camera = world.spawn((View::new(Vec3::ONE, Vec3::ZERO), Camera::default())).id();
        let mut part = |shows_panels: bool, sequence: Sequence| {
            world.insert_resource(sequence);
            world.get_mut::<Camera>(panels).unwrap().is_active = shows_panels;
            world.run_system_cached(share_out).unwrap();
            let viewport = world.get::<Camera>(camera).unwrap().viewport.clone().unwrap();
            URect::from_corners(
                viewport.physical_position,
                viewport.physical_position + viewport.physical_size,
            )
        };
        let whole = URect::new(0, 0, 1280, 720);
        assert_eq!([true, false].map(|shown| part(shown, default())), [FREE.as_urect(), whole]);
        assert_eq!([true, false].map(|shown| part(shown, Sequence::into_folder("pictures"))), [whole; 2]);
    }
}
