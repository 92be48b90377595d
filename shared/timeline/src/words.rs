//! Words of the timeline: symptoms, outcomes, degraded services, blindness, watchdog, reasons.

use vigil_blocks::{
    ActionOutcome, Blindness, ControlCommand, Degraded, Event, MODE_MULTIPLE, RecoveryKind,
    ServiceState, Symptoms, mode_word,
};
use vigil_cycle::watchdog::WatchdogFinding;

/// Symptoms, joined by `_` as in the decision model; `none` for the empty set. `own` are those that
/// the graph declares, each with the set that holds it alone.
pub fn symptoms(set: u32, own: &[(String, u32)]) -> String {
    let own = own.iter().map(|(name, bit)| (name.as_str(), *bit));
    let named = Symptoms::NAMED.into_iter().chain(own);
    let present = named.filter(|(_, bit)| set & bit != 0);
    let present: Vec<&str> = present.map(|(name, _)| name).collect();
    if present.is_empty() {
        "none".into()
    } else {
        present.join("_")
    }
}

/// How a recovery action ended.
pub fn outcome(event: &Event) -> String {
    use RecoveryKind as K;
    let outcome = u32::try_from(event.value).ok();
    let succeeded = outcome == Some(ActionOutcome::Succeeded as u32);
    let words = match (K::from_repr(event.what), succeeded) {
        (Some(K::GoThrough), true) => "blockage overtaken",
        (Some(K::GoThrough), false) => "no opening",
        (Some(K::NewPath), true) => "alternative path",
        (Some(K::NewPath), false) => "no alternative",
        (Some(K::Relocalise), true) => "place found",
        (Some(K::MoveAway), true) => "moved away",
        (Some(K::MoveAway), false) => "could not move away",
        (Some(K::CallForHelp), true) => "help came",
        (Some(K::GiveUp), true) => "task given up",
        (Some(K::Stop), true) => "stopped",
        (_, true) => "done",
        (_, false) => "failed",
    };
    words.into()
}

/// Why a service is in degraded mode; `no longer` if it is not.
pub fn degraded(bits: u32) -> String {
    let reasons = [
        (Degraded::INPUT_LOST, "input lost"),
        (Degraded::LATE, "late"),
        (Degraded::FEWER_PARTICLES, "fewer particles"),
        (Degraded::QUARANTINE, "source in quarantine"),
    ];
    let present = reasons.iter().filter(|(bit, _)| bits & bit != 0);
    let present: Vec<&str> = present.map(|(_, word)| *word).collect();
    if present.is_empty() {
        "no longer".into()
    } else {
        present.join(", ")
    }
}

/// The life of a service in a word.
pub const fn service_state(state: u32) -> &'static str {
    const STARTING: u32 = ServiceState::Starting as u32;
    const READY: u32 = ServiceState::Ready as u32;
    const RUNNING: u32 = ServiceState::Running as u32;
    const STOPPING: u32 = ServiceState::Stopping as u32;
    match state {
        STARTING => "starting",
        READY => "ready",
        RUNNING => "running",
        STOPPING => "stopping",
        _ => "?",
    }
}

/// Why the detector is blind.
pub fn blind(cause: u32) -> &'static str {
    Blindness::from_repr(cause).map_or("?", Blindness::as_str)
}

/// An order that was not carried out, by its command.
pub const fn refused(command: u32) -> &'static str {
    const ACKNOWLEDGE: u32 = ControlCommand::Acknowledge as u32;
    const FORGET: u32 = ControlCommand::Forget as u32;
    const INJECT: u32 = ControlCommand::Inject as u32;
    const CLEAR: u32 = ControlCommand::Clear as u32;
    match command {
        ACKNOWLEDGE => "acknowledge: there is no such fault to acknowledge",
        FORGET => "clear: no fault is over",
        INJECT => "inject: not allowed, or not possible",
        CLEAR => "inject clear: not allowed, or nothing to mend",
        _ => "an order that is not for this service",
    }
}

/// What the watchdog has found of a service.
pub const fn watchdog(finding: WatchdogFinding) -> &'static str {
    match finding {
        WatchdogFinding::StartUp => "did not start up in time",
        WatchdogFinding::Alive => "has stopped reporting",
        WatchdogFinding::Deadline => "misses its deadlines",
        WatchdogFinding::Logical => "no longer follows its input",
    }
}

/// How many cycles.
pub fn cycles(count: u64) -> String {
    match count {
        1 => "1 cycle".to_owned(),
        count => format!("{count} cycles"),
    }
}

/// What speaks most for a fault, by how much, and what would explain the data next best.
#[must_use]
pub fn reason(channel: &str, evidence_nat: f64, runner_up: &str) -> String {
    let runner_up = match Some(runner_up) == mode_word(MODE_MULTIPLE) {
        true => "several faults",
        false => runner_up,
    };
    format!("{channel} says so by {evidence_nat:.1} nat; runner-up {runner_up}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_cycle_and_a_set_are_told_as_people_say_it() {
        assert_eq!([cycles(1), cycles(2)], ["1 cycle", "2 cycles"]);
        let told = reason("wheel rate RM", 4.81, "MULTIPLE");
        assert_eq!(
            told,
            "wheel rate RM says so by 4.8 nat; runner-up several faults"
        );
        let told = reason("wheel rate RM", 4.81, "RM_ENC");
        assert_eq!(told, "wheel rate RM says so by 4.8 nat; runner-up RM_ENC");
    }

    #[test]
    fn sets_of_symptoms_and_reasons_are_joined_and_empty_ones_have_a_word() {
        let own = [("DOOR".to_owned(), 1 << 9)];
        assert_eq!(symptoms(0, &own), "none");
        assert_eq!(symptoms(Symptoms::EPS | Symptoms::LD, &own), "EPS_LD");
        assert_eq!(symptoms(1 << 9 | Symptoms::LD, &own), "LD_DOOR");
        assert_eq!(degraded(0), "no longer");
        let both = Degraded::INPUT_LOST | Degraded::LATE;
        assert_eq!(degraded(both), "input lost, late");
    }

    #[test]
    fn what_this_version_does_not_know_is_a_question_mark_and_no_panic() {
        assert_eq!(blind(Blindness::Silence as u32), "no frames");
        assert_eq!(blind(99), "?");
        let outcome_of = |what, value| {
            outcome(&Event {
                what,
                value,
                ..Event::default()
            })
        };
        let succeeded = ActionOutcome::Succeeded as u64;
        let path = RecoveryKind::NewPath as u32;
        assert_eq!(outcome_of(path, succeeded), "alternative path");
        assert_eq!(outcome_of(path, u64::MAX), "no alternative");
        assert_eq!(outcome_of(99, succeeded), "done");
        assert_eq!(watchdog(WatchdogFinding::Alive), "has stopped reporting");
    }
}
