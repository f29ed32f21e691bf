//! A virtual screen with a sandbox on it, that is seen and used from outside as a person would.

use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// How long anything may take on a machine that has other things to do.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A process that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Waits until something is found.
pub fn wait_for<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(begun.elapsed() < PATIENCE, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Parts of the screen of one colour.
#[derive(Debug, Clone, Copy)]
pub struct Shares {
    /// As black as a window in which nothing has been drawn.
    pub black: f64,
    /// As white as the screen where there is no window.
    pub white: f64,
}

/// A virtual screen of its own, white.
pub struct Screen {
    _server: Running,
    display: String,
    /// The server keeps in it what is on the screen, in a file in X's format of window dumps.
    memory: TempDir,
}

impl Screen {
    /// `None` where tests of the renderer are skipped.
    pub fn start() -> Option<Self> {
        if crate::common::skips_gpu() {
            return None;
        }
        let memory = tempfile::tempdir().unwrap();
        let mut server = Command::new("Xvfb");
        server
            // Without a reset: it takes nobody on while it starts over, as it does when the last one leaves.
            .args(["-noreset", "-displayfd", "1", "-screen", "0", "1280x720x24", "-wr", "-fbdir"])
            .arg(memory.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        let mut server = Running(server.spawn().expect("Xvfb is installed (Debian package xvfb)"));
        let mut number = String::new();
        let output = server.0.stdout.take().expect("piped");
        // The server chooses the number.
        BufReader::new(output).read_line(&mut number).expect("the server says its number");
        Some(Self { _server: server, display: format!(":{}", number.trim()), memory })
    }

    /// What the server is called.
    pub fn display(&self) -> &str {
        &self.display
    }

    /// What `xdotool` answers.
    pub fn xdotool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool").env("DISPLAY", &self.display).args(arguments).output();
        String::from_utf8_lossy(&output.expect("xdotool runs").stdout).trim().to_owned()
    }

    /// What the server keeps of the screen: the words of its header, and rows of blue, green, red and a byte without a meaning.
    fn dump(&self) -> (Vec<usize>, Vec<u8>) {
        let mut dump = fs::read(self.memory.path().join("Xvfb_screen0")).unwrap();
        let words = dump.as_chunks::<4>().0.iter().take(25);
        let header: Vec<usize> = words.map(|word| u32::from_be_bytes(*word) as usize).collect();
        // Behind the header lie the colours that it announces.
        dump.drain(..header[0] + 12 * header[19]);
        (header, dump)
    }

    /// The screen as it is, panels and all.
    pub fn picture(&self) -> image::RgbImage {
        let (header, bytes) = self.dump();
        let (width, height, row) = (header[4], header[5], header[12]);
        image::RgbImage::from_fn(width as u32, height as u32, |x, y| {
            let at = y as usize * row + 4 * x as usize;
            image::Rgb([bytes[at + 2], bytes[at + 1], bytes[at]])
        })
    }

    /// A part of the scene that panels leave free, without what is told below.
    pub fn scene(&self) -> image::RgbImage {
        image::imageops::crop_imm(&self.picture(), 395, 70, 275, 350).to_image()
    }

    /// The same when it stands still: it takes a slow program some time to draw what it was told last.
    pub fn still_scene(&self) -> image::RgbImage {
        wait_for("a scene that stands still", || {
            let scene = self.scene();
            std::thread::sleep(Duration::from_millis(700));
            (scene == self.scene()).then_some(scene)
        })
    }

    /// What is on the screen.
    pub fn shares(&self) -> Shares {
        let (_, bytes) = self.dump();
        let pixels = bytes.as_chunks::<4>().0;
        let part = |wanted: [u8; 3]| {
            let count = pixels.iter().filter(|pixel| pixel[..3] == wanted).count();
            count as f64 / pixels.len() as f64
        };
        Shares { black: part([0; 3]), white: part([255; 3]) }
    }

    /// Looks at the screen all the time while something is done.
    pub fn watch<T>(&self, during: impl FnOnce() -> T) -> (T, Vec<(Instant, Shares)>) {
        /// So that the watcher ends even if what is done panics.
        struct End<'a>(&'a AtomicBool);
        impl Drop for End<'_> {
            fn drop(&mut self) {
                self.0.store(true, Ordering::Relaxed);
            }
        }
        let is_over = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let end = End(&is_over);
            let watcher = scope.spawn(|| {
                let mut seen = Vec::new();
                while !is_over.load(Ordering::Relaxed) {
                    seen.push((Instant::now(), self.shares()));
                    std::thread::sleep(Duration::from_millis(10));
                }
                seen
            });
            let done = during();
            drop(end);
            (done, watcher.join().unwrap())
        })
    }
}

/// Files of a scenario and of its effect, and all that a sandbox writes.
pub struct Scenery {
    folder: TempDir,
}

impl Scenery {
    /// A scenario that uses the shipped hose.
    pub fn new(scenario: &str) -> Self {
        let scenery = Self { folder: tempfile::tempdir().unwrap() };
        let effect = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/effects/hose.effect.ron");
        fs::copy(effect, scenery.effect()).unwrap();
        fs::write(scenery.scenario(), scenario).unwrap();
        scenery
    }

    pub fn scenario(&self) -> PathBuf {
        self.folder.path().join("scene.ron")
    }

    pub fn effect(&self) -> PathBuf {
        self.folder.path().join("hose.effect.ron")
    }

    /// A copy of a shipped file under another name.
    pub fn copy(&self, shipped: &str, name: &str) -> PathBuf {
        let copy = self.folder.path().join(name);
        fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets").join(shipped), &copy).unwrap();
        copy
    }

    /// Pictures and saved scenes.
    pub fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    fn settings(&self) -> PathBuf {
        self.folder.path().join("config/bevy_weathering/settings.ron")
    }

    /// What the program is to remember of a time before.
    pub fn remember(&self, settings: &str) {
        let file = self.settings();
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, settings).unwrap();
    }

    /// What the program remembers for another time; nothing if no setting has ever changed.
    pub fn remembered(&self) -> String {
        fs::read_to_string(self.settings()).unwrap_or_default()
    }

    /// What the program said since it was started last.
    pub fn log(&self) -> String {
        fs::read_to_string(self.folder.path().join("log")).unwrap()
    }
}

/// The program, with its window.
pub struct Sandbox<'a> {
    screen: &'a Screen,
    scenery: &'a Scenery,
    process: Running,
    window: String,
    pictures: u32,
}

impl<'a> Sandbox<'a> {
    /// Waits until the window is seen, has the keyboard, and the scene runs: before that, keys do nothing.
    pub fn start(screen: &'a Screen, scenery: &'a Scenery) -> Self {
        let log = File::create(scenery.folder.path().join("log")).unwrap();
        let process = Command::new(env!("CARGO_BIN_EXE_weathering"))
            .arg("sandbox")
            .arg(scenery.scenario())
            .arg("--out")
            .arg(scenery.out())
            .env("DISPLAY", &screen.display)
            .env("XDG_RUNTIME_DIR", scenery.folder.path())
            // Not the settings of whoever runs the test, and not into them.
            .env("XDG_CONFIG_HOME", scenery.folder.path().join("config"))
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .unwrap();
        let window = String::new();
        let mut sandbox = Self { screen, scenery, process: Running(process), window, pictures: 0 };
        sandbox.window = sandbox.wait_for("the window", |screen| {
            let found = screen.xdotool(&["search", "--onlyvisible", "--name", "weathering"]);
            found.lines().next().map(str::to_owned)
        });
        // No window manager does it here.
        screen.xdotool(&["windowfocus", "--sync", &sandbox.window]);
        sandbox.state("running");
        sandbox
    }

    /// The same, and pauses, so that nothing moves but what the test moves.
    pub fn start_paused(screen: &'a Screen, scenery: &'a Scenery) -> Self {
        let mut sandbox = Self::start(screen, scenery);
        sandbox.pause();
        sandbox
    }

    /// Presses the key, and waits until time stands still.
    pub fn pause(&mut self) {
        self.key("space");
        self.state("paused");
    }

    /// Waits until something is found, or the program ends.
    fn wait_for<T>(&mut self, what: &str, mut found: impl FnMut(&Screen) -> Option<T>) -> T {
        let (screen, scenery, process) = (self.screen, self.scenery, &mut self.process.0);
        wait_for(what, || {
            if let Some(status) = process.try_wait().unwrap() {
                panic!("it ended with {status} in place of {what}:\n{}", scenery.log());
            }
            found(screen)
        })
    }

    pub fn key(&self, key: &str) {
        self.screen.xdotool(&["key", key]);
    }

    pub fn xdotool(&self, arguments: &[&str]) {
        self.screen.xdotool(arguments);
    }

    pub fn title(&self) -> String {
        self.screen.xdotool(&["getwindowname", &self.window])
    }

    /// Waits until the title says so, and returns how long that took.
    pub fn state(&mut self, name: &str) -> Duration {
        let (window, end) = (self.window.clone(), format!("({name})"));
        let begun = Instant::now();
        self.wait_for(name, |screen| {
            screen.xdotool(&["getwindowname", &window]).ends_with(&end).then_some(())
        });
        begun.elapsed()
    }

    /// Waits until the log has a line with this.
    pub fn says(&mut self, what: &str) {
        let scenery = self.scenery;
        self.wait_for(what, |_| scenery.log().contains(what).then_some(()));
    }

    /// Does something, and waits until the log has another line with this, which is returned from there on.
    pub fn answer(&mut self, what: &str, ask: impl FnOnce(&Self)) -> String {
        let scenery = self.scenery;
        let before = scenery.log().matches(what).count();
        ask(self);
        self.wait_for(what, |_| {
            let log = scenery.log();
            let (at, _) = log.match_indices(what).nth(before)?;
            // Not a line of which only a part is written.
            let (line, _) = log[at..].split_once('\n')?;
            Some(line.to_owned())
        })
    }

    /// Waits until a frame has seen all that was done so far: two keys that undo each other are answered.
    pub fn seen(&mut self) {
        for key in ["period", "comma"] {
            self.answer(" times as fast as in the world", |sandbox| sandbox.key(key));
        }
    }

    /// What X calls the window.
    pub fn window(&self) -> u32 {
        self.window.parse().unwrap()
    }

    /// Moves the mouse to a place and clicks the left button.
    pub fn click(&self, [x, y]: [u32; 2]) {
        self.xdotool(&["mousemove", &x.to_string(), &y.to_string(), "click", "1"]);
    }

    /// Drags with a button from a place by so much, in steps that a slow program sees one by one.
    pub fn drag(&self, button: &str, [x, y]: [u32; 2], [right, down]: [i32; 2]) {
        const STEPS: i32 = 6;
        self.xdotool(&["mousemove", &x.to_string(), &y.to_string(), "mousedown", button]);
        let step = [right / STEPS, down / STEPS].map(|along| along.to_string());
        for _ in 0..STEPS {
            std::thread::sleep(Duration::from_millis(60));
            // What is below zero looks like an option.
            self.xdotool(&["mousemove_relative", "--", &step[0], &step[1]]);
        }
        std::thread::sleep(Duration::from_millis(60));
        self.xdotool(&["mouseup", button]);
    }

    /// Presses F12 and waits for the picture.
    pub fn picture(&mut self) -> image::RgbImage {
        self.key("F12");
        let path = self.scenery.out().join(format!("screenshot_{:03}.png", self.pictures));
        self.pictures += 1;
        self.wait_for("a screenshot", |_| path.exists().then_some(()));
        image::open(&path).unwrap().to_rgb8()
    }

    /// As a crash or a battery that is empty would.
    pub fn kill(mut self) {
        self.process.0.kill().unwrap();
        self.process.0.wait().unwrap();
    }

    /// Waits until it ends by itself.
    pub fn end(mut self) -> ExitStatus {
        let process = &mut self.process.0;
        wait_for("the end", || process.try_wait().unwrap())
    }
}
