//! Files that are dragged out of another program and dropped on the window: the other program's side of XDND, X's protocol for that.

use std::path::Path;

use x11rb::connection::Connection;
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    Atom, AtomEnum, ClientMessageEvent, ConnectionExt, CreateWindowAux, EventMask, PropMode,
    SELECTION_NOTIFY_EVENT, SelectionNotifyEvent, SelectionRequestEvent, Window, WindowClass,
};
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;
use x11rb::{COPY_DEPTH_FROM_PARENT, COPY_FROM_PARENT, CURRENT_TIME};

use super::screen::wait_for;

/// Of the protocol; it is in the highest byte of the first message.
const VERSION: u32 = 5;

/// A program that has a file in its hand.
struct Source {
    connection: RustConnection,
    window: Window,
    /// The contents of a list of files.
    files: String,
}

impl Source {
    fn new(display: &str, file: &Path) -> Self {
        let (connection, screen) = RustConnection::connect(Some(display)).unwrap();
        let root = connection.setup().roots[screen].root;
        let window = connection.generate_id().unwrap();
        let class = WindowClass::INPUT_OUTPUT;
        let values = CreateWindowAux::new();
        connection
            .create_window(
                COPY_DEPTH_FROM_PARENT,
                window,
                root,
                0,
                0,
                1,
                1,
                0,
                class,
                COPY_FROM_PARENT,
                &values,
            )
            .unwrap();
        Self { connection, window, files: format!("file://{}\r\n", file.display()) }
    }

    fn atom(&self, name: &str) -> Atom {
        self.connection.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom
    }

    /// Sends a message that begins with whom it is from.
    fn tell(&self, target: Window, name: &str, rest: [u32; 4]) {
        let [a, b, c, d] = rest;
        let message = ClientMessageEvent::new(32, target, self.atom(name), [self.window, a, b, c, d]);
        self.connection.send_event(false, target, EventMask::NO_EVENT, message).unwrap();
        self.connection.flush().unwrap();
    }

    /// Hands over the names of the files.
    fn hand_over(&self, request: SelectionRequestEvent) {
        let SelectionRequestEvent { time, requestor, selection, target, property, .. } = request;
        self.connection
            .change_property8(PropMode::REPLACE, requestor, property, target, self.files.as_bytes())
            .unwrap();
        let response_type = SELECTION_NOTIFY_EVENT;
        let notify =
            SelectionNotifyEvent { response_type, sequence: 0, time, requestor, selection, target, property };
        self.connection.send_event(false, requestor, EventMask::NO_EVENT, notify).unwrap();
        self.connection.flush().unwrap();
    }
}

/// Drags a file into a window, drops it there, and waits until the window has taken it.
pub fn drop_file(display: &str, target: Window, file: &Path) {
    let source = Source::new(display, file);
    let connection = &source.connection;
    let aware = connection.get_property(false, target, source.atom("XdndAware"), AtomEnum::ATOM, 0, 1);
    assert_eq!(aware.unwrap().reply().unwrap().value_len, 1, "nothing can be dropped on the window");
    connection
        .set_selection_owner(source.window, source.atom("XdndSelection"), CURRENT_TIME)
        .unwrap()
        .check()
        .unwrap();
    let (status, finished) = (source.atom("XdndStatus"), source.atom("XdndFinished"));
    source.tell(target, "XdndEnter", [VERSION << 24, source.atom("text/uri-list"), 0, 0]);
    // Somewhere in the scene.
    let place = (500 << 16) | 300;
    source.tell(target, "XdndPosition", [0, place, CURRENT_TIME, source.atom("XdndActionCopy")]);
    let (mut is_handed_over, mut is_welcome) = (false, false);
    loop {
        match wait_for("an answer to what is dragged", || connection.poll_for_event().unwrap()) {
            Event::SelectionRequest(request) => {
                source.hand_over(request);
                is_handed_over = true;
            }
            Event::ClientMessage(message) if message.type_ == status => {
                is_welcome = message.data.as_data32()[1] & 1 == 1;
                assert!(is_welcome, "the file is not welcome");
            }
            Event::ClientMessage(message) if message.type_ == finished => return,
            _ => continue,
        }
        // Before its name is known there would be nothing to drop.
        if is_handed_over && is_welcome {
            source.tell(target, "XdndDrop", [0, CURRENT_TIME, 0, 0]);
        }
    }
}
