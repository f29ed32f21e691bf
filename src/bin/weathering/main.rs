//! `weathering`: replays scenarios to pictures and numbers, opens them to play with, and bakes scenes.

mod bake;
mod cli;
mod replay;
mod sandbox;
mod stamps;
mod wet_texture;
mod wetmap;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let result = match cli::Cli::parse().command {
        cli::Command::Replay(arguments) => replay::run(&arguments),
        cli::Command::Sandbox(arguments) => sandbox::run(&arguments),
        cli::Command::Wetmap(command) => wetmap::run(&command),
        cli::Command::Bake(arguments) => bake::run(&arguments),
        cli::Command::Stamps(arguments) => stamps::run(&arguments),
        cli::Command::WetTexture(arguments) => wet_texture::run(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}
