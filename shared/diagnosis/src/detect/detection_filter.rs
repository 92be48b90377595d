//! Observer and detection filter: of the rover's model, or of a model of channels.

use vigil_blocks::SensorFrame;
use vigil_checkpoint::Checkpoint;
use vigil_robot::channel_model::context_change::ChangeWatch;
use vigil_robot::learned::monitor::DetectionOutput;
use vigil_robot::learned::{FrameOutcome, Healthy, Monitor, NoiseScales, Observation, Observer};
use vigil_robot::{channel_model, declared};

/// The interval of an observation: what the detector must know of it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Interval {
    /// When it ended, ns.
    pub t_ns: u64,
    /// Its length, s.
    pub dt_s: f64,
    /// True if the robot was moving.
    pub moving: bool,
}

impl From<&Observation> for Interval {
    fn from(observation: &Observation) -> Self {
        Self {
            t_ns: observation.t_ns,
            dt_s: observation.dt_s,
            moving: observation.moving,
        }
    }
}

/// Observer and detection filter of either model. The models share no observation, so that no
/// trait covers both.
#[derive(Debug, Clone, Checkpoint)]
pub(crate) enum DetectionFilter {
    /// Of a model with faults: tracks the pose.
    Faults {
        /// Frames to observations.
        observer: Box<Observer>,
        /// Detection filter.
        monitor: Box<Monitor>,
    },
    /// Of a model with faults, against a declared null.
    Declared {
        /// Frames to observations.
        observer: Box<Observer>,
        /// Tracks the pose and the noise, from which a diagnosis begins. Its evidence is not used.
        tracking: Box<Monitor>,
        /// E-detectors.
        monitor: Box<declared::Monitor>,
    },
    /// Of a model of channels.
    Channels {
        /// Frames to observations.
        observer: Box<channel_model::Observer>,
        /// Detection filter.
        monitor: Box<channel_model::Monitor>,
    },
}

impl DetectionFilter {
    /// Takes a frame.
    pub fn push(&mut self, frame: &SensorFrame) -> FrameOutcome {
        match self {
            Self::Faults { observer, .. } | Self::Declared { observer, .. } => observer.push(frame),
            Self::Channels { observer, .. } => observer.push(frame),
        }
    }

    /// Takes the observation that the last frame completed.
    pub fn step(&mut self, suspected: bool) -> Interval {
        match self {
            Self::Faults { observer, monitor } => {
                observer.suspect(suspected);
                let observation = observer.observation();
                monitor.step(observation, observer.further(), suspected);
                observation.into()
            }
            Self::Declared {
                observer,
                tracking,
                monitor,
            } => {
                observer.suspect(suspected);
                let observation = observer.observation();
                tracking.step(observation, observer.further(), suspected);
                monitor.step(observation, suspected);
                observation.into()
            }
            Self::Channels { observer, monitor } => {
                monitor.step(observer.history(), observer.orders());
                // A complete observation is the newest of the history.
                let newest = observer.history().ago(0);
                newest.map_or_else(Interval::default, |now| Interval {
                    t_ns: now.t_ns,
                    dt_s: now.dt_s,
                    moving: now.moving,
                })
            }
        }
    }

    /// The next frame begins a new run.
    pub fn reset_observer(&mut self) {
        match self {
            Self::Faults { observer, .. } | Self::Declared { observer, .. } => observer.reset(),
            Self::Channels { observer, .. } => observer.reset(),
        }
    }

    /// Forgets the run.
    pub fn reset(&mut self) {
        match self {
            Self::Faults { monitor, .. } => monitor.reset(),
            Self::Declared {
                tracking, monitor, ..
            } => {
                tracking.reset();
                monitor.reset();
            }
            Self::Channels { monitor, .. } => monitor.reset(),
        }
    }

    /// Forgets what speaks for a fault.
    pub fn forget_evidence(&mut self) {
        match self {
            Self::Faults { monitor, .. } => monitor.forget_evidence(),
            Self::Declared {
                tracking, monitor, ..
            } => {
                tracking.forget_evidence();
                monitor.forget_evidence();
            }
            // Its evidence is that of the last seconds.
            Self::Channels { .. } => {}
        }
    }

    /// True if the evidence is that of the last seconds, and so ends by itself.
    pub const fn is_windowed(&self) -> bool {
        matches!(self, Self::Channels { .. })
    }

    /// True once evidence counts.
    pub fn is_ready(&self) -> bool {
        match self {
            Self::Faults { monitor, .. } => monitor.is_ready(),
            Self::Declared { monitor, .. } => monitor.is_ready(),
            Self::Channels { monitor, .. } => monitor.is_ready(),
        }
    }

    /// What the last observation did.
    pub fn report(&self) -> &DetectionOutput {
        match self {
            Self::Faults { monitor, .. } => monitor.report(),
            Self::Declared { monitor, .. } => monitor.report(),
            Self::Channels { monitor, .. } => monitor.report(),
        }
    }

    /// Changes that are no fault, which a model of channels tells.
    pub fn changes(&self) -> Option<&ChangeWatch> {
        match self {
            Self::Channels { monitor, .. } => Some(monitor.changes()),
            Self::Faults { .. } | Self::Declared { .. } => None,
        }
    }

    /// How noisy the sensors are; a model of channels does not explain noise away.
    pub fn scales(&self) -> NoiseScales {
        match self {
            Self::Faults { monitor, .. } => monitor.noise().scales(),
            Self::Declared { tracking, .. } => tracking.noise().scales(),
            Self::Channels { .. } => NoiseScales::default(),
        }
    }

    /// What is believed of the robot as long as it is healthy, where its pose is tracked.
    pub fn healthy(&self) -> Option<Healthy> {
        match self {
            Self::Faults { monitor, .. } => monitor.healthy(),
            Self::Declared { tracking, .. } => tracking.healthy(),
            Self::Channels { .. } => None,
        }
    }
}
