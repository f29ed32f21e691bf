//! Files that are there whole or not at all.

use std::fs;
use std::io::{Result, Write};
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
    file.write_all(bytes)?;
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
    builder
        .tempfile_in(path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")))
}

#[cfg(test)]
mod tests {
    use super::*;

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
