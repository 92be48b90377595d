//! Names of the graph's topics.

/// A topic of the graph, under `vigil/<graph>/`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Topic {
    /// Sensor frames.
    Sensor,
    /// The detector's belief.
    Detection,
    /// The detector's particles.
    DetectionParticles,
    /// The identifier's belief.
    Diagnosis,
    /// The identifier's particles.
    DiagnosisParticles,
    /// The life of faults.
    Faults,
    /// The supervisor's action.
    Action,
    /// What is true of a simulated robot.
    Truth,
    /// Health of a service.
    Health(ServiceName),
    /// Commands to a service.
    Control(ServiceName),
    /// What a service's step took, in order.
    Journal(ServiceName),
    /// The state of a service's step, now and then.
    Checkpoint(ServiceName),
}

/// The services of the graph, in the order of the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ServiceName {
    /// The sensor source.
    SensorSim,
    /// The detector.
    Detector,
    /// The identifier.
    Identifier,
    /// The supervisor.
    Supervisor,
}

impl ServiceName {
    /// All services.
    pub const ALL: [Self; 4] = [
        Self::SensorSim,
        Self::Detector,
        Self::Identifier,
        Self::Supervisor,
    ];

    /// Those that work in steps, and keep a journal of them.
    pub const STEPPING: [Self; 3] = [Self::Detector, Self::Identifier, Self::Supervisor];

    /// Name, as in topics, configuration and reports.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::SensorSim => "sensor-sim",
            Self::Detector => "detector",
            Self::Identifier => "identifier",
            Self::Supervisor => "supervisor",
        }
    }

    /// Position in [`Self::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        match self {
            Self::SensorSim => 0,
            Self::Detector => 1,
            Self::Identifier => 2,
            Self::Supervisor => 3,
        }
    }
}

impl Topic {
    /// Every topic on which something is published.
    pub const ALL: [Self; 20] = [
        Self::Sensor,
        Self::Detection,
        Self::DetectionParticles,
        Self::Diagnosis,
        Self::DiagnosisParticles,
        Self::Faults,
        Self::Action,
        Self::Truth,
        Self::Health(ServiceName::SensorSim),
        Self::Health(ServiceName::Detector),
        Self::Health(ServiceName::Identifier),
        Self::Health(ServiceName::Supervisor),
        Self::Control(ServiceName::SensorSim),
        Self::Control(ServiceName::Supervisor),
        Self::Journal(ServiceName::Detector),
        Self::Journal(ServiceName::Identifier),
        Self::Journal(ServiceName::Supervisor),
        Self::Checkpoint(ServiceName::Detector),
        Self::Checkpoint(ServiceName::Identifier),
        Self::Checkpoint(ServiceName::Supervisor),
    ];

    /// Name within its graph.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Sensor => "sensor".to_owned(),
            Self::Detection => "detection".to_owned(),
            Self::DetectionParticles => "detection/particles".to_owned(),
            Self::Diagnosis => "diagnosis".to_owned(),
            Self::DiagnosisParticles => "diagnosis/particles".to_owned(),
            Self::Faults => "faults".to_owned(),
            Self::Action => "action".to_owned(),
            Self::Truth => "truth".to_owned(),
            Self::Health(service) => format!("health/{}", service.as_str()),
            Self::Control(service) => format!("control/{}", service.as_str()),
            Self::Journal(service) => format!("journal/{}", service.as_str()),
            Self::Checkpoint(service) => format!("checkpoint/{}", service.as_str()),
        }
    }

    /// Full name of the topic in `graph`.
    #[must_use]
    pub fn path(self, graph: &str) -> String {
        format!("vigil/{graph}/{}", self.name())
    }
}
