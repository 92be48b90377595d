//! Starts and ends graphs.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::Value;
use vigil_blocks::{Action, Block, Health, RecoveryKind};
use vigil_cycle::port::Link;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Graph, Receiver, Topic};
use vigil_setup::{GraphArgs, Setup};

use crate::built;
pub use crate::built::root;

/// A test that hangs is ended after this long; no test passes or fails by its duration.
const WATCHDOG: Duration = Duration::from_secs(120);

static MACHINE: RwLock<()> = RwLock::new(());

/// Takes the machine for one test: another graph beside its own would change what it looks at.
pub fn machine() -> RwLockWriteGuard<'static, ()> {
    MACHINE.write().unwrap_or_else(PoisonError::into_inner)
}

/// Takes the machine for a test that may run beside others of its kind.
pub fn shared_machine() -> RwLockReadGuard<'static, ()> {
    MACHINE.read().unwrap_or_else(PoisonError::into_inner)
}

/// A binary of the workspace, to be run in the project's folder.
pub fn binary(name: &str) -> Command {
    let mut command = Command::new(built::program(name));
    command.current_dir(root()).env_remove("VIGIL_CONFIG");
    command
}

/// Name for a graph that no other run of the tests has. It is one for each `name`: tests that run
/// at once give different ones.
pub fn unique(name: &str) -> String {
    format!("t{}-{name}", std::process::id())
}

/// The default graph file in `folder`, changed; the models stay where they are.
pub fn config_with(folder: &Path, change: impl FnOnce(String) -> String) -> PathBuf {
    std::fs::create_dir_all(folder).unwrap();
    let config = root().join("config");
    let absolute = |text: String, name: &str| {
        let path = config.join(name).display().to_string();
        text.replacen(&format!("\"{name}\""), &format!("\"{path}\""), 1)
    };
    let text = std::fs::read_to_string(config.join("rover.toml")).unwrap();
    let models = [
        "robots/rover.toml",
        "trees/rover.toml",
        "models/rover.toml",
        "rover.pomdp",
        "rover.policy.json",
    ];
    let path = folder.join("rover.toml");
    std::fs::write(&path, change(models.into_iter().fold(text, absolute))).unwrap();
    path
}

/// Starts the launcher for a second at most, and waits for its end.
pub fn launch(config: &Path, name: &str, options: &[&str]) -> Output {
    binary("vigil-launcher")
        .args([
            "--json",
            "--no-blackbox",
            "--duration",
            "1",
            "--graph",
            &unique(name),
        ])
        .arg("--config")
        .arg(config)
        .args(options)
        .output()
        .unwrap()
}

/// A running graph; stopped, with all its services, when dropped.
pub struct RunningGraph {
    launcher: Option<Child>,
    /// What the launcher prints, read as it comes: a full pipe would hold it up.
    printed: Option<JoinHandle<String>>,
    pub setup: Setup,
}

impl RunningGraph {
    /// Starts the launcher with `--json` and these options.
    pub fn start(name: &str, options: &[&str]) -> Self {
        Self::start_with("config/rover.toml".into(), name, options)
    }

    pub fn start_with(config: PathBuf, name: &str, options: &[&str]) -> Self {
        let graph = unique(name);
        let args = GraphArgs {
            config,
            graph: Some(graph.clone()),
            ..GraphArgs::default()
        };
        let mut launcher = binary("vigil-launcher")
            .args(["--json", "--no-blackbox", "--graph", &graph, "--config"])
            .arg(&args.config)
            .args(options)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stdout = launcher.stdout.take().unwrap();
        let printed = std::thread::spawn(move || {
            let mut text = String::new();
            stdout.read_to_string(&mut text).unwrap();
            text
        });
        let setup = GraphArgs {
            config: root().join(&args.config),
            ..args
        }
        .load()
        .unwrap();
        Self {
            launcher: Some(launcher),
            printed: Some(printed),
            setup,
        }
    }

    /// An observer's link to the graph, once its services have been started.
    pub fn observe(&mut self) -> Graph {
        let domain = self.setup.domain().unwrap();
        eventually("the services are started", || {
            assert!(self.is_alive(), "the launcher ended");
            domain.processes_file().exists().then_some(())
        });
        Graph::SharedMemory(Link::join(&domain, "test").unwrap())
    }

    /// True while the launcher runs.
    pub fn is_alive(&mut self) -> bool {
        matches!(self.launcher.as_mut().unwrap().try_wait(), Ok(None))
    }

    /// Asks the launcher to stop.
    pub fn interrupt(&self) {
        vigil_cycle::signal::terminate(self.launcher.as_ref().unwrap().id());
    }

    /// Waits for the end and reads the summary.
    pub fn finish(mut self) -> Summary {
        let output = wait(self.launcher.take().unwrap());
        let text = self.printed.take().unwrap().join().unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        // A graph that was blind for a while has had a failure; a restart may take that long.
        let was_blind = json["blind"] != serde_json::json!({});
        let expected = Some(i32::from(was_blind));
        assert_eq!(output.status.code(), expected, "{}", json["blind"]);
        let residue = self.setup.domain().unwrap().residue();
        assert_eq!(
            residue,
            Vec::<PathBuf>::new(),
            "shared memory is left behind"
        );
        Summary { json }
    }
}

impl Drop for RunningGraph {
    fn drop(&mut self) {
        if let Some(launcher) = self.launcher.take() {
            vigil_cycle::signal::terminate(launcher.id());
            let _ = wait(launcher);
        }
    }
}

/// Waits for a child; a hanging one is killed and fails the test.
pub fn wait(mut child: Child) -> Output {
    let started = Instant::now();
    while matches!(child.try_wait(), Ok(None)) {
        if started.elapsed() > WATCHDOG {
            let _ = child.kill();
            panic!("a process hung");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.wait_with_output().unwrap()
}

/// Polls until `condition` gives a value; panics when it never does.
pub fn eventually<T>(what: &str, mut condition: impl FnMut() -> Option<T>) -> T {
    let started = Instant::now();
    loop {
        if let Some(value) = condition() {
            return value;
        }
        assert!(started.elapsed() < WATCHDOG, "never happened: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Takes every waiting block.
pub fn drain<T: Block>(receiver: &mut dyn Receiver<T>, mut take: impl FnMut(&T)) {
    while let Some(block) = receiver.take_next() {
        take(block);
    }
}

/// Newest Health of each service.
pub struct HealthWatch {
    receivers: Vec<(ServiceName, Box<dyn Receiver<Health>>)>,
    pub latest: BTreeMap<&'static str, Health>,
}

impl HealthWatch {
    pub fn new(graph: &Graph) -> Self {
        let open = |name| (name, graph.receiver(Topic::Health(name)).unwrap());
        Self {
            receivers: ServiceName::ALL.into_iter().map(open).collect(),
            latest: BTreeMap::new(),
        }
    }

    pub fn poll(&mut self) -> &BTreeMap<&'static str, Health> {
        for (name, receiver) in &mut self.receivers {
            drain(receiver.as_mut(), |health| {
                self.latest.insert(name.as_str(), *health);
            });
        }
        &self.latest
    }

    /// True once every service cycles.
    pub fn all_running(&mut self) -> bool {
        let running = vigil_blocks::ServiceState::Running as u32;
        self.poll().values().filter(|h| h.state == running).count() == ServiceName::ALL.len()
    }
}

/// What the supervisor does.
pub struct ActionWatch {
    receiver: Box<dyn Receiver<Action>>,
    last: Option<RecoveryKind>,
}

impl ActionWatch {
    pub fn new(graph: &Graph) -> Self {
        Self {
            receiver: graph.receiver(Topic::Action).unwrap(),
            last: None,
        }
    }

    /// Waits until an action of this kind has stood for `lasting`. Changes are printed, in case
    /// that never happens.
    pub fn wait_for(&mut self, kind: RecoveryKind, lasting: Duration) {
        let mut since_ns = None;
        eventually(&format!("{kind:?} for {lasting:?}"), || {
            let mut is_done = None;
            drain(self.receiver.as_mut(), |action| {
                let (now_ns, is_kind) = (action.header.t_publish_ns, action.kind == kind as u32);
                let last = RecoveryKind::from_repr(action.kind);
                if std::mem::replace(&mut self.last, last) != last {
                    println!("{:.2} s: {last:?}", now_ns as f64 * 1e-9);
                }
                since_ns = is_kind.then(|| since_ns.unwrap_or(now_ns));
                let lasted = |since_ns| Duration::from_nanos(now_ns - since_ns) >= lasting;
                is_done = since_ns.is_some_and(lasted).then_some(());
            });
            is_done
        });
    }
}

/// The launcher's JSON document.
pub struct Summary {
    pub json: Value,
}

impl Summary {
    pub fn service(&self, name: &str, key: &str) -> u64 {
        self.json["services"][name][key].as_u64().unwrap()
    }

    /// Events of a kind: (time, what), in order.
    pub fn events(&self, kind: &str) -> Vec<(f64, String)> {
        let events = self.json["events"].as_array().unwrap();
        events
            .iter()
            .filter(|e| e["event"] == kind)
            .map(|e| {
                (
                    e["t_s"].as_f64().unwrap(),
                    e["what"].as_str().unwrap().to_owned(),
                )
            })
            .collect()
    }
}

/// The mode that the identifier reports, by name.
pub struct ModeWatch {
    receiver: Box<dyn Receiver<vigil_blocks::FaultBelief>>,
    names: Vec<String>,
    mode: Option<u32>,
}

impl ModeWatch {
    pub fn new(graph: &Graph, setup: &Setup) -> Self {
        let names = setup
            .tree
            .nodes()
            .iter()
            .map(|node| node.name.clone())
            .collect();
        Self {
            receiver: graph.receiver(Topic::Diagnosis).unwrap(),
            names,
            mode: None,
        }
    }

    pub fn poll(&mut self) -> Option<String> {
        drain(self.receiver.as_mut(), |belief| {
            self.mode = Some(belief.mode)
        });
        let mode = self.mode? as usize;
        Some(
            self.names
                .get(mode)
                .cloned()
                .unwrap_or_else(|| format!("mode {mode}")),
        )
    }
}
