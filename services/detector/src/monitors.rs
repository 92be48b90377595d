//! Monitors of the pose against the planned pose: EPS, EPM, LD and SD of Verma, Fernandez and
//! Simmons (2002), section 3. The paper names them; the rules are ours, thresholds those of
//! [`schema::Monitors`]:
//!
//! - **error in position**: the pose is farther than `position_error_m` from the planned pose; it
//!   ends below half of that. The robot is stopped (EPS) once it has stayed within 0.1 m for
//!   `stopped_after_s`, else it moves (EPM);
//! - **LD**: within `loop_radius_m` of where the robot was at least `loop_travel_m` of way before,
//!   while the planned pose is at least `2 loop_radius_m` from where it was then. Looked at every
//!   0.25 m; the last 32 m are kept;
//! - **SD**: since the robot was last more than `spin_radius_m` from where it began to count, it
//!   has turned by `spin_turn_rad` more than its plan, to one side.
//!
//! A jump of the pose's frame and a new run begin everything anew; a frame without both poses
//! changes nothing.

use vigil_blocks::{SensorFrame, Symptoms, Valid};
use vigil_inference::angle::wrap;
use vigil_setup::schema;

/// A robot that stays within this distance stands, m.
const STILL_M: f64 = 0.1;
/// Distance between kept places, m.
const SPACING_M: f64 = 0.25;
/// Kept places.
const PLACES: usize = 128;
/// Positions beyond this are no measurement, m.
const POSITION_MAX_M: f64 = 1e7;

/// A place that the robot has passed.
#[derive(Debug, Clone, Copy)]
struct Place {
    at: [f64; 2],
    planned: [f64; 2],
    travel_m: f64,
}

/// The four monitors. Allocates nothing after the start.
#[derive(Debug, Clone)]
pub struct Monitors {
    settings: schema::Monitors,
    places: Vec<Place>,
    trace: Option<Trace>,
    symptoms: u32,
}

/// What carries over from frame to frame.
#[derive(Debug, Clone, Copy)]
struct Trace {
    reset_count: u32,
    yaw: [f64; 2],
    /// Where and when the robot last was more than `STILL_M` from where it had been.
    still: ([f64; 2], u64),
    /// Where turning is counted from, and the turn beyond the planned one since, rad.
    spin: ([f64; 2], f64),
    /// Places kept so far.
    kept: usize,
    last: Place,
}

impl Monitors {
    /// With these thresholds.
    #[must_use]
    pub fn new(settings: &schema::Monitors) -> Self {
        Self {
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
        let poses = [frame.pose, frame.planned_pose];
        let sound = |value: &f64| value.abs() <= POSITION_MAX_M;
        let is_whole = frame.has(Valid::POSE | Valid::PLANNED_POSE);
        if !is_whole || !poses.iter().flatten().all(sound) {
            return;
        }
        if self
            .trace
            .is_some_and(|trace| trace.reset_count != frame.pose_reset_count)
        {
            self.reset();
        }
        let [at, planned] = poses.map(|[x, y, _]| [x, y]);
        let yaw = poses.map(|pose| pose[2]);
        let t_ns = frame.header.t_capture_ns;
        let here = Place {
            at,
            planned,
            travel_m: 0.0,
        };
        let mut trace = self.trace.unwrap_or(Trace {
            reset_count: frame.pose_reset_count,
            yaw,
            still: (at, t_ns),
            spin: (at, 0.0),
            kept: 0,
            last: here,
        });
        self.take_position(&mut trace, here, t_ns);
        self.take_turn(&mut trace, at, yaw);
        self.take_place(&mut trace, here);
        self.trace = Some(trace);
    }

    fn take_position(&mut self, trace: &mut Trace, here: Place, t_ns: u64) {
        if distance(here.at, trace.still.0) > STILL_M {
            trace.still = (here.at, t_ns);
        }
        let still_s = t_ns.saturating_sub(trace.still.1) as f64 * 1e-9;
        let stands = self.symptoms & (Symptoms::EPS | Symptoms::EPM) != 0;
        let limit_m = self.settings.position_error_m * if stands { 0.5 } else { 1.0 };
        self.symptoms &= !(Symptoms::EPS | Symptoms::EPM);
        if distance(here.at, here.planned) > limit_m {
            self.symptoms |= if still_s >= self.settings.stopped_after_s {
                Symptoms::EPS
            } else {
                Symptoms::EPM
            };
        }
    }

    fn take_turn(&mut self, trace: &mut Trace, at: [f64; 2], yaw: [f64; 2]) {
        let turned = wrap(yaw[0] - trace.yaw[0]) - wrap(yaw[1] - trace.yaw[1]);
        trace.yaw = yaw;
        if distance(at, trace.spin.0) > self.settings.spin_radius_m {
            trace.spin = (at, 0.0);
        }
        trace.spin.1 += turned;
        self.set(
            Symptoms::SD,
            trace.spin.1.abs() >= self.settings.spin_turn_rad,
        );
    }

    fn take_place(&mut self, trace: &mut Trace, here: Place) {
        let step_m = distance(here.at, trace.last.at);
        if trace.kept > 0 && step_m < SPACING_M {
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
        trace.last = now;
    }

    const fn set(&mut self, symptom: u32, fires: bool) {
        self.symptoms = (self.symptoms & !symptom) | if fires { symptom } else { 0 };
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}
