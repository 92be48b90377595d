//! No filter and no belief update allocates in a step.
#![cfg(test)]

#[path = "../shared/inference/tests/filters/cases/mod.rs"]
#[allow(dead_code, unused_imports)] // Only two of the cases are used here.
mod cases;
#[path = "../shared/pomdp/examples/control_loop.rs"]
#[allow(dead_code)] // Its `main`.
mod control_loop;

use std::path::Path;

use cases::{HiddenMarkov, JumpLinear, PoseAndWheels};
use vigil_cycle::allocation::{CountingAllocator, allocations};
use vigil_inference::adaptive::Adaptive;
use vigil_inference::ages::Ages;
use vigil_inference::bank::{Bank, Hypothesis};
use vigil_inference::bootstrap::ParticleFilter;
use vigil_inference::constant::Constant;
use vigil_inference::filter::Filter;
use vigil_inference::hierarchical::Hierarchical;
use vigil_inference::look_ahead::LookAhead;
use vigil_inference::merged::Merged;
use vigil_inference::proposal::Proposal;
use vigil_inference::resample::Resampling;
use vigil_inference::windowed::Windowed;
use vigil_pomdp::{Evidence, Pomdp, Tracker};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

const COUNT: usize = 64;

/// The filters of a three-mode model, as the identifier builds them.
fn filters(model: &JumpLinear) -> Vec<Box<dyn Filter<Observation = PoseAndWheels>>> {
    let resampling = Resampling::default();
    let sampled =
        |proposal| ParticleFilter::new(model.clone(), proposal, resampling, COUNT, 1).unwrap();
    let hierarchical = || {
        let nodes = [vec![1, 2]];
        Hierarchical::new(model.clone(), &nodes, resampling, COUNT, 1).unwrap()
    };
    vec![
        Box::new(sampled(Proposal::prior(model).unwrap())),
        Box::new(sampled(Proposal::raised(model, 0.5).unwrap())),
        Box::new(sampled(
            Proposal::risk_raised(model, 0.5, &[1.0; 3]).unwrap(),
        )),
        Box::new(hierarchical()),
        Box::new(hierarchical().with_raised_proposals(0.5)),
        Box::new(LookAhead::<_, 3>::new(model.clone(), COUNT, 1).unwrap()),
        Box::new(Merged::<_, 3>::new(model.clone()).unwrap()),
    ]
}

#[test]
fn no_identifying_filter_allocates_in_a_step() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/filters");
    let model = JumpLinear::read(&data.join("case3_jmls3_full.json")).unwrap();
    // It begins with observations that nothing explains.
    let bad = [f64::NAN, 1e200].map(|value| PoseAndWheels {
        pose: [value; 3],
        wheels: [value; 2],
    });
    let observations: Vec<PoseAndWheels> = bad.into_iter().chain(model.observations()).collect();
    for (i, mut filter) in filters(&model).into_iter().enumerate() {
        let before = allocations();
        assert!(before > 0, "the allocator does not count");
        for z in observations.iter().cycle().take(5_000) {
            filter.step(z);
        }
        assert_eq!(allocations() - before, 0, "filter {i}");
    }
}

#[test]
fn no_adaptive_number_of_particles_allocates() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/filters");
    let hidden = HiddenMarkov::read(&data.join("case1_hmm13.json")).unwrap();
    let proposal = Proposal::prior(&hidden).unwrap();
    let adaptive = Adaptive::new(0.05, 2.33, 50, 500);
    let mut filter = ParticleFilter::new(hidden.clone(), proposal, Resampling::EVERY_STEP, 500, 1)
        .unwrap()
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
fn no_detection_filter_allocates_in_a_step() {
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

#[test]
fn no_belief_update_allocates() {
    let sharp = "discount: 0.9 states: 30 actions: 2 observations: 30\nT: 0 identity T: 1 uniform\n\
        O: 0 uniform O: 1 uniform O: 0 : 3 : * 0 O: 0 : 3 : 7 1 O: * : 4 : * 0 O: * : 4 : 9 1\n";
    // Beyond what is laid out for updates.
    let large = sharp.replace("observations: 30", "observations: 40000");
    for text in [sharp, &large] {
        let model = Pomdp::parse(text).unwrap();
        let mut tracker = Tracker::new(&model);
        let soft: Vec<f64> = (0..30).map(f64::from).collect();
        let nothing = [0.0; 30];
        let (mut taken, mut impossible) = (0, 0);
        let before = allocations();
        assert!(before > 0, "the allocator does not count");
        for step in 0..10_000_usize {
            let (mut action, mut z) = (step / 50 % 2, [9, 7, 1][step % 3]);
            if step % 100 == 0 {
                // State 4 stays, and does not show 7.
                let mut only = [0.0; 30];
                only[4] = 1.0;
                tracker.anchor(&only);
                (action, z) = (0, 7);
            }
            match tracker.update(&model, action, z) {
                Evidence::Taken(_) => taken += 1,
                Evidence::Impossible => impossible += 1,
            }
            tracker.predict(&model, 1 - step % 2);
            tracker.weigh(if step % 7 == 0 { &nothing } else { &soft });
            if step % 1000 == 0 {
                tracker.reset();
            }
        }
        assert_eq!(allocations() - before, 0);
        assert!(taken > 1000 && impossible > 10, "{taken}, {impossible}");
    }
}

#[test]
fn the_control_loop_that_others_copy_allocates_nothing() {
    let model = include_str!("../shared/pomdp/examples/gearbox.pomdp");
    let policy = include_bytes!("../shared/pomdp/examples/gearbox.policy.json");
    let mut controller = control_loop::Controller::new(model, policy).unwrap();
    let mut inspected = 0;
    let before = allocations();
    assert!(before > 0, "the allocator does not count");
    for step in 0..10_000 {
        inspected += usize::from(controller.action() == "inspect");
        controller.step(usize::from(step % 7 == 0));
    }
    assert_eq!(allocations() - before, 0);
    assert!(inspected > 1000, "{inspected}");
}
