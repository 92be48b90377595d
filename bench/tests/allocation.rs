//! The filters that are measured allocate nothing in a step.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use vigil_bench::filters::{Kind, build};
use vigil_bench::naive::Naive;
use vigil_cycle::allocation::{CountingAllocator, allocations};
use vigil_evaluation::cases::{HiddenMarkov, JumpLinear, Planar};
use vigil_inference::adaptive::Adaptive;
use vigil_inference::ages::Ages;
use vigil_inference::bank::{Bank, Hypothesis};
use vigil_inference::bootstrap::ParticleFilter;
use vigil_inference::constant::Constant;
use vigil_inference::fault_sets::{Component, FaultSets};
use vigil_inference::filter::Filter;
use vigil_inference::forward::Forward;
use vigil_inference::lanes::linear::{LaneLookAhead, Observation};
use vigil_inference::lanes::{Event, LaneFilter, Level, PlanarModel};
use vigil_inference::windowed::Windowed;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

#[test]
fn a_hundred_thousand_steps_allocate_nothing() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/filters");
    let (Planar { parameters }, observations) = Planar::read(&data).unwrap();
    let model = PlanarModel::new(&parameters).unwrap();
    for level in Level::ALL.into_iter().filter(|level| level.is_available()) {
        for share in [1.0, 0.5] {
            let filter = LaneFilter::new(model.clone(), 64, 1).at_level(level);
            let mut filter = filter.unwrap().resampling_below(share);
            let mut events = 0;
            let before = allocations();
            assert!(before > 0, "the allocator does not count");
            for z in observations.iter().cycle().take(100_000) {
                // Each round begins with a jump back: the ways out are taken too.
                events += u32::from(filter.step(z).event >= Some(Event::Redone));
            }
            assert_eq!(allocations() - before, 0);
            assert!(events > 10, "{events}");
        }
    }
    let mut naive = Naive::new(&parameters, 64, 1).unwrap();
    let before = allocations();
    for z in observations.iter().cycle().take(1_000) {
        naive.step(z);
    }
    assert_eq!(allocations() - before, 0);
}

#[test]
fn no_filter_allocates_in_a_step() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/filters");
    let hidden = HiddenMarkov::read(&data.join("case1_hmm13.json")).unwrap();
    let jump = JumpLinear::read(&data.join("case3_jmls3_full.json")).unwrap();
    let observations: Vec<_> = jump.observations().collect();
    let nodes = [vec![1, 2, 3], vec![4, 5, 6], (7..13).collect()];
    for kind in Kind::ALL {
        // Hundreds of Kalman filters a step take their time.
        let steps = if kind == Kind::Sequences {
            5_000
        } else {
            100_000
        };
        let mut filter = build::<_, 0>(kind, &hidden, (&nodes, &[1.0; 13]), 64, 1);
        let before = allocations();
        // It begins with observations that nothing explains.
        for z in [[f64::NAN; 6], [1e200; 6]]
            .iter()
            .chain(hidden.observations.iter().cycle())
            .take(steps)
        {
            filter.step(z);
        }
        assert_eq!(allocations() - before, 0, "{}", kind.name());
        let mut filter = build::<_, 3>(kind, &jump, (&[vec![1, 2]], &[1.0; 3]), 64, 1);
        let before = allocations();
        for z in observations.iter().cycle().take(1_000) {
            filter.step(z);
        }
        assert_eq!(allocations() - before, 0, "{}", kind.name());
    }
    let proposal = vigil_inference::proposal::Proposal::prior(&hidden);
    let adaptive = Adaptive::new(0.05, 2.33, 50, 500);
    let resampling = vigil_inference::resample::Resampling::EVERY_STEP;
    let mut filter = ParticleFilter::new(hidden.clone(), proposal, resampling, 500, 1)
        .with_adaptive_count(adaptive);
    let (before, mut fewest) = (allocations(), 500);
    for z in hidden.observations.iter().cycle().take(5_000) {
        filter.step(z);
        fewest = fewest.min(filter.count());
    }
    assert_eq!(allocations() - before, 0);
    assert!(fewest < 100, "{fewest} particles at the least");
}

#[test]
fn the_look_ahead_filter_on_lanes_allocates_nothing() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/filters");
    let jump = JumpLinear::read(&data.join("case3_jmls3_full.json")).unwrap();
    let mut observations: Vec<Observation<3, 2>> = jump.observations().map(Into::into).collect();
    // The ways out are taken too; each round begins with a jump back.
    observations.push(Observation::MISSING);
    observations[3].state[1] = f64::NAN;
    observations[5].state[0] = 1e200;
    for level in Level::ALL.into_iter().filter(|level| level.is_available()) {
        let filter = LaneLookAhead::new(jump.linear_model().unwrap(), 64, 1);
        let mut filter = filter.at_level(level).unwrap();
        let (before, mut events) = (allocations(), 0);
        for z in observations.iter().cycle().take(100_000) {
            events += u32::from(filter.step(z).event.is_some());
        }
        assert_eq!(allocations() - before, 0);
        assert!(events > 10_000, "{events}");
    }
}

#[test]
fn no_detection_filter_and_no_exact_one_allocates_in_a_step() {
    let component = Component {
        prior: 0.0,
        birth: 1e-4,
        death: 1e-3,
    };
    let mut sets = FaultSets::new(&[component; 4]).unwrap();
    let mut forward = Forward::<3>::at(0);
    let transition = [[0.98, 0.01, 0.01], [0.1, 0.9, 0.0], [0.1, 0.0, 0.9]];
    let mut bank = Bank::new(&[1, 8]);
    bank.restart(0, 0, ());
    let (mut ages, mut constant) = (Ages::<3>::new(1.0), Constant::default());
    let mut windowed = Windowed::<3, 10>::default();
    let before = allocations();
    for step in 0..100_000_u64 {
        // Quiet, then off, then garbage, again and again.
        let value = [0.1, 2.0, f64::NAN][(step / 50 % 3) as usize];
        let residual = [value, -value, 0.5].into();
        ages.step(&residual, 1e-6);
        constant.step(value * value, 5.0, 1e-6, 1e-9);
        windowed.step(&residual, 5.0, 1e-6, 1e-9);
        forward.predict(&transition);
        forward.update(&[0.0, value, -value]);
        sets.predict();
        sets.update_wheels(&[0.0, value, 0.0, -1.0], &[[0.0, value, -1.0, -2.0]; 2]);
        bank.add(Hypothesis {
            mode: 1,
            onset: step,
            log_weight: -5.0,
            state: (),
        });
        for hypothesis in bank.hypotheses_mut() {
            hypothesis.log_weight += value;
        }
        bank.normalise(-30.0);
    }
    assert_eq!(allocations() - before, 0);
}
