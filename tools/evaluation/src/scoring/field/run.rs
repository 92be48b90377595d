//! One run, verdict by verdict.

use std::collections::BTreeMap;

use serde::Serialize;

use super::claims::{Claim, Instants};
use super::{BLIND, CONFIDENT, HELD_S, JUDGED_S, RobotOrder, SIZED_S, Stretch, Truth};
use crate::scoring::{TIME_SLACK_S, Taxonomy, Verdict};

/// One onset of a fault.
#[derive(Debug, Clone, PartialEq)]
pub struct Onset {
    /// When, s.
    pub t_s: f64,
    /// Until when it is judged, s: the truth changes, or the run ends.
    pub until_s: f64,
    /// Time to its announcement, s; `None` if it was missed.
    pub delay_s: Option<f64>,
    /// Right leaf at [`JUDGED_S`]; `None` if it did not last so long.
    pub leaf: [Option<bool>; JUDGED_S.len()],
    /// Right side at the same times.
    pub side: [Option<bool>; JUDGED_S.len()],
    /// Right leaf and size at [`SIZED_S`]; `None` without a size, or if it did not last so long.
    pub size: Option<bool>,
}

/// The end of all faults.
#[derive(Debug, Clone, PartialEq)]
pub struct End {
    /// When, s.
    pub t_s: f64,
    /// Driven time until the next fault or the end of the run, s.
    pub driven_s: f64,
    /// Driven time until the alarm was down, s; `None` if it never was.
    pub alarm_s: Option<f64>,
    /// Driven time until the names were nominal, s; `None` if they never were.
    pub name_s: Option<f64>,
}

/// Driven time in which something was judged.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JudgedTime {
    /// All of it, s.
    pub driven_s: f64,
    /// With the right leaf as `mode`, s.
    pub leaf_s: f64,
    /// With the right side as `mode`, s.
    pub side_s: f64,
    /// With the right leaf as the reported name, s.
    pub reported_s: f64,
    /// With an alarm, s.
    pub alarm_s: f64,
    /// With a wrong leaf as `mode` whose probability is above 0.9, s.
    pub confident_wrong_s: f64,
}

/// How often a name changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Changes {
    /// In the whole run.
    pub all: usize,
    /// From 2 s after an onset until the fault ends.
    pub settled: usize,
}

/// Entries into actions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Actions {
    /// Into slower driving.
    pub slow: usize,
    /// Into a stop.
    pub stop: usize,
    /// Into a call for help.
    pub help: usize,
    /// Into anything else but going on.
    pub other: usize,
    /// Into a stop by rule, without a usable belief: no decision, and not among all.
    pub blind: usize,
}

impl Actions {
    /// All decisions.
    #[must_use]
    pub const fn all(&self) -> usize {
        self.slow + self.stop + self.help + self.other
    }

    const fn add(&mut self, order: RobotOrder) {
        match order {
            RobotOrder::GoOn => {}
            RobotOrder::Slow => self.slow += 1,
            RobotOrder::Stop => self.stop += 1,
            RobotOrder::Blind => self.blind += 1,
            RobotOrder::Help => self.help += 1,
            RobotOrder::Other => self.other += 1,
        }
    }
}

/// A change in what an operator was told of a fault of the robot.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ToldChange {
    /// When, s.
    pub t_s: f64,
    /// Counts the run's faults, from 1.
    pub number: u64,
    /// Its name.
    pub fault: String,
    /// The state that it came to.
    pub state: &'static str,
    /// How often it has become active.
    pub count: u32,
}

/// What one run brought.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Run {
    /// Seed or id by which it is found again.
    pub seed: u64,
    /// Length, s.
    pub duration_s: f64,
    /// Driven time, s.
    pub driven_s: f64,
    /// Driven time without a fault, s.
    pub healthy_driven_s: f64,
    /// Of it with another mode than the nominal one, s.
    pub healthy_wrong_s: f64,
    /// Of it with an alarm, s.
    pub healthy_alarm_s: f64,
    /// Onsets, in order.
    pub onsets: Vec<Onset>,
    /// Ends of faults, in order.
    pub ends: Vec<End>,
    /// Time in a wrong mode, s: at any time, standing or not.
    pub wrong_s: f64,
    /// From 2 s after an onset on.
    pub from_2_s: JudgedTime,
    /// From 10 s after an onset on.
    pub from_10_s: JudgedTime,
    /// Changes of `mode`.
    pub mode: Changes,
    /// Changes of the reported name.
    pub reported: Changes,
    /// Rises of the alarm while nothing was wrong.
    pub alarms: usize,
    /// Actions begun while nothing was wrong.
    pub actions: Actions,
    /// Actions begun during faults.
    pub actions_in_fault: Actions,
    /// A call for help stands at the end, and nothing is wrong.
    pub is_help_latched: bool,
    /// Claims, in order of time.
    pub claims: Vec<Claim>,
    /// Log score 2 s after the first onset, nats.
    pub log_score_2_s_nats: Option<f64>,
    /// Time of contradictions, s.
    pub contradiction_s: f64,
    /// Longest one, s.
    pub contradiction_longest_s: f64,
    /// Time without valid input as it is reported, s.
    pub blind_s: f64,
    /// What an operator was told of faults of the robot, in order.
    pub told: Vec<ToldChange>,
    /// How often one of them became active while no alarm stood.
    pub told_without_alarm: usize,
    /// Faults that were gone before an operator was told of them.
    pub faults_pending: usize,
}

impl Run {
    /// Faults of the robot that an operator was told of, each with how often it became active.
    fn activations_by_fault(&self) -> BTreeMap<u64, u32> {
        let told = self.told.iter();
        told.map(|change| (change.number, change.count)).collect()
    }

    /// Faults of the robot that an operator was told of.
    #[must_use]
    pub fn faults_told(&self) -> usize {
        self.activations_by_fault().len()
    }

    /// How often one of them became active.
    #[must_use]
    pub fn activations(&self) -> usize {
        self.activations_by_fault().values().sum::<u32>() as usize
    }
}

/// Scores one run while it goes on.
#[derive(Debug, Clone)]
pub struct Scorer<'a> {
    truth: &'a [Stretch],
    taxonomy: &'a Taxonomy,
    /// The stretch that holds now.
    at: usize,
    before: Option<Verdict>,
    /// Time of the last verdict, s, and how long after the one before.
    t_s: f64,
    dt_s: f64,
    instants: Instants,
    contradiction_s: f64,
    /// Driven time after the last end at which alarm and name were down, and since when in time.
    down: [Option<(f64, f64)>; 2],
    run: Run,
}

impl<'a> Scorer<'a> {
    /// Against the truth, in order of time, of a run from `span_s[0]` to `span_s[1]`; the first
    /// stretch holds from the beginning.
    #[must_use]
    pub fn new(truth: &'a [Stretch], taxonomy: &'a Taxonomy, span_s: [f64; 2], seed: u64) -> Self {
        let mut scorer = Self {
            truth,
            taxonomy,
            at: 0,
            before: None,
            t_s: span_s[0],
            dt_s: 0.0,
            instants: Instants::new(truth, span_s, seed),
            contradiction_s: 0.0,
            down: [None; 2],
            run: Run {
                seed,
                ..Run::default()
            },
        };
        scorer.begin_stretch(&Truth::Healthy);
        scorer
    }

    fn now(&self) -> &'a Truth {
        let stretch = self.truth.get(self.at);
        stretch.map_or(&Truth::Healthy, |stretch| &stretch.truth)
    }

    /// Takes the next verdict; verdicts come in order of time.
    pub fn take(&mut self, verdict: &Verdict) {
        let begins = |stretch: &Stretch| stretch.from_s <= verdict.t_s + TIME_SLACK_S;
        while self.truth.get(self.at + 1).is_some_and(begins) {
            let before = self.now();
            self.at += 1;
            self.begin_stretch(before);
        }
        self.dt_s = verdict.t_s - self.t_s;
        self.t_s = verdict.t_s;
        self.run.duration_s += self.dt_s;
        if verdict.drives {
            self.run.driven_s += self.dt_s;
        }
        let is_first = self.before.is_none();
        let before = self.before.take().unwrap_or_else(|| Verdict {
            mode: verdict.mode.clone(),
            reported: verdict.reported.clone(),
            ..Verdict::default()
        });
        self.judge_onset(verdict, &before);
        self.judge_end(verdict);
        self.judge_names(verdict);
        let now = (self.at, self.now());
        let (taxonomy, run) = (self.taxonomy, &mut self.run);
        self.instants.take(verdict, now, taxonomy, run);
        self.count(verdict, &before, is_first);
        self.before = Some(verdict.clone());
    }

    /// What the run brought.
    #[must_use]
    pub fn finish(mut self) -> Run {
        let helps = |before: &Verdict| before.order == RobotOrder::Help;
        self.run.is_help_latched =
            self.now().is_healthy() && self.before.as_ref().is_some_and(helps);
        self.run
    }

    /// The truth has changed.
    fn begin_stretch(&mut self, before: &Truth) {
        let (now, t_s) = (
            self.now(),
            self.truth.get(self.at).map_or(0.0, |s| s.from_s),
        );
        if now == before {
            return;
        }
        self.down = [None; 2];
        if now.is_healthy() {
            self.run.ends.push(End {
                t_s,
                driven_s: 0.0,
                alarm_s: None,
                name_s: None,
            });
        } else {
            self.run.onsets.push(Onset {
                t_s,
                until_s: t_s,
                delay_s: None,
                leaf: [None; JUDGED_S.len()],
                side: [None; JUDGED_S.len()],
                size: None,
            });
        }
    }

    /// True if a fault was there before the present one.
    fn follows_a_fault(&self) -> bool {
        let before = self.at.checked_sub(1).and_then(|i| self.truth.get(i));
        before.is_some_and(|stretch| !stretch.truth.is_healthy())
    }

    fn judge_onset(&mut self, verdict: &Verdict, before: &Verdict) {
        let (truth, taxonomy) = (self.now(), self.taxonomy);
        if truth.is_healthy() {
            return;
        }
        let follows = self.follows_a_fault();
        let size = self.truth.get(self.at).and_then(|stretch| stretch.size);
        let Some(onset) = self.run.onsets.last_mut() else {
            return;
        };
        onset.until_s = verdict.t_s;
        let since_s = (verdict.t_s - onset.t_s).max(0.0);
        let rises = verdict.alarm && !before.alarm;
        let changes = follows && verdict.mode != before.mode;
        if onset.delay_s.is_none() && (rises || changes) {
            onset.delay_s = Some(since_s);
        }
        // The last verdict up to each instant counts: it is overwritten until the instant is past.
        for (i, judged_s) in JUDGED_S.into_iter().enumerate() {
            let due = since_s + TIME_SLACK_S >= judged_s;
            if due && onset.leaf[i].is_none() {
                let (name, set) = (verdict.mode.as_str(), verdict.fault_set.as_str());
                onset.leaf[i] = Some(truth.is_leaf(name, set, taxonomy));
                onset.side[i] = Some(truth.is_side(name, set, taxonomy));
            }
        }
        let is_due = since_s + TIME_SLACK_S >= SIZED_S && onset.size.is_none();
        if let Some(size) = size.filter(|_| is_due) {
            let is_leaf = truth.is_leaf(&verdict.mode, &verdict.fault_set, taxonomy);
            onset.size = Some(is_leaf && size.is(&verdict.size));
        }
    }

    fn judge_end(&mut self, verdict: &Verdict) {
        if !self.now().is_healthy() {
            return;
        }
        let nominal = self.taxonomy.name(0).unwrap_or_default();
        let Some(end) = self.run.ends.last_mut() else {
            return;
        };
        let named = verdict.mode != nominal || verdict.reported != nominal;
        let slots = [&mut end.alarm_s, &mut end.name_s];
        for ((is_up, slot), down) in [verdict.alarm, named]
            .into_iter()
            .zip(slots)
            .zip(&mut self.down)
        {
            if is_up {
                *down = None;
                continue;
            }
            let (driven_s, since_s) = *down.get_or_insert((end.driven_s, verdict.t_s));
            if slot.is_none() && verdict.t_s - since_s + TIME_SLACK_S >= HELD_S {
                *slot = Some(driven_s);
            }
        }
        end.driven_s += if verdict.drives { self.dt_s } else { 0.0 };
    }

    fn judge_names(&mut self, verdict: &Verdict) {
        let (truth, taxonomy, dt_s) = (self.now(), self.taxonomy, self.dt_s);
        let run = &mut self.run;
        if verdict.mode == BLIND {
            run.blind_s += dt_s;
        }
        let (name, set) = (verdict.mode.as_str(), verdict.fault_set.as_str());
        let is_leaf = truth.is_leaf(name, set, taxonomy);
        let is_wrong = !is_leaf && name != BLIND;
        run.wrong_s += if is_wrong { dt_s } else { 0.0 };
        if !verdict.drives {
            return;
        }
        if truth.is_healthy() {
            run.healthy_driven_s += dt_s;
            run.healthy_wrong_s += if is_wrong { dt_s } else { 0.0 };
            run.healthy_alarm_s += if verdict.alarm { dt_s } else { 0.0 };
            return;
        }
        let onset_s = run.onsets.last().map_or(f64::INFINITY, |onset| onset.t_s);
        let since_s = verdict.t_s - onset_s + TIME_SLACK_S;
        let confident = verdict.p_mode > CONFIDENT && truth.is_wrong_leaf(name, set, taxonomy);
        for (seen, from_s) in [
            (&mut run.from_2_s, JUDGED_S[0]),
            (&mut run.from_10_s, JUDGED_S[2]),
        ] {
            if since_s < from_s {
                continue;
            }
            let of = |is: bool| if is { dt_s } else { 0.0 };
            seen.driven_s += dt_s;
            seen.leaf_s += of(is_leaf);
            seen.side_s += of(truth.is_side(name, set, taxonomy));
            seen.reported_s += of(truth.is_leaf(&verdict.reported, set, taxonomy));
            seen.alarm_s += of(verdict.alarm);
            seen.confident_wrong_s += of(confident);
        }
    }

    fn count(&mut self, verdict: &Verdict, before: &Verdict, is_first: bool) {
        let truth = self.now();
        let nominal = self.taxonomy.name(0).unwrap_or_default();
        let run = &mut self.run;
        let onset_s = run.onsets.last().map_or(f64::INFINITY, |onset| onset.t_s);
        let is_settled = !truth.is_healthy() && verdict.t_s - onset_s + TIME_SLACK_S >= JUDGED_S[0];
        for (changes, is) in [
            (&mut run.mode, verdict.mode != before.mode),
            (&mut run.reported, verdict.reported != before.reported),
        ] {
            changes.all += usize::from(is);
            changes.settled += usize::from(is && is_settled);
        }
        let rises = verdict.alarm && !before.alarm;
        run.alarms += usize::from(rises && truth.is_healthy());
        let enters = verdict.action != before.action || verdict.order != before.order;
        if enters || is_first {
            match truth.is_healthy() {
                true => run.actions.add(verdict.order),
                false => run.actions_in_fault.add(verdict.order),
            }
        }
        let names = verdict.reported != nominal && verdict.reported != BLIND;
        let contradicts = (verdict.alarm && verdict.belief().node(0, self.taxonomy) > 0.5)
            || (names && !verdict.alarm);
        self.contradiction_s = match contradicts {
            true => self.contradiction_s + self.dt_s,
            false => 0.0,
        };
        run.contradiction_s += if contradicts { self.dt_s } else { 0.0 };
        run.contradiction_longest_s = run.contradiction_longest_s.max(self.contradiction_s);
    }
}
