//! Loads beside the graph.

use std::error::Error;
use std::process::{Child, Command, Stdio};

use clap::ValueEnum;
use vigil_cycle::KeepAwake;

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
            Self::Idle | Self::KeepAwake => return Vec::new(),
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
pub struct Running {
    stress: Option<Child>,
    _awake: Option<KeepAwake>,
}

impl Running {
    /// Starts `load` for a machine of `cores`; files it may need lie in `folder`.
    ///
    /// # Errors
    /// If `stress-ng` is missing, or a core cannot be kept awake.
    pub fn start(
        load: Load,
        cores: &[usize],
        folder: &std::path::Path,
    ) -> Result<Self, Box<dyn Error>> {
        let arguments = load.arguments(cores.len());
        let stress = if arguments.is_empty() {
            None
        } else {
            let started = Command::new("stress-ng")
                .args(&arguments)
                .args(["--timeout", LONGEST])
                .arg("--temp-path")
                .arg(folder)
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn();
            Some(started.map_err(|error| format!("stress-ng: {error}; install stress-ng"))?)
        };
        let awake = (load == Load::KeepAwake).then(|| KeepAwake::start(cores.iter().copied()));
        Ok(Self {
            stress,
            _awake: awake.transpose()?,
        })
    }
}

impl Running {
    /// Ends it.
    ///
    /// # Errors
    /// If it had ended before: what was measured was not under it.
    pub fn finish(mut self) -> Result<(), Box<dyn Error>> {
        if let Some(stress) = &mut self.stress
            && let Some(status) = stress.try_wait()?
        {
            return Err(format!("stress-ng ended early with {status}").into());
        }
        Ok(())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(stress) = &mut self.stress {
            // It ends its workers on SIGTERM; one that has ended is not to be signalled.
            if matches!(stress.try_wait(), Ok(None)) {
                vigil_cycle::signal::terminate(stress.id());
            }
            let _ = stress.wait();
        }
    }
}
