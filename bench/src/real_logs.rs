//! Faults of sensors, put into logs of real robots that were not learned from.

pub mod injection;
pub mod logs;
pub mod split;
pub mod table;
pub mod tolerance;
pub mod trial;

pub use injection::{Change, Injection};
pub use split::{LOGS, Split};
pub use table::table;
pub use tolerance::tolerances;
pub use trial::{Healthy, Trial, healthy, trial};
