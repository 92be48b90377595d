//! Rules of `[supervisor]`.

use vigil_blocks::Symptoms;
use vigil_decision::{Evidence, Recovery, Settings};
use vigil_pomdp::policy::PolicyKind;

use crate::graph_file::{GraphFile, Navigation, Source};

/// With symptoms, the shortest epoch, ms. Chosen: no manoeuvre shows an outcome sooner. A larger
/// one refuses quick robots.
const EPOCH_MIN_MS: f64 = 1000.0;

/// Policy, evidence, and actions that only a robot with a path can take.
pub(super) fn check(file: &GraphFile, report: &mut impl FnMut(&str, String)) {
    let settings = &file.supervisor;
    policy(settings, report);
    let simulates = file.sensor.source == Source::Simulator;
    if settings.evidence == Evidence::Faults {
        let message = "has a meaning only with supervisor.evidence = \"symptoms\"";
        let is_given = [
            ("lost_state", settings.lost_state.is_some()),
            ("symptoms", !settings.symptoms.is_empty()),
        ];
        for (key, _) in is_given.into_iter().filter(|(_, is_given)| *is_given) {
            report(&format!("supervisor.{key}"), message.to_owned());
        }
    }
    symptoms(settings, report);
    for (name, action) in &settings.actions {
        if settings.evidence == Evidence::Faults && action.epoch_ms.is_some() {
            let message = "has a meaning only with supervisor.evidence = \"symptoms\"";
            report(
                &format!("supervisor.actions.{name}.epoch_ms"),
                message.to_owned(),
            );
        }
    }
    if settings.evidence == Evidence::Symptoms {
        durations(file, report);
    }
    if settings.evidence == Evidence::Symptoms && simulates && file.monitors.is_none() {
        let message = "\"symptoms\" requires [monitors]: the simulator reports none of its own";
        report("supervisor.evidence", message.to_owned());
    }
    if simulates && file.navigation.is_none() {
        for (name, action) in &settings.actions {
            if needs_path(action.kind) {
                let key = format!("supervisor.actions.{name}.kind");
                let message = "the simulator can do this only with a path: [navigation]";
                report(&key, message.to_owned());
            }
        }
    }
}

/// Symptoms of the user's own: names that sets can be written with, and bits of their own.
fn symptoms(settings: &Settings, report: &mut impl FnMut(&str, String)) {
    let is_letter = |c: char| c.is_ascii_alphanumeric();
    for (name, own) in &settings.symptoms {
        let key = format!("supervisor.symptoms.{name}");
        let is_taken = name == "none" || Symptoms::NAMED.iter().any(|(taken, _)| taken == name);
        if is_taken || !name.starts_with(is_letter) || !name.chars().all(is_letter) {
            let message = "is no name for a symptom: allowed are letters and digits, and none of \
                           none, EPS, EPM, LD, SD, BO, ALT, NNA";
            report(&key, message.to_owned());
        }
        let same = settings
            .symptoms
            .iter()
            .filter(|(_, other)| other.bit == own.bit);
        if let Some((other, _)) = same.into_iter().find(|(other, _)| *other < name) {
            report(&key, format!("has the bit {} of '{other}'", own.bit));
        }
    }
}

/// Epochs in which a robot can do something, and a limit that no action of the simulator reaches.
fn durations(file: &GraphFile, report: &mut impl FnMut(&str, String)) {
    let settings = &file.supervisor;
    if settings.epoch_ms < EPOCH_MIN_MS {
        let message = format!(
            "{} is out of range: with supervisor.evidence = \"symptoms\" allowed is \
             {EPOCH_MIN_MS} or more; a robot does nothing about an exception in less",
            settings.epoch_ms
        );
        report("supervisor.epoch_ms", message);
    }
    let longest_s = file.navigation.as_ref().map(Navigation::longest_action_s);
    if let Some(longest_s) = longest_s.filter(|longest_s| settings.action_max_s < *longest_s) {
        let message = format!(
            "{} is too short: with these durations of [navigation] an action may run for \
             {longest_s}",
            settings.action_max_s
        );
        report("supervisor.action_max_s", message);
    }
}

const fn needs_path(kind: Recovery) -> bool {
    use Recovery as R;
    matches!(
        kind,
        R::NewPath | R::Relocalise | R::GoThrough | R::MoveAway | R::GiveUp
    )
}

/// Name of the policy, and what its dual control needs.
fn policy(settings: &Settings, report: &mut impl FnMut(&str, String)) {
    let kind = match settings.policy.parse::<PolicyKind>() {
        Ok(kind) => kind,
        Err(error) => return report("supervisor.policy", error.to_string()),
    };
    match (kind, &settings.policy_file) {
        (PolicyKind::PointBased, None) => {
            let message = "point-based requires supervisor.policy_file: what `vigil pomdp solve \
                           MODEL --out FILE` has written";
            report("supervisor.policy", message.to_owned());
        }
        (PolicyKind::Heuristic(_), Some(_)) => {
            let message = "has a meaning only with supervisor.policy = \"point-based\" or \
                           \"despot\"";
            report("supervisor.policy_file", message.to_owned());
        }
        _ => {}
    }
    let is_dual = kind.is_dual();
    let key = "supervisor.information_actions";
    let named = &settings.information_actions;
    if settings.as_published && (!named.is_empty() || settings.gate.is_some()) {
        let message = "with as_published neither information_actions nor gate has a meaning";
        report("supervisor.as_published", message.to_owned());
    } else if is_dual && named.is_empty() && !settings.as_published {
        let message = format!(
            "is required by {}: one or more actions of the decision model that do not end or \
             interrupt the task",
            settings.policy
        );
        report(key, message);
    }
    if settings.switching_cost > 0.0 && settings.evidence == Evidence::Symptoms {
        let message = "has a meaning only with supervisor.evidence = \"faults\"";
        report("supervisor.switching_cost", message.to_owned());
    }
    for (i, name) in named.iter().enumerate() {
        if named[..i].contains(name) {
            report(key, format!("'{name}' appears twice"));
        }
    }
}
