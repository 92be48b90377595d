//! What is said in one run, whenever it changes: for whoever asks why a bar is not met.

use std::fmt::Write as _;

use vigil_evaluation::scoring::Verdict;
use vigil_evaluation::stages::Stages;

use super::job::Job;

/// Prints a line on standard error for every change of alarm, name, set of faults or action.
#[derive(Debug)]
pub(super) struct Timeline {
    head: String,
    said: String,
}

impl Timeline {
    /// Of a run with these sensors, if it is asked for.
    pub(super) fn asked_for(job: &Job<'_>, seed: u64, sensors: &str) -> Option<Self> {
        job.timeline.then(|| Self {
            head: format!("{} {seed} {sensors}", job.scenario.name),
            said: String::new(),
        })
    }

    /// Takes the next verdict.
    pub(super) fn take(&mut self, verdict: &Verdict, stages: &Stages, command: &[f64]) {
        let alarm = if verdict.alarm { "ALARM" } else { "-" };
        let said = format!(
            "{alarm} mode {} reported {} set {} {:?}",
            verdict.mode, verdict.reported, verdict.fault_set, verdict.order
        );
        if said == self.said {
            return;
        }
        let mut line = format!("{} {:.2} s: {said}, p", self.head, verdict.t_s);
        let name = |node| stages.taxonomy().name(node).unwrap_or("?");
        let nodes = verdict.p_nodes.iter().enumerate();
        let nodes = nodes.map(|(node, p)| (name(node), *p));
        for (name, p) in highest(nodes).chain([("UNKNOWN", verdict.p_unknown)]) {
            let _ = write!(line, " {name} {p:.3}");
        }
        line.push_str(", log-odds by channel");
        let channels = stages
            .detection()
            .channel_log_odds
            .iter()
            .copied()
            .enumerate();
        for (channel, log_odds) in highest(channels) {
            let _ = write!(line, " {channel}: {log_odds:.1}");
        }
        eprintln!("{line}, command {command:.2?}");
        self.said = said;
    }
}

/// The four highest.
fn highest<T>(all: impl Iterator<Item = (T, f64)>) -> impl Iterator<Item = (T, f64)> {
    let mut all: Vec<(T, f64)> = all.collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.into_iter().take(4)
}
