//! Models that become hostile after their check: no value that a model returns breaks a filter.

use std::cell::Cell;

use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;
use rand_pcg::Pcg64Mcg;
use vigil_inference::adaptive::Adaptive;
use vigil_inference::bootstrap::ParticleFilter;
use vigil_inference::filter::Filter;
use vigil_inference::gaussian::Gaussian;
use vigil_inference::hierarchical::Hierarchical;
use vigil_inference::hybrid::{Conditional, Modes, Sampled};
use vigil_inference::look_ahead::LookAhead;
use vigil_inference::merged::Merged;
use vigil_inference::proposal::Proposal;
use vigil_inference::resample::Resampling;

const MODES: usize = 4;

/// Values that no model should return, and some that it may.
const VALUES: [f64; 14] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    -1.0,
    -0.0,
    0.0,
    1e-300,
    0.25,
    1.0,
    -700.0,
    1e200,
];

/// A model whose answers are sound until it is made hostile.
#[derive(Debug, Clone)]
struct Hostile {
    /// Answers to give, in turn; sound ones while there are none.
    answers: Vec<usize>,
    next: Cell<usize>,
}

impl Hostile {
    fn answer(&self, sound: f64) -> f64 {
        let Some(&answer) = self
            .answers
            .get(self.next.get() % self.answers.len().max(1))
        else {
            return sound;
        };
        self.next.set(self.next.get() + 1);
        VALUES.get(answer).copied().unwrap_or(sound)
    }
}

impl Modes for Hostile {
    fn modes(&self) -> usize {
        MODES
    }

    fn initial(&self, mode: usize) -> f64 {
        self.answer(if mode == 0 { 1.0 } else { 0.0 })
    }

    fn transition(&self, from: usize, to: usize) -> f64 {
        self.answer(if from == to { 0.7 } else { 0.1 })
    }
}

impl Sampled for Hostile {
    type State = f64;
    type Observation = f64;

    fn draw(&self, mode: usize, _rng: &mut Pcg64Mcg) -> f64 {
        self.answer(mode as f64)
    }

    fn propagate(&self, mode: usize, state: &f64, _rng: &mut Pcg64Mcg) -> f64 {
        self.answer(0.5 * state + mode as f64)
    }

    fn log_likelihood(&self, _mode: usize, state: &f64, z: &f64) -> f64 {
        self.answer(-0.5 * (z - state) * (z - state))
    }

    fn log_motion(&self, mode: usize, before: &f64, after: &f64) -> f64 {
        self.answer(-(after - 0.5 * before - mode as f64).abs())
    }

    fn locate(&self, _mode: usize, z: &f64, _rng: &mut Pcg64Mcg) -> Option<f64> {
        Some(self.answer(*z))
    }

    fn cell(&self, state: &f64) -> u64 {
        state.to_bits()
    }
}

impl Conditional<1> for Hostile {
    type Observation = f64;

    fn prior(&self, mode: usize) -> Gaussian<1> {
        Gaussian {
            mean: SVector::from([self.answer(mode as f64)]),
            covariance: SMatrix::from([[self.answer(1.0)]]),
        }
    }

    fn enter(&self, _from: usize, _to: usize, state: &mut Gaussian<1>) {
        state.mean[0] = self.answer(state.mean[0]);
    }

    fn predict(&self, mode: usize, state: &mut Gaussian<1>) {
        let shift = SVector::from([self.answer(mode as f64)]);
        let noise = SMatrix::from([[self.answer(0.1)]]);
        state.predict(&SMatrix::identity(), &shift, &noise);
    }

    fn update(&self, _mode: usize, state: &mut Gaussian<1>, z: &f64) -> Option<f64> {
        let innovation = SVector::from([self.answer(z - state.mean[0])]);
        let noise = SMatrix::from([[self.answer(1.0)]]);
        let log_likelihood = state.update(&innovation, &SMatrix::identity(), &noise)?;
        Some(self.answer(log_likelihood))
    }
}

/// Each filter with the number of its particles or modes, hostile from the next step on.
fn filters(answers: &[usize]) -> Vec<Box<dyn Filter<Observation = f64>>> {
    let sound = Hostile {
        answers: Vec::new(),
        next: Cell::new(0),
    };
    let hostile = || answers.to_vec();
    let resampling = Resampling::default();
    let sampled = |proposal| {
        let mut filter = ParticleFilter::new(sound.clone(), proposal, resampling, 20, 1).unwrap();
        filter.model_mut().answers = hostile();
        filter
    };
    let raised = || Proposal::raised(&sound, 0.5).unwrap();
    let risky = Proposal::risk_raised(&sound, 0.5, &[1.0, 9.0, 3.0, 1e-3]).unwrap();
    let hierarchical = || {
        let nodes = [vec![1, 2], vec![1, 2, 3]];
        Hierarchical::new(sound.clone(), &nodes, resampling, 20, 1).unwrap()
    };
    let mut plain = hierarchical();
    plain.model_mut().answers = hostile();
    let mut paid = hierarchical().with_raised_proposals(0.5);
    paid.model_mut().answers = hostile();
    let mut ahead = LookAhead::<_, 1>::new(sound.clone(), 10, 1).unwrap();
    ahead.model_mut().answers = hostile();
    let mut merged = Merged::<_, 1>::new(sound.clone()).unwrap();
    merged.model_mut().answers = hostile();
    vec![
        Box::new(sampled(Proposal::prior(&sound).unwrap())),
        Box::new(sampled(raised())),
        Box::new(sampled(risky)),
        Box::new(sampled(raised()).with_adaptive_count(Adaptive::new(0.05, 2.33, 5, 20))),
        Box::new(plain),
        Box::new(paid),
        Box::new(ahead),
        Box::new(merged),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// The filters' own assertions are the check; beyond these the belief stays a distribution.
    #[test]
    fn no_answer_of_a_model_breaks_a_filter(
        // Above the number of values the answer is sound.
        answers in prop::collection::vec(0..3 * VALUES.len(), 1..200),
        observations in prop::collection::vec(-3.0..3.0_f64, 1..12),
    ) {
        for mut filter in filters(&answers) {
            for z in &observations {
                filter.step(z);
                let p = filter.posterior();
                prop_assert!(p.iter().all(|p| (0.0..=1.0).contains(p)), "{p:?}");
                prop_assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-5, "{p:?}");
            }
            filter.reset();
            filter.step(&0.0);
        }
    }
}
