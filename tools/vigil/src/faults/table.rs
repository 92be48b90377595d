//! Faults for people.

use vigil_timeline::unix_time_of_day;

use super::document::{Document, NamedFault};

/// The overall state, and a line for each fault with why below it.
pub fn text(document: &Document) -> String {
    let mut lines = vec![format!("overall: {}", document.overall)];
    if document.faults.is_empty() {
        lines.push("no faults".to_owned());
    } else {
        lines.push(format!(
            "{:>3}  {:<14} {:<12} {:>9}  {:<12} {:>5}  {:<16} {}",
            "no.", "fault", "state", "for", "first at", "times", "action", "p"
        ));
    }
    for fault in &document.faults {
        lines.push(line(fault));
        let why = why(fault);
        if !why.is_empty() {
            lines.push(format!("     {why}"));
        }
    }
    if document.dropped > 0 {
        let dropped = document.dropped;
        lines.push(format!(
            "{dropped} more have no place: acknowledge what is over"
        ));
    }
    lines.join("\n")
}

fn line(fault: &NamedFault) -> String {
    format!(
        "{:>3}  {:<14} {:<12} {:>9}  {:<12} {:>5}  {:<16} {:.3}",
        fault.number,
        fault.name,
        fault.state,
        ago(fault.changed_ago_s),
        first_at(fault),
        fault.count,
        fault.action,
        fault.p,
    )
}

/// The size, and what speaks for it.
pub fn why(fault: &NamedFault) -> String {
    let evidence = fault.evidence.as_ref().map(|it| {
        let (channel, nat, against) = (&it.channel, it.nat, &it.against);
        format!("{channel} says so by {nat:.1} nat; runner-up {against}")
    });
    let size = fault.size.as_ref().map(|size| size.text.clone());
    let parts = size.into_iter().chain(evidence);
    parts.collect::<Vec<String>>().join("; ")
}

/// Time of day at which it was present first.
pub fn first_at(fault: &NamedFault) -> String {
    let time = unix_time_of_day(fault.first_unix_s);
    time.split('.').next().unwrap_or_default().to_owned()
}

/// A time that has passed, short.
pub fn ago(seconds: f64) -> String {
    match seconds {
        s if s < 60.0 => format!("{s:.1} s"),
        s if s < 3600.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}
