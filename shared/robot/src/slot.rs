//! Fixed places of evidence inside the models of wheeled robots.

/// Number of slots.
pub const SLOTS: usize = 64;

/// Index of a slot. A belief carries evidence by the robot's own channels instead, see
/// [`crate::ChannelMap`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slot;

impl Slot {
    /// Motion: the pose track.
    pub const POSE: usize = 0;
    /// Yaw rate.
    pub const YAW_RATE: usize = 1;
    /// Deviation of any kind: without a constant direction (the paper's constant likelihood), or
    /// that no single channel of a model of channels explains.
    pub const ANY: usize = 2;

    /// Wheel rate of wheel `i`.
    #[must_use]
    pub const fn wheel_rate(i: usize) -> usize {
        8 + i
    }
    /// Steering angle of wheel `i`.
    #[must_use]
    pub const fn steer(i: usize) -> usize {
        16 + i
    }
    /// Motor current of wheel `i`.
    #[must_use]
    pub const fn current(i: usize) -> usize {
        24 + i
    }
    /// The channel at a place of the frame that is none of these. A model has fewer than 32 places.
    #[must_use]
    pub const fn further(place: usize) -> usize {
        if place < 32 { 32 + place } else { Self::ANY }
    }
}
