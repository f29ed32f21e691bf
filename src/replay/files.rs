//! The folder that a replay writes into.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::ReplayError;
use super::maps::MAP_NAMES;
use super::plots::{PLOT_FILES, PLOTS_FOLDER};
use super::series::{SERIES_FILE, TIMINGS_FILE};
use super::sheet::SHEET_FILE;
use super::video::{ANIMATION_FILE, VIDEO_FILE};
use crate::input::read_file;
use crate::output::{self, refuse_file, remove_temporaries, temporary_beside};

/// Writes under a temporary name beside `path` and renames; makes missing folders. On an error nothing is left.
///
/// # Errors
/// [`ReplayError::Write`] with the path.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), ReplayError> {
    output::write_atomic(path, bytes).map_err(|source| ReplayError::Write { path: path.into(), source })
}

/// Makes the folder and checks that files can be written into it: better before a long run than after it.
///
/// # Errors
/// [`ReplayError::Write`] with the folder.
pub(super) fn require_writable(folder: &Path) -> Result<(), ReplayError> {
    let writable = refuse_file(folder)
        .and_then(|()| fs::create_dir_all(folder))
        .and_then(|()| temporary_beside(&folder.join("report.json")));
    writable.map(drop).map_err(|source| ReplayError::Write { path: folder.into(), source })
}

/// The file of a picture by its number.
pub(super) fn frame_file(number: u32) -> String {
    format!("frame_{number:05}.png")
}

/// The number of a picture by its file; `None` for what [`frame_file`] never names.
fn frame_number(name: &str) -> Option<u32> {
    let number = name.strip_prefix("frame_")?.strip_suffix(".png")?.parse::<u32>().ok()?;
    (frame_file(number) == name).then_some(number)
}

/// The file of a picture that an event asked for.
pub(super) fn capture_file(name: &str) -> String {
    format!("capture_{name}.png")
}

/// The folder of an export that an event asked for.
pub(super) fn export_folder(name: &str) -> String {
    format!("export_{name}")
}

/// The largest report of an earlier run that is read: some ten thousand surfaces.
const MAX_REPORT_BYTES: u64 = 64 << 20;

/// What an earlier run left in the folder that must not stand beside this one's files: pictures from number `first` on, captures
/// and exports but for those in `kept`, the report, and maps. Of these only those of `surfaces` and of the surfaces that a report
/// tells of are ours. The pictures before are those of the run that this one goes on with.
fn earlier_run(folder: &Path, first: u32, kept: &[String], surfaces: &BTreeSet<String>) -> Vec<PathBuf> {
    let is_frame = |name: &str| frame_number(name).is_some_and(|number| number >= first);
    let is_capture = |name: &str| {
        name.starts_with("capture_") && name.ends_with(".png") && !kept.iter().any(|file| file == name)
    };
    let mut files = files_in(folder, |name| name == "report.json" || is_frame(name) || is_capture(name));
    let surfaces = with_reported(surfaces, folder);
    files.extend(maps_in(folder, &surfaces));
    for export in exports(folder, kept) {
        files.extend(files_in(&export, |name| name == "report.json" || name.ends_with("_weathered.glb")));
        files.extend(maps_in(&export, &with_reported(&surfaces, &export)));
    }
    files
}

/// Removes what an earlier run left in the folder; see [`earlier_run`].
///
/// # Errors
/// [`ReplayError::Write`] with the file.
pub(super) fn remove_earlier_run(
    folder: &Path,
    first: u32,
    kept: &[String],
    surfaces: &BTreeSet<String>,
) -> Result<(), ReplayError> {
    for path in earlier_run(folder, first, kept, surfaces) {
        fs::remove_file(&path).map_err(|source| ReplayError::Write { path, source })?;
    }
    for export in exports(folder, kept) {
        // What somebody else has put there stays, and then so do they.
        for folder in [export.join("maps"), export] {
            fs::remove_dir(folder).ok();
        }
    }
    Ok(())
}

/// Checks that nothing that a run removes or replaces in its folder is one of `inputs`: the files that its scenario reads,
/// without links on their way.
///
/// # Errors
/// [`ReplayError::Option`] with the file.
pub(super) fn refuse_inputs(
    inputs: &[PathBuf],
    folder: &Path,
    first: u32,
    kept: &[String],
    surfaces: &BTreeSet<String>,
) -> Result<(), ReplayError> {
    let mut replaced = earlier_run(folder, first, kept, surfaces);
    replaced.extend(earlier_outputs(folder, false));
    let is_input = |path: &&PathBuf| path.canonicalize().is_ok_and(|place| inputs.contains(&place));
    let Some(input) = replaced.iter().find(is_input) else { return Ok(()) };
    let value = folder.display().to_string();
    let expected =
        format!("another folder: {}, which the scenario reads, would be replaced", input.display());
    Err(ReplayError::Option { option: "out", value, expected })
}

/// The files of these names in a folder; none if it is not there.
fn files_in(folder: &Path, is_ours: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let ours = entries.filter(|entry| entry.file_name().to_str().is_some_and(&is_ours));
    ours.map(|entry| entry.path()).collect()
}

/// The maps of surfaces that lie with a run or an export.
fn maps_in(folder: &Path, surfaces: &BTreeSet<String>) -> Vec<PathBuf> {
    files_in(&folder.join("maps"), |name| {
        let map = name.strip_suffix(".png").and_then(|name| name.rsplit_once('_'));
        map.is_some_and(|(surface, map)| MAP_NAMES.contains(&map) && surfaces.contains(surface))
    })
}

/// These surfaces, and those that the report in a folder tells of.
fn with_reported(surfaces: &BTreeSet<String>, folder: &Path) -> BTreeSet<String> {
    let bytes = read_file(&folder.join("report.json"), MAX_REPORT_BYTES).unwrap_or_default();
    let report: Value = serde_json::from_slice(&bytes).unwrap_or_default();
    let reported = report["surfaces"].as_array().into_iter().flatten();
    let reported = reported.filter_map(|surface| surface["name"].as_str()).map(String::from);
    surfaces.iter().cloned().chain(reported).collect()
}

/// The folders of a run's exports, but for those in `kept`. Links are none: what they lead to is not the run's.
fn exports(folder: &Path, kept: &[String]) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let is_name = |name: &str| name.starts_with("export_") && !kept.iter().any(|folder| folder == name);
    let is_export = |entry: &fs::DirEntry| {
        entry.file_type().is_ok_and(|kind| kind.is_dir()) && entry.file_name().to_str().is_some_and(is_name)
    };
    entries.filter(is_export).map(|entry| entry.path()).collect()
}

/// Tells that all of a folder is there, and what it was made from: written last, removed first.
pub const DONE_FILE: &str = "done.json";

/// What was made of an earlier run's pictures and numbers, the mark that it is done before all else. `goes_on`: not the rows.
fn earlier_outputs(folder: &Path, goes_on: bool) -> Vec<PathBuf> {
    let made = [DONE_FILE, VIDEO_FILE, ANIMATION_FILE, SHEET_FILE];
    let rows = [SERIES_FILE, TIMINGS_FILE].into_iter().filter(|_| !goes_on);
    let plots = folder.join(PLOTS_FOLDER);
    let files = made.into_iter().chain(rows).map(|file| folder.join(file));
    files.chain(PLOT_FILES.map(|file| plots.join(file))).collect()
}

/// Removes what was made of an earlier run's pictures and numbers, the mark that it is done before all else, and what a run
/// that was killed has left half-written. `goes_on`: the rows of the run that this one goes on with stay until those of this one
/// take their place, so that they are not lost if it is killed.
///
/// # Errors
/// [`ReplayError::Write`] with the file.
pub(super) fn remove_earlier_outputs(folder: &Path, goes_on: bool) -> Result<(), ReplayError> {
    for path in earlier_outputs(folder, goes_on) {
        match fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                return Err(ReplayError::Write { path, source });
            }
            _ => {}
        }
    }
    let (maps, plots) = (folder.join("maps"), folder.join(PLOTS_FOLDER));
    let exports = exports(folder, &[]).into_iter().flat_map(|export| [export.join("maps"), export]);
    for folder in [folder.to_path_buf(), maps, plots].into_iter().chain(exports) {
        remove_temporaries(&folder).map_err(|source| ReplayError::Write { path: folder, source })?;
    }
    Ok(())
}

/// The numbers and files of all pictures in a folder, in order.
pub(super) fn frames(folder: &Path) -> Vec<(u32, PathBuf)> {
    let entries = fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let mut frames: Vec<(u32, PathBuf)> = entries
        .filter_map(|entry| Some((frame_number(entry.file_name().to_str()?)?, entry.path())))
        .collect();
    frames.sort();
    frames
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_made_of_an_earlier_run_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let made = ["done.json", "series.csv", "timings.csv", "video.mp4", "video.apng", "sheet.png"];
        let below = [
            "plots/film.svg",
            ".weathering-a1B2c3.tmp",
            "maps/.weathering-ABCDEF.tmp",
            "plots/.weathering-123456.tmp",
            "export_a/.weathering-abcdef.tmp",
            "export_a/maps/.weathering-fedcba.tmp",
        ];
        let others = ["my.csv", "plots/mine.svg", ".tmp", ".a1B2c3.tmp", "frame_00000.png"];
        for name in made.iter().chain(&below).chain(&others) {
            write_atomic(&folder.path().join(name), b"x").unwrap();
        }
        remove_earlier_outputs(folder.path(), false).unwrap();
        assert!(made.iter().chain(&below).all(|name| !folder.path().join(name).exists()));
        assert!(others.iter().all(|name| folder.path().join(name).exists()));
        remove_earlier_outputs(&folder.path().join("nowhere"), false).unwrap();
    }

    #[test]
    fn rows_of_the_run_that_is_gone_on_with_stay() {
        let folder = tempfile::tempdir().unwrap();
        let (rows, made) = (["series.csv", "timings.csv"], ["done.json", "sheet.png", "plots/film.svg"]);
        for name in rows.iter().chain(&made) {
            write_atomic(&folder.path().join(name), b"x").unwrap();
        }
        remove_earlier_outputs(folder.path(), true).unwrap();
        assert!(rows.iter().all(|name| folder.path().join(name).exists()));
        assert!(made.iter().all(|name| !folder.path().join(name).exists()));
    }

    #[test]
    fn pictures_are_found_in_their_order() {
        let folder = tempfile::tempdir().unwrap();
        let ours = ["frame_00010.png", "frame_00002.png", "frame_100000.png"];
        let others = ["frame_7.png", "frame_000003.png", "frame_+0004.png", "frame_x.png", "sheet.png"];
        for name in ours.into_iter().chain(others) {
            write_atomic(&folder.path().join(name), b"x").unwrap();
        }
        let numbers: Vec<u32> = frames(folder.path()).into_iter().map(|(number, _)| number).collect();
        assert_eq!(numbers, [2, 10, 100_000]);
        assert!(frames(&folder.path().join("nowhere")).is_empty());
    }

    #[test]
    fn what_is_written_is_whole_and_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/c.txt");
        write_atomic(&path, b"one").unwrap();
        write_atomic(&path, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    fn names<const N: usize>(names: [&str; N]) -> BTreeSet<String> {
        names.map(String::from).into()
    }

    #[test]
    fn an_earlier_run_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let ours = [
            "report.json",
            "frame_00000.png",
            "frame_123456.png",
            "maps/a_b_film.png",
            "maps/a_since.png",
            "capture_a.png",
            "export_a/a_weathered.glb",
            "export_a/report.json",
            "export_a/maps/a_film.png",
            "export_a/maps/c_film.png",
            "export_b/b_weathered.glb",
        ];
        let others = [
            "frame_1.png",
            "frame_000001.png",
            "frame_abcde.png",
            "notes.txt",
            "maps/mine.png",
            "maps/a_mine.png",
            "maps/brick_normal.png",
            "maps/b_film.png",
            "maps/c_film.png",
            "export_b/mine.glb",
            "export_b/maps/brick_film.png",
            "exports/a.glb",
        ];
        for name in ours.iter().chain(&others) {
            write_atomic(&folder.path().join(name), b"x").unwrap();
        }
        // Of a run with other surfaces.
        for (name, surface) in [("report.json", "a"), ("export_a/report.json", "c")] {
            let report = serde_json::json!({ "surfaces": [{ "name": surface, "impacts": 1 }] });
            write_atomic(&folder.path().join(name), report.to_string().as_bytes()).unwrap();
        }
        remove_earlier_run(folder.path(), 0, &[], &names(["a_b"])).unwrap();
        assert!(ours.iter().all(|name| !folder.path().join(name).exists()));
        assert!(others.iter().all(|name| folder.path().join(name).exists()));
        assert!(!folder.path().join("export_a").exists());
        remove_earlier_run(&folder.path().join("nowhere"), 0, &[], &names([])).unwrap();
    }

    #[test]
    fn pictures_of_the_run_that_is_gone_on_with_stay() {
        let folder = tempfile::tempdir().unwrap();
        let (before, after) = (
            ["frame_00000.png", "frame_00011.png", "capture_a.png", "export_a/report.json"],
            ["frame_00012.png", "frame_100000.png", "export_ab/report.json"],
        );
        for name in before.iter().chain(&after) {
            write_atomic(&folder.path().join(name), b"x").unwrap();
        }
        let kept = [capture_file("a"), export_folder("a")];
        remove_earlier_run(folder.path(), 12, &kept, &names([])).unwrap();
        assert!(before.iter().all(|name| folder.path().join(name).exists()));
        assert!(after.iter().all(|name| !folder.path().join(name).exists()));
    }

    #[test]
    fn a_run_that_would_replace_what_its_scenario_reads_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let replaced = [
            "sheet.png",
            "capture_a.png",
            "frame_00003.png",
            "maps/ground_wetness.png",
            "export_a/maps/ground_normal.png",
            "export_a/b_weathered.glb",
        ];
        let others =
            ["clay.png", "capture_kept.png", "frame_00002.png", "frame_9.png", "maps/clay_normal.png"];
        for name in replaced.iter().chain(&others) {
            write_atomic(&folder.path().join(name), b"x").unwrap();
        }
        let place = folder.path().canonicalize().unwrap();
        let check = |folder: &Path, input: &str| {
            let (inputs, kept) = ([place.join("none.png"), place.join(input)], [capture_file("kept")]);
            refuse_inputs(&inputs, folder, 3, &kept, &names(["ground"])).map_err(|error| error.to_string())
        };
        for name in replaced {
            let error = check(folder.path(), name).unwrap_err();
            assert!(error.contains("`out`") && error.contains(name), "{error}");
        }
        for name in others {
            check(folder.path(), name).unwrap();
        }
        #[cfg(unix)]
        {
            let out = folder.path().join("out");
            fs::create_dir(&out).unwrap();
            std::os::unix::fs::symlink(folder.path().join("maps"), out.join("maps")).unwrap();
            assert!(check(&out, "maps/ground_wetness.png").is_err());
            check(&out, "sheet.png").unwrap();
        }
        check(&folder.path().join("nowhere"), replaced[0]).unwrap();
    }

    #[test]
    fn a_failure_names_the_file_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("taken");
        fs::create_dir(&path).unwrap();
        fs::write(path.join("inside"), b"x").unwrap();
        let error = write_atomic(&path, b"one").unwrap_err().to_string();
        assert!(error.contains("taken"), "{error}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
