//! Follows a document: runs its commands in a folder like the project's, and looks for the lines
//! that it shows.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::time::{Duration, Instant};

use crate::blocks::{Block, Kind, of_document, shape};
use crate::built::root;
use crate::programs::{program, unknown_words};

/// The documents with commands.
pub const DOCUMENTS: [&str; 7] = [
    "README.md",
    "docs/commands.md",
    "docs/first-fault.md",
    "docs/library.md",
    "docs/make-it-yours.md",
    "docs/operation.md",
    "docs/your-robot.md",
];
/// A command that hangs is ended after this long; no test passes or fails by its duration.
const WATCHDOG: Duration = Duration::from_secs(120);
/// Further tries of a run in which a service has missed cycles.
const RETRIES: usize = 2;
/// Duration of a graph of which no lines are awaited, s.
const SHORT_S: &str = "2";
/// What a command's lines are awaited in steps of.
const STEP: Duration = Duration::from_millis(20);

/// Documents are followed side by side; a further try has the machine to itself.
static MACHINE: RwLock<()> = RwLock::new(());

fn shared_machine() -> RwLockReadGuard<'static, ()> {
    MACHINE.read().unwrap_or_else(PoisonError::into_inner)
}

fn machine() -> RwLockWriteGuard<'static, ()> {
    MACHINE.write().unwrap_or_else(PoisonError::into_inner)
}

/// A folder that looks like the project's; removed when dropped.
struct Workplace(PathBuf);

impl Workplace {
    fn new(document: &str) -> Self {
        let name = document.replace('/', "-");
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
            .join(format!("documents-{}-{name}", std::process::id()));
        // A document may change its own configuration.
        copy(&root().join("config"), &folder.join("config"));
        for entry in ["tests", "examples", "docs", "scripts"] {
            std::os::unix::fs::symlink(root().join(entry), folder.join(entry)).unwrap();
        }
        Self(folder)
    }
}

impl Drop for Workplace {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &target);
        } else {
            fs::copy(&path, &target).unwrap();
        }
    }
}

/// A running command and what it has printed; ended by its own id when dropped.
struct Process {
    command: String,
    child: Child,
    lines: Receiver<String>,
    printed: Vec<String>,
}

impl Process {
    fn start(line: &str, graph: &str, folder: &Path, is_awaited: bool) -> Self {
        let mut words = line.split_whitespace();
        let first = words.next().unwrap();
        let mut command = match program(first) {
            Some(path) => {
                let mut command = Command::new(path);
                command.args(arguments(first, words.collect(), graph, is_awaited));
                command
            }
            None => {
                let mut command = Command::new("bash");
                command.arg("-c").arg(line);
                command
            }
        };
        let mut child = command
            .current_dir(folder)
            .env_remove("VIGIL_CONFIG")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap_or_else(|error| panic!("{line}: {error}"));
        let (sender, lines) = channel();
        let streams: [Box<dyn Read + Send>; 2] = [
            Box::new(child.stdout.take().unwrap()),
            Box::new(child.stderr.take().unwrap()),
        ];
        for stream in streams {
            let sender = sender.clone();
            // A full pipe would hold the command up.
            std::thread::spawn(move || {
                for line in BufReader::new(stream).lines().map_while(Result::ok) {
                    let _ = sender.send(line);
                }
            });
        }
        Self {
            command: line.to_owned(),
            child,
            lines,
            printed: Vec::new(),
        }
    }

    /// Takes what has been printed since; false once nothing more can come.
    fn read(&mut self) -> bool {
        loop {
            match self.lines.recv_timeout(STEP) {
                Ok(line) => self.printed.push(line),
                Err(RecvTimeoutError::Timeout) => return true,
                Err(RecvTimeoutError::Disconnected) => return false,
            }
        }
    }

    /// True if a service missed a cycle: the simulator's noise is another then, and so is the
    /// drive; what comes late is told in another order, or not at all.
    fn has_missed(&self) -> bool {
        let is_miss = |line: &String| line.split_whitespace().nth(4) == Some("miss");
        self.printed.iter().any(is_miss)
    }

    /// Waits until lines of all these shapes have been printed.
    fn expect(&mut self, place: &str, shown: &[String]) {
        self.expect_unless_missed(place, shown, false);
    }

    /// The same; or else, if that `may_miss`, until the end of a run in which a service has missed
    /// a cycle. False then.
    fn expect_unless_missed(&mut self, place: &str, shown: &[String], may_miss: bool) -> bool {
        let started = Instant::now();
        let mut is_open = true;
        loop {
            let is_missing =
                |line: &&String| !self.printed.iter().any(|p| shape(p).contains(*line));
            let missing: Vec<&String> = shown.iter().filter(is_missing).collect();
            if missing.is_empty() {
                return true;
            }
            if !is_open && may_miss && self.has_missed() {
                return false;
            }
            assert!(
                is_open && started.elapsed() < WATCHDOG,
                "{place}: `{}` does not print {missing:#?}; it prints\n{}",
                self.command,
                self.printed.join("\n")
            );
            is_open = self.read();
        }
    }

    /// Waits for the end.
    fn wait(&mut self) -> ExitStatus {
        let started = Instant::now();
        while self.read() {
            assert!(
                started.elapsed() < WATCHDOG,
                "`{}` does not end",
                self.command
            );
        }
        self.child.wait().unwrap()
    }

    fn finish(mut self, place: &str, exit: Option<i32>) {
        let status = self.wait();
        assert!(
            exit.is_none() || status.code() == exit,
            "{place}: `{}` ends with {status}, not {exit:?}; it prints\n{}",
            self.command,
            self.printed.join("\n")
        );
    }

    fn terminate(&self) {
        vigil_cycle::signal::terminate(self.child.id());
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            self.terminate();
            let started = Instant::now();
            while matches!(self.child.try_wait(), Ok(None)) {
                if started.elapsed() > Duration::from_secs(10) {
                    let _ = self.child.kill();
                }
                std::thread::sleep(STEP);
            }
        }
    }
}

/// The command's words for a test: a graph of its own, and short if nothing of it is awaited.
fn arguments(program: &str, words: Vec<&str>, graph: &str, is_awaited: bool) -> Vec<String> {
    let mut words: Vec<String> = words.into_iter().map(str::to_owned).collect();
    let speaks_to_a_graph = match program {
        "scripts/up" => true,
        "target/release/vigil" => {
            ["check", "inject"].contains(&words[0].as_str())
                && !words.contains(&"--list".to_owned())
        }
        _ => false,
    };
    if program == "scripts/up" && !is_awaited {
        if let Some(at) = words.iter().position(|word| word == "--duration") {
            words.drain(at..(at + 2).min(words.len()));
        }
        words.extend(["--duration".into(), SHORT_S.into()]);
    }
    if program == "scripts/up" {
        words.push("--no-blackbox".into());
    }
    if speaks_to_a_graph {
        words.extend(["--graph".into(), graph.into()]);
    }
    if program == "target/release/publisher" {
        words.push(graph.into());
    }
    words
}

/// The shapes of the lines that the block after this one shows, if it shows any.
fn shown_after(following: &[Block]) -> Vec<String> {
    let next = following.first().filter(|next| next.kind == Kind::Shown);
    next.map(shapes).unwrap_or_default()
}

fn shapes(block: &Block) -> Vec<String> {
    block.text.lines().map(shape).collect()
}

/// A graph that runs in a window of its own, and its name.
struct Window {
    process: Process,
    graph: String,
    _machine: RwLockReadGuard<'static, ()>,
}

/// A document that is being followed.
struct Follower<'a> {
    document: &'a str,
    workplace: Workplace,
    window: Option<Window>,
}

impl Follower<'_> {
    fn place(&self, block: &Block) -> String {
        format!("{}:{}", self.document, block.line)
    }

    /// A name for a block's graph that no other block and no other run of the tests has.
    fn graph(&self, block: &Block) -> String {
        let page = DOCUMENTS.iter().position(|name| *name == self.document);
        let page = page.unwrap_or_else(|| panic!("{} is not in the list", self.document));
        format!("d{}-{page}-{}", std::process::id(), block.line)
    }

    fn start(&self, block: &Block, command: &str, is_awaited: bool) -> Process {
        assert_eq!(unknown_words(command), [""; 0], "{}", self.place(block));
        let own = self.graph(block);
        // A command beside a window is for the window's graph.
        let graph = self.window.as_ref().map_or(&own, |window| &window.graph);
        Process::start(command, graph, &self.workplace.0, is_awaited)
    }

    fn run(&self, block: &Block, exit: Option<i32>, shown: &[String]) {
        let place = self.place(block);
        let commands = block.commands();
        // An open window has it already.
        let is_first = self.window.is_none();
        let mut shared = is_first.then(shared_machine);
        let mut alone = None;
        for (index, command) in commands.iter().enumerate() {
            let is_awaited = index + 1 == commands.len() && !shown.is_empty();
            let mut process = self.start(block, command, is_awaited);
            if is_awaited {
                // On a loaded machine services miss cycles: another try may miss none.
                for _ in 0..RETRIES {
                    if process.expect_unless_missed(&place, shown, true) {
                        break;
                    }
                    if shared.take().is_some() {
                        alone = Some(machine());
                    }
                    process = self.start(block, command, is_awaited);
                }
                process.expect(&place, shown);
                if command.starts_with("scripts/up") {
                    process.terminate();
                }
            }
            process.finish(&place, exit);
        }
        drop(alone);
    }

    fn open_window(&mut self, block: &Block) {
        let place = self.place(block);
        assert!(self.window.is_none(), "{place}: a window is open already");
        let commands = block.commands();
        assert_eq!(commands.len(), 1, "{place}: a window has one command");
        let machine = shared_machine();
        let mut process = self.start(block, &commands[0], true);
        // From here on a simulator can be broken; a publisher waits for its graph itself.
        if !commands[0].contains("--source") {
            process.expect(&place, &[shape("0.0 s sensor-sim ready")]);
        }
        let graph = self.graph(block);
        self.window = Some(Window {
            process,
            graph,
            _machine: machine,
        });
    }

    /// Waits for the lines that the window shows, and ends it as Ctrl-C would.
    fn close_window(&mut self, block: &Block) {
        let place = self.place(block);
        let window = self.window.take();
        let mut window = window.unwrap_or_else(|| panic!("{place}: no window"));
        window.process.expect(&place, &shapes(block));
        window.process.terminate();
        // A publisher that has ended may have left the graph blind.
        window.process.finish(&place, None);
    }
}

/// Runs what a document says; panics with the place of the first thing that is not so.
pub fn follow(document: &str) {
    let blocks = of_document(&root().join(document));
    let mut follower = Follower {
        document,
        workplace: Workplace::new(document),
        window: None,
    };
    for (index, block) in blocks.iter().enumerate() {
        match block.kind {
            Kind::Run { exit } => {
                let shown = shown_after(&blocks[index + 1..]);
                follower.run(block, exit, &shown);
            }
            Kind::Window => follower.open_window(block),
            Kind::ShownInWindow => follower.close_window(block),
            Kind::Shown | Kind::NotRun(_) | Kind::Other => {}
        }
    }
    assert!(follower.window.is_none(), "{document}: a window stays open");
}
