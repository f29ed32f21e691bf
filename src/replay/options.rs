//! What to run and what to write.

use std::path::{Component, Path, PathBuf};

use bevy::prelude::*;

use super::plots::PLOTS_FOLDER;
use super::{ReplayError, files, sheet, video};
use crate::clock::WeatheringClock;
use crate::overlay::SplatBudget;
use crate::scenario::{LoadedScenario, exports};

/// What to run and what to write.
#[derive(Debug, Clone)]
pub struct ReplayOptions {
    /// The scenario.
    pub scenario: LoadedScenario,
    /// Folder for all that is written; made if missing. None in which that would replace a file that the scenario reads. `None`
    /// writes nothing.
    pub out: Option<PathBuf>,
    /// Pictures per second of weather time; at least 1. Without a renderer there are none.
    pub fps: u32,
    /// Size of the pictures in pixels, up to [`Self::MAX_SIZE`] each way.
    pub size: UVec2,
    /// In place of the scenario's length. Counted from its start, also with `resume`.
    pub seconds: Option<f32>,
    /// In place of the scenario's seed. Not with `resume`: a saved scene goes on with its own.
    pub seed: Option<u64>,
    /// Threads to compute ticks with, up to [`Self::MAX_THREADS`]; all cores if `None`. The first replay of a process decides for
    /// all that follow.
    /// Exposure to air and sun is found out by a thread of the operating system for each core, whatever this says.
    pub threads: Option<usize>,
    /// Draw pictures.
    pub render: bool,
    /// A [saved scene](crate::save) to go on from.
    pub resume: Option<PathBuf>,
    /// Folder to save the scene into at the end. Of its own: none that the run writes anything else into, and none that holds
    /// such a one.
    pub save: Option<PathBuf>,
    /// What a frame may paint. Where it is not enough for the ticks of a frame, there are more frames: pictures and maps show
    /// all, whatever it is.
    pub splats: SplatBudget,
    /// Seconds of weather time between two rows of the series, at least a tick; without, one, or more if a run is so long
    /// that the rows would be too many.
    pub every: Option<f32>,
    /// Make a video of the pictures: with ffmpeg, or else an animated PNG. Needs `out` and `render`.
    pub video: bool,
    /// Make a contact sheet of so many pictures, up to [`Self::MAX_SHEET`]. Needs `out` and `render`.
    pub sheet: Option<u32>,
    /// Folder to [export](crate::export::Export::write) the scene into as it is at the end. Not `out`, and apart from
    /// `save`.
    pub export: Option<PathBuf>,
}

impl ReplayOptions {
    /// The widest and highest picture.
    pub const MAX_SIZE: u32 = 8192;
    /// The most pictures on a contact sheet.
    pub const MAX_SHEET: u32 = 400;
    /// The most threads: many more than these a system may refuse to start.
    pub const MAX_THREADS: usize = 1024;

    /// A run of `scenario` that draws small pictures at 24 a second.
    pub fn new(scenario: LoadedScenario) -> Self {
        Self {
            scenario,
            out: None,
            fps: 24,
            size: UVec2::new(640, 360),
            seconds: None,
            seed: None,
            threads: None,
            render: true,
            resume: None,
            save: None,
            splats: SplatBudget::LARGEST,
            every: None,
            video: false,
            sheet: None,
            export: None,
        }
    }
}

impl ReplayOptions {
    /// What is made of the pictures in the folder.
    pub(super) fn write_pictures(&self, out: &Path) -> Result<(), ReplayError> {
        if !self.video && self.sheet.is_none() {
            return Ok(());
        }
        let frames = files::frames(out);
        if let Some(count) = self.sheet {
            let seconds = |number: u32| f64::from(number) / f64::from(self.fps);
            let pictures: Vec<_> =
                frames.iter().map(|(number, path)| (seconds(*number), path.clone())).collect();
            sheet::write_sheet(out, &pictures, count)?;
        }
        if self.video {
            let files: Vec<_> = frames.into_iter().map(|(_, path)| path).collect();
            video::write_video(out, &files, self.fps)?;
        }
        Ok(())
    }

    /// Checks all options, and tells how many ticks apart the rows of the series are.
    pub(super) fn check(&self) -> Result<u32, ReplayError> {
        let wrong =
            |option, value: String, expected: String| Err(ReplayError::Option { option, value, expected });
        if self.fps == 0 || self.fps > WeatheringClock::MAX_HZ {
            return wrong("fps", self.fps.to_string(), format!("1 to {}", WeatheringClock::MAX_HZ));
        }
        if self.size.min_element() == 0 || self.size.max_element() > Self::MAX_SIZE {
            let value = format!("{}x{}", self.size.x, self.size.y);
            return wrong("size", value, format!("1x1 to {0}x{0}", Self::MAX_SIZE));
        }
        let most = crate::scenario::Scenario::MAX_SECONDS;
        if let Some(seconds) = self.seconds
            && !(seconds > 0.0 && seconds <= most)
        {
            return wrong("seconds", seconds.to_string(), format!("above 0 and at most {most}"));
        }
        if let Some(threads) = self.threads
            && !(1..=Self::MAX_THREADS).contains(&threads)
        {
            return wrong("threads", threads.to_string(), format!("1 to {}", Self::MAX_THREADS));
        }
        if let (Some(seed), Some(_)) = (self.seed, &self.resume) {
            return wrong(
                "seed",
                seed.to_string(),
                "left out with `resume`: a saved scene has its own".into(),
            );
        }
        if let Some(save) = &self.save
            && self.folders().iter().any(|folder| place(folder).starts_with(place(save)))
        {
            let value = save.display().to_string();
            return wrong("save", value, "a folder of its own, beside those of `out` or in them".into());
        }
        if let Some(export) = &self.export {
            let is_same = self.out.as_ref().is_some_and(|out| place(out) == place(export));
            let maps = place(&export.join("maps"));
            if is_same || self.save.as_ref().is_some_and(|save| maps.starts_with(place(save))) {
                let value = export.display().to_string();
                return wrong("export", value, "another folder than `out`, and apart from `save`".into());
            }
        }
        if let Some(count) = self.sheet
            && !(1..=Self::MAX_SHEET).contains(&count)
        {
            return wrong("sheet", count.to_string(), format!("1 to {}", Self::MAX_SHEET));
        }
        for (option, is_set) in [("video", self.video), ("sheet", self.sheet.is_some())] {
            if is_set && (self.out.is_none() || !self.render) {
                return wrong(option, "set".into(), "used with `out` and with `render`".into());
            }
        }
        self.series_ticks()
    }

    /// The innermost folders that a run makes in `out`.
    fn folders(&self) -> Vec<PathBuf> {
        let Some(out) = &self.out else { return Vec::new() };
        let exports = exports(&self.scenario.scenario).into_iter();
        let exports = exports.map(|(_, name)| out.join(files::export_folder(name)).join("maps"));
        [out.join("maps"), out.join(PLOTS_FOLDER)].into_iter().chain(exports).collect()
    }
}

/// Where a folder is, or will be: its parts one after the other, as the file system takes them. What is not there yet is no
/// link.
fn place(folder: &Path) -> PathBuf {
    let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.into());
    let mut place = PathBuf::new();
    for part in folder.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                place.pop();
            }
            Component::Normal(name) => {
                place.push(name);
                if let Ok(there) = place.canonicalize() {
                    place = there;
                }
            }
            root => place.push(root),
        }
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    fn options(folder: &Path) -> ReplayOptions {
        let file = folder.join("scene.ron");
        let scenario = r#"(
            seconds: 1.0,
            camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
            events: [(at: 0.5, what: Export("half"))],
        )"#;
        std::fs::write(&file, scenario).unwrap();
        ReplayOptions { out: Some(folder.join("out")), ..ReplayOptions::new(Scenario::load(&file).unwrap()) }
    }

    #[test]
    fn a_scene_is_saved_into_no_folder_of_the_run() {
        let folder = tempfile::tempdir().unwrap();
        let options = ReplayOptions { export: Some(folder.path().join("glb")), ..options(folder.path()) };
        let check = |save: &str| {
            let save = Some(folder.path().join(save));
            ReplayOptions { save, ..options.clone() }.check().map_err(|error| error.to_string())
        };
        for save in [
            ".",
            "out",
            "out/.",
            "out/../out",
            "out/x/..",
            "new/../out/maps",
            "out/maps",
            "out/plots",
            "out/export_half",
            "out/export_half/maps",
        ] {
            let error = check(save).unwrap_err();
            assert!(error.contains("`save`"), "{save}: {error}");
        }
        for save in ["glb", "glb/maps", "out/../glb"] {
            let error = check(save).unwrap_err();
            assert!(error.contains("`export`"), "{save}: {error}");
        }
        for save in ["kept", "out/kept", "out/maps/kept", "out/plots2", "out/../kept", "out/export_other"] {
            check(save).unwrap();
        }
    }

    #[test]
    #[cfg(unix)]
    fn links_are_what_they_lead_to() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("out/plots")).unwrap();
        std::os::unix::fs::symlink(folder.path().join("out/plots"), folder.path().join("link")).unwrap();
        for save in ["link", "link/..", "link/../maps"] {
            let save = Some(folder.path().join(save));
            assert!(ReplayOptions { save, ..options(folder.path()) }.check().is_err());
        }
    }
}
