//! The real-time cycle: absolute clock, placement, deadline monitoring, histograms, ports.
//!
//! Knows no robot and no filter. A service implements [`Stage`] (it is woken by input) or
//! [`Source`] (it is woken by its schedule); [`StageCycle`] and [`SourceCycle`] do one turn at a
//! time and know no thread, so that the same code runs on the robot (over shared memory, under the
//! monotonic clock) and in tests (in process, under a virtual clock).
//!
//! One turn: wake, count deadlines that have passed, take input, check it, step, publish, account.

pub mod allocation;
pub mod clock;
mod cycle_account;
pub mod datagrams;
mod deadline;
pub mod domain;
pub mod failure;
pub mod health;
pub mod input;
pub mod keep_awake;
pub mod latency;
mod live;
pub mod on_miss;
pub mod placement;
pub mod port;
pub mod recorder;
pub mod report;
mod sealed;
pub mod serve;
pub mod service;
pub mod shed;
pub mod signal;
pub mod source;
pub mod stage;
pub mod stamps;
pub mod topic;
pub mod wake;
pub mod watchdog;

pub use clock::{Clock, Monotonic, VirtualClock};
pub use cycle_account::CycleAccount;
pub use deadline::{DeadlineMonitor, Schedule};
pub use domain::Domain;
pub use health::HealthBoard;
pub use input::{InputAccount, Writer};
pub use keep_awake::KeepAwake;
pub use latency::Latency;
pub use on_miss::OnMiss;
pub use placement::Placement;
pub use port::{Graph, PortError, Receiver, Sender, Stamp};
pub use recorder::{Recorder, Timing};
pub use report::RunReport;
pub use sealed::SealedText;
pub use shed::Shedder;
pub use source::{Source, SourceCycle, SourceOutcome};
pub use stage::{Intake, Stage, StageCycle};
pub use stamps::{CycleStamps, Stamps};
pub use topic::Topic;
pub use watchdog::Watchdog;
