//! What gyro and currents may show.

use vigil_blocks::{SizeKind, WHEELS};
use vigil_checkpoint::CheckpointValue;
use vigil_robot::learned::Further;
use vigil_robot::learned::current_effects::SHARES;

/// What may be wrong.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub(crate) enum FurtherState {
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

impl FurtherState {
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

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_robot::learned::Reading;

    #[test]
    fn a_state_shows_in_the_channels_that_it_changes() {
        let read = Reading {
            repeats: 1,
            ..Reading::default()
        };
        let mut current = Further::default();
        current.currents[2] = read;
        let gyro = Further {
            yaw_rate: read,
            ..Further::default()
        };
        use FurtherState as S;
        for (state, by_current, by_gyro) in [
            (S::Whole, true, true),
            (S::Unknown, true, true),
            (S::Stuck(5), true, true),
            (S::Torque(5, 0), true, false),
            (S::CurrentDead(2), true, false),
            (S::CurrentOffset(2, 1.0), true, false),
            (S::CurrentGain(2, 0.5), true, false),
            (S::CurrentNoise(2, 8.0), true, false),
            (S::CurrentDead(3), false, false),
            (S::GyroDead, false, true),
            (S::GyroBias(0.1), false, true),
            (S::GyroGain(0.5), false, true),
            (S::GyroNoise(8.0), false, true),
        ] {
            let found = (state.is_read(&current), state.is_read(&gyro));
            assert_eq!(found, (by_current, by_gyro), "{state:?}");
            assert!(!state.is_read(&Further::default()), "{state:?}");
        }
    }

    #[test]
    fn each_state_has_its_way_and_size() {
        use FurtherState as S;
        for (state, kind, size) in [
            (S::Torque(1, 2), SizeKind::TorqueShareLost, SHARES[2]),
            (S::CurrentOffset(1, -0.3), SizeKind::CurrentOffsetA, -0.3),
            (S::CurrentGain(1, 2.0), SizeKind::Gain, 2.0),
            (S::GyroGain(0.5), SizeKind::Gain, 0.5),
            (S::GyroBias(0.2), SizeKind::RateBiasRadS, 0.2),
            (S::CurrentDead(1), SizeKind::Frozen, 0.0),
            (S::GyroNoise(8.0), SizeKind::Noise, 0.0),
            (S::Stuck(1), SizeKind::None, 0.0),
        ] {
            assert_eq!(state.size(), (kind, size));
        }
    }
}
