//! One mission in a corridor, driven by each commander.

use std::error::Error;

use vigil_blocks::{Action, RecoveryKind, SensorFrame};
use vigil_missions::learning::Record;
use vigil_robot::Injection;
use vigil_sensor_sim::{NavigatorEvent, SensorSource, Simulation};
use vigil_setup::Setup;

use super::commander::{CorridorArm, CorridorCommander};
use super::plan::CorridorPlan;
use super::recording::StepRecorder;
use super::score::{CorridorScore, Step, Tally, pose_error};
use super::{CorridorGraph, LIMIT_S};
use crate::missions::{PresentFault, order};

/// A mission, driven.
#[derive(Debug, Clone)]
pub struct CorridorMission {
    /// The plan.
    pub plan: CorridorPlan,
    /// What it brought, in the order of the commanders.
    pub scores: Vec<CorridorScore>,
}

/// Drives a mission with every commander.
///
/// # Errors
/// A world or commander that cannot be made.
pub fn drive(
    graph: &CorridorGraph,
    plan: &CorridorPlan,
    arms: &[CorridorArm],
) -> Result<CorridorMission, Box<dyn Error>> {
    let setup = setup_of(graph, plan);
    let scores: Result<_, _> = arms
        .iter()
        .map(|arm| ride(graph, &setup, plan, *arm, &mut |_, _| {}))
        .collect();
    Ok(CorridorMission {
        plan: plan.clone(),
        scores: scores?,
    })
}

pub(super) fn setup_of(graph: &CorridorGraph, plan: &CorridorPlan) -> Setup {
    let mut setup = graph.setup.clone();
    setup.file.navigation = Some(plan.navigation.clone());
    setup.file.simulator = plan.simulator.clone();
    setup.file.graph.seed = plan.seed;
    setup
}

/// The corridor of a mission, and what breaks in it.
struct Field<'a> {
    simulation: Simulation,
    setup: &'a Setup,
    plan: &'a CorridorPlan,
    faults: Vec<PresentFault>,
    t_s: f64,
    is_due: bool,
}

impl<'a> Field<'a> {
    fn new(setup: &'a Setup, plan: &'a CorridorPlan) -> Result<Self, Box<dyn Error>> {
        let SensorSource::Simulator(simulation, _) = vigil_sensor_sim::assemble(setup, &[])? else {
            return Err("a corridor is simulated".into());
        };
        Ok(Self {
            simulation: *simulation,
            setup,
            plan,
            faults: Vec::new(),
            t_s: 0.0,
            is_due: plan.hardware.is_some(),
        })
    }

    fn break_what_is_due(&mut self, dt_s: f64) -> Result<(), Box<dyn Error>> {
        self.t_s += dt_s;
        let due = self.plan.hardware.as_ref();
        let Some(fault) = due.filter(|it| self.is_due && it.at_s <= self.t_s) else {
            return Ok(());
        };
        let change = Injection::parse_change(&fault.change, &self.setup.robot)?;
        self.simulation.change(change)?;
        self.faults.push(PresentFault {
            cause: fault.cause,
            severity: 1.0,
        });
        self.is_due = false;
        Ok(())
    }

    fn pose(&self) -> [f64; 3] {
        self.simulation.world.true_state().pose
    }
}

/// Drives a mission with a commander that at times tries something else, and records the steps of
/// the decision model with what was true after each.
///
/// # Errors
/// As [`drive`].
pub fn record(
    graph: &CorridorGraph,
    plan: &CorridorPlan,
    tried_share: f64,
) -> Result<Record, Box<dyn Error>> {
    let setup = setup_of(graph, plan);
    let range_m = plan.navigation.slow_m;
    let mut recorder = StepRecorder::new(&graph.setup.decision, range_m);
    let arm = CorridorArm::Explorer(tried_share);
    ride(graph, &setup, plan, arm, &mut |field, action| {
        recorder.take(action, &field.simulation, &field.faults);
    })?;
    Ok(recorder.finish())
}

/// Drives a mission with one commander; `watch` is shown each action block and the world in which
/// it was decided.
fn ride(
    graph: &CorridorGraph,
    setup: &Setup,
    plan: &CorridorPlan,
    arm: CorridorArm,
    watch: &mut dyn FnMut(&Field<'_>, &Action),
) -> Result<CorridorScore, Box<dyn Error>> {
    let rate_hz = setup.file.graph.rate_hz;
    let (dt_s, period_ns) = (1.0 / rate_hz, (1e9 / rate_hz).round() as u64);
    let mut field = Field::new(setup, plan)?;
    let mut commander = CorridorCommander::new(setup, arm, plan.seed)?;
    let mut tally = Tally::default();
    let mut frame = SensorFrame::default();
    field.simulation.measure(&mut frame);
    for k in 0..(LIMIT_S * rate_hz) as u64 {
        frame.header.epoch = 1;
        frame.header.seq = k;
        frame.header.t_capture_ns = (k + 1) * period_ns;
        let action = commander.command(&frame, dt_s);
        watch(&field, action);
        let obeyed = order(action);
        field.break_what_is_due(dt_s)?;
        let before = field.pose();
        let run_id = frame.run_id;
        field
            .simulation
            .step(dt_s, Some(action), frame.header.t_capture_ns);
        field.simulation.measure(&mut frame);
        let pose = field.pose();
        tally.add(
            &graph.file.prices,
            &graph.faults,
            &Step {
                faults: &field.faults,
                obeyed,
                moved_m: (pose[0] - before[0]).hypot(pose[1] - before[1]),
                pose_error: pose_error(&frame, pose),
                touches: field.simulation.touches(),
                planned_m_s: plan.navigation.speed_m_s,
                dt_s,
            },
        );
        if let Some(NavigatorEvent::Goal) = field.simulation.take_event() {
            tally.arrive(&graph.file.prices, plan.off_goal_m(pose));
            break;
        }
        // Help has mended the hardware; a place that was found has not.
        if frame.run_id != run_id && obeyed.kind == RecoveryKind::CallForHelp {
            field.faults.clear();
        }
        if obeyed.kind == RecoveryKind::GiveUp {
            break;
        }
    }
    Ok(tally.score)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corridors::Exception;
    use crate::variation::Variation;

    #[test]
    fn a_ladder_goes_through_an_opening_to_its_goal() {
        let graph = CorridorGraph::read(Variation::default(), None).unwrap();
        let mut plans = (0..).map(|seed| graph.plan(seed));
        // Smaller ones leave the middle of the corridor free; another way would do as well.
        let blocks = |plan: &CorridorPlan| {
            let navigation = &plan.navigation;
            navigation.alternative.is_empty() && navigation.obstacle[0].radius_m > 0.5
        };
        let plan = plans.find(|it| it.exceptions == [Exception::Opening] && blocks(it));
        let arms = [CorridorArm::Ladder(graph.file.ladder), CorridorArm::Without];
        let [ladder, without] = drive(&graph, &plan.unwrap(), &arms).unwrap().scores[..] else {
            unreachable!("two commanders have two scores");
        };
        assert_eq!((ladder.done, ladder.calls), (1.0, 0.0), "{ladder:?}");
        // Without a rung it would stand until the end.
        assert!(ladder.time_s < 60.0, "{ladder:?}");
        assert_eq!(without.done, 0.0, "without, it stands before it");
    }
}
