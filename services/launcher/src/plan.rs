//! What is to be started: options, configuration and every model, checked before anything starts.

use std::io;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use vigil_cycle::topic::ServiceName;
use vigil_cycle::{KeepAwake, SealedText};
use vigil_recording::frames;
use vigil_robot::Injection;
use vigil_setup::graph_file::Source;
use vigil_setup::{Document, RunningGraph, Setup};

use crate::args::LauncherArgs;
use crate::error::LauncherError;
use crate::restarts::RestartPolicy;
use crate::start_options::StartOptions;

/// Changes younger than this may not be in the timeline when a simulator dies, s: four intervals of
/// Health, which goes out twenty times a second.
const UNREPORTED_S: f64 = 0.2;

/// What a simulator that replaces another has to know.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveProgress {
    /// When the drive began, ns.
    pub began_ns: u64,
    /// Seconds since then.
    pub t_s: f64,
    /// What was broken and mended until now: `stuck:RM@5.02`, `clear:RM@9.4`.
    pub changes: Vec<String>,
}

/// A program and its options.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CommandLine {
    /// Path of the program.
    pub program: PathBuf,
    /// Its options.
    pub options: Vec<String>,
}

/// A checked start.
pub struct Plan {
    /// The configuration, options applied.
    pub setup: Setup,
    /// What every service reads: the same bytes at each restart, even if a file was edited.
    document: SealedText,
    /// Folder of the services' programs: the launcher's own.
    pub programs: PathBuf,
    /// What the start asks beside the configuration.
    pub options: StartOptions,
}

impl Plan {
    /// Reads and checks everything that the services will read; each of them checks its part.
    pub fn new(args: &LauncherArgs) -> Result<Self, LauncherError> {
        let plan = Self::read(args)?;
        if let Some(folder) = &plan.options.stamps {
            std::fs::create_dir_all(folder).map_err(|cause| LauncherError::file(folder, cause))?;
        }
        plan.check_services()?;
        Ok(plan)
    }

    /// Reads the configuration and checks the options against it.
    fn read(args: &LauncherArgs) -> Result<Self, LauncherError> {
        let mut document = args.graph.read()?;
        document.file.blackbox.enabled &= !args.no_blackbox;
        let mut setup = document.check()?;
        if !args.inject.is_empty() && setup.file.sensor.source != Source::Simulator {
            return Err(LauncherError::NotSimulated);
        }
        if setup.file.sensor.source == Source::Playback {
            if args.graph.rate.is_some() {
                return Err(LauncherError::RecordedRate);
            }
            document.file.graph.rate_hz = playback_rate_hz(&setup)?;
            setup = document.check()?;
        }
        let stamps = args.stamps.as_deref().unwrap_or(Path::new("."));
        let options =
            StartOptions::new(args).map_err(|cause| LauncherError::file(stamps, cause))?;
        Self::from_document(&document, setup, options)
    }

    /// What a running graph runs on, to look after it from now on.
    pub fn of_running(graph: &RunningGraph) -> Result<Self, LauncherError> {
        let file = graph.domain.options_file();
        let options = StartOptions::read(&file);
        let options = options.map_err(|cause| LauncherError::file(&file, cause))?;
        Self::from_document(&graph.document, graph.setup.clone(), options)
    }

    fn from_document(
        document: &Document,
        setup: Setup,
        options: StartOptions,
    ) -> Result<Self, LauncherError> {
        let text = document.to_text()?;
        Ok(Self {
            document: SealedText::new(&text).map_err(LauncherError::Document)?,
            setup,
            programs: std::env::current_exe()
                .unwrap_or_default()
                .with_file_name(""),
            options,
        })
    }

    /// What every service reads.
    pub fn document_text(&self) -> io::Result<String> {
        std::fs::read_to_string(self.document.path())
    }

    /// Lets each service check what it needs, models included, without starting it.
    fn check_services(&self) -> Result<(), LauncherError> {
        let mut problems: Vec<String> = Vec::new();
        for name in self.services() {
            let CommandLine { program, options } = self.program(name, &self.injections(name));
            let output = Command::new(&program)
                .args(options)
                .arg("--check")
                .stdin(Stdio::null())
                .output()
                .map_err(|cause| LauncherError::file(program, cause))?;
            if !output.status.success() {
                let mut problem = String::from_utf8_lossy(&output.stderr).trim().to_owned();
                if problem.is_empty() {
                    problem = format!("{} --check: {}", name.as_str(), output.status);
                }
                if !problems.contains(&problem) {
                    problems.push(problem);
                }
            }
        }
        if problems.is_empty() {
            return Ok(());
        }
        Err(LauncherError::Refused(problems))
    }

    /// Options that say what a service is to record of its cycles.
    fn recording(&self, name: ServiceName, report: &Path) -> Vec<String> {
        let mut options = vec!["--report".into(), report.display().to_string()];
        if self.options.no_timing {
            options.push("--no-timing".into());
        }
        if let Some(folder) = &self.options.stamps {
            let cycles = self.options.stamped_cycles;
            let file = folder.join(format!("{}.stamps", name.as_str()));
            options.extend(["--stamps".into(), file.display().to_string()]);
            options.extend(["--stamped-cycles".into(), cycles.to_string()]);
        }
        options
    }

    /// That nobody else takes datagrams at this graph's address.
    ///
    /// # Errors
    /// What to say.
    pub fn check_address(&self) -> Result<(), String> {
        let sensor = &self.setup.file.sensor;
        let (Source::Socket, Ok(Some(address))) = (sensor.source, sensor.socket.udp_address())
        else {
            return Ok(());
        };
        let told = |error| format!("udp {address}: {error}; another address: --socket");
        UdpSocket::bind(address).map(|_| ()).map_err(told)
    }

    /// When a service is given up.
    pub fn restart_policy(&self) -> RestartPolicy {
        let settings = &self.setup.file.restart;
        RestartPolicy {
            max_restarts: settings.max_restarts as usize,
            window: Duration::from_secs_f64(settings.window_s),
            delay: Duration::from_secs_f64(settings.delay_ms * 1e-3),
        }
    }

    /// True if a first action must come back within the start-up limit; a sensor outside may
    /// take its time.
    pub fn waits_for_ready(&self) -> bool {
        !self.setup.file.sensor.source.is_outside()
    }

    /// False for a source that could only begin its recording again.
    pub fn can_resume(&self, service: ServiceName) -> bool {
        service != ServiceName::SensorSim || self.setup.file.sensor.source != Source::Playback
    }

    /// Keeps the cores of the services awake until the result is dropped.
    pub fn keep_awake(&self) -> Result<KeepAwake, LauncherError> {
        let cores = self.services().map(|name| self.setup.service(name).core);
        KeepAwake::start(cores).map_err(LauncherError::KeepAwake)
    }

    /// The services to start: not sensor-sim when the sensor is external.
    pub fn services(&self) -> impl Iterator<Item = ServiceName> {
        let external = self.setup.file.sensor.source == Source::External;
        ServiceName::ALL
            .into_iter()
            .filter(move |&service| !(external && service == ServiceName::SensorSim))
    }

    /// Command that starts a service, which leaves its report there.
    pub fn command(&self, name: ServiceName, report: &Path) -> CommandLine {
        let mut command = self.program(name, &self.injections(name));
        command.options.extend(self.recording(name, report));
        command
    }

    /// Command that starts a service in place of one that has died, in the middle of a `drive`.
    pub fn command_again(
        &self,
        name: ServiceName,
        report: &Path,
        drive: Option<&DriveProgress>,
    ) -> CommandLine {
        let (ServiceName::SensorSim, Some(drive)) = (name, drive) else {
            return self.command(name, report);
        };
        let mut command = self.program(name, &self.injections_after(drive));
        let began = ["--began-ns".into(), drive.began_ns.to_string()];
        command.options.extend(began);
        command.options.extend(self.recording(name, report));
        command
    }

    /// What is to be broken from the start on; only the simulator can be.
    fn injections(&self, name: ServiceName) -> Vec<String> {
        match name {
            ServiceName::SensorSim => self.options.inject.clone(),
            _ => Vec::new(),
        }
    }

    /// What is still to come after this part of a drive, and what it has changed so far.
    fn injections_after(&self, drive: &DriveProgress) -> Vec<String> {
        let parse = |spec: &String| Injection::parse(spec, &self.setup.robot).ok();
        // What was due just now may not be among the changes yet.
        let is_to_come = |spec: &&String| {
            parse(spec).is_some_and(|injection| {
                let is_same = |done: Injection| {
                    done.change == injection.change
                        && (done.at_s - injection.at_s).abs() < UNREPORTED_S
                };
                injection.at_s > drive.t_s - UNREPORTED_S
                    && !drive.changes.iter().filter_map(parse).any(is_same)
            })
        };
        let to_come = self.options.inject.iter().filter(is_to_come);
        to_come.chain(&drive.changes).cloned().collect()
    }

    fn program(&self, name: ServiceName, injections: &[String]) -> CommandLine {
        let program = format!("vigil-{}", name.as_str());
        let document = self.document.path().display().to_string();
        let mut options = vec!["--setup".into(), document];
        for spec in injections {
            options.extend(["--inject".into(), spec.clone()]);
        }
        CommandLine {
            program: self.programs.join(program),
            options,
        }
    }
}

/// Rate at which recorded frames are played: their own, times the speed.
fn playback_rate_hz(setup: &Setup) -> Result<f64, LauncherError> {
    let sensor = &setup.file.sensor;
    let path = setup.resolve(sensor.frames.as_deref().unwrap_or_default());
    let runs = frames::read(&path, &setup.robot)?;
    frames::playback_rate_hz(&runs, sensor.speed.unwrap_or(1.0))
        .map_err(|reason| LauncherError::PlaybackRate { path, reason })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use clap::Parser;

    /// A plan of the rover's graph with these options.
    pub(crate) fn plan(options: &[&str]) -> Result<Plan, LauncherError> {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let config = format!("{root}/config/rover.toml");
        let line = ["vigil run", "--config", &config];
        Plan::read(&LauncherArgs::parse_from(line.iter().chain(options)))
    }

    /// The options of a command but for `--setup` and its file.
    fn options(command: CommandLine) -> String {
        command.options[2..].join(" ")
    }

    #[test]
    fn only_the_simulator_gets_injections_and_every_service_leaves_a_report() {
        let options_of = |plan: &Plan, name| options(plan.command(name, Path::new("r")));
        let plan = plan(&["--inject", "stuck:RM@5"]).unwrap();
        let simulator = options_of(&plan, ServiceName::SensorSim);
        assert_eq!(simulator, "--inject stuck:RM@5 --report r");
        let detector = options_of(&plan, ServiceName::Detector);
        assert_eq!(detector, "--report r");
        let program = plan.command(ServiceName::Detector, Path::new("r")).program;
        assert!(program.ends_with("vigil-detector"), "{program:?}");
    }

    #[test]
    fn what_services_are_to_record_is_in_their_options() {
        let plan = plan(&["--stamps", "/d", "--stamped-cycles", "9", "--no-timing"]).unwrap();
        assert_eq!(
            options(plan.command(ServiceName::Supervisor, Path::new("r"))),
            "--report r --no-timing --stamps /d/supervisor.stamps --stamped-cycles 9"
        );
    }

    #[test]
    fn a_simulator_that_is_restarted_breaks_what_was_broken_and_what_is_to_come() {
        let specs = ["--inject", "stuck:RM@5", "--inject", "clear:RM@9"];
        let plan = plan(&specs).unwrap();
        let again = |t_s, changes: &[&str]| {
            let drive = DriveProgress {
                began_ns: 7,
                t_s,
                changes: changes.iter().map(|c| (*c).to_owned()).collect(),
            };
            let report = Path::new("r");
            options(plan.command_again(ServiceName::SensorSim, report, Some(&drive)))
        };
        let rest = "--began-ns 7 --report r";
        let early = "--inject stuck:RM@5 --inject clear:RM@9";
        assert_eq!(again(4.0, &[]), format!("{early} {rest}"));
        let broken = "--inject clear:RM@9 --inject stuck:RM@5.02";
        assert_eq!(again(5.1, &["stuck:RM@5.02"]), format!("{broken} {rest}"));
        // It died before it could report the change that was due.
        assert_eq!(again(5.1, &[]), format!("{early} {rest}"));
        let detector = plan.command_again(ServiceName::Detector, Path::new("r"), None);
        assert_eq!(options(detector), "--report r");
    }

    #[test]
    fn the_cores_of_the_services_can_be_kept_awake() {
        let mut plan = plan(&[]).unwrap();
        assert!(plan.keep_awake().is_ok());
        plan.setup.file.services.detector.core = 100_000;
        let refusal = plan.keep_awake().err().unwrap().to_string();
        assert_eq!(refusal, "--keep-awake: core 100000 is not permitted");
    }

    #[test]
    fn a_graph_with_a_sensor_outside_starts_three_services_and_waits_for_nobody() {
        let simulated = plan(&[]).unwrap();
        assert_eq!(simulated.services().count(), 4);
        assert!(simulated.waits_for_ready());
        let external = plan(&["--source", "external"]).unwrap();
        assert_eq!(external.services().next(), Some(ServiceName::Detector));
        assert!(!external.waits_for_ready());
        assert!(external.can_resume(ServiceName::SensorSim));
    }

    #[test]
    fn the_configuration_says_when_a_service_is_given_up() {
        let expected = RestartPolicy {
            max_restarts: 3,
            window: Duration::from_secs(60),
            delay: Duration::from_millis(20),
        };
        assert_eq!(plan(&[]).unwrap().restart_policy(), expected);
    }

    #[test]
    fn options_that_do_not_fit_are_refused_with_what_is_allowed() {
        let refusal = |options: &[&str]| plan(options).err().unwrap().to_string();
        let external = ["--source", "external", "--inject", "stuck:RM@5"];
        assert!(refusal(&external).contains("only the simulator"));
        let recording = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../tests/data/rover/healthy_frames.csv.gz"
        );
        let replay = ["--replay", recording, "--rate", "10"];
        assert!(refusal(&replay).contains("--speed"));
        assert!(refusal(&["--replay", "none.csv"]).contains("none.csv"));
    }
}
