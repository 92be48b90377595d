//! The service processes: start, restart, stop.

use std::io;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use vigil_cycle::failure::Failure;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Clock, Domain, Monotonic, RunReport, signal};

use crate::error::LauncherError;
use crate::observer::HealthObserver;
use crate::plan::{CommandLine, Plan};
use crate::restarts::{Death, RestartHistory};

/// Time that a service may take to stop before it is killed: three cycles at the lowest rate,
/// 1 Hz, as a service ends between two cycles.
const STOP_LIMIT: Duration = Duration::from_secs(3);
/// Interval at which a stopping service is looked at: nothing waits for it but the end.
const POLL: Duration = Duration::from_millis(5);

/// One service process.
struct ServiceProcess {
    name: ServiceName,
    child: Child,
    report: PathBuf,
    /// Where it leaves the assertion that ended it.
    failure: PathBuf,
    history: RestartHistory,
    restart_at: Option<Instant>,
}

/// All service processes of a graph.
pub struct Children {
    services: Vec<ServiceProcess>,
    restarted: Vec<ServiceName>,
    gave_up: Option<String>,
}

impl Children {
    /// Starts every service of the plan; on a failure stops those already started.
    pub fn start(plan: &Plan, domain: &Domain) -> Result<Self, LauncherError> {
        let mut children = Self {
            services: Vec::new(),
            restarted: Vec::new(),
            gave_up: None,
        };
        for name in plan.services() {
            let report = domain.folder().join(format!("{}.report", name.as_str()));
            let failure = domain.failure_file(name);
            for old in [&report, &failure] {
                let _ = std::fs::remove_file(old);
            }
            // Those already started stop when `children` is dropped.
            let child = spawn(plan.command(name, &report))?;
            children.services.push(ServiceProcess {
                name,
                child,
                report,
                failure,
                history: RestartHistory::new(plan.restart_policy()),
                restart_at: None,
            });
        }
        let list = domain.processes_file();
        children
            .list(plan, domain)
            .map_err(|cause| LauncherError::file(list, cause))?;
        Ok(children)
    }

    /// Leaves the process ids where whoever finds the graph running can read them.
    fn list(&self, plan: &Plan, domain: &Domain) -> io::Result<()> {
        let line = |s: &ServiceProcess| format!("{} {}\n", s.name.as_str(), s.child.id());
        let text: String = self.services.iter().map(line).collect();
        // First: a publisher that finds the graph may ask for them.
        plan.setup.border().tell_publishers(domain)?;
        std::fs::write(domain.processes_file(), text)
    }

    /// Restarts what has died; true if a service had to be given up.
    pub fn look_after(&mut self, plan: &Plan, observer: &mut HealthObserver) -> bool {
        for service in &mut self.services {
            let now = Instant::now();
            let name = service.name.as_str();
            if let (None, Ok(Some(status))) = (service.restart_at, service.child.try_wait()) {
                let failure = service.take_failure(observer);
                let death = Death {
                    code: status.code(),
                    failure,
                    can_resume: plan.can_resume(service.name),
                };
                match service.history.judge(&death, now) {
                    Ok(delay) => {
                        tell!("vigil: {name} ended ({status}); restarting");
                        service.restart_at = Some(now + delay);
                        observer.remove_dead_peers();
                    }
                    Err(reason) => {
                        tell!("vigil: {name} ended ({status}); given up: {reason}");
                        self.gave_up = Some(format!("{name}: {status}; {reason}"));
                        return true;
                    }
                }
            }
            // A stop always wins over a restart.
            if service.restart_at.is_some_and(|at| now >= at) && !signal::stop_requested() {
                service.restart_at = None;
                service.history.restarted(now);
                let (began_ns, drive) = (Monotonic.now_ns(), observer.drive());
                match spawn(plan.command_again(service.name, &service.report, drive.as_ref())) {
                    Ok(child) => {
                        service.child = child;
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
        false
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
            let _ = service.child.kill();
        }
    }

    /// Stops every service, the last of the chain first, so that none waits for input in vain;
    /// kills those that do not stop in time.
    pub fn stop(&mut self) {
        for service in self.services.iter_mut().rev() {
            if matches!(service.child.try_wait(), Ok(None)) {
                signal::terminate(service.child.id());
            }
            let deadline = Instant::now() + STOP_LIMIT;
            while matches!(service.child.try_wait(), Ok(None)) && Instant::now() < deadline {
                std::thread::sleep(POLL);
            }
            if matches!(service.child.try_wait(), Ok(None)) {
                tell!("vigil: {} did not stop: killed", service.name.as_str());
                let _ = service.child.kill();
            }
            let _ = service.child.wait();
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

fn spawn(command: CommandLine) -> Result<Child, LauncherError> {
    // A group of its own: Ctrl-C reaches the launcher alone, which stops the services in order.
    Command::new(&command.program)
        .args(command.options)
        .process_group(0)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .map_err(|cause| LauncherError::file(command.program, cause))
}

#[cfg(test)]
mod tests;
