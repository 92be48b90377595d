//! Rare faults in simulated runs of the planar rover: who sees them, when, and which.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_evaluation::cases::Planar;
use vigil_inference::filter::Filter;
use vigil_inference::hybrid::{Modes, Sampled};
use vigil_inference::lanes::Observation;

use crate::filters::{Kind, build};
use crate::matched::{Outcome, Trace, in_parallel, log_odds, threshold};

/// Steps without and with the fault.
const NOMINAL: usize = 100;
const FAULTY: usize = 150;
/// Share of nominal runs of as many steps with a false alarm.
const FALSE_ALARMS: f64 = 0.05;
/// Probability per step that a fault vanishes, as the filters know it; those simulated stay.
const RECOVERY: f64 = 0.01;
/// Nominal runs that set the threshold.
const CALIBRATION_RUNS: u64 = 100;
/// Time of a step, s.
pub const STEP_S: f64 = 0.1;

/// A set of runs.
#[derive(Debug, Clone, Copy)]
pub struct Scenario {
    /// Probability of a fault per step, as the filters know it.
    pub p_fault: f64,
    /// True if wheel rates are measured too.
    pub with_wheels: bool,
    /// Number of runs; each has one fault, the same for every filter.
    pub runs: u64,
}

/// A fault and what is seen of a run with it.
type Run = (usize, Vec<Observation>);

/// Runs every filter over the same simulated runs.
#[must_use]
pub fn rare_faults(
    planar: &Planar,
    (nodes, risk): (&[Vec<usize>], &[f64]),
    scenario: &Scenario,
    wanted: &[(Kind, usize)],
) -> Vec<Outcome> {
    let model = planar.clone().with_rates(scenario.p_fault, RECOVERY);
    let nominal: Vec<Run> = (0..CALIBRATION_RUNS)
        .map(|seed| simulate(&model, scenario, false, 2_000_000 + seed))
        .collect();
    let faulty: Vec<Run> = (0..scenario.runs)
        .map(|seed| simulate(&model, scenario, true, 1_000_000 + seed))
        .collect();
    let outcome = |&(kind, count): &(Kind, usize)| {
        let traces = |runs: &[Run]| -> Vec<Trace> {
            let runs = runs.iter().enumerate();
            runs.map(|(seed, run)| {
                let mut filter = build::<_, 3>(kind, &model, (nodes, risk), count, seed as u64);
                follow(&mut *filter, run, nodes)
            })
            .collect()
        };
        let threshold = threshold(&traces(&nominal), FALSE_ALARMS);
        let count = kind.is_sampled().then_some(count);
        Outcome::of(kind.name(), count, threshold, &traces(&faulty))
    };
    in_parallel(wanted, outcome)
}

fn follow<F: Filter<Observation = Observation> + ?Sized>(
    filter: &mut F,
    (fault, observations): &Run,
    nodes: &[Vec<usize>],
) -> Trace {
    let follow = |z| {
        filter.step(z);
        log_odds(filter.posterior())
    };
    let log_odds = observations.iter().map(follow).collect();
    let p = filter.posterior();
    let best = (0..p.len())
        .max_by(|&a, &b| p[a].total_cmp(&p[b]))
        .unwrap_or(0);
    // Left or right for stuck wheels; an encoder for encoders.
    let node = |mode: usize| nodes.iter().position(|leaves| leaves.contains(&mode));
    Trace {
        log_odds,
        onset: NOMINAL,
        leaf_right: best == *fault,
        side_right: best != 0 && node(best) == node(*fault),
    }
}

fn simulate(model: &Planar, scenario: &Scenario, is_faulty: bool, seed: u64) -> Run {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    // Without wheel rates a broken encoder shows nowhere.
    let last = if scenario.with_wheels {
        Modes::modes(model) - 1
    } else {
        6
    };
    let fault = rng.random_range(1..=last);
    let mut pose: Vector3<f64> = model.draw(0, &mut rng);
    let observations = (0..NOMINAL + FAULTY)
        .map(|t| {
            let mode = if is_faulty && t >= NOMINAL { fault } else { 0 };
            pose = model.propagate(mode, &pose, &mut rng);
            model.measure(mode, &pose, scenario.with_wheels, &mut rng)
        })
        .collect();
    (fault, observations)
}
