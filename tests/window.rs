//! The sandbox on a virtual screen, driven by the key presses and mouse moves a person would make.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A process that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A little scene that a software driver draws fast: a wall that a hose wets from the first moment.
const SCENARIO: &str = r#"(
    seconds: 600.0,
    camera: (keys: [(eye: (0.0, 1.5, 3.0), target: (0.0, 0.0, 0.0))]),
    materials: {"clay": (color: (0.5, 0.23, 0.13), porous: (t_fill: 0.0))},
    surfaces: [(name: "floor", mesh: Ground(size: (4.0, 4.0), cells: (2, 2)), material: "clay",
        maps: (map_size: 128, wrap_u: Clamp, wrap_v: Clamp))],
    emitters: [(name: "hose", effect: "hose.effect.ron", rate: 500.0, shape: Cone(radius: 0.01), speed: 8.0,
        spread_deg: 12.0, keys: [(position: (0.0, 1.2, 1.5), target: (0.0, 0.0, 0.0))])],
)"#;

/// A virtual screen of its own; the server chooses the number.
fn start_screen() -> (Running, String) {
    let mut server = Command::new("Xvfb");
    server
        .args(["-displayfd", "1", "-screen", "0", "1280x720x24"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null());
    let mut server = Running(server.spawn().expect("Xvfb is installed (Debian package xvfb)"));
    let mut number = String::new();
    let output = server.0.stdout.take().expect("piped");
    BufReader::new(output).read_line(&mut number).expect("the server says its number");
    (server, format!(":{}", number.trim()))
}

fn xdotool(display: &str, arguments: &[&str]) -> String {
    let output = Command::new("xdotool").env("DISPLAY", display).args(arguments).output();
    String::from_utf8_lossy(&output.expect("xdotool runs").stdout).trim().to_owned()
}

fn wait_for<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(begun.elapsed() < Duration::from_secs(120), "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Presses F12 and waits for the picture.
fn screenshot(display: &str, folder: &Path, number: u32) -> image::RgbImage {
    xdotool(display, &["key", "F12"]);
    let path = folder.join(format!("screenshot_{number:03}.png"));
    wait_for("a screenshot", || path.exists().then_some(()));
    image::open(&path).unwrap().to_rgb8()
}

fn sum(pixel: &image::Rgb<u8>) -> u32 {
    pixel.0.iter().map(|&byte| u32::from(byte)).sum()
}

/// Part of the pixels that show the floor, which is redder than the sky.
fn floor_part(picture: &image::RgbImage) -> f64 {
    let floor = picture.pixels().filter(|pixel| pixel.0[0] > pixel.0[2] + 15).count();
    floor as f64 / picture.pixels().len() as f64
}

/// Part of the pixels that are at least a tenth darker than before.
fn darker_part(picture: &image::RgbImage, before: &image::RgbImage) -> f64 {
    let darker = picture.pixels().zip(before.pixels()).filter(|(now, then)| 10 * sum(now) < 9 * sum(then));
    darker.count() as f64 / picture.pixels().len() as f64
}

#[test]
fn keys_pause_start_over_take_pictures_and_leave() {
    if std::env::var_os("WEATHERING_SKIP_GPU").is_some_and(|skip| skip == "1") {
        eprintln!("skipped: WEATHERING_SKIP_GPU=1");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    std::fs::write(folder.path().join("floor.ron"), SCENARIO).unwrap();
    std::fs::copy(root.join("assets/effects/hose.effect.ron"), folder.path().join("hose.effect.ron"))
        .unwrap();
    let out = folder.path().join("pictures");

    let (_server, display) = start_screen();
    let xdotool = |arguments: &[&str]| xdotool(&display, arguments);
    let mut sandbox = Running(
        Command::new(env!("CARGO_BIN_EXE_weathering"))
            .arg("sandbox")
            .arg(folder.path().join("floor.ron"))
            .arg("--out")
            .arg(&out)
            .env("DISPLAY", &display)
            .env("XDG_RUNTIME_DIR", folder.path())
            // Not the settings of whoever runs the test, and not into them.
            .env("XDG_CONFIG_HOME", folder.path().join("config"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap(),
    );
    let window = wait_for("the window", || {
        let found = xdotool(&["search", "--name", "weathering"]);
        found.lines().next().map(str::to_owned)
    });
    // No window manager does it here.
    xdotool(&["windowfocus", "--sync", &window]);

    let state = |name: &str| {
        let title = format!("({name})");
        wait_for(name, || xdotool(&["getwindowname", &window]).ends_with(&title).then_some(()));
    };
    // Before that, the keys do nothing.
    state("running");
    let mut number = 0;
    let mut take = || {
        number += 1;
        screenshot(&display, &out, number - 1)
    };
    // Time runs: no two pictures of the jet are the same.
    wait_for("the water to run", || (take().as_raw() != take().as_raw()).then_some(()));
    // Paused and started over: dry, and nothing moves.
    xdotool(&["key", "space"]);
    state("paused");
    xdotool(&["key", "r"]);
    let dry = wait_for("a picture that stands still", || {
        let picture = take();
        (floor_part(&picture) > 0.4 && picture.as_raw() == take().as_raw()).then_some(picture)
    });
    // Running: the floor gets dark.
    xdotool(&["key", "space"]);
    state("running");
    wait_for("the floor to get wet", || (darker_part(&take(), &dry) > 0.01).then_some(()));
    // Started over once more: the same picture as before, to the pixel.
    xdotool(&["key", "space"]);
    state("paused");
    xdotool(&["key", "r"]);
    wait_for("the dry floor", || (take().as_raw() == dry.as_raw()).then_some(()));
    // Dragging with the right button turns the camera.
    xdotool(&["mousemove", "600", "250", "mousedown", "3"]);
    for _ in 0..8 {
        xdotool(&["mousemove_relative", "12", "4"]);
        std::thread::sleep(Duration::from_millis(60));
    }
    xdotool(&["mouseup", "3"]);
    wait_for("the camera to turn", || (take().as_raw() != dry.as_raw()).then_some(()));
    // Over a panel it does not.
    let turned = take();
    xdotool(&["mousemove", "100", "250", "mousedown", "3", "mousemove_relative", "60", "20", "mouseup", "3"]);
    assert!(take().as_raw() == turned.as_raw(), "the camera turned over a panel");
    // Exported as it is; the report comes last.
    xdotool(&["key", "x"]);
    let exported = out.join("export_000");
    wait_for("the export", || exported.join("report.json").exists().then_some(()));
    assert!(exported.join("floor_weathered.glb").is_file() && exported.join("maps/floor_film.png").is_file());
    xdotool(&["key", "Escape"]);
    let status = wait_for("the end", || sandbox.0.try_wait().unwrap());
    assert!(status.success(), "{status}");
}
