//! What the deterministic baseline does.

use vigil_missions::navigation;
use vigil_missions::simulation::Escalation;
use vigil_pomdp::Pomdp;

use vigil_terminal::CommandError;

/// Options of `escalation-N`.
#[derive(Debug, clap::Args)]
pub struct EscalationArgs {
    /// What escalation-N does while nothing fires.
    #[arg(long, default_value = navigation::ACTIONS[0])]
    usual: String,
    /// The rungs of escalation-N.
    #[arg(long, value_delimiter = ',', default_value = "MA,GO,NP,RL,SH,GU")]
    ladder: Vec<String>,
    /// Observations in which nothing fires, for escalation-N.
    #[arg(long, value_delimiter = ',', default_value = "none,BO,ALT")]
    quiet: Vec<String>,
}

impl EscalationArgs {
    /// Takes the next rung after `patience` firings in a row.
    ///
    /// # Errors
    /// A name that the model does not have.
    pub fn build(&self, model: &Pomdp, patience: usize) -> Result<Escalation, CommandError> {
        let ladder: Vec<&str> = self.ladder.iter().map(String::as_str).collect();
        let quiet: Vec<&str> = self.quiet.iter().map(String::as_str).collect();
        let built = Escalation::new(model, &self.usual, &ladder, &quiet, patience);
        built.map_err(CommandError::usage)
    }
}
