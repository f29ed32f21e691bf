//! What goes wrong around the program: it is killed while it writes, the disk is full, a folder cannot be written, nothing can
//! be drawn. Whatever happens, no file under its final name is half a file, the message says what is wrong, and the next start
//! works.
#![cfg(unix)]

use std::ffi::OsStr;
use std::fs::{self, File};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use bevy_weathering::save::SavedScene;
use serde_json::Value;

use super::common::Random;
use super::replay::{Outcome, files_below, replay, run};

/// Rain on three floors, a second of it.
fn scene(folder: &Path) -> PathBuf {
    let floor = |name: &str, x: f32| {
        format!(
            r#"(name: "{name}", mesh: Ground(size: (1.0, 1.0), cells: (2, 2)), material: "brick",
                position: ({x:?}, 0.0, 0.0), rotation_deg: (8.0, 0.0, 0.0), maps: (map_size: 128)),"#
        )
    };
    let floors: String =
        [("left", -1.0), ("middle", 0.0), ("right", 1.0)].map(|(name, x)| floor(name, x)).concat();
    let text = format!(
        r#"(
            seconds: 1.0,
            tick_hz: 30,
            camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
            materials: {{"brick": (porous: (capacity_mm: 0.5, sorptivity: 1.0, efflorescence: 0.5))}},
            surfaces: [{floors}],
            emitters: [(
                name: "rain",
                effect: "rain.effect.ron",
                rate: 400.0,
                shape: Sky(half_size: (1.5, 0.5)),
                speed: 5.0,
                lifetime: 2.0,
                keys: [(position: (0.0, 1.0, 0.0), target: (0.0, 0.0, 0.0))],
            )],
        )"#
    );
    let effect = "(volume_mm3: 60.0, stamp_radius: 0.03, diffuse: (color: (0.4, 0.3, 0.2), opacity: 0.6))";
    fs::write(folder.join("rain.effect.ron"), effect).unwrap();
    let file = folder.join("rain.ron");
    fs::write(&file, text).unwrap();
    file
}

/// The same program, started by a shell that first does something else.
fn through_shell(first: &str, command: &Command) -> Command {
    let mut shell = Command::new("sh");
    shell
        .arg("-c")
        .arg(format!("{first}; exec \"$0\" \"$@\""))
        .arg(command.get_program())
        .args(command.get_args());
    shell.current_dir(env!("CARGO_MANIFEST_DIR"));
    shell
}

fn is_temporary(name: &str) -> bool {
    name.contains(".weathering-") || name.contains(".saving-")
}

fn leftovers(folder: &Path) -> Vec<String> {
    files_below(folder).into_iter().filter(|name| is_temporary(name)).collect()
}

/// That each file below a folder, but for temporary ones, is whole.
fn assert_whole(folder: &Path) {
    if !folder.exists() {
        return;
    }
    for name in files_below(folder).iter().filter(|name| !is_temporary(name)) {
        let path = folder.join(name);
        match path.extension().and_then(OsStr::to_str) {
            Some("png") => drop(image::open(&path).unwrap_or_else(|error| panic!("{name}: {error}"))),
            Some("json") => {
                let bytes = fs::read(&path).unwrap();
                let report: Result<Value, _> = serde_json::from_slice(&bytes);
                assert!(report.is_ok(), "{name}: {report:?}");
            }
            Some("ron") => {}
            Some("svg") => assert!(fs::read_to_string(&path).unwrap().ends_with("</svg>\n"), "{name}"),
            Some("csv") => assert!(fs::read_to_string(&path).unwrap().ends_with('\n'), "{name}"),
            _ => panic!("{name} is none of ours"),
        }
    }
}

/// That a run failed with exit code 2 and a message that has all of `named`.
fn assert_failed(outcome: &Outcome, named: &[&str]) {
    assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
    assert!(!outcome.stderr.contains("panicked"), "{}", outcome.stderr);
    for name in named {
        assert!(outcome.stderr.contains(name), "no {name:?} in: {}", outcome.stderr);
    }
}

#[test]
fn killed_at_any_moment_it_leaves_no_half_files_and_starts_again() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene(folder.path());
    let (out, kept) = (folder.path().join("run/out"), folder.path().join("run/kept"));
    let command = || {
        let mut command = replay(&file, "--no-render --out");
        command.arg(&out).arg("--save-state").arg(&kept);
        command
    };
    let begun = Instant::now();
    run(&mut command()).assert_success();
    let whole_run = begun.elapsed();
    let mut random = Random(7);
    for number in 0..10 {
        let mut child = command().stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        // Most of the writing is done towards the end.
        let part = if number < 2 { 0.0 } else { 0.5 };
        let part = part + (1.05 - part) * random.below(1000) as f64 / 1000.0;
        std::thread::sleep(whole_run.mul_f64(part));
        child.kill().unwrap();
        child.wait().unwrap();
        assert_whole(&out);
        // The one of before, or the new one.
        let saved = SavedScene::read(&kept).unwrap_or_else(|error| panic!("killed after {part}: {error}"));
        assert_eq!(saved.tick(), 30);
        assert_whole(&kept);
    }
    run(&mut command()).assert_success();
    assert_eq!(leftovers(&folder.path().join("run")), Vec::<String>::new());
    run(replay(&file, "--no-render --resume").arg(&kept)).assert_success();
}

#[test]
fn killed_in_the_middle_of_a_save_it_keeps_a_whole_scene() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene(folder.path());
    let kept = folder.path().join("kept");
    let command = || {
        let mut command = replay(&file, "--no-render --save-state");
        command.arg(&kept);
        command
    };
    run(&mut command()).assert_success();
    // What is being written, as long as it has not been moved to its place.
    let unfinished = || {
        let mut entries = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
        entries.find(|path| is_temporary(&path.file_name().unwrap().to_string_lossy()))
    };
    let has_files =
        |hidden: PathBuf| fs::read_dir(hidden.join("new")).is_ok_and(|mut entries| entries.next().is_some());
    let mut caught = 0;
    // A fast disk is seldom caught.
    for _ in 0..30 {
        if caught == 3 {
            break;
        }
        if let Some(left) = unfinished() {
            fs::remove_dir_all(left).unwrap();
        }
        let mut child = command().stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        while child.try_wait().unwrap().is_none() {
            if unfinished().is_some_and(has_files) {
                child.kill().unwrap();
                break;
            }
            std::thread::sleep(Duration::from_micros(200));
        }
        child.wait().unwrap();
        caught += u32::from(unfinished().is_some_and(has_files));
        assert_eq!(SavedScene::read(&kept).unwrap().tick(), 30);
        assert_whole(&kept);
    }
    assert!(caught > 0, "it was never killed while it saved");
    run(&mut command()).assert_success();
    assert_eq!(unfinished(), None);
    assert_eq!(SavedScene::read(&kept).unwrap().tick(), 30);
}

/// Moments that are too short to be hit by chance.
#[test]
fn a_scene_that_was_about_to_be_moved_is_found_and_what_was_left_is_removed() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene(folder.path());
    let (out, kept) = (folder.path().join("out"), folder.path().join("kept"));
    let save = || run(replay(&file, "--no-render --save-state").arg(&kept));
    save().assert_success();
    // Killed when the old scene had been moved aside.
    let hidden = folder.path().join(".kept.saving-killed");
    fs::create_dir(&hidden).unwrap();
    fs::create_dir(hidden.join("old")).unwrap();
    fs::rename(&kept, hidden.join("new")).unwrap();
    run(replay(&file, "--no-render --resume").arg(&kept)).assert_success();
    assert!(kept.join("state.ron").exists());
    save().assert_success();
    // Killed when a file was half written.
    fs::create_dir_all(out.join("maps")).unwrap();
    for name in ["out/.weathering-abc123.tmp", "out/maps/.weathering-abc124.tmp"] {
        fs::write(folder.path().join(name), "half").unwrap();
    }
    run(replay(&file, "--no-render --out").arg(&out)).assert_success();
    assert_eq!(leftovers(folder.path()), Vec::<String>::new());
    assert!(!hidden.exists());
}

#[test]
fn files_that_grow_too_large_are_told_and_not_left_half() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene(folder.path());
    let (out, kept) = (folder.path().join("out"), folder.path().join("kept"));
    run(replay(&file, "--no-render --save-state").arg(&kept)).assert_success();
    let before = fs::read(kept.join("state.ron")).unwrap();
    let mut to_out = replay(&file, "--no-render --out");
    to_out.arg(&out);
    let mut to_state = replay(&file, "--no-render --save-state");
    to_state.arg(&kept);
    // 512 bytes, with an error in place of a signal.
    let limit = "trap '' XFSZ; ulimit -f 1";
    for (command, folder) in [(&to_out, &out), (&to_state, &kept)] {
        let outcome = run(&mut through_shell(limit, command));
        assert_failed(&outcome, &["error: ", ".png", "too large"]);
        assert_whole(folder);
    }
    assert!(!out.join("report.json").exists());
    // With the signal it dies without a word.
    let outcome = run(&mut through_shell("ulimit -f 1", &to_state));
    assert_eq!(outcome.code, None, "{}", outcome.stderr);
    assert!(SavedScene::read(&kept).is_ok());
    assert_eq!(fs::read(kept.join("state.ron")).unwrap(), before);
    for command in [&mut to_out, &mut to_state] {
        run(command).assert_success();
    }
    assert_eq!(leftovers(folder.path()), Vec::<String>::new());
}

/// A file system of its own, for those who may mount one.
struct Mount(tempfile::TempDir);

impl Mount {
    fn new(options: &str) -> Option<Self> {
        let folder = tempfile::tempdir().ok()?;
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", options, "tmpfs"]).arg(folder.path());
        let mounted = mount.stderr(Stdio::null()).status().is_ok_and(|status| status.success());
        mounted.then_some(Self(folder))
    }
}

impl Drop for Mount {
    fn drop(&mut self) {
        // Whether it worked shows when the folder is removed.
        let _ = Command::new("umount").arg(self.0.path()).status();
    }
}

#[test]
fn a_full_disk_is_told_and_holds_no_half_files() {
    let Some(disk) = Mount::new("size=64k") else {
        eprintln!("skipped: a file system may not be mounted here");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = scene(folder.path());
    let (out, kept) = (disk.0.path().join("out"), disk.0.path().join("kept"));
    let outcome = run(replay(&file, "--no-render --out").arg(&out));
    assert_failed(&outcome, &["error: ", "out/maps/", "No space left"]);
    assert_whole(&out);
    assert_eq!(leftovers(&out), Vec::<String>::new());
    assert!(!out.join("report.json").exists());
    fs::remove_dir_all(&out).unwrap();
    let outcome = run(replay(&file, "--no-render --save-state").arg(&kept));
    assert_failed(&outcome, &["error: ", "No space left"]);
    assert!(!kept.exists());
    assert_eq!(files_below(disk.0.path()).len(), 0);
}

#[test]
fn output_that_nobody_can_take_is_an_error_and_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene(folder.path());
    let program = env!("CARGO_BIN_EXE_weathering");
    let mut schema = Command::new(program);
    schema.arg("schema");
    let mut check = Command::new(program);
    check.arg("check").arg(&file);
    let mut bake = Command::new(program);
    bake.args(["bake", "assets/models/bunny_1000.glb", "--minutes", "0.01", "--size", "64"]);
    bake.args(["--texture-size", "64", "--out"]).arg(folder.path().join("baked"));
    let mut batch = replay(&file, "--no-render --seconds 0.1 --jobs 1 --out");
    batch.arg(folder.path().join("many"));
    for mut command in [schema, check, bake, batch, replay(&file, "--no-render --seconds 0.1")] {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let outcome = command.stdout(full).output().unwrap();
        let message = String::from_utf8_lossy(&outcome.stderr);
        assert_eq!(outcome.status.code(), Some(2), "{message}");
        assert!(message.contains("cannot write to standard output"), "{message}");
        assert!(!message.contains("panicked"), "{message}");
    }
}

#[test]
fn a_reader_that_has_had_enough_is_no_error_and_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene(folder.path());
    let nobody = || std::io::pipe().unwrap().1;
    let program = env!("CARGO_BIN_EXE_weathering");
    let mut schema = Command::new(program);
    schema.arg("schema");
    let mut check = Command::new(program);
    check.arg("check").arg(&file);
    for mut command in [schema, check, replay(&file, "--no-render --seconds 0.1")] {
        let outcome = command.stdout(nobody()).output().unwrap();
        let message = String::from_utf8_lossy(&outcome.stderr);
        assert_eq!(outcome.status.code(), Some(0), "{message}");
        assert!(!message.contains("error"), "{message}");
    }
    let mut missing = Command::new(program);
    missing.args(["check", "there is none.ron"]);
    assert_eq!(missing.stderr(nobody()).output().unwrap().status.code(), Some(2));
}

#[test]
fn what_was_mixed_up_is_told_with_what_does_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene(folder.path());
    let taken = folder.path().join("taken");
    fs::write(&taken, "mine").unwrap();
    let outcome = run(replay(&file, "--no-render --seconds 0.1 --out").arg(&taken));
    assert_failed(&outcome, &["taken", "it is a file, not a folder"]);
    assert_eq!(fs::read_to_string(&taken).unwrap(), "mine");
    let model = "assets/models/bunny_1000.glb";
    assert_failed(&run(&mut replay(model, "--no-render")), &[model, "weathering sandbox"]);
    let mut bake = Command::new(env!("CARGO_BIN_EXE_weathering"));
    bake.arg("bake").arg(&file).arg("--out").arg(folder.path().join("baked"));
    assert_failed(&run(&mut bake), &["replay --export"]);
    assert!(!folder.path().join("baked").exists());
}

#[test]
fn a_folder_that_is_read_only_is_told_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene(folder.path());
    let closed = folder.path().join("closed");
    fs::create_dir(&closed).unwrap();
    fs::set_permissions(&closed, fs::Permissions::from_mode(0o555)).unwrap();
    // Permissions do not stop everyone.
    let stops = fs::write(closed.join("probe"), "").is_err();
    let mount = if stops { None } else { Mount::new("ro,size=64k") };
    let place = match &mount {
        Some(mount) => mount.0.path(),
        None if stops => closed.as_path(),
        None => {
            eprintln!("skipped: nothing is read-only for this user");
            return;
        }
    };
    for option in ["--out", "--save-state"] {
        for target in [place.to_owned(), place.join("below")] {
            let outcome = run(replay(&file, "--no-render").arg(option).arg(&target));
            // The file system of its own cannot be replaced by a saved scene anyhow.
            assert_failed(&outcome, &["cannot write", &target.display().to_string()]);
            assert_eq!(files_below(place).len(), 0, "{option}");
        }
    }
}

#[test]
fn files_in_the_place_of_folders_stay_and_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene(folder.path());
    let mine = folder.path().join("mine");
    fs::write(&mine, "mine").unwrap();
    for option in ["--out", "--save-state"] {
        for target in [mine.clone(), mine.join("below")] {
            let outcome = run(replay(&file, "--no-render").arg(option).arg(&target));
            assert_failed(&outcome, &["cannot write", "mine"]);
            assert_eq!(fs::read_to_string(&mine).unwrap(), "mine", "{option}");
        }
    }
    let out = folder.path().join("out");
    fs::create_dir(&out).unwrap();
    fs::write(out.join("maps"), "mine").unwrap();
    let outcome = run(replay(&file, "--no-render --out").arg(&out));
    assert_failed(&outcome, &["error: ", "maps"]);
    assert_eq!(files_below(&out).into_iter().collect::<Vec<_>>(), ["maps"]);
    assert_eq!(fs::read_to_string(out.join("maps")).unwrap(), "mine");
}

#[test]
fn without_a_driver_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene(folder.path());
    let (out, kept) = (folder.path().join("out"), folder.path().join("kept"));
    let mut command = replay(&file, "--out");
    command.arg(&out).arg("--save-state").arg(&kept);
    for name in ["VK_ICD_FILENAMES", "VK_DRIVER_FILES"] {
        command.env(name, "/nonexistent");
    }
    command.env("WGPU_BACKEND", "vulkan").env("XDG_RUNTIME_DIR", folder.path());
    let outcome = run(&mut command);
    assert_failed(&outcome, &["no graphics adapter", "mesa-vulkan-drivers", "--no-render"]);
    assert!(!out.exists() && !kept.exists());
}

#[cfg(target_os = "linux")]
#[test]
fn a_display_without_a_server_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene(folder.path());
    let out = folder.path().join("out");
    for (display, named) in [(":4321", "DISPLAY is \":4321\""), ("", "DISPLAY is not set")] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_weathering"));
        command.arg("sandbox").arg(&file).arg("--out").arg(&out).env("DISPLAY", display);
        command.env("XDG_RUNTIME_DIR", folder.path()).env("XDG_CONFIG_HOME", folder.path().join("config"));
        assert_failed(&run(&mut command), &["error: no display", named, "weathering replay"]);
        assert!(!out.exists() && !folder.path().join("config").exists());
    }
}
