//! The simulated rover: drive, soil, slip, sensors, faults and disturbances.

use vigil_blocks::{ActionOutcome, SensorFrame};
use vigil_robot::disturbance_kind::{KINDS, Place, SIDES};
use vigil_robot::injection::Change;
use vigil_robot::kinematics::{ROVER_WHEELS, advance, wrap_angle};
use vigil_robot::slip::{Condition, Situation, SlipModel, Solution};
use vigil_robot::{ChannelMap, Description, Disturbance, DisturbanceKind, Fault, FaultKind};
use vigil_setup::Ranges;
use vigil_setup::graph_file::{DriveSegment, Simulator};

use crate::action_gate::EffectiveCommand;
use crate::active_disturbances::ActiveDisturbances;
use crate::check::{self, WorldError};
use crate::drive::{Drive, DriveCommand, RateLimiter};
use crate::encoders::Encoders;
use crate::noise::Noise;
use crate::pose_sensor::PoseSensor;
use crate::soil::SoilPath;

/// Motor current per torque, A/(N m). Chosen: the simulated motors with their gear.
pub const CURRENT_PER_TORQUE_A_N_M: f64 = 2.0;
/// Longest step of the physics, s; longer cycles are divided. Also the interval at which the slip
/// equilibrium follows soil and command: well below the body's lag and the soil's scatter length.
const STEP_MAX_S: f64 = 0.01;
/// Longest cycle, s. Chosen: a cycle of more than a hundred steps would miss further deadlines, so
/// simulated time falls behind instead.
const CYCLE_MAX_S: f64 = 1.0;
/// Velocity, m/s and rad/s, below which a stopped body stands still. Chosen: far below what a pose
/// shows; without it the decay of the lag would never end.
const STILL: f64 = 1e-5;

/// The true state of the rover, for tests and labels; no filter gets it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueState {
    /// x m, y m, yaw rad (not wrapped).
    pub pose: [f64; 3],
    /// Body velocity: forward m/s, left m/s, yaw rate rad/s.
    pub velocity: [f64; 3],
    /// Wheel rates, rad/s.
    pub wheel_rate_rad_s: [f64; ROVER_WHEELS],
    /// Motor torques, N m.
    pub torque_n_m: [f64; ROVER_WHEELS],
    /// Which wheels are stuck.
    pub stuck: [bool; ROVER_WHEELS],
}

/// The simulated rover in its world.
#[derive(Debug, Clone)]
pub struct World {
    map: ChannelMap,
    ranges: Ranges<Simulator>,
    model: SlipModel,
    drive: Drive,
    executed: RateLimiter,
    planned: RateLimiter,
    planned_pose: [f64; 3],
    pose: [f64; 3],
    velocity: [f64; 3],
    lag_s: f64,
    soil: SoilPath,
    /// The last equilibrium, and how long ago it was found.
    motion: Solution,
    motion_age_s: f64,
    stuck: [bool; ROVER_WHEELS],
    active: ActiveDisturbances,
    /// State of body and wheels under the disturbances.
    condition: Condition,
    pose_sensor: PoseSensor,
    encoders: Encoders,
    /// Since the start, s.
    elapsed_s: f64,
    noise: Noise,
    run_id: u64,
    safe_stop: bool,
    action_seq: u64,
    outcome: ActionOutcome,
    unsolved: u64,
    invalid: u64,
}

impl World {
    /// A rover at rest at the origin, about to drive `drive` (standing still if it is empty), with
    /// sensors read `rate_hz` times a second. Equal arguments give equal worlds.
    ///
    /// # Errors
    /// [`WorldError`] naming what is out of range.
    pub fn new(
        robot: &Description,
        settings: &Simulator,
        drive: &[DriveSegment],
        rate_hz: f64,
        seed: u64,
    ) -> Result<Self, WorldError> {
        check::rate(rate_hz)?;
        let ranges = Ranges::default();
        ranges.check(settings)?;
        check::drive(drive)?;
        check::noise(robot)?;
        let model = SlipModel::new(robot)?;
        let rest = Situation {
            curvature_1_m: 0.0,
            speed_m_s: 0.0,
            stuck: [false; ROVER_WHEELS],
            soil: model.soil(),
            condition: Condition::default(),
        };
        let Ok(motion) = model.solve(&rest, None) else {
            return Err(check::quantity("speed at rest", 0.0, "always solvable"));
        };
        // One stream each, so that a fault changes no healthy channel's noise.
        let stream = |n: u64| seed.wrapping_mul(4).wrapping_add(n);
        Ok(Self {
            map: ChannelMap::new(robot),
            ranges,
            model,
            drive: Drive::new(drive),
            executed: RateLimiter::default(),
            planned: RateLimiter::default(),
            planned_pose: [0.0; 3],
            pose: [0.0; 3],
            velocity: [0.0; 3],
            lag_s: settings.lag_s,
            soil: SoilPath::new(settings, stream(0)),
            motion,
            motion_age_s: f64::INFINITY,
            stuck: [false; ROVER_WHEELS],
            active: ActiveDisturbances::none(),
            condition: Condition::default(),
            pose_sensor: PoseSensor::new(rate_hz, stream(3)),
            encoders: Encoders::new(rate_hz, stream(1)),
            elapsed_s: 0.0,
            noise: Noise::new(&robot.noise, rate_hz, settings.noise_scale, stream(2)),
            run_id: 1,
            safe_stop: false,
            action_seq: 0,
            outcome: ActionOutcome::None,
            unsolved: 0,
            invalid: 0,
        })
    }

    /// What the drive wants now: input of [`crate::action_gate::ActionGate::apply`].
    #[must_use]
    pub fn planned(&self) -> DriveCommand {
        self.drive.command()
    }

    /// Moves the world on by `dt_s` under `command`. Steering and speed follow it at limited
    /// rates; the drive's clock runs at the command's `progress`, so that a slowed rover drives
    /// the same path. A step that is not a positive number of seconds, or a command that is not
    /// finite, is counted and not executed: the rover then stops.
    pub fn step(&mut self, dt_s: f64, command: EffectiveCommand) {
        if !(dt_s.is_finite() && dt_s > 0.0) {
            self.invalid += 1;
            return;
        }
        let command = self.checked(command);
        let cycle_s = dt_s.min(CYCLE_MAX_S);
        self.elapsed_s += cycle_s;
        self.pose_sensor.advance(cycle_s, &self.active);
        self.encoders.advance(cycle_s, &self.active);
        let parts = (cycle_s / STEP_MAX_S).ceil().max(1.0);
        let part_s = cycle_s / parts;
        for _ in 0..parts as u32 {
            self.move_on(part_s, &command);
        }
        self.safe_stop = command.rejection.is_some();
        self.action_seq = command.action_seq;
        let reached = self.executed.at == command.target;
        self.outcome = match (command.action_seq, command.rejection.is_some()) {
            (0, _) => ActionOutcome::None,
            (_, true) => ActionOutcome::Failed,
            (_, false) if reached => ActionOutcome::Succeeded,
            (_, false) => ActionOutcome::Running,
        };
    }

    /// Reads the sensors into `frame`; its header is left to the caller. Exactly
    /// what this rover measures is marked as measured.
    pub fn measure(&mut self, frame: &mut SensorFrame) {
        *frame = SensorFrame {
            header: frame.header,
            run_id: self.run_id,
            robot_hash: self.map.hash(),
            action_seq: self.action_seq,
            action_outcome: self.outcome as u32,
            safe_stop: u32::from(self.safe_stop),
            ..SensorFrame::default()
        };
        let DriveCommand {
            curvature_1_m,
            speed_m_s,
        } = self.executed.at;
        frame.set_command(0, curvature_1_m);
        frame.set_command(1, speed_m_s);

        let active = &self.active;
        let noise = &mut self.noise;
        let mut pose = self.pose_sensor.distort(self.pose, active);
        pose[0] += noise.draw(noise.position_m);
        pose[1] += noise.draw(noise.position_m);
        pose[2] = wrap_angle(pose[2] + noise.draw(noise.yaw_rad));
        if let Some(pose) = self.pose_sensor.report(self.elapsed_s, pose, active) {
            self.map.set_pose(frame, pose);
        }
        let yaw_rate = active.yaw_rate(self.velocity[2], noise.draw(noise.yaw_rate_rad_s));
        self.map.set_yaw_rate(frame, yaw_rate);
        let [x, y, yaw] = self.planned_pose;
        frame.set_planned([x, y, wrap_angle(yaw)]);

        let kinematics = self.model.kinematics();
        let steer_rad = kinematics.targets(curvature_1_m, speed_m_s).steer_rad;
        let mut rates_rad_s = [0.0; ROVER_WHEELS];
        for (i, &steer) in steer_rad.iter().enumerate() {
            let rate = self
                .encoders
                .scaled(i, self.motion.wheel_rate_rad_s[i], active);
            rates_rad_s[i] = rate + noise.draw(noise.wheel_rate_rad_s);
            let current = CURRENT_PER_TORQUE_A_N_M * self.motion.torque_n_m[i];
            let current = active.current(i, current, noise.draw(noise.current_a));
            self.map.set_current(frame, i, current);
            if kinematics.steered[i] {
                let steer = active.steer(i, steer) + noise.draw(noise.steer_rad);
                self.map.set_steer(frame, i, steer);
            }
        }
        let rates_rad_s = self.encoders.report(self.elapsed_s, rates_rad_s, active);
        for (wheel, rate_rad_s) in rates_rad_s.into_iter().enumerate() {
            self.map.set_wheel_rate(frame, wheel, rate_rad_s);
        }
    }

    /// Starts a fault. A wheel may be stuck and have a broken encoder at once; a new fault of an
    /// encoder replaces its old one.
    ///
    /// # Errors
    /// [`WorldError::Wheel`].
    pub fn inject(&mut self, fault: Fault) -> Result<(), WorldError> {
        check::wheel(fault.wheel)?;
        match fault.kind {
            FaultKind::Stuck => self.set_stuck(fault.wheel, true),
            kind => self.encoders.set(fault.wheel, Some(kind)),
        }
        Ok(())
    }

    /// Starts a disturbance; it replaces one of its kind at its place.
    ///
    /// # Errors
    /// [`WorldError`] if its place does not exist or a parameter is out of range.
    pub fn disturb(&mut self, disturbance: Disturbance) -> Result<(), WorldError> {
        disturbance.check()?;
        let place = disturbance.place;
        let kinematics = self.model.kinematics();
        let there = match disturbance.kind.spec().place {
            Place::Rover => place == 0,
            Place::Side => place < SIDES.len(),
            Place::Wheel => place < ROVER_WHEELS,
            Place::SteeredWheel => kinematics.steered.get(place) == Some(&true),
        };
        if !(there && self.active.set(&disturbance)) {
            return Err(WorldError::Place {
                kind: disturbance.kind.spec().form(),
                found: place,
            });
        }
        self.pose_sensor.begin(&disturbance, self.pose);
        self.update_condition();
        Ok(())
    }

    /// Ends every fault and disturbance of one wheel.
    ///
    /// # Errors
    /// [`WorldError::Wheel`].
    pub fn clear(&mut self, wheel: usize) -> Result<(), WorldError> {
        check::wheel(wheel)?;
        self.set_stuck(wheel, false);
        self.encoders.set(wheel, None);
        for row in &KINDS {
            if matches!(row.place, Place::Wheel | Place::SteeredWheel) {
                self.active.end(row.kind, Some(wheel));
            }
        }
        self.update_condition();
        Ok(())
    }

    /// Ends a kind of disturbance, at one place or everywhere.
    pub fn end_disturbance(&mut self, kind: DisturbanceKind, place: Option<usize>) {
        self.active.end(kind, place);
        self.update_condition();
    }

    /// Makes a change.
    ///
    /// # Errors
    /// [`WorldError`] naming what does not exist or is out of range.
    pub fn change(&mut self, change: Change) -> Result<(), WorldError> {
        match change {
            Change::Inject(fault) => self.inject(fault),
            Change::Disturb(disturbance) => self.disturb(disturbance),
            Change::Clear(wheel) => self.clear(wheel),
            Change::EndDisturbance(kind, place) => {
                self.end_disturbance(kind, place);
                Ok(())
            }
            Change::ClearAll => {
                KINDS
                    .iter()
                    .for_each(|row| self.end_disturbance(row.kind, None));
                (0..ROVER_WHEELS).try_for_each(|wheel| self.clear(wheel))
            }
        }
    }

    /// True while a fault or disturbance is in force.
    #[must_use]
    pub fn is_disturbed(&self) -> bool {
        self.stuck.contains(&true) || self.encoders.is_broken() || self.active.is_any()
    }

    /// Changes mean friction coefficient and shear modulus during the drive. The scatter about them
    /// stays.
    ///
    /// # Errors
    /// [`WorldError::Setting`].
    pub fn set_ground(&mut self, friction: f64, shear_modulus: f64) -> Result<(), WorldError> {
        self.ranges.check(&Simulator {
            friction,
            shear_modulus,
            ..Simulator::default()
        })?;
        self.soil.set(friction, shear_modulus);
        Ok(())
    }

    /// The true state.
    #[must_use]
    pub fn true_state(&self) -> TrueState {
        TrueState {
            pose: self.pose,
            velocity: self.velocity,
            wheel_rate_rad_s: self.motion.wheel_rate_rad_s,
            torque_n_m: self.motion.torque_n_m,
            stuck: self.stuck,
        }
    }

    /// Sets the rover down, at rest, at x m, y m, yaw rad.
    pub const fn set_at(&mut self, pose: [f64; 3]) {
        (self.pose, self.velocity) = (pose, [0.0; 3]);
    }

    /// Sets the run's id as it appears in the frames; 1 at first. A new id resets every filter.
    pub fn set_run_id(&mut self, run_id: u64) {
        self.run_id = run_id;
    }

    /// Begins another run, which resets every filter.
    pub const fn begin_run(&mut self) {
        self.run_id = self.run_id.wrapping_add(1);
    }

    /// Steps without an equilibrium, which kept the last one: there is none where forces from
    /// outside exceed the soil's strength.
    #[must_use]
    pub const fn unsolved(&self) -> u64 {
        self.unsolved
    }

    /// Steps and commands that were not finite, and therefore not executed.
    #[must_use]
    pub const fn invalid(&self) -> u64 {
        self.invalid
    }

    fn set_stuck(&mut self, wheel: usize, stuck: bool) {
        self.stuck[wheel] = stuck;
        self.motion_age_s = f64::INFINITY;
    }

    /// After a change of the disturbances: the next step solves the equilibrium again.
    fn update_condition(&mut self) {
        self.condition = self.active.condition();
        self.motion_age_s = f64::INFINITY;
    }

    /// A command that cannot be executed becomes a stop.
    fn checked(&mut self, command: EffectiveCommand) -> EffectiveCommand {
        let target = command.target;
        let finite = target.curvature_1_m.is_finite() && target.speed_m_s.is_finite();
        if finite && (0.0..=1.0).contains(&command.progress) {
            return command;
        }
        self.invalid += 1;
        EffectiveCommand {
            target: DriveCommand {
                curvature_1_m: self.executed.at.curvature_1_m,
                speed_m_s: 0.0,
            },
            progress: 0.0,
            rejection: Some(vigil_blocks::ActionRejection::Nothing),
            action_seq: command.action_seq,
        }
    }

    fn move_on(&mut self, dt_s: f64, command: &EffectiveCommand) {
        let mut planned = self.drive.command();
        planned.speed_m_s *= command.progress;
        self.drive.advance(dt_s * command.progress);
        self.planned.follow(planned, dt_s);
        let ideal = self.planned.at;
        let ideal_yaw_rate = ideal.curvature_1_m * ideal.speed_m_s;
        let ideal = [ideal.speed_m_s, 0.0, ideal_yaw_rate];
        self.planned_pose = advance(self.planned_pose, ideal, dt_s);

        self.executed.follow(command.target, dt_s);
        self.find_motion(dt_s);
        // First-order lag toward the equilibrium; the mean over the step moves the pose.
        let decay = if self.lag_s > 0.0 {
            (-dt_s / self.lag_s).exp()
        } else {
            0.0
        };
        let mean_share = (1.0 - decay) * self.lag_s / dt_s;
        let mut mean = [0.0; 3];
        for (axis, mean) in mean.iter_mut().enumerate() {
            let target = self.motion.velocity[axis];
            let off = self.velocity[axis] - target;
            *mean = target + off * mean_share;
            self.velocity[axis] = target + off * decay;
        }
        let stopped = self.executed.at.speed_m_s == 0.0;
        if stopped && self.velocity.iter().all(|value| value.abs() < STILL) {
            self.velocity = [0.0; 3];
            return;
        }
        self.pose = advance(self.pose, mean, dt_s);
        self.soil.advance(mean[0].hypot(mean[1]) * dt_s);
    }

    /// Solves the slip equilibrium every [`STEP_MAX_S`], and at once when the rover starts or stops
    /// or a fault or disturbance changes.
    fn find_motion(&mut self, dt_s: f64) {
        let at = self.executed.at;
        self.motion_age_s += dt_s;
        // Half a step of tolerance: rounding must not stretch the interval by a whole cycle.
        if at.speed_m_s != 0.0 && self.motion_age_s + 0.5 * dt_s < STEP_MAX_S {
            return;
        }
        let situation = Situation {
            curvature_1_m: at.curvature_1_m,
            speed_m_s: at.speed_m_s,
            stuck: self.stuck,
            soil: self.active.soil(self.soil.here(), self.model.kinematics()),
            condition: self.condition,
        };
        // From rest the ideal motion is the better start.
        let moves = self.motion.velocity != [0.0; 3];
        let start = moves.then(|| self.motion.unknowns());
        match self.model.solve(&situation, start.as_ref()) {
            Ok(motion) => self.motion = motion,
            Err(_) => self.unsolved += 1,
        }
        let rests = at.speed_m_s == 0.0;
        self.motion_age_s = if rests { f64::INFINITY } else { 0.0 };
    }
}
