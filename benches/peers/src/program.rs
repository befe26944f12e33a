//! A peer in a process of its own.

use std::fmt;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Why a peer is not here.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Absent(pub String);

impl fmt::Display for Absent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// A running peer. It prints `ready` once it has read its data; then, for each line it reads (the
/// name of a case), it measures one round and prints the figure on a line. It ends with its input.
pub struct Program {
    child: Child,
    ask: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl Program {
    /// Starts a program and waits until it is ready.
    ///
    /// # Errors
    /// When it does not start, or ends or says something else before `ready`.
    pub fn start(command: &mut Command) -> Result<Self, Absent> {
        let name = format!("{command:?}");
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| Absent(format!("{name} does not start: {error}")))?;
        let (ask, answers) = (child.stdin.take(), child.stdout.take());
        let answers = BufReader::new(answers.ok_or_else(|| Absent(format!("{name} has no output")))?);
        let mut program = Self { child, ask, answers };
        match program.answer() {
            Some(line) if line == "ready" => Ok(program),
            other => Err(Absent(format!("{name} said {other:?} in place of \"ready\""))),
        }
    }

    /// Measures one round of a case.
    ///
    /// # Panics
    /// When the program ended or answered what is no number: then there is nothing to compare with.
    pub fn round(&mut self, case: &str) -> f64 {
        let line = self.line(case);
        line.parse().unwrap_or_else(|_| panic!("{case}: the peer answered {line:?}, not a number"))
    }

    /// Asks a question whose answer is any one line.
    ///
    /// # Panics
    /// When the program ended.
    pub fn line(&mut self, question: &str) -> String {
        let asked = self.ask.as_mut().is_some_and(|ask| writeln!(ask, "{question}").and_then(|()| ask.flush()).is_ok());
        assert!(asked, "{question}: the peer has ended");
        self.answer().unwrap_or_else(|| panic!("{question}: the peer ended without an answer"))
    }

    fn answer(&mut self) -> Option<String> {
        let mut line = String::new();
        let read = self.answers.read_line(&mut line).ok()?;
        (read > 0).then(|| line.trim().to_owned())
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // The end of its input ends it; one that does not obey is killed before it is waited for.
        self.ask = None;
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Result<Program, Absent> {
        Program::start(Command::new("sh").args(["-c", script]))
    }

    /// A program answers round by round; one that is not ready is absent and says why.
    #[test]
    fn a_program_answers_line_by_line() {
        let mut program = shell("echo ready; while read case; do echo 2.5; done").expect("it is ready");
        assert_eq!(program.round("a"), 2.5);
        assert_eq!(program.line("b"), "2.5");
        let absent = shell("echo no such file").err().expect("it is not ready");
        assert!(absent.to_string().ends_with(r#"said Some("no such file") in place of "ready""#), "{absent}");
        let absent = Program::start(&mut Command::new("no-such-program")).err().expect("there is none");
        assert!(absent.to_string().contains("\"no-such-program\" does not start: "), "{absent}");
    }
}
