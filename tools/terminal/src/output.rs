//! Standard output and standard error. A reader that closed its end has seen enough: not an error.

use std::io::{self, ErrorKind, IsTerminal, Write};

use serde::Serialize;

/// Prints one JSON document, pretty, ended by a line break.
///
/// # Errors
/// The system's, except that of a closed pipe.
pub fn json(document: &impl Serialize) -> io::Result<()> {
    line(&serde_json::to_string_pretty(document)?)
}

/// Prints one JSON document as a line.
///
/// # Errors
/// The system's, except that of a closed pipe.
pub fn json_line(document: &impl Serialize) -> io::Result<()> {
    line(&serde_json::to_string(document)?)
}

/// Prints a line.
///
/// # Errors
/// The system's, except that of a closed pipe.
pub fn line(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    let result = writeln!(out, "{text}").and_then(|()| out.flush());
    match result {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        Err(error) => Err(io::Error::new(
            error.kind(),
            format!("standard output: {error}"),
        )),
        Ok(()) => Ok(()),
    }
}

/// Counts on standard error what is done, if it is a terminal.
#[derive(Debug)]
pub struct Progress {
    what: &'static str,
    total: usize,
    shown: bool,
}

impl Progress {
    /// Will count up to `total`.
    pub fn new(what: &'static str, total: usize) -> Self {
        let shown = io::stderr().is_terminal();
        Self { what, total, shown }
    }

    /// So many are done.
    pub fn show(&self, done: usize) {
        if self.shown {
            eprint!("\r{} {done} of {} ", self.what, self.total);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.shown {
            // Back to the start of the line, and clear it.
            eprint!("\r\x1b[K");
        }
    }
}
