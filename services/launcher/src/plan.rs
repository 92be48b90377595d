//! What is to be started: options, configuration and every model, checked before anything starts.

use std::path::PathBuf;

use vigil_cycle::topic::ServiceName;
use vigil_decision::Pomdp;
use vigil_evaluation::frames;
use vigil_robot::Injection;
use vigil_robot::learned::Model;
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
    /// Names of the decision model's actions.
    pub action_names: Vec<String>,
    /// Options for every service.
    options: Vec<String>,
    inject: Vec<String>,
}

impl Plan {
    /// Reads and checks everything that the services will read.
    pub fn new(args: &LauncherArgs) -> Result<Self, Box<dyn std::error::Error>> {
        let mut graph = args.graph.clone();
        if let (Some(recording), None) = (&graph.replay, graph.rate) {
            // A recording has its own rate; the deadlines follow it.
            let robot = vigil_setup::load_robot(&graph.load()?.robot_path)?;
            let interval_s = frames::interval_s(recording, &robot)?;
            graph.rate = Some(graph.speed.unwrap_or(1.0) / interval_s);
        }
        let setup = graph.load()?;
        if args.duration.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
            return Err("--duration: allowed is any number of seconds above 0".into());
        }
        Model::from_toml(&setup.model_text)
            .map_err(|e| format!("{}: {e}", setup.model_path.display()))?;
        let decision = Pomdp::parse(&setup.decision_text)
            .map_err(|e| format!("{}: {e}", setup.decision_path.display()))?;
        let action_names = decision.actions().to_vec();
        if !args.inject.is_empty() {
            check_injections(&args.inject, &setup)?;
        }
        Ok(Self {
            options: graph.to_command_line(),
            setup,
            action_names,
            inject: args.inject.clone(),
        })
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

    /// Program and arguments of a service.
    pub fn command(&self, name: ServiceName, report: PathBuf) -> (PathBuf, Vec<String>) {
        let program = format!("vigil-{}", name.as_str());
        let beside = std::env::current_exe()
            .unwrap_or_default()
            .with_file_name(program);
        let mut line = self.options.clone();
        line.extend(["--report".to_owned(), report.display().to_string()]);
        if name == ServiceName::SensorSim {
            for spec in &self.inject {
                line.extend(["--inject".to_owned(), spec.clone()]);
            }
        }
        (beside, line)
    }
}

fn check_injections(specs: &[String], setup: &Setup) -> Result<(), Box<dyn std::error::Error>> {
    if setup.file.sensor.source != Source::Simulator {
        return Err("--inject: only the simulator can be broken; the source is another".into());
    }
    if !setup.file.control.allow_injection {
        let path = setup.path.display();
        return Err(
            format!("{path}: control.allow_injection is false: --inject is refused").into(),
        );
    }
    for spec in specs {
        Injection::parse(spec, &setup.robot).map_err(|e| format!("--inject {spec}: {e}"))?;
    }
    Ok(())
}
