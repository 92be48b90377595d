//! The filters on recorded runs of the rover that its model was not learned from.

use std::error::Error;
use std::path::Path;

use vigil_decision::Pomdp;
use vigil_identifier::{Leaves, MultipleHypothesis, Posterior, risks};
use vigil_inference::FaultTree;
use vigil_inference::hybrid::Modes;
use vigil_inference::track::TRACK_DIMENSION;
use vigil_recording::frames::{self, Run};
use vigil_recording::labels::{self, Label};
use vigil_robot::Description;
use vigil_robot::learned::{
    FaultRates, Healthy, Model, Moved, NoiseScales, Observation, Observer, Switching,
};
use vigil_setup::schema::Sensors;

use crate::filters::{Kind, build};
use crate::matched::{Outcome, Trace, in_parallel, log_odds, threshold};
use crate::simulated::Rover;

/// The live default, as tables name it.
pub const DEFAULT: &str = "sets of faults (live default)";
/// Share of nominal stretches with a false alarm.
const FALSE_ALARMS: f64 = 0.05;
/// Steps after the onset at which leaf and side are judged: 2 s.
const JUDGED: usize = 40;
/// Rates at which faults vanish, and at which something unknown happens, relative to all faults.
const DEATH_1_S: f64 = 1.0 / 60.0;
const UNKNOWN: f64 = 0.01;

/// Recorded runs, ready for the filters.
pub struct Recorded {
    robot: Description,
    model: Model,
    tree: FaultTree,
    leaves: Leaves,
    decision: Pomdp,
    nominal: Vec<Prepared>,
    stuck: Vec<Prepared>,
    encoders: Vec<Prepared>,
}

/// A run as observations in motion, and its fault.
struct Prepared {
    observations: Vec<Observation>,
    fault: Option<(Moved, Option<usize>)>,
    onset: usize,
}

impl Recorded {
    /// Reads the runs that the shipped model was not learned from.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read(root: &Path) -> Result<Self, Box<dyn Error>> {
        let Rover { robot, model, tree } = Rover::read(root)?;
        let decision = vigil_setup::load_decision(&root.join("config/rover.pomdp"))?;
        let data = root.join("tests/data/rover");
        let runs = frames::read(&data.join("learn_frames.csv.gz"), &robot)?;
        let labels = labels::read(&data.join("learn_runs.csv"), &robot)?;
        let mut recorded = Self {
            nominal: Vec::new(),
            stuck: Vec::new(),
            encoders: Vec::new(),
            leaves: Leaves::new(&tree, &model, &robot, Sensors::PoseEncoders)?,
            tree,
            decision,
            robot,
            model,
        };
        let held_out = recorded.model.provenance.runs_held_out.clone();
        for run in runs.iter().filter(|run| held_out.contains(&run.id)) {
            if let Some(label) = labels.iter().find(|label| label.run == run.id) {
                let prepared = recorded.prepare(run, label);
                match prepared.fault {
                    None => recorded.nominal.push(prepared),
                    Some((Moved::Nominal, _)) => recorded.encoders.push(prepared),
                    Some(_) => recorded.stuck.push(prepared),
                }
            }
        }
        Ok(recorded)
    }

    fn prepare(&self, run: &Run, label: &Label) -> Prepared {
        let mut observer = Observer::new(&self.model, &self.robot);
        let complete = run.frames.iter().filter_map(|frame| {
            let intake = observer.push(frame);
            intake.complete.then(|| *observer.observation())
        });
        let observations: Vec<Observation> = complete.filter(|o| o.moving || o.anchor).collect();
        let onset_s = label.onset_s.unwrap_or(f64::INFINITY);
        let is_before = |o: &&Observation| (o.t_ns as f64) * 1e-9 < onset_s;
        let wheel = label
            .mode
            .split('_')
            .next()
            .and_then(|w| self.robot.wheel_index(w));
        let fault = wheel.map(|wheel| match label.mode.ends_with("_STUCK") {
            true => (Moved::Stuck(1 << wheel), None),
            false => (Moved::Nominal, Some(wheel)),
        });
        Prepared {
            onset: observations.iter().take_while(is_before).count(),
            observations,
            fault,
        }
    }

    /// Time of a step, s.
    #[must_use]
    pub const fn step_s(&self) -> f64 {
        self.model.interval_s
    }

    /// Faulty runs that are judged.
    #[must_use]
    pub const fn runs(&self, with_wheels: bool) -> usize {
        self.stuck.len() + if with_wheels { self.encoders.len() } else { 0 }
    }

    /// Every filter over the same runs, a fault appearing with `p_fault` per step in the filters'
    /// eyes. Without wheel rates encoders break unseen: those runs are left out.
    #[must_use]
    pub fn outcomes(
        &self,
        p_fault: f64,
        with_wheels: bool,
        wanted: &[(Kind, usize)],
    ) -> Vec<Outcome> {
        let wheels: u32 = (1 << self.robot.wheels.len()) - 1;
        let encoders = if with_wheels { wheels } else { 0_u32 };
        let faults = f64::from(wheels.count_ones() + encoders.count_ones());
        let all_1_s = p_fault / self.model.interval_s;
        let rates = FaultRates {
            fault_1_s: all_1_s * (1.0 - UNKNOWN) / faults,
            unknown_1_s: all_1_s * UNKNOWN,
            further: 1.0,
            death_1_s: DEATH_1_S,
        };
        let switching = Switching::new(&self.model, &self.robot, wheels, encoders, &rates);
        let nodes = self.nodes(&switching);
        let risk = self.risks(&switching);
        let mut faulty: Vec<&Prepared> = self.stuck.iter().collect();
        if with_wheels {
            faulty.extend(&self.encoders);
        }
        let nominal: Vec<&Prepared> = self.nominal.iter().chain(&self.stuck).collect();
        let outcome = |&(kind, count): &(Kind, usize)| {
            let traces = |runs: &[&Prepared], until_onset: bool| -> Vec<Trace> {
                let follow = |(seed, run): (usize, &&Prepared)| {
                    let seed = seed as u64;
                    let filter = (kind, count, seed);
                    self.follow(
                        &switching,
                        (&nodes, &risk),
                        filter,
                        run,
                        with_wheels,
                        until_onset,
                    )
                };
                runs.iter().enumerate().map(follow).collect()
            };
            // Stretches without a fault: nominal runs, and the others up to the onset. They set the
            // threshold of each filter in the same way; no other figure comes from them.
            let threshold = threshold(&traces(&nominal, true), FALSE_ALARMS);
            let count = kind.is_sampled().then_some(count);
            Outcome::of(kind.name(), count, threshold, &traces(&faulty, false))
        };
        let mut outcomes = in_parallel(wanted, outcome);
        let traces = |runs: &[&Prepared], until_onset: bool| -> Vec<Trace> {
            let follow =
                |run: &&Prepared| self.follow_default(run, rates, with_wheels, until_onset);
            in_parallel(runs, follow)
        };
        let threshold = threshold(&traces(&nominal, true), FALSE_ALARMS);
        outcomes.push(Outcome::of(
            DEFAULT,
            None,
            threshold,
            &traces(&faulty, false),
        ));
        outcomes
    }

    /// The identifier's own filter over sets of faults.
    fn follow_default(
        &self,
        run: &Prepared,
        rates: FaultRates,
        with_wheels: bool,
        until_onset: bool,
    ) -> Trace {
        let mut filter =
            MultipleHypothesis::new(&self.model, &self.robot, &self.leaves, with_wheels, rates);
        if let Some(first) = run.observations.first() {
            let start = Healthy {
                pose: first.pose.into(),
                ..Healthy::unsure(&self.model, &self.robot)
            };
            filter.restart(&start, first.t_ns);
        }
        let steps = run.steps(until_onset);
        let mut trace = Trace::new(run.onset);
        let mut posterior = Posterior::nominal();
        for (t, observation) in run.observations[..steps].iter().enumerate() {
            filter.step(observation, NoiseScales::default());
            filter.posterior(None, &mut posterior);
            let p = posterior.nodes[0];
            trace.log_odds.push(((1.0 - p) / p).ln());
            if t == run.onset + JUDGED {
                let named = self.meaning(posterior.sets[0].leaves);
                trace.leaf_right = named == run.fault;
                trace.side_right = named.is_some_and(|named| self.side(named) == run.side(self));
            }
        }
        trace
    }

    /// What a set of one leaf says.
    fn meaning(&self, leaves: u64) -> Option<(Moved, Option<usize>)> {
        let is = |leaf: &Option<usize>| leaf.is_some_and(|node| leaves == 1 << node);
        let stuck = self.leaves.stuck.iter().position(is);
        let broken = || self.leaves.encoder.iter().position(is);
        let stuck = stuck.map(|wheel| (Moved::Stuck(1 << wheel), None));
        stuck.or_else(|| broken().map(|wheel| (Moved::Nominal, Some(wheel))))
    }

    /// Risk of each mode, from the decision model that ships.
    fn risks(&self, switching: &Switching) -> Vec<f64> {
        let name = |mode| {
            let leaf = match switching.meaning(mode) {
                (Moved::Unknown | Moved::UnknownAny, _) => return "UNKNOWN",
                (_, Some(wheel)) => self.leaves.encoder[wheel],
                (moved, None) => {
                    let stuck = self.leaves.stuck.iter().enumerate();
                    let mut stuck = stuck.filter(|(wheel, _)| moved.is_stuck(*wheel));
                    stuck.next().and_then(|(_, leaf)| *leaf)
                }
            };
            self.tree.nodes()[leaf.unwrap_or(0)].name.as_str()
        };
        let named: Vec<(&str, f64)> = (0..Modes::modes(switching))
            .map(|k| (name(k), 0.0))
            .collect();
        risks(&self.decision, &named, usize::MAX).unwrap_or_else(|_| vec![1.0; named.len()])
    }

    fn follow(
        &self,
        switching: &Switching,
        models: (&[Vec<usize>], &[f64]),
        (kind, count, seed): (Kind, usize, u64),
        run: &Prepared,
        with_wheels: bool,
        until_onset: bool,
    ) -> Trace {
        let mut switching = switching.clone();
        if let Some(first) = run.observations.first() {
            let variance = first.pose_variance(&self.model, [1.0; 3]);
            let spread = nalgebra::Matrix3::from_diagonal(&variance.into());
            switching.start_at(first.pose.into(), spread);
        }
        let mut filter = build::<_, TRACK_DIMENSION>(kind, &switching, models, count, seed);
        let steps = run.steps(until_onset);
        let mut trace = Trace::new(run.onset);
        for (t, observation) in run.observations[..steps].iter().enumerate() {
            let seen = filter
                .model()
                .look(observation, NoiseScales::default(), with_wheels);
            filter.step(&seen);
            trace.log_odds.push(log_odds(filter.posterior()));
            if t == run.onset + JUDGED {
                let p = filter.posterior();
                let best = (0..p.len()).max_by(|&a, &b| p[a].total_cmp(&p[b]));
                let named = best.map(|best| switching.meaning(best));
                trace.leaf_right = named == run.fault;
                trace.side_right = named.is_some_and(|named| self.side(named) == run.side(self));
            }
        }
        trace
    }

    /// Modes of stuck wheels of the left and right, and of the encoders.
    fn nodes(&self, switching: &Switching) -> Vec<Vec<usize>> {
        let of = |side| {
            let modes = 1..Modes::modes(switching);
            modes
                .filter(|&mode| self.side(switching.meaning(mode)) == side)
                .collect()
        };
        let nodes: Vec<Vec<usize>> = [Side::Left, Side::Right, Side::Encoder].map(of).into();
        nodes.into_iter().filter(|modes| modes.len() > 1).collect()
    }

    fn side(&self, (moved, broken): (Moved, Option<usize>)) -> Side {
        match (moved, broken) {
            (Moved::Stuck(mask), _) => {
                let wheel = mask.trailing_zeros() as usize;
                match self.robot.wheels[wheel].y > 0.0 {
                    true => Side::Left,
                    false => Side::Right,
                }
            }
            (_, Some(_)) => Side::Encoder,
            _ => Side::None,
        }
    }
}

impl Prepared {
    const fn steps(&self, until_onset: bool) -> usize {
        if until_onset {
            self.onset
        } else {
            self.observations.len()
        }
    }

    fn side(&self, recorded: &Recorded) -> Side {
        self.fault.map_or(Side::None, |fault| recorded.side(fault))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Left,
    Right,
    Encoder,
    None,
}
