//! The pictures of a run as one moving picture: a video where ffmpeg is installed, an animated PNG elsewhere.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use bevy::log::warn;
use image::ImageFormat;
use tempfile::NamedTempFile;

use super::{ReplayError, ReplayOptions};
use crate::output::temporary_beside;
use crate::picture::read_picture;

/// With ffmpeg.
pub(super) const VIDEO_FILE: &str = "video.mp4";
/// Without.
pub(super) const ANIMATION_FILE: &str = "video.apng";

/// Writes the pictures into `out`, each shown for an `fps`-th of a second; tells the file. Nothing is written of no pictures.
///
/// # Errors
/// [`ReplayError::Write`], [`ReplayError::Picture`].
pub(super) fn write_video(out: &Path, frames: &[PathBuf], fps: u32) -> Result<Option<PathBuf>, ReplayError> {
    if frames.is_empty() {
        return Ok(None);
    }
    let path = out.join(VIDEO_FILE);
    match write_whole(&path, |file| encode_with_ffmpeg(file, frames, fps)) {
        Ok(()) => return Ok(Some(path)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => warn!("{ANIMATION_FILE} is written, since ffmpeg failed: {error}"),
    }
    let path = out.join(ANIMATION_FILE);
    let failed = |source| ReplayError::Write { path: path.clone(), source };
    let mut file = temporary_beside(&path).map_err(failed)?;
    encode_png(&path, file.as_file_mut(), frames, fps)?;
    persist(file, &path).map_err(failed)?;
    Ok(Some(path))
}

/// Makes a file under a temporary name, and renames it when it is whole.
fn write_whole(path: &Path, write: impl FnOnce(&Path) -> io::Result<()>) -> io::Result<()> {
    let file = temporary_beside(path)?;
    write(file.path())?;
    persist(file, path)
}

fn persist(file: NamedTempFile, path: &Path) -> io::Result<()> {
    file.as_file().sync_data()?;
    file.persist(path).map(drop).map_err(|error| error.error)
}

/// The error is `NotFound` if there is no ffmpeg.
fn encode_with_ffmpeg(file: &Path, frames: &[PathBuf], fps: u32) -> io::Result<()> {
    let mut said = tempfile::tempfile()?;
    let mut ffmpeg = Command::new("ffmpeg")
        .args(["-loglevel", "error", "-y", "-f", "image2pipe", "-c:v", "png", "-framerate"])
        .arg(fps.to_string())
        // Players want even sides and this way of storing colours.
        .args(["-i", "-", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-crf", "18"])
        .args(["-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"])
        .arg(file)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        // A pipe that nobody reads could fill up.
        .stderr(said.try_clone()?)
        .spawn()?;
    // Closed when the last picture is written: that ends the video.
    let fed = ffmpeg.stdin.take().map_or(Ok(()), |pipe| feed(pipe, frames));
    let status = ffmpeg.wait()?;
    if !status.success() {
        let mut message = String::new();
        said.seek(SeekFrom::Start(0))?;
        said.read_to_string(&mut message)?;
        let last = message.lines().last().unwrap_or_default();
        return Err(io::Error::other(format!("{status}: {last}")));
    }
    fed
}

fn feed(mut pipe: impl Write, frames: &[PathBuf]) -> io::Result<()> {
    for frame in frames {
        // That a picture is missing does not mean that ffmpeg is.
        let mut picture = File::open(frame).map_err(io::Error::other)?;
        io::copy(&mut picture, &mut pipe)?;
    }
    Ok(())
}

/// An animated PNG of pictures of one size. `path` is for messages.
fn encode_png(path: &Path, file: &mut File, frames: &[PathBuf], fps: u32) -> Result<(), ReplayError> {
    let failed = |error: png::EncodingError| ReplayError::Write { path: path.into(), source: error.into() };
    let read = |frame: &PathBuf| read_picture(frame, ImageFormat::Png, ReplayOptions::MAX_SIZE);
    let Some(first) = frames.first() else { return Ok(()) };
    let first = read(first)?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), first.width(), first.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    // For ever.
    encoder.set_animated(frames.len() as u32, 0).map_err(failed)?;
    encoder.set_frame_delay(1, u16::try_from(fps).unwrap_or(u16::MAX)).map_err(failed)?;
    let mut writer = encoder.write_header().map_err(failed)?;
    for frame in frames {
        writer.write_image_data(&read(frame)?.to_rgb8()).map_err(failed)?;
    }
    writer.finish().map_err(failed)
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use image::RgbImage;

    use super::*;

    fn frames(folder: &Path, sizes: &[u32]) -> Vec<PathBuf> {
        let frame = |(number, &size): (usize, &u32)| {
            let path = folder.join(format!("frame_{number:05}.png"));
            RgbImage::from_pixel(size, 3, image::Rgb([number as u8 * 50, 1, 2])).save(&path).unwrap();
            path
        };
        sizes.iter().enumerate().map(frame).collect()
    }

    #[test]
    fn an_animation_has_every_picture_and_their_pace() {
        let folder = tempfile::tempdir().unwrap();
        let frames = frames(folder.path(), &[5, 5, 5, 5]);
        let path = folder.path().join(ANIMATION_FILE);
        encode_png(&path, &mut File::create(&path).unwrap(), &frames, 24).unwrap();

        let decoder = png::Decoder::new(BufReader::new(File::open(&path).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        assert_eq!(reader.info().animation_control().map(|control| control.num_frames), Some(4));
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        for number in 0..4 {
            reader.next_frame(&mut pixels).unwrap();
            let control = reader.info().frame_control.unwrap();
            assert_eq!((control.delay_num, control.delay_den), (1, 24));
            assert_eq!(&pixels[..3], [number * 50, 1, 2]);
        }
    }

    #[test]
    fn pictures_that_do_not_fit_each_other_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let frames = frames(folder.path(), &[5, 6]);
        let path = folder.path().join("out").with_extension("apng");
        let error = encode_png(&path, &mut File::create(&path).unwrap(), &frames, 24).unwrap_err();
        assert!(matches!(error, ReplayError::Write { .. }), "{error}");
        assert!(write_video(folder.path(), &[], 24).unwrap().is_none());
    }
}
