//! The life of faults: from what is believed in each cycle to what an operator is told.
//!
//! A belief comes and goes with the evidence. What is told has a life: a fault is pending until it
//! was present for `debounce_s`, then active; it is over once it was absent for `clear_s`. One that
//! latches stays until somebody acknowledges it. A fault that is first unknown and then has a name
//! is one fault.

mod freeze_frames;
mod present;
mod rules;
mod settings;
mod tracked;

use vigil_blocks::{
    Action, FAULTS, FaultBelief, FaultRecord, FaultSet, FaultSource, FaultState, Faults,
    MODE_UNKNOWN, OverallState, RecoveryKind, SensorFrame, Severity,
};
use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_robot::FaultTree;

use freeze_frames::FreezeFrames;
use present::{Present, PresentFaults};
pub use rules::FaultRuleError;
use rules::FaultRules;
pub use settings::{FaultLifeSettings, FaultRule, RuleSeverity};
use tracked::Tracked;

/// A name that gives way to none holds for so long, ns: with a second opinion that soon passes
/// there are not two faults. Chosen by hand.
const UNNAMED_NS: u64 = 10_000_000_000;
/// Longest time between two steps that counts, ns: what nobody has looked at is neither present nor
/// over. Two periods at 10 Hz.
const STEP_MAX_NS: u64 = 200_000_000;

/// What was decided in a cycle.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, CheckpointValue)]
pub struct CycleDecision {
    /// See [`Action::action`].
    pub action: u32,
    /// See [`Action::kind`].
    pub kind: u32,
    /// See [`Action::blind`].
    pub blind: u32,
}

impl From<&Action> for CycleDecision {
    fn from(block: &Action) -> Self {
        Self {
            action: block.action,
            kind: block.kind,
            blind: block.blind,
        }
    }
}

/// What the supervisor knows in a cycle.
#[derive(Debug, Clone, Copy)]
pub struct LifeInput<'a> {
    /// `CLOCK_MONOTONIC`, ns.
    pub now_ns: u64,
    /// The diagnosis of a frame of this cycle, if an alarm could have risen. Without one, what is
    /// known of the robot is held.
    pub observed: Option<&'a FaultBelief>,
    /// What was decided.
    pub decided: CycleDecision,
    /// Services that have been silent for too long, as bits in the order of the data.
    pub silent_services: u32,
}

/// What an operator asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LifeOrder {
    /// Somebody knows of the fault of this number; 0: of all.
    Acknowledge(u64),
    /// Forget what is over.
    Clear,
}

/// Keeps the faults of a graph. Allocates nothing after it was made; never panics on any input.
#[derive(Checkpoint)]
pub struct FaultLife {
    #[checkpoint(fixed)]
    rules: FaultRules,
    frames: FreezeFrames,
    present: PresentFaults,
    tracked: [Tracked; FAULTS],
    fault_count: u64,
    /// What is present and has no place.
    dropped_count: u32,
    revision: u64,
    /// Something has changed in this step.
    is_changed: bool,
    overall: OverallState,
    /// For how long what is present has had no name, although something has one, ns.
    unnamed_ns: u64,
    last_ns: Option<u64>,
}

impl FaultLife {
    /// A graph's, with nothing in it.
    ///
    /// # Errors
    /// [`FaultRuleError`] for a rule about what does not exist.
    pub fn new(settings: &FaultLifeSettings, tree: &FaultTree) -> Result<Self, FaultRuleError> {
        Ok(Self {
            rules: FaultRules::new(settings, tree)?,
            frames: FreezeFrames::new(),
            present: PresentFaults::new(tree),
            tracked: [Tracked::default(); FAULTS],
            fault_count: 0,
            dropped_count: 0,
            revision: 1,
            is_changed: false,
            overall: OverallState::Stale,
            unnamed_ns: 0,
            last_ns: None,
        })
    }

    /// Goes on from what another has written last.
    pub fn restore(&mut self, block: &Faults) {
        for (tracked, record) in self.tracked.iter_mut().zip(&block.records) {
            *tracked = Tracked::restored(record);
        }
        self.fault_count = block.fault_count;
        self.revision = block.revision;
    }

    /// What is active, as a diagnosis of all of it together; `None` if nothing of the robot is.
    /// Allocates.
    #[must_use]
    pub fn diagnosis(&self, tree_hash: u64) -> Option<Box<FaultBelief>> {
        let active = self.tracked.iter().filter(|it| it.is_active());
        let active: Vec<(u32, f64)> = active.map(|it| (it.record.what, it.record.p)).collect();
        let p = active.iter().map(|(_, p)| *p).reduce(f64::min)?;
        let leaves = active
            .iter()
            .filter(|(what, _)| self.present.is_leaf(*what));
        let leaves = leaves.fold(0, |set, (what, _)| set | 1_u64 << what);
        let mut told = Box::new(FaultBelief {
            tree_hash,
            identifying: 1,
            ..FaultBelief::default()
        });
        told.p[0] = 1.0 - p;
        if leaves == 0 {
            told.p_unknown = p;
        } else {
            (told.sets[0], told.set_count) = (FaultSet { leaves, p }, 1);
            let of_set = |(node, _): &(usize, &mut f64)| leaves >> node & 1 == 1;
            let nodes = told.p.iter_mut().enumerate().filter(of_set);
            nodes.for_each(|(_, it)| *it = p);
        }
        Some(told)
    }

    /// Keeps a frame, for the freeze frame of a fault that begins about then.
    pub fn see(&mut self, frame: &SensorFrame) {
        self.frames.push(frame);
    }

    /// Takes what is known in a cycle.
    // Never merged into its caller, so that its instructions can be counted.
    #[inline(never)]
    pub fn step(&mut self, input: LifeInput<'_>) {
        let now_ns = input.now_ns;
        let last_ns = self.last_ns.replace(now_ns).unwrap_or(now_ns);
        let passed_ns = now_ns.saturating_sub(last_ns).min(STEP_MAX_NS);
        self.present.take(input);
        self.hold_names(input.observed.map_or(0, |_| passed_ns));
        let present = self.present.clone();
        let dropped = std::mem::take(&mut self.dropped_count);
        for it in present.list() {
            self.note(it, input);
        }
        self.is_changed |= dropped != self.dropped_count;
        for tracked in &mut self.tracked {
            let key = tracked.key();
            let is_present = present.list().any(|it| it.key() == key);
            // Of the robot nothing is over, and nothing lasts, while nothing is seen of it.
            let counts = !tracked.is_of_robot() || input.observed.is_some();
            let passed_ns = if counts { passed_ns } else { 0 };
            self.is_changed |= tracked.advance(is_present, passed_ns, now_ns, &self.rules);
        }
        let overall = self.overall_of(input.decided);
        self.is_changed |= overall != self.overall;
        self.overall = overall;
        let is_changed = std::mem::take(&mut self.is_changed);
        self.revision = self.revision.wrapping_add(u64::from(is_changed));
    }

    /// Carries out an order; false if there is nothing that it could be about.
    pub fn obey(&mut self, order: LifeOrder, now_ns: u64) -> bool {
        let mut is_done = false;
        for tracked in &mut self.tracked {
            is_done |= match order {
                LifeOrder::Acknowledge(number) => {
                    let is_meant = number == 0 || tracked.record.number == number;
                    is_meant && tracked.acknowledge(now_ns)
                }
                LifeOrder::Clear => tracked.forget(),
            };
        }
        self.revision = self.revision.wrapping_add(u64::from(is_done));
        is_done
    }

    /// A fault whose state is another than it was told last, once.
    pub fn take_change(&mut self) -> Option<&FaultRecord> {
        let changed = self.tracked.iter_mut().find(|it| it.is_untold())?;
        changed.mark_told();
        Some(&changed.record)
    }

    /// The faults that are kept; a free place has number 0.
    pub fn records(&self) -> impl Iterator<Item = &FaultRecord> {
        self.tracked.iter().map(|tracked| &tracked.record)
    }

    /// Another after each change.
    #[must_use]
    pub const fn revision(&self) -> u64 {
        self.revision
    }

    /// Writes everything but the header.
    pub fn write(&self, block: &mut Faults, tree_hash: u64) {
        block.tree_hash = tree_hash;
        block.revision = self.revision;
        block.fault_count = self.fault_count;
        block.dropped_count = self.dropped_count;
        block.overall = self.overall as u32;
        for (written, record) in block.records.iter_mut().zip(self.records()) {
            *written = *record;
        }
    }

    /// While what is present has no name, the names that were told hold for a while.
    fn hold_names(&mut self, passed_ns: u64) {
        let Some(coarse) = self.present.coarse() else {
            self.unnamed_ns = 0;
            return;
        };
        let covered = self.present.covered_by(coarse);
        let named = |it: &&Tracked| it.is_open() && it.is_of_robot();
        let names = self.tracked.iter().filter(named).map(|it| it.record.what);
        let leaves = names.filter(|what| *what != MODE_UNKNOWN);
        let held = leaves.fold(0, |set, node| set | 1_u64.checked_shl(node).unwrap_or(0));
        let held = held & covered;
        if held == 0 {
            self.unnamed_ns = 0;
            return;
        }
        self.unnamed_ns = self.unnamed_ns.saturating_add(passed_ns);
        if self.unnamed_ns < UNNAMED_NS {
            self.present.replace(coarse, held);
        }
    }

    /// Brings what is present to the fault that it is.
    fn note(&mut self, it: Present, input: LifeInput<'_>) {
        let Some(at) = self.find(it) else {
            self.dropped_count = self.dropped_count.saturating_add(1);
            return;
        };
        let tracked = &mut self.tracked[at];
        let is_of_robot = it.source == FaultSource::Robot;
        if is_of_robot && input.observed.is_none() {
            return;
        }
        tracked.describe(it, input);
        let begins = tracked.record.frame_t_capture_ns == 0 && is_of_robot;
        if begins && let Some(diagnosis) = input.observed {
            let known = [diagnosis.onset_t_capture_ns, diagnosis.alarm_t_capture_ns];
            let onset_ns = known.into_iter().find(|at_ns| *at_ns != 0);
            self.frames.freeze(onset_ns, &mut tracked.record);
        }
    }

    /// The place of what is present: that of the same fault, or of one that had no name until now,
    /// or a new one; `None` if no place is free.
    fn find(&mut self, it: Present) -> Option<usize> {
        let same = |tracked: &Tracked| tracked.is_kept() && tracked.key() == it.key();
        let same = self.tracked.iter().position(same);
        if let Some(at) = same.filter(|at| self.tracked[*at].is_open()) {
            return Some(at);
        }
        let unnamed = match it.source {
            FaultSource::Robot => self.unnamed(it.what),
            _ => None,
        };
        if let Some(at) = unnamed {
            let earlier = same.map(|at| std::mem::take(&mut self.tracked[at]));
            self.tracked[at].rename(it.what, &self.rules);
            if let Some(earlier) = earlier {
                self.tracked[at].goes_on(&earlier);
            }
            self.is_changed = true;
            return Some(at);
        }
        let at = same.or_else(|| self.free_place());
        if let (None, Some(at)) = (same, at) {
            self.fault_count = self.fault_count.saturating_add(1);
            self.tracked[at] = Tracked::new(it, self.fault_count, &self.rules);
        }
        at
    }

    /// A fault that had a coarser name, which is gone, until this one.
    fn unnamed(&self, name: u32) -> Option<usize> {
        let fits = |tracked: &Tracked| {
            let record = &tracked.record;
            tracked.is_open()
                && tracked.is_of_robot()
                && self.present.is_coarser(record.what, name)
                && !self.present.list().any(|it| it.key() == tracked.key())
        };
        self.tracked.iter().position(fits)
    }

    /// A free place, or that of the fault that was over first.
    fn free_place(&self) -> Option<usize> {
        let free = self.tracked.iter().position(|it| !it.is_kept());
        free.or_else(|| {
            let over = self.tracked.iter().enumerate();
            let over = over.filter(|(_, it)| it.record.state() == Some(FaultState::Cleared));
            over.min_by_key(|(_, it)| it.record.changed_ns)
                .map(|it| it.0)
        })
    }

    fn overall_of(&self, decided: CycleDecision) -> OverallState {
        use FaultState::{Acknowledged, Active, Latched};
        let with = |severity: Severity, states: &[FaultState]| {
            self.tracked.iter().any(|it| {
                let state = it.record.state();
                it.record.severity == severity as u32
                    && state.is_some_and(|state| states.contains(&state))
            })
        };
        let stands = matches!(
            RecoveryKind::from_repr(decided.kind),
            Some(RecoveryKind::Stop | RecoveryKind::CallForHelp | RecoveryKind::GiveUp)
        );
        let is_present = with(Severity::Fault, &[Active, Acknowledged]);
        if decided.blind != 0 || decided.kind == RecoveryKind::None as u32 {
            OverallState::Stale
        } else if is_present && stands {
            OverallState::SafeStop
        } else if is_present || with(Severity::Fault, &[Latched]) {
            OverallState::Fault
        } else if with(Severity::Warning, &[Active, Acknowledged, Latched]) {
            OverallState::Degraded
        } else {
            OverallState::Ok
        }
    }
}

#[cfg(test)]
mod tests;
