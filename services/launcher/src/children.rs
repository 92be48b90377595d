//! The service processes: start, restart, stop.

use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use vigil_cycle::failure::Failure;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Clock, Domain, FoundProcess, Monotonic, RunReport, signal};

use crate::companion::{Companion, CompanionNews};
use crate::error::LauncherError;
use crate::locks::Locks;
use crate::observer::HealthObserver;
use crate::plan::Plan;
use crate::process::Process;
use crate::restarts::{Death, RestartHistory};

/// Time that a service may take to stop before it is killed: three cycles at the lowest rate,
/// 1 Hz, as a service ends between two cycles.
const STOP_LIMIT: Duration = Duration::from_secs(3);
/// Time that a killed one may take to be gone.
const KILL_LIMIT: Duration = Duration::from_secs(1);

/// True of the command line of this service or black box, but for one that only rescues or records
/// for somebody.
fn is_service(words: &[String], name: &str) -> bool {
    let program = words.first().and_then(|word| Path::new(word).file_name());
    let is_it = program.is_some_and(|program| program == format!("vigil-{name}").as_str());
    let has_other_work = |word: &String| ["--rescue", "--record"].contains(&word.as_str());
    is_it && !words.iter().any(has_other_work)
}

/// One service process.
struct ServiceProcess {
    name: ServiceName,
    process: Process,
    report: PathBuf,
    /// Where it leaves the assertion that ended it.
    failure: PathBuf,
    history: RestartHistory,
    restart_at: Option<Instant>,
}

/// All service processes of a graph.
pub struct Children {
    services: Vec<ServiceProcess>,
    blackbox: Option<Companion>,
    domain: Domain,
    locks: Locks,
    restarted: Vec<ServiceName>,
    gave_up: Option<String>,
}

impl Children {
    /// Starts every service of the plan; on a failure stops those already started.
    pub fn start(plan: &Plan, domain: &Domain, locks: Locks) -> Result<Self, LauncherError> {
        let mut children = Self::none(domain, locks);
        for name in plan.services() {
            let (report, failure) = (report_file(domain, name), domain.failure_file(name));
            for old in [&report, &failure] {
                let _ = std::fs::remove_file(old);
            }
            // Those already started stop when `children` is dropped.
            let process = Process::start(plan.command(name, &report))?;
            children.add(plan, name, process);
        }
        let list = domain.processes_file();
        children
            .announce(plan)
            .map_err(|cause| LauncherError::file(list, cause))?;
        // It finds a graph that is announced.
        children.blackbox = Some(Companion::start(plan, domain, None));
        let _ = children.list();
        Ok(children)
    }

    /// Takes over the services of a launcher that is gone; those that are gone, too, are restarted.
    pub fn adopt(
        plan: &Plan,
        domain: &Domain,
        observer: &mut HealthObserver,
        locks: Locks,
    ) -> Result<Self, LauncherError> {
        let (mut children, listed) = (Self::none(domain, locks), domain.processes());
        // Whoever was killed may have started one that it had no time to list.
        let members = domain.members();
        let unlisted = |name: &str| {
            let is_it = |process: &&FoundProcess| is_service(&process.words(), name);
            members.iter().find(is_it).cloned()
        };
        for name in plan.services() {
            let found = listed.services.iter().find(|(of, _)| *of == name);
            let found = found.and_then(|(_, pid)| domain.find_process(*pid));
            let process = match found.or_else(|| unlisted(name.as_str())) {
                Some(process) => Process::found(process),
                None => {
                    let (began_ns, drive) = (Monotonic.now_ns(), observer.drive());
                    let report = report_file(domain, name);
                    observer.timeline.add_restart(name, began_ns);
                    Process::start(plan.command_again(name, &report, drive.as_ref()))?
                }
            };
            children.add(plan, name, process);
        }
        let found = listed.blackbox.and_then(|pid| domain.find_process(pid));
        let found = match plan.setup.file.blackbox.enabled {
            true => found.or_else(|| unlisted("blackbox")),
            false => found,
        };
        children.blackbox = Some(Companion::start(plan, domain, found));
        let list = domain.launcher_file();
        let listed = children.list();
        listed.map_err(|cause| LauncherError::file(list, cause))?;
        Ok(children)
    }

    fn none(domain: &Domain, locks: Locks) -> Self {
        Self {
            services: Vec::new(),
            blackbox: None,
            domain: domain.clone(),
            locks,
            restarted: Vec::new(),
            gave_up: None,
        }
    }

    fn add(&mut self, plan: &Plan, name: ServiceName, process: Process) {
        self.services.push(ServiceProcess {
            name,
            process,
            report: report_file(&self.domain, name),
            failure: self.domain.failure_file(name),
            history: RestartHistory::new(plan.restart_policy()),
            restart_at: None,
        });
    }

    /// Leaves what the graph runs on, and its processes, where whoever finds it running reads them.
    fn announce(&mut self, plan: &Plan) -> io::Result<()> {
        self.list()?;
        let domain = &self.domain;
        std::fs::write(domain.document_file(), plan.document_text()?)?;
        plan.options.leave(&domain.options_file())?;
        // First: a publisher that finds the graph may ask for them.
        plan.setup.border().tell_publishers(domain)?;
        let line = |s: &ServiceProcess| format!("{} {}\n", s.name.as_str(), s.process.id());
        let text: String = self.services.iter().map(line).collect();
        std::fs::write(domain.processes_file(), text)
    }

    /// Lists the present processes.
    fn list(&mut self) -> io::Result<()> {
        let present = self.services.iter().map(|s| (s.name, s.process.id()));
        let present: Vec<_> = present.collect();
        let blackbox = self.blackbox.as_ref().and_then(Companion::id);
        self.locks.launcher.list(&present, blackbox)
    }

    /// Restarts what has died; true if a service had to be given up.
    pub fn look_after(&mut self, plan: &Plan, observer: &mut HealthObserver) -> bool {
        let mut is_listed = true;
        // The last process that held it for another launcher may have ended.
        self.locks.graph.take_over();
        for service in &mut self.services {
            let now = Instant::now();
            let name = service.name.as_str();
            if let (None, Some(ending)) = (service.restart_at, service.process.ended()) {
                let failure = service.take_failure(observer);
                let death = Death {
                    code: ending.code(),
                    failure,
                    can_resume: plan.can_resume(service.name),
                };
                match service.history.judge(&death, now) {
                    Ok(delay) => {
                        tell!("vigil: {name} ended ({ending}); restarting");
                        service.restart_at = Some(now + delay);
                        observer.remove_dead_peers();
                    }
                    Err(reason) => {
                        tell!("vigil: {name} ended ({ending}); given up: {reason}");
                        self.gave_up = Some(format!("{name}: {ending}; {reason}"));
                        return true;
                    }
                }
            }
            // A stop always wins over a restart.
            if service.restart_at.is_some_and(|at| now >= at) && !signal::stop_requested() {
                service.restart_at = None;
                service.history.restarted(now);
                let (began_ns, drive) = (Monotonic.now_ns(), observer.drive());
                let command = plan.command_again(service.name, &service.report, drive.as_ref());
                match Process::start(command) {
                    Ok(process) => {
                        service.process = process;
                        is_listed = false;
                        observer.timeline.add_restart(service.name, began_ns);
                        self.restarted.push(service.name);
                    }
                    Err(error) => {
                        tell!("vigil: {name} cannot be started: {error}");
                        self.gave_up = Some(format!("{name}: {error}"));
                        return true;
                    }
                }
            }
        }
        if let Some(blackbox) = &mut self.blackbox {
            is_listed &= !blackbox.look_after(plan, &self.domain);
        }
        if !is_listed {
            // What cannot be listed runs all the same.
            let _ = self.list();
        }
        false
    }

    /// What has become of the black box since the last call.
    pub fn take_blackbox_news(&mut self) -> Option<CompanionNews> {
        self.blackbox.as_mut().and_then(Companion::take_news)
    }

    /// The services that have been restarted since the last call.
    pub fn take_restarted(&mut self) -> Vec<ServiceName> {
        std::mem::take(&mut self.restarted)
    }

    /// The services that have died and are to be restarted.
    pub fn dead(&self) -> impl Iterator<Item = ServiceName> {
        let dead = self.services.iter().filter(|s| s.restart_at.is_some());
        dead.map(|s| s.name)
    }

    /// Kills a service that lives and does not do its work; it is then restarted like one that has
    /// died. It may be stopped or hang: a signal that it would have to handle would not reach it.
    pub fn end(&mut self, name: ServiceName, why: &str) {
        let found = self.services.iter_mut().find(|s| s.name == name);
        if let Some(service) = found.filter(|s| s.restart_at.is_none()) {
            tell!("vigil: {} {why}: killed", name.as_str());
            service.process.kill();
        }
    }

    /// Stops every service, the last of the chain first, so that none waits for input in vain;
    /// kills those that do not stop in time.
    pub fn stop(&mut self) {
        for service in self.services.iter_mut().rev() {
            if service.process.ended().is_none() {
                service.process.terminate();
            }
            if !service.process.wait(STOP_LIMIT) {
                tell!("vigil: {} did not stop: killed", service.name.as_str());
                service.process.kill();
                service.process.wait(KILL_LIMIT);
            }
        }
    }

    /// Lets the black box finish what it writes, and ends it: after the services, whose end it
    /// records.
    pub fn stop_blackbox(&mut self) {
        if let Some(mut blackbox) = self.blackbox.take() {
            blackbox.stop();
        }
    }

    /// Puts the assertions into the timeline that have failed while the services stopped.
    pub fn take_failures(&self, observer: &mut HealthObserver) {
        for service in &self.services {
            service.take_failure(observer);
        }
    }

    /// The run report that a service has left.
    pub fn report(&self, name: ServiceName) -> Option<RunReport> {
        let service = self.services.iter().find(|s| s.name == name)?;
        RunReport::read(&service.report)
            .inspect_err(|error| tell!("vigil: no report of {}: {error}", name.as_str()))
            .ok()
    }

    /// Restarts of a service.
    pub fn restarts(&self, name: ServiceName) -> usize {
        let service = self.services.iter().find(|s| s.name == name);
        service.map_or(0, |s| s.history.count())
    }

    /// The service that was given up, how it last ended, and why it is not started again.
    pub fn gave_up(&self) -> Option<&str> {
        self.gave_up.as_deref()
    }
}

impl ServiceProcess {
    /// The assertion that has ended it, if one has; it is then in the timeline.
    fn take_failure(&self, observer: &mut HealthObserver) -> Option<Failure> {
        let failure = Failure::take(&self.failure)?;
        observer.timeline.add_failure(self.name, &failure);
        Some(failure)
    }
}

impl Drop for Children {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Where a service leaves its report.
fn report_file(domain: &Domain, name: ServiceName) -> PathBuf {
    domain.folder().join(format!("{}.report", name.as_str()))
}

#[cfg(test)]
mod tests;
