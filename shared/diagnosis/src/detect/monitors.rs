//! Monitors of the pose against the planned pose: EPS, EPM, LD and SD of Verma, Fernandez and
//! Simmons (2002), section 3. The paper names them; the rules are ours, thresholds those of
//! [`MonitorSettings`]:
//!
//! - **error in position**: the pose is farther than `position_error_m` from the planned pose; it
//!   ends below half of that. The robot is stopped (EPS) once it has stayed within 0.1 m for
//!   `stopped_after_s`, else it moves (EPM);
//! - **LD**: within `loop_radius_m` of where the robot was at least `loop_travel_m` of way before,
//!   while the planned pose is at least `2 loop_radius_m` from where it was then. Looked at every
//!   0.25 m; the last 32 m are kept. It ends where that no longer holds, or [`LASTS_NS`] after the
//!   last look;
//! - **SD**: since the robot was last more than `spin_radius_m` from where it began to count, it
//!   has turned by `spin_turn_rad` more than its plan, to one side.
//!
//! A jump of the pose's frame and a new run begin everything anew.
//!
//! A frame without both poses changes nothing until the last one with both is [`SILENT_NS`] old.
//! From then on loop and spin are over. A robot whose pose is known is then in error, EPS or EPM:
//! without a plan it is not where its plan wants it. Before the first frame with both poses nothing
//! fires, and the first one after a silence begins everything anew.

use vigil_blocks::{SensorFrame, Symptoms};
use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_inference::angle::wrap;
use vigil_robot::ChannelMap;

use crate::detect::settings::MonitorSettings;

/// A robot that stays within this distance stands, m: twenty deviations of a pose of 5 mm.
const STILL_M: f64 = 0.1;
/// Distance between kept places, m: chosen, so that [`PLACES`] hold 32 m of the way.
const SPACING_M: f64 = 0.25;
/// Without a frame with both poses for this long, ns, the last symptoms no longer hold: see above.
/// As `blindness::BLIND_S`.
const SILENT_NS: u64 = 1_000_000_000;
/// A loop or a spin ends so long after its last sign, ns. Chosen by hand: much shorter, and a loop
/// would fire twice; longer, and a robot that is free again stays a looping one.
const LASTS_NS: u64 = 10_000_000_000;
/// A turn by this much more is a sign of a spin, rad. Twenty deviations of a yaw of 5 mrad.
const TURN_STEP_RAD: f64 = 0.1;
/// Kept places: 32 m of way, beyond the largest `loop_travel_m` (30 m).
const PLACES: usize = 128;
/// A pose with a coordinate, m, or a yaw, rad, beyond this is none: the observer's bound of a
/// position. The frame guard bounds frames from outside more closely, at 1e6 m.
const POSE_MAX: f64 = 1e7;

/// A place that the robot has passed.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct Place {
    at: [f64; 2],
    planned: [f64; 2],
    travel_m: f64,
}

/// The four monitors. Allocates nothing after the start.
#[derive(Debug, Clone, Checkpoint)]
pub struct Monitors {
    #[checkpoint(fixed)]
    map: ChannelMap,
    #[checkpoint(fixed)]
    settings: MonitorSettings,
    places: Vec<Place>,
    trace: Option<Trace>,
    symptoms: u32,
}

/// What carries over from frame to frame.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct Trace {
    reset_count: u32,
    yaw: [f64; 2],
    /// Where the robot last was more than `STILL_M` from where it had been, and when, ns.
    still_at: [f64; 2],
    still_ns: u64,
    spin: Spin,
    /// Places kept so far.
    kept: usize,
    last: Place,
    /// When the last place was kept.
    kept_ns: u64,
    /// When both poses were there last.
    whole_ns: u64,
}

/// Turning on the spot.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct Spin {
    /// Where turning is counted from.
    from: [f64; 2],
    /// Turn beyond the planned one since, rad.
    turned_rad: f64,
    /// The largest turn to either side so far, rad, and since when, within `TURN_STEP_RAD`.
    most_rad: f64,
    most_ns: u64,
}

impl Spin {
    const fn new(from: [f64; 2], t_ns: u64) -> Self {
        Self {
            from,
            turned_rad: 0.0,
            most_rad: 0.0,
            most_ns: t_ns,
        }
    }
}

impl Trace {
    /// True if the robot has stayed where it is for `after_s`.
    fn is_still(&mut self, at: [f64; 2], t_ns: u64, after_s: f64) -> bool {
        if distance(at, self.still_at) > STILL_M {
            (self.still_at, self.still_ns) = (at, t_ns);
        }
        t_ns.saturating_sub(self.still_ns) as f64 * 1e-9 >= after_s
    }
}

impl Monitors {
    /// With these thresholds, for frames of this channel map.
    #[must_use]
    pub fn new(settings: &MonitorSettings, map: ChannelMap) -> Self {
        Self {
            map,
            settings: settings.clone(),
            places: Vec::with_capacity(PLACES),
            trace: None,
            symptoms: 0,
        }
    }

    /// Begins anew.
    pub fn reset(&mut self) {
        self.places.clear();
        self.trace = None;
        self.symptoms = 0;
    }

    /// Bits of [`Symptoms`]: what fires as of the last frame.
    #[must_use]
    pub const fn symptoms(&self) -> u32 {
        self.symptoms
    }

    /// Takes a frame.
    pub fn observe(&mut self, frame: &SensorFrame) {
        let sound = |pose: &[f64; 3]| pose.iter().all(|value| value.abs() <= POSE_MAX);
        let pose = self.map.pose(frame).filter(sound);
        let plan = frame.planned().filter(sound);
        let t_ns = frame.header.t_capture_ns;
        let silent = |trace: Trace| t_ns.saturating_sub(trace.whole_ns) >= SILENT_NS;
        let is_silent = self.trace.is_some_and(silent);
        let (Some(at_pose), Some(at_plan)) = (pose, plan) else {
            if is_silent {
                self.miss_plan(pose, t_ns);
            }
            return;
        };
        let jumped = |trace: Trace| trace.reset_count != frame.pose_reset_count;
        if is_silent || self.trace.is_some_and(jumped) {
            self.reset();
        }
        let poses = [at_pose, at_plan];
        let [at, planned] = poses.map(|[x, y, _]| [x, y]);
        let yaw = poses.map(|pose| pose[2]);
        let here = Place {
            at,
            planned,
            travel_m: 0.0,
        };
        let mut trace = self.trace.unwrap_or(Trace {
            reset_count: frame.pose_reset_count,
            yaw,
            still_at: at,
            still_ns: t_ns,
            spin: Spin::new(at, t_ns),
            kept: 0,
            last: here,
            kept_ns: t_ns,
            whole_ns: t_ns,
        });
        trace.whole_ns = t_ns;
        self.take_position(&mut trace, here, t_ns);
        self.take_turn(&mut trace, at, yaw, t_ns);
        self.take_place(&mut trace, here, t_ns);
        self.trace = Some(trace);
    }

    /// No plan for long: the robot, if it knows where it is, is not where it should be.
    fn miss_plan(&mut self, pose: Option<[f64; 3]>, t_ns: u64) {
        self.symptoms = 0;
        if let (Some(trace), Some([x, y, _])) = (&mut self.trace, pose) {
            let is_still = trace.is_still([x, y], t_ns, self.settings.stopped_after_s);
            self.symptoms = error_in_position(is_still);
        }
    }

    fn take_position(&mut self, trace: &mut Trace, here: Place, t_ns: u64) {
        let is_still = trace.is_still(here.at, t_ns, self.settings.stopped_after_s);
        let fires = self.symptoms & (Symptoms::EPS | Symptoms::EPM) != 0;
        let limit_m = self.settings.position_error_m * if fires { 0.5 } else { 1.0 };
        self.symptoms &= !(Symptoms::EPS | Symptoms::EPM);
        if distance(here.at, here.planned) > limit_m {
            self.symptoms |= error_in_position(is_still);
        }
    }

    fn take_turn(&mut self, trace: &mut Trace, at: [f64; 2], yaw: [f64; 2], t_ns: u64) {
        let turned = wrap(yaw[0] - trace.yaw[0]) - wrap(yaw[1] - trace.yaw[1]);
        trace.yaw = yaw;
        if distance(at, trace.spin.from) > self.settings.spin_radius_m {
            trace.spin = Spin::new(at, t_ns);
        }
        trace.spin.turned_rad += turned;
        let turned_rad = trace.spin.turned_rad.abs();
        if turned_rad >= trace.spin.most_rad + TURN_STEP_RAD {
            (trace.spin.most_rad, trace.spin.most_ns) = (turned_rad, t_ns);
        }
        let fires = turned_rad >= self.settings.spin_turn_rad;
        let is_over = t_ns.saturating_sub(trace.spin.most_ns) >= LASTS_NS;
        if fires && is_over {
            trace.spin = Spin::new(at, t_ns);
        }
        self.set(Symptoms::SD, fires && !is_over);
    }

    fn take_place(&mut self, trace: &mut Trace, here: Place, t_ns: u64) {
        let step_m = distance(here.at, trace.last.at);
        if trace.kept > 0 && step_m < SPACING_M {
            if t_ns.saturating_sub(trace.kept_ns) >= LASTS_NS {
                self.set(Symptoms::LD, false);
            }
            return;
        }
        let now = Place {
            travel_m: trace.last.travel_m + step_m,
            ..here
        };
        let radius_m = self.settings.loop_radius_m;
        let is_back = |before: &Place| {
            now.travel_m - before.travel_m >= self.settings.loop_travel_m
                && distance(now.at, before.at) <= radius_m
                && distance(now.planned, before.planned) >= 2.0 * radius_m
        };
        let loops = self.places.iter().any(is_back);
        self.set(Symptoms::LD, loops);
        if self.places.len() < PLACES {
            self.places.push(now);
        } else if let Some(oldest) = self.places.get_mut(trace.kept % PLACES) {
            *oldest = now;
        }
        trace.kept += 1;
        (trace.last, trace.kept_ns) = (now, t_ns);
    }

    const fn set(&mut self, symptom: u32, fires: bool) {
        self.symptoms = (self.symptoms & !symptom) | if fires { symptom } else { 0 };
    }
}

const fn error_in_position(is_still: bool) -> u32 {
    if is_still {
        Symptoms::EPS
    } else {
        Symptoms::EPM
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}
