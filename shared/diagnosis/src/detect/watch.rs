//! What the detector watches with: a model with faults, or one of nominal behaviour alone.

use vigil_blocks::SensorFrame;
use vigil_robot::learned::monitor::DetectionOutput;
use vigil_robot::learned::{FrameOutcome, Healthy, Monitor, NoiseScales, Observer};
use vigil_robot::nominal;

/// What the detector must know of an observation.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct DetectorInput {
    /// When it ended, ns.
    pub t_ns: u64,
    /// Its length, s.
    pub dt_s: f64,
    /// True if the robot was moving.
    pub moving: bool,
}

/// Observer and monitor of either kind.
#[derive(Debug, Clone)]
pub(crate) enum Watch {
    /// Of a model with faults: tracks the pose.
    Faults {
        /// Frames to observations.
        observer: Box<Observer>,
        /// Detection filter.
        monitor: Box<Monitor>,
    },
    /// Of a nominal model.
    Nominal {
        /// Frames to observations.
        observer: Box<nominal::Observer>,
        /// Detection filter.
        monitor: Box<nominal::Monitor>,
        /// The last observation.
        last: DetectorInput,
    },
}

impl Watch {
    /// Takes a frame.
    pub fn push(&mut self, frame: &SensorFrame) -> FrameOutcome {
        match self {
            Self::Faults { observer, .. } => observer.push(frame),
            Self::Nominal { observer, .. } => observer.push(frame),
        }
    }

    /// Takes the observation that the last frame completed.
    pub fn step(&mut self, suspected: bool) -> DetectorInput {
        match self {
            Self::Faults { observer, monitor } => {
                observer.suspect(suspected);
                let observation = observer.observation();
                monitor.step_with(observation, observer.further(), suspected);
                DetectorInput {
                    t_ns: observation.t_ns,
                    dt_s: observation.dt_s,
                    moving: observation.moving,
                }
            }
            Self::Nominal {
                observer,
                monitor,
                last,
            } => {
                monitor.step(observer.history(), suspected);
                if let Some(now) = observer.history().ago(0) {
                    *last = DetectorInput {
                        t_ns: now.t_ns,
                        dt_s: now.dt_s,
                        moving: now.moving,
                    };
                }
                *last
            }
        }
    }

    /// The next frame begins a new run.
    pub fn reset_observer(&mut self) {
        match self {
            Self::Faults { observer, .. } => observer.reset(),
            Self::Nominal { observer, .. } => observer.reset(),
        }
    }

    /// Forgets the run.
    pub fn reset(&mut self) {
        match self {
            Self::Faults { monitor, .. } => monitor.reset(),
            Self::Nominal { monitor, .. } => monitor.reset(),
        }
    }

    /// Forgets what speaks for a fault.
    pub fn forget_evidence(&mut self) {
        match self {
            Self::Faults { monitor, .. } => monitor.forget_evidence(),
            Self::Nominal { monitor, .. } => monitor.forget_evidence(),
        }
    }

    /// True once evidence counts.
    pub fn is_ready(&self) -> bool {
        match self {
            Self::Faults { monitor, .. } => monitor.is_ready(),
            Self::Nominal { monitor, .. } => monitor.is_ready(),
        }
    }

    /// What the last observation did.
    pub fn report(&self) -> &DetectionOutput {
        match self {
            Self::Faults { monitor, .. } => monitor.report(),
            Self::Nominal { monitor, .. } => monitor.report(),
        }
    }

    /// How noisy the sensors are; a nominal model does not explain noise away.
    pub fn scales(&self) -> NoiseScales {
        match self {
            Self::Faults { monitor, .. } => monitor.noise().scales(),
            Self::Nominal { .. } => NoiseScales::default(),
        }
    }

    /// What is believed of the robot as long as it is healthy, where its pose is tracked.
    pub fn healthy(&self) -> Option<Healthy> {
        match self {
            Self::Faults { monitor, .. } => monitor.healthy(),
            Self::Nominal { .. } => None,
        }
    }
}
