//! In which way a component is broken, and what the size of its fault is.

use strum::{FromRepr, VariantArray};
use vigil_checkpoint::CheckpointValue;

/// The way in which a component is most probably broken: it gives the fault's size its unit.
///
/// A size is what a sensor's reading or an actuator does beside what it should. Some ways have no
/// size: their name says all.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, Default, FromRepr, VariantArray, CheckpointValue,
)]
#[repr(u32)]
pub enum SizeKind {
    /// Nothing is said of the way or the size.
    #[default]
    None = 0,
    /// A reading is this many times the true value (ratio; 1 is healthy).
    Gain = 1,
    /// A rate is read with this much added, rad/s.
    BiasRadS = 2,
    /// A rate is read with an addition that grows by this much each second, rad/s².
    DriftRadS2 = 3,
    /// A reading comes late by this much, s.
    DelayS = 4,
    /// A steered wheel stands off its commanded angle by this much, rad.
    AngleRad = 5,
    /// A motor lacks this share of its torque (0 to 1).
    TorqueShareLost = 6,
    /// A current is read with this much added, A.
    CurrentOffsetA = 7,
    /// A gyro reads this much more, rad/s.
    RateBiasRadS = 8,
    /// A sensor reports exactly zero; no size.
    Zero = 9,
    /// A sensor repeats its last value; no size.
    Frozen = 10,
    /// A sensor reports noise; no size.
    Noise = 11,
    /// A sensor reports nothing but its own noise about zero; no size.
    Dead = 12,
    /// An actuator stands still whatever it is told; no size.
    Stuck = 13,
    /// A steered wheel stands at this angle whatever it is told, rad.
    HeldAtRad = 14,
    /// A pose has jumped by this much, m.
    JumpM = 15,
    /// A reading has this much added, in its unit.
    Bias = 16,
    /// A reading has an addition that grows by this much each second, in its unit.
    Drift = 17,
    /// Noise is this many times as large.
    NoiseRatio = 18,
    /// A sensor is silent; no size.
    Missing = 19,
    /// A sensor reads what no kind of fault explains; no size.
    Erratic = 20,
    /// A drive lacks this share of its commanded speed.
    EffectShareLost = 21,
    /// The robot lacks this share of the speed with which a drive turns.
    GripShareLost = 22,
    /// A drive has this share of its largest speed beside what is commanded.
    SpeedShareAdded = 23,
}

impl SizeKind {
    /// Every kind, in the order of the codes.
    pub const ALL: &[Self] = Self::VARIANTS;

    /// The kind behind a block's code, [`Self::None`] for one that this version does not know.
    #[must_use]
    pub fn from_wire(code: u32) -> Self {
        Self::from_repr(code).unwrap_or_default()
    }

    /// One word for the way, empty for [`Self::None`].
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Gain => "gain",
            Self::BiasRadS => "bias",
            Self::DriftRadS2 => "drift",
            Self::DelayS => "delay",
            Self::AngleRad => "angle",
            Self::TorqueShareLost => "torque-loss",
            Self::CurrentOffsetA => "current-offset",
            Self::RateBiasRadS => "rate-bias",
            Self::Zero => "zero",
            Self::Frozen => "frozen",
            Self::Noise => "noise",
            Self::Dead => "dead",
            Self::Stuck => "stuck",
            Self::HeldAtRad => "held",
            Self::JumpM => "jump",
            Self::Bias => "bias",
            Self::Drift => "drift",
            Self::NoiseRatio => "noise",
            Self::Missing => "missing",
            Self::Erratic => "erratic",
            Self::EffectShareLost => "loss",
            Self::GripShareLost => "slip",
            Self::SpeedShareAdded => "offset",
        }
    }

    /// In which way a component is broken, and by how much: `gain 0.50 (sd 0.02)`.
    #[must_use]
    pub fn text(self, size: f64, sd: f64) -> String {
        let way = self.word();
        match self.unit() {
            None => way.to_owned(),
            Some("") => format!("{way} {size:.2} (sd {sd:.2})"),
            Some(unit) => format!("{way} {size:.2} {unit} (sd {sd:.2})"),
        }
    }

    /// Unit of the size, empty for a ratio; None if the way has no size.
    #[must_use]
    pub const fn unit(self) -> Option<&'static str> {
        match self {
            Self::Gain
            | Self::TorqueShareLost
            | Self::Bias
            | Self::Drift
            | Self::NoiseRatio
            | Self::EffectShareLost
            | Self::GripShareLost
            | Self::SpeedShareAdded => Some(""),
            Self::BiasRadS | Self::RateBiasRadS => Some("rad/s"),
            Self::DriftRadS2 => Some("rad/s2"),
            Self::DelayS => Some("s"),
            Self::AngleRad | Self::HeldAtRad => Some("rad"),
            Self::CurrentOffsetA => Some("A"),
            Self::JumpM => Some("m"),
            Self::None
            | Self::Zero
            | Self::Frozen
            | Self::Noise
            | Self::Dead
            | Self::Stuck
            | Self::Missing
            | Self::Erratic => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::SizeKind;

    #[test]
    fn a_size_has_its_unit_and_ways_without_size_have_none() {
        assert_eq!(SizeKind::Gain.text(0.5, 0.02), "gain 0.50 (sd 0.02)");
        let angle = SizeKind::AngleRad.text(0.2, 0.02);
        assert_eq!(angle, "angle 0.20 rad (sd 0.02)");
        assert_eq!(SizeKind::Zero.text(0.0, 0.02), "zero");
    }

    #[test]
    fn codes_are_the_places_in_the_list() {
        for (code, kind) in SizeKind::ALL.iter().enumerate() {
            assert_eq!(*kind as usize, code);
            assert_eq!(SizeKind::from_wire(code as u32), *kind);
        }
        assert_eq!(SizeKind::from_wire(99), SizeKind::None);
    }
}
