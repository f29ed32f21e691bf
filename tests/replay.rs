//! The program itself, run as its users run it: what it writes, what it says, and how it ends.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;

pub const HOSE: &str = "assets/scenarios/hose.ron";
pub const VASE: &str = "assets/scenarios/vase.ron";

/// A tap over a square metre of ground: what [`Tree`] holds, what its copies spoil, and what is run many times.
pub const TAP: &str = r#"(
    seconds: 1.0,
    max_particles: 1000,
    camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
    materials: {"plain": ()},
    surfaces: [
        (
            name: "ground",
            mesh: Ground(size: (1.0, 1.0), cells: (2, 2)),
            material: "plain",
            scale: (1.0, 1.0, 1.0),
            maps: (map_size: 256),
        ),
    ],
    emitters: [
        (
            name: "tap",
            effect: "effects/tap.effect.ron",
            rate: 200.0,
            speed: 1.0,
            keys: [(position: (0.0, 0.2, 0.0), target: (0.0, 0.0, 0.0))],
        ),
    ],
)
"#;
pub const MESH: &str = "Ground(size: (1.0, 1.0), cells: (2, 2))";
pub const EFFECT: &str = "\"effects/tap.effect.ron\"";

/// How a run of the program ended.
pub struct Outcome {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Outcome {
    /// The report of a run that went well and had no `--out`.
    pub fn report(&self) -> Value {
        self.assert_success();
        serde_json::from_str(&self.stdout).expect("standard output is the report")
    }

    pub fn assert_success(&self) {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
    }

    /// The run was refused with a message that has all of `named`, before anything was written.
    pub fn assert_refused(&self, named: &[&str], out: &Path) {
        assert_eq!(self.code, Some(2), "{named:?}: {}", self.stderr);
        for name in named {
            assert!(self.stderr.contains(name), "no {name:?} in: {}", self.stderr);
        }
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        assert!(!out.exists(), "{named:?}: something was written");
    }
}

/// `weathering replay FILE OPTIONS...`.
pub fn replay(file: impl AsRef<OsStr>, options: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_weathering"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).arg("replay").arg(file).args(options.split_whitespace());
    command
}

pub fn run(command: &mut Command) -> Outcome {
    let output = command.output().expect("the program starts");
    Outcome {
        code: output.status.code(),
        stdout: String::from_utf8_lossy(&output.stdout).into(),
        stderr: String::from_utf8_lossy(&output.stderr).into(),
    }
}

/// A report without what differs from run to run.
fn without_timing(mut report: Value) -> Value {
    let timing = report.as_object_mut().and_then(|report| report.remove("timing"));
    assert!(timing.is_some(), "a report tells how long it took");
    report
}

pub fn read_report(out: &Path) -> Value {
    let bytes = fs::read(out.join("report.json")).expect("there is a report");
    serde_json::from_slice(&bytes).expect("the report is JSON")
}

pub fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

pub fn surfaces(report: &Value) -> &[Value] {
    report["surfaces"].as_array().expect("a list of surfaces")
}

fn triangle_counts(report: &Value) -> Vec<(&str, u64)> {
    let row = |surface: &Value| surface["triangles"].as_u64().expect("a whole number");
    surfaces(report).iter().map(|surface| (surface["name"].as_str().expect("a name"), row(surface))).collect()
}

/// All files below a folder, hidden ones too.
pub fn files_below(folder: &Path) -> BTreeSet<String> {
    let mut files = BTreeSet::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).expect("the folder is there") {
            let path = entry.expect("it can be read").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("it is below the folder");
                files.insert(name.display().to_string());
            }
        }
    }
    files
}

/// The files of a finished run.
fn expected_files(surfaces: &[&str], frames: u32) -> BTreeSet<String> {
    let maps = ["diffuse", "specular", "normal", "film", "absorbed", "wetness", "since"];
    let maps = surfaces.iter().flat_map(|name| maps.map(|map| format!("maps/{name}_{map}.png")));
    let frames = (0..frames).map(|frame| format!("frame_{frame:05}.png"));
    let plots = ["wetness", "film", "absorbed", "water", "particles", "timings"];
    let plots = plots.map(|plot| format!("plots/{plot}.svg"));
    let tables = ["report.json", "series.csv", "timings.csv"].map(String::from);
    maps.chain(frames).chain(plots).chain(tables).collect()
}

/// A 16-bit map.
fn grey_map(out: &Path, name: &str) -> Vec<u16> {
    let image = image::open(out.join("maps").join(name)).expect("the map is an image");
    assert_eq!(image.color(), image::ColorType::L16, "{name}");
    image.into_luma16().into_raw()
}

/// A scenario's folders in a temporary place, with good and bad files, and beside them a folder that no
/// scenario may read.
pub struct Tree(pub TempDir);

impl Tree {
    pub fn new() -> Self {
        let tree = Self(tempfile::tempdir().expect("a temporary folder"));
        let effect = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/effects/hose.effect.ron");
        let effect = fs::read(effect).expect("the effect is in the repository");
        let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/bunny_1000.glb");
        let model = fs::read(model).expect("the model is in the repository");
        for (path, content) in [
            ("tree/effects/tap.effect.ron", effect.as_slice()),
            ("outside/tap.effect.ron", effect.as_slice()),
            ("tree/effects/unknown.effect.ron", b"(\n    wetness: 3.5,\n)"),
            ("tree/effects/nan.effect.ron", b"(bump: NaN)"),
            ("tree/models/text.glb", b"This is no model."),
            ("tree/models/cut.glb", &model[..model.len() / 2]),
            ("tree/scenarios/tap.ron", TAP.as_bytes()),
        ] {
            let path = tree.path(path);
            fs::create_dir_all(path.parent().expect("a file in a folder")).expect("a new folder");
            fs::write(path, content).expect("a new file");
        }
        #[cfg(unix)]
        std::os::unix::fs::symlink(
            tree.path("outside/tap.effect.ron"),
            tree.path("tree/effects/link.effect.ron"),
        )
        .expect("a new link");
        tree
    }

    pub fn path(&self, path: &str) -> PathBuf {
        self.0.path().join(path)
    }

    pub fn tap(&self) -> PathBuf {
        self.path("tree/scenarios/tap.ron")
    }

    /// [`TAP`] with one thing changed.
    pub fn spoilt(&self, from: &str, to: &str) -> PathBuf {
        assert_eq!(TAP.matches(from).count(), 1, "{from}");
        let path = self.path("tree/scenarios/spoilt.ron");
        fs::write(&path, TAP.replace(from, to)).expect("a new file");
        path
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let report = |threads| {
        let options = format!("--no-render --seconds 2 --threads {threads}");
        without_timing(run(&mut replay(HOSE, &options)).report())
    };
    let one = report(1);
    assert_eq!(one["digest"].as_str().map(str::len), Some(64), "{one}");
    assert_eq!(one, report(2));
    assert_eq!(one, report(8));
}

/// As many as it takes for every parallel loop to be split.
#[test]
fn the_number_of_threads_changes_nothing_for_a_crowd() {
    let tree = Tree::new();
    let crowd = TAP
        .replace("rate: 200.0", "rate: 60000.0")
        .replace("max_particles: 1000", "max_particles: 100000")
        .replace("position: (0.0, 0.2, 0.0)", "position: (0.0, 2.0, 0.0)");
    let path = tree.path("tree/scenarios/crowd.ron");
    fs::write(&path, crowd).unwrap();
    let report = |threads: u32| {
        without_timing(run(&mut replay(&path, &format!("--no-render --threads {threads}"))).report())
    };
    let one = report(1);
    let alive = number(&one["particles"]["alive"]);
    assert!(alive > 20_000.0 && number(&one["particles"]["hit"]) > 10_000.0, "{one}");
    assert_eq!(one, report(2));
    assert_eq!(one, report(8));
}

#[test]
fn another_seed_is_another_run() {
    let report = |options: &str| run(&mut replay(HOSE, options)).report();
    let own = report("--no-render --seconds 1");
    let other = report("--no-render --seconds 1 --seed 12345");
    assert_eq!(other["seed"], 12345);
    assert_ne!(own["seed"], other["seed"]);
    assert_ne!(own["digest"], other["digest"]);
    // The hose sends out the same number; how many drops splash up depends on where they hit.
    let born = [&own, &other].map(|report| number(&report["particles"]["emitted"]));
    assert!(born.iter().all(|born| (500.0..800.0).contains(born)), "{born:?}");
}

#[test]
fn a_longer_run_is_that_of_a_longer_scenario() {
    let tree = Tree::new();
    let report = |file: &Path, options: &str| {
        without_timing(run(&mut replay(file, &format!("--no-render {options}"))).report())
    };
    let kept = tree.path("kept");
    let own = run(replay(tree.tap(), "--no-render --save-state").arg(&kept)).report();
    let longer = report(&tree.tap(), "--seconds 2");
    let gone_on = run(replay(tree.tap(), "--no-render --seconds 2 --resume").arg(&kept)).report();
    assert_eq!(gone_on["digest"], longer["digest"]);
    let emitted = |report: &Value| number(&report["particles"]["emitted"]);
    assert!(emitted(&longer) > emitted(&own) + 200.0, "{longer}");
    let mut expected = report(&tree.spoilt("seconds: 1.0", "seconds: 2.0"), "");
    expected["scenario"] = longer["scenario"].clone();
    assert_eq!(longer, expected);
}

#[test]
fn the_numbers_of_a_report_add_up() {
    let report = run(&mut replay(HOSE, "--no-render --seconds 2")).report();
    assert_eq!((number(&report["ticks"]), number(&report["seconds"])), (120.0, 2.0));
    let particles = &report["particles"];
    let hit = number(&particles["hit"]);
    let elsewhere = number(&particles["alive"]) + number(&particles["expired"]);
    assert!(hit > 0.0, "{report}");
    assert_eq!(number(&particles["emitted"]), hit + elsewhere);
    let impacts: f64 = surfaces(&report).iter().map(|surface| number(&surface["impacts"])).sum();
    assert_eq!(impacts, hit);
    for surface in surfaces(&report) {
        let part = |name: &str| number(&surface[name]);
        let received = part("received_mm3");
        let found = part("film_mm3") + part("absorbed_mm3") + part("evaporated_mm3") + part("dripped_mm3");
        assert!((found - received).abs() <= 1e-9 * received, "{surface}");
        let wet = part("wet_fraction");
        assert!((0.0..=1.0).contains(&wet), "{surface}");
        assert_eq!(wet > 0.0, received > 0.0, "{surface}");
    }
    assert!(number(&report["water"]["imbalance"]).abs() < 1e-9, "{}", report["water"]);
    assert_eq!(triangle_counts(&report), [("ground", 1584), ("sphere", 936), ("bunny", 1000)]);
}

#[test]
fn the_vase_has_its_triangles() {
    let report = run(&mut replay(VASE, "--no-render --seconds 0.5")).report();
    assert_eq!(triangle_counts(&report), [("ground", 1584), ("vase", 11_008)]);
}

#[test]
fn out_holds_the_report_and_the_maps_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("not/there/yet");
    let to_folder = run(replay(HOSE, "--no-render --seconds 2 --out").arg(&out));
    to_folder.assert_success();
    assert_eq!(files_below(&out), expected_files(&["ground", "sphere", "bunny"], 0));
    let to_output = run(&mut replay(HOSE, "--no-render --seconds 2"));
    let report = read_report(&out);
    assert_eq!(without_timing(report.clone()), without_timing(to_output.report()));

    for surface in surfaces(&report) {
        let name = surface["name"].as_str().unwrap();
        let film = grey_map(&out, &format!("{name}_film.png"));
        let absorbed = grey_map(&out, &format!("{name}_absorbed.png"));
        let since = grey_map(&out, &format!("{name}_since.png"));
        let water: Vec<u16> = film.iter().zip(&absorbed).map(|(film, pores)| film + pores).collect();
        assert_eq!(water.iter().any(|&um| um > 0), number(&surface["received_mm3"]) > 0.0, "{name}");
        // Less than half a micrometre is written as 0.
        let wet = |(um, since): (&u16, &u16)| *um == 0 || *since > 0;
        assert!(water.iter().zip(&since).all(wet), "{name}: water that came at no time");
        assert!(since.iter().all(|&since| since <= 200), "{name}: water from the future");
        for map in ["diffuse", "specular", "normal"] {
            let image = image::open(out.join(format!("maps/{name}_{map}.png"))).unwrap();
            assert_eq!(image.color(), image::ColorType::Rgba8, "{name} {map}");
            assert_eq!((image.width() * image.height()) as usize, water.len(), "{name} {map}");
        }
    }
}

#[test]
fn what_the_scenario_reads_is_not_replaced_and_what_is_no_map_of_the_run_stays() {
    let tree = Tree::new();
    let out = tree.path("tree/out");
    fs::create_dir_all(out.join("maps")).unwrap();
    let pictures = ["maps/ground_diffuse.png", "maps/clay_diffuse.png", "maps/clay_normal.png"];
    for name in pictures {
        fs::write(out.join(name), "mine").unwrap();
    }
    let before = files_below(&out);
    let reading = |name: &str| {
        let file = tree.spoilt("\"plain\": ()", &format!("\"plain\": (texture: Photo(\"out/{name}\"))"));
        run(replay(&file, "--no-render --out").arg(&out))
    };
    let outcome = reading("maps/ground_diffuse.png");
    assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
    for named in ["`out`", "maps/ground_diffuse.png"] {
        assert!(outcome.stderr.contains(named), "{}", outcome.stderr);
    }
    assert_eq!(files_below(&out), before);
    // That of no surface is in nobody's way.
    reading("maps/clay_diffuse.png").assert_success();
    let is_mine = |name: &str| fs::read(out.join(name)).is_ok_and(|bytes| bytes == b"mine");
    assert_eq!(pictures.map(is_mine), [false, true, true]);
}

#[test]
fn the_maps_hold_the_water_in_micrometres() {
    let tree = Tree::new();
    let out = tree.path("out");
    run(replay(tree.tap(), "--no-render --out").arg(&out)).assert_success();
    let report = read_report(&out);
    for (map, field) in [("film", "film_mm3"), ("absorbed", "absorbed_mm3")] {
        let texels = grey_map(&out, &format!("ground_{map}.png"));
        let sum: f64 = texels.iter().copied().map(f64::from).sum();
        // A square metre; a micrometre on a mm² is a thousandth of a mm³.
        let texel_mm2 = 1.0e6 / texels.len() as f64;
        let expected = number(&report["surfaces"][0][field]);
        let actual = sum * texel_mm2 / 1000.0;
        assert!(expected > 0.0, "{map}");
        // Each value is rounded.
        assert!(
            (actual / expected - 1.0).abs() < 0.02,
            "{actual} mm³ in the map, {expected} mm³ in the report"
        );
    }
}

#[test]
fn pictures_come_with_the_same_digest() {
    if crate::common::skips_gpu() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut command = replay(HOSE, "--seconds 1 --fps 2 --size 96x64 --out");
    // Vulkan's window-system code wants one even when no window is opened.
    run(command.arg(&out).env("XDG_RUNTIME_DIR", folder.path())).assert_success();

    assert_eq!(files_below(&out), expected_files(&["ground", "sphere", "bunny"], 2));
    for name in ["frame_00000.png", "frame_00001.png"] {
        let picture = image::open(out.join(name)).unwrap().into_luma8();
        assert_eq!(picture.dimensions(), (96, 64), "{name}");
        let (darkest, brightest) =
            picture.iter().fold((255, 0), |(low, high), &grey| (grey.min(low), grey.max(high)));
        assert!(brightest - darkest > 32, "{name} is flat: {darkest} to {brightest}");
    }
    let rendered = read_report(&out);
    assert_eq!(rendered["timing"]["frames"], 2);
    let unseen = run(&mut replay(HOSE, "--seconds 1 --no-render")).report();
    assert!(number(&unseen["particles"]["hit"]) > 0.0);
    assert_eq!(without_timing(rendered), without_timing(unseen));
}

#[test]
fn a_surface_without_room_for_its_maps_is_told_of_and_accounted_for() {
    let tree = Tree::new();
    let out = tree.path("out");
    for (budget, side) in [("(mib: 0.001)", 0), ("(texel_mm: 10.0)", 112), ("(mib: 0.6)", 128), ("()", 256)] {
        let file = tree.spoilt("seconds: 1.0", &format!("seconds: 1.0, map_budget: {budget}"));
        run(replay(&file, "--no-render --out").arg(&out)).assert_success();
        let report = read_report(&out);
        assert_eq!(surfaces(&report)[0]["map_size"], side, "{budget}");
        assert_eq!(report["maps"]["refusals"], u32::from(side == 0), "{budget}");
        let water = &report["water"];
        assert_eq!(number(&water["evicted_mm3"]) > 0.0, side == 0, "{budget}: {water}");
        assert!(number(&water["imbalance"]).abs() < 1e-9, "{budget}: {water}");
        assert_eq!(out.join("maps/ground_film.png").exists(), side > 0, "{budget}");
    }
}
