//! What a check has found, for people and for programs.

use schemars::JsonSchema;
use serde::Serialize;

use vigil_terminal::CommandError;
use vigil_terminal::output;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// As it should be.
    Ok,
    /// Nothing has shown how it is.
    Unjudged,
    /// It will work, but not as well as it could.
    Warning,
    /// It will not work.
    Failure,
}

/// One thing that was looked at.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Finding {
    /// What was looked at.
    pub check: String,
    /// How it is.
    pub status: Status,
    /// What was found, and what to do about it.
    pub detail: String,
}

impl Finding {
    /// A finding.
    pub fn new(check: impl Into<String>, status: Status, detail: impl Into<String>) -> Self {
        Self {
            check: check.into(),
            status,
            detail: detail.into(),
        }
    }
}

/// How many there are of this status.
pub fn count(findings: &[Finding], status: Status) -> usize {
    findings.iter().filter(|f| f.status == status).count()
}

/// True if none of them is a failure.
pub fn have_no_failure(findings: &[Finding]) -> bool {
    findings.iter().all(|f| f.status != Status::Failure)
}

/// Prints them, one a line.
///
/// # Errors
/// Standard output's.
pub fn print(findings: &[Finding]) -> Result<(), CommandError> {
    for finding in findings {
        let mark = match finding.status {
            Status::Ok => "ok      ",
            Status::Unjudged => "unjudged",
            Status::Warning => "warning ",
            Status::Failure => "FAILURE ",
        };
        let (check, detail) = (&finding.check, &finding.detail);
        output::line(&format!("{mark} {check:<15} {detail}")).map_err(CommandError::failure)?;
    }
    Ok(())
}
