//! What each service says about itself.

use strum::{FromRepr, IntoStaticStr};

use crate::block::block;
use crate::header::Header;
use crate::layout::part;
use crate::rejection::REJECTIONS;

/// Capacity of the ring of recent events in a [`Health`] block.
pub const EVENTS: usize = 32;

part! {
/// Something worth telling a person. `what` is an index whose meaning depends on `kind`.
pub struct Event, size 32 {
    /// When, `CLOCK_MONOTONIC` ns.
    pub t_ns: u64,
    /// An [`EventKind`].
    pub kind: u32,
    /// See [`EventKind`].
    pub what: u32,
    /// Probability, where the event has one; else as [`EventKind`] says, or 0.
    pub p: f64,
    /// See [`EventKind`].
    pub value: u64,
}
}

/// Kind of an [`Event`], and the meaning of its `what` and `value`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr, IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
#[repr(u32)]
pub enum EventKind {
    /// The drive begins: every stage answers. `value`: the sensor's sequence number.
    Ready = 1,
    /// A fault or disturbance was injected. `what`: wheel or side (255 for none) + 256 x kind
    /// code; `p` and the bits of `value`: parameters of a disturbance, else 0.
    Injected = 2,
    /// Faults or disturbances were removed. `what`: wheel or side (255 for all) + 256 x kind code
    /// (0 for all).
    Restored = 3,
    /// An alarm rose: the detector's own, or the supervisor's, fused of both stages.
    Alarm = 4,
    /// It fell, or the identifier is back at nominal.
    Cleared = 5,
    /// A diagnosis. `what`: node of the fault tree, or one of the `MODE_*`; `value`: leaves of
    /// the most probable fault set as bits.
    Diagnosis = 6,
    /// A decision. `what`: action of the decision model; `value`: its wheels, as
    /// [`crate::AnsweredWheels::to_event`] says.
    Action = 7,
    /// Deadlines missed. `value`: how many in a row.
    Miss = 8,
    /// An input is lost. `what`: 0 sensor, 1 detection, 2 diagnosis, 3 action.
    InputLost = 9,
    /// The input is back. `what`: as above.
    InputBack = 10,
    /// The robot stops itself: no valid action. `what`: a [`crate::ActionRejection`].
    SafeStop = 11,
    /// The robot obeys actions again.
    SafeStopEnds = 12,
    /// A control command was refused. `what`: a reason of the service.
    Refused = 13,
    /// A new run began. `value`: its id.
    Run = 14,
    /// Recorded frames are at their end. `value`: scheduled instant of the last frame, ns.
    EndOfRecording = 15,
    /// The robot begins to obey another decision. `what` and `value` as for `Action`.
    Obeys = 16,
    /// Why the last diagnosis and not the next best. `what`: the channel that speaks most for it;
    /// `p`: its evidence, nat; `value`: the next best mode.
    Reason = 17,
    /// The set of symptoms changed. `what`: bits of [`crate::Symptoms`].
    Symptoms = 18,
    /// A recovery action ended. `what`: its [`crate::RecoveryKind`]; `value`: an
    /// [`crate::ActionOutcome`].
    Outcome = 19,
    /// The robot is at the goal of its path.
    Goal = 20,
    /// The degraded mode changed, other than by an input. `what`: bits of [`Degraded`].
    Degraded = 21,
    /// The time allows another number of hypotheses or particles. `what`: that number; `value`: the
    /// configured.
    Particles = 22,
    /// The launcher's watchdog finds a service failed. `what`: 1 start-up, 2 alive, 3 deadline, 4
    /// logical.
    Watchdog = 23,
    /// Blocks from outside were refused. `what`: the [`crate::Rejection`]; `value`: how many since
    /// it was told last.
    Rejected = 24,
    /// The detector sees nothing any more. `what`: a [`crate::Blindness`], told anew when it is
    /// another.
    Blind = 25,
    /// It sees again. `value`: how long it was blind, ns.
    BlindEnds = 26,
    /// From now on an alarm can rise.
    Armed = 27,
    /// The robot stands by command, for a second at least: the belief is held.
    NotExcited = 28,
    /// It moves again.
    Excited = 29,
    /// An action stands whatever is believed, until a new run or a reset. `what`: the action.
    Latched = 30,
    /// It stands no longer. `what`: the action.
    Released = 31,
    /// What frames say cannot be as the robot's description has it. `what`: a finding of the
    /// tests of a publisher + 256 x the index of a wheel; `p`: how far off.
    Publisher = 32,
    /// In which way the diagnosed component is broken, once that is clear. `what`: node of the
    /// fault tree + 256 x [`crate::SizeKind`]; `p`: the size; bits of `value`: its standard
    /// deviation.
    Size = 33,
    /// An assertion of the service has failed and ended it. Only the launcher records it: no block
    /// carries its text.
    Assertion = 34,
    /// What is no fault has changed, as the ground does. `what`: the description's context, from 0;
    /// `value`: capture time of the change, ns.
    ContextChanged = 35,
    /// What the last decision was weighed from: see [`crate::Weighing`].
    Weighed = 36,
    /// A step of the decision model, with symptoms. `what`: its action; `p`: its number, from 1;
    /// `value`: its observation, `u32::MAX` for a set of symptoms that the model does not have,
    /// + 2^32 x how many beliefs had begun anew before.
    Step = 37,
    /// A service was started again. Only the launcher records it.
    Restarted = 38,
    /// The state of a fault changed. `what`: its [`crate::FaultRecord::what`] + 65536 x its
    /// [`crate::FaultSource`]; `p`: its probability; `value`: its [`crate::FaultState`] + 256 x its
    /// number.
    Fault = 39,
}

impl EventKind {
    /// Name, as in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.into()
    }
}

block! {
    /// Written by each service, at about 20 Hz and at once when something happens.
    pub struct Health, size 1416 {
        /// Common header.
        pub header: Header,
        /// Cycles done: blocks published, or frames for the source.
        pub cycles: u64,
        /// Scheduled cycles whose deadline passed before the block was out.
        pub missed: u64,
        /// Cycles whose time from wake-up to publication exceeded the budget.
        pub over_budget: u64,
        /// Schedule instants that the source slept through.
        pub slips: u64,
        /// Input blocks that never arrived, by gaps of their sequence numbers.
        pub lost: u64,
        /// Input blocks that arrived after their deadline.
        pub late: u64,
        /// Input blocks that arrived twice.
        pub duplicate: u64,
        /// Input blocks refused: wrong schema, impossible time stamps, non-finite data.
        pub invalid: u64,
        /// The refused ones by cause, see [`crate::Rejection`].
        pub rejected: [u64; REJECTIONS],
        /// Longest time from wake-up to publication, ns.
        pub worst_cycle_ns: u64,
        /// Sequence number of that cycle.
        pub worst_cycle_seq: u64,
        /// Last time from wake-up to publication, ns.
        pub last_cycle_ns: u64,
        /// Period of the schedule, ns.
        pub period_ns: u64,
        /// Deadline after the schedule, ns.
        pub deadline_ns: u64,
        /// Budget of one cycle, from wake-up to publication, ns.
        pub budget_ns: u64,
        /// Schedule instant of the service's first and last accounted cycle, ns.
        pub accounted_ns: [u64; 2],
        /// A [`ServiceState`].
        pub state: u32,
        /// Core that was asked for.
        pub core_wanted: u32,
        /// Core that the kernel reported in the last check.
        pub core: u32,
        /// 1 if the kernel lets the service run on no other core than `core_wanted`.
        pub pinned: u32,
        /// Scheduling policy read back (`SCHED_FIFO` is 1, `SCHED_OTHER` 0).
        pub policy: u32,
        /// Priority read back.
        pub priority: u32,
        /// 1 if all memory is locked.
        pub memory_locked: u32,
        /// Process id.
        pub pid: u32,
        /// Why the service is in degraded mode, bits of [`Degraded`]; 0 if it is not.
        pub degraded: u32,
        /// Result of the last control command: 1 done, 2 refused, 0 none yet.
        pub control_result: u32,
        /// Sequence number of the last control command handled.
        pub control_seq: u64,
        /// Epoch of the writer of that command.
        pub control_epoch: u64,
        /// Writer and sequence number of the newest sensor frame that an output has answered.
        pub answered_epoch: u64,
        /// See `answered_epoch`.
        pub answered_seq: u64,
        /// Hypotheses or particles that the time allows at present; 0 without any to shed.
        pub particles: u32,
        /// Hypotheses or particles configured.
        pub particles_configured: u32,
        /// Events so far; event number n is at `events[n % EVENTS]`.
        pub event_count: u64,
        /// Recent events.
        pub events: [Event; EVENTS],
    }
}

/// Why a service is in degraded mode, as bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Degraded;

impl Degraded {
    /// An input is lost: what is published is prediction.
    pub const INPUT_LOST: u32 = 1;
    /// Its own deadlines are missed, and `on_miss = "degrade"`.
    pub const LATE: u32 = 2;
    /// It works with fewer hypotheses or particles than configured.
    pub const FEWER_PARTICLES: u32 = 4;
    /// Its source sends what cannot be trusted: all that it sends is refused until that ends.
    pub const QUARANTINE: u32 = 8;
}

/// Life of a service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum ServiceState {
    /// Opening ports, warming up.
    Starting = 1,
    /// Ports are open; no input yet.
    Ready = 2,
    /// Cycling.
    Running = 3,
    /// Told to stop, and stopping.
    Stopping = 4,
}
