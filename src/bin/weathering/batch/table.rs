//! What became of many scenarios, at a glance.

use std::fmt::Write;

use super::done::Finished;
use super::{Job, Outcome};

/// A line for each job: its name, what became of it, seconds, and its digest, with what was not as expected, or why it failed.
pub(super) fn table(jobs: &[Job], outcomes: &[Outcome]) -> String {
    let rows = jobs.iter().zip(outcomes).map(|(job, outcome)| {
        let [what, seconds, more] = match outcome {
            Outcome::Ran { seconds, finished } => ["ran".to_owned(), format!("{seconds:.1}"), told(finished)],
            Outcome::Skipped { finished } => ["skipped".to_owned(), String::new(), told(finished)],
            Outcome::Failed(reason) => ["failed".to_owned(), String::new(), reason.replace('\n', " ")],
        };
        [job.name.clone(), what, seconds, more]
    });
    let head = ["scenario", "outcome", "seconds", "digest or reason"].map(String::from);
    let rows: Vec<[String; 4]> = std::iter::once(head).chain(rows).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let (names, whats, seconds) = (width(0), width(1), width(2));
    let mut text = String::new();
    for [name, what, time, more] in &rows {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name:names$}  {what:whats$}  {time:>seconds$}  {more}");
    }
    text
}

/// The digest, and how much was not as expected.
fn told(Finished { digest, unmet }: &Finished) -> String {
    if *unmet == 0 { digest.clone() } else { format!("{digest}, {unmet} not as expected") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_stand_below_each_other() {
        let job = |name: &str| Job { file: name.into(), folder: name.into(), name: name.into() };
        let jobs = [job("rain"), job("a_long_name"), job("hose")];
        let outcomes = [
            Outcome::Ran { seconds: 12.34, finished: Finished { digest: "abc".into(), unmet: 0 } },
            Outcome::Skipped { finished: Finished { digest: "def".into(), unmet: 2 } },
            Outcome::Failed("it is torn".into()),
        ];
        assert_eq!(
            table(&jobs, &outcomes),
            "scenario     outcome  seconds  digest or reason\n\
             rain         ran         12.3  abc\n\
             a_long_name  skipped           def, 2 not as expected\n\
             hose         failed            it is torn\n"
        );
    }
}
