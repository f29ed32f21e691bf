//! Files that are there whole or not at all.

use std::fs;
use std::io::Write;
use std::path::Path;

use tempfile::NamedTempFile;

use super::ReplayError;

/// Writes under a temporary name beside `path` and renames; makes missing folders. On an error nothing is left.
///
/// # Errors
/// [`ReplayError::Write`] with the path.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), ReplayError> {
    let failed = |source| ReplayError::Write { path: path.into(), source };
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(failed)?;
    }
    // Removes itself unless it is persisted.
    let mut file = temporary_beside(path).map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    file.as_file().sync_data().map_err(failed)?;
    file.persist(path).map(drop).map_err(|error| failed(error.error))
}

/// Makes the folder and checks that files can be written into it: better before a long run than after it.
///
/// # Errors
/// [`ReplayError::Write`] with the folder.
pub(super) fn require_writable(folder: &Path) -> Result<(), ReplayError> {
    let writable = fs::create_dir_all(folder).and_then(|()| temporary_beside(&folder.join("report.json")));
    writable.map(drop).map_err(|source| ReplayError::Write { path: folder.into(), source })
}

fn temporary_beside(path: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What a plain file gets, less the umask, and not the owner alone.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder
        .tempfile_in(path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")))
}

#[cfg(test)]
mod tests {
    use super::*;

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
