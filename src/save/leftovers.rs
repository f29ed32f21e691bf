//! What a run leaves beside the folder that it saves into if it is killed while it does so.
//!
//! A scene is written into a hidden folder beside its place: all of it into `new`, then what was there is moved to `old`, then
//! `new` to the place. Whoever is killed before that leaves a folder that nobody wants; whoever is killed between the two moves,
//! a whole scene that only has to be moved on.

use std::path::{Path, PathBuf};
use std::{fs, io};

use tempfile::TempDir;

use super::maps::STATE;
use crate::output::without_temporary_name;

/// The hidden folder's part that becomes the scene.
pub(super) const NEW: &str = "new";

/// The hidden folder's part that was the scene before.
pub(super) const OLD: &str = "old";

/// How the hidden folders of a place begin; `None` for a place without a name.
fn prefix(place: &Path) -> Option<String> {
    Some(format!(".{}.saving-", place.file_name()?.to_string_lossy()))
}

/// Where they lie.
fn parent(place: &Path) -> &Path {
    place.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A folder beside the place that removes itself with all that is in it, unless it is kept.
pub(super) fn folder_beside(place: &Path) -> io::Result<TempDir> {
    let prefix = prefix(place).ok_or_else(|| io::Error::other("it has no name"))?;
    tempfile::Builder::new().prefix(&prefix).tempdir_in(parent(place)).map_err(without_temporary_name)
}

/// Hidden folders of the place, in the order of their names.
fn found(place: &Path) -> Vec<PathBuf> {
    let (Some(prefix), Ok(entries)) = (prefix(place), fs::read_dir(parent(place))) else { return Vec::new() };
    let ours = |entry: &fs::DirEntry| {
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
        is_folder && entry.file_name().to_str().is_some_and(|name| name.starts_with(&prefix))
    };
    let mut folders: Vec<_> = entries.filter_map(Result::ok).filter(ours).map(|entry| entry.path()).collect();
    folders.sort();
    folders
}

/// If nothing is at the place, because a run was killed when it had moved the old scene aside: moves the new one there, which is
/// whole by then, or else the old one back.
///
/// # Errors
/// What the file system says.
pub(super) fn recover(place: &Path) -> io::Result<()> {
    if place.try_exists()? {
        return Ok(());
    }
    for folder in found(place) {
        if !folder.join(OLD).is_dir() {
            // It was killed before.
            continue;
        }
        if let Some(whole) =
            [NEW, OLD].map(|part| folder.join(part)).iter().find(|part| part.join(STATE).is_file())
        {
            return fs::rename(whole, place);
        }
    }
    Ok(())
}

/// Removes what killed runs left, after [`recover`].
///
/// # Errors
/// What the file system says.
pub(super) fn remove(place: &Path) -> io::Result<()> {
    // While nothing is at the place, one of them may hold what was.
    if !place.try_exists()? {
        return Ok(());
    }
    found(place).iter().try_for_each(fs::remove_dir_all)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hidden folder of `place` with a scene in each of these parts.
    fn left(place: &Path, parts: &[&str]) -> PathBuf {
        let folder = folder_beside(place).unwrap().keep();
        for part in parts {
            fs::create_dir(folder.join(part)).unwrap();
            fs::write(folder.join(part).join(STATE), part).unwrap();
        }
        folder
    }

    fn state(place: &Path) -> Option<String> {
        fs::read_to_string(place.join(STATE)).ok()
    }

    #[test]
    fn a_scene_between_two_moves_is_found_again() {
        let home = tempfile::tempdir().unwrap();
        let place = home.path().join("kept");
        let early = left(&place, &[NEW]);
        recover(&place).unwrap();
        assert_eq!(state(&place), None, "it was never finished");
        left(&place, &[NEW, OLD]);
        recover(&place).unwrap();
        assert_eq!(state(&place).as_deref(), Some(NEW));
        // Of another place.
        let other = left(&home.path().join("kept2"), &[NEW, OLD]);
        remove(&place).unwrap();
        assert!(!early.exists() && other.exists());
        assert_eq!(fs::read_dir(home.path()).unwrap().count(), 2);
    }

    #[test]
    fn what_is_there_stays_and_nothing_is_thrown_away_while_it_is_not() {
        let home = tempfile::tempdir().unwrap();
        let place = home.path().join("kept");
        let folder = left(&place, &[OLD]);
        remove(&place).unwrap();
        assert!(folder.exists());
        fs::create_dir(&place).unwrap();
        fs::write(place.join(STATE), "mine").unwrap();
        recover(&place).unwrap();
        assert_eq!(state(&place).as_deref(), Some("mine"));
        fs::remove_dir_all(&place).unwrap();
        recover(&place).unwrap();
        assert_eq!(state(&place).as_deref(), Some(OLD));
    }
}
