//! The simulated rover on its way through a run, and its frames.

use std::error::Error;
use std::iter::Peekable;
use std::slice::Iter;

use vigil_blocks::SensorFrame;
use vigil_robot::Injection;
use vigil_sensor_sim::{DriveCommand, EffectiveCommand, World};

use super::frames::{Fate, Way};
use super::ground::Ground;

/// The world of one run, frame by frame.
pub(super) struct Passage<'a> {
    world: World,
    ground: Ground,
    way: Way,
    pending: Peekable<Iter<'a, Injection>>,
    rate_hz: f64,
    steps: u64,
    /// Time of the last frame, s.
    pub(super) t_s: f64,
    /// The last frame, and what happens to it.
    pub(super) frame: SensorFrame,
    pub(super) fate: Fate,
    /// The frame before, if the last one has overtaken it.
    pub(super) held: Option<SensorFrame>,
}

impl<'a> Passage<'a> {
    /// The beginning of a run in a world that `changes` in the order of time.
    ///
    /// # Errors
    /// A ground that the world refuses.
    pub(super) fn begin(
        mut world: World,
        (ground, way): (Ground, Way),
        changes: &'a [Injection],
        rate_hz: f64,
    ) -> Result<Self, Box<dyn Error>> {
        ground.begin(&mut world)?;
        Ok(Self {
            world,
            ground,
            way,
            pending: changes.iter().peekable(),
            rate_hz,
            steps: 0,
            t_s: 0.0,
            frame: SensorFrame::default(),
            fate: Fate::Comes,
            held: None,
        })
    }

    /// Drives on to the next frame; `command` says what becomes of the planned one.
    ///
    /// # Errors
    /// A change of the world that is refused.
    pub(super) fn advance(
        &mut self,
        command: impl FnOnce(DriveCommand) -> EffectiveCommand,
    ) -> Result<(), Box<dyn Error>> {
        self.held = (self.fate == Fate::Overtaken).then_some(self.frame);
        while let Some(injection) = self.pending.next_if(|change| change.at_s <= self.t_s) {
            self.world.change(injection.change)?;
        }
        let (planned, before) = (self.world.planned(), self.world.true_state().pose);
        let due_s = (self.steps + 1) as f64 / self.rate_hz;
        let dt_s = self.way.instant_s(self.t_s, due_s) - self.t_s;
        self.world.step(dt_s, command(planned));
        self.t_s += dt_s;
        self.world.measure(&mut self.frame);
        let pose = self.world.true_state().pose;
        let way_m = (pose[0] - before[0]).hypot(pose[1] - before[1]);
        self.ground.advance(way_m, &mut self.world)?;
        self.way.blur(&mut self.frame, pose, dt_s);
        self.frame.header.epoch = 1;
        self.frame.header.seq = self.steps;
        self.frame.header.t_capture_ns = (1e9 * self.way.stamp_s(self.t_s)).round() as u64;
        self.fate = self.way.fate(self.t_s);
        self.steps += 1;
        Ok(())
    }

    /// Calls `take` with what arrives in place of the last frame; none for one that is missed.
    pub(super) fn deliver(&self, take: &mut dyn FnMut(Option<&SensorFrame>)) {
        self.fate.deliver(&self.frame, self.held.as_ref(), take);
    }
}
