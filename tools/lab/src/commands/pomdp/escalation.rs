//! What the deterministic baseline does.

use vigil_missions::navigation;
use vigil_missions::simulation::Escalation;
use vigil_pomdp::Pomdp;

use vigil_terminal::CommandError;

/// Options of `escalation-N`.
#[derive(Debug, clap::Args)]
pub struct EscalationArgs {
    /// Action of escalation-N while no symptom is observed.
    #[arg(long, value_name = "ACTION", default_value = navigation::ACTIONS[0])]
    usual: String,
    /// Actions that escalation-N takes one after another while symptoms last.
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "MA,GO,NP,RL,SH,GU"
    )]
    ladder: Vec<String>,
    /// Observations that escalation-N takes for no symptom.
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "none,BO,ALT"
    )]
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
