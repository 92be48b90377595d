//! What of the frames can be used.

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::{Blindness, Rejection, SensorFrame};
use vigil_cycle::topic::ServiceName;
use vigil_robot::Description;
use vigil_robot::channel::channels;

use crate::watch::View;

/// Health of the input.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Input {
    /// Channels that the robot has, but those that frames may lack.
    pub channels: usize,
    /// Those that the newest frame has measured.
    pub valid: usize,
    /// Names of the others.
    pub missing: Vec<String>,
    /// False while the newest frame carries no command.
    pub has_command: bool,
    /// Frames refused so far, at the border of the graph and by the detector.
    pub rejected: Vec<RejectedFrames>,
    /// Why nothing can be seen; null while something is.
    pub blind: Option<&'static str>,
}

/// Refused frames of one cause.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RejectedFrames {
    /// Why.
    pub cause: &'static str,
    /// How many.
    pub count: u64,
}

impl Input {
    /// Of the newest frame.
    pub fn new(frame: &SensorFrame, robot: &Description, view: &View) -> Self {
        let all = channels(robot).into_iter().enumerate();
        let needed: Vec<_> = all.filter(|(_, channel)| !channel.is_optional).collect();
        let (channels, is_missing) = (needed.len(), |at: usize| frame.measured(at).is_none());
        let missing = needed.into_iter().filter(|(at, _)| is_missing(*at));
        let missing: Vec<String> = missing.map(|(_, channel)| channel.name).collect();
        let blind = view.detection.as_ref().map_or(0, |block| block.blind);
        Self {
            channels,
            valid: channels - missing.len(),
            missing,
            has_command: frame.command_valid != 0,
            rejected: rejected(view),
            blind: Blindness::from_repr(blind).map(Blindness::as_str),
        }
    }

    /// In a line, for people.
    pub fn text(&self) -> String {
        let (valid, channels) = (self.valid, self.channels);
        let mut parts = Vec::new();
        if let Some(cause) = self.blind {
            parts.push(format!("BLIND: {cause}"));
        }
        parts.push(format!("{valid} of {channels} channels valid"));
        if !self.missing.is_empty() {
            parts.push(format!("MISSING {}", self.missing.join(" ")));
        }
        if !self.has_command {
            parts.push("NO COMMAND".to_owned());
        }
        let cause = |it: &RejectedFrames| format!("{} {}", it.count, it.cause);
        let causes: Vec<String> = self.rejected.iter().map(cause).collect();
        parts.push(match causes.is_empty() {
            true => "none rejected".to_owned(),
            false => format!("REJECTED {}", causes.join(", ")),
        });
        parts.join("; ")
    }

    /// True if something of it cannot be used.
    pub fn is_wrong(&self) -> bool {
        self.blind.is_some() || !self.missing.is_empty() || !self.has_command
    }
}

/// A frame meets one border: the socket's, or in shared memory the detector's.
fn rejected(view: &View) -> Vec<RejectedFrames> {
    let borders = [ServiceName::SensorSim, ServiceName::Detector];
    let count = |cause: Rejection| {
        let counts = borders.iter().filter_map(|service| {
            let health = view.health[service.index()].as_ref()?;
            Some(health.rejected[cause as usize])
        });
        counts.sum::<u64>()
    };
    let causes = Rejection::ALL.iter().map(|&cause| RejectedFrames {
        cause: cause.as_str(),
        count: count(cause),
    });
    causes.filter(|it| it.count > 0).collect()
}
