//! Rare faults in simulated runs of the planar rover: who sees them, when, and which.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use vigil_evaluation::cases::Planar;
use vigil_inference::filter::Filter;
use vigil_inference::hybrid::{Modes, Sampled};
use vigil_inference::lanes::Observation;

use crate::filters::{Kind, build};

/// Steps without and with the fault.
const NOMINAL: usize = 100;
const FAULTY: usize = 150;
/// Probability of any fault at which a filter alarms.
const ALARM: f64 = 0.9;
const COUNTS: [usize; 3] = [100, 1_000, 10_000];

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

/// What one filter did in all runs.
#[derive(Debug, Clone)]
pub struct Cell {
    kind: Kind,
    count: Option<usize>,
    missed: u64,
    false_alarms: u64,
    delays: Vec<usize>,
    leaf_right: u64,
    side_right: u64,
    runs: u64,
}

impl Cell {
    /// Raw data.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "filter": self.kind.name(), "particles": self.count, "runs": self.runs,
            "missed": self.missed, "false_alarms": self.false_alarms,
            "delays_steps": self.delays, "leaf_right": self.leaf_right,
            "side_right": self.side_right,
        })
    }

    /// A row of the table.
    #[must_use]
    pub fn row(&self) -> String {
        let percent = |n: u64| 100.0 * n as f64 / self.runs as f64;
        let detected = self.delays.len().max(1) as f64;
        let delay = self.delays.iter().sum::<usize>() as f64 / detected;
        format!(
            "| {} | {} | {:.0} % | {} | {} | {:.0} % | {:.0} % |",
            self.kind.name(),
            self.count
                .map_or_else(|| "-".into(), |count| count.to_string()),
            percent(self.missed),
            self.false_alarms,
            if self.delays.is_empty() {
                "-".into()
            } else {
                format!("{delay:.1}")
            },
            percent(self.leaf_right),
            percent(self.side_right),
        )
    }
}

/// Runs every filter over the same simulated runs.
#[must_use]
pub fn rare_faults(planar: &Planar, nodes: &[Vec<usize>], scenario: &Scenario) -> Vec<Cell> {
    let model = planar.clone().with_rates(scenario.p_fault, 0.0);
    let runs: Vec<_> = (0..scenario.runs)
        .map(|seed| simulate(&model, scenario, seed))
        .collect();
    let mut cells = Vec::new();
    for kind in Kind::ALL {
        for count in COUNTS {
            if kind == Kind::LookAhead && count > 100
                || matches!(kind, Kind::Hierarchical | Kind::RaisedHierarchical) && count > 1_000
            {
                continue;
            }
            let mut cell = Cell {
                kind,
                count: kind.is_sampled().then_some(count),
                missed: 0,
                false_alarms: 0,
                delays: Vec::new(),
                leaf_right: 0,
                side_right: 0,
                runs: scenario.runs,
            };
            for (seed, (fault, observations)) in runs.iter().enumerate() {
                let mut filter = build::<_, 3>(kind, &model, nodes, count, seed as u64);
                judge(&mut cell, &mut *filter, *fault, observations, nodes);
            }
            cells.push(cell);
            if !kind.is_sampled() {
                break;
            }
        }
    }
    cells
}

fn judge(
    cell: &mut Cell,
    filter: &mut dyn Filter<Observation = Observation>,
    fault: usize,
    observations: &[Observation],
    nodes: &[Vec<usize>],
) {
    let mut alarm = None;
    for (t, z) in observations.iter().enumerate() {
        filter.step(z);
        if alarm.is_none() && 1.0 - filter.posterior()[0] > ALARM {
            alarm = Some(t);
        }
    }
    match alarm {
        None => cell.missed += 1,
        Some(t) if t < NOMINAL => cell.false_alarms += 1,
        Some(t) => cell.delays.push(t + 1 - NOMINAL),
    }
    let p = filter.posterior();
    let best = (0..p.len())
        .max_by(|&a, &b| p[a].total_cmp(&p[b]))
        .unwrap_or(0);
    cell.leaf_right += u64::from(best == fault);
    // Left or right for stuck wheels; an encoder for encoders.
    let node = |mode: usize| nodes.iter().position(|leaves| leaves.contains(&mode));
    cell.side_right += u64::from(node(best) == node(fault) && best != 0);
}

/// A fault and what is seen of a run with it.
fn simulate(model: &Planar, scenario: &Scenario, seed: u64) -> (usize, Vec<Observation>) {
    let mut rng = Pcg64Mcg::seed_from_u64(1_000_000 + seed);
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
            let mode = if t < NOMINAL { 0 } else { fault };
            pose = model.propagate(mode, &pose, &mut rng);
            model.measure(mode, &pose, scenario.with_wheels, &mut rng)
        })
        .collect();
    (fault, observations)
}
