//! Files that are there whole or not at all.

use std::fs;
use std::io::{Error, ErrorKind, Result, Write};
use std::path::Path;

use tempfile::NamedTempFile;

/// Writes under a temporary name beside `path` and renames; makes missing folders. On an error nothing is left.
///
/// # Errors
/// What the file system says.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    // Removes itself unless it is persisted.
    let mut file = temporary_beside(path)?;
    file.write_all(bytes).map_err(without_temporary_name)?;
    file.as_file().sync_data()?;
    file.persist(path).map(drop).map_err(|error| error.error)
}

/// How temporary names begin and end.
const TEMPORARY: (&str, &str) = (".weathering-", ".tmp");

/// Removes temporary files that a run which was killed left in a folder. What cannot be read is left to whoever writes into it.
///
/// # Errors
/// What the file system says.
pub(crate) fn remove_temporaries(folder: &Path) -> Result<()> {
    let Ok(entries) = fs::read_dir(folder) else { return Ok(()) };
    for entry in entries {
        let entry = entry?;
        let is_temporary = |name: &str| name.starts_with(TEMPORARY.0) && name.ends_with(TEMPORARY.1);
        if entry.file_name().to_str().is_some_and(is_temporary) && entry.file_type()?.is_file() {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

pub(crate) fn temporary_beside(path: &Path) -> Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY.0).suffix(TEMPORARY.1);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What a plain file gets, less the umask, and not the owner alone.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    builder.tempfile_in(folder).map_err(without_temporary_name)
}

/// What went wrong, without the path that `tempfile` puts behind it: whoever called names the file that was meant.
pub(crate) fn without_temporary_name(error: Error) -> Error {
    let text = error.to_string();
    match text.split_once(" at path ") {
        Some((reason, _)) => Error::new(error.kind(), reason),
        None => error,
    }
}

/// Checks that what should be a folder is not a file.
///
/// # Errors
/// It is one.
pub(crate) fn refuse_file(folder: &Path) -> Result<()> {
    if folder.is_file() {
        return Err(Error::new(ErrorKind::NotADirectory, "it is a file, not a folder"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_do_not_name_temporary_files() {
        let folder = tempfile::tempdir().unwrap();
        let error = temporary_beside(&folder.path().join("none/report.json")).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::NotFound);
        let text = error.to_string();
        assert!(
            text.contains("No such file") && !text.contains(TEMPORARY.0) && !text.contains("none"),
            "{text}"
        );
        let plain = Error::other("at path");
        assert_eq!(without_temporary_name(plain).to_string(), "at path");
    }

    #[test]
    fn a_file_is_no_folder() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("out");
        refuse_file(&file).unwrap();
        refuse_file(folder.path()).unwrap();
        fs::write(&file, "mine").unwrap();
        assert_eq!(refuse_file(&file).unwrap_err().kind(), ErrorKind::NotADirectory);
    }

    #[test]
    fn what_a_killed_run_left_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.json");
        let (_, left) = temporary_beside(&path).unwrap().keep().unwrap();
        let others = [".weathering-notes", ".hidden.tmp", "a.tmp"].map(|name| folder.path().join(name));
        others.iter().for_each(|path| fs::write(path, "mine").unwrap());
        remove_temporaries(folder.path()).unwrap();
        assert!(!left.exists() && others.iter().all(|path| path.exists()));
        remove_temporaries(&folder.path().join("none")).unwrap();
    }
}
