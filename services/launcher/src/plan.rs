//! What is to be started: options, configuration and every model, checked before anything starts.

use std::error::Error;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use vigil_cycle::topic::ServiceName;
use vigil_cycle::{KeepAwake, SealedText};
use vigil_recording::frames;
use vigil_robot::Injection;
use vigil_setup::graph_file::Source;
use vigil_setup::{GraphArgs, Setup};

/// Starts a Vigil graph, watches it and prints what happened.
#[derive(Debug, Clone, clap::Parser)]
#[command(name = "scripts/up", bin_name = "scripts/up", version)]
pub struct LauncherArgs {
    #[command(flatten)]
    pub graph: GraphArgs,
    /// Stop after this many seconds. They count from the first cycle in which every service
    /// answers.
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
    /// Break the simulated rover T seconds after the start: `stuck:RM@5`, `encoder:LF:zero@3`.
    /// `clear:RM@9` and `clear:all@9` mend it. Some kinds are in no model, such as `tether:20@5`
    /// and `steer-jump:LF:0.2@5`. An unknown kind prints the list of all.
    #[arg(long, value_name = "SPEC@T")]
    pub inject: Vec<String>,
    /// Keep the graph's cores from halting, with a thread of the lowest class on each. A halted
    /// core takes long to wake; an awake one costs power.
    #[arg(long)]
    pub keep_awake: bool,
    /// Write the times of every cycle to `DIR/SERVICE.stamps`. A record is four little-endian
    /// 64-bit numbers, ns of CLOCK_MONOTONIC: due, input published, awake, output published.
    #[arg(long, value_name = "DIR")]
    pub stamps: Option<PathBuf>,
    /// Cycles whose times are kept; the oldest are dropped.
    #[arg(long, value_name = "N", default_value_t = 100_000, requires = "stamps")]
    pub stamped_cycles: usize,
    /// Record no latencies; the summary then has none. It serves to measure what recording costs.
    #[arg(long)]
    pub no_timing: bool,
    /// Print one JSON document at the end, and nothing else on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Changes younger than this may not have been told by a simulator that has died, s.
const UNTOLD_S: f64 = 0.2;

/// What a simulator that replaces another has to know.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// When the drive began, ns.
    pub began_ns: u64,
    /// Seconds since then.
    pub t_s: f64,
    /// What was broken and mended until now: `stuck:RM@5.02`, `clear:RM@9.4`.
    pub changes: Vec<String>,
}

/// A checked start.
pub struct Plan {
    /// The configuration, options applied.
    pub setup: Setup,
    /// What every service reads: the same bytes at each restart, even if a file was edited.
    document: SealedText,
    inject: Vec<String>,
    stamps: Option<(PathBuf, usize)>,
    no_timing: bool,
}

impl Plan {
    /// Reads and checks everything that the services will read; each of them checks its part.
    pub fn new(args: &LauncherArgs) -> Result<Self, Box<dyn Error>> {
        if args.duration.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
            return Err("--duration: allowed is any number of seconds above 0".into());
        }
        let mut document = args.graph.read()?;
        let mut setup = document.check()?;
        if !args.inject.is_empty() && setup.file.sensor.source != Source::Simulator {
            return Err("--inject: only the simulator can be broken; the source is another".into());
        }
        if setup.file.sensor.source == Source::Playback {
            if args.graph.rate.is_some() {
                return Err(
                    "--rate: recorded frames have their own; change it with --speed or sensor.speed"
                        .into(),
                );
            }
            document.file.graph.rate_hz = playback_rate_hz(&setup)?;
            setup = document.check()?;
        }
        let plan = Self {
            document: SealedText::new(&document.to_text()?)?,
            setup,
            inject: args.inject.clone(),
            stamps: args.stamps.clone().map(|f| (f, args.stamped_cycles)),
            no_timing: args.no_timing,
        };
        if let Some((folder, _)) = &plan.stamps {
            std::fs::create_dir_all(folder)
                .map_err(|error| format!("--stamps {}: {error}", folder.display()))?;
        }
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
                let mut said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
                if said.is_empty() {
                    said = format!("{} --check: {}", name.as_str(), output.status);
                }
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

    /// Options that say what a service is to record of its cycles.
    pub fn recording(&self, name: ServiceName) -> Vec<String> {
        let mut options = Vec::new();
        if self.no_timing {
            options.push("--no-timing".into());
        }
        let Some((folder, cycles)) = &self.stamps else {
            return options;
        };
        let file = folder.join(format!("{}.stamps", name.as_str()));
        let file = file.display().to_string();
        let cycles = cycles.to_string();
        options.extend(["--stamps".into(), file]);
        options.extend(["--stamped-cycles".into(), cycles]);
        options
    }

    /// True if a first action must come back within the start-up limit; a sensor outside may
    /// take its time.
    pub fn waits_for_ready(&self) -> bool {
        !self.setup.file.sensor.source.is_outside()
    }

    /// True for a source that could only begin its recording again.
    pub fn cannot_resume(&self, service: ServiceName) -> bool {
        service == ServiceName::SensorSim && self.setup.file.sensor.source == Source::Playback
    }

    /// Keeps the cores of the services awake until the result is dropped.
    pub fn keep_awake(&self) -> std::io::Result<KeepAwake> {
        KeepAwake::start(self.services().map(|name| self.setup.service(name).core))
    }

    /// The services to start: not sensor-sim when the sensor is external.
    pub fn services(&self) -> impl Iterator<Item = ServiceName> {
        let external = self.setup.file.sensor.source == Source::External;
        ServiceName::ALL
            .into_iter()
            .filter(move |&service| !(external && service == ServiceName::SensorSim))
    }

    /// Program of a service, and the options that say what it is to do from the start.
    pub fn command(&self, name: ServiceName) -> (PathBuf, Vec<String>) {
        let (program, mut line) = self.program(name);
        if name == ServiceName::SensorSim {
            line.extend(
                self.inject
                    .iter()
                    .flat_map(|spec| ["--inject".into(), spec.clone()]),
            );
        }
        (program, line)
    }

    /// The same for a service that replaces one that has died, in the middle of a `drive`.
    pub fn command_again(
        &self,
        name: ServiceName,
        drive: Option<&Drive>,
    ) -> (PathBuf, Vec<String>) {
        let (program, mut line) = self.program(name);
        let (ServiceName::SensorSim, Some(drive)) = (name, drive) else {
            return self.command(name);
        };
        line.extend(["--began-ns".into(), drive.began_ns.to_string()]);
        let parse = |spec: &String| Injection::parse(spec, &self.setup.robot).ok();
        // What was due just now may not have been told.
        let is_to_come = |spec: &&String| {
            parse(spec).is_some_and(|injection| {
                let is_same = |told: Injection| {
                    told.change == injection.change && (told.at_s - injection.at_s).abs() < UNTOLD_S
                };
                injection.at_s > drive.t_s - UNTOLD_S
                    && !drive.changes.iter().filter_map(parse).any(is_same)
            })
        };
        let specs = self.inject.iter().filter(is_to_come).chain(&drive.changes);
        line.extend(specs.flat_map(|spec| ["--inject".into(), spec.clone()]));
        (program, line)
    }

    fn program(&self, name: ServiceName) -> (PathBuf, Vec<String>) {
        let program = format!("vigil-{}", name.as_str());
        let beside = std::env::current_exe()
            .unwrap_or_default()
            .with_file_name(program);
        let document = self.document.path().display().to_string();
        (beside, vec!["--setup".into(), document])
    }
}

/// Rate at which recorded frames are played: their own, times the speed.
fn playback_rate_hz(setup: &Setup) -> Result<f64, Box<dyn Error>> {
    let sensor = &setup.file.sensor;
    let path = setup.resolve(sensor.frames.as_deref().unwrap_or_default());
    let runs = frames::read(&path, &setup.robot)?;
    let rate_hz = frames::playback_rate_hz(&runs, sensor.speed.unwrap_or(1.0));
    Ok(rate_hz.map_err(|error| format!("{}: {error}", path.display()))?)
}
