//! The black box: an observer beside the services. The graph drives on without it.

use std::path::Path;
use std::time::{Duration, Instant};

use vigil_cycle::{Domain, FoundProcess};

use crate::plan::{CommandLine, Plan};
use crate::process::Process;
use crate::restarts::{Death, RestartHistory};

/// Time that it may take to finish a recording when the graph ends: the memory's content, written
/// to a slow disk.
const STOP_LIMIT: Duration = Duration::from_secs(20);
/// Time that a killed one may take to be gone.
const KILL_LIMIT: Duration = Duration::from_secs(1);

/// The black box of a graph, started and restarted like a service; when it is given up, that is
/// said, and the graph goes on.
pub struct Companion {
    process: Option<Process>,
    history: RestartHistory,
    restart_at: Option<Instant>,
    /// What is still to be told of it.
    news: Option<CompanionNews>,
}

/// What has become of the black box.
pub enum CompanionNews {
    /// Another process has taken its place.
    Restarted,
    /// It is gone for good.
    GaveUp(String),
}

impl Companion {
    /// Starts it, or takes over the one that was `found`; none if the configuration wants none.
    pub fn start(plan: &Plan, domain: &Domain, found: Option<FoundProcess>) -> Self {
        let mut companion = Self {
            process: found.map(Process::found),
            history: RestartHistory::new(plan.restart_policy()),
            restart_at: None,
            news: None,
        };
        if companion.process.is_none() && plan.setup.file.blackbox.enabled {
            companion.spawn(plan, domain);
        }
        companion
    }

    /// Its process, while there is one.
    pub fn id(&self) -> Option<u32> {
        self.process.as_ref().map(Process::id)
    }

    /// Restarts it if it has died; true if its process is another one now.
    pub fn look_after(&mut self, plan: &Plan, domain: &Domain) -> bool {
        let now = Instant::now();
        if let Some(ending) = self.process.as_mut().and_then(Process::ended) {
            self.process = None;
            let death = Death {
                code: ending.code(),
                failure: None,
                can_resume: true,
            };
            match self.history.judge(&death, now) {
                Ok(delay) => {
                    tell!("vigil: the black box ended ({ending}); restarting");
                    self.restart_at = Some(now + delay);
                }
                Err(reason) => {
                    tell!(
                        "vigil: the black box ended ({ending}); given up: {reason}; nothing is \
                         recorded any more"
                    );
                    let what = format!("{ending}; {reason}; nothing is recorded any more");
                    self.news = Some(CompanionNews::GaveUp(what));
                }
            }
        }
        let is_due = self.restart_at.is_some_and(|at| now >= at);
        if is_due {
            self.restart_at = None;
            self.history.restarted(now);
            self.spawn(plan, domain);
            if self.process.is_some() {
                self.news = Some(CompanionNews::Restarted);
            }
        }
        is_due
    }

    /// What has become of it since the last call.
    pub const fn take_news(&mut self) -> Option<CompanionNews> {
        self.news.take()
    }

    fn spawn(&mut self, plan: &Plan, domain: &Domain) {
        let command = CommandLine {
            program: plan.programs.join("vigil-blackbox"),
            options: vec!["--graph".to_owned(), domain.graph().to_owned()],
        };
        match Process::start(command) {
            Ok(process) => self.process = Some(process),
            Err(error) => {
                let what = format!("nothing is recorded: {error}");
                tell!("vigil: {what}");
                self.news = Some(CompanionNews::GaveUp(what));
            }
        }
    }

    /// Lets it finish what it writes, and ends it.
    pub fn stop(&mut self) {
        let Some(process) = &mut self.process else {
            return;
        };
        if process.ended().is_none() {
            process.terminate();
        }
        if !process.wait(STOP_LIMIT) {
            tell!("vigil: the black box did not stop: killed");
            process.kill();
            process.wait(KILL_LIMIT);
        }
    }
}

/// Has what was kept by black boxes that were killed written, before the files are gone that say
/// what happened then. `programs` is the folder of the binaries; no black box may live.
pub fn rescue(programs: &Path, domain: &Domain) {
    if !domain.has_memory() {
        return;
    }
    let command = CommandLine {
        options: vec![
            "--rescue".to_owned(),
            "--graph".to_owned(),
            domain.graph().to_owned(),
        ],
        program: programs.join("vigil-blackbox"),
    };
    // Without one, or if it fails, it stays; the graph starts all the same.
    match Process::start(command) {
        Ok(mut process) => {
            if !process.wait(STOP_LIMIT) {
                tell!("vigil: what a killed black box kept was not written in time; it stays");
                process.kill();
                process.wait(KILL_LIMIT);
            }
        }
        Err(error) => tell!("vigil: what a killed black box kept is not written: {error}"),
    }
}

/// Asks the black box to record that a service was given up.
pub fn record_crash(domain: &Domain, gave_up: &str) {
    // What cannot be asked for is not recorded; the summary says what happened.
    let text = format!("{}{gave_up}", Domain::CRASH_REQUEST);
    let _ = std::fs::write(domain.request_file(), text);
}

impl Drop for Companion {
    fn drop(&mut self) {
        self.stop();
    }
}
