//! Where a graph lives on a machine: runtime folder, shared-memory prefix, and its lock.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use iceoryx2::prelude::{Config, FileName, SemanticString};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use vigil_blocks::{Action, Block, SensorFrame};

use crate::clock::{Clock, Monotonic};
use crate::port_error::PortError;
use crate::runtime_folder::{excess_bytes, runtime_folder};
use crate::topic::{ServiceName, Topic};

/// Version of the transport, as the workspace's manifest demands it.
const TRANSPORT_VERSION: &str = "0.10.0";
/// Sensor frames are small, and a publisher that was held up sends many at once: so many times
/// more of them may wait, with what was true of each.
const SENSOR_BUFFERS: usize = 8;

/// Characters of a start's name, and how many there are.
const START_DIGITS: &[u8; 62] = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz";
const START_LENGTH: usize = 3;
/// Blocks that a reader may hold at once: the one it works on, and the next.
pub(crate) const BORROWED: usize = 2;
/// Blocks that a writer may hold at once: the one it fills, and one more while that is sent.
pub(crate) const LOANED: usize = 2;

/// Sizes of the shared-memory queues; the same for every peer of a graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Queues {
    /// Blocks a reader may fall behind before the oldest is overwritten; of sensor frames eight
    /// times as many.
    #[default(16)]
    #[schemars(range(min = 2, max = 256), extend("x-unit" = "blocks"))]
    pub buffer: usize,
    /// Blocks kept for a reader that connects late.
    #[default(1)]
    #[schemars(range(min = 0, max = 8), extend("x-unit" = "blocks"))]
    pub history: usize,
    /// Readers of one topic, observers included.
    #[default(8)]
    #[schemars(range(min = 6, max = 32), extend("x-unit" = "readers"))]
    pub max_subscribers: usize,
}

/// A graph's place on this machine. Graphs with different names share nothing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Domain {
    graph: String,
    folder: PathBuf,
    queues: Queues,
}

/// Tells one start of a graph from another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GraphStart {
    list_inode: u64,
    written_s: i64,
    written_ns: i64,
}

impl Domain {
    /// The place of `graph`; creates its runtime folder (mode 0700).
    ///
    /// # Errors
    /// [`PortError::Setup`] when no runtime folder can be made, or the name is too long for it.
    pub fn new(graph: &str, queues: Queues) -> Result<Self, PortError> {
        let domain = Self {
            graph: graph.to_owned(),
            folder: runtime_folder().join(graph),
            queues,
        };
        domain.demand_room()?;
        let failed = |e| {
            let message = format!("{}: {e}", domain.folder.display());
            PortError::setup("runtime folder", message)
        };
        fs::DirBuilder::new()
            .recursive(true)
            .mode(0o700)
            .create(&domain.folder)
            .map_err(failed)?;
        Ok(domain)
    }

    /// Refuses a name that the paths of sockets have no room for.
    fn demand_room(&self) -> Result<(), PortError> {
        let prefix_length = self.prefix().len() + START_LENGTH;
        let excess = excess_bytes(&self.transport_folder(), prefix_length);
        if excess == 0 {
            return Ok(());
        }
        // Each character of the name is in the path twice.
        let (excess, path) = (excess.div_ceil(2), self.folder.display());
        let message = format!("{path} has no room for sockets: {excess} characters too many");
        Err(PortError::setup("graph's name", message))
    }

    /// The place of the running graph of this name; `None` while there is none. Nothing is made.
    #[must_use]
    pub fn running(graph: &str) -> Option<Self> {
        let domain = Self {
            graph: graph.to_owned(),
            folder: runtime_folder().join(graph),
            queues: Queues::default(),
        };
        (domain.processes_file().exists() && domain.is_locked()).then_some(domain)
    }

    /// Names of the running graphs, sorted.
    #[must_use]
    pub fn all_running() -> Vec<String> {
        let folders = fs::read_dir(runtime_folder()).into_iter().flatten();
        let names = folders.flatten().map(|entry| entry.file_name());
        let names = names.filter_map(|name| name.into_string().ok());
        let mut names: Vec<_> = names.filter(|name| Self::running(name).is_some()).collect();
        names.sort();
        names
    }

    /// True while a launcher or one of its services lives. What was killed has left its files.
    fn is_locked(&self) -> bool {
        let file = File::open(self.lock_file());
        file.is_ok_and(|file| matches!(file.try_lock_shared(), Err(fs::TryLockError::WouldBlock)))
    }

    /// What is different after each start of the graph: when its list of processes was written.
    #[must_use]
    pub fn start(&self) -> Option<GraphStart> {
        let list = fs::metadata(self.processes_file()).ok()?;
        Some(GraphStart {
            list_inode: list.ino(),
            written_s: list.mtime(),
            written_ns: list.mtime_nsec(),
        })
    }

    /// Name of the graph.
    #[must_use]
    pub fn graph(&self) -> &str {
        &self.graph
    }

    /// Folder for the graph's lock, reports and the transport's files.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// File that lists the services' first processes, `name pid` a line, while the graph runs.
    #[must_use]
    pub fn processes_file(&self) -> PathBuf {
        self.folder.join("processes")
    }

    /// File with what the graph runs on: configuration and models, options applied. Who watches a
    /// graph takes names from it.
    #[must_use]
    pub fn document_file(&self) -> PathBuf {
        self.folder.join("document")
    }

    /// File with what the start asked of the services beside the configuration, for a launcher that
    /// adopts the graph.
    #[must_use]
    pub fn options_file(&self) -> PathBuf {
        self.folder.join("options")
    }

    /// File to which the launcher writes what happens.
    #[must_use]
    pub fn events_file(&self) -> PathBuf {
        self.folder.join("events")
    }

    /// Folder in which the black box keeps the last seconds.
    #[must_use]
    pub fn memory_folder(&self) -> PathBuf {
        self.folder.join("memory")
    }

    /// Folders of black boxes that were killed; each stays until what they kept is written.
    #[must_use]
    pub fn unwritten_folders(&self) -> [PathBuf; 2] {
        ["unwritten-1", "unwritten-2"].map(|name| self.folder.join(name))
    }

    /// True if a black box was killed and what it kept is not yet written, or if one lives.
    #[must_use]
    pub fn has_memory(&self) -> bool {
        let unwritten = self.unwritten_folders();
        self.memory_folder().exists() || unwritten.iter().any(|folder| folder.exists())
    }

    /// What a request to the black box begins with that is about a crash.
    pub const CRASH_REQUEST: &str = "crash: ";

    /// File by which the black box is asked for a recording; it says why, and the box removes it.
    #[must_use]
    pub fn request_file(&self) -> PathBuf {
        self.folder.join("request")
    }

    /// File in which the black box says where its recordings lie.
    #[must_use]
    pub fn recordings_file(&self) -> PathBuf {
        self.folder.join("recordings")
    }

    /// File in which the supervisor keeps the faults, for one that replaces it.
    #[must_use]
    pub fn faults_file(&self) -> PathBuf {
        self.folder.join("faults")
    }

    /// File in which a service whose assertion has failed leaves a [`crate::failure::Failure`].
    #[must_use]
    pub fn failure_file(&self, service: ServiceName) -> PathBuf {
        self.folder.join(format!("{}.failure", service.as_str()))
    }

    /// File that tells publishers the graph's types while it runs: name, size, alignment and the
    /// transport's version a line.
    #[must_use]
    pub fn types_file(&self) -> PathBuf {
        self.folder.join("types")
    }

    /// Writes [`Self::types_file`].
    ///
    /// # Errors
    /// The file system's.
    pub fn tell_types(&self) -> io::Result<()> {
        let line = |name: &str, size: usize, alignment: usize| {
            format!("{name} {size} {alignment} {TRANSPORT_VERSION}\n")
        };
        let frame = line(
            SensorFrame::TYPE_NAME,
            size_of::<SensorFrame>(),
            align_of::<SensorFrame>(),
        );
        let action = line(Action::TYPE_NAME, size_of::<Action>(), align_of::<Action>());
        fs::write(self.types_file(), frame + &action)
    }

    /// File that tells publishers which command and channels the graph's frames carry.
    #[must_use]
    pub fn channels_file(&self) -> PathBuf {
        self.folder.join("channels")
    }

    /// File that tells publishers where a graph takes datagrams: `udp ADDRESS` or `unix PATH` a
    /// line.
    #[must_use]
    pub fn addresses_file(&self) -> PathBuf {
        self.folder.join("addresses")
    }

    /// Sizes of the queues.
    #[must_use]
    pub const fn queues(&self) -> Queues {
        self.queues
    }

    /// Gives the transport's files of this start names of their own. Only for the holder of the
    /// lock, before anybody joins: a peer of an earlier start that lets go of its ports removes
    /// files by their names, and must not meet those of this one.
    ///
    /// # Errors
    /// The file system's.
    pub fn begin(&self) -> io::Result<()> {
        // Short, for the path of a socket has 107 characters: two starts have one name in 200,000.
        let mut rest = Monotonic.now_ns() / 1_000_000;
        let name = [(); START_LENGTH].map(|()| {
            let digit = START_DIGITS[(rest % START_DIGITS.len() as u64) as usize];
            rest /= START_DIGITS.len() as u64;
            digit
        });
        fs::write(self.start_file(), name)
    }

    /// File with what the names of this start's files have in addition.
    fn start_file(&self) -> PathBuf {
        self.folder.join("start")
    }

    /// Beginning of the names of the graph's files in /dev/shm, whatever start they are of.
    fn prefix(&self) -> String {
        format!("vigil_{}_", self.graph)
    }

    /// The same of the present start.
    #[must_use]
    pub fn transport_prefix(&self) -> String {
        // Without a launcher nothing has begun, and nothing is to be told apart.
        self.prefix() + &fs::read_to_string(self.start_file()).unwrap_or_default()
    }

    /// The transport's configuration, built here and handed to every node: a file found through
    /// the current directory would put services that start in different folders into different
    /// worlds.
    ///
    /// # Errors
    /// [`PortError::Setup`] when a name is too long for the transport.
    pub fn transport_config(&self) -> Result<Config, PortError> {
        let mut config = Config::default();
        config.global.prefix = FileName::new(self.transport_prefix().as_bytes())
            .map_err(|e| PortError::setup("shared-memory prefix", e))?;
        let root = self.transport_folder();
        let root = iceoryx2::prelude::Path::new(root.as_os_str().as_encoded_bytes())
            .map_err(|e| PortError::setup("transport folder", e))?;
        config.global.set_root_path(&root);
        Ok(config)
    }

    /// Folder of the transport's files, its sockets among them.
    fn transport_folder(&self) -> PathBuf {
        self.folder.join("t")
    }

    /// File of [`crate::GraphLock`].
    pub(crate) fn lock_file(&self) -> PathBuf {
        self.folder.join("lock")
    }

    /// Files of this graph in /dev/shm and in the transport's folder.
    #[must_use]
    pub fn residue(&self) -> Vec<PathBuf> {
        let prefix = self.prefix();
        let mut found = Vec::new();
        for entry in fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&prefix) {
                found.push(entry.path());
            }
        }
        collect_files(&self.transport_folder(), &mut found);
        found
    }

    /// Removes every file of this graph but the memory of its black box, which goes when it is
    /// written. Only for the holder of the lock, with no service alive.
    pub fn remove_residue(&self) {
        for path in self.residue() {
            let _ = fs::remove_file(path);
        }
        let _ = fs::remove_dir_all(self.transport_folder());
        for file in [
            self.processes_file(),
            self.types_file(),
            self.channels_file(),
            self.addresses_file(),
            self.start_file(),
            self.faults_file(),
            self.document_file(),
            self.options_file(),
            self.request_file(),
            self.recordings_file(),
        ] {
            let _ = fs::remove_file(file);
        }
    }
}

/// Free bytes of /dev/shm; `None` if it cannot be asked. A full one kills its users with SIGBUS.
#[must_use]
pub fn shared_memory_free_bytes() -> Option<u64> {
    // SAFETY: the path is a constant C string; statvfs only writes into the zeroed struct.
    #[allow(unsafe_code)]
    unsafe {
        let mut stat: libc::statvfs = std::mem::zeroed();
        (libc::statvfs(c"/dev/shm".as_ptr(), &raw mut stat) == 0)
            .then(|| stat.f_bavail * stat.f_frsize)
    }
}

impl Queues {
    /// The sizes of one topic's queues: of sensor frames and truths eight times as many may wait.
    #[must_use]
    pub const fn for_topic(mut self, topic: Topic) -> Self {
        if matches!(topic, Topic::Sensor | Topic::Truth) {
            self.buffer *= SENSOR_BUFFERS;
        }
        self
    }

    /// Bytes of shared memory that one writer of blocks of `size` bytes reserves: a slot for
    /// every block that may wait or be held, and those of history and on loan.
    #[must_use]
    pub const fn reserved_bytes(&self, size: usize) -> u64 {
        let slots = self.max_subscribers * (self.buffer + BORROWED) + self.history + LOANED;
        (slots * size) as u64
    }
}

fn collect_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect_files(&path, found);
        } else {
            found.push(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_graphs_files_lie_in_its_folder_under_names_of_their_own() {
        let graph = format!("t{}-files", std::process::id());
        let domain = Domain::new(&graph, Queues::default()).unwrap();
        let files = [
            domain.processes_file(),
            domain.types_file(),
            domain.channels_file(),
            domain.addresses_file(),
            domain.start_file(),
            domain.document_file(),
            domain.options_file(),
            domain.events_file(),
            domain.launcher_file(),
            domain.failure_file(ServiceName::Detector),
        ];
        for (i, file) in files.iter().enumerate() {
            assert_eq!(file.parent(), Some(domain.folder()));
            assert!(!files[..i].contains(file), "{}", file.display());
        }
        std::fs::remove_dir_all(domain.folder()).unwrap();
    }

    #[test]
    fn each_start_has_file_names_of_its_own_and_only_a_locked_graph_is_running() {
        let graph = format!("t{}-starts", std::process::id());
        let domain = Domain::new(&graph, Queues::default()).unwrap();
        let prefix = || domain.transport_config().unwrap().global.prefix.to_string();
        domain.begin().unwrap();
        let first = prefix();
        std::thread::sleep(Duration::from_millis(2));
        domain.begin().unwrap();
        assert_ne!(first, prefix());
        assert!(first.starts_with(&domain.prefix()), "{first}");

        fs::write(domain.processes_file(), "").unwrap();
        assert_eq!(Domain::running(&graph), None);
        let lock = domain.lock().unwrap().unwrap();
        assert_eq!(Domain::running(&graph), Some(domain.clone()));
        assert!(Domain::all_running().contains(&graph));
        drop(lock);
        // A child that another test starts holds the lock, too, until it has become its program.
        for _ in 0..100 {
            if Domain::running(&graph).is_none() {
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        assert_eq!(Domain::running(&graph), None);

        domain.remove_residue();
        assert_eq!(prefix(), domain.prefix());
        fs::remove_dir_all(domain.folder()).unwrap();
    }

    #[test]
    fn a_name_that_sockets_have_no_room_for_is_refused_and_leaves_nothing_behind() {
        let name = "a".repeat(80);
        let error = Domain::new(&name, Queues::default()).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("has no room for sockets: "), "{text}");
        assert!(!runtime_folder().join(name).exists());
    }

    #[test]
    fn eight_times_as_many_sensor_frames_may_wait_and_memory_is_reserved_for_all() {
        let queues = Queues {
            buffer: 16,
            history: 1,
            max_subscribers: 8,
        };
        let sensor = queues.for_topic(Topic::Sensor);
        assert_eq!((sensor.buffer, sensor.history), (128, 1));
        assert_eq!(queues.for_topic(Topic::Diagnosis), queues);
        // Eight readers may each leave 16 blocks and hold two; one of history; two loaned.
        assert_eq!(queues.reserved_bytes(100), (8 * 18 + 1 + 2) * 100);
    }
}
