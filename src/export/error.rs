//! Why a scene could not be baked.

use std::path::PathBuf;

use crate::collision::TriangleError;
use crate::effect::EffectError;
use crate::picture::PictureError;
use crate::replay::ReplayError;
use crate::scenes::gltf_mesh::GltfMeshError;
use crate::unwrap::UnwrapError;

/// Why a scene could not be baked. Nothing has been written then, except by [`ExportError::Write`] and
/// [`ExportError::Replay`]: files that were finished before stay, whole.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum ExportError {
    /// The scene, or a file that it names, cannot be read.
    #[error(transparent)]
    Gltf(#[from] GltfMeshError),
    /// Nothing in the scene can get wet.
    #[error("{}: its scene shows no mesh of triangles", .path.display())]
    NoMesh {
        /// The file.
        path: PathBuf,
    },
    /// The world has no surfaces.
    #[error("{}: there is no surface to export", .path.display())]
    NoSurface {
        /// What the scene is called.
        path: PathBuf,
    },
    /// The look of a surface cannot be written.
    #[error("{}: `{surface}` {reason}", .path.display())]
    Look {
        /// What the scene is called.
        path: PathBuf,
        /// Its name.
        surface: String,
        /// Why.
        reason: String,
    },
    /// Its texture coordinates are not unique, and cannot be made so.
    #[error("{}: `{surface}`: {source}{}", .path.display(), size_option(.source))]
    Unwrap {
        /// The file.
        path: PathBuf,
        /// Where in it.
        surface: String,
        /// Why.
        source: UnwrapError,
    },
    /// A mesh that nothing can hit.
    #[error("{}: `{surface}`: {source}", .path.display())]
    Surface {
        /// The file.
        path: PathBuf,
        /// Where in it.
        surface: String,
        /// Why.
        source: TriangleError,
    },
    /// More than is baked at once.
    #[error("{}: {value} {what}, but at most {max} are baked", .path.display())]
    TooMany {
        /// The file.
        path: PathBuf,
        /// Of what.
        what: &'static str,
        /// How many.
        value: u64,
        /// The cap.
        max: u64,
    },
    /// An option is out of range.
    #[error("option `{option}` is {value}, but must be {expected}")]
    Option {
        /// Its name.
        option: &'static str,
        /// What it is.
        value: String,
        /// What it must be.
        expected: String,
    },
    /// What falls cannot be used.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// A picture could not be read or made.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The maps could not be written.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// A file could not be written.
    #[error("cannot write {}: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The JSON could not be written.
    #[error("cannot write JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// The surfaces were not ready in time.
    #[error("gave up after {seconds} s waiting for {what}")]
    TimedOut {
        /// What did not come.
        what: &'static str,
        /// How long it was waited for.
        seconds: u64,
    },
}

/// What `map_size` is called here, if it is too small.
fn size_option(error: &UnwrapError) -> &'static str {
    match error {
        UnwrapError::MapTooSmall { .. } | UnwrapError::DoesNotFit { .. } => {
            " (the size of maps is option `size`)"
        }
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_names_the_option_that_helps() {
        let text = |source| {
            ExportError::Unwrap { path: "a.glb".into(), surface: "leaves".into(), source }.to_string()
        };
        let crowd = text(UnwrapError::DoesNotFit { charts: 20_000, map_size: 512 });
        assert!(crowd.starts_with("a.glb: `leaves`: ") && crowd.contains("option `size`"), "{crowd}");
        let broken = text(UnwrapError::NoPositions);
        assert!(!broken.contains("option"), "{broken}");
    }
}
