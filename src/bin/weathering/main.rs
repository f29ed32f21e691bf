//! `weathering`: replays scenarios to pictures and numbers, and opens them to play with.

mod batch;
mod check;
mod cli;
mod replay;
mod sandbox;
mod stamps;
mod wet_texture;
mod wetmap;

use std::error::Error;
use std::process::ExitCode;

use clap::Parser;

/// What has done all it should.
fn done(result: Result<(), Box<dyn Error>>) -> Result<ExitCode, Box<dyn Error>> {
    result.map(|()| ExitCode::SUCCESS)
}

fn main() -> ExitCode {
    let result = match cli::Cli::parse().command {
        cli::Command::Replay(arguments) => replay::run(&arguments),
        cli::Command::Check(arguments) => check::run(&arguments),
        cli::Command::Schema => check::print_schema(),
        cli::Command::Sandbox(arguments) => done(sandbox::run(&arguments)),
        cli::Command::Wetmap(command) => done(wetmap::run(&command)),
        cli::Command::Stamps(arguments) => done(stamps::run(&arguments)),
        cli::Command::WetTexture(arguments) => done(wet_texture::run(&arguments)),
    };
    match result {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}
