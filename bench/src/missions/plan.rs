//! What is to be driven, and what breaks.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_setup::graph_file::{DriveSegment, Simulator};

use super::breakdown::Breakdown;
use super::kind::Kind;
use crate::variation::Variation;

/// Metres of the path.
const LENGTH_M: f64 = 20.0;
/// Length of a segment, m; the last is what is left.
const SEGMENT_M: std::ops::Range<f64> = 2.0..5.0;
/// Curvature of a bend, 1/m, left or right.
const CURVATURE_1_M: std::ops::Range<f64> = 0.1..0.5;
/// One segment in so many is straight.
const ONE_STRAIGHT_IN: u32 = 3;
/// Speed of a segment, m/s.
const SPEED_M_S: std::ops::Range<f64> = 0.15..0.3;
/// Soil from mission to mission.
const MODULUS: std::ops::Range<f64> = 0.18..0.22;
const FRICTION: std::ops::Range<f64> = 0.6..0.7;
/// Seeds of one kind are so far from those of the next.
const SEEDS: u64 = 1 << 32;

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
    /// What breaks, unless nothing does.
    pub breakdown: Option<Breakdown>,
}

impl Plan {
    /// The mission of a kind and seed.
    #[must_use]
    pub fn new(kind: Kind, seed: u64) -> Self {
        let seed = seed + kind as u64 * SEEDS;
        let mut rng = Pcg64Mcg::seed_from_u64(seed ^ 0x4d31_5510);
        Self {
            seed,
            simulator: drawn_soil(&mut rng),
            segments: segments(&mut rng),
            kind,
            breakdown: Breakdown::drawn(kind, LENGTH_M, &mut rng),
        }
    }

    pub(super) fn vary(&mut self, variation: &Variation) {
        variation.change_world(&mut self.simulator);
        for segment in &mut self.segments {
            segment.speed_m_s *= variation.speed_scale();
            segment.duration_s /= variation.speed_scale();
        }
    }

    /// So many missions of every kind, from a seed on.
    #[must_use]
    pub fn of_all_kinds(per_kind: u64, first_seed: u64) -> Vec<Self> {
        let seeds = first_seed..first_seed + per_kind;
        let of_a_kind = |kind| seeds.clone().map(move |seed| Self::new(kind, seed));
        Kind::ALL.into_iter().flat_map(of_a_kind).collect()
    }
}

/// A soil like those of the runs that the model was learned from.
pub fn drawn_soil(rng: &mut Pcg64Mcg) -> Simulator {
    Simulator {
        friction: rng.random_range(FRICTION),
        shear_modulus: rng.random_range(MODULUS),
        ..Simulator::default()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::ShippedGraph;
    use crate::missions::breakdown::WHEELS;

    #[test]
    fn missions_are_as_stated_and_every_change_is_understood() {
        let shipped = ShippedGraph::read("rover.toml".as_ref(), Variation::default()).unwrap();
        let names = shipped.setup.robot.wheels.iter().map(|w| w.name.as_str());
        assert!(names.eq(WHEELS));
        for plan in shipped.plans(50, 7) {
            let lengths = plan.segments.iter().map(|s| s.duration_s * s.speed_m_s);
            assert!((lengths.sum::<f64>() - LENGTH_M).abs() < 1e-9);
            assert_eq!(plan.breakdown.is_none(), plan.kind == Kind::Nothing);
            let Some(breakdown) = &plan.breakdown else {
                continue;
            };
            assert!((2.0..16.0).contains(&breakdown.onset_m));
            let times = breakdown.steps.iter().map(|step| step.after_s);
            assert!(times.is_sorted(), "{breakdown:?}");
            assert!(!breakdown.expected.is_empty());
            for change in breakdown.steps.iter().filter_map(|s| s.change.as_ref()) {
                shipped.change(change).unwrap();
            }
        }
        let equal = |a: &Plan, b: &Plan| a.breakdown == b.breakdown && a.segments == b.segments;
        let plan = Plan::new(Kind::Two, 7);
        assert!(equal(&plan, &Plan::new(Kind::Two, 7)) && !equal(&plan, &Plan::new(Kind::Two, 8)));
    }
}
