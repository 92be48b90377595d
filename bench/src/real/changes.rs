//! What became of each change of ground: the border, the wheels, the alarm, and what there was to
//! be seen.

use super::robotino::{Change, INTERVALS_H, JUMP_SD, Robotino, WITHIN_S};
use super::seen::Seen;

/// The monitor's warm-up, s.
const READY_S: f64 = 1.5;

impl Change {
    /// The last crossing of the border up to a time, s.
    fn crossing_before(&self, t_s: f64) -> Option<f64> {
        let mut all = self.crossings_t_s.iter().copied();
        all.rfind(|&crossing| crossing <= t_s)
    }

    /// Alarm less a time; none without an alarm.
    fn late_s(&self, than_s: f64) -> Option<f64> {
        self.alarm_t_s.map(|t_s| t_s - than_s)
    }

    fn scored(&self) -> bool {
        self.z.abs() > JUMP_SD
    }
}

fn median(all: impl Iterator<Item = f64>) -> Option<f64> {
    let mut all: Vec<f64> = all.collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied()
}

fn cell(value: Option<f64>, digits: usize) -> String {
    value.map_or(String::new(), |value| format!("{value:.digits$}"))
}

/// A row for each run over two grounds.
#[must_use]
pub fn csv(robotino: &Robotino) -> String {
    let mut out = "file,scored,speed_m_s,change_t_s,z,alarm_t_s,crossings_t_s,own_change_t_s,\
                   own_log_ratio,step_noncentrality,first_second_noncentrality,\
                   first_second_difference\n"
        .to_owned();
    for change in &robotino.changes {
        let crossings = change.crossings_t_s.iter().map(|t_s| format!("{t_s:.2}"));
        let seen = change.seen.as_ref();
        let cells = [
            change.file.clone(),
            change.scored().to_string(),
            format!("{:.1}", change.speed_m_s),
            format!("{:.2}", change.change_t_s),
            format!("{:.1}", change.z),
            cell(change.alarm_t_s, 2),
            crossings.collect::<Vec<_>>().join(" "),
            cell(seen.map(|s| s.own_change_t_s), 2),
            cell(seen.map(|s| s.own_log_ratio), 1),
            cell(seen.and_then(|s| s.of_step), 1),
            cell(seen.and_then(|s| s.first_second), 1),
            cell(seen.map(|s| s.difference), 1),
        ];
        out.push_str(&cells.join(","));
        out.push('\n');
    }
    out
}

/// The summary.
#[must_use]
pub fn lines(robotino: &Robotino) -> Vec<String> {
    let mut out = vec![
        "\n### Which wheel crosses when\n".to_owned(),
        "| folder | border at y, m | slope | squares of residuals about the mean | and with a step \
         per wheel that crosses | steps |"
            .to_owned(),
        "|---|---|---|---|---|---|".to_owned(),
    ];
    for (folder, border) in &robotino.borders {
        out.push(format!(
            "| {folder} | {:.3} | {:.2} | {:.0} | {:.0} | {} |",
            border.line.y_m,
            border.line.slope,
            border.squares_without,
            border.squares_with,
            border.steps
        ));
    }
    out.extend(crossings(&robotino.changes));
    out.extend(intervals(robotino));
    out.extend(own(&robotino.changes));
    out.extend(clairvoyant(robotino));
    out
}

/// Alarms against the wheels' crossings.
fn crossings(changes: &[Change]) -> Vec<String> {
    let none = || changes.iter().filter(|c| c.crossings_t_s.is_empty());
    let alarms = changes.iter().filter_map(|c| Some((c, c.alarm_t_s?)));
    let too_early = alarms.filter(|(c, t_s)| c.crossing_before(*t_s).is_none());
    let early = |c: &&Change| c.scored() && c.late_s(c.change_t_s).is_some_and(|l| l < -WITHIN_S);
    let since = |c: &Change| Some(c.alarm_t_s? - c.crossing_before(c.alarm_t_s?)?);
    let after = changes.iter().filter(early).map(|c| cell(since(c), 1));
    let scored = || changes.iter().filter(|c| c.scored());
    let long_before = scored().filter(|c| {
        let first = c.crossings_t_s.iter().find(|&&t_s| t_s > READY_S);
        first.is_some_and(|&t_s| c.change_t_s - t_s > 2.0 * WITHIN_S)
    });
    let by = scored().filter(|c| {
        let by = c
            .late_s(c.change_t_s)
            .is_some_and(|late_s| late_s <= WITHIN_S);
        by && since(c).is_some()
    });
    vec![
        format!(
            "\nruns in which no wheel crosses: {}, {} of them alarm; alarms before any wheel has \
             crossed, in all runs: {}",
            none().count(),
            none().filter(|c| c.alarm_t_s.is_some()).count(),
            too_early.count()
        ),
        format!(
            "of the scored runs, alarm after a wheel has crossed and by {WITHIN_S} s after the \
             change: {}; those more than {WITHIN_S} s before it come so long after the last \
             crossing, s: [{}]",
            by.count(),
            after.collect::<Vec<_>>().join(", ")
        ),
        format!(
            "scored runs whose first wheel crosses more than {:.0} s before the change, so that an \
             alarm within {WITHIN_S} s of that wheel comes too early for the {WITHIN_S} s on \
             either side: {}; alarm less the last \
             crossing before it, median: {} s",
            2.0 * WITHIN_S,
            long_before.count(),
            cell(median(scored().filter_map(since)), 2)
        ),
    ]
}

/// What other times between false alarms give.
fn intervals(robotino: &Robotino) -> Vec<String> {
    let mut out = vec![
        "\n| between false alarms, h | one ground, held out: alarm | learned from: alarm | within \
         1 s | earlier | later | never | in all by 1 s after it | not scored: alarm |"
            .to_owned(),
        "|---|---|---|---|---|---|---|---|---|".to_owned(),
    ];
    for (i, (interval_h, single)) in INTERVALS_H.iter().zip(robotino.at_intervals).enumerate() {
        let changes = || robotino.changes.iter();
        let late = changes().filter(|c| c.scored());
        let late: Vec<Option<f64>> = late
            .map(|c| c.alarms_t_s[i].map(|t_s| t_s - c.change_t_s))
            .collect();
        let count = |is_in: fn(f64) -> bool| late.iter().flatten().filter(|l| is_in(**l)).count();
        let others = changes().filter(|c| !c.scored() && c.alarms_t_s[i].is_some());
        out.push(format!(
            "| {interval_h} | {} | {} | {} | {} | {} | {} | {} | {} |",
            single.0,
            single.1,
            count(|l| l.abs() <= WITHIN_S),
            count(|l| l < -WITHIN_S),
            count(|l| l > WITHIN_S),
            late.iter().filter(|l| l.is_none()).count(),
            count(|l| l <= WITHIN_S),
            others.count()
        ));
    }
    out
}

/// Alarms against the step that the residuals themselves show.
fn own(changes: &[Change]) -> Vec<String> {
    let scored = || {
        let scored = changes.iter().filter(|c| c.scored());
        scored.filter_map(|c| Some((c, c.seen?)))
    };
    let apart = || scored().map(|(c, seen)| (seen.own_change_t_s - c.change_t_s).abs());
    let late = || scored().filter_map(|(c, seen)| c.late_s(seen.own_change_t_s));
    let missed = || {
        scored().filter(|(c, _)| {
            c.late_s(c.change_t_s)
                .is_none_or(|late| late.abs() > WITHIN_S)
        })
    };
    let found = missed().filter(|(c, seen)| {
        let late = c.late_s(seen.own_change_t_s);
        late.is_some_and(|late| late.abs() <= WITHIN_S)
    });
    vec![format!(
        "\nthe step that the residuals show by themselves lies {} s (median) \
         from the given change, within {WITHIN_S} s of it in {}; alarms within \
         {WITHIN_S} s of it: {}, by {WITHIN_S} s after it: {}; \
         of the {} that are not within {WITHIN_S} s of the given one: {}",
        cell(median(apart()), 2),
        apart().filter(|apart| *apart <= WITHIN_S).count(),
        late().filter(|late| late.abs() <= WITHIN_S).count(),
        late().filter(|late| *late <= WITHIN_S).count(),
        missed().count(),
        found.count()
    )]
}

/// A class of alarms by how late they are, s.
type Lateness = fn(f64) -> bool;

/// What could be seen within the first second.
fn clairvoyant(robotino: &Robotino) -> Vec<String> {
    let mut out = vec![
        format!(
            "\n### What there is to be seen in the first second after the change\n\n\
             One in 20 runs on one ground shows a difference of means of {:.0} somewhere; an alarm \
             by all channels together within a second needs {:.0}.\n",
            robotino.usual_difference, robotino.needed
        ),
        "| runs scored | n | step, median | first second, median | difference, median | below \
         what one in 20 shows |"
            .to_owned(),
        "|---|---|---|---|---|---|".to_owned(),
    ];
    let late = |c: &Change| c.late_s(c.change_t_s);
    let groups: [(&str, Lateness); 3] = [
        ("noticed by 1 s after it, not earlier", |l| {
            l.abs() <= WITHIN_S
        }),
        ("earlier", |l| l < -WITHIN_S),
        ("later or never", |l| l > WITHIN_S),
    ];
    for (name, is_in) in groups {
        let inside = robotino.changes.iter().filter(|c| c.scored());
        let inside = inside.filter(|c| is_in(late(c).unwrap_or(f64::INFINITY)));
        let seen: Vec<_> = inside.filter_map(|c| c.seen).collect();
        let middle = |of: fn(&Seen) -> Option<f64>| cell(median(seen.iter().filter_map(of)), 0);
        let below = |than: f64| seen.iter().filter(|s| s.difference < than).count();
        out.push(format!(
            "| {name} | {} | {} | {} | {} | {} |",
            seen.len(),
            middle(|s| s.of_step),
            middle(|s| s.first_second),
            middle(|s| Some(s.difference)),
            below(robotino.usual_difference)
        ));
    }
    out.push(
        "\n| not within 1 s | change | own step | wheels cross | alarm | step | first second \
         | difference |\n|---|---|---|---|---|---|---|---|"
            .to_owned(),
    );
    for change in robotino.changes.iter().filter(|c| c.scored()) {
        let Some(seen) = change.seen else { continue };
        if late(change).is_some_and(|late| late.abs() <= WITHIN_S) {
            continue;
        }
        let crossings = change.crossings_t_s.iter().map(|t_s| format!("{t_s:.2}"));
        out.push(format!(
            "| {} | {:.2} | {:.2} | {} | {} | {} | {} | {:.0} |",
            change.file.trim_start_matches("two_surface_types/"),
            change.change_t_s,
            seen.own_change_t_s,
            crossings.collect::<Vec<_>>().join(", "),
            cell(change.alarm_t_s, 2),
            cell(seen.of_step, 0),
            cell(seen.first_second, 0),
            seen.difference
        ));
    }
    out
}
