//! Processes of a graph that somebody else has started.

use std::fs;

use crate::domain::Domain;
use crate::signal;

/// A process of a graph that this one has not started: it cannot be waited for, and its exit code
/// is not known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundProcess {
    pid: u32,
    /// When it began, ticks since the machine did: its number may come to belong to another.
    began: u64,
}

impl Domain {
    /// The process of this number, if it lives and belongs to this graph: each service holds the
    /// graph's lock file open, which it has inherited.
    #[must_use]
    pub fn find_process(&self, pid: u32) -> Option<FoundProcess> {
        let began = began(pid)?;
        let lock = fs::canonicalize(self.lock_file()).ok()?;
        let open = fs::read_dir(format!("/proc/{pid}/fd")).ok()?.flatten();
        let mut open = open.filter_map(|entry| fs::read_link(entry.path()).ok());
        open.any(|file| file == lock)
            .then_some(FoundProcess { pid, began })
    }
}

impl Domain {
    /// Every process of this graph but this one: its launcher, services and black box, listed or
    /// not.
    #[must_use]
    pub fn members(&self) -> Vec<FoundProcess> {
        let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
        let pids = processes.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        let others = pids.filter(|pid| *pid != std::process::id());
        others.filter_map(|pid| self.find_process(pid)).collect()
    }
}

impl FoundProcess {
    /// Its number.
    #[must_use]
    pub const fn id(&self) -> u32 {
        self.pid
    }

    /// Its command line; empty once it has ended.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let text = fs::read(format!("/proc/{}/cmdline", self.pid)).unwrap_or_default();
        let words = text
            .split(|byte| *byte == 0)
            .filter(|word| !word.is_empty());
        let words = words.map(|word| String::from_utf8_lossy(word).into_owned());
        if self.lives() {
            words.collect()
        } else {
            Vec::new()
        }
    }

    /// False once it has ended.
    #[must_use]
    pub fn lives(&self) -> bool {
        began(self.pid) == Some(self.began)
    }

    /// Asks it to stop.
    pub fn terminate(&self) {
        if self.lives() {
            signal::terminate(self.pid);
        }
    }

    /// Ends it.
    pub fn kill(&self) {
        if self.lives() {
            signal::kill(self.pid);
        }
    }
}

/// When a living process began, in ticks: field 22 of `/proc/PID/stat` (proc(5)). The second field
/// may hold blanks, and ends with the last parenthesis. A process whose first thread has ended
/// lives, and holds its files, until the last has.
fn began(pid: u32) -> Option<u64> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let mut fields = stat.rsplit_once(") ")?.1.split(' ');
    // The state is field 3, the number of threads field 20.
    let state = fields.next()?;
    let threads: u32 = fields.nth(16)?.parse().ok()?;
    if state == "X" || state == "Z" && threads <= 1 {
        return None;
    }
    fields.nth(1)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Queues;
    use std::process::Command;

    #[test]
    fn only_who_has_inherited_the_lock_is_of_the_graph_and_one_that_ended_lives_no_more() {
        let graph = format!("t{}-found", std::process::id());
        let domain = Domain::new(&graph, Queues::default()).unwrap();
        let sleeper = || Command::new("sleep").arg("3600").spawn().unwrap();
        let mut stranger = sleeper();
        let lock = domain.lock().unwrap().unwrap();
        lock.share_with_children();
        let mut service = sleeper();
        assert_eq!(domain.find_process(stranger.id()), None);
        let found = domain.find_process(service.id()).unwrap();
        assert!(domain.members().contains(&found));
        assert_eq!((found.id(), found.lives()), (service.id(), true));
        assert_eq!(found.words(), ["sleep", "3600"]);
        found.terminate();
        // Not reaped yet, it is there and lives no more.
        while found.lives() {
            std::thread::yield_now();
        }
        assert_eq!(domain.find_process(service.id()), None);
        assert!(found.words().is_empty());
        service.wait().unwrap();
        found.kill();
        stranger.kill().unwrap();
        stranger.wait().unwrap();
        drop(lock);
        fs::remove_dir_all(domain.folder()).unwrap();
    }
}
