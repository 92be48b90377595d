//! What a launcher holds while it lives.

use std::io;

use vigil_cycle::{Domain, GraphLock, LauncherLock};

/// The two locks of a graph that is looked after.
#[derive(Debug)]
pub struct Locks {
    /// The services share it: it says that the graph runs.
    pub graph: GraphLock,
    /// The launcher's own: it says that somebody looks after the graph.
    pub launcher: LauncherLock,
}

/// What there is of a graph already.
#[derive(Debug)]
pub enum Claim {
    /// Nothing: this launcher may start it.
    Free(Locks),
    /// Its services run, and their launcher is gone: this one may adopt them.
    Orphaned(Locks),
    /// Its launcher lives.
    Held,
}

impl Claim {
    /// Takes the locks of a graph, if its launcher does not live.
    ///
    /// # Errors
    /// The file system's.
    pub fn take(domain: &Domain) -> io::Result<Self> {
        let Some(launcher) = domain.lock_launcher()? else {
            return Ok(Self::Held);
        };
        let claim = match domain.lock()? {
            Some(graph) => Self::Free(Locks { graph, launcher }),
            None => {
                let graph = domain.adopt_lock()?;
                Self::Orphaned(Locks { graph, launcher })
            }
        };
        if let Self::Free(locks) | Self::Orphaned(locks) = &claim {
            locks.graph.share_with_children();
        }
        Ok(claim)
    }
}
