#![doc = include_str!("../README.md")]

mod entry;
mod event_file;
mod namer;
mod record;
mod timeline;
mod told;
mod wall_clock;
mod weighing;
mod words;

pub use entry::{NamedFault, NamedStep, TimelineEntry};
pub use event_file::{EventReader, EventWriter};
pub use timeline::Timeline;
pub use told::{PendingMisses, told};
pub use wall_clock::{WallClock, time_of_day, unix_time_of_day};
pub use weighing::{NamedSecond, NamedState, NamedWeighing};
pub use words::{
    degraded as degraded_text, reason as reason_text, service_state as service_state_text,
    watchdog as watchdog_text,
};
