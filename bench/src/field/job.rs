//! What a run of a scenario is asked for, and what it brings.

use vigil_evaluation::scoring::field::Run;

use super::scenario::Scenario;

/// One run of a scenario.
#[derive(Debug, Clone, Copy)]
pub struct Job<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// Number of the run, from 0.
    pub run: usize,
    /// Print whatever changes.
    pub timeline: bool,
}

/// What a run brought with one set of sensors.
#[derive(Debug, Clone)]
pub struct ScoredRun {
    /// Name of the set.
    pub sensors: &'static str,
    /// The score.
    pub run: Run,
}
