//! `weathering`: replays scenarios to pictures and numbers, opens them to play with, and bakes scenes.

mod bake;
mod batch;
mod check;
mod cli;
mod replay;
mod sandbox;
mod stamps;
mod wet_texture;
mod wetmap;

use std::error::Error;
use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal, Write};
use std::process::ExitCode;

use bevy::log::tracing_subscriber;
use clap::Parser;

/// What has done all it should.
fn done(result: Result<(), Box<dyn Error>>) -> Result<ExitCode, Box<dyn Error>> {
    result.map(|()| ExitCode::SUCCESS)
}

/// Writes a line to standard output, which may be a full disk. That whoever reads it has had enough, as `head` has, is no
/// error.
fn print(line: impl Display) -> Result<(), Box<dyn Error>> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{line}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(format!("cannot write to standard output: {error}").into())
        }
        _ => Ok(()),
    }
}

/// Writes a line to standard error. Where nobody can read it, there is no one to tell either; `eprintln!` would panic.
fn tell(line: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// Whether what goes to standard error is in colour: only where a terminal shows it and `NO_COLOR` is not set.
fn is_in_color() -> bool {
    let is_set = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    std::io::stderr().is_terminal() && !is_set
}

/// Warnings go to standard error.
fn log_warnings() {
    tracing_subscriber::fmt()
        .with_max_level(bevy::log::Level::WARN)
        .with_ansi(is_in_color())
        .with_writer(std::io::stderr)
        // It would be told with `eprintln!`, which panics where nobody reads.
        .log_internal_errors(false)
        .init();
}

fn main() -> ExitCode {
    let result = match cli::Cli::parse().command {
        cli::Command::Replay(arguments) => replay::run(&arguments),
        cli::Command::Check(arguments) => check::run(&arguments),
        cli::Command::Schema => check::print_schema(),
        cli::Command::Sandbox(arguments) => done(sandbox::run(&arguments)),
        cli::Command::Wetmap(command) => done(wetmap::run(&command)),
        cli::Command::Bake(arguments) => done(bake::run(&arguments)),
        cli::Command::Stamps(arguments) => done(stamps::run(&arguments)),
        cli::Command::WetTexture(arguments) => done(wet_texture::run(&arguments)),
    };
    match result {
        Ok(code) => code,
        Err(error) => {
            tell(format_args!("error: {error}"));
            ExitCode::from(2)
        }
    }
}
