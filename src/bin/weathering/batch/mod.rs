//! `weathering replay` of many scenarios: each is run by a program of its own, into a folder of its own.
//!
//! A folder is done when [`Done`] lies in it and tells that it was made of the same inputs, by the same program, as is asked
//! for now; then it is left alone. The mark is removed before a scenario is run and written when everything else is there, so
//! what was killed at any moment is run again and what was finished is not.

mod child;
mod done;
mod table;

use std::collections::BTreeMap;
use std::error::Error;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use bevy_weathering::scenario::Scenario;
use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::{ReplayArgs, refuse_model};
use crate::{print, tell};
use child::Children;
use done::{Done, Finished, Request};

pub use child::end_with_input;

/// A scenario and where its files go.
struct Job {
    file: PathBuf,
    folder: PathBuf,
    name: String,
}

/// What became of a job.
enum Outcome {
    /// Run now, in so many seconds.
    Ran { seconds: f64, finished: Finished },
    /// Was there already.
    Skipped { finished: Finished },
    /// Why not.
    Failed(String),
}

/// Runs all scenarios that are not done, and prints what became of each. Exit code 1 if all came to their ends, but not as they
/// expect it.
///
/// # Errors
/// If any failed, or if the arguments make no sense for many.
pub fn run(arguments: &ReplayArgs) -> Result<ExitCode, Box<dyn Error>> {
    let Some(out) = &arguments.out else {
        return Err("many scenarios, --jobs and --only need --out, the folder for their folders".into());
    };
    for (option, is_given) in [
        ("--resume", arguments.resume.is_some()),
        ("--save-state", arguments.save_state.is_some()),
        ("--export", arguments.export.is_some()),
    ] {
        if is_given {
            return Err(format!("{option} is for a single scenario, without --jobs and --only").into());
        }
    }
    let mut jobs = jobs(&arguments.files, out)?;
    if let Some(only) = arguments.only {
        if only >= jobs.len() {
            let last = jobs.len() - 1;
            return Err(
                format!("--only is {only}, but must be 0 to {last}: the files are counted from 0").into()
            );
        }
        jobs = vec![jobs.swap_remove(only)];
    }
    let at_a_time = arguments.jobs.map_or(1, |jobs| jobs as usize).min(jobs.len());
    let batch = Batch {
        children: Children::new(arguments.threads, at_a_time)?,
        arguments: handed_on(arguments),
        variant: arguments.variant.clone(),
        bar: ProgressBar::new(jobs.len() as u64).with_style(
            ProgressStyle::with_template("{bar:40} {pos}/{len} scenarios, {elapsed} gone; {msg}")
                .unwrap_or_else(|_| ProgressStyle::default_bar()),
        ),
    };
    let outcomes = batch.run(&jobs, at_a_time);
    batch.bar.finish_and_clear();
    print(table::table(&jobs, &outcomes).trim_end())?;
    let failed = outcomes.iter().filter(|outcome| matches!(outcome, Outcome::Failed(_))).count();
    if failed > 0 {
        return Err(format!("{failed} of {} scenarios failed", jobs.len()).into());
    }
    let unmet = outcomes.iter().filter(|outcome| outcome.is_unexpected()).count();
    if unmet > 0 {
        tell(format_args!("{unmet} of {} scenarios came out not as expected", jobs.len()));
        return Ok(ExitCode::from(1));
    }
    Ok(ExitCode::SUCCESS)
}

impl Outcome {
    /// It came to its end, and something was not as expected.
    fn is_unexpected(&self) -> bool {
        match self {
            Self::Ran { finished, .. } | Self::Skipped { finished } => finished.unmet > 0,
            Self::Failed(_) => false,
        }
    }
}

/// A job for each file, in their order.
fn jobs(files: &[PathBuf], out: &Path) -> Result<Vec<Job>, Box<dyn Error>> {
    let mut taken = BTreeMap::new();
    let mut jobs = Vec::new();
    for file in files {
        let stem = file.file_stem().unwrap_or(OsStr::new("scenario"));
        if let Some(other) = taken.insert(stem, file) {
            let (other, file) = (other.display(), file.display());
            return Err(format!("{other} and {file} would have the same folder in --out").into());
        }
        jobs.push(Job {
            file: file.clone(),
            folder: out.join(stem),
            name: stem.to_string_lossy().into_owned(),
        });
    }
    Ok(jobs)
}

/// The arguments that every child gets, always in the same order. Not among them: what is of the batch, and the number of
/// threads, which changes no result.
fn handed_on(arguments: &ReplayArgs) -> Vec<String> {
    // Every field by its name, so that a new option cannot be forgotten here.
    let ReplayArgs {
        files: _,
        out: _,
        jobs: _,
        only: _,
        threads: _,
        resume: _,
        save_state: _,
        export: _,
        end_with_input: _,
        variant,
        fps,
        size,
        seconds,
        seed,
        no_render,
        every,
        video,
        sheet,
    } = arguments;
    let with_values = [
        ("variant", variant.clone()),
        ("fps", Some(fps.to_string())),
        ("size", Some(format!("{}x{}", size.x, size.y))),
        ("seconds", seconds.map(|seconds| seconds.to_string())),
        ("seed", seed.map(|seed| seed.to_string())),
        ("every", every.map(|every| every.to_string())),
        ("sheet", sheet.map(|sheet| sheet.to_string())),
    ];
    let with_values =
        with_values.into_iter().filter_map(|(name, value)| Some(format!("--{name}={}", value?)));
    let flags = [("--no-render", *no_render), ("--video", *video)];
    let flags = flags.into_iter().filter(|(_, is_set)| *is_set).map(|(name, _)| name.to_owned());
    with_values.chain(flags).collect()
}

struct Batch {
    children: Children,
    arguments: Vec<String>,
    variant: Option<String>,
    bar: ProgressBar,
}

impl Batch {
    /// Runs the jobs, so many at a time; what became of them, in their order.
    fn run(&self, jobs: &[Job], at_a_time: usize) -> Vec<Outcome> {
        let next = AtomicUsize::new(0);
        let work = || {
            let mut outcomes = Vec::new();
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                let Some(job) = jobs.get(number) else { return outcomes };
                self.bar.set_message(job.name.clone());
                outcomes.push((number, self.run_job(job)));
                self.bar.inc(1);
            }
        };
        let mut outcomes: Vec<(usize, Outcome)> = std::thread::scope(|threads| {
            let workers: Vec<_> = (0..at_a_time).map(|_| threads.spawn(work)).collect();
            workers.into_iter().flat_map(|worker| worker.join().unwrap_or_default()).collect()
        });
        outcomes.sort_by_key(|(number, _)| *number);
        // In order and without gaps, also if a worker should have been lost with what it knew.
        let mut known = outcomes.into_iter().peekable();
        (0..jobs.len())
            .map(|number| match known.next_if(|(known, _)| *known == number) {
                Some((_, outcome)) => outcome,
                None => Outcome::Failed("it is not known what became of it".into()),
            })
            .collect()
    }

    fn run_job(&self, job: &Job) -> Outcome {
        self.try_job(job).unwrap_or_else(|error| Outcome::Failed(error.to_string()))
    }

    fn try_job(&self, job: &Job) -> Result<Outcome, Box<dyn Error>> {
        let begun = Instant::now();
        refuse_model(&job.file)?;
        let request = Request {
            scenario: job.name.clone(),
            inputs: Scenario::load_variant(&job.file, self.variant.as_deref())?.inputs_hash()?,
            arguments: self.arguments.clone(),
            program: self.children.program_hash().to_owned(),
        };
        if let Some(finished) = Done::find(&job.folder, &request) {
            return Ok(Outcome::Skipped { finished });
        }
        Done::remove(&job.folder)?;
        let ran = self.children.run(&job.file, &job.folder, &self.arguments);
        for line in ran.said.lines() {
            self.bar.suspend(|| tell(format_args!("{}: {line}", job.name)));
        }
        ran.result?;
        let finished = Done::write(&job.folder, request)?;
        Ok(Outcome::Ran { seconds: begun.elapsed().as_secs_f64(), finished })
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::{Cli, Command};

    fn parsed(options: &str) -> ReplayArgs {
        let line = format!("weathering replay a.ron --out out {options}");
        match Cli::parse_from(line.split_whitespace()).command {
            Command::Replay(arguments) => arguments,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn children_get_what_was_asked_for() {
        let options = "--fps=5 --size=64x32 --seconds=2.5 --seed=7 --every=0.25 --sheet=12 --video";
        let handed = handed_on(&parsed(options));
        assert_eq!(handed.join(" "), options);
        // And take it for the same.
        assert_eq!(handed_on(&parsed(&handed.join(" "))), handed);
        let few = handed_on(&parsed("--no-render --threads 3 --jobs 2"));
        assert_eq!(few, ["--fps=24", "--size=640x360", "--no-render"]);
        assert_eq!(parsed("--sheet").sheet, Some(12));
    }

    #[test]
    fn a_batch_is_many_files_or_one_that_is_treated_like_many() {
        let is_batch = |options| parsed(options).is_batch();
        assert!(!is_batch("--threads 2"));
        assert!(is_batch("b.ron") && is_batch("--jobs 1") && is_batch("--only 0"));
    }

    #[test]
    fn every_scenario_has_its_folder() {
        let files = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let both = jobs(&files(&["x/a.ron", "b.ron"]), Path::new("out")).unwrap();
        assert_eq!([&both[0].folder, &both[1].folder], [Path::new("out/a"), Path::new("out/b")]);
        let error = jobs(&files(&["x/a.ron", "b.ron", "y/a.ron"]), Path::new("out")).err().unwrap();
        let message = error.to_string();
        assert!(message.contains("x/a.ron") && message.contains("y/a.ron"), "{message}");
    }
}
