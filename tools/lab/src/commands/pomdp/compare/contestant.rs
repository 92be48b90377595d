//! Who takes part.

use vigil_missions::simulation::{Agent, PolicyAgent, Random};
use vigil_pomdp::mdp::Solution;
use vigil_pomdp::policy::{DespotOptions, Dual, Gate, Information, PolicyKind};
use vigil_pomdp::{PointBased, Pomdp};

use crate::commands::pomdp::escalation::EscalationArgs;
use vigil_terminal::CommandError;

/// Firings per rung of plain `escalation`.
const PATIENCE: usize = 2;

/// A policy, with its threshold if it has one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contestant {
    /// What it is.
    pub kind: Kind,
    /// K of dual control.
    pub threshold: Option<f64>,
}

/// What a contestant is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A policy over beliefs.
    Policy(PolicyKind),
    /// The deterministic baseline, with its firings per rung.
    Escalation(usize),
    /// Any action.
    Random,
}

/// What contestants are built from.
pub struct Knowledge<'a> {
    /// What they believe in.
    pub model: &'a Pomdp,
    /// Its fully observable relaxation.
    pub solution: &'a Solution,
    /// Actions for information; `None` for all.
    pub allowed: Option<Vec<usize>>,
    /// Steps after which dual control yields.
    pub stall_steps: u32,
    /// Gate of dual control, if not the usual one.
    pub gate: Option<Gate>,
    /// What the escalation does.
    pub escalation: &'a EscalationArgs,
    /// What despot may spend.
    pub planner: DespotOptions,
    /// What point-based decides by, and despot may end with.
    pub solved: Option<PointBased>,
}

impl Knowledge<'_> {
    /// Names of the actions that dual control may take for information.
    pub fn information_actions(&self) -> Vec<&str> {
        let is_in = |action: usize| match &self.allowed {
            None => true,
            Some(list) => list.contains(&action),
        };
        let all = self.model.actions().iter().enumerate();
        all.filter(|(action, _)| is_in(*action))
            .map(|(_, name)| name.as_str())
            .collect()
    }
}

impl Contestant {
    /// Every policy; those with dual control once for each threshold.
    pub fn all(names: &[String], thresholds: &[f64]) -> Result<Vec<Self>, CommandError> {
        if let Some(k) = thresholds.iter().find(|k| !(0.0..=1.0).contains(*k)) {
            let message = format!("--thresholds: {k} is out of range: allowed is 0 to 1");
            return Err(CommandError::usage(message));
        }
        let mut all: Vec<Self> = Vec::new();
        for name in names {
            let kind = Kind::parse(name.trim())?;
            let with = |threshold| Self { kind, threshold };
            let dual = matches!(kind, Kind::Policy(policy) if policy.is_dual());
            let several = if dual {
                thresholds.iter().map(|k| with(Some(*k))).collect()
            } else {
                vec![with(None)]
            };
            if several.iter().any(|one| all.contains(one)) {
                let message = format!("--policies: '{name}' appears twice");
                return Err(CommandError::usage(message));
            }
            all.extend(several);
        }
        if all.is_empty() {
            let message = "--policies and --thresholds: allowed are one or more of each";
            return Err(CommandError::usage(message));
        }
        Ok(all)
    }

    /// Name without the threshold.
    pub fn name(&self) -> String {
        match self.kind {
            Kind::Policy(name) => name.to_string(),
            Kind::Escalation(patience) => format!("escalation-{patience}"),
            Kind::Random => "random".to_owned(),
        }
    }

    /// Name with the threshold.
    pub fn label(&self) -> String {
        match self.threshold {
            Some(k) => format!("{} K={k}", self.name()),
            None => self.name(),
        }
    }

    /// Ready to act.
    pub fn build<'a>(&self, of: &Knowledge<'a>) -> Result<Box<dyn Agent + 'a>, CommandError> {
        Ok(match self.kind {
            Kind::Random => Box::new(Random::new(of.model.actions().len())),
            Kind::Escalation(patience) => Box::new(of.escalation.build(of.model, patience)?),
            Kind::Policy(name) => {
                let threshold = self.threshold.unwrap_or(1.0);
                let dual = |information| dual(information, threshold, of);
                let solved = of.solved.as_ref();
                let decider = name.build(of.model, of.solution, dual, solved, &of.planner);
                let decider = decider.map_err(CommandError::usage)?;
                Box::new(PolicyAgent::new(of.model, decider))
            }
        })
    }
}

impl Kind {
    fn parse(name: &str) -> Result<Self, CommandError> {
        if name == "random" {
            return Ok(Self::Random);
        }
        if let Some(rest) = name.strip_prefix("escalation") {
            let patience = match rest.strip_prefix('-') {
                None if rest.is_empty() => Some(PATIENCE),
                firings => firings.and_then(|n| n.parse().ok()).filter(|n| *n > 0),
            };
            let wrong = || format!("policy '{name}': allowed is escalation-N, N from 1");
            return patience
                .map(Self::Escalation)
                .ok_or_else(|| CommandError::usage(wrong()));
        }
        let policy = name.parse().map(Self::Policy);
        policy.map_err(|error| CommandError::usage(format!("{error}, escalation-N, random")))
    }
}

fn dual(information: Information, threshold: f64, of: &Knowledge<'_>) -> Dual {
    let mut dual = Dual::new(information, threshold);
    dual.gate = of.gate.unwrap_or(dual.gate);
    dual.allowed.clone_from(&of.allowed);
    dual.stall_steps = of.stall_steps;
    dual
}
