//! What came of all faults, counted.

use std::collections::BTreeMap;

use super::trial::{Healthy, Trial};

/// Counts of a group of trials.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    all: usize,
    alarms: usize,
    shown: usize,
    detected: usize,
    named: usize,
    kinds: usize,
    sizes: usize,
    sized: usize,
    wrong: usize,
}

impl Counts {
    fn new<'a>(trials: impl Iterator<Item = &'a Trial>) -> Self {
        trials.fold(Self::default(), |sum, it| {
            let detected = it.is_detected();
            let counted = |is: bool| usize::from(detected && is);
            Self {
                all: sum.all + 1,
                alarms: sum.alarms + usize::from(it.alarm_s.is_some()),
                shown: sum.shown + usize::from(it.shown_s.is_some()),
                detected: sum.detected + counted(true),
                named: sum.named + counted(it.named),
                kinds: sum.kinds + counted(it.kind),
                sizes: sum.sizes + counted(it.kind && it.size == Some(true)),
                sized: sum.sized + counted(it.kind && it.size.is_some()),
                wrong: sum.wrong + usize::from(it.wrong),
            }
        })
    }

    fn row(&self, name: &str) -> String {
        let share = |part: usize, whole: usize| match whole {
            0 => "-".to_owned(),
            _ => format!("{:.0} %", 100.0 * part as f64 / whole as f64),
        };
        format!(
            "| {name} | {} | {} | {} | {} | {} | {} | {} | {} |",
            self.all,
            share(self.alarms, self.all),
            self.shown,
            share(self.detected, self.shown),
            share(self.named, self.shown),
            share(self.kinds, self.shown),
            share(self.sizes, self.sized),
            share(self.wrong, self.all),
        )
    }
}

/// The table of one robot: by kind of fault, by channel, and in all.
#[must_use]
pub fn table(robot: &str, healthy: &Healthy, trials: &[Trial]) -> Vec<String> {
    let mut lines = vec![
        format!(
            "{robot}: {} alarms in {:.3} h without a fault.\n",
            healthy.alarms, healthy.hours
        ),
        "| fault | all | alarm | shown | in 5 s | named | kind | size | wrong |".to_owned(),
        "|---|---|---|---|---|---|---|---|---|".to_owned(),
    ];
    for key in [
        |it: &Trial| it.fault.clone(),
        |it: &Trial| it.channel.clone(),
    ] {
        let mut groups: BTreeMap<String, Vec<&Trial>> = BTreeMap::new();
        for trial in trials {
            groups.entry(key(trial)).or_default().push(trial);
        }
        let rows = groups.iter().map(|(name, of)| {
            let counts = Counts::new(of.iter().copied());
            counts.row(name)
        });
        lines.extend(rows);
    }
    lines.push(Counts::new(trials.iter()).row("all"));
    lines.push(String::new());
    lines
}
