//! What gyro and currents may show.

use vigil_blocks::{SizeKind, WHEELS};
use vigil_robot::learned::Further;
use vigil_robot::learned::current_effects::SHARES;

/// What may be wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum State {
    Whole,
    /// A motor: wheel, index of the share lost.
    Torque(usize, usize),
    /// A current sensor repeats itself.
    CurrentDead(usize),
    /// It reads so much more, A.
    CurrentOffset(usize, f64),
    /// It reads this many times the current.
    CurrentGain(usize, f64),
    /// Its noise is this many times the usual.
    CurrentNoise(usize, f64),
    /// The gyro repeats itself.
    GyroDead,
    /// It reads so much more, rad/s.
    GyroBias(f64),
    /// It reads this many times the yaw rate.
    GyroGain(f64),
    /// Its noise is this many times the usual.
    GyroNoise(f64),
    /// A wheel is stuck: its leaf belongs to the other filter.
    Stuck(usize),
    Unknown,
}

impl State {
    /// In which way a component is broken, and by how much.
    pub(crate) const fn size(self) -> (SizeKind, f64) {
        match self {
            Self::Torque(_, share) => (SizeKind::TorqueShareLost, SHARES[share]),
            Self::CurrentOffset(_, offset_a) => (SizeKind::CurrentOffsetA, offset_a),
            Self::CurrentGain(_, gain) | Self::GyroGain(gain) => (SizeKind::Gain, gain),
            Self::GyroBias(bias_rad_s) => (SizeKind::RateBiasRadS, bias_rad_s),
            Self::CurrentDead(_) | Self::GyroDead => (SizeKind::Frozen, 0.0),
            Self::CurrentNoise(..) | Self::GyroNoise(_) => (SizeKind::Noise, 0.0),
            Self::Stuck(_) | Self::Whole | Self::Unknown => (SizeKind::None, 0.0),
        }
    }

    /// True if the observation holds a channel that shows it. A dead sensor is read: it repeats
    /// itself.
    pub(crate) fn is_read(self, further: &Further) -> bool {
        let gyro = further.yaw_rate.count() > 0;
        let current = |wheel: usize| further.currents[wheel].count() > 0;
        match self {
            // A motor's load is carried by the others.
            Self::Torque(..) => (0..WHEELS).any(current),
            Self::Whole | Self::Unknown | Self::Stuck(_) => gyro || (0..WHEELS).any(current),
            Self::CurrentDead(wheel)
            | Self::CurrentOffset(wheel, _)
            | Self::CurrentGain(wheel, _)
            | Self::CurrentNoise(wheel, _) => current(wheel),
            Self::GyroDead | Self::GyroBias(_) | Self::GyroGain(_) | Self::GyroNoise(_) => gyro,
        }
    }
}
