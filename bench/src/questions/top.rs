//! How much of a core does `vigil top` take?
//!
//! The graph runs as a user starts it, and `vigil top` on a terminal of its own, which nobody looks
//! at: `script` makes it, of util-linux.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use vigil_bench::archive::{Archive, Outlet};
use vigil_bench::latency::graph::{Change, GraphFile};
use vigil_bench::launched::Launched;
use vigil_bench::process_time::{children, cpu_s};
use vigil_bench::program;
use vigil_cycle::signal;

/// Largest share of a core, %.
const PERCENT_MAX: f64 = 2.0;
/// Rate of the graph, Hz.
const RATE_HZ: f64 = 100.0;
/// Time around the measurement, s.
const AROUND_S: f64 = 10.0;
/// Time for a process to come up.
const START_LIMIT: Duration = Duration::from_secs(10);
/// Between two looks.
const POLL: Duration = Duration::from_millis(50);

/// Measures what the live view costs.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Time to measure, s.
    #[arg(long, value_name = "S", default_value_t = 60.0)]
    seconds: f64,
    /// Print the result as one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// A terminal with the program on it; both are ended when this is dropped.
struct Terminal {
    script: Child,
}

impl Terminal {
    fn open(graph: &str, folder: &Path) -> Result<Self, Box<dyn Error>> {
        let vigil = program("vigil")?;
        let words = format!(
            "stty cols 120 rows 40; exec {} top --graph {graph}",
            vigil.display()
        );
        let typescript = folder.join("typescript");
        let script = Command::new("script")
            .args(["--quiet", "--flush", "--command", &words])
            .arg(typescript)
            .env("TERM", "xterm-256color")
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()?;
        Ok(Self { script })
    }

    /// The program, once it is there.
    fn program(&self) -> Result<u32, Box<dyn Error>> {
        let began = Instant::now();
        while began.elapsed() < START_LIMIT {
            let is_top = |pid: &u32| {
                let words = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
                words.split(|byte| *byte == 0).nth(1) == Some(b"top")
            };
            if let Some(pid) = children(self.script.id()).into_iter().find(is_top) {
                return Ok(pid);
            }
            std::thread::sleep(POLL);
        }
        Err("vigil top did not come up on its terminal".into())
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        for pid in children(self.script.id()) {
            signal::terminate(pid);
        }
        let _ = self.script.kill();
        let _ = self.script.wait();
    }
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let seconds = args.seconds;
    if seconds.is_nan() || seconds < 1.0 {
        return Err(format!("--seconds {seconds}: allowed is 1 or more").into());
    }
    let document = vigil_bench::in_folder("top", |folder| measure(seconds, folder))?;
    let percent = document["percent_of_a_core"].as_f64().unwrap_or_default();
    let mut archive = Archive::new("top", Outlet::by_flag(args.json))?;
    archive.say(&format!(
        "`vigil top` beside a graph at {RATE_HZ} Hz, on a terminal of 120 columns and 40 lines, \
         for {seconds} s: {percent:.2} % of a core; it wrote {} bytes a second. Bar: at most \
         {PERCENT_MAX} %: {}.",
        document["bytes_a_second"],
        if document["is_met"] == true {
            "met"
        } else {
            "missed"
        },
    ));
    archive.store("top.json", &document)?;
    archive.close()?;
    match document["is_met"] == true {
        true => Ok(()),
        false => Err("it takes more of a core than it may".into()),
    }
}

fn measure(seconds: f64, folder: &Path) -> Result<Value, Box<dyn Error>> {
    let change = Change {
        rate_hz: RATE_HZ,
        particles: 1000,
        is_fifo: true,
        is_faulty: false,
    };
    let graph = GraphFile::new(change, folder)?;
    let launcher = graph.command(seconds + 2.0 * AROUND_S, folder);
    let launched = Launched::start(&graph, launcher, folder)?;
    let terminal = Terminal::open(&graph.setup().file.graph.name, folder)?;
    let program = terminal.program()?;
    std::thread::sleep(Duration::from_secs_f64(AROUND_S / 2.0));
    let written = || fs::metadata(folder.join("typescript")).map_or(0, |it| it.len());
    let (before_s, before_bytes, began) = (cpu_s(program), written(), Instant::now());
    std::thread::sleep(Duration::from_secs_f64(seconds));
    let passed_s = began.elapsed().as_secs_f64();
    let (used_s, bytes) = (cpu_s(program) - before_s, written() - before_bytes);
    if used_s < 0.0 || bytes == 0 {
        return Err("vigil top has ended, or draws nothing".into());
    }
    drop(terminal);
    launched.stop()?;
    let percent = 100.0 * used_s / passed_s;
    Ok(json!({
        "percent_of_a_core": percent,
        "is_met": percent <= PERCENT_MAX,
        "bytes_a_second": (bytes as f64 / passed_s).round(),
        "seconds": passed_s,
    }))
}
