//! A decision model of exceptions, several at once: of the way, of the place, of the hardware.
//!
//! [`Parameters`] hold what a person can judge: how often an exception arises and passes, what each
//! action mends, what is seen, what things cost. Names are the user's own: exceptions, actions,
//! symptoms, outcomes. [`generate`] multiplies them out into a `.pomdp` text.
//!
//! - Exceptions of one kind exclude each other; those of different kinds come and go independently.
//! - What is wrong is a set, and its state is named by its members, joined by `-`.
//! - Symptoms are independent given the exceptions; each shows its own (noisy-or). What an action
//!   remedies shows nothing while it lasts; of the others an action may show a share.

mod fit;
mod parameters;
mod process;

pub use fit::fit;
pub use parameters::{Action, Exception, ParameterError, Parameters, Signs};
pub use process::{ExceptionProcess, NOMINAL};

use vigil_pomdp::Pomdp;

/// Says where the text comes from.
const HEAD: &str = "\
# What a robot does about exceptions of its navigation and faults of its hardware.
# Written by `vigil pomdp generate`; change the parameters, not this file.
";

/// Writes the model, in Cassandra's format.
///
/// # Errors
/// [`ParameterError`] if a parameter means nothing.
pub fn generate(parameters: &Parameters) -> Result<String, ParameterError> {
    parameters.check()?;
    let model = Pomdp::from_process(&ExceptionProcess::new(parameters))?;
    Ok(format!("{HEAD}{}", model.to_cassandra()))
}
