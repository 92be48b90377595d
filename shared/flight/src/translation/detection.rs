//! What the detector believes, as curves.

use vigil_blocks::{DetectionBelief, Evidence};
use vigil_robot::Description;
use vigil_robot::channel::{channels, evidence_name};

use crate::message_times::MessageTimes;
use crate::messages::joint_state::JointState;
use crate::sink::Sink;
use crate::topics;

/// What is said of the robot as a whole, in the order of [`whole`].
const NAMES: [&str; 9] = [
    "p_fault",
    "log_odds",
    "alarm_log_odds",
    "evidence",
    "alarm",
    "alarm_count",
    "symptoms",
    "blind",
    "readiness",
];

fn whole(belief: &DetectionBelief) -> [f64; NAMES.len()] {
    [
        belief.p_fault,
        belief.log_odds,
        belief.alarm_log_odds,
        belief.evidence,
        belief.alarm.into(),
        belief.alarm_count.into(),
        belief.symptoms.into(),
        belief.blind.into(),
        belief.readiness.into(),
    ]
}

/// Names of the curves.
pub(crate) struct DetectionTranslation {
    names: Vec<String>,
    /// Places of the evidence by channel.
    places: Vec<usize>,
}

impl DetectionTranslation {
    pub(crate) fn new(robot: &Description) -> Self {
        let together = [Evidence::POSE, Evidence::ANY];
        let places: Vec<usize> = (0..channels(robot).len()).chain(together).collect();
        let of_channel = |place: &usize| format!("log_odds: {}", evidence_name(robot, *place));
        let names = NAMES.map(str::to_owned).into_iter();
        Self {
            names: names.chain(places.iter().map(of_channel)).collect(),
            places,
        }
    }

    /// Writes what a belief says.
    pub(crate) fn write<S: Sink>(
        &self,
        belief: &DetectionBelief,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<(), S::Error> {
        let of_channels = self.places.iter().map(|at| belief.channel_log_odds[*at]);
        let values: Vec<f64> = whole(belief).into_iter().chain(of_channels).collect();
        let state = JointState::named(times.capture_ns, &self.names, &values);
        sink.write(&topics::DETECTION, times, &state)
    }
}
