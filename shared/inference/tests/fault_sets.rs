//! The belief over fault sets against brute force, and over several faults at once.
#![allow(clippy::unwrap_used, missing_docs)]

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_inference::fault_sets::{Component, FaultSets, FaultSetsError};
use vigil_inference::logspace::log_normal;

const fn component(prior: f64, birth: f64, death: f64) -> Component {
    Component {
        prior,
        birth,
        death,
    }
}

/// Bayes' rule with the whole transition matrix.
struct BruteForce {
    components: Vec<Component>,
    p: Vec<f64>,
}

impl BruteForce {
    fn transition(&self, from: usize, to: usize) -> f64 {
        let factor = |(j, c): (usize, &Component)| match (from >> j & 1, to >> j & 1) {
            (0, 0) => 1.0 - c.birth,
            (0, _) => c.birth,
            (_, 0) => c.death,
            _ => 1.0 - c.death,
        };
        self.components.iter().enumerate().map(factor).product()
    }

    fn step(&mut self, likelihood: impl Fn(usize) -> f64) -> f64 {
        let sets = self.p.len();
        let arrives = |to: usize| -> f64 {
            (0..sets)
                .map(|from| self.p[from] * self.transition(from, to))
                .sum()
        };
        let joint: Vec<f64> = (0..sets).map(|to| arrives(to) * likelihood(to)).collect();
        let evidence: f64 = joint.iter().sum();
        self.p = joint.into_iter().map(|p| p / evidence).collect();
        evidence
    }
}

#[test]
fn four_components_are_filtered_as_by_brute_force() {
    let components = [
        component(0.1, 0.02, 0.3),
        component(0.0, 0.2, 0.0),
        component(0.5, 0.01, 0.05),
        component(1.0, 0.0, 0.4),
    ];
    let mut belief = FaultSets::new(&components).unwrap();
    let mut reference = BruteForce {
        components: components.to_vec(),
        p: belief.probabilities().to_vec(),
    };
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    for _ in 0..50 {
        let log_likelihood: [f64; 16] = std::array::from_fn(|_| -8.0 * rng.random::<f64>());
        belief.predict();
        let found = belief.update(|set| log_likelihood[set as usize]).unwrap();
        let expected = reference.step(|set| log_likelihood[set].exp());
        assert!((found - expected.ln()).abs() < 1e-10);
        for (p, q) in belief.probabilities().iter().zip(&reference.p) {
            assert!((p - q).abs() < 1e-12);
        }
        let marginal: f64 = (0..16)
            .filter(|set| set >> 2 & 1 == 1)
            .map(|s| reference.p[s])
            .sum();
        assert!((belief.marginal(2) - marginal).abs() < 1e-12);
    }
}

/// Twelve components: six wheels stuck, six encoders broken.
fn wheels(birth: f64, death: f64) -> FaultSets {
    FaultSets::new(&[component(0.0, birth, death); 12]).unwrap()
}

#[test]
fn the_update_by_doubling_equals_the_one_set_by_set() {
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    let (mut doubled, mut direct) = (wheels(1e-3, 1e-2), wheels(1e-3, 1e-2));
    for _ in 0..20 {
        let body: [f64; 64] = std::array::from_fn(|_| -30.0 * rng.random::<f64>());
        let tables: [[f64; 4]; 6] =
            std::array::from_fn(|_| std::array::from_fn(|_| -20.0 * rng.random::<f64>()));
        doubled.predict();
        direct.predict();
        let found = doubled.update_wheels(&body, &tables).unwrap();
        let expected = direct.update(|set| {
            let wheel = |w: usize| {
                let (stuck, broken) = (set >> w & 1, set >> (6 + w) & 1);
                tables[w][(stuck + 2 * broken) as usize]
            };
            body[(set & 63) as usize] + (0..6).map(wheel).sum::<f64>()
        });
        assert!((found - expected.unwrap()).abs() < 1e-9);
        for (a, b) in doubled.probabilities().iter().zip(direct.probabilities()) {
            assert!((a - b).abs() < 1e-12);
        }
    }
}

/// Simulated wheel readings, 20 Hz: a turning wheel has the rate 1, a stuck one 0, a broken encoder
/// says 0; standard deviation 0.3. A stuck wheel slows the body down.
struct Rover {
    rng: Pcg64Mcg,
}

const RATE_SD: f64 = 0.3;
const TURN_SD: f64 = 0.5;

impl Rover {
    fn step(&mut self, truth: u32, belief: &mut FaultSets) {
        let mut normal = || self.rng.sample::<f64, _>(StandardNormal);
        let turn_of = |mask: u32| -> f64 {
            // Each stuck wheel turns the body by its own lever.
            (0..6)
                .map(|w| f64::from(mask >> w & 1) * (0.4 + 0.3 * f64::from(w)))
                .sum()
        };
        let turn = turn_of(truth & 63) + TURN_SD * normal();
        let body: [f64; 64] =
            std::array::from_fn(|mask| log_normal(turn - turn_of(mask as u32), TURN_SD * TURN_SD));
        let tables: [[f64; 4]; 6] = std::array::from_fn(|w| {
            let shows = truth >> w & 1 == 0 && truth >> (6 + w) & 1 == 0;
            let reading = f64::from(u8::from(shows)) + RATE_SD * normal();
            let log_p = |mean: f64| log_normal(reading - mean, RATE_SD * RATE_SD);
            [log_p(1.0), log_p(0.0), log_p(0.0), log_p(0.0)]
        });
        belief.predict();
        belief.update_wheels(&body, &tables).unwrap();
    }
}

fn best(belief: &FaultSets) -> u32 {
    let mut top = [(0, 0.0); 2];
    belief.most_probable(&mut top);
    assert!(top[0].1 >= top[1].1);
    top[0].0
}

#[test]
fn double_faults_are_named_exactly_within_five_seconds() {
    let mut right = 0;
    for seed in 0..200 {
        let mut rover = Rover {
            rng: Pcg64Mcg::seed_from_u64(seed),
        };
        let first = rover.rng.random_range(0..12);
        // Not the encoder of a stuck wheel, or the other way round: it says 0 either way.
        let second = (0..).map(|_| rover.rng.random_range(0..12));
        let second = second.into_iter().find(|b| b % 6 != first % 6).unwrap();
        let truth = 1 << first | 1 << second;
        let mut belief = wheels(1e-5, 1e-4);
        (0..40).for_each(|_| rover.step(0, &mut belief));
        assert_eq!(best(&belief), 0, "nothing is broken yet");
        (0..100).for_each(|_| rover.step(truth, &mut belief));
        right += u32::from(best(&belief) == truth);
    }
    assert!(right >= 190, "{right} of 200");
}

#[test]
fn a_wheel_that_sticks_and_frees_itself_is_followed() {
    let mut rover = Rover {
        rng: Pcg64Mcg::seed_from_u64(1),
    };
    // Birth 1e-6 per step: the belief does not forget that faults exist.
    let mut belief = wheels(1e-6, 1e-3);
    for (truth, steps) in [(0, 400), (1 << 4, 60), (0, 60), (1 << 4, 60), (0, 60)] {
        for step in 0..steps {
            rover.step(truth, &mut belief);
            // One second at 20 Hz to follow.
            assert!(
                step < 20 || best(&belief) == truth,
                "{truth} after {step} steps"
            );
        }
    }
}

#[test]
fn what_is_no_probability_is_refused() {
    assert_eq!(FaultSets::new(&[]), Err(FaultSetsError::Count(0)));
    let too_many = [component(0.0, 0.1, 0.1); 17];
    assert_eq!(FaultSets::new(&too_many), Err(FaultSetsError::Count(17)));
    let bad = FaultSets::new(&[component(0.0, 1.1, 0.1)]).unwrap_err();
    assert!(bad.to_string().contains("birth is 1.1"), "{bad}");
    assert!(FaultSets::new(&[component(f64::NAN, 0.1, 0.1)]).is_err());
}

proptest! {
    #[test]
    fn no_evidence_breaks_the_belief(
        steps in prop::collection::vec(prop::collection::vec(any::<f64>(), 9), 1..20)
    ) {
        let mut belief = FaultSets::new(&[component(0.0, 1e-6, 1e-3); 4]).unwrap();
        for values in steps {
            belief.predict();
            let before = belief.clone();
            let whole = [values[0], values[1], values[2], values[3]];
            let tables = [whole, [0.0, -1.0, -2.0, values[8]]];
            let body = [values[4], values[5], values[6], values[7]];
            if belief.update_wheels(&body, &tables).is_none() {
                prop_assert_eq!(before.probabilities(), belief.probabilities());
            }
            let _ = belief.update(|set| values[(set & 7) as usize]);
            let sum: f64 = belief.probabilities().iter().sum();
            prop_assert!((sum - 1.0).abs() < 1e-9, "{}", sum);
            prop_assert!(belief.entropy().is_finite());
        }
    }
}
