//! Events of scenarios, as their users run them: what they do, that it can be repeated, and how a run ends.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;

use super::replay::{Outcome, number, read_report, replay, run, surfaces};

/// Two floors a metre wide and a tap that events switch.
const SCENE: &str = r#"
    seconds: 4.0,
    tick_hz: 20,
    camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
    materials: {
        "glazed": (porous: (capacity_mm: 0.0)),
        "brick": (porous: (capacity_mm: 2.0, sorptivity: 2.0)),
    },
    surfaces: [
        (
            name: "left",
            mesh: Ground(size: (1.0, 1.0), cells: (2, 2)),
            material: "glazed",
            position: (-1.0, 0.0, 0.0),
            maps: (map_size: 64, wrap_u: Clamp, wrap_v: Clamp),
        ),
        (
            name: "right",
            mesh: Ground(size: (1.0, 1.0), cells: (2, 2)),
            material: "brick",
            position: (1.0, 0.0, 0.0),
            maps: (map_size: 64, wrap_u: Clamp, wrap_v: Clamp),
        ),
    ],
    emitters: [(
        name: "tap",
        effect: "tap.effect.ron",
        rate: 100.0,
        speed: 2.0,
        keys: [(position: (-1.0, 0.5, 0.0), target: (-1.0, 0.0, 0.0))],
    )],
"#;

const TAP: &str = "(volume_mm3: 50.0, stamp_radius: 0.05)";

/// From the left to the right, and some of everything on the way.
const STORY: &str = r#"
    (at: 0.5, what: Start("tap")),
    (at: 2.0, what: Move(emitter: "tap", position: (1.0, 0.5, 0.0), target: (1.0, 0.0, 0.0))),
    (at: 3.5, what: Stop("tap")),
    (at: 1.0, what: Weather(wind: (0.1, 0.0, 0.2), drying_speed: 50.0, over: 1.0)),
    (at: 2.5, what: Weather(humidity: 0.2)),
    (at: 1.5, what: Brush(kind: Dirty, point: (1.0, 0.0, 0.2), radius: 0.3, strength: 0.02)),
    (at: 1.6, what: Brush(kind: Wet, point: (1.0, 0.0, -0.2), radius: 0.3, strength: 0.4, surface: "right")),
    (at: 3.0, what: Brush(kind: Dry, point: (-1.0, 0.0, 0.0), radius: 0.4, strength: 0.5)),
    (at: 3.2, what: Brush(kind: Clean, point: (1.0, 0.0, 0.2), radius: 0.2, strength: 0.8)),
    (at: 2.2, what: Material(surface: "left", material: "brick")),
    (at: 2.8, what: Material(surface: "right", model: Twomey(porosity: 0.8))),
"#;

/// Files in a folder of their own.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        fs::write(folder.0.path().join("tap.effect.ron"), TAP).unwrap();
        folder
    }

    fn file(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, text).unwrap();
        path
    }

    fn scene(&self, events: &str) -> PathBuf {
        self.file("scene.ron", &format!("({SCENE} events: [{events}])"))
    }

    fn report(&self, events: &str) -> Value {
        run(&mut replay(self.scene(events), "--no-render")).report()
    }
}

fn surface<'a>(report: &'a Value, name: &str) -> &'a Value {
    surfaces(report).iter().find(|surface| surface["name"] == name).unwrap()
}

fn check(arguments: &[&Path]) -> Outcome {
    let mut command = Command::new(env!("CARGO_BIN_EXE_weathering"));
    run(command.current_dir(env!("CARGO_MANIFEST_DIR")).arg("check").args(arguments))
}

#[test]
fn emitters_are_switched_and_moved_to_the_tick() {
    let folder = Folder::new();
    let report = folder.report(r#"(at: 1.0, what: Start("tap")), (at: 2.0, what: Stop("tap"))"#);
    assert_eq!(number(&report["particles"]["emitted"]), 100.0);
    assert_eq!(number(&surface(&report, "right")["impacts"]), 0.0);
    let moved =
        r#"(at: 0.0, what: Move(emitter: "tap", position: (1.0, 0.5, 0.0), target: (1.0, 0.0, 0.0)))"#;
    let report = folder.report(moved);
    assert_eq!(number(&surface(&report, "left")["impacts"]), 0.0);
    assert!(number(&surface(&report, "right")["impacts"]) > 300.0);
}

#[test]
fn whatever_happens_is_booked() {
    let report = Folder::new().report(STORY);
    assert!(number(&report["water"]["imbalance"]).abs() < 1e-9, "{}", report["water"]);
    assert!(number(&report["water"]["painted_mm3"]) > 1000.0, "{}", report["water"]);
    assert!(number(&report["water"]["wiped_mm3"]) > 100.0, "{}", report["water"]);
    for surface in surfaces(&report) {
        let part = |name: &str| number(&surface[name]);
        let came = part("received_mm3") + part("painted_mm3");
        let found = ["film_mm3", "absorbed_mm3", "evaporated_mm3", "dripped_mm3", "wiped_mm3"].map(part);
        assert!((found.iter().sum::<f64>() - came).abs() <= 1e-9 * came, "{surface}");
    }
    let (left, right) = (surface(&report, "left"), surface(&report, "right"));
    let soil = number(&right["dust_mm3"]) + number(&right["mud_mm3"]);
    assert!(soil > 0.0 && number(&right["wiped_soil_mm3"]) > 0.0, "{right}");
    // 0.02 mm in the middle of a bump of a third of the disc.
    let painted = soil + number(&right["wiped_soil_mm3"]) + number(&right["washed_off_mm3"]);
    let expected = 0.02 * std::f64::consts::PI * 300.0 * 300.0 / 3.0;
    assert!((painted / expected - 1.0).abs() < 0.03, "{painted} {expected}");
    assert_eq!(number(&left["painted_mm3"]), 0.0);
    // It became porous under its film.
    assert!(number(&left["absorbed_mm3"]) > 0.0, "{left}");
}

#[test]
fn the_same_story_ends_the_same_and_another_does_not() {
    let folder = Folder::new();
    let file = folder.scene(STORY);
    let digest = |options: &str| {
        let report = run(&mut replay(&file, &format!("--no-render {options}"))).report();
        report["digest"].as_str().unwrap().to_owned()
    };
    let one = digest("--threads 1");
    assert_eq!(one, digest("--threads 2"));
    // What only looks changes nothing.
    let looking = r#"(at: 1.0, what: Capture("a")), (at: 2.0, what: Expect(quantity: Particles, above: 0.0)),
        (at: 2.0, what: Camera(eye: (0.0, 1.0, 1.0), target: (0.0, 0.0, 0.0))),"#;
    let of = |events: &str| folder.report(events)["digest"].as_str().unwrap().to_owned();
    assert_eq!(of(&format!("{STORY}{looking}")), one);
    // A stroke that reaches nothing is another story, too.
    let far = "(at: 1.0, what: Brush(kind: Wet, point: (0.0, 9.0, 0.0), radius: 0.1, strength: 1.0)),";
    assert_ne!(of(&format!("{STORY}{far}")), one);
}

#[test]
fn a_story_that_is_gone_on_with_ends_the_same() {
    let folder = Folder::new();
    let file = folder.scene(STORY);
    let whole = run(&mut replay(&file, "--no-render")).report();
    // In a change of the weather, after surfaces have become other matter, after all.
    for seconds in ["1.5", "2.5", "3.1"] {
        let saved = folder.0.path().join(format!("saved_{seconds}"));
        let options = format!("--no-render --seconds {seconds} --save-state");
        run(replay(&file, &options).arg(&saved)).assert_success();
        let rest = run(replay(&file, "--no-render --resume").arg(&saved)).report();
        assert_eq!(rest["digest"], whole["digest"], "{seconds}");
        assert_eq!(rest["water"], whole["water"], "{seconds}");
    }
}

#[test]
fn expectations_decide_how_a_run_ends() {
    let folder = Folder::new();
    let good = r#"(at: 1.0, what: Expect(quantity: WaterMl, surface: "left", above: 1.0)),
        (at: 4.0, what: Expect(quantity: WaterMl, surface: "right", below: 0.001)),
        (at: 0.0, what: Expect(quantity: Particles, below: 10.0)),"#;
    let report = folder.report(good);
    let outcomes = report["expectations"].as_array().unwrap();
    assert!(outcomes.iter().all(|outcome| outcome["holds"] == true), "{outcomes:?}");
    assert_eq!(outcomes.iter().map(|outcome| number(&outcome["at"])).collect::<Vec<_>>(), [0.0, 1.0, 4.0]);
    // 100 particles of 50 mm³ a second; some are in flight.
    let water = number(&outcomes[1]["value"]);
    assert!((3.0..5.0).contains(&water), "{water}");

    let bad = r#"(at: 1.0, what: Expect(quantity: WetFraction, surface: "right", above: 0.5)),
        (at: 3.0, what: Expect(quantity: Particles, above: 0.0)),"#;
    let out = folder.0.path().join("out");
    let outcome = run(replay(folder.scene(bad), "--no-render --seconds 2 --out").arg(&out));
    assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
    for named in ["events[0]", "WetFraction of right is 0", "above 0.5"] {
        assert!(outcome.stderr.contains(named), "{named}: {}", outcome.stderr);
    }
    // All is written nevertheless.
    let report = read_report(&out);
    assert_eq!(report["expectations"][0]["holds"], false);
    assert_eq!(number(&report["expectations"][0]["value"]), 0.0);
    assert_eq!(report["expectations"][1]["holds"], Value::Null);
}

#[test]
fn what_looks_at_the_very_end_is_done() {
    let folder = Folder::new();
    // 50.4 ticks, and less than half a tick.
    for (seconds, ticks) in [("2.52", 50.0), ("0.004", 1.0)] {
        let scene = SCENE.replace("seconds: 4.0", &format!("seconds: {seconds}"));
        let events = format!(
            r#"(at: {seconds}, what: Expect(quantity: Particles, above: 1.0e9)),
            (at: {seconds}, what: Export("end")),"#
        );
        let file = folder.file("short.ron", &format!("({scene} events: [{events}])"));
        let out = folder.0.path().join(format!("out_{seconds}"));
        let outcome = run(replay(file, "--no-render --out").arg(&out));
        assert_eq!(outcome.code, Some(1), "{seconds}: {}", outcome.stderr);
        let report = read_report(&out);
        assert_eq!(number(&report["ticks"]), ticks);
        assert_eq!(report["expectations"][0]["holds"], false, "{report}");
        assert!(out.join("export_end").is_dir(), "{seconds}");
    }
}

#[test]
fn pictures_are_taken_by_name() {
    if crate::common::skips_gpu() {
        return;
    }
    let folder = Folder::new();
    let out = folder.0.path().join("out");
    fs::create_dir(&out).unwrap();
    fs::write(out.join("capture_old.png"), "of an earlier run").unwrap();
    let file = folder.scene(r#"(at: 0.25, what: Capture("quarter")), (at: 1.0, what: Capture("end")), (at: 2.0, what: Capture("late"))"#);
    let mut command = replay(&file, "--seconds 1 --fps 2 --size 64x48 --out");
    run(command.arg(&out).env("XDG_RUNTIME_DIR", folder.0.path())).assert_success();
    let mut names: Vec<_> = fs::read_dir(&out)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".png"))
        .collect();
    names.sort();
    assert_eq!(names, ["capture_end.png", "capture_quarter.png", "frame_00000.png", "frame_00001.png"]);
}

#[test]
fn files_are_laid_over_each_other() {
    let folder = Folder::new();
    folder.file("base.ron", &format!("({SCENE})"));
    let main = folder.file(
        "main.ron",
        r#"(
            include: ["base.ron"],
            seconds: 1.0,
            variants: {"strong": (emitter_changes: {"tap": (rate: 300.0)}, seed: 5)},
        )"#,
    );
    let plain = run(&mut replay(&main, "--no-render")).report();
    assert_eq!((number(&plain["seconds"]), number(&plain["particles"]["emitted"])), (1.0, 100.0));
    assert_eq!(plain["variant"], Value::Null);
    let strong = run(&mut replay(&main, "--no-render --variant strong")).report();
    assert_eq!(
        (number(&strong["particles"]["emitted"]), &strong["variant"]),
        (300.0, &Value::from("strong"))
    );
    let outcome = run(&mut replay(&main, "--no-render --variant weak"));
    assert_eq!(outcome.code, Some(2));
    assert!(outcome.stderr.contains("weak") && outcome.stderr.contains("strong"), "{}", outcome.stderr);
}

#[test]
fn every_scenario_that_is_shipped_passes_the_check() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenarios");
    let mut files: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "ron"));
    files.sort();
    let outcome = check(&files.iter().map(PathBuf::as_path).collect::<Vec<_>>());
    outcome.assert_success();
    // A line for each, and for each variant.
    assert!(outcome.stdout.lines().count() >= files.len(), "{}", outcome.stdout);
    assert!(
        outcome.stdout.contains("shower.ron [cold]: 12 s at 60 ticks/s, 3 surfaces"),
        "{}",
        outcome.stdout
    );
}

#[test]
fn the_check_goes_on_after_a_mistake_and_names_file_and_field() {
    let folder = Folder::new();
    let good = folder.file("good.ron", &format!("({SCENE})"));
    let bad = folder.file(
        "bad.ron",
        &format!(r#"({SCENE} variants: {{"x": (events: [(at: 1.0, what: Stop("rain"))])}})"#),
    );
    let no_effect =
        folder.file("no_effect.ron", &format!("({})", SCENE.replace("tap.effect.ron", "odd.effect.ron")));
    folder.file("odd.effect.ron", "(bump: NaN)");
    let outcome = check(&[&bad, &no_effect, &good]);
    assert_eq!(outcome.code, Some(2));
    assert!(outcome.stdout.contains("good.ron: 4 s at 20 ticks/s, 2 surfaces"), "{}", outcome.stdout);
    for named in ["bad.ron: field `variants.x.events[0].what.Stop` is rain", "odd.effect.ron", "`bump`"] {
        assert!(outcome.stderr.contains(named), "{named}: {}", outcome.stderr);
    }
}

#[test]
fn the_schema_names_every_kind_of_event() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_weathering"));
    let outcome = run(command.arg("schema"));
    outcome.assert_success();
    let schema: Value = serde_json::from_str(&outcome.stdout).unwrap();
    assert_eq!(schema["title"], "ScenarioPart");
    let fields = schema["properties"].as_object().unwrap();
    for field in ["include", "variants", "seconds", "surfaces", "emitters", "events"] {
        assert!(fields.contains_key(field), "{field}");
    }
    let actions = schema["$defs"]["Action"].to_string();
    for kind in
        ["Start", "Stop", "Move", "Weather", "Camera", "Brush", "Material", "Capture", "Export", "Expect"]
    {
        assert!(actions.contains(&format!("\"{kind}\"")), "{kind}");
    }
}

#[test]
fn the_shower_comes_out_as_it_says() {
    let outcome = run(&mut replay("assets/scenarios/shower.ron", "--no-render"));
    let report = outcome.report();
    let outcomes = report["expectations"].as_array().unwrap();
    assert!(outcomes.len() >= 8 && outcomes.iter().all(|outcome| outcome["holds"] == true), "{outcomes:?}");
}
