//! A graph in one line.

use vigil_timeline::time_of_day;

use crate::status::Document;

/// Time of day, state, the worst fault, what is done, and how the services do.
pub fn text(document: &Document) -> String {
    let clock = time_of_day(&document.wall);
    let clock = clock.split('.').next().unwrap_or_default();
    let mut parts = vec![format!(
        "{clock}  {}  {}",
        document.graph,
        document.state_text()
    )];
    parts.extend(document.unknown_because.clone());
    let faults = document.faults_in_order();
    let present = || faults.iter().filter(|fault| fault.state != "cleared");
    parts.push(present().next().map_or("no faults".to_owned(), |fault| {
        let (name, state, p) = (&fault.name, fault.state, fault.p);
        let others = match present().count() - 1 {
            0 => String::new(),
            others => format!(" and {others} more"),
        };
        format!("{name} {state} p {p:.3}{others}")
    }));
    if let Some(detector) = &document.detector {
        parts.push(format!("p(fault) {:.3}", detector.p_fault));
    }
    if let Some(decision) = &document.decision {
        parts.push(decision.action_text());
    }
    if let Some(times) = &document.end_to_end {
        let (rate_hz, p99) = (document.present_rate_hz(), times.latency_us_p99);
        parts.push(format!("{rate_hz:.1} Hz, p99 {p99:.0} us"));
    }
    let health = || document.services.iter().filter_map(|it| it.health.as_ref());
    let missed: u64 = health().map(|health| health.missed).sum();
    parts.push(format!("missed {missed}"));
    let unwell = document.services.iter().filter(|it| !it.is_well());
    parts.extend(unwell.map(|it| format!("{} {}", it.name, it.state.to_uppercase())));
    parts.join(" | ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::sample::{self, NOW, setup};

    #[test]
    fn a_line_says_state_fault_action_and_time() {
        let setup = setup();
        let line = |view| text(&Document::new(&view, &setup, NOW));
        let faulty = line(sample::faulty(&setup));
        let (_, rest) = faulty.split_once("  ").unwrap();
        assert_eq!(
            rest,
            "rover  FAULT | RM_STUCK active p 0.998 | p(fault) 0.998 | compensate | \
             100.0 Hz, p99 299 us | missed 1"
        );
        let silent = line(sample::silent(&setup));
        assert!(silent.contains("STALE, UNSUPERVISED"), "{silent}");
        assert!(
            silent.contains("all services have been silent for 5.0 s"),
            "{silent}"
        );
        assert!(silent.ends_with("supervisor GONE"), "{silent}");
    }
}
