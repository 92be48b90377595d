//! What is to be started: options, configuration and every model, checked before anything starts.

use std::error::Error;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use vigil_cycle::topic::ServiceName;
use vigil_evaluation::frames;
use vigil_setup::schema::Source;
use vigil_setup::{GraphArgs, Setup};

/// Starts the Vigil graph and says what happened.
#[derive(Debug, Clone, clap::Parser)]
#[command(name = "scripts/up", version, about)]
pub struct LauncherArgs {
    #[command(flatten)]
    pub graph: GraphArgs,
    /// Stop after this many seconds, counted from the first cycle in which every service answers.
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
    /// Inject a fault: `stuck:RM@5`, `encoder:LF:zero@3`, `clear:RM@9` (seconds after the start).
    #[arg(long, value_name = "SPEC@T")]
    pub inject: Vec<String>,
    /// Print one JSON document at the end, nothing else on standard output.
    #[arg(long)]
    pub json: bool,
}

/// A checked start.
pub struct Plan {
    /// The configuration, options applied.
    pub setup: Setup,
    /// Options for every service.
    options: Vec<String>,
    inject: Vec<String>,
}

impl Plan {
    /// Reads and checks everything that the services will read; each of them checks its part.
    pub fn new(args: &LauncherArgs) -> Result<Self, Box<dyn Error>> {
        if args.duration.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
            return Err("--duration: allowed is any number of seconds above 0".into());
        }
        let mut graph = args.graph.clone();
        let mut setup = graph.load()?;
        if setup.file.sensor.source == Source::Playback {
            if graph.rate.is_some() {
                return Err(
                    "--rate: recorded frames have their own rate; change it with --speed".into(),
                );
            }
            graph.rate = Some(playback_rate_hz(&setup)?);
            setup = graph.load()?;
        }
        let plan = Self {
            options: graph.to_command_line(),
            setup,
            inject: args.inject.clone(),
        };
        plan.check_services()?;
        Ok(plan)
    }

    /// Lets each service check what it needs, models included, without starting it.
    fn check_services(&self) -> Result<(), Box<dyn Error>> {
        let mut problems: Vec<String> = Vec::new();
        for name in self.services() {
            let (program, mut line) = self.command(name);
            line.push("--check".into());
            let output = Command::new(&program)
                .args(line)
                .stdin(Stdio::null())
                .output()
                .map_err(|error| format!("{}: {error}", program.display()))?;
            if !output.status.success() {
                let said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
                if !problems.contains(&said) {
                    problems.push(said);
                }
            }
        }
        if problems.is_empty() {
            return Ok(());
        }
        Err(problems.join("\n").into())
    }

    /// True if a first action must come back within the start-up limit; an external sensor may
    /// take its time.
    pub fn waits_for_ready(&self) -> bool {
        self.setup.file.sensor.source != Source::External
    }

    /// The services to start: not sensor-sim when the sensor is external.
    pub fn services(&self) -> impl Iterator<Item = ServiceName> {
        let external = self.setup.file.sensor.source == Source::External;
        ServiceName::ALL
            .into_iter()
            .filter(move |&service| !(external && service == ServiceName::SensorSim))
    }

    /// Program of a service, and the options that say what it is to do.
    pub fn command(&self, name: ServiceName) -> (PathBuf, Vec<String>) {
        let program = format!("vigil-{}", name.as_str());
        let beside = std::env::current_exe()
            .unwrap_or_default()
            .with_file_name(program);
        let mut line = self.options.clone();
        if name == ServiceName::SensorSim {
            for spec in &self.inject {
                line.extend(["--inject".to_owned(), spec.clone()]);
            }
        }
        (beside, line)
    }
}

/// Rate at which recorded frames are played: their own, times the speed.
fn playback_rate_hz(setup: &Setup) -> Result<f64, Box<dyn Error>> {
    let sensor = &setup.file.sensor;
    let path = setup.resolve(sensor.frames.as_deref().unwrap_or_default());
    let runs = frames::read(&path, &setup.robot)?;
    let interval_s = frames::interval_s(&runs)
        .ok_or_else(|| format!("{}: no run has two frames", path.display()))?;
    Ok(sensor.speed.unwrap_or(1.0) / interval_s)
}
