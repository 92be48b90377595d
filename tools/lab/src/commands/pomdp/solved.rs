//! Policies in files.

use std::fs;
use std::path::Path;

use vigil_pomdp::policy_file::{PolicyFile, alpha, appl};
use vigil_pomdp::{PointBased, Pomdp};

use vigil_terminal::CommandError;

/// The policy of `model` in a file of any format that `vigil pomdp solve` writes; `option` gave it.
///
/// # Errors
/// The option, the file, what was found and what is allowed.
pub fn load(model: &Pomdp, option: &str, path: &Path) -> Result<PointBased, CommandError> {
    let wrong = |problem: &dyn std::fmt::Display| {
        CommandError::usage(format!("{option} {}: {problem}", path.display()))
    };
    let bytes = fs::read(path).map_err(|error| wrong(&error))?;
    let text = String::from_utf8_lossy(&bytes);
    let vectors = if text.trim_start().starts_with('<') {
        warn_of_nameless(option, path);
        appl::read(&text, model).map_err(|e| wrong(&e))?
    } else if text.trim_start().starts_with('{') {
        let file = PolicyFile::read(&bytes, model).map_err(|e| wrong(&e))?;
        file.vectors
    } else {
        warn_of_nameless(option, path);
        alpha::read(&text, model).map_err(|e| wrong(&e))?
    };
    PointBased::new(model, &vectors).map_err(|e| wrong(&e))
}

/// Other programs' formats say how many states and actions a model has, not which model it is.
fn warn_of_nameless(option: &str, path: &Path) {
    eprintln!(
        "{option} {}: warning: this format does not say which model the policy was solved for, \
         and it cannot be checked that it was this one; Vigil's own format says it",
        path.display()
    );
}
