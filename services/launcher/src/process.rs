//! A process of a service: one that was started here, or one that was found running.

use std::fmt;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use vigil_cycle::{FoundProcess, signal};

use crate::error::LauncherError;
use crate::plan::CommandLine;

/// Interval at which a found process is looked at: the kernel tells nobody but its parent.
const LOOK: Duration = Duration::from_millis(50);
/// Interval at which a stopping process is looked at: nothing waits for it but the end.
const POLL: Duration = Duration::from_millis(5);

/// A process of a service.
pub enum Process {
    /// Started by this launcher.
    Started(Child),
    /// Started by a launcher that is gone, and when it was looked at last.
    Found(FoundProcess, Instant),
}

/// How a process has ended; of a found one nobody knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ending(Option<ExitStatus>);

impl Ending {
    /// Its exit code, if it is known and there was one.
    pub fn code(self) -> Option<i32> {
        self.0?.code()
    }
}

impl fmt::Display for Ending {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(status) => write!(f, "{status}"),
            None => write!(f, "nobody knows how"),
        }
    }
}

impl Process {
    /// Starts a program.
    pub fn start(command: CommandLine) -> Result<Self, LauncherError> {
        // A group of its own: Ctrl-C reaches the launcher alone, which stops the services in order.
        Command::new(&command.program)
            .args(command.options)
            .process_group(0)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .map(Self::Started)
            .map_err(|cause| LauncherError::file(command.program, cause))
    }

    /// Takes one that was found.
    pub fn found(process: FoundProcess) -> Self {
        Self::Found(process, Instant::now())
    }

    /// Its number.
    pub fn id(&self) -> u32 {
        match self {
            Self::Started(child) => child.id(),
            Self::Found(process, _) => process.id(),
        }
    }

    /// How it ended; `None` while it lives.
    pub fn ended(&mut self) -> Option<Ending> {
        match self {
            Self::Started(child) => child.try_wait().ok()?.map(|status| Ending(Some(status))),
            Self::Found(process, looked) => {
                if looked.elapsed() < LOOK {
                    return None;
                }
                *looked = Instant::now();
                (!process.lives()).then_some(Ending(None))
            }
        }
    }

    /// Asks it to stop.
    pub fn terminate(&self) {
        match self {
            Self::Started(child) => signal::terminate(child.id()),
            Self::Found(process, _) => process.terminate(),
        }
    }

    /// Ends it. It may be stopped or hang: a signal that it had to handle would not reach it.
    pub fn kill(&mut self) {
        match self {
            Self::Started(child) => {
                let _ = child.kill();
            }
            Self::Found(process, _) => process.kill(),
        }
    }

    /// Waits for its end, for `limit` at most; false if it lives on.
    pub fn wait(&mut self, limit: Duration) -> bool {
        let deadline = Instant::now() + limit;
        while self.ended().is_none() {
            if Instant::now() >= deadline {
                return false;
            }
            std::thread::sleep(POLL);
        }
        true
    }
}
