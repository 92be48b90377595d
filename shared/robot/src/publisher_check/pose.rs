//! Pose against command, over stretches of half a second.

use vigil_checkpoint::CheckpointValue;
use vigil_inference::angle::wrap;

use super::{Finding, FindingKind, Motion, RATIO_MAX, TURN_MIN_RAD, TURNING_1_M, TestOutcome};

/// Length of a stretch, s. Chosen: a path is nearly straight over it, and 0.1 m at 0.2 m/s are
/// twenty deviations of a pose of 5 mm.
const STRETCH_S: f64 = 0.5;
/// Stretches from which the pose is judged, and commanded travel, m (twenty deviations of 5 mm).
/// Weighed by [`FORGET`], three count 2.31.
const STRETCHES_MIN: f64 = 2.3;
const TRAVEL_MIN_M: f64 = 0.1;
/// Weight of a stretch beside the next: exchanged axes show in some headings, and not in others.
/// The sums weigh four stretches, two seconds.
const FORGET: f64 = 0.75;
/// Turn, rad, or travel, m, after which headings are judged: a quarter turn shows exchanged axes; a
/// robot that never turns is judged after four metres.
const TURNED_RAD: f64 = 1.6;
const COME_M: f64 = 4.0;
/// Angle between travel and yaw that no ground explains, rad: 0.68 m aside per metre, where a
/// healthy rover drifts by 0.04.
const ANGLE_MAX_RAD: f64 = 0.6;
/// Factor by which the mean displacement must exceed its standard error: by chance 6 in 100,000 do.
const CERTAIN: f64 = 4.0;

/// A stretch under way.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct Stretch {
    from: [f64; 3],
    last_yaw: f64,
    turned_rad: f64,
    elapsed_s: f64,
    /// A wheel stood in it.
    has_standing: bool,
    /// Commanded displacement, forward and left, m, and turn, rad.
    commanded: [f64; 3],
}

/// Sums over the stretches of a run.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub(super) struct Poses {
    stretch: Option<Stretch>,
    count: f64,
    commanded_m: f64,
    /// Displacement along the commanded direction and to its left: sums, and of their squares.
    moved_m: [f64; 2],
    squares: f64,
    /// All that was commanded, m and rad.
    come_m: f64,
    swung_rad: f64,
    turned_rad: f64,
    /// Commanded turn, rad, and the part of it in which a wheel stood.
    turn_rad: f64,
    standing_rad: f64,
}

impl Poses {
    /// Drops the stretch under way.
    pub fn interrupt(&mut self) {
        self.stretch = None;
    }

    /// Takes the pose of a robot in motion; true if a stretch is complete.
    pub fn take(
        &mut self,
        pose: Option<[f64; 3]>,
        motion: Motion,
        has_standing: bool,
        standing_m_s: f64,
    ) -> bool {
        let Motion { twist, dt_s } = motion;
        let Some(pose) = pose else {
            self.stretch = None;
            return false;
        };
        let stretch = self.stretch.get_or_insert(Stretch {
            from: pose,
            last_yaw: pose[2],
            turned_rad: 0.0,
            elapsed_s: -dt_s,
            has_standing: false,
            commanded: [0.0; 3],
        });
        stretch.elapsed_s += dt_s;
        stretch.has_standing |= has_standing;
        if stretch.elapsed_s > 0.0 {
            for (sum, rate) in stretch.commanded.iter_mut().zip(twist) {
                *sum += rate * dt_s;
            }
        }
        stretch.turned_rad += wrap(pose[2] - stretch.last_yaw);
        stretch.last_yaw = pose[2];
        if stretch.elapsed_s < STRETCH_S {
            return false;
        }
        let done = *stretch;
        self.stretch = None;
        self.add(&done, pose, standing_m_s);
        true
    }

    fn add(&mut self, stretch: &Stretch, to: [f64; 3], standing_m_s: f64) {
        let [forward, left, turn] = stretch.commanded;
        let way_m = forward.hypot(left);
        self.come_m += way_m;
        self.swung_rad += turn.abs();
        if turn.abs() >= TURNING_1_M * way_m {
            self.turn_rad += turn.abs();
            if stretch.has_standing {
                self.standing_rad += turn.abs();
            }
            self.turned_rad += stretch.turned_rad * turn.signum();
        }
        // A turn in place goes nowhere.
        if way_m < standing_m_s * stretch.elapsed_s {
            return;
        }
        let heading = stretch.from[2] + 0.5 * stretch.turned_rad + left.atan2(forward);
        let (sin, cos) = heading.sin_cos();
        let (x, y) = (to[0] - stretch.from[0], to[1] - stretch.from[1]);
        let moved = [x * cos + y * sin, y * cos - x * sin];
        self.count = FORGET * self.count + 1.0;
        self.commanded_m = FORGET * self.commanded_m + way_m;
        for (sum, value) in self.moved_m.iter_mut().zip(moved) {
            *sum = FORGET * *sum + value;
        }
        self.squares = FORGET * self.squares + moved[0] * moved[0] + moved[1] * moved[1];
    }

    /// Tests travel and heading.
    pub fn travel(&self) -> TestOutcome {
        if self.count < STRETCHES_MIN || self.commanded_m < TRAVEL_MIN_M {
            return TestOutcome::NotYet;
        }
        let [along, left] = self.moved_m;
        let total_m = along.hypot(left);
        let scatter = (self.squares - total_m * total_m / self.count).max(0.0);
        let error_m = (scatter * self.count / (self.count - 1.0)).sqrt();
        let ratio = total_m / self.commanded_m;
        if ratio > RATIO_MAX && total_m > CERTAIN * error_m {
            return TestOutcome::new(FindingKind::Travel, None, ratio);
        }
        let has_come = self.swung_rad >= TURNED_RAD || self.come_m >= COME_M;
        // A robot that hardly moves has no direction.
        if ratio < 1.0 / RATIO_MAX || total_m < CERTAIN * error_m {
            return match has_come {
                true => TestOutcome::Unclear,
                false => TestOutcome::NotYet,
            };
        }
        let angle = left.atan2(along);
        match angle.abs() > ANGLE_MAX_RAD {
            true => TestOutcome::new(FindingKind::Heading, None, angle),
            false if has_come => TestOutcome::Fits,
            false => TestOutcome::NotYet,
        }
    }

    /// Tests the turns.
    pub fn turn(&self) -> TestOutcome {
        if self.turn_rad < TURN_MIN_RAD {
            return TestOutcome::NotYet;
        }
        let standing = self.standing_rad / self.turn_rad;
        super::turn(FindingKind::Turn, self.turned_rad / self.turn_rad, standing)
    }
}

impl TestOutcome {
    pub(super) const fn new(kind: FindingKind, wheel: Option<usize>, value: f64) -> Self {
        Self::Wrong(Finding { kind, wheel, value })
    }
}
