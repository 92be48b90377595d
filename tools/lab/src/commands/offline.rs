//! Options and files that the offline commands share.

use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;
use schemars::JsonSchema;
use serde::de::IntoDeserializer;
use serde::de::value::{Error as Refused, StrDeserializer};
use serde::{Deserialize, Serialize};
use vigil_decision::{Compensation, Recovery, RecoveryAction, Supervisor, SupervisorError};
use vigil_diagnosis::Sensors;
use vigil_diagnosis::detect::{self, Detector, Form};
use vigil_diagnosis::identify::{
    self, ChannelIdentifier, Diagnoser, Identifier, IdentifierFilter, Models, PARTICLES_MAX,
    PARTICLES_MIN,
};
use vigil_evaluation::scoring::{Taxonomy, Verdict};
use vigil_evaluation::stages::{Stages, Vocabulary};
use vigil_learning::data_hash;
use vigil_pomdp::Pomdp;
use vigil_recording::frames::{self, Run};
use vigil_robot::FaultTree;
use vigil_robot::{Description, RobotModel, channel_model};
use vigil_setup::{load_decision, load_robot, load_tree, state_risks};

use vigil_terminal::CommandError;

/// Decision model of a robot with faults unless another is given.
const DECISION: &str = "config/rover.pomdp";

/// Misses in a row without any detection after which no belief is usable. Recorded frames have no
/// deadlines, so none is ever missed.
const BLIND_MISSES: u32 = 1;

/// How rare false alarms shall be.
#[derive(Debug, clap::Args)]
pub struct IntervalArgs {
    /// Mean time between false alarms, h, for which a model is judged.
    #[arg(
        long,
        value_name = "H",
        value_parser = hours,
        default_value_t = detect::Settings::default().false_alarm_interval_h
    )]
    pub false_alarm_interval: f64,
}

/// A time, h.
fn hours(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("allowed is a number above 0".to_owned()),
    }
}

/// Sets of channels, as `--sensors` names them.
pub const SENSOR_SETS: [&str; 3] = ["pose", "pose+encoders", "all"];

/// Which robot.
#[derive(Debug, clap::Args)]
pub struct RobotArgs {
    /// Description of the robot (TOML).
    #[arg(long, value_name = "FILE", default_value = "config/robots/rover.toml")]
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
    #[arg(long, value_name = "FILE")]
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
    #[command(flatten)]
    interval: IntervalArgs,
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
    /// Fault tree (TOML); that of a model of channels follows from the description.
    #[arg(long, value_name = "FILE", default_value = "config/trees/rover.toml")]
    tree: PathBuf,
    /// Decision model (`.pomdp`) that chooses the action of each row [default: config/rover.pomdp].
    /// A model without faults chooses none.
    #[arg(long, value_name = "FILE")]
    decision: Option<PathBuf>,
}

/// What was used, for the record.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FilterSettings {
    /// Hash of the learned model.
    pub model_hash: String,
    /// Hash of the fault tree.
    pub tree_hash: String,
    /// Set of channels: `pose` or `pose+encoders`.
    pub sensors: String,
    /// Form of the detection filter.
    pub detector: String,
    /// Identification filter; `channels` on a model of channels.
    pub identifier: String,
    /// Most hypotheses of the identification filter, or its particles.
    pub particles: u32,
    /// Seed of the filters.
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
    /// Sides and types of its faults.
    pub taxonomy: Taxonomy,
    /// Chooses the action of each row; none without faults.
    decision: Option<Pomdp>,
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
            RobotModel::Channels(_) => {
                channel_model::tree::tree(&robot).map_err(CommandError::usage)?
            }
        };
        let identifier = match &model {
            RobotModel::Faults(_) => self.identifier.to_string(),
            RobotModel::Channels(_) if self.identifier == IdentifierFilter::default() => {
                "channels".to_owned()
            }
            RobotModel::Channels(_) => return Err(self.names_nothing("--identifier")),
        };
        let identify::Settings { p_unknown, .. } = identify::Settings::default();
        let mut models = OfflineModels {
            taxonomy: Taxonomy::new(&tree, &robot).with_prior_unknown(p_unknown),
            decision: self.decision(&model)?,
            runs: frames::read(&self.frames, &robot).map_err(CommandError::usage)?,
            used: FilterSettings {
                model_hash: format!("{:016x}", model.hash()),
                tree_hash: format!("{:016x}", tree.hash()),
                sensors: self.sensors.clone(),
                detector: self.detector.to_string(),
                identifier,
                particles: 0,
                seed: self.seed,
            },
            robot,
            model,
            tree,
        };
        let initial = self.initial(&models, &self.sensors, self.identifier)?;
        models.used.particles = initial.identifier.particles();
        Ok(models)
    }

    /// Refuses an option that is about the rover's filters, on a model of channels.
    pub fn names_nothing(&self, option: &str) -> CommandError {
        CommandError::usage(format!(
            "{option}: {} is a model of channels, which has one filter of its own; leave it out",
            self.model.display()
        ))
    }

    /// Sets of channels for which `model` has an alarm with the form of detection asked for.
    pub fn sets(&self, model: &RobotModel) -> Vec<&'static str> {
        let has = |set: &&str| {
            let channels = channels(set).into();
            let form = self.detector.calibrated();
            // Without one, all that it reads are declared: pose and encoders.
            form.map_or(*set != "all", |form| {
                model.calibration(channels, form).is_ok()
            })
        };
        // Few frames hold everything: this set is one for which one asks.
        let asked = |set: &&str| *set != "all" || self.sensors == "all";
        SENSOR_SETS.into_iter().filter(asked).filter(has).collect()
    }

    /// The stages before any run, with the settings given but for channels and filter.
    pub fn initial<'a>(
        &'a self,
        of: &'a OfflineModels,
        sensors: &str,
        filter: IdentifierFilter,
    ) -> Result<InitialStages<'a>, CommandError> {
        let (robot, tree) = (&of.robot, &of.tree);
        let settings = detect::Settings {
            sensors: channels(sensors),
            form: self.detector,
            false_alarm_interval_h: self.interval.false_alarm_interval,
            ..detect::Settings::default()
        };
        let refuse = |error: &dyn std::fmt::Display| {
            CommandError::usage(format!("{}: {error}", self.model.display()))
        };
        let (detector, identifier) = match &of.model {
            RobotModel::Channels(model) => {
                let detector = Detector::of_channels(model, robot, &settings);
                let detector = detector.map_err(|e| refuse(&e))?;
                let used = (settings.sensors, settings.fault_rate_1_h);
                let identifier = ChannelIdentifier::new(model, robot, tree, used);
                let identifier = identifier.map_err(|e| refuse(&e))?;
                (Ok(detector), Diagnoser::from(identifier))
            }
            RobotModel::Faults(model) => {
                let is_asked = filter == IdentifierFilter::RiskSensitive;
                let decision = of.decision.as_ref().filter(|_| is_asked);
                let risks = decision.map(state_risks).transpose();
                let risks = risks.map_err(|e| refuse(&format!("risks: {e}")))?;
                let models = Models {
                    model,
                    robot,
                    tree,
                    risks: risks.as_ref(),
                };
                let identifier = identify::Settings {
                    filter,
                    particles: self.particles.map(usize::from),
                    ..identify::Settings::default()
                };
                let identifier = Identifier::new(&models, &identifier, settings.sensors, self.seed);
                (
                    Detector::new(model, robot, &settings),
                    Diagnoser::from(identifier.map_err(|e| refuse(&e))?),
                )
            }
        };
        // That it can be built is asked before any run.
        self.supervisor(of)?;
        Ok(InitialStages {
            args: self,
            models: of,
            detector: detector.map_err(|e| refuse(&e))?,
            identifier,
        })
    }

    /// What a page says of its origin.
    pub fn facts(&self, of: &OfflineModels) -> Vec<(&'static str, String)> {
        let words: Vec<String> = std::env::args_os()
            .map(|word| word.to_string_lossy().into_owned())
            .collect();
        let used = &of.used;
        let settings = format!(
            "detector {}, identifier {}, {} particles, seed {}",
            used.detector, used.identifier, used.particles, used.seed
        );
        let (model, frames) = (self.model.display(), self.frames.display());
        let all: Vec<&Run> = of.runs.iter().collect();
        let data = data_hash(&all, f64::INFINITY, &[]);
        vec![
            ("command", words.join(" ")),
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("model", format!("{model}, hash {}", used.model_hash)),
            ("learned from", of.model.provenance().data_hash.clone()),
            ("frames", format!("{frames}, {data}")),
            ("fault tree", format!("hash {}", used.tree_hash)),
            ("settings", settings),
        ]
    }

    /// The decision model given, or the rover's for a model with faults, if it is there.
    fn decision(&self, learned: &RobotModel) -> Result<Option<Pomdp>, CommandError> {
        let usual = Path::new(DECISION);
        let has_usual = matches!(learned, RobotModel::Faults(_)) && usual.is_file();
        let path = self.decision.as_deref().or(has_usual.then_some(usual));
        let decision = path.map(load_decision).transpose();
        decision.map_err(CommandError::usage)
    }

    /// The supervisor of a decision model. One that was not asked for and does not fit this robot
    /// is left out: another robot than the rover has its own.
    fn supervisor(&self, of: &OfflineModels) -> Result<Option<Supervisor>, CommandError> {
        let Some(decision) = &of.decision else {
            return Ok(None);
        };
        match (supervisor(decision, of), &self.decision) {
            (Ok(supervisor), _) => Ok(Some(supervisor)),
            (Err(_), None) => Ok(None),
            (Err(error), Some(path)) => {
                let message = format!("--decision {}: {error}", path.display());
                Err(CommandError::usage(message))
            }
        }
    }
}

/// Detector and identifier as they begin every run: to build them takes far longer than to copy.
pub struct InitialStages<'a> {
    args: &'a FilterArgs,
    models: &'a OfflineModels,
    detector: Detector,
    identifier: Diagnoser,
}

impl InitialStages<'_> {
    /// Log-odds at which the detector's alarm rises, nats.
    pub const fn alarm_log_odds(&self) -> f64 {
        self.detector.alarm_log_odds()
    }

    /// The stages at the beginning of a run.
    pub fn begin(&self) -> Result<Stages, CommandError> {
        let of = self.models;
        let actions = of.decision.as_ref().map(Pomdp::actions);
        let vocabulary = Vocabulary {
            taxonomy: of.taxonomy.clone(),
            robot: of.robot.clone(),
            actions: actions.unwrap_or_default().to_vec(),
        };
        Ok(Stages::new(
            self.detector.clone(),
            self.identifier.clone(),
            self.args.supervisor(of)?,
            vocabulary,
        ))
    }

    /// What is reported of each frame of a run.
    pub fn verdicts(&self, run: &Run) -> Result<Vec<Verdict>, CommandError> {
        let mut stages = self.begin()?;
        let verdicts = run.frames.iter().map(|frame| {
            stages.take(frame);
            stages.verdict(frame)
        });
        Ok(verdicts.collect())
    }
}

/// For a decision model whose states are the leaves of the tree and whose actions have the names of
/// what they make the robot do (`go_on`, `slow_down`, `compensate`, ...).
fn supervisor(decision: &Pomdp, of: &OfflineModels) -> Result<Supervisor, SupervisorError> {
    let named = |name: &String| {
        let word: StrDeserializer<'_, Refused> = name.as_str().into_deserializer();
        let action = RecoveryAction {
            kind: Recovery::deserialize(word).ok()?,
            speed_scale: None,
            has_end: None,
            epoch_ms: None,
        };
        Some((name.clone(), action))
    };
    let settings = vigil_decision::Settings {
        actions: decision.actions().iter().filter_map(named).collect(),
        ..vigil_decision::Settings::default()
    };
    let compensation = (0..of.robot.wheels.len()).map(|wheel| {
        let (curvature_gain, curvature_offset_1_m) = of.model.compensation(wheel);
        Compensation {
            wheel,
            curvature_gain,
            curvature_offset_1_m,
        }
    });
    Supervisor::new(
        decision.clone(),
        None,
        &of.tree,
        &of.robot,
        &settings,
        compensation.collect(),
        BLIND_MISSES,
    )
}

fn channels(set: &str) -> Sensors {
    match set {
        "pose" => Sensors::Pose,
        "all" => Sensors::All,
        _ => Sensors::PoseEncoders,
    }
}

/// Reads a learned model of either kind.
pub fn load_model(path: &Path) -> Result<RobotModel, CommandError> {
    let refuse =
        |error: &dyn std::fmt::Display| CommandError::usage(format!("{}: {error}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| refuse(&error))?;
    RobotModel::from_toml(&text).map_err(|error| refuse(&error))
}
