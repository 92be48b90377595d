#![doc = include_str!("../README.md")]

/// Writes a line to standard error; that nobody reads it is no reason to end a graph.
macro_rules! tell {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}

mod args;
mod children;
mod companion;
mod error;
mod locks;
mod observer;
mod plan;
mod process;
mod restarts;
mod run;
mod start_options;
mod summary;
mod teller;
mod waiting;
mod watchdog;

pub use args::LauncherArgs;
pub use companion::rescue;
pub use run::launch;
pub use summary::Summary;
