//! One fault through its life.

use vigil_blocks::{EVIDENCE, FAULT_NODES, FaultRecord, FaultSource, FaultState, MODE_UNKNOWN};
use vigil_checkpoint::CheckpointValue;

use super::LifeInput;
use super::present::Present;
use super::rules::FaultRules;

/// A fault, and how long it has been there or gone.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub(super) struct Tracked {
    pub record: FaultRecord,
    /// Time that it was present in while pending, ns.
    present_ns: u64,
    /// Time since it was present, ns.
    absent_ns: u64,
    /// State that was told, and of which fault.
    told: (u32, (u32, u32)),
}

impl Tracked {
    pub(super) fn new(it: Present, number: u64, rules: &FaultRules) -> Self {
        let (source, what) = (it.source as u32, it.what);
        let rule = rules.of_fault(source, what);
        Self {
            record: FaultRecord {
                number,
                source,
                what,
                severity: rule.severity as u32,
                latches: u32::from(rule.latches),
                ..FaultRecord::default()
            },
            ..Self::default()
        }
    }

    /// A fault as another has left it.
    pub(super) fn restored(record: &FaultRecord) -> Self {
        // What was written by another version, or half, is no fault.
        let is_known = record.state().is_some() && FaultSource::from_repr(record.source).is_some();
        match is_known && record.number != 0 {
            true => {
                let mut restored = Self {
                    record: *record,
                    ..Self::default()
                };
                restored.mark_told();
                restored
            }
            false => Self::default(),
        }
    }

    pub(super) const fn is_kept(&self) -> bool {
        self.record.number != 0
    }

    pub(super) const fn is_of_robot(&self) -> bool {
        self.record.source == FaultSource::Robot as u32
    }

    /// True while it is present, or was until a moment ago.
    pub(super) fn is_open(&self) -> bool {
        use FaultState::{Acknowledged, Active, Pending};
        let state = self.record.state();
        self.is_kept() && matches!(state, Some(Pending | Active | Acknowledged))
    }

    /// True while the robot has it, for long enough to be told.
    pub(super) fn is_active(&self) -> bool {
        use FaultState::{Acknowledged, Active};
        let state = self.record.state();
        self.is_of_robot() && self.is_kept() && matches!(state, Some(Active | Acknowledged))
    }

    /// See [`Present::key`].
    pub(super) fn key(&self) -> (u32, u32) {
        let source = FaultSource::from_repr(self.record.source);
        source.map_or((0, 0), |source| {
            let what = self.record.what;
            Present { source, what }.key()
        })
    }

    /// From now on it has a name that says more.
    pub(super) fn rename(&mut self, what: u32, rules: &FaultRules) {
        let rule = rules.of_fault(self.record.source, what);
        self.record.what = what;
        (self.record.severity, self.record.latches) =
            (rule.severity as u32, u32::from(rule.latches));
        // The onset of what has a name is known better, and so is the reason.
        (self.record.frame_t_capture_ns, self.record.evidence) = (0, 0.0);
    }

    /// It is one with what was there, and over, before.
    pub(super) fn goes_on(&mut self, earlier: &Self) {
        self.record.first_ns = earlier.record.first_ns;
        self.record.count = self.record.count.saturating_add(earlier.record.count);
    }

    /// Takes what is known of it.
    pub(super) fn describe(&mut self, it: Present, input: LifeInput<'_>) {
        let record = &mut self.record;
        (record.what, record.action) = (it.what, input.decided.action);
        if record.first_ns == 0 {
            record.first_ns = input.now_ns;
        }
        record.last_ns = input.now_ns;
        let Some(diagnosis) = input.observed.filter(|_| it.source == FaultSource::Robot) else {
            record.p = 1.0;
            return;
        };
        let node = (it.what as usize).min(FAULT_NODES);
        record.p = match it.what {
            MODE_UNKNOWN => diagnosis.p_unknown,
            _ => diagnosis.p.get(node).copied().unwrap_or_default(),
        };
        // Bad numbers are not for people.
        record.p = Some(record.p).filter(|p| p.is_finite()).unwrap_or(0.0);
        let of = |values: &[f64]| values.get(node).copied().unwrap_or_default();
        (record.size, record.size_sd) = (of(&diagnosis.size), of(&diagnosis.size_sd));
        record.size_kind = diagnosis.size_kind.get(node).copied().unwrap_or_default();
        // What speaks for a set is mostly about the fault that came to it last: who has a reason
        // of its own keeps that.
        let is_alone = diagnosis.mode == it.what;
        let is_new = record.evidence <= 0.0 || record.state == FaultState::Pending as u32;
        if !(is_alone || is_new) {
            return;
        }
        let evidence = diagnosis.channel_evidence.iter().enumerate();
        let strongest = evidence.max_by(|a, b| a.1.total_cmp(b.1));
        let (channel, nat) = strongest.map_or((EVIDENCE, 0.0), |(i, nat)| (i, *nat));
        (record.evidence_channel, record.evidence) = (channel as u32, nat);
        record.runner_up = diagnosis.runner_up;
    }

    /// Lets time pass; true if its state is another.
    pub(super) fn advance(
        &mut self,
        is_present: bool,
        passed_ns: u64,
        now_ns: u64,
        rules: &FaultRules,
    ) -> bool {
        use FaultState::{Acknowledged, Active, Cleared, Latched, Pending};
        if !self.is_kept() {
            return false;
        }
        let rule = rules.of_fault(self.record.source, self.record.what);
        match is_present {
            true => {
                self.present_ns = self.present_ns.saturating_add(passed_ns);
                self.absent_ns = 0;
            }
            false => self.absent_ns = self.absent_ns.saturating_add(passed_ns),
        }
        let is_over = !is_present && self.absent_ns >= rule.clear_ns;
        let is_due = is_present && self.present_ns >= rule.debounce_ns;
        let before = self.record.state();
        let next = match before {
            None | Some(Cleared) if is_present => Some(Pending),
            None => None,
            Some(Pending) if is_due => Some(Active),
            // What was never told leaves nothing, unless it was told before.
            Some(Pending) if is_over && self.record.count == 0 => {
                *self = Self::default();
                return true;
            }
            Some(Pending) if is_over => Some(Cleared),
            Some(Active) if is_over && rule.latches => Some(Latched),
            Some(Active | Acknowledged) if is_over => Some(Cleared),
            Some(Latched) if is_due => Some(Active),
            same => same,
        };
        if !is_present && !self.is_open() {
            self.present_ns = 0;
        }
        match next.filter(|next| before != Some(*next)) {
            Some(state) => {
                self.enter(state, now_ns);
                true
            }
            None => false,
        }
    }

    fn enter(&mut self, state: FaultState, now_ns: u64) {
        let record = &mut self.record;
        (record.state, record.changed_ns) = (state as u32, now_ns);
        if state == FaultState::Active {
            record.count = record.count.saturating_add(1);
        }
        if matches!(state, FaultState::Pending | FaultState::Active) {
            // It begins anew, or its onset is known better by now.
            record.frame_t_capture_ns = 0;
        }
        self.present_ns = 0;
    }

    /// Somebody knows; false if there is nothing to know.
    pub(super) fn acknowledge(&mut self, now_ns: u64) -> bool {
        let state = match self.record.state() {
            Some(FaultState::Active) => FaultState::Acknowledged,
            Some(FaultState::Latched) => FaultState::Cleared,
            _ => return false,
        };
        self.enter(state, now_ns);
        true
    }

    /// Leaves its place if it is over.
    pub(super) fn forget(&mut self) -> bool {
        let is_over = self.record.state() == Some(FaultState::Cleared);
        if is_over {
            *self = Self::default();
        }
        is_over
    }

    /// True if its state or name is another than was told; what is pending is not told.
    pub(super) fn is_untold(&self) -> bool {
        let is_pending = self.record.state() == Some(FaultState::Pending);
        self.is_kept() && !is_pending && self.told != (self.record.state, self.key())
    }

    /// Its state and name are told from now on.
    pub(super) fn mark_told(&mut self) {
        self.told = (self.record.state, self.key());
    }
}
