//! Videos by the ffmpeg of this machine, looked at by its ffprobe. Where they are not installed, that is said and nothing tested.

use std::path::Path;
use std::process::{Command, Stdio};

use super::replay::{HOSE, replay, run};

fn is_there(program: &str) -> bool {
    let started = Command::new(program).arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    started.is_ok_and(|status| status.success())
}

/// What ffprobe tells of the first stream of a video: width, height, pictures a second, codec, pixels, pictures. It decodes all
/// to count them.
fn probe(video: &Path) -> Vec<String> {
    let entries = "stream=width,height,r_frame_rate,codec_name,pix_fmt,nb_read_frames";
    let output = Command::new("ffprobe")
        .args(["-v", "error", "-count_frames", "-select_streams", "v:0", "-show_entries", entries])
        .args(["-of", "default=noprint_wrappers=1"])
        .arg(video)
        .output()
        .unwrap();
    assert!(
        output.status.success() && output.stderr.is_empty(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let mut lines: Vec<String> = String::from_utf8_lossy(&output.stdout).lines().map(str::to_owned).collect();
    lines.sort();
    lines
}

/// The middle pixel of a picture of a video.
fn middle(video: &Path, picture: u32, size: [usize; 2]) -> [u8; 3] {
    let only = format!("select=eq(n\\,{picture})");
    let output = Command::new("ffmpeg")
        .args(["-v", "error", "-i"])
        .arg(video)
        .args(["-vf", &only, "-frames:v", "1", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"])
        .output()
        .unwrap();
    let pixels = output.stdout;
    assert_eq!(pixels.len(), size[0] * size[1] * 3, "{}", String::from_utf8_lossy(&output.stderr));
    let at = (size[1] / 2 * size[0] + size[0] / 2) * 3;
    [pixels[at], pixels[at + 1], pixels[at + 2]]
}

#[test]
fn a_video_has_all_pictures_in_their_size_and_at_their_pace() {
    if crate::common::skips_gpu() {
        return;
    }
    if !is_there("ffmpeg") || !is_there("ffprobe") {
        eprintln!("skipped: needs ffmpeg and ffprobe (Debian package ffmpeg)");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    // Odd sides, which a video cannot have: it is a pixel wider and higher.
    let mut command = replay(HOSE, "--seconds 1 --fps 5 --size 75x49 --video --out");
    let outcome = run(command.arg(&out).env("XDG_RUNTIME_DIR", folder.path()));
    outcome.assert_success();
    assert!(!out.join("video.apng").exists(), "ffmpeg was not used: {}", outcome.stderr);
    let expected = [
        "codec_name=h264",
        "height=50",
        "nb_read_frames=5",
        "pix_fmt=yuv420p",
        "r_frame_rate=5/1",
        "width=76",
    ];
    let video = out.join("video.mp4");
    assert_eq!(probe(&video), expected);
    for number in [0, 4] {
        let frame = image::open(out.join(format!("frame_{number:05}.png"))).unwrap().into_rgb8();
        let (found, drawn) = (middle(&video, number, [76, 50]), frame[(38, 25)].0);
        // Colours are stored for two by two pixels at once, and compressed.
        let away = found.iter().zip(drawn).map(|(found, drawn)| found.abs_diff(drawn)).max();
        assert!(away < Some(60), "{number}: {found:?} {drawn:?}");
    }
}
