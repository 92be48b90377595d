//! What a broken sensor makes of a run.

use vigil_blocks::SensorFrame;
use vigil_inference::angle::wrap;
use vigil_recording::frames::Run;
use vigil_robot::channel_model::fault_kind::FaultKind;
use vigil_robot::channel_model::{Quantity, Target};
use vigil_robot::{ChannelMap, Description};

use crate::run_time::time_s;

/// Delays that are tried, s.
const DELAYS_S: [f64; 2] = [0.4, 1.0];
/// Sizes of the other faults, in tolerances of the channel.
const TOLERANCES: [f64; 2] = [2.0, 4.0];
/// Time in which a drift grows to the size of the bias, s.
const DRIFT_S: f64 = 4.0;

/// A fault of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Change {
    /// Readings times so much.
    Gain(f64),
    /// So much added, in the channel's unit.
    Bias(f64),
    /// So much added and more each second, in the channel's unit.
    Drift(f64),
    /// The reading of the onset is repeated; the velocity of a pose is zero.
    Frozen,
    /// Readings are late by so much, s.
    Delay(f64),
}

impl Change {
    /// Its size as a diagnosis would give it; none for what has no size.
    #[must_use]
    pub const fn size(self) -> Option<f64> {
        match self {
            Self::Gain(size) | Self::Bias(size) | Self::Drift(size) | Self::Delay(size) => {
                Some(size)
            }
            Self::Frozen => None,
        }
    }

    /// True if a diagnosis of this kind is right. A pose that stands has velocities of zero.
    #[must_use]
    pub fn is_of(self, kind: FaultKind) -> bool {
        match self {
            Self::Gain(_) => kind == FaultKind::Gain,
            Self::Bias(_) => kind == FaultKind::Bias,
            Self::Drift(_) => kind == FaultKind::Drift,
            Self::Frozen => matches!(kind, FaultKind::Frozen | FaultKind::Zero),
            Self::Delay(_) => kind == FaultKind::Delay,
        }
    }
}

/// A fault of one channel.
#[derive(Debug, Clone)]
pub struct Injection {
    /// Place of the channel in the model.
    pub channel: usize,
    /// What is done.
    pub change: Change,
    /// Name: kind, and tolerances or seconds.
    pub name: String,
}

impl Injection {
    /// All faults of all channels; `tolerances` and `usual` are sizes by channel.
    #[must_use]
    pub fn all(targets: &[Target], tolerances: &[f64], usual: &[f64]) -> Vec<Self> {
        let mut all = Vec::new();
        let channels = targets.iter().zip(tolerances.iter().zip(usual));
        for (channel, (target, (tolerance, usual))) in channels.enumerate() {
            let mut add = |change: Change, name: String| {
                all.push(Self {
                    channel,
                    change,
                    name,
                });
            };
            for factor in TOLERANCES {
                let size = factor * tolerance;
                add(
                    Change::Gain(1.0 + size / usual.max(1e-9)),
                    format!("gain {factor}"),
                );
                add(Change::Bias(size), format!("bias {factor}"));
                add(Change::Drift(size / DRIFT_S), format!("drift {factor}"));
            }
            add(Change::Frozen, "frozen".to_owned());
            if !target.quantity.is_pose() {
                for delay_s in DELAYS_S {
                    add(Change::Delay(delay_s), format!("delay {delay_s}"));
                }
            }
        }
        all
    }

    /// The run with this fault from `onset_s` on. Commands stay as they were.
    #[must_use]
    pub fn frames(
        &self,
        run: &Run,
        robot: &Description,
        target: &Target,
        onset_s: f64,
    ) -> Vec<SensorFrame> {
        match target.quantity.is_pose() {
            true => self.pose(run, robot, target.quantity, onset_s),
            false => self.readings(run, target.place, onset_s),
        }
    }

    fn readings(&self, run: &Run, place: usize, onset_s: f64) -> Vec<SensorFrame> {
        let mut out = run.frames.clone();
        let mut held = None;
        for (k, (whole, frame)) in run.frames.iter().zip(&mut out).enumerate() {
            let t_s = time_s(whole);
            let is_read = whole.channel_valid >> place & 1 == 1;
            if t_s < onset_s || !is_read {
                continue;
            }
            let x = whole.channel[place];
            frame.channel[place] = match self.change {
                Change::Gain(gain) => gain * x,
                Change::Bias(bias) => x + bias,
                Change::Drift(rate) => x + rate * (t_s - onset_s),
                Change::Frozen => *held.get_or_insert(x),
                Change::Delay(delay_s) => {
                    let earlier = run.frames[..=k].iter().rev();
                    let mut earlier = earlier.skip_while(|then| time_s(then) > t_s - delay_s);
                    earlier.next().map_or(x, |then| then.channel[place])
                }
            };
        }
        out
    }

    /// A pose whose velocity is wrong: what is added to it lasts.
    fn pose(
        &self,
        run: &Run,
        robot: &Description,
        quantity: Quantity,
        onset_s: f64,
    ) -> Vec<SensorFrame> {
        let map = ChannelMap::new(robot);
        let mut out = run.frames.clone();
        let mut added = [0.0; 3];
        let pairs = run.frames.windows(2).zip(out.iter_mut().skip(1));
        for (pair, frame) in pairs {
            let [then, now] = [&pair[0], &pair[1]];
            let (Some(before), Some(pose)) = (map.pose(then), map.pose(now)) else {
                continue;
            };
            let (t_s, dt_s) = (time_s(now), time_s(now) - time_s(then));
            if t_s >= onset_s && dt_s > 0.0 {
                let (sin, cos) = pose[2].sin_cos();
                let [dx, dy] = [pose[0] - before[0], pose[1] - before[1]];
                let read = match quantity {
                    Quantity::Forward => dx * cos + dy * sin,
                    Quantity::Lateral => dy * cos - dx * sin,
                    _ => wrap(pose[2] - before[2]),
                };
                let more = match self.change {
                    Change::Gain(gain) => (gain - 1.0) * read,
                    Change::Bias(bias) => bias * dt_s,
                    Change::Drift(rate) => rate * (t_s - onset_s) * dt_s,
                    Change::Frozen => -read,
                    Change::Delay(_) => 0.0,
                };
                let along = match quantity {
                    Quantity::Forward => [more * cos, more * sin, 0.0],
                    Quantity::Lateral => [-more * sin, more * cos, 0.0],
                    _ => [0.0, 0.0, more],
                };
                added.iter_mut().zip(along).for_each(|(a, b)| *a += b);
            }
            let moved = std::array::from_fn(|axis| pose[axis] + added[axis]);
            map.set_pose(frame, moved);
        }
        out
    }
}
