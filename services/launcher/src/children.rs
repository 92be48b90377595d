//! The service processes: start, restart within a bound, stop.

use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use vigil_cycle::serve::EXIT_MISSED;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Domain, RunReport, signal};

use crate::observer::Observer;
use crate::plan::Plan;

/// Time that a service may take to stop before it is killed.
const STOP_LIMIT: Duration = Duration::from_secs(3);
const POLL: Duration = Duration::from_millis(5);

/// One service process.
struct ServiceProcess {
    name: ServiceName,
    child: Child,
    report: PathBuf,
    /// Those within the window.
    restarts: Vec<Instant>,
    restart_count: usize,
    restart_at: Option<Instant>,
    last_exit: String,
}

/// All service processes of a graph.
pub struct Children {
    services: Vec<ServiceProcess>,
    restarted: Vec<ServiceName>,
    gave_up: Option<ServiceName>,
}

impl Children {
    /// Starts every service of the plan; on a failure stops those already started.
    pub fn start(plan: &Plan, domain: &Domain) -> io::Result<Self> {
        let mut children = Self {
            services: Vec::new(),
            restarted: Vec::new(),
            gave_up: None,
        };
        for name in plan.services() {
            let report = domain.folder().join(format!("{}.report", name.as_str()));
            let _ = std::fs::remove_file(&report);
            match spawn(plan.command(name), &report, plan.recording(name)) {
                Ok(child) => children.services.push(ServiceProcess {
                    name,
                    child,
                    report,
                    restarts: Vec::new(),
                    restart_count: 0,
                    restart_at: None,
                    last_exit: String::new(),
                }),
                // Those already started stop when `children` is dropped.
                Err(error) => return Err(error),
            }
        }
        children.list(domain)?;
        Ok(children)
    }

    /// Leaves the process ids where whoever finds the graph running can read them.
    fn list(&self, domain: &Domain) -> io::Result<()> {
        let line = |s: &ServiceProcess| format!("{} {}\n", s.name.as_str(), s.child.id());
        let text: String = self.services.iter().map(line).collect();
        // First: a publisher that finds the graph may ask for its types.
        domain.tell_types()?;
        std::fs::write(domain.processes_file(), text)
    }

    /// Restarts what has died; true if a service had to be given up.
    pub fn look_after(&mut self, plan: &Plan, observer: &Observer) -> bool {
        let policy = &plan.setup.file.restart;
        let window = Duration::from_secs_f64(policy.window_s);
        for service in &mut self.services {
            let now = Instant::now();
            if let (None, Ok(Some(status))) = (service.restart_at, service.child.try_wait()) {
                service.last_exit = status.to_string();
                service
                    .restarts
                    .retain(|at| now.duration_since(*at) < window);
                let count = service.restarts.len() as u32;
                let name = service.name.as_str();
                // What was refused at a restart is refused at the next.
                let is_refused = [Some(2), Some(i32::from(EXIT_MISSED))].contains(&status.code());
                let is_final = is_refused || plan.cannot_resume(service.name);
                if count >= policy.max_restarts || is_final {
                    tell!("vigil: {name} ended ({status}); given up after {count} restarts");
                    self.gave_up = Some(service.name);
                    return true;
                }
                tell!("vigil: {name} ended ({status}); restarting");
                let delay_ms = policy.delay_ms * f64::from(2_u32.saturating_pow(count));
                service.restart_at = Some(now + Duration::from_secs_f64(delay_ms * 1e-3));
                observer.remove_dead_peers();
            }
            // A stop always wins over a restart.
            if service.restart_at.is_some_and(|at| now >= at) && !signal::stop_requested() {
                service.restart_at = None;
                service.restarts.push(now);
                service.restart_count += 1;
                let command = plan.command_again(service.name, observer.drive().as_ref());
                match spawn(command, &service.report, plan.recording(service.name)) {
                    Ok(child) => {
                        service.child = child;
                        self.restarted.push(service.name);
                    }
                    Err(error) => {
                        tell!(
                            "vigil: {} cannot be started: {error}",
                            service.name.as_str()
                        );
                        self.gave_up = Some(service.name);
                        return true;
                    }
                }
            }
        }
        false
    }

    /// The services that have been restarted since this was last asked.
    pub fn take_restarted(&mut self) -> Vec<ServiceName> {
        std::mem::take(&mut self.restarted)
    }

    /// The services that have died and are to be restarted.
    pub fn dead(&self) -> impl Iterator<Item = ServiceName> {
        let dead = self.services.iter().filter(|s| s.restart_at.is_some());
        dead.map(|s| s.name)
    }

    /// Ends a service that lives and does not do its work; it is then restarted like one that has
    /// died. Not by a signal that it would have to handle: it may be stopped, or hang.
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

    /// The run reports that the services have left.
    pub fn reports(&self) -> Vec<(ServiceName, Option<RunReport>)> {
        let read = |service: &ServiceProcess| match RunReport::read(&service.report) {
            Ok(report) => Some(report),
            Err(error) => {
                tell!("vigil: no report of {}: {error}", service.name.as_str());
                None
            }
        };
        self.services
            .iter()
            .map(|service| (service.name, read(service)))
            .collect()
    }

    /// Restarts of a service.
    pub fn restarts(&self, name: ServiceName) -> usize {
        self.services
            .iter()
            .find(|s| s.name == name)
            .map_or(0, |s| s.restart_count)
    }

    /// The service that was given up, and how it last ended.
    pub fn gave_up(&self) -> Option<(ServiceName, &str)> {
        let name = self.gave_up?;
        let service = self.services.iter().find(|s| s.name == name)?;
        Some((name, service.last_exit.as_str()))
    }
}

impl Drop for Children {
    fn drop(&mut self) {
        self.stop();
    }
}

fn spawn(
    (program, line): (PathBuf, Vec<String>),
    report: &Path,
    recording: Vec<String>,
) -> io::Result<Child> {
    // A group of its own: Ctrl-C reaches the launcher alone, which stops the services in order.
    Command::new(&program)
        .args(line)
        .arg("--report")
        .arg(report)
        .args(recording)
        .process_group(0)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", program.display())))
}
