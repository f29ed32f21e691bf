//! The folder that a replay writes into.

use std::fs;
use std::path::{Path, PathBuf};

use super::ReplayError;
use super::maps::MAP_NAMES;
use super::plots::{PLOT_FILES, PLOTS_FOLDER};
use super::series::{SERIES_FILE, TIMINGS_FILE};
use super::sheet::SHEET_FILE;
use super::video::{ANIMATION_FILE, VIDEO_FILE};
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

/// Removes what an earlier run left in the folder, so that nothing of it stands beside this one's files: pictures from
/// number `first` on, captures and exports but for those in `kept`, maps and report. The pictures before are those of the run
/// that this one goes on with.
///
/// # Errors
/// [`ReplayError::Write`] with the file.
pub(super) fn remove_earlier_run(folder: &Path, first: u32, kept: &[String]) -> Result<(), ReplayError> {
    let is_frame = |name: &str| frame_number(name).is_some_and(|number| number >= first);
    let is_capture = |name: &str| {
        name.starts_with("capture_") && name.ends_with(".png") && !kept.iter().any(|file| file == name)
    };
    let is_map = |name: &str| MAP_NAMES.iter().any(|map| name.ends_with(&format!("_{map}.png")));
    remove_files(folder, |name| name == "report.json" || is_frame(name) || is_capture(name))?;
    remove_files(&folder.join("maps"), is_map)?;
    for export in exports(folder) {
        let is_kept = |name: &str| kept.iter().any(|folder| folder == name);
        if export.file_name().and_then(|name| name.to_str()).is_some_and(is_kept) {
            continue;
        }
        let maps = export.join("maps");
        remove_files(&export, |name| name == "report.json" || name.ends_with("_weathered.glb"))?;
        remove_files(&maps, is_map)?;
        // What somebody else has put there stays, and then so do they.
        for folder in [maps, export] {
            fs::remove_dir(folder).ok();
        }
    }
    Ok(())
}

/// Removes the files of these names from a folder, if it is there.
fn remove_files(folder: &Path, is_ours: impl Fn(&str) -> bool) -> Result<(), ReplayError> {
    let Ok(entries) = fs::read_dir(folder) else { return Ok(()) };
    for entry in entries.filter_map(Result::ok) {
        if entry.file_name().to_str().is_some_and(&is_ours) {
            let path = entry.path();
            fs::remove_file(&path).map_err(|source| ReplayError::Write { path, source })?;
        }
    }
    Ok(())
}

/// The folders of a run's exports. Links are none: what they lead to is not the run's.
fn exports(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let is_export = |entry: &fs::DirEntry| {
        entry.file_type().is_ok_and(|kind| kind.is_dir())
            && entry.file_name().to_str().is_some_and(|name| name.starts_with("export_"))
    };
    entries.filter(is_export).map(|entry| entry.path()).collect()
}

/// Tells that all of a folder is there, and what it was made from: written last, removed first.
pub const DONE_FILE: &str = "done.json";

/// Removes what was made of an earlier run's pictures and numbers, the mark that it is done before all else, and what a run
/// that was killed has left half-written. `goes_on`: the rows of the run that this one goes on with stay until those of this one
/// take their place, so that they are not lost if it is killed.
///
/// # Errors
/// [`ReplayError::Write`] with the file.
pub(super) fn remove_earlier_outputs(folder: &Path, goes_on: bool) -> Result<(), ReplayError> {
    let made = [DONE_FILE, VIDEO_FILE, ANIMATION_FILE, SHEET_FILE];
    let rows = [SERIES_FILE, TIMINGS_FILE].into_iter().filter(|_| !goes_on);
    let plots = folder.join(PLOTS_FOLDER);
    let files = made.into_iter().chain(rows).map(|file| folder.join(file));
    let files = files.chain(PLOT_FILES.map(|file| plots.join(file)));
    let maps = folder.join("maps");
    for path in files {
        match fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                return Err(ReplayError::Write { path, source });
            }
            _ => {}
        }
    }
    let exports = exports(folder).into_iter().flat_map(|export| [export.join("maps"), export]);
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
            "export_b/b_weathered.glb",
        ];
        let others = [
            "frame_1.png",
            "frame_000001.png",
            "frame_abcde.png",
            "notes.txt",
            "maps/mine.png",
            "export_b/mine.glb",
            "exports/a.glb",
        ];
        for name in ours.iter().chain(&others) {
            write_atomic(&folder.path().join(name), b"x").unwrap();
        }
        remove_earlier_run(folder.path(), 0, &[]).unwrap();
        assert!(ours.iter().all(|name| !folder.path().join(name).exists()));
        assert!(others.iter().all(|name| folder.path().join(name).exists()));
        assert!(!folder.path().join("export_a").exists());
        remove_earlier_run(&folder.path().join("nowhere"), 0, &[]).unwrap();
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
        remove_earlier_run(folder.path(), 12, &[capture_file("a"), export_folder("a")]).unwrap();
        assert!(before.iter().all(|name| folder.path().join(name).exists()));
        assert!(after.iter().all(|name| !folder.path().join(name).exists()));
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
