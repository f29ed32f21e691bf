//! The same digest, the same report and the same maps on one thread and on many, drawn and not drawn, on one driver and on
//! another. That builds with and without optimisation agree, `scripts/digests.sh` finds out.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::replay::{number, read_report, replay, run};

/// Scenarios that together have rain, mud, snow, and a jet on dust, and as many seconds of them as it takes until much has been hit.
const RUNS: [(&str, &str); 4] = [("shower", "2.5"), ("mud", "1.5"), ("snow", "3"), ("wash", "7")];

/// What a run came to: the report without what differs from run to run, and all maps.
struct Findings {
    report: Value,
    maps: BTreeMap<String, Vec<u8>>,
}

impl Findings {
    fn assert_same(&self, other: &Self, what: &str) {
        assert_eq!(self.report, other.report, "{what}");
        let names = |findings: &Self| findings.maps.keys().cloned().collect::<Vec<_>>();
        assert_eq!(names(self), names(other), "{what}");
        for (name, bytes) in &self.maps {
            assert!(other.maps[name] == *bytes, "{what}: {name} is another picture");
        }
    }
}

/// Runs a scenario, on a certain driver if one is given.
fn findings((name, seconds): (&str, &str), options: &str, driver: Option<&Path>) -> Findings {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let file = Path::new("assets/scenarios").join(name).with_extension("ron");
    let mut command = replay(file, options);
    command.arg("--seconds").arg(seconds).arg("--out").arg(&out);
    // Vulkan's window-system code wants one even when no window is opened.
    command.env("XDG_RUNTIME_DIR", folder.path());
    if let Some(driver) = driver {
        command.env("WGPU_BACKEND", "vulkan");
        // The older name, and the newer.
        for variable in ["VK_ICD_FILENAMES", "VK_DRIVER_FILES"] {
            command.env(variable, driver);
        }
    }
    let outcome = run(&mut command);
    // What a scenario expects of its end need not hold in its middle.
    assert!(matches!(outcome.code, Some(0 | 1)), "{name} {options}: {}", outcome.stderr);
    let mut report = read_report(&out);
    let timing = report.as_object_mut().and_then(|report| report.remove("timing"));
    assert!(
        timing.is_some() && report["digest"].as_str().is_some_and(|digest| digest.len() == 64),
        "{report}"
    );
    assert!(number(&report["particles"]["hit"]) > 50.0, "{name}: hardly anything was hit");
    let maps = fs::read_dir(out.join("maps")).unwrap().map(|entry| entry.unwrap().path()).map(|path| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        (name, fs::read(path).unwrap())
    });
    let maps = maps.collect();
    Findings { report, maps }
}

const DRAWN: &str = "--fps 1 --size 64x48";

/// Where SwiftShader, a driver that computes on the CPU in another way than Mesa's, is known to be put: by the variable, by
/// packages of drivers, by browsers. `None`, which is printed, if it is nowhere.
fn swiftshader() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("WEATHERING_SWIFTSHADER").map(PathBuf::from) {
        assert!(named.is_file(), "WEATHERING_SWIFTSHADER: there is no {}", named.display());
        return Some(named);
    }
    let home = std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".local/share/vulkan/icd.d"));
    let shared =
        ["/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d"].map(PathBuf::from);
    let browsers =
        ["/usr/lib/chromium", "/usr/lib64/chromium-browser", "/opt/google/chrome"].map(PathBuf::from);
    for folder in home.into_iter().chain(shared).chain(browsers) {
        let Ok(entries) = fs::read_dir(folder) else { continue };
        let mut files: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
        files.sort();
        let is_manifest = |path: &PathBuf| {
            let name = path.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
            name.contains("swiftshader") && name.ends_with(".json")
        };
        if let Some(found) = files.into_iter().find(is_manifest) {
            return Some(found);
        }
    }
    eprintln!("skipped: there is no SwiftShader; WEATHERING_SWIFTSHADER=vk_swiftshader_icd.json names one");
    None
}

#[test]
fn one_two_and_eight_threads_agree() {
    for one in RUNS {
        let alone = findings(one, "--no-render --threads 1", None);
        for threads in [2, 8] {
            let many = findings(one, &format!("--no-render --threads {threads}"), None);
            alone.assert_same(&many, &format!("{} on {threads} threads", one.0));
        }
    }
}

#[test]
fn what_is_drawn_and_what_is_not_agree_on_every_driver() {
    if crate::common::skips_gpu() {
        return;
    }
    let other = swiftshader();
    for one in RUNS {
        let unseen = findings(one, "--no-render", None);
        unseen.assert_same(&findings(one, DRAWN, None), &format!("{} drawn", one.0));
        if let Some(driver) = &other {
            unseen.assert_same(&findings(one, DRAWN, Some(driver)), &format!("{} by SwiftShader", one.0));
        }
    }
}
