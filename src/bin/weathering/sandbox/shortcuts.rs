//! Whose a key is: a panel's, in which a text is being edited, or the sandbox's, for which it is a shortcut.
//!
//! A slow frame brings many events at once; they are read in the order in which they came. Where a mouse button in a panel, or
//! a key that moves on, may have begun or ended an edit, only the panels know whose the keys after it are. Such keys wait until
//! the panels have been drawn, and count for the next frame then, or not at all.

use bevy::input::InputSystems;
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::prelude::*;
use bevy::window::WindowEvent;

use super::keys::asks;
use super::ui::{self, UiInput};

/// Whose the next key is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Owner {
    /// Nothing is being edited.
    Shortcuts,
    /// A text is being edited.
    Field,
    /// The panels will tell.
    Unknown,
}

/// A key that was pressed.
#[derive(Debug, Clone, Copy)]
struct Press {
    /// Where it is on the keyboard.
    code: KeyCode,
    /// The small letter on it, wherever that is.
    letter: Option<char>,
    /// Together with Ctrl.
    control: bool,
    /// Together with Shift.
    shift: bool,
    /// It types a question mark.
    asks: bool,
    /// A field that has it is left.
    ends: bool,
    is_released: bool,
}

#[cfg(test)]
impl Press {
    const NONE: Self = Self {
        code: KeyCode::F35,
        letter: None,
        control: false,
        shift: false,
        asks: false,
        ends: false,
        is_released: false,
    };
}

fn letter_of(key: &KeyboardInput) -> Option<char> {
    let Key::Character(text) = &key.logical_key else { return None };
    let typed = text.chars().next().filter(char::is_ascii);
    // Where letters are not Latin, by its place.
    let placed = || format!("{:?}", key.key_code).strip_prefix("Key")?.chars().next();
    typed.or_else(placed).map(|letter| letter.to_ascii_lowercase())
}

/// Keys that no panel takes.
#[derive(Resource, Default)]
pub struct Shortcuts {
    /// In this frame.
    pressed: Vec<Press>,
    /// Pressed without Ctrl, and not let go of since.
    held: Vec<KeyCode>,
    /// Until it is known whose they are, in their order.
    waiting: Vec<Press>,
    /// Ctrl is held.
    control: bool,
    /// Shift is held.
    shift: bool,
    /// Where the mouse was last, physical pixels.
    at: Option<Vec2>,
}

impl Shortcuts {
    /// Whether a key was pressed, without Ctrl.
    pub fn pressed(&self, code: KeyCode) -> bool {
        self.pressed.iter().any(|press| press.code == code && !press.control)
    }

    /// Whether the key with this small letter was pressed while Ctrl was held, and Shift was not.
    pub fn with_control(&self, letter: char) -> bool {
        self.pressed.iter().any(|press| press.letter == Some(letter) && press.control && !press.shift)
    }

    /// Whether the key with this small letter was pressed while both were held.
    pub fn with_control_and_shift(&self, letter: char) -> bool {
        self.pressed.iter().any(|press| press.letter == Some(letter) && press.control && press.shift)
    }

    /// Whether a key is held that was pressed without Ctrl.
    pub fn is_held(&self, code: KeyCode) -> bool {
        self.held.contains(&code)
    }

    /// Whether a question mark was typed; twice is not at all.
    pub fn is_asked(&self) -> bool {
        self.pressed.iter().filter(|press| press.asks).count() % 2 == 1
    }

    fn act(&mut self, press: Press) {
        if !press.control && !press.is_released && !self.held.contains(&press.code) {
            self.held.push(press.code);
        }
        self.pressed.push(press);
    }

    /// Takes a key, and tells whose the next one is.
    fn hear(&mut self, key: &KeyboardInput, owner: Owner) -> Owner {
        let is_control = key.logical_key == Key::Control;
        if is_control {
            self.control = key.state.is_pressed();
        }
        if key.logical_key == Key::Shift {
            self.shift = key.state.is_pressed();
        }
        if !key.state.is_pressed() {
            self.held.retain(|held| *held != key.key_code);
            let same = self.waiting.iter_mut().filter(|press| press.code == key.key_code);
            same.for_each(|press| press.is_released = true);
            return owner;
        }
        if is_control || key.repeat {
            return owner;
        }
        let ends = matches!(key.logical_key, Key::Enter | Key::Escape | Key::Tab);
        let press = Press {
            code: key.key_code,
            letter: letter_of(key),
            control: self.control,
            shift: self.shift,
            asks: asks(key),
            ends,
            is_released: false,
        };
        match owner {
            Owner::Shortcuts => {
                self.act(press);
                // Into a field, maybe.
                if key.logical_key == Key::Tab { Owner::Unknown } else { owner }
            }
            // In a field of several lines some of them end nothing.
            Owner::Field => {
                if ends {
                    Owner::Unknown
                } else {
                    owner
                }
            }
            Owner::Unknown => {
                self.waiting.push(press);
                owner
            }
        }
    }

    /// The panels have been drawn: keys that have waited are theirs, or count now.
    fn settle(&mut self, input: &UiInput) {
        let mut waiting = std::mem::take(&mut self.waiting);
        let theirs = if input.keyboard {
            waiting.len()
        } else if input.edited {
            // A field that was entered and left again has all up to the key that it was left by.
            waiting.iter().position(|press| press.ends).map_or(waiting.len(), |last| last + 1)
        } else {
            0
        };
        waiting.drain(theirs..).for_each(|press| self.act(press));
    }

    #[cfg(test)]
    pub fn of(code: KeyCode) -> Self {
        let press = Press { code, ..Press::NONE };
        Self { pressed: vec![press], ..default() }
    }

    #[cfg(test)]
    pub fn typed(letter: char, control: bool, shift: bool) -> Self {
        let press = Press { letter: Some(letter), control, shift, ..Press::NONE };
        Self { pressed: vec![press], ..default() }
    }
}

pub fn plugin(app: &mut App) {
    // Whose a press is, is told before tools ask.
    app.init_resource::<Shortcuts>()
        .add_systems(PreUpdate, listen.after(InputSystems).after(ui::judge_pointer));
}

/// Reads what has come since the last frame.
pub fn listen(
    mut events: MessageReader<WindowEvent>,
    windows: Query<&Window>,
    mut input: ResMut<UiInput>,
    mut shortcuts: ResMut<Shortcuts>,
) {
    shortcuts.pressed.clear();
    shortcuts.settle(&input);
    input.edited = false;
    let mut owner = if input.keyboard { Owner::Field } else { Owner::Shortcuts };
    for event in events.read() {
        match event {
            WindowEvent::CursorMoved(moved) => {
                let scale = windows.get(moved.window).map_or(1.0, Window::scale_factor);
                shortcuts.at = Some(moved.position * scale);
            }
            WindowEvent::CursorLeft(_) => shortcuts.at = None,
            WindowEvent::MouseButtonInput(button) => {
                let is_taken = shortcuts.at.map_or(input.popup, |at| input.takes(at));
                if button.button == MouseButton::Left && button.state.is_pressed() {
                    input.took_press = is_taken;
                }
                // A press anywhere else ends an edit.
                if is_taken || owner == Owner::Field {
                    owner = Owner::Unknown;
                }
            }
            WindowEvent::KeyboardInput(key) => owner = shortcuts.hear(key, owner),
            WindowEvent::KeyboardFocusLost(_) => {
                (shortcuts.control, shortcuts.shift) = (false, false);
                shortcuts.held.clear();
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::input::ButtonState;
    use bevy::input::mouse::MouseButtonInput;
    use bevy::window::CursorMoved;

    use super::*;

    /// A window whose left third is panels.
    fn world() -> World {
        let mut world = World::new();
        world.init_resource::<Messages<WindowEvent>>();
        world.init_resource::<Shortcuts>();
        let free = Some(Rect::new(300.0, 0.0, 900.0, 600.0));
        world.insert_resource(UiInput { free, ..default() });
        world
    }

    fn key(world: &mut World, code: KeyCode, logical_key: Key, state: ButtonState) {
        let window = Entity::PLACEHOLDER;
        let input = KeyboardInput { key_code: code, logical_key, state, text: None, repeat: false, window };
        world.write_message(WindowEvent::KeyboardInput(input));
    }

    fn tap(world: &mut World, code: KeyCode, logical_key: Key) {
        key(world, code, logical_key.clone(), ButtonState::Pressed);
        key(world, code, logical_key, ButtonState::Released);
    }

    fn letter(world: &mut World, code: KeyCode) {
        let letter = match code {
            KeyCode::KeyM => "m",
            KeyCode::KeyR => "R",
            KeyCode::KeyW => "w",
            _ => "x",
        };
        tap(world, code, Key::Character(letter.into()));
    }

    fn control(world: &mut World, state: ButtonState) {
        key(world, KeyCode::ControlLeft, Key::Control, state);
    }

    fn click(world: &mut World, x: f32) {
        let window = Entity::PLACEHOLDER;
        let moved = CursorMoved { window, position: Vec2::new(x, 100.0), delta: None };
        world.write_message(WindowEvent::CursorMoved(moved));
        for state in [ButtonState::Pressed, ButtonState::Released] {
            let input = MouseButtonInput { button: MouseButton::Left, state, window };
            world.write_message(WindowEvent::MouseButtonInput(input));
        }
    }

    /// A frame begins; of R, M and Space, which are pressed in it.
    fn frame(world: &mut World) -> [bool; 3] {
        world.run_system_cached(listen).unwrap();
        let shortcuts = world.resource::<Shortcuts>();
        [KeyCode::KeyR, KeyCode::KeyM, KeyCode::Space].map(|code| shortcuts.pressed(code))
    }

    /// The panels have been drawn: a text is being edited, and a field was entered.
    fn drawn(world: &mut World, keyboard: bool, edited: bool) {
        let mut input = world.resource_mut::<UiInput>();
        (input.keyboard, input.edited) = (keyboard, edited);
    }

    #[test]
    fn keys_count_at_once_where_nothing_is_edited_and_once() {
        let mut world = world();
        letter(&mut world, KeyCode::KeyR);
        // In the scene, which has no fields.
        click(&mut world, 500.0);
        letter(&mut world, KeyCode::KeyM);
        assert_eq!(frame(&mut world), [true, true, false]);
        assert_eq!(frame(&mut world), [false; 3]);
    }

    #[test]
    fn a_field_that_is_entered_in_the_frame_has_the_keys() {
        let mut world = world();
        letter(&mut world, KeyCode::Space);
        click(&mut world, 100.0);
        letter(&mut world, KeyCode::KeyR);
        assert_eq!(frame(&mut world), [false, false, true]);
        drawn(&mut world, true, true);
        letter(&mut world, KeyCode::KeyM);
        assert_eq!(frame(&mut world), [false; 3]);
        drawn(&mut world, true, false);
        assert_eq!(frame(&mut world), [false; 3]);
    }

    #[test]
    fn after_a_button_of_a_panel_keys_count_in_the_next_frame() {
        let mut world = world();
        click(&mut world, 100.0);
        letter(&mut world, KeyCode::KeyR);
        assert_eq!(frame(&mut world), [false; 3]);
        assert_eq!(frame(&mut world), [true, false, false]);
        assert_eq!(frame(&mut world), [false; 3]);
        // So does one that is entered and left again have what was typed, but not what comes after.
        click(&mut world, 100.0);
        letter(&mut world, KeyCode::KeyR);
        tap(&mut world, KeyCode::Enter, Key::Enter);
        letter(&mut world, KeyCode::Space);
        assert_eq!(frame(&mut world), [false; 3]);
        drawn(&mut world, false, true);
        assert_eq!(frame(&mut world), [false, false, true]);
    }

    #[test]
    fn a_field_that_is_left_in_the_frame_has_the_keys_before() {
        for leaves in [Key::Enter, Key::Tab] {
            let mut world = world();
            drawn(&mut world, true, false);
            letter(&mut world, KeyCode::KeyR);
            tap(&mut world, KeyCode::Enter, leaves);
            letter(&mut world, KeyCode::Space);
            assert_eq!(frame(&mut world), [false; 3]);
            drawn(&mut world, false, false);
            assert_eq!(frame(&mut world), [false, false, true]);
        }
        // By a click into the scene.
        let mut world = world();
        drawn(&mut world, true, false);
        letter(&mut world, KeyCode::KeyR);
        click(&mut world, 500.0);
        letter(&mut world, KeyCode::Space);
        assert_eq!(frame(&mut world), [false; 3]);
        drawn(&mut world, false, false);
        assert_eq!(frame(&mut world), [false, false, true]);
        // One that goes on, for it has several lines, has all.
        drawn(&mut world, true, false);
        tap(&mut world, KeyCode::Enter, Key::Enter);
        letter(&mut world, KeyCode::KeyR);
        assert_eq!(frame(&mut world), [false; 3]);
        drawn(&mut world, true, false);
        assert_eq!(frame(&mut world), [false; 3]);
    }

    #[test]
    fn ctrl_is_that_of_the_moment_in_which_the_letter_comes() {
        let mut world = world();
        control(&mut world, ButtonState::Pressed);
        letter(&mut world, KeyCode::KeyR);
        control(&mut world, ButtonState::Released);
        letter(&mut world, KeyCode::KeyM);
        assert_eq!(frame(&mut world), [false, true, false]);
        let shortcuts = world.resource::<Shortcuts>();
        assert!(shortcuts.with_control('r') && !shortcuts.with_control('m'));
        // Shift makes it another one.
        control(&mut world, ButtonState::Pressed);
        key(&mut world, KeyCode::ShiftLeft, Key::Shift, ButtonState::Pressed);
        letter(&mut world, KeyCode::KeyR);
        key(&mut world, KeyCode::ShiftLeft, Key::Shift, ButtonState::Released);
        control(&mut world, ButtonState::Released);
        frame(&mut world);
        let shortcuts = world.resource::<Shortcuts>();
        assert!(!shortcuts.with_control('r') && shortcuts.with_control_and_shift('r'));
        // A letter that is not Latin goes by its place.
        control(&mut world, ButtonState::Pressed);
        tap(&mut world, KeyCode::KeyZ, Key::Character("\u{44f}".into()));
        control(&mut world, ButtonState::Released);
        frame(&mut world);
        assert!(world.resource::<Shortcuts>().with_control('z'));
        // In a field it is neither.
        drawn(&mut world, true, false);
        control(&mut world, ButtonState::Pressed);
        letter(&mut world, KeyCode::KeyR);
        assert_eq!(frame(&mut world), [false; 3]);
        assert!(!world.resource::<Shortcuts>().with_control('r'));
    }

    #[test]
    fn what_is_typed_into_a_field_is_not_held() {
        let held = |world: &World| world.resource::<Shortcuts>().is_held(KeyCode::KeyW);
        let w = |world: &mut World, state| key(world, KeyCode::KeyW, Key::Character("w".into()), state);
        let mut world = world();
        w(&mut world, ButtonState::Pressed);
        frame(&mut world);
        assert!(held(&world));
        frame(&mut world);
        assert!(held(&world));
        w(&mut world, ButtonState::Released);
        frame(&mut world);
        assert!(!held(&world));
        drawn(&mut world, true, false);
        w(&mut world, ButtonState::Pressed);
        frame(&mut world);
        drawn(&mut world, false, false);
        frame(&mut world);
        assert!(!held(&world));
        w(&mut world, ButtonState::Released);
        // Pressed and let go of while it was not known whose it is.
        click(&mut world, 100.0);
        letter(&mut world, KeyCode::KeyW);
        frame(&mut world);
        frame(&mut world);
        assert!(world.resource::<Shortcuts>().pressed(KeyCode::KeyW) && !held(&world));
    }
}
