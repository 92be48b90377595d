//! One mission, driven by each commander.

use std::error::Error;

use vigil_blocks::{RecoveryKind, SensorFrame};
use vigil_robot::injection::Change;
use vigil_sensor_sim::{ActionGate, World};

use super::arm::Arm;
use super::commander::Commander;
use super::plan::Plan;
use super::score::{ObeyedOrder, Pay, Score, Step, Tally, Truth};
use super::{HELP_S, LIMIT_S, ShippedGraph};

/// A mission, driven.
#[derive(Debug, Clone)]
pub struct Mission {
    /// The plan.
    pub plan: Plan,
    /// What it brought, in the order of [`Arm::ALL`].
    pub scores: [Score; Arm::ALL.len()],
}

/// Drives a mission with every commander.
///
/// # Errors
/// A world or commander that cannot be made.
pub fn drive(shipped: &ShippedGraph, plan: Plan) -> Result<Mission, Box<dyn Error>> {
    let mut scores = [Score::default(); Arm::ALL.len()];
    for (score, arm) in scores.iter_mut().zip(Arm::ALL) {
        *score = ride(shipped, &plan, arm)?;
    }
    Ok(Mission { plan, scores })
}

/// The world of a mission, what is wrong in it, and who helps.
struct Field<'a> {
    shipped: &'a ShippedGraph,
    world: World,
    truth: Truth,
    pending: Option<(Change, f64, Truth)>,
    waited_s: f64,
    run_id: u64,
}

impl<'a> Field<'a> {
    fn new(shipped: &'a ShippedGraph, plan: &Plan, rate_hz: f64) -> Result<Self, Box<dyn Error>> {
        let robot = &shipped.setup.robot;
        let world = World::new(robot, &plan.simulator, &plan.segments, rate_hz, plan.seed)?;
        let pending = match &plan.fault {
            None => None,
            Some(fault) => {
                let change = shipped.change(&fault.spec)?;
                Some((change, fault.onset_s, truth_of(shipped, fault)?))
            }
        };
        Ok(Self {
            shipped,
            world,
            truth: nominal(shipped)?,
            pending,
            waited_s: 0.0,
            run_id: 1,
        })
    }

    fn break_what_is_due(&mut self, t_s: f64) -> Result<(), Box<dyn Error>> {
        if let Some((change, _, truth)) = self.pending.filter(|(_, at_s, _)| *at_s <= t_s) {
            self.world.change(change)?;
            self.truth = truth;
            self.pending = None;
        }
        Ok(())
    }

    /// True when help has come: all is mended.
    fn help(&mut self, obeyed: ObeyedOrder, dt_s: f64) -> Result<bool, Box<dyn Error>> {
        match obeyed.kind {
            RecoveryKind::CallForHelp => self.waited_s += dt_s,
            _ => self.waited_s = 0.0,
        }
        if self.waited_s < HELP_S {
            return Ok(false);
        }
        self.waited_s = 0.0;
        self.world.change(Change::ClearAll)?;
        self.truth = nominal(self.shipped)?;
        self.run_id += 1;
        self.world.set_run_id(self.run_id);
        Ok(true)
    }
}

fn nominal(shipped: &ShippedGraph) -> Result<Truth, Box<dyn Error>> {
    Ok(Truth {
        state: state(shipped, "ND")?,
        wheel: None,
        dragged: 0,
    })
}

fn truth_of(shipped: &ShippedGraph, fault: &super::Fault) -> Result<Truth, Box<dyn Error>> {
    let wheel = fault
        .wheel
        .and_then(|name| shipped.setup.robot.wheel_index(name));
    Ok(Truth {
        state: state(shipped, &fault.state)?,
        wheel,
        dragged: usize::from(fault.spec.starts_with("stuck:")),
    })
}

fn state(shipped: &ShippedGraph, name: &str) -> Result<usize, Box<dyn Error>> {
    let found = shipped
        .model()
        .states()
        .iter()
        .position(|state| state == name);
    found.ok_or_else(|| format!("the decision model has no state '{name}'").into())
}

/// Drives a mission with one commander.
fn ride(shipped: &ShippedGraph, plan: &Plan, arm: Arm) -> Result<Score, Box<dyn Error>> {
    let rate_hz = shipped.setup.file.graph.rate_hz;
    let dt_s = 1.0 / rate_hz;
    let period_ns = (1e9 / rate_hz).round() as u64;
    let mut field = Field::new(shipped, plan, rate_hz)?;
    let mut commander = Commander::new(shipped, arm, plan.seed)?;
    let mut gate = ActionGate::new(&shipped.setup.robot.limits);
    let pay = Pay::new(shipped);
    let mut tally = Tally::default();
    let (mut frame, mut planned_s) = (SensorFrame::default(), 0.0);
    field.world.measure(&mut frame);
    for k in 0..(LIMIT_S * rate_hz) as u64 {
        frame.header.epoch = 1;
        frame.header.seq = k;
        frame.header.t_capture_ns = (k + 1) * period_ns;
        let action = commander.command(&frame, field.truth, dt_s);
        field.break_what_is_due(k as f64 * dt_s)?;
        let obeyed = ObeyedOrder::new(action);
        let planned = field.world.planned();
        let command = gate.apply(planned, Some(action), frame.header.t_capture_ns);
        let before = field.world.true_state().pose;
        field.world.step(dt_s, command);
        field.world.measure(&mut frame);
        let pose = field.world.true_state().pose;
        let step = Step {
            truth: field.truth,
            obeyed,
            may_stand: shipped.may_stand(field.truth.state),
            moved_m: (pose[0] - before[0]).hypot(pose[1] - before[1]),
            dt_s,
        };
        tally.add(&pay, &step);
        planned_s += command.progress * dt_s;
        if planned_s >= plan.duration_s() {
            tally.score.done = 1.0;
            break;
        }
        if field.help(obeyed, dt_s)? {
            commander.begin_anew();
        }
    }
    Ok(tally.score)
}
