//! Programs that run one scenario each. What one of them does, or suffers, does not touch the others.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Starts children of this very program.
pub struct Children {
    program: PathBuf,
    hash: String,
    /// Threads that each may use.
    threads: Option<usize>,
}

/// What became of a child.
pub struct Ran {
    /// Why it failed, if it did.
    pub result: Result<(), String>,
    /// What it wrote to its standard error, but for what is in `result`.
    pub said: String,
}

impl Children {
    /// `threads`: as told for each; otherwise they share the cores when several run at a time.
    ///
    /// # Errors
    /// If this program cannot be found or read.
    pub fn new(threads: Option<usize>, at_a_time: usize) -> Result<Self, Box<dyn Error>> {
        let program = std::env::current_exe()?;
        let bytes = std::fs::read(&program)
            .map_err(|error| format!("cannot read the program, {}: {error}", program.display()))?;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let share = (at_a_time > 1).then(|| (cores / at_a_time).max(1));
        let hash = blake3::hash(&bytes).to_hex().to_string();
        Ok(Self { program, hash, threads: threads.or(share) })
    }

    /// Hash of the program: another one may come to other results.
    pub fn program_hash(&self) -> &str {
        &self.hash
    }

    /// Runs a scenario to its end.
    pub fn run(&self, file: &Path, out: &Path, arguments: &[String]) -> Ran {
        let mut command = Command::new(&self.program);
        command.arg("replay").arg("--out").arg(out).args(arguments).arg("--end-with-input");
        if let Some(threads) = self.threads {
            command.args(["--threads", &threads.to_string()]);
        }
        // A file may be called like an option.
        command.arg("--").arg(file);
        match finish(command) {
            Ok(ran) => ran,
            Err(error) => Ran { result: Err(format!("cannot be started: {error}")), said: String::new() },
        }
    }
}

/// How the line begins that tells why a child failed.
const ERROR: &str = "error: ";

fn finish(mut command: Command) -> io::Result<Ran> {
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    // What it says is read by this program first.
    command.env("NO_COLOR", "1");
    let mut child = command.spawn()?;
    // Held until the child has ended; it is let go, too, if this program is killed, and then the child ends.
    let held = child.stdin.take();
    let output = child.wait_with_output()?;
    drop(held);
    let text = String::from_utf8_lossy(&output.stderr);
    // Something was not as expected, which its report tells: it came to its end all the same.
    if output.status.success() || output.status.code() == Some(1) {
        return Ok(Ran { result: Ok(()), said: text.into_owned() });
    }
    // The last error tells why. Where there is none it did not end by itself, and any line may be about something else.
    let mut lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    let error = lines.iter().rposition(|line| line.starts_with(ERROR));
    let reason = error.map(|at| lines.remove(at).replacen(ERROR, "", 1));
    let reason = reason.unwrap_or_else(|| output.status.to_string());
    Ok(Ran { result: Err(reason), said: lines.join("\n") })
}

/// Ends this program, whatever it is at, when its standard input ends: nobody waits for its results any more, and somebody else
/// may begin the same folder anew. What it was writing is not there under its name.
pub fn end_with_input() {
    std::thread::spawn(exit_after_input);
}

fn exit_after_input() {
    // An error is an end, too.
    let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
    std::process::exit(3);
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;

    fn ran(script: &str) -> Ran {
        let mut command = Command::new("sh");
        command.arg("-c").arg(script);
        finish(command).unwrap()
    }

    #[test]
    fn a_child_failed_by_its_last_error_or_by_how_it_ended() {
        let told =
            ran("echo 'warning: x' >&2; echo 'error: a' >&2; echo 'error: error: b' >&2; echo y >&2; exit 2");
        assert_eq!(told.result.unwrap_err(), "error: b");
        assert_eq!(told.said, "warning: x\nerror: a\ny");

        let killed = ran("echo 'warning: x' >&2; kill -9 $$");
        let reason = killed.result.unwrap_err();
        assert!(reason.contains("SIGKILL"), "{reason}");
        assert_eq!(killed.said, "warning: x");

        let panicked = ran("echo 'it panicked' >&2; echo 'note: run with a backtrace' >&2; exit 101");
        let reason = panicked.result.unwrap_err();
        assert!(reason.contains("101"), "{reason}");
        assert_eq!(panicked.said, "it panicked\nnote: run with a backtrace");
    }

    #[test]
    fn what_came_to_its_end_did_not_fail() {
        for code in [0, 1] {
            let ended = ran(&format!("echo 'error: not one' >&2; exit {code}"));
            assert_eq!(ended.result, Ok(()), "{code}");
            assert_eq!(ended.said, "error: not one\n");
        }
    }
}
