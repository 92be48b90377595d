//! What is to be driven, and what breaks.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_setup::graph_file::{DriveSegment, Simulator};

/// Metres commanded.
const LENGTH_M: f64 = 20.0;
/// Length of a segment, m; the last is what is left.
const SEGMENT_M: std::ops::Range<f64> = 2.0..5.0;
/// Curvature of a bend, 1/m, left or right.
const CURVATURE_1_M: std::ops::Range<f64> = 0.1..0.5;
/// One segment in so many is straight.
const ONE_STRAIGHT_IN: u32 = 3;
/// Speed of a segment, m/s.
const SPEED_M_S: std::ops::Range<f64> = 0.15..0.3;
/// Onset of the fault, as a share of the planned time.
const ONSET: std::ops::Range<f64> = 0.1..0.8;
/// Soil from mission to mission: as in the runs that the model was learned from.
const MODULUS: std::ops::Range<f64> = 0.18..0.22;
const FRICTION: std::ops::Range<f64> = 0.6..0.7;

const WHEELS: [&str; 6] = ["LF", "LM", "LR", "RF", "RM", "RR"];
const STEERED: [&str; 4] = ["LF", "LR", "RF", "RR"];
const BROKEN: [&str; 3] = ["zero", "frozen", "noise"];
/// What no model contains and what shows in the motion; `W` stands for a wheel, `S` for a steered
/// one.
const UNMODELLED: [&str; 10] = [
    "steer-offset-hidden:S:0.2",
    "steer-offset-hidden:S:-0.3",
    "tether:40",
    "slope:0.15",
    "slope:-0.2",
    "side-slope:0.15",
    "side-slope:-0.25",
    "brush:W:20",
    "puncture:W:0.8",
    "sinkage:W:10",
];

/// Kind of a mission.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Nothing breaks.
    Healthy,
    /// A wheel sticks.
    Stuck,
    /// An encoder breaks.
    Encoder,
    /// Something happens that no model contains.
    Unmodelled,
}

impl Kind {
    /// All, each with its share of the missions, %.
    pub const SHARES: [(Self, u32); 4] = [
        (Self::Healthy, 20),
        (Self::Stuck, 40),
        (Self::Encoder, 25),
        (Self::Unmodelled, 15),
    ];

    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Healthy => "nothing",
            Self::Stuck => "stuck wheel",
            Self::Encoder => "broken encoder",
            Self::Unmodelled => "unmodelled",
        }
    }
}

/// What breaks.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// As `--inject` takes it.
    pub spec: String,
    /// State of the decision model from then on.
    pub state: String,
    /// The wheel of a modelled fault, by name.
    pub wheel: Option<&'static str>,
    /// When, s after the start.
    pub onset_s: f64,
}

/// A mission.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Seed of everything in it.
    pub seed: u64,
    /// Soil, noise, lag.
    pub simulator: Simulator,
    /// The path.
    pub segments: Vec<DriveSegment>,
    /// Its kind.
    pub kind: Kind,
    /// What breaks, unless it is a healthy one.
    pub fault: Option<Fault>,
}

impl Plan {
    /// The mission of a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed ^ 0x4d31_5510);
        let simulator = Simulator {
            friction: rng.random_range(FRICTION),
            shear_modulus: rng.random_range(MODULUS),
            ..Simulator::default()
        };
        let segments = segments(&mut rng);
        let kind = kind(&mut rng);
        let mut plan = Self {
            seed,
            simulator,
            segments,
            kind,
            fault: None,
        };
        let onset_s = plan.duration_s() * rng.random_range(ONSET);
        plan.fault = fault(&mut rng, kind, onset_s);
        plan
    }

    /// Time that the plan takes at its own speed, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.segments.iter().map(|s| s.duration_s).sum()
    }
}

fn segments(rng: &mut Pcg64Mcg) -> Vec<DriveSegment> {
    let mut left_m = LENGTH_M;
    let mut segments = Vec::new();
    while left_m > 0.0 {
        let length_m = rng.random_range(SEGMENT_M).min(left_m);
        let speed_m_s = rng.random_range(SPEED_M_S);
        let bend_1_m = rng.random_range(CURVATURE_1_M);
        let curvature_1_m = match rng.random_range(0..2 * ONE_STRAIGHT_IN) {
            0 | 1 => 0.0,
            n if n % 2 == 0 => bend_1_m,
            _ => -bend_1_m,
        };
        segments.push(DriveSegment {
            duration_s: length_m / speed_m_s,
            curvature_1_m,
            speed_m_s,
        });
        left_m -= length_m;
    }
    segments
}

fn kind(rng: &mut Pcg64Mcg) -> Kind {
    let mut percent = rng.random_range(0..100);
    let present = Kind::SHARES.iter().find(|(_, share)| {
        let is_here = percent < *share;
        percent = percent.saturating_sub(*share);
        is_here
    });
    present.map_or(Kind::Healthy, |(kind, _)| *kind)
}

fn fault(rng: &mut Pcg64Mcg, kind: Kind, onset_s: f64) -> Option<Fault> {
    let wheel = WHEELS[rng.random_range(0..WHEELS.len())];
    let (spec, state, wheel) = match kind {
        Kind::Healthy => return None,
        Kind::Stuck => (
            format!("stuck:{wheel}"),
            format!("{wheel}_STUCK"),
            Some(wheel),
        ),
        Kind::Encoder => {
            let how = BROKEN[rng.random_range(0..BROKEN.len())];
            let spec = format!("encoder:{wheel}:{how}");
            (spec, format!("{wheel}_ENC"), Some(wheel))
        }
        Kind::Unmodelled => {
            let steered = STEERED[rng.random_range(0..STEERED.len())];
            let spec = UNMODELLED[rng.random_range(0..UNMODELLED.len())];
            let spec = spec.replace(":W:", &format!(":{wheel}:"));
            let spec = spec.replace(":S:", &format!(":{steered}:"));
            (spec, "UNKNOWN".to_owned(), None)
        }
    };
    Some(Fault {
        spec,
        state,
        wheel,
        onset_s,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::ShippedGraph;

    #[test]
    fn missions_are_as_stated_and_every_fault_is_understood() {
        let shipped = ShippedGraph::read(100.0).unwrap();
        let plans: Vec<Plan> = (0..2000).map(Plan::new).collect();
        for plan in &plans {
            let length_m: f64 = plan
                .segments
                .iter()
                .map(|s| s.duration_s * s.speed_m_s)
                .sum();
            assert!((length_m - LENGTH_M).abs() < 1e-9);
            assert_eq!(plan.fault.is_none(), plan.kind == Kind::Healthy);
            if let Some(fault) = &plan.fault {
                shipped.change(&fault.spec).unwrap();
                assert!(shipped.model().states().contains(&fault.state), "{fault:?}");
                let share = fault.onset_s / plan.duration_s();
                assert!(ONSET.contains(&share));
            }
        }
        for (kind, percent) in Kind::SHARES {
            let found = plans.iter().filter(|plan| plan.kind == kind).count() as f64;
            // Five standard deviations of a binomial share of 2000.
            let p = f64::from(percent) / 100.0;
            let sd = (2000.0 * p * (1.0 - p)).sqrt();
            assert!((found - 2000.0 * p).abs() < 5.0 * sd, "{kind:?}: {found}");
        }
        let equal = |a: &Plan, b: &Plan| a.fault == b.fault && a.segments == b.segments;
        assert!(equal(&plans[7], &Plan::new(7)) && !equal(&plans[7], &Plan::new(8)));
    }
}
