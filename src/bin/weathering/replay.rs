//! `weathering replay`.

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

use bevy_weathering::replay::{ReplayOptions, replay};
use bevy_weathering::scenario::{Expectation, ExpectationOutcome, Scenario};
use indicatif::{ProgressBar, ProgressStyle};

use crate::batch;
use crate::cli::{ReplayArgs, refuse_model};
use crate::{log_warnings, print, tell};

/// Exit code 1 if something was not as the scenario expects it.
pub fn run(arguments: &ReplayArgs) -> Result<ExitCode, Box<dyn Error>> {
    log_warnings();
    match arguments.files.as_slice() {
        [file] if !arguments.is_batch() => run_one(file, arguments),
        _ => batch::run(arguments),
    }
}

fn run_one(file: &Path, arguments: &ReplayArgs) -> Result<ExitCode, Box<dyn Error>> {
    if arguments.end_with_input {
        batch::end_with_input();
    }
    refuse_model(file)?;
    let options = ReplayOptions {
        out: arguments.out.clone(),
        fps: arguments.fps,
        size: arguments.size,
        seconds: arguments.seconds,
        seed: arguments.seed,
        threads: arguments.threads,
        render: !arguments.no_render,
        resume: arguments.resume.clone(),
        save: arguments.save_state.clone(),
        every: arguments.every,
        video: arguments.video,
        sheet: arguments.sheet,
        export: arguments.export.clone(),
        ..ReplayOptions::new(Scenario::load_variant(file, arguments.variant.as_deref())?)
    };
    for flaw in &options.scenario.scenario.flaws {
        tell(format_args!("warning: the recorded session comes out differently: {flaw}"));
    }
    let bar = ProgressBar::no_length().with_style(
        ProgressStyle::with_template("{bar:40} tick {pos}/{len}, {elapsed} gone, {eta} to go")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let report = replay(&options, |progress| {
        bar.set_length(progress.ticks.into());
        bar.set_position(progress.tick.into());
    })?;
    bar.finish_and_clear();
    match &arguments.out {
        Some(out) => {
            let hits = report.particles.hit;
            let frames = report.timing.frames;
            print(format!("{hits} impacts, {frames} pictures, digest {}", report.digest))?;
            print(out.join("report.json").display())?;
        }
        None => print(serde_json::to_string_pretty(&report)?)?,
    }
    for outcome in report.failed() {
        tell(format_args!("not as expected: {}", describe(outcome)));
    }
    Ok(if report.failed().next().is_none() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// An expectation and what came of it, in a line.
fn describe(outcome: &ExpectationOutcome) -> String {
    let ExpectationOutcome { event, at, expectation, value, .. } = outcome;
    let Expectation { quantity, surface, above, below } = expectation;
    let of = surface.as_ref().map(|name| format!(" of {name}")).unwrap_or_default();
    let bound = |word: &str, bound: &Option<f64>| bound.map(|bound| format!("{word} {bound}"));
    let bounds: Vec<_> = [bound("above", above), bound("below", below)].into_iter().flatten().collect();
    let value = value.map_or_else(|| "not measured".to_owned(), |value| value.to_string());
    let bounds = bounds.join(" and ");
    format!("events[{event}] at {at} s: {quantity:?}{of} is {value}, but should be {bounds}")
}
