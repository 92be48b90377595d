//! Who looks after a running graph: its launcher, and the processes that it has started.

use std::fs::{self, File, TryLockError};
use std::io::{self, Seek, Write};
use std::path::PathBuf;

use crate::domain::Domain;
use crate::graph_lock::{lock_soon, open_to_lock};
use crate::topic::ServiceName;

/// Held by the launcher of a graph alone, as long as it lives: services do not inherit it. Its file
/// lists the processes that the graph consists of now.
#[derive(Debug)]
pub struct LauncherLock {
    file: File,
}

/// The processes of a graph, as its launcher has listed them last.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Processes {
    /// The launcher; `None` once it is gone.
    pub launcher: Option<u32>,
    /// The services and their process ids. They may have ended since.
    pub services: Vec<(ServiceName, u32)>,
    /// The black box, if there is one; as the services.
    pub blackbox: Option<u32>,
}

impl LauncherLock {
    /// Lists the services that run now, and the black box.
    ///
    /// # Errors
    /// The file system's.
    pub fn list(
        &mut self,
        services: &[(ServiceName, u32)],
        blackbox: Option<u32>,
    ) -> io::Result<()> {
        let line = |(name, pid): &(ServiceName, u32)| format!("{} {pid}\n", name.as_str());
        let mut lines: String = services.iter().map(line).collect();
        if let Some(pid) = blackbox {
            lines.push_str(&format!("blackbox {pid}\n"));
        }
        // A reader in between meets the new lines, and perhaps old ones behind them.
        let text = format!("launcher {}\n{lines}", std::process::id());
        self.file.rewind()?;
        self.file.write_all(text.as_bytes())?;
        self.file.set_len(text.len() as u64)
    }
}

impl Domain {
    /// Takes the right to look after this graph; `None` while its launcher lives.
    ///
    /// # Errors
    /// The file system's.
    pub fn lock_launcher(&self) -> io::Result<Option<LauncherLock>> {
        let file = open_to_lock(&self.launcher_file())?;
        Ok(lock_soon(&file)?.then_some(LauncherLock { file }))
    }

    /// The processes of this graph, as its launcher has listed them last.
    #[must_use]
    pub fn processes(&self) -> Processes {
        let Ok(file) = File::open(self.launcher_file()) else {
            return Processes::default();
        };
        let is_held = matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock));
        let text = fs::read_to_string(self.launcher_file()).unwrap_or_default();
        let pid = |name: &str| {
            let mut lines = text.lines().filter_map(|line| line.split_once(' '));
            lines.find(|(of, _)| *of == name)?.1.parse::<u32>().ok()
        };
        let services = ServiceName::ALL.iter();
        // Another may hold the lock, and not be listed yet.
        let lives = |pid: &u32| is_held && self.find_process(*pid).is_some();
        Processes {
            launcher: pid("launcher").filter(lives),
            services: services
                .filter_map(|&name| Some((name, pid(name.as_str())?)))
                .collect(),
            blackbox: pid("blackbox"),
        }
    }

    /// File of [`LauncherLock`].
    #[must_use]
    pub fn launcher_file(&self) -> PathBuf {
        self.folder().join("launcher")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Queues;

    #[test]
    fn a_launcher_is_known_while_it_lives_and_its_services_after_it() {
        let graph = format!("t{}-launcher", std::process::id());
        let domain = Domain::new(&graph, Queues::default()).unwrap();
        assert_eq!(domain.processes(), Processes::default());
        let mut lock = domain.lock_launcher().unwrap().unwrap();
        let _graph = domain.lock().unwrap().unwrap();
        assert!(domain.lock_launcher().unwrap().is_none());
        let many = ServiceName::ALL.map(|name| (name, 4_000_000));
        lock.list(&many, Some(9)).unwrap();
        assert_eq!(domain.processes().blackbox, Some(9));
        let services = vec![(ServiceName::Detector, 7), (ServiceName::Supervisor, 8)];
        lock.list(&services, None).unwrap();
        assert_eq!(domain.processes().blackbox, None);
        let launcher = Some(std::process::id());
        let found = domain.processes();
        assert_eq!((found.launcher, &found.services), (launcher, &services));
        drop(lock);
        let found = domain.processes();
        assert_eq!((found.launcher, found.services), (None, services));
        assert!(domain.lock_launcher().unwrap().is_some());
        fs::remove_dir_all(domain.folder()).unwrap();
    }
}
