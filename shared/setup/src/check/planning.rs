//! What a planner spends in a cycle.

use vigil_decision::Settings;
use vigil_pomdp::policy::{DespotOptions, PolicyKind};
use vigil_pomdp::{PointBased, Pomdp};

/// Whether a cycle has time for the trials of `despot`; `report` gets the key and a message if not.
pub(super) fn check(
    settings: &Settings,
    model: &Pomdp,
    solved: Option<&PointBased>,
    report: impl FnOnce(&str, String),
) {
    if settings.policy.parse() != Ok(PolicyKind::Despot) {
        return;
    }
    let options = settings.despot.options();
    let products = options.products(model, solved);
    if products > DespotOptions::PRODUCTS_MAX {
        let trials = settings.despot.trials as usize;
        let message = format!(
            "{trials} trials with {} scenarios take {products} multiplications, allowed are {}: \
             choose fewer of either",
            options.scenarios,
            DespotOptions::PRODUCTS_MAX
        );
        report("supervisor.despot.trials", message);
    }
}
