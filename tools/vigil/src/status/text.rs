//! A status for people: at most 80 columns, at most 24 lines for a robot with few faults.

use super::document::Document;
use super::service::Service;
use crate::clipped::clipped;
use crate::faults::document::NamedFault;
use crate::faults::table::{ago, why};
use crate::list::duration_text;
use crate::watch::Percentiles;

/// Columns of a line at most.
const COLUMNS: usize = 80;
/// Faults that are told; `vigil faults` tells all.
const FAULTS: usize = 3;
/// Events that are told; `vigil events` tells all.
const EVENTS: usize = 4;
/// What is less probable is not told.
const P_SHOWN: f64 = 0.0005;

/// The lines.
pub fn text(document: &Document) -> String {
    let mut lines = vec![head(document)];
    let because = document.unknown_because.iter();
    lines.extend(because.map(|because| format!("           {because}")));
    if document.launcher.is_none() && !document.is_past() {
        let name = &document.graph;
        lines.push(format!(
            "           no launcher: `vigil run --adopt --graph {name}` takes over"
        ));
    }
    lines.extend(faults(document));
    if let Some(detector) = &document.detector {
        let (p, text) = (detector.p_fault, detector.text());
        lines.push(format!("detector   p(fault) {p:.3}; {text}"));
    }
    if let Some(diagnosis) = &document.diagnosis {
        let mut entries = vec![(diagnosis.nominal.as_str(), diagnosis.p_nominal)];
        let leaves = diagnosis.nodes.iter().filter(|node| node.is_leaf);
        entries.extend(leaves.map(|node| (node.name.as_str(), node.p)).take(3));
        entries.push(("UNKNOWN", diagnosis.p_unknown));
        entries.sort_by(|a, b| b.1.total_cmp(&a.1));
        let told = entries.iter().filter(|(_, p)| *p >= P_SHOWN).take(4);
        let told: Vec<String> = told.map(|(name, p)| format!("{name} {p:.3}")).collect();
        let healthy = match diagnosis.mode == diagnosis.nominal {
            true => " (healthy)",
            false => "",
        };
        let mode = &diagnosis.mode;
        let told = match told.is_empty() {
            true => String::new(),
            false => format!("; {}", told.join("  ")),
        };
        lines.push(format!("diagnosis  {mode}{healthy}{told}"));
    }
    if let Some(decision) = &document.decision {
        let (action, why) = (decision.action_text(), decision.why());
        lines.push(format!("decision   {action}; {why}"));
        lines.push(format!("           {}", decision.states_text()));
    }
    lines.extend(services(&document.services));
    let times = document.end_to_end.as_ref().map(percent_text);
    lines.extend(times.map(|times| format!("time       {times}")));
    let input = document.input.as_ref().map(|input| input.text());
    lines.extend(input.map(|input| format!("input      {input}")));
    let from = document.events.len().saturating_sub(EVENTS);
    let events = document.events[from..].iter();
    lines.extend(events.map(|entry| format!("{entry}")));
    let lines = lines.iter().map(|line| clipped(line, COLUMNS));
    lines.collect::<Vec<_>>().join("\n")
}

fn head(document: &Document) -> String {
    let (graph, state) = (&document.graph, document.state_text());
    let up = document.up_s.map_or("?".to_owned(), duration_text);
    let launcher = document.launcher;
    let launcher = launcher.map_or(String::new(), |pid| format!(", launcher {pid}"));
    let rate_hz = document.rate_hz;
    format!("{graph}: {state}, {rate_hz} Hz, up {up}{launcher}")
}

fn faults(document: &Document) -> Vec<String> {
    let faults = document.faults_in_order();
    if faults.is_empty() {
        return vec!["faults     no faults".to_owned()];
    }
    let mut lines = Vec::new();
    for fault in faults.iter().take(FAULTS) {
        let title = if lines.is_empty() { "faults" } else { "" };
        lines.push(format!("{title:<11}{}", fault_text(fault)));
        let why = why(fault);
        if !why.is_empty() {
            lines.push(format!("             {why}"));
        }
    }
    let others = faults.len().saturating_sub(FAULTS) + document.faults_dropped as usize;
    if others > 0 {
        lines.push(format!(
            "           {others} more: `vigil faults` lists them"
        ));
    }
    lines
}

fn fault_text(fault: &NamedFault) -> String {
    let NamedFault { name, state, p, .. } = fault;
    let (since, action) = (ago(fault.lasts_s()), &fault.action);
    let times = match fault.count {
        1 => "once".to_owned(),
        count => format!("{count} times"),
    };
    format!("{name} {state} for {since}, {times}, p {p:.3}, {action}")
}

fn services(services: &[Service]) -> Vec<String> {
    let mut lines = vec![format!(
        "{:<11}{:<9}{:>7}{:>8}{:>8}{:>7}{:>6}{:>6}{:>6}  core",
        "services", "", "last us", "worst", "budget", "missed", "over", "lost", "late"
    )];
    for service in services {
        let (name, state) = (service.name, service.state);
        let Some(of) = &service.health else {
            lines.push(format!("{name:<11}{state}"));
            continue;
        };
        let (last, worst, budget) = (of.cycle_us_last, of.cycle_us_max, of.budget_us);
        let (core, scheduling) = (of.core, &of.scheduling);
        lines.push(format!(
            "{name:<11}{state:<9}{last:>7.0}{worst:>8.0}{budget:>8.0}{:>7}{:>6}{:>6}{:>6}  \
             {core} {scheduling}",
            of.missed, of.over_budget, of.lost, of.late
        ));
    }
    lines
}

/// From schedule to action, for people.
pub fn percent_text(times: &Percentiles) -> String {
    let Percentiles {
        latency_us_p50: p50,
        latency_us_p90: p90,
        latency_us_p99: p99,
        latency_us_max: max,
        window_s,
        age_s,
        ..
    } = times;
    let ended = match times.have_ended() {
        true => format!(", until {age_s:.0} s ago"),
        false => String::new(),
    };
    format!(
        "schedule to action p50 {p50:.0}  p90 {p90:.0}  p99 {p99:.0}  max {max:.0} us  \
         ({window_s:.1} s{ended})"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::sample::{self, NOW, setup};

    #[test]
    fn a_fault_is_told_with_why_and_what_is_done_in_80_columns_and_24_lines() {
        let setup = setup();
        let text = text(&Document::new(&sample::faulty(&setup), &setup, NOW));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[..7],
            [
                "rover: FAULT, 100 Hz, up 1 min 2 s, launcher 4711",
                "faults     RM_STUCK active for 3 min, 2 times, p 0.998, compensate",
                "             stuck; wheel rate RM says so by 5.4 nat; runner-up RM_ENC",
                "detector   p(fault) 0.998; ALARM, alarms so far 1",
                "diagnosis  RM_STUCK; RM_STUCK 0.998  ND 0.001  UNKNOWN 0.001",
                "decision   compensate; worth 1.50; go_on is worth 4.50 less",
                "           STUCK 0.750  UNKNOWN 0.250  ND 0.000",
            ]
        );
        let time = "time       schedule to action p50 250  p90 290  p99 299  max 300 us  (10.0 s)";
        assert!(lines.contains(&time), "{text}");
        assert!(lines.len() <= 24, "{text}");
        assert!(
            lines.iter().all(|line| line.chars().count() <= 80),
            "{text}"
        );
    }

    #[test]
    fn who_looks_after_a_graph_without_a_launcher_is_told() {
        let setup = setup();
        let mut view = sample::healthy(&setup);
        view.launcher = None;
        let text = text(&Document::new(&view, &setup, NOW));
        assert!(text.starts_with("rover: UNSUPERVISED, 100 Hz"), "{text}");
        assert!(text.contains("`vigil run --adopt --graph rover` takes over"));
        assert!(text.contains("\nfaults     no faults\n"), "{text}");
    }
}
