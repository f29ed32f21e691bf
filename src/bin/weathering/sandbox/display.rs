//! Whether there is a screen to open a window on. What opens windows would end with a panic, and name nothing.

use std::ffi::OsStr;

/// Looks for the X server on which the window would be, where windows are X's. The error is for whoever starts the program.
pub fn require_display() -> Result<(), String> {
    if cfg!(target_os = "linux") { check(std::env::var_os("DISPLAY").as_deref()) } else { Ok(()) }
}

/// Whether a server of this name answers.
fn check(name: Option<&OsStr>) -> Result<(), String> {
    const HELP: &str = "use `weathering replay`, or start one (Xvfb)";
    // An empty name counts as none, for whatever opens windows, too.
    let Some(name) = name.filter(|name| !name.is_empty()) else {
        return Err(format!("no display: DISPLAY is not set; {HELP}"));
    };
    connect(name).map_err(|error| format!("no display: DISPLAY is {name:?}, and {error}; {HELP}"))
}

#[cfg(target_os = "linux")]
fn connect(name: &OsStr) -> Result<(), String> {
    let name = name.to_str().ok_or("that is no name of a server")?;
    let connected = x11rb::connect(Some(name));
    connected.map(drop).map_err(|error| format!("no server can be reached there ({error})"))
}

#[cfg(not(target_os = "linux"))]
fn connect(_name: &OsStr) -> Result<(), String> {
    Ok(())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::os::unix::ffi::OsStrExt;

    use super::*;

    #[test]
    fn a_display_that_is_none_is_named() {
        for unset in [None, Some(OsStr::new(""))] {
            let error = check(unset).unwrap_err();
            assert!(error.contains("DISPLAY is not set"), "{error}");
        }
        for (name, shown) in [
            (OsStr::new(":4321"), ":4321"),
            (OsStr::new("nonsense"), "nonsense"),
            (OsStr::from_bytes(b":\xff"), ":\\xFF"),
        ] {
            let error = check(Some(name)).unwrap_err();
            assert!(error.contains(&format!("DISPLAY is \"{shown}\"")), "{error}");
        }
    }
}
