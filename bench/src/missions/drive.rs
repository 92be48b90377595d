//! One mission, driven by each commander.

use std::error::Error;

use vigil_blocks::{Action, RecoveryKind, SensorFrame};
use vigil_missions::learning::Record;
use vigil_robot::injection::Change;
use vigil_sensor_sim::{ActionGate, World};

use super::breakdown::{Breakdown, PresentFault};
use super::commander::{Arm, Commander};
use super::order::order;
use super::pilot::Pilot;
use super::plan::Plan;
use super::recording::EvidenceRecorder;
use super::rules::RuleOutput;
use super::score::{Score, Step, Tally};
use super::told::{self, Knowledge};
use super::{HELP_S, LIMIT_S, ShippedGraph};

/// A mission, driven.
#[derive(Debug, Clone)]
pub struct Mission {
    /// The plan.
    pub plan: Plan,
    /// What it brought, in the order of the commanders.
    pub scores: Vec<Score>,
}

/// Drives a mission with every commander.
///
/// # Errors
/// A world or commander that cannot be made.
pub fn drive(shipped: &ShippedGraph, plan: &Plan, arms: &[Arm]) -> Result<Mission, Box<dyn Error>> {
    let scores: Result<_, _> = arms
        .iter()
        .map(|arm| ride(shipped, plan, *arm, &mut |_, _, _| {}))
        .collect();
    Ok(Mission {
        plan: plan.clone(),
        scores: scores?,
    })
}

/// The world of a mission, what is wrong in it, and who helps.
struct Field<'a> {
    shipped: &'a ShippedGraph,
    world: World,
    pilot: Pilot,
    breakdown: Option<&'a Breakdown>,
    /// Time since the onset, s, and steps that were made; `None` before it and after help.
    since_s: Option<f64>,
    made: usize,
    waited_s: f64,
    run_id: u64,
}

impl<'a> Field<'a> {
    fn new(shipped: &'a ShippedGraph, plan: &'a Plan) -> Result<Self, Box<dyn Error>> {
        let rate_hz = shipped.setup.file.graph.rate_hz;
        let robot = &shipped.setup.robot;
        let world = World::new(robot, &plan.simulator, &plan.segments, rate_hz, plan.seed)?;
        Ok(Self {
            shipped,
            world,
            pilot: Pilot::new(&plan.segments),
            breakdown: plan.breakdown.as_ref(),
            since_s: None,
            made: 0,
            waited_s: 0.0,
            run_id: 1,
        })
    }

    /// What is wrong.
    fn present(&self) -> &'a [PresentFault] {
        let step = self.made.checked_sub(1).zip(self.breakdown);
        step.and_then(|(at, breakdown)| breakdown.steps.get(at))
            .map_or(&[], |step| &step.present)
    }

    fn knowledge(&self) -> Knowledge<'a> {
        let begun = self.breakdown.filter(|_| self.made > 0);
        Knowledge {
            present: self.present(),
            expected: begun.map_or(&[], |breakdown| &breakdown.expected),
            rest_m: self.pilot.rest_m(),
        }
    }

    fn break_what_is_due(&mut self, dt_s: f64) -> Result<(), Box<dyn Error>> {
        let Some(breakdown) = self.breakdown else {
            return Ok(());
        };
        self.since_s = match self.since_s {
            Some(since_s) => Some(since_s + dt_s),
            None => (self.pilot.progress_m() >= breakdown.onset_m).then_some(0.0),
        };
        while let Some(step) = breakdown.steps.get(self.made)
            && self.since_s.is_some_and(|since_s| step.after_s <= since_s)
        {
            if let Some(change) = &step.change {
                self.world.change(self.shipped.change(change)?)?;
            }
            self.made += 1;
        }
        Ok(())
    }

    /// True when help has come: all is mended, for good.
    fn help(&mut self, obeyed: RuleOutput, dt_s: f64) -> Result<bool, Box<dyn Error>> {
        match obeyed.kind {
            RecoveryKind::CallForHelp => self.waited_s += dt_s,
            _ => self.waited_s = 0.0,
        }
        if self.waited_s < HELP_S {
            return Ok(false);
        }
        self.waited_s = 0.0;
        self.world.change(Change::ClearAll)?;
        if self.made > 0 {
            (self.breakdown, self.made) = (None, 0);
        }
        self.run_id += 1;
        self.world.set_run_id(self.run_id);
        Ok(true)
    }
}

/// Drives a mission with Vigil, which after a share of the alarms tries something else, and records
/// the evidence of each epoch with what was true in it.
///
/// # Errors
/// As [`drive`].
pub fn record(
    shipped: &ShippedGraph,
    plan: &Plan,
    tried_share: f64,
) -> Result<Vec<Record>, Box<dyn Error>> {
    let epoch_s = shipped.setup.file.supervisor.epoch_ms * 1e-3;
    let mut recorder = EvidenceRecorder::new(&shipped.setup.decision, epoch_s)?;
    let arm = Arm::Explorer(tried_share);
    ride(shipped, plan, arm, &mut |t_ns, faults, action| {
        recorder.take(t_ns, faults, action);
    })?;
    Ok(recorder.finish())
}

/// Drives a mission with one commander; `watch` is shown the time of each frame in ns, what
/// is wrong, and the action block.
///
/// # Errors
/// A world or commander that cannot be made.
fn ride(
    shipped: &ShippedGraph,
    plan: &Plan,
    arm: Arm,
    watch: &mut dyn FnMut(u64, &[PresentFault], &Action),
) -> Result<Score, Box<dyn Error>> {
    let rate_hz = shipped.setup.file.graph.rate_hz;
    let (dt_s, period_ns) = (1.0 / rate_hz, (1e9 / rate_hz).round() as u64);
    let prices = &shipped.missions.prices;
    let mut field = Field::new(shipped, plan)?;
    let mut commander = Commander::new(shipped, arm, plan.seed)?;
    let mut gate = ActionGate::new(&shipped.setup.robot.limits);
    let mut tally = Tally::default();
    let mut frame = SensorFrame::default();
    field.world.measure(&mut frame);
    // Who drives half as fast has twice the time.
    let limit_s = LIMIT_S / shipped.variation.speed_scale().min(1.0);
    for k in 0..(limit_s * rate_hz) as u64 {
        frame.header.epoch = 1;
        frame.header.seq = k;
        frame.header.t_capture_ns = (k + 1) * period_ns;
        let knowledge = field.knowledge();
        let action = commander.command(&frame, &knowledge, dt_s);
        let obeyed = order(action);
        watch(frame.header.t_capture_ns, field.present(), action);
        let (planned, before) = (field.pilot.command(), field.world.true_state().pose);
        let command = gate.apply(planned, Some(action), frame.header.t_capture_ns);
        field.break_what_is_due(dt_s)?;
        field.world.step(dt_s, command);
        field.world.measure(&mut frame);
        let pose = field.world.true_state().pose;
        let progress_m = field.pilot.progress_m();
        field.pilot.take(pose);
        tally.add(
            prices,
            &Step {
                faults: field.present(),
                obeyed,
                may_stand: told::best(prices, &knowledge).kind == RecoveryKind::CallForHelp,
                moved_m: (pose[0] - before[0]).hypot(pose[1] - before[1]),
                progress_m: field.pilot.progress_m() - progress_m,
                off_path_m: field.pilot.off_path_m(),
                planned_m_s: planned.speed_m_s,
                dt_s,
            },
        );
        if field.pilot.rest_m() <= 0.0 {
            tally.score.done = 1.0;
            break;
        }
        if field.help(obeyed, dt_s)? {
            commander.begin_anew();
        }
    }
    Ok(tally.score)
}
