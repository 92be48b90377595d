//! The ways in which sensors and drives fail.

use vigil_blocks::SizeKind;
use vigil_checkpoint::CheckpointValue;

use super::component::Quantity;

/// A way in which a component fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq, CheckpointValue)]
pub enum FaultKind {
    /// A sensor reads this much more, in its unit.
    Bias,
    /// A sensor reads this many times the true value.
    Gain,
    /// A sensor reads an addition that grows by this much each second.
    Drift,
    /// A sensor repeats a value.
    Frozen,
    /// A sensor reads zero.
    Zero,
    /// A sensor is late by this much, s.
    Delay,
    /// A sensor's noise is this many times as large.
    Noise,
    /// A sensor is silent.
    Missing,
    /// A sensor reads anything.
    Erratic,
    /// A drive stands still, and its motor draws any current.
    Stuck,
    /// A drive lacks this share of its commanded speed.
    Loss,
    /// A drive turns and moves nothing: this share of its commanded speed is lost to the body.
    Slip,
    /// A drive has this share of its largest speed beside what is commanded.
    Offset,
    /// What a drive moves jolts: the noise of all that is measured at it is this many times as
    /// large.
    Rough,
    /// A declared fault shifts the channels in which it shows.
    Shift,
    /// A declared fault shows as in the labelled runs.
    Signature,
    /// A declared fault comes back with the turns of its wheel as in the labelled runs.
    Turning,
}

/// Kinds of a sensor's faults.
pub const SENSOR_KINDS: [FaultKind; 9] = [
    FaultKind::Bias,
    FaultKind::Gain,
    FaultKind::Drift,
    FaultKind::Frozen,
    FaultKind::Zero,
    FaultKind::Delay,
    FaultKind::Noise,
    FaultKind::Missing,
    FaultKind::Erratic,
];
/// Kinds of a drive's faults.
pub const DRIVE_KINDS: [FaultKind; 5] = [
    FaultKind::Stuck,
    FaultKind::Loss,
    FaultKind::Slip,
    FaultKind::Offset,
    FaultKind::Rough,
];

/// Kinds of evidence for a declared fault.
pub const DECLARED_KINDS: [FaultKind; 3] =
    [FaultKind::Shift, FaultKind::Signature, FaultKind::Turning];

/// Deviation of a gain from one, before anything is seen.
pub const GAIN_SD: f64 = 1.0;
/// Deviation of a drive's share that is lost, likewise.
pub const SHARE_SD: f64 = 0.5;
/// Deviation of a bias over the channel's usual size in motion, or over so many deviations of its
/// residual.
const BIAS_SD: f64 = 0.5;
const BIAS_DEVIATIONS: f64 = 10.0;

/// Deviation of a bias before anything is seen, in the channel's unit: it may be as large as what
/// is usually measured, or as many deviations of the residual.
#[must_use]
pub fn bias_sd(usual: f64, deviation: f64) -> f64 {
    BIAS_SD * usual.hypot(BIAS_DEVIATIONS * deviation)
}

impl FaultKind {
    /// The word for it and the unit of its size on the wire; `of`: what the sensor measures.
    #[must_use]
    pub const fn size_kind(self, of: Option<Quantity>) -> SizeKind {
        match (self, of) {
            (Self::Bias, Some(Quantity::WheelRate)) => SizeKind::BiasRadS,
            (Self::Bias, Some(Quantity::YawRate)) => SizeKind::RateBiasRadS,
            (Self::Bias, Some(Quantity::Current)) => SizeKind::CurrentOffsetA,
            (Self::Bias, _) => SizeKind::Bias,
            (Self::Gain, _) => SizeKind::Gain,
            (Self::Drift, Some(Quantity::WheelRate | Quantity::YawRate)) => SizeKind::DriftRadS2,
            (Self::Drift, _) => SizeKind::Drift,
            (Self::Frozen, _) => SizeKind::Frozen,
            (Self::Zero, _) => SizeKind::Zero,
            (Self::Delay, _) => SizeKind::DelayS,
            (Self::Noise | Self::Rough, _) => SizeKind::NoiseRatio,
            (Self::Missing, _) => SizeKind::Missing,
            (Self::Erratic, _) => SizeKind::Erratic,
            (Self::Stuck, _) => SizeKind::Stuck,
            (Self::Loss, _) => SizeKind::EffectShareLost,
            (Self::Slip, _) => SizeKind::GripShareLost,
            (Self::Offset, _) => SizeKind::SpeedShareAdded,
            (Self::Shift | Self::Signature | Self::Turning, _) => SizeKind::None,
        }
    }
}
