//! The process of the black box, as a launcher has it.

use std::fs::{self, Metadata};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use vigil_cycle::{Domain, signal};

use crate::process_time::cpu_s;
use crate::program;

/// Time in which it makes its ring, or ends.
const LIMIT: Duration = Duration::from_secs(20);
/// Between two looks.
const POLL: Duration = Duration::from_millis(10);

/// The black box, or none at present.
pub struct Process {
    domain: Domain,
    child: Option<Child>,
    /// Computing time of those that are gone, s.
    past_cpu_s: f64,
}

impl Process {
    /// None so far.
    pub const fn new(domain: Domain) -> Self {
        Self {
            domain,
            child: None,
            past_cpu_s: 0.0,
        }
    }

    /// Starts it, if there is none, and waits until it has its ring and has rescued what an earlier
    /// one kept.
    pub fn start(&mut self) -> io::Result<()> {
        if self.child.is_some() {
            return Ok(());
        }
        // That of a process before this one.
        let ring_before = self.ring().map(|ring| ring.ino());
        let is_new = |ring: Metadata| Some(ring.ino()) != ring_before;
        self.spawn()?;
        let began = Instant::now();
        while !self.ring().is_some_and(is_new) || self.is_unwritten() {
            let child = self.child.as_mut().map(Child::try_wait).transpose()?;
            if let Some(status) = child.flatten() {
                return Err(io::Error::other(format!("the black box ended: {status}")));
            }
            if began.elapsed() > LIMIT {
                return Err(io::Error::other("the black box did not come up"));
            }
            std::thread::sleep(POLL);
        }
        Ok(())
    }

    /// What the file system says of its ring.
    fn ring(&self) -> Option<Metadata> {
        fs::metadata(self.domain.memory_folder().join("ring")).ok()
    }

    fn is_unwritten(&self) -> bool {
        let mut folders = self.domain.unwritten_folders().into_iter();
        folders.any(|folder| folder.exists())
    }

    /// Starts it, as the launcher does.
    pub fn spawn(&mut self) -> io::Result<()> {
        let mut command = Command::new(program("vigil-blackbox")?);
        command.args(["--graph", self.domain.graph()]);
        command.stdin(Stdio::null()).stdout(Stdio::null());
        self.child = Some(command.stderr(Stdio::null()).spawn()?);
        Ok(())
    }

    /// Ends it in order.
    pub fn stop(&mut self) -> io::Result<()> {
        if let Some(child) = &self.child {
            signal::terminate(child.id());
        }
        self.reap()
    }

    /// Ends it at once.
    pub fn kill(&mut self) -> io::Result<()> {
        if let Some(child) = &mut self.child {
            child.kill()?;
        }
        self.reap()
    }

    fn reap(&mut self) -> io::Result<()> {
        // A process that is gone says nothing of itself.
        let cpu_s = self.present_cpu_s();
        if let Some(mut child) = self.child.take() {
            child.wait()?;
            self.past_cpu_s += cpu_s;
        }
        Ok(())
    }

    /// Holds it, or lets it go on.
    pub fn hold(&self, is_held: bool) -> io::Result<()> {
        let Some(child) = &self.child else {
            return Ok(());
        };
        let word = if is_held { "-STOP" } else { "-CONT" };
        let status = Command::new("kill")
            .args([word, &child.id().to_string()])
            .status()?;
        match status.success() {
            true => Ok(()),
            false => Err(io::Error::other(format!("kill {word} failed"))),
        }
    }

    /// Computing time of all processes so far, s.
    pub fn cpu_s(&self) -> f64 {
        self.past_cpu_s + self.present_cpu_s()
    }

    fn present_cpu_s(&self) -> f64 {
        self.child.as_ref().map_or(0.0, |child| cpu_s(child.id()))
    }

    /// Its resident memory, bytes.
    pub fn memory_bytes(&self) -> u64 {
        let Some(child) = &self.child else {
            return 0;
        };
        let path = format!("/proc/{}/status", child.id());
        let text = fs::read_to_string(path).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let kib = line.and_then(|rest| rest.split_ascii_whitespace().next());
        1024 * kib.and_then(|kib| kib.parse().ok()).unwrap_or(0)
    }

    /// Its ring, bytes.
    pub fn ring_bytes(&self) -> u64 {
        self.ring().map_or(0, |ring| ring.len())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // A held one hears nothing else.
        let _ = self.kill();
        let kept = [self.domain.memory_folder()].into_iter();
        for folder in kept.chain(self.domain.unwritten_folders()) {
            let _ = fs::remove_dir_all(folder);
        }
    }
}
