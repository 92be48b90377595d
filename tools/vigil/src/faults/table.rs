//! Faults for people.

use vigil_timeline::{reason_text, unix_time_of_day};

use super::document::{Document, NamedFault};

/// A fault that was present so long ago is quiet, s.
const QUIET_S: f64 = 1.0;

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
        let below = [quiet(fault).unwrap_or_default(), why(fault)];
        let below = below.iter().filter(|text| !text.is_empty());
        lines.extend(below.map(|text| format!("     {text}")));
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
        ago(fault.lasts_s()),
        first_at(fault),
        fault.count,
        fault.action,
        fault.p,
    )
}

/// Since when it is quiet, if it is.
fn quiet(fault: &NamedFault) -> Option<String> {
    let at = time_of_day(fault.last_unix_s);
    let passed_s = fault.changed_ago_s + fault.changed_unix_s - fault.last_unix_s;
    (passed_s >= QUIET_S).then(|| format!("not seen since {at}, for {}", ago(passed_s)))
}

/// The size, and what speaks for it.
pub fn why(fault: &NamedFault) -> String {
    let evidence = fault.evidence.as_ref();
    let evidence = evidence.map(|it| reason_text(&it.channel, it.nat, &it.against));
    let size = fault.size.as_ref().map(|size| size.text.clone());
    let parts = size.into_iter().chain(evidence);
    parts.collect::<Vec<String>>().join("; ")
}

/// Time of day at which it was present first.
pub fn first_at(fault: &NamedFault) -> String {
    time_of_day(fault.first_unix_s)
}

fn time_of_day(unix_s: f64) -> String {
    let time = unix_time_of_day(unix_s);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn latched() -> NamedFault {
        NamedFault {
            number: 1,
            name: "RM_STUCK".to_owned(),
            source: "robot",
            state: "latched",
            severity: "fault",
            count: 2,
            first_unix_s: 100.0,
            last_unix_s: 3_605.0,
            changed_unix_s: 3_610.0,
            first_ago_s: 3_600.0,
            changed_ago_s: 90.0,
            p: 0.998,
            size: None,
            evidence: None,
            action: "compensate".to_owned(),
            freeze_frame: None,
        }
    }

    #[test]
    fn an_acknowledgement_does_not_make_a_fault_younger() {
        for (state, count, lasts_s) in [
            ("pending", 0, 90.0),
            ("active", 1, 3_600.0),
            ("acknowledged", 1, 3_600.0),
            ("latched", 1, 90.0),
            ("cleared", 1, 90.0),
            ("active", 2, 90.0),
        ] {
            let fault = NamedFault {
                state,
                count,
                ..latched()
            };
            assert_eq!(fault.lasts_s(), lasts_s, "{state}, {count} times");
        }
    }

    #[test]
    fn of_a_fault_that_is_over_it_is_told_since_when_it_is_quiet() {
        let mut fault = latched();
        let said = quiet(&fault).unwrap();
        assert_eq!(said, "not seen since 01:00:05, for 2 min");
        fault.last_unix_s = 3_699.5;
        assert_eq!(quiet(&fault), None);
    }
}
