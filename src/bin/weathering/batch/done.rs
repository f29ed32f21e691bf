//! The mark of a folder that is done.

use std::error::Error;
use std::fs;
use std::io;
use std::path::Path;

use bevy_weathering::replay::{DONE_FILE, write_atomic};
use serde::{Deserialize, Serialize};

/// What was asked for. The same request has the same result, to the digest.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
pub struct Request {
    /// File name of the scenario, without its ending.
    pub scenario: String,
    /// Hash of the scenario and of everything it names.
    pub inputs: String,
    /// Arguments, those left out included, where they have a value by default.
    pub arguments: Vec<String>,
    /// Hash of the program.
    pub program: String,
}

/// `done.json`.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq)]
pub struct Done {
    request: Request,
    /// That of the report.
    digest: String,
}

/// What a run that came to its end has told in `report.json`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finished {
    pub digest: String,
    /// Expectations that did not hold.
    pub unmet: usize,
}

/// The fields of `report.json` that are looked at.
#[derive(Deserialize)]
struct Reported {
    digest: String,
    #[serde(default)]
    expectations: Vec<Expected>,
}

/// An expectation, of which only the end counts.
#[derive(Deserialize)]
struct Expected {
    holds: Option<bool>,
}

impl Done {
    /// What came of a folder in which this request is done. That its report is there and of the same digest is checked, too.
    pub fn find(folder: &Path, request: &Request) -> Option<Finished> {
        let done: Self = serde_json::from_slice(&fs::read(folder.join(DONE_FILE)).ok()?).ok()?;
        let reported = reported(folder).ok()?;
        (done.request == *request && done.digest == reported.digest).then_some(reported)
    }

    /// Marks a folder as done, whatever came of expectations; tells what its report does.
    pub fn write(folder: &Path, request: Request) -> Result<Finished, Box<dyn Error>> {
        let reported = reported(folder)?;
        let done = Self { request, digest: reported.digest.clone() };
        write_atomic(&folder.join(DONE_FILE), &serde_json::to_vec_pretty(&done)?)?;
        Ok(reported)
    }

    /// It is not done, or no longer.
    pub fn remove(folder: &Path) -> Result<(), Box<dyn Error>> {
        let path = folder.join(DONE_FILE);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(format!("cannot remove {}: {error}", path.display()).into())
            }
            _ => Ok(()),
        }
    }
}

fn reported(folder: &Path) -> Result<Finished, Box<dyn Error>> {
    let path = folder.join("report.json");
    let bytes = fs::read(&path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    let Reported { digest, expectations } =
        serde_json::from_slice(&bytes).map_err(|error| format!("{}: {error}", path.display()))?;
    let unmet = expectations.iter().filter(|expected| expected.holds == Some(false)).count();
    Ok(Finished { digest, unmet })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request() -> Request {
        Request {
            scenario: "rain".into(),
            inputs: "a".into(),
            arguments: vec!["--fps=24".into()],
            program: "b".into(),
        }
    }

    #[test]
    fn a_folder_is_done_for_what_it_was_made_from() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        assert!(Done::write(folder, request()).is_err(), "there is no report");
        let report = |digest: &str| {
            let report = serde_json::json!({ "digest": digest, "ticks": 60 });
            fs::write(folder.join("report.json"), report.to_string()).unwrap();
        };
        report("d1");
        assert_eq!(Done::find(folder, &request()), None);
        let finished = Finished { digest: "d1".into(), unmet: 0 };
        assert_eq!(Done::write(folder, request()).unwrap(), finished);
        assert_eq!(Done::find(folder, &request()), Some(finished));
        let others = [
            Request { scenario: "snow".into(), ..request() },
            Request { inputs: "x".into(), ..request() },
            Request { arguments: vec![], ..request() },
            Request { program: "x".into(), ..request() },
        ];
        assert!(others.iter().all(|other| Done::find(folder, other).is_none()));
        // Somebody else has run something into it.
        report("d2");
        assert_eq!(Done::find(folder, &request()), None);
    }

    #[test]
    fn expectations_that_did_not_hold_are_counted_and_those_of_later_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let report = r#"{"digest": "d", "expectations": [{"holds": true}, {"holds": false}, {"holds": null, "at": 3.0}]}"#;
        fs::write(folder.join("report.json"), report).unwrap();
        let finished = Finished { digest: "d".into(), unmet: 1 };
        assert_eq!(Done::write(folder, request()).unwrap(), finished);
        assert_eq!(Done::find(folder, &request()), Some(finished));
    }

    #[test]
    fn what_is_half_written_or_removed_is_not_done() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        fs::write(folder.join("report.json"), r#"{"digest": "d"}"#).unwrap();
        Done::write(folder, request()).unwrap();
        let whole = fs::read(folder.join(DONE_FILE)).unwrap();
        fs::write(folder.join(DONE_FILE), &whole[..whole.len() / 2]).unwrap();
        assert_eq!(Done::find(folder, &request()), None);
        fs::write(folder.join(DONE_FILE), &whole).unwrap();
        assert!(Done::find(folder, &request()).is_some());
        Done::remove(folder).unwrap();
        Done::remove(folder).unwrap();
        assert_eq!(Done::find(folder, &request()), None);
        Done::remove(&folder.join("nowhere")).unwrap();
    }
}
