//! What a run stops for on its way: pictures, and exports that events ask for.

use super::{ReplayOptions, files};
use crate::scenario::{Scenario, captures, exports};

/// Something that is made of the scene between two ticks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Moment {
    /// A picture, into this file.
    Picture(String),
    /// The scene for other engines, into this folder.
    Export(String),
}

impl Moment {
    /// Whether a run makes such things at all.
    pub(super) fn is_made(&self, options: &ReplayOptions) -> bool {
        match self {
            Self::Picture(_) => options.render,
            Self::Export(_) => options.out.is_some(),
        }
    }

    /// Its file or folder, in that of the run.
    fn into_name(self) -> String {
        match self {
            Self::Picture(name) | Self::Export(name) => name,
        }
    }
}

/// What events ask for: what was made before `tick`, at which a run begins or goes on, by name; and what is still to be made, each
/// with the tick whose end it sees.
pub(super) fn asked_for(scenario: &Scenario, tick: u32) -> (Vec<String>, Vec<(u32, Moment)>) {
    let pictures = captures(scenario).into_iter();
    let pictures = pictures.map(|(due, name)| (due, Moment::Picture(files::capture_file(name))));
    let exports = exports(scenario).into_iter();
    let exports = exports.map(|(due, name)| (due, Moment::Export(files::export_folder(name))));
    // The run that is gone on with has seen its last tick.
    let is_past = |due: u32| due < tick || (due == tick && tick > 0);
    let (made, to_make): (Vec<_>, Vec<_>) = pictures.chain(exports).partition(|(due, _)| is_past(*due));
    (made.into_iter().map(|(_, moment)| moment.into_name()).collect(), to_make)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_is_gone_on_with_makes_nothing_twice() {
        let text = r#"(
            seconds: 10.0,
            tick_hz: 10,
            camera: (keys: [(eye: (0.0, 1.0, 2.0), target: (0.0, 0.0, 0.0))]),
            events: [
                (at: 0.0, what: Export("start")),
                (at: 2.0, what: Export("two")),
                (at: 2.0, what: Capture("two")),
                (at: 3.0, what: Export("three")),
            ],
        )"#;
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("scene.ron");
        std::fs::write(&file, text).unwrap();
        let scenario = Scenario::load(&file).unwrap().scenario;
        let export = |due: u32, name: &str| (due, Moment::Export(files::export_folder(name)));
        let picture = (20, Moment::Picture("capture_two.png".into()));
        let all = vec![picture, export(0, "start"), export(20, "two"), export(30, "three")];
        assert_eq!(asked_for(&scenario, 0), (vec![], all));
        let made = ["capture_two.png", "export_start", "export_two"].map(String::from).to_vec();
        assert_eq!(asked_for(&scenario, 20), (made, vec![export(30, "three")]));
    }
}
