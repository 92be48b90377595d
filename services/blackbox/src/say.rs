//! What the black box says to whom has started it.

use std::io::Write;

use crate::recorder::{RecordingError, Written};

/// Says where a recording lies, or why there is none.
pub fn tell(ended: Result<Written, RecordingError>) {
    match ended {
        Ok(written) => say(&format!("recorded {}", written.path.display())),
        Err(error) => say(&format!("no recording: {error}")),
    }
}

/// Says it; that nobody reads it is no reason to end.
pub fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "vigil: {text}");
}
