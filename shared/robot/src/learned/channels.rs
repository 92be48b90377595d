//! Which channels take part.

/// Which channels a monitor uses besides the pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channels {
    /// Pose and command.
    Pose,
    /// Wheel rates and steering angles too.
    PoseEncoders,
    /// Gyro and motor currents too.
    All,
}

impl Channels {
    /// Name, as calibrations carry it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pose => "pose",
            Self::PoseEncoders => "pose+encoders",
            Self::All => "all",
        }
    }

    /// True if wheel rates and steering angles are among them.
    #[must_use]
    pub const fn use_wheels(self) -> bool {
        !matches!(self, Self::Pose)
    }
}
