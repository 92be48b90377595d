//! Options and files that the offline commands share.

use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;
use serde::Serialize;
use vigil_diagnosis::Sensors;
use vigil_diagnosis::detect::{self, Form};
use vigil_diagnosis::identify::{self, IdentifierFilter, Models, PARTICLES_MAX, PARTICLES_MIN};
use vigil_pomdp::Pomdp;
use vigil_recording::frames::{self, Run};
use vigil_robot::FaultTree;
use vigil_robot::tree::Node;
use vigil_robot::{Description, RobotModel};
use vigil_setup::{load_decision, load_robot, load_tree, state_risks};

use crate::pipeline::Pipeline;
use crate::recovery::Recoverer;
use vigil_terminal::CommandError;

/// Decision model of a robot with faults unless another is given.
const DECISION: &str = "config/rover.pomdp";

/// Sets of channels, as `--sensors` names them.
pub const SENSOR_SETS: [&str; 3] = ["pose", "pose+encoders", "all"];

/// Which robot.
#[derive(Debug, clap::Args)]
pub struct RobotArgs {
    /// Description of the robot (TOML).
    #[arg(long, value_name = "F", default_value = "config/robots/rover.toml")]
    robot: PathBuf,
}

impl RobotArgs {
    /// Reads the description.
    pub fn load(&self) -> Result<Description, CommandError> {
        load_robot(&self.robot).map_err(CommandError::usage)
    }
}

/// Which frames, model and filters.
#[derive(Debug, clap::Args)]
pub struct FilterArgs {
    /// Learned model (TOML, written by `vigil learn`).
    #[arg(long, value_name = "MODEL")]
    pub model: PathBuf,
    /// Recorded frames (CSV, plain or gzip), any number of runs.
    #[arg(long, value_name = "F")]
    pub frames: PathBuf,
    /// Channels that the filters may use. `pose` is pose and command; `pose+encoders` adds wheel
    /// rates and steering angles; `all` is every channel of the frames that the model knows.
    #[arg(
        long,
        default_value = "pose+encoders",
        value_parser = PossibleValuesParser::new(SENSOR_SETS)
    )]
    pub sensors: String,
    /// How the detection filter models a fault: as an unknown bias of the residual, by a constant
    /// likelihood, or by a constant likelihood over windows.
    #[arg(long, value_name = "FORM", value_enum, default_value_t)]
    detector: Form,
    /// Identification filter.
    #[arg(long, value_name = "NAME", value_enum, default_value_t)]
    pub identifier: IdentifierFilter,
    /// Particles of a sampled identification filter [default: 256]. For `multiple-hypothesis` the
    /// greatest number of hypotheses [default: all].
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u16).range(PARTICLES_MIN as i64..=PARTICLES_MAX as i64)
    )]
    particles: Option<u16>,
    /// Seed of the filters.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    robot: RobotArgs,
    /// Fault tree (TOML); a nominal model needs none.
    #[arg(long, value_name = "F", default_value = "config/trees/rover.toml")]
    tree: PathBuf,
    /// Decision model (`.pomdp`) that chooses the action of each row [default: config/rover.pomdp].
    /// A model without faults chooses none.
    #[arg(long, value_name = "F")]
    decision: Option<PathBuf>,
}

/// What was used, for the record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilterSettings {
    /// Hash of the learned model.
    pub model_hash: String,
    /// Hash of the fault tree.
    pub tree_hash: String,
    /// Channels.
    pub sensors: String,
    /// Form of the detection filter.
    pub detector: String,
    /// Identification filter; `none` on a model of nominal behaviour alone.
    pub identifier: String,
    /// Most hypotheses of the identification filter, or its particles.
    pub particles: u32,
    /// Seed.
    pub seed: u64,
}

/// Everything that a run of the filters needs, read and checked.
pub struct OfflineModels {
    /// The robot.
    pub robot: Description,
    /// The learned model.
    pub model: RobotModel,
    /// The fault tree.
    pub tree: FaultTree,
    /// Detector and identifier.
    pub pipeline: Pipeline,
    /// All runs of the frames file.
    pub runs: Vec<Run>,
    /// What was used.
    pub used: FilterSettings,
}

impl FilterArgs {
    /// Reads and checks all files and settings.
    pub fn prepare(&self) -> Result<OfflineModels, CommandError> {
        let robot = self.robot.load()?;
        let model = load_model(&self.model)?;
        let tree = match &model {
            RobotModel::Faults(_) => load_tree(&self.tree).map_err(CommandError::usage)?,
            RobotModel::Nominal(_) => nominal_tree()?,
        };
        let identifier = match &model {
            RobotModel::Faults(_) => self.identifier.to_string(),
            RobotModel::Nominal(_) if self.identifier == IdentifierFilter::default() => {
                "none".to_owned()
            }
            RobotModel::Nominal(_) => return Err(self.names_nothing("--identifier")),
        };
        let pipeline = self.pipeline(&model, &robot, &tree, &self.sensors, self.identifier)?;
        let runs = frames::read(&self.frames, &robot).map_err(CommandError::usage)?;
        let used = FilterSettings {
            model_hash: format!("{:016x}", model.hash()),
            tree_hash: format!("{:016x}", tree.hash()),
            sensors: self.sensors.clone(),
            detector: self.detector.to_string(),
            identifier,
            particles: pipeline.particles(),
            seed: self.seed,
        };
        Ok(OfflineModels {
            robot,
            model,
            tree,
            pipeline,
            runs,
            used,
        })
    }

    /// Refuses an option that is about filters that name faults, on a model that knows none.
    pub fn names_nothing(&self, option: &str) -> CommandError {
        CommandError::usage(format!(
            "{option}: {} is a model of nominal behaviour alone: there are no faults for a filter \
             to name, only fault or no fault; leave it out",
            self.model.display()
        ))
    }

    /// Sets of channels for which `model` has an alarm with the form of detection asked for.
    pub fn sets(&self, model: &RobotModel) -> Vec<&'static str> {
        let has = |set: &&str| {
            let channels = channels(set).into();
            model.calibration(channels, self.detector.into()).is_ok()
        };
        // Few frames hold everything: this set is one for which one asks.
        let asked = |set: &&str| *set != "all" || self.sensors == "all";
        SENSOR_SETS.into_iter().filter(asked).filter(has).collect()
    }

    /// Detector and identifier with the settings given, but for channels and filter.
    pub fn pipeline(
        &self,
        learned: &RobotModel,
        robot: &Description,
        tree: &FaultTree,
        sensors: &str,
        filter: IdentifierFilter,
    ) -> Result<Pipeline, CommandError> {
        let detector = detect::Settings {
            sensors: channels(sensors),
            form: self.detector,
            ..detect::Settings::default()
        };
        let refuse = |error: &dyn std::fmt::Display| {
            CommandError::usage(format!("{}: {error}", self.model.display()))
        };
        let model = match learned {
            RobotModel::Faults(model) => model,
            RobotModel::Nominal(model) => {
                let pipeline = Pipeline::nominal(model, robot, tree, &detector);
                let recoverer = self.recoverer(learned, robot, tree)?;
                return Ok(pipeline.map_err(|e| refuse(&e))?.recovering(recoverer));
            }
        };
        let identifier = identify::Settings {
            filter,
            particles: self.particles.map(usize::from),
            ..identify::Settings::default()
        };
        let needs_decision = identifier.filter == IdentifierFilter::RiskSensitive;
        let decision = match needs_decision {
            true => self.decision(learned)?,
            false => None,
        };
        let risks = decision.as_ref().map(state_risks).transpose();
        let risks = risks.map_err(|e| refuse(&format!("risks: {e}")))?;
        let models = Models {
            model,
            robot,
            tree,
            risks: risks.as_ref(),
        };
        let pipeline = Pipeline::new(&models, &detector, &identifier, self.seed);
        let recoverer = self.recoverer(learned, robot, tree)?;
        Ok(pipeline.map_err(|e| refuse(&e))?.recovering(recoverer))
    }

    /// The decision model given, or the rover's for a model with faults.
    fn decision(&self, learned: &RobotModel) -> Result<Option<Pomdp>, CommandError> {
        let usual = match learned {
            RobotModel::Faults(_) => Some(Path::new(DECISION)),
            RobotModel::Nominal(_) => None,
        };
        let path = self.decision.as_deref().or(usual);
        let decision = path.map(load_decision).transpose();
        decision.map_err(CommandError::usage)
    }

    /// The supervisor of a decision model. One that was not asked for and does not fit this robot
    /// is left out: another robot than the rover has its own.
    fn recoverer(
        &self,
        learned: &RobotModel,
        robot: &Description,
        tree: &FaultTree,
    ) -> Result<Option<Recoverer>, CommandError> {
        if self.decision.is_none() && !Path::new(DECISION).is_file() {
            return Ok(None);
        }
        let Some(decision) = self.decision(learned)? else {
            return Ok(None);
        };
        match (
            Recoverer::new(decision, tree, robot, learned),
            &self.decision,
        ) {
            (Ok(recoverer), _) => Ok(Some(recoverer)),
            (Err(_), None) => Ok(None),
            (Err(error), Some(path)) => {
                let message = format!("--decision {}: {error}", path.display());
                Err(CommandError::usage(message))
            }
        }
    }
}

fn channels(set: &str) -> Sensors {
    match set {
        "pose" => Sensors::Pose,
        "all" => Sensors::All,
        _ => Sensors::PoseEncoders,
    }
}

/// The tree of a robot whose faults nobody has modelled.
fn nominal_tree() -> Result<FaultTree, CommandError> {
    let nominal = Node {
        name: "ND".to_owned(),
        parent: None,
        fault: None,
    };
    FaultTree::new(vec![nominal]).map_err(CommandError::failure)
}

/// Reads a learned model of either kind.
pub fn load_model(path: &Path) -> Result<RobotModel, CommandError> {
    let refuse =
        |error: &dyn std::fmt::Display| CommandError::usage(format!("{}: {error}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| refuse(&error))?;
    RobotModel::from_toml(&text).map_err(|error| refuse(&error))
}
