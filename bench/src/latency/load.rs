//! Loads beside the graph.

use std::error::Error;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use clap::ValueEnum;
use vigil_cycle::KeepAwake;

use super::flood::FLOOD_WORD;

/// What else the machine does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
#[value(rename_all = "kebab-case")]
pub enum Load {
    /// Nothing.
    Idle,
    /// Nothing, and every core is kept from halting.
    KeepAwake,
    /// Arithmetic on every core.
    Cpu,
    /// Memory written and read.
    Memory,
    /// Files written and synced.
    Io,
    /// Context switches.
    Switch,
    /// Timer interrupts.
    Timer,
    /// Wake-ups of the sensor's readers without a frame, as fast as a process can.
    SensorFlood,
}

impl Load {
    /// Name in options, files and reports.
    #[must_use]
    pub fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// Arguments of `stress-ng` for `cores` cores; none for what needs no program.
    #[must_use]
    pub fn arguments(self, cores: usize) -> Vec<String> {
        let line = match self {
            Self::Idle | Self::KeepAwake | Self::SensorFlood => return Vec::new(),
            Self::Cpu => format!("--cpu {cores} --cpu-method all"),
            Self::Memory => format!("--vm {cores} --vm-bytes 256M --vm-keep"),
            Self::Io => "--hdd 1 --hdd-bytes 64M --hdd-opts fsync --io 1".into(),
            Self::Switch => format!("--switch {cores}"),
            Self::Timer => format!("--timer {cores} --timer-freq 10000"),
        };
        line.split(' ').map(str::to_owned).collect()
    }
}

/// A load ends by itself after this long, should the bench be killed.
const LONGEST: &str = "3600s";

/// A load that lasts until it is dropped.
#[derive(Debug)]
pub struct LoadProcess {
    program: Option<Child>,
    _awake: Option<KeepAwake>,
}

impl LoadProcess {
    /// Starts `load` for a machine of `cores`; files it may need lie in `folder`. `graph` is the
    /// file of the graph that a flood is for.
    ///
    /// # Errors
    /// If `stress-ng` is missing, a core cannot be kept awake, or a flood has no graph.
    pub fn start(
        load: Load,
        cores: &[usize],
        folder: &Path,
        graph: Option<&Path>,
    ) -> Result<Self, Box<dyn Error>> {
        let program = match load {
            Load::Idle | Load::KeepAwake => None,
            Load::SensorFlood => Some(flood(graph.ok_or("a sensor flood needs a graph")?)?),
            _ => Some(stress(&load.arguments(cores.len()), folder)?),
        };
        let awake = (load == Load::KeepAwake).then(|| KeepAwake::start(cores.iter().copied()));
        Ok(Self {
            program,
            _awake: awake.transpose()?,
        })
    }

    /// Ends it.
    ///
    /// # Errors
    /// If it had ended before: what was measured was not under it.
    pub fn finish(mut self) -> Result<(), Box<dyn Error>> {
        if let Some(program) = &mut self.program
            && let Some(status) = program.try_wait()?
        {
            return Err(format!("the load ended early with {status}").into());
        }
        Ok(())
    }
}

fn stress(arguments: &[String], folder: &Path) -> Result<Child, Box<dyn Error>> {
    let started = Command::new("stress-ng")
        .args(arguments)
        .args(["--timeout", LONGEST])
        .arg("--temp-path")
        .arg(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    Ok(started.map_err(|error| format!("stress-ng: {error}; install stress-ng"))?)
}

/// This program again, as a flood.
fn flood(graph: &Path) -> Result<Child, Box<dyn Error>> {
    let mut command = Command::new(std::env::current_exe()?);
    command.arg(FLOOD_WORD).arg(graph).stdin(Stdio::null());
    Ok(command.spawn()?)
}

impl Drop for LoadProcess {
    fn drop(&mut self) {
        if let Some(program) = &mut self.program {
            // stress-ng ends its workers on SIGTERM; one that has ended is not to be signalled.
            if matches!(program.try_wait(), Ok(None)) {
                vigil_cycle::signal::terminate(program.id());
            }
            let _ = program.wait();
        }
    }
}
