//! What a replay makes of its numbers and pictures, and many replays at once.

use std::collections::BTreeMap;
use std::fs;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use super::replay::{Outcome, TAP, files_below, number, read_report, replay, run, surfaces};

const HOSE: &str = "assets/scenarios/hose.ron";

/// Rows of a CSV file, each by the names of its columns.
fn csv(path: &Path) -> Vec<BTreeMap<String, f64>> {
    let text = fs::read_to_string(path).expect("there is a table");
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("a line of names").split(',').collect();
    let row = |line: &str| -> BTreeMap<String, f64> {
        let numbers: Vec<f64> = line.split(',').map(|number| number.parse().expect("a number")).collect();
        assert_eq!(numbers.len(), names.len(), "{line}");
        names.iter().map(|name| name.to_string()).zip(numbers).collect()
    };
    lines.map(row).collect()
}

fn column(rows: &[BTreeMap<String, f64>], name: &str) -> Vec<f64> {
    rows.iter().map(|row| row[name]).collect()
}

#[test]
fn the_series_ends_with_what_the_report_says() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    run(replay(HOSE, "--no-render --seconds 2 --every 0.5 --out").arg(&out)).assert_success();
    let (report, rows) = (read_report(&out), csv(&out.join("series.csv")));
    assert_eq!(column(&rows, "tick"), [0.0, 30.0, 60.0, 90.0, 120.0]);
    assert_eq!(column(&rows, "seconds"), [0.0, 0.5, 1.0, 1.5, 2.0]);
    let (first, last) = (&rows[0], &rows[4]);
    for name in ["alive", "emitted", "hit", "expired", "refused"] {
        assert_eq!(last[&format!("particles_{name}")], number(&report["particles"][name]), "{name}");
    }
    let is_close = |ml: f64, mm3: f64| (ml * 1000.0 - mm3).abs() <= 1.0e-9 * mm3.abs();
    for name in [
        "emitted",
        "melted",
        "painted",
        "on_surfaces",
        "evaporated",
        "run_off",
        "wiped",
        "missed",
        "in_flight",
        "evicted",
    ] {
        let (ml, mm3) = (last[&format!("{name}_ml")], number(&report["water"][format!("{name}_mm3")]));
        assert!(is_close(ml, mm3), "{name}: {ml} ml, {mm3} mm³");
    }
    let mut film_ml = 0.0;
    for surface in surfaces(&report) {
        let of = |name: &str| last[&format!("{}.{name}", surface["name"].as_str().unwrap())];
        for name in ["film", "absorbed", "received", "evaporated", "dripped", "dust", "mud", "snow"] {
            let (ml, mm3) = (of(&format!("{name}_ml")), number(&surface[format!("{name}_mm3")]));
            assert!(is_close(ml, mm3), "{name}: {ml} ml, {mm3} mm³");
        }
        assert_eq!(of("wet_fraction"), number(&surface["wet_fraction"]));
        assert_eq!(of("impacts"), number(&surface["impacts"]));
        let found = of("film_ml") + of("absorbed_ml") + of("evaporated_ml") + of("dripped_ml");
        assert!((found - of("received_ml")).abs() <= 1.0e-9 * of("received_ml"), "{surface}");
        // A mean depth is a volume over an area, and it is the same area for both.
        let areas = [of("film_ml") / of("film_mm"), of("absorbed_ml") / of("absorbed_mm")];
        assert!(areas[0].is_nan() || areas[1].is_nan() || (areas[0] / areas[1] - 1.0).abs() < 1.0e-9);
        film_ml += of("film_ml");
    }
    assert!(film_ml > 0.0 && last["particles_hit"] > 0.0, "{last:?}");
    assert!(first.values().all(|&number| number == 0.0), "{first:?}");
    assert!(column(&rows, "emitted_ml").is_sorted() && column(&rows, "particles_hit").is_sorted());
}

#[test]
fn the_series_is_the_same_whatever_it_is_computed_with() {
    let folder = tempfile::tempdir().unwrap();
    let series = |name: &str, options: &str| {
        let out = folder.path().join(name);
        run(replay(HOSE, &format!("--no-render --seconds 1.5 {options} --out")).arg(&out)).assert_success();
        fs::read_to_string(out.join("series.csv")).unwrap()
    };
    let one = series("one", "--threads 1");
    // A row each second, and one at the end.
    assert_eq!(one.lines().count(), 1 + 3);
    assert_eq!(series("two", "--threads 2"), one);
    let timings = csv(&folder.path().join("one/timings.csv"));
    assert_eq!(column(&timings, "ticks"), [60.0, 30.0]);
    assert_eq!(column(&timings, "seconds"), [1.0, 1.5]);
    for name in ["first", "emit", "integrate", "trace", "deposit", "flow", "last", "outside"] {
        assert!(column(&timings, &format!("{name}_ms")).iter().all(|&ms| ms > 0.0), "{name}");
    }
}

#[test]
fn a_run_that_goes_on_keeps_the_rows_before() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, parts, state] = ["whole", "parts", "state"].map(|name| folder.path().join(name));
    run(replay(HOSE, "--no-render --seconds 3 --out").arg(&whole)).assert_success();
    let mut first = replay(HOSE, "--no-render --seconds 1.5 --out");
    run(first.arg(&parts).arg("--save-state").arg(&state)).assert_success();
    let mut rest = replay(HOSE, "--no-render --seconds 3 --out");
    run(rest.arg(&parts).arg("--resume").arg(&state)).assert_success();
    let rows = csv(&parts.join("series.csv"));
    assert_eq!(column(&rows, "tick"), [0.0, 60.0, 90.0, 120.0, 180.0]);
    let without_seam: Vec<_> = rows.into_iter().filter(|row| row["tick"] != 90.0).collect();
    assert_eq!(without_seam, csv(&whole.join("series.csv")));
    assert_eq!(column(&csv(&parts.join("timings.csv")), "tick"), [60.0, 90.0, 120.0, 180.0]);
}

#[test]
fn plots_have_lines_and_units() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    run(replay(HOSE, "--no-render --seconds 2 --out").arg(&out)).assert_success();
    for (file, unit, lines) in [
        ("wetness", "part of the area", 3),
        ("film", "mm", 3),
        ("absorbed", "mm", 3),
        ("water", "ml", 8),
        ("particles", "particles", 3),
        ("timings", "ms", 8),
    ] {
        let svg = fs::read_to_string(out.join(format!("plots/{file}.svg"))).unwrap();
        assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"), "{file}");
        assert!(svg.contains(unit) && svg.contains("weather time, s") && svg.contains("hose.ron"), "{file}");
        assert_eq!(svg.matches("<polyline").count(), lines, "{file}");
    }
    assert!(fs::read_to_string(out.join("plots/film.svg")).unwrap().contains(">bunny</text>"));
}

#[test]
fn pictures_become_a_video_and_a_contact_sheet() {
    if crate::common::skips_gpu() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (out, programs) = (folder.path().join("out"), folder.path().join("programs"));
    fs::create_dir(&programs).unwrap();
    let run_with_programs = |paths: &str| {
        let mut command = replay(HOSE, "--seconds 1 --fps 4 --size 64x48 --video --sheet=4 --out");
        // Vulkan's window-system code wants one even when no window is opened.
        run(command.arg(&out).env("XDG_RUNTIME_DIR", folder.path()).env("PATH", paths)).assert_success();
    };
    let frames: Vec<PathBuf> = (0..4).map(|number| out.join(format!("frame_{number:05}.png"))).collect();

    // No ffmpeg anywhere.
    run_with_programs(&programs.display().to_string());
    assert!(!out.join("video.mp4").exists());
    let decoder = png::Decoder::new(BufReader::new(fs::File::open(out.join("video.apng")).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    assert_eq!(reader.info().size(), (64, 48));
    assert_eq!(reader.info().animation_control().map(|control| control.num_frames), Some(4));
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    for frame in &frames {
        reader.next_frame(&mut pixels).unwrap();
        assert!(pixels == image::open(frame).unwrap().into_rgb8().into_raw(), "{}", frame.display());
    }
    let sheet = image::open(out.join("sheet.png")).unwrap();
    assert_eq!((sheet.width(), sheet.height()), (2 * 72 + 8, 2 * (48 + 14 + 16) + 8));

    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // One that takes the pictures for the video.
        let ffmpeg = programs.join("ffmpeg");
        fs::write(&ffmpeg, "#!/bin/sh\nfor last; do :; done\ncat > \"$last\"\n").unwrap();
        fs::set_permissions(&ffmpeg, fs::Permissions::from_mode(0o755)).unwrap();
        run_with_programs(&format!("{}:/usr/bin:/bin", programs.display()));
        let fed: Vec<u8> = frames.iter().flat_map(|frame| fs::read(frame).unwrap()).collect();
        assert!(fs::read(out.join("video.mp4")).unwrap() == fed);
        assert!(!out.join("video.apng").exists(), "that of the run before is still there");
        // One that is broken.
        fs::write(&ffmpeg, "#!/bin/sh\necho no such encoder >&2\nexit 1\n").unwrap();
        run_with_programs(&format!("{}:/usr/bin:/bin", programs.display()));
        assert!(out.join("video.apng").exists() && !out.join("video.mp4").exists());
    }
    assert!(!files_below(&out).iter().any(|name| name.ends_with(".tmp")));
}

#[test]
fn what_cannot_be_made_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for (options, named) in [
        ("--every 0", "`every`"),
        ("--every NaN", "`every`"),
        ("--every 1e9", "`every`"),
        ("--no-render --video", "--video"),
        ("--no-render --sheet", "--sheet"),
        ("--sheet=0", "`sheet`"),
        ("--threads 0", "`threads`"),
        ("--threads 20000", "1 to 1024"),
        ("--jobs 0", "--jobs"),
        ("--only 1", "--only"),
        ("--jobs 2 --resume state", "--resume"),
        ("--only 0 --save-state state", "--save-state"),
        ("other/hose.ron", "the same folder"),
    ] {
        run(replay(HOSE, options).arg("--out").arg(&out)).assert_refused(&[named], &out);
    }
    run(&mut replay(HOSE, "--no-render --jobs 2")).assert_refused(&["--out"], &out);
    run(&mut replay(HOSE, "--video")).assert_refused(&["--out"], &out);
}

/// A folder of scenarios.
struct Farm(TempDir);

impl Farm {
    fn new(names: &[&str]) -> Self {
        let farm = Self(tempfile::tempdir().unwrap());
        let effect = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/effects/hose.effect.ron");
        farm.write("effects/tap.effect.ron", &fs::read_to_string(effect).unwrap());
        for name in names {
            farm.write(&format!("scenarios/{name}.ron"), &TAP.replace("seconds: 1.0", "seconds: 0.25"));
        }
        farm
    }

    fn write(&self, name: &str, text: &str) {
        let path = self.0.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn out(&self, name: &str) -> PathBuf {
        self.0.path().join("out").join(name)
    }

    fn command(&self, names: &[&str], options: &str) -> Command {
        let file = |name: &&str| self.0.path().join(format!("scenarios/{name}.ron"));
        let mut command = replay(file(&names[0]), "--no-render");
        command.args(names[1..].iter().map(file)).args(options.split_whitespace());
        command.arg("--out").arg(self.out(""));
        command
    }

    fn run(&self, names: &[&str], options: &str) -> Outcome {
        run(&mut self.command(names, options))
    }
}

/// What became of each scenario, by the table at the end.
fn became(outcome: &Outcome) -> Vec<(&str, &str)> {
    let row = |line| {
        let mut words = str::split_whitespace(line);
        (words.next().unwrap_or_default(), words.next().unwrap_or_default())
    };
    outcome.stdout.lines().skip(1).map(row).collect()
}

#[test]
fn of_many_scenarios_what_is_done_is_not_done_again() {
    let farm = Farm::new(&["a", "b"]);
    let all = |options: &str| {
        let outcome = farm.run(&["a", "b"], options);
        outcome.assert_success();
        became(&outcome).into_iter().map(|(name, what)| format!("{name} {what}")).collect::<Vec<_>>()
    };
    assert_eq!(all("--jobs 2"), ["a ran", "b ran"]);
    let first = read_report(&farm.out("a"));
    for name in ["a", "b"] {
        let files = files_below(&farm.out(name));
        for file in ["done.json", "report.json", "series.csv", "plots/film.svg", "maps/ground_film.png"] {
            assert!(files.contains(file), "{name}: {files:?}");
        }
    }
    let written = || fs::metadata(farm.out("a").join("report.json")).unwrap().modified().unwrap();
    let before = written();
    // Neither the number of jobs nor that of threads makes another request of it.
    assert_eq!(all("--jobs 1 --threads 1"), ["a skipped", "b skipped"]);
    assert_eq!(written(), before);

    fs::remove_file(farm.out("a").join("done.json")).unwrap();
    assert_eq!(all("--jobs 2"), ["a ran", "b skipped"]);
    assert_eq!(read_report(&farm.out("a"))["digest"], first["digest"]);
    fs::write(farm.out("b").join("report.json"), "{").unwrap();
    assert_eq!(all(""), ["a skipped", "b ran"]);
    farm.write("scenarios/a.ron", &TAP.replace("seconds: 1.0", "seconds: 0.5"));
    assert_eq!(all(""), ["a ran", "b skipped"]);
    assert_ne!(read_report(&farm.out("a"))["digest"], first["digest"]);
    assert_eq!(all("--seconds 0.125"), ["a ran", "b ran"]);
    farm.write("effects/tap.effect.ron", "(wetness_of: nothing)");
    let outcome = farm.run(&["a", "b"], "--seconds 0.125");
    assert_eq!(outcome.code, Some(2), "{}", outcome.stdout);
}

#[test]
fn one_that_fails_does_not_stop_the_others() {
    let farm = Farm::new(&["a", "b"]);
    farm.write("scenarios/torn.ron", "(seconds: 1.0");
    let outcome = farm.run(&["a", "torn", "b"], "--jobs 2");
    assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
    assert_eq!(became(&outcome), [("a", "ran"), ("torn", "failed"), ("b", "ran")]);
    assert!(outcome.stderr.contains("1 of 3 scenarios failed"), "{}", outcome.stderr);
    assert!(outcome.stdout.contains("torn.ron"), "{}", outcome.stdout);
    assert!(!farm.out("torn").join("done.json").exists());
    // A fault that only the child can find: a folder where a file should be.
    fs::create_dir_all(farm.out("c/report.json/in")).unwrap();
    farm.write("scenarios/c.ron", TAP);
    let outcome = farm.run(&["a", "c"], "");
    assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
    assert_eq!(became(&outcome), [("a", "skipped"), ("c", "failed")]);
    assert!(outcome.stdout.contains("report.json"), "{}", outcome.stdout);
    assert!(!farm.out("c").join("done.json").exists());
}

#[test]
fn what_is_not_as_expected_is_done_all_the_same_and_told_each_time() {
    let farm = Farm::new(&["a"]);
    let expecting = |above: &str| {
        let events = format!(
            "events: [(at: 1.0, what: Expect(quantity: WaterMl, surface: \"ground\", above: {above}))],\n    emitters: ["
        );
        assert_eq!(TAP.matches("emitters: [").count(), 1);
        TAP.replace("emitters: [", &events)
    };
    farm.write("scenarios/odd.ron", &expecting("1000.0"));
    let first = farm.run(&["a", "odd"], "");
    assert_eq!(first.code, Some(1), "{}", first.stderr);
    assert_eq!(became(&first), [("a", "ran"), ("odd", "ran")]);
    assert!(first.stdout.contains("1 not as expected"), "{}", first.stdout);
    assert!(first.stderr.contains("odd: not as expected: events[0]"), "{}", first.stderr);
    let again = farm.run(&["a", "odd"], "--jobs 2");
    assert_eq!(again.code, Some(1), "{}", again.stderr);
    assert_eq!(became(&again), [("a", "skipped"), ("odd", "skipped")]);
    // Once it is as expected, all is well.
    farm.write("scenarios/odd.ron", &expecting("0.0"));
    farm.run(&["a", "odd"], "").assert_success();
    // What fails weighs more.
    farm.write("scenarios/odd.ron", &expecting("1000.0"));
    farm.write("scenarios/torn.ron", "(seconds: 1.0");
    assert_eq!(farm.run(&["odd", "torn"], "").code, Some(2));
}

#[test]
fn a_task_of_an_array_runs_its_own_scenario() {
    let farm = Farm::new(&["a", "b", "c"]);
    let names = ["a", "b", "c"];
    let outcome = farm.run(&names, "--only 1");
    outcome.assert_success();
    assert_eq!(became(&outcome), [("b", "ran")]);
    assert!(!farm.out("a").exists() && !farm.out("c").exists());
    let outcome = farm.run(&names, "--jobs 3");
    assert_eq!(became(&outcome), [("a", "ran"), ("b", "skipped"), ("c", "ran")]);
    let outcome = farm.run(&names, "--only 3");
    assert_eq!(outcome.code, Some(2));
    assert!(outcome.stderr.contains("0 to 2"), "{}", outcome.stderr);
}

fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < Duration::from_secs(120), "{what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn what_is_killed_counts_as_nothing_and_is_run_again() {
    let farm = Farm::new(&["short"]);
    farm.write("scenarios/long.ron", &TAP.replace("seconds: 1.0", "seconds: 80000.0"));
    let mut batch = farm
        .command(&["short", "long"], "--jobs 1")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    wait_until("the second one never began", || farm.out("long").exists());
    batch.kill().unwrap();
    batch.wait().unwrap();
    let files = files_below(&farm.out("long"));
    assert!(!files.contains("done.json") && !files.contains("report.json"), "{files:?}");
    farm.write("scenarios/long.ron", TAP);
    let outcome = farm.run(&["short", "long"], "--jobs 1");
    outcome.assert_success();
    assert_eq!(became(&outcome), [("short", "skipped"), ("long", "ran")]);
}

#[test]
fn a_child_ends_with_whoever_started_it() {
    let farm = Farm::new(&[]);
    farm.write("scenarios/long.ron", &TAP.replace("seconds: 1.0", "seconds: 80000.0"));
    let mut child = replay(farm.0.path().join("scenarios/long.ron"), "--no-render --end-with-input --out")
        .arg(farm.out("long"))
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    wait_until("it never began", || farm.out("long").exists());
    assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
    drop(child.stdin.take());
    wait_until("it goes on", || child.try_wait().unwrap().is_some());
    assert_eq!(child.wait().unwrap().code(), Some(3));
    assert!(!farm.out("long").join("report.json").exists());
}
