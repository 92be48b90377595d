//! What tells one robot from another, by a model of its channels.

use std::fmt;

use super::component::targets;
use crate::context_table::DeclaredContext;
use crate::description::Description;
use crate::fault_table::DeclaredFault;

/// What tells one channel from another.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChannelIdentity {
    /// Its name.
    pub name: String,
    /// What it comes back to the same after, if it is an angle.
    pub period: Option<f64>,
    /// Whether its level wanders.
    pub drifts: bool,
}

/// All that a model and a description must have in common.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Identity {
    /// Of the robot.
    pub name: String,
    /// Of the command's axes.
    pub axes: Vec<String>,
    /// The channels.
    pub channels: Vec<ChannelIdentity>,
    /// Interval of observations, s.
    pub interval_s: f64,
    /// First seconds of a run that are left out.
    pub warm_up_s: f64,
    /// Declared faults.
    pub faults: Vec<DeclaredFault>,
    /// Declared contexts.
    pub contexts: Vec<DeclaredContext>,
}

impl Identity {
    /// Of a robot by its description.
    pub fn of_robot(robot: &Description) -> Self {
        let channels = targets(robot).into_iter().map(|one| ChannelIdentity {
            name: one.name,
            period: one.period,
            drifts: one.drifts,
        });
        Self {
            name: robot.name.clone(),
            axes: robot.command.iter().map(|axis| axis.name.clone()).collect(),
            channels: channels.collect(),
            interval_s: robot.interval_s,
            warm_up_s: robot.warm_up_s,
            faults: without_groups(&robot.fault),
            contexts: robot.context.clone(),
        }
    }
}

/// The node above a leaf is the tree's matter alone.
pub(super) fn without_groups(faults: &[DeclaredFault]) -> Vec<DeclaredFault> {
    let bare = |fault: &DeclaredFault| DeclaredFault {
        group: None,
        ..fault.clone()
    };
    faults.iter().map(bare).collect()
}

/// All but the name.
impl fmt::Display for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "command {}; channels", self.axes.join(" "))?;
        for channel in &self.channels {
            write!(f, " {}", channel.name)?;
            if let Some(period) = channel.period {
                write!(f, " (period {period})")?;
            }
            if channel.drifts {
                write!(f, " (drifts)")?;
            }
        }
        write!(f, "; {} s", self.interval_s)?;
        if self.warm_up_s > 0.0 {
            write!(f, "; warm-up {} s", self.warm_up_s)?;
        }
        for (i, fault) in self.faults.iter().enumerate() {
            write!(
                f,
                "{} {}",
                ["", "; faults"][usize::from(i == 0)],
                fault.name
            )?;
            if !fault.shows.is_empty() {
                write!(f, " (shows in {})", fault.shows.join(" "))?;
            }
            if let Some(wheel) = &fault.wheel {
                write!(f, " (turns with {wheel})")?;
            }
        }
        for (i, context) in self.contexts.iter().enumerate() {
            let before = ["", "; contexts"][usize::from(i == 0)];
            write!(f, "{before} {}", context.name)?;
            if !context.shows.is_empty() {
                write!(f, " (shows in {})", context.shows.join(" "))?;
            }
        }
        Ok(())
    }
}
