//! Files of strangers: never a pipe that has no end or a device, and never more bytes than expected.

use std::fs::{File, metadata, symlink_metadata};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// That this is a file, and not a folder, a pipe or a device, whose reading might never end. Links are followed.
///
/// # Errors
/// What the file system says, and what it is instead.
pub(crate) fn require_file(path: &Path) -> Result<()> {
    if metadata(path)?.is_file() {
        Ok(())
    } else {
        Err(Error::other("it is a folder or a device, not a file"))
    }
}

/// The same, and no link, which might lead anywhere.
///
/// # Errors
/// What the file system says, and what it is instead.
pub(crate) fn require_plain_file(path: &Path) -> Result<()> {
    if symlink_metadata(path)?.is_file() { Ok(()) } else { Err(Error::other("it is no plain file")) }
}

/// All bytes of a file of at most `max`.
///
/// # Errors
/// [`require_file`]'s, and [`ErrorKind::FileTooLarge`].
pub(crate) fn read_file(path: &Path, max: u64) -> Result<Vec<u8>> {
    require_file(path)?;
    let mut bytes = Vec::new();
    // It may grow meanwhile.
    File::open(path)?.take(max.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > max {
        return Err(Error::new(ErrorKind::FileTooLarge, format!("it has more than {max} bytes")));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_up_to_a_size() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, [7; 10]).unwrap();
        assert_eq!(read_file(&path, 10).unwrap(), [7; 10]);
        assert_eq!(read_file(&path, 9).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert!(read_file(folder.path(), 10).unwrap_err().to_string().contains("not a file"));
        assert_eq!(read_file(&folder.path().join("none"), 10).unwrap_err().kind(), ErrorKind::NotFound);
    }

    #[test]
    #[cfg(unix)]
    fn links_are_files_but_no_plain_ones_and_devices_are_neither() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        std::fs::write(&file, "").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        assert!(require_plain_file(&file).is_ok() && require_file(&link).is_ok());
        assert!(require_plain_file(&link).is_err());
        assert!(require_file(Path::new("/dev/zero")).is_err());
    }
}
